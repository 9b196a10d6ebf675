//! Process data and CAN Link channels of `run`: what the program sends is set up, what comes is told.

use core::time::Duration;

use can_link::{Channel, Event, Role as ChannelRole, Setting};
use motion_core::Controller;
use motion_core::bus::{CanBus, Kind, OBJECTS, Role};
use motion_core::storage::Storage;
use pdo::Payload;

use super::report::Report;
use super::step::{Action, Step};
use crate::can::value::hex;
use crate::exit::Exit;

/// Sets the channels up: those that the program sends on, and all others to receive. What it sends must
/// be there to be sent with.
pub(super) fn set_up<S: Storage>(
    controller: &mut Controller<S, Vec<u8>>,
    steps: &[Step],
) -> Result<(), Exit> {
    for at in 0..2 {
        if let Some(link) = controller.bus(at).and_then(CanBus::link) {
            for channel in Channel::all() {
                // A channel of its default identifier and any length can always be received.
                let _ = link.set(channel, Setting::RECEIVE);
            }
        }
    }
    for step in steps {
        let Some(bus) = step.bus else { continue };
        let wrong = |what| Exit::usage(format!("{}: {what}", step.words()));
        let Some(can) = controller.bus(bus.at()) else { continue };
        match step.action {
            Action::Write => {
                let outputs = can.settings().outputs;
                let place = usize::from(step.object.unwrap_or(0)).wrapping_sub(1);
                match outputs.get(place).copied().flatten() {
                    Some(object) if can.role() != Role::Link && object.kind != Kind::Axis => {}
                    _ => {
                        let what =
                            "an object OUT of type Digital, Analogue or Other on a CANopen bus expected";
                        return Err(wrong(what.into()));
                    }
                }
            }
            Action::Send => {
                let Some(link) = can.link() else {
                    return Err(wrong(format!("[{:03}] CAN Link = Yes expected", 302 + bus.at())));
                };
                let role = ChannelRole::Transmit(step.trigger()?);
                link.set(step.channel()?, Setting { role, ..Setting::OFF })
                    .map_err(|error| wrong(error.to_string()))?;
            }
            _ => {}
        }
    }
    Ok(())
}

/// What was told of one bus.
#[derive(Default)]
pub(super) struct Told {
    inputs: [Option<Payload>; OBJECTS],
    channels: [Option<Vec<u8>>; 14],
    conflicts: u16,
}

impl Told {
    /// Tells what is new: changed data of objects IN, axes apart, and of channels, and conflicts.
    pub(super) fn tell(&mut self, report: &Report<'_>, now: Duration, at: usize, bus: &mut CanBus) {
        let inputs = bus.settings().inputs;
        for ((number, object), told) in (1..).zip(inputs).zip(&mut self.inputs) {
            let Some(object) = object.filter(|object| object.kind != Kind::Axis) else { continue };
            if !bus.image().take_new(number) {
                continue;
            }
            let data = bus.image().input(number);
            if core::mem::replace(told, data) != data
                && let Some(data) = data
            {
                let bytes = hex(data.bytes().get(..usize::from(data.len())).unwrap_or(&[]));
                report.object(now, at, number, object.node.raw(), &bytes);
            }
        }
        while let Some(event) = bus.link().and_then(can_link::Link::poll_event) {
            match event {
                Event::Received(channel) => {
                    let received = bus.link().and_then(|link| link.read(now, channel));
                    let Some(received) = received else { continue };
                    let told = &mut self.channels[usize::from(channel.number()) - 1];
                    if told.as_deref() != Some(received.data()) {
                        *told = Some(received.data().to_vec());
                        report.channel(now, at, channel.number(), &hex(received.data()));
                    }
                }
                Event::Conflict(channel) => {
                    let bit = 1 << (channel.number() - 1);
                    if self.conflicts & bit == 0 {
                        report.conflict(now, at, channel.number());
                    }
                    self.conflicts |= bit;
                }
                // Channels of any length.
                _ => {}
            }
        }
    }
}
