//! A program on a bus of a socketcand server.

use core::time::Duration;
use std::collections::VecDeque;
use std::io;
use std::time::Instant;

use pdo::Frame;

use super::super::{BusError, BusEvent, BusState, CanPort, Event};
use super::{Messages, parse_frame, send_message};
use crate::port::Port;

/// Longest wait for each step of the greeting.
const ANSWER: Duration = Duration::from_secs(3);
/// Error classes of Linux that `< error … >` carries.
const CLASS_TX_TIMEOUT: u32 = 0x01;
const CLASS_CONTROLLER: u32 = 0x04;
const CLASS_PROTOCOL: u32 = 0x08;
const CLASS_TRANSCEIVER: u32 = 0x10;
const CLASS_ACK: u32 = 0x20;
const CLASS_BUS_OFF: u32 = 0x40;
const CLASS_RESTARTED: u32 = 0x100;

pub(in super::super) struct Client {
    port: Box<dyn Port>,
    messages: Messages,
    start: Instant,
    received: VecDeque<String>,
}

impl Client {
    /// Opens a bus in raw mode.
    pub(in super::super) fn new(port: Box<dyn Port>, bus: &str) -> io::Result<Self> {
        let start = Instant::now();
        let mut client = Self { port, messages: Messages::default(), start, received: VecDeque::new() };
        client.expect("hi", "no greeting: not a socketcand server")?;
        client.port.send(format!("< open {bus} >").as_bytes())?;
        client.expect("ok", &format!("the server does not open the bus {bus:?}"))?;
        client.port.send(b"< rawmode >")?;
        client.expect("ok", "the server has no raw mode")?;
        Ok(client)
    }

    fn expect(&mut self, answer: &str, otherwise: &str) -> io::Result<()> {
        let end = self.start.elapsed() + ANSWER;
        while self.received.is_empty() && self.start.elapsed() < end {
            let left = end.saturating_sub(self.start.elapsed());
            self.fill(left)?;
        }
        match self.received.pop_front() {
            Some(message) if message == answer => Ok(()),
            Some(message) => Err(io::Error::other(format!("{otherwise}: {message:?} came"))),
            None => Err(io::Error::new(io::ErrorKind::TimedOut, otherwise.to_owned())),
        }
    }

    fn fill(&mut self, timeout: Duration) -> io::Result<()> {
        let mut buffer = [0; 2048];
        let len = self.port.receive(&mut buffer, timeout)?;
        for &byte in buffer.get(..len).unwrap_or(&[]) {
            if let Some(message) = self.messages.push(byte) {
                self.received.push_back(message);
            }
        }
        Ok(())
    }
}

/// What a message says; `None` for those that concern nobody.
fn event(message: &str) -> Option<Event> {
    let mut words = message.split_whitespace();
    match words.next()? {
        "frame" => parse_frame(words, false).map(|(frame, _)| Event::Frame(frame)),
        "rtr" => parse_frame(words, true).map(|(frame, _)| Event::Frame(frame)),
        // The class bits of Linux' error frames, whose details the protocol leaves out.
        "error" => {
            let class = u32::from_str_radix(words.next()?, 16).ok()?;
            let has = |bit| class & bit != 0;
            Some(Event::Bus(if has(CLASS_BUS_OFF) {
                BusEvent::State(BusState::Off)
            } else if has(CLASS_RESTARTED) {
                BusEvent::State(BusState::Active)
            } else if has(CLASS_ACK) {
                BusEvent::Error(BusError::NoAcknowledge)
            } else if has(CLASS_PROTOCOL) {
                BusEvent::Error(BusError::Protocol)
            } else if has(CLASS_TRANSCEIVER) {
                BusEvent::Error(BusError::Transceiver)
            } else if has(CLASS_TX_TIMEOUT) {
                BusEvent::Error(BusError::TransmitTimeout)
            } else if has(CLASS_CONTROLLER) {
                BusEvent::State(BusState::Warning)
            } else {
                BusEvent::Error(BusError::Unspecified)
            }))
        }
        _ => None,
    }
}

impl CanPort for Client {
    fn send(&mut self, frame: &Frame) -> io::Result<()> {
        self.port.send(send_message(frame).as_bytes())
    }

    fn receive(&mut self, timeout: Duration) -> io::Result<Option<Event>> {
        let end = self.start.elapsed().saturating_add(timeout);
        loop {
            while let Some(message) = self.received.pop_front() {
                if let Some(event) = event(&message) {
                    return Ok(Some(event));
                }
            }
            let left = end.saturating_sub(self.start.elapsed());
            self.fill(left)?;
            if self.received.is_empty() && self.start.elapsed() >= end {
                return Ok(None);
            }
        }
    }
}
