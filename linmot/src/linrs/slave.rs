//! The drive's side of LinRS.

use core::time::Duration;

use super::frame::{Checksum, Decoder, MAX_FRAME, Message};
use super::message;
use crate::code::Status;
use crate::drive::{Drive, Service};
use crate::request::{Reply, Request};
use crate::upid::Upid;

/// Silence that ends a frame which has begun (project-defined).
const GAP: Duration = Duration::from_millis(50);

/// Answers LinRS for a [`Drive`].
///
/// - Input: [`handle_bytes`](Self::handle_bytes), [`handle_timeout`](Self::handle_timeout).
/// - Output: [`poll_transmit`](Self::poll_transmit), [`poll_timeout`](Self::poll_timeout).
///
/// A command that goes on (writing flash, starting the software) is answered when it has ended.
#[derive(Debug, Clone)]
pub struct Slave {
    id: u8,
    checksum: Checksum,
    decoder: Decoder,
    service: Service,
    /// Carried out, but it goes on.
    running: Option<(Request, Reply)>,
    silence: Option<Duration>,
    tx: [u8; MAX_FRAME],
    tx_len: usize,
    away: bool,
}

impl Slave {
    /// The drive with this ID. After each of its restarts the checksum is what its parameter says.
    #[must_use]
    pub const fn new(id: u8, checksum: Checksum) -> Self {
        Self {
            id,
            checksum,
            decoder: Decoder::new(checksum),
            service: Service::new(),
            running: None,
            silence: None,
            tx: [0; MAX_FRAME],
            tx_len: 0,
            away: false,
        }
    }

    /// The checksum that the drive's UPID 2080h says; `None` if it has none.
    pub fn checksum(drive: &impl Drive) -> Option<Checksum> {
        drive.parameter(Checksum::UPID)?;
        Checksum::from_raw(drive.ram(Checksum::UPID))
    }

    /// Takes received bytes in any chunking.
    pub fn handle_bytes(&mut self, now: Duration, mut bytes: &[u8], drive: &mut impl Drive) {
        self.handle_timeout(now, drive);
        if drive.is_restarting(now) {
            return;
        }
        if !bytes.is_empty() {
            self.silence = Some(now.saturating_add(GAP));
        }
        loop {
            let (taken, found) = self.decoder.decode(bytes);
            bytes = bytes.get(taken..).unwrap_or(&[]);
            match found {
                Some(found) if found.id == self.id => self.serve(now, &found, drive),
                Some(_) => {}
                None => break,
            }
        }
        if !self.decoder.in_frame() {
            self.silence = None;
        }
    }

    /// Answers what has ended, and ends frames that the line fell silent in.
    pub fn handle_timeout(&mut self, now: Duration, drive: &mut impl Drive) {
        if drive.is_restarting(now) {
            self.away = true;
        } else if core::mem::take(&mut self.away) {
            *self = Self::new(self.id, Self::checksum(drive).unwrap_or(self.checksum));
        }
        if let Some((request, reply)) = self.running
            && !drive.is_busy(now)
        {
            self.running = None;
            self.answer(&request, &Reply { status: Status::OK, ..reply }, drive);
        }
        if self.silence.is_some_and(|silence| now >= silence) {
            self.silence = None;
            while self.decoder.in_frame() {
                self.decoder.gap();
                while let (_, Some(found)) = self.decoder.decode(&[]) {
                    if found.id == self.id {
                        self.serve(now, &found, drive);
                    }
                }
            }
        }
    }

    /// When to call [`handle_timeout`](Self::handle_timeout).
    #[must_use]
    pub fn poll_timeout(&self, drive: &impl Drive) -> Option<Duration> {
        let running = if self.running.is_some() { drive.poll_timeout() } else { None };
        [running, self.silence].into_iter().flatten().min()
    }

    /// The bytes to send now, once.
    pub fn poll_transmit(&mut self, _now: Duration) -> Option<&[u8]> {
        match core::mem::take(&mut self.tx_len) {
            0 => None,
            len => self.tx.get(..len),
        }
    }

    fn serve(&mut self, now: Duration, found: &Message, drive: &mut impl Drive) {
        // Address usage and type are told by LinRS only.
        if let (0x05, sub @ (0x03 | 0x04), &[low, high, ..]) = (found.main, found.sub, found.data()) {
            let upid = u16::from_le_bytes([low, high]);
            let (status, value) = match drive.parameter(Upid(upid)) {
                Some(parameter) if sub == 0x03 => (Status::OK, parameter.usage.0),
                Some(parameter) => (Status::OK, parameter.kind.0.into()),
                None => (Status::UPID, 0),
            };
            let ([a, b], [c, d]) = (upid.to_le_bytes(), value.to_le_bytes());
            return self.send(&Message::new(self.id, 0x50 | sub, 0, &[status.0, a, b, c, d, 0, 0]));
        }
        let Some(request) = message::request(found) else { return };
        let reply = self.service.execute(now, &request, drive);
        if reply.status == Status::RUNNING {
            self.running = Some((request, reply));
        } else {
            self.answer(&request, &reply, drive);
        }
    }

    fn answer(&mut self, request: &Request, reply: &Reply, drive: &impl Drive) {
        let text = match request {
            Request::ErrorText { code, .. } => drive.error_text(*code),
            _ => &[],
        };
        self.send(&message::response(self.id, request, reply, text));
    }

    fn send(&mut self, message: &Message) {
        self.tx_len = message.encode(self.checksum, &mut self.tx);
    }
}
