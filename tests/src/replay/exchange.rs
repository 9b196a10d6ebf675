//! The SDO exchanges of a capture, each with its frames.

use core::time::Duration;
use std::collections::HashMap;
use std::io::Read;

use canopen_master::NodeId;
use canopen_master::trace::{Kind, Outcome, Tracer, Transfer, Way};
use motion_io::capture::{self, Capture, CaptureError, Frame, Item};

/// A frame of an exchange.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Message {
    /// When.
    pub time: Duration,
    /// From client or server.
    pub way: Way,
    /// Its data.
    pub data: Vec<u8>,
}

/// One SDO transfer and the frames that it was made of.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Exchange {
    /// What it came to.
    pub transfer: Transfer,
    /// In the order of the bus.
    pub messages: Vec<Message>,
}

/// What a capture holds.
#[derive(Debug, Default)]
pub struct Recording {
    /// All classic frames that are no loop-back copies, with their times.
    pub frames: Vec<(Duration, Frame)>,
    /// Its SDO exchanges, in the order in which they end.
    pub exchanges: Vec<Exchange>,
    /// SDO frames that belong to no exchange: answers whose request is not in the capture, damage.
    pub strays: usize,
}

/// Reads a capture whole.
///
/// # Errors
/// [`CaptureError`]; a capture of a serial line is none of a bus and gives an empty recording.
pub fn read(source: impl Read) -> Result<Recording, CaptureError> {
    let mut recording = Recording::default();
    let Capture::Can(mut reader) = capture::open(source)? else { return Ok(recording) };
    let mut sorter = Sorter::default();
    while let Some(item) = reader.next()? {
        let Item::Frame(record) = item else { continue };
        let (Some(frame), false) = (record.frame.classic(), record.loopback) else { continue };
        let time = record.time.map_or(Duration::ZERO, capture::Time::since_zero);
        recording.frames.push((time, *frame));
        sorter.frame(time, record.bus.map_or(0, |bus| bus.0), frame, &mut recording);
    }
    sorter.tracer.finish();
    sorter.take_events(&mut recording, None);
    recording.strays += sorter.open.values().map(Vec::len).sum::<usize>();
    Ok(recording)
}

#[derive(Default)]
struct Sorter {
    tracer: Tracer,
    /// Frames of the transfer that is under way, and strays before it.
    open: HashMap<(u16, NodeId), Vec<Message>>,
}

impl Sorter {
    fn frame(&mut self, time: Duration, bus: u16, frame: &Frame, recording: &mut Recording) {
        let kind = self.tracer.handle_frame(Some(time), bus, frame);
        let (Kind::SdoRequest(sdo) | Kind::SdoResponse(sdo) | Kind::SdoAbort(sdo)) = kind else { return };
        let message = Message { time, way: sdo.way, data: frame.data().to_vec() };
        self.open.entry((bus, sdo.node)).or_default().push(message);
        self.take_events(recording, Some((bus, sdo.node)));
    }

    /// `current`: the channel whose last frame may have begun another transfer.
    fn take_events(&mut self, recording: &mut Recording, current: Option<(u16, NodeId)>) {
        while let Some(transfer) = self.tracer.poll_event() {
            let channel = (transfer.bus, transfer.node);
            let Some(messages) = self.open.get_mut(&channel) else { continue };
            // A transfer that was replaced ended with the frame before.
            let replaced = current == Some(channel) && transfer.outcome == Outcome::Incomplete;
            let end = messages.len() - usize::from(replaced);
            let begin = end.saturating_sub(transfer.frames as usize);
            recording.strays += begin;
            if transfer.late {
                recording.strays += messages.drain(..end).skip(begin).count();
                continue;
            }
            let of_transfer: Vec<_> = messages.drain(..end).skip(begin).collect();
            recording.exchanges.push(Exchange { transfer, messages: of_transfer });
        }
    }
}
