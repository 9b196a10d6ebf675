//! A whole virtual node in the place of the recorded one.

use core::time::Duration;
use std::collections::BTreeMap;

use canopen_master::NodeId;
use device_sim::can::Node;
use motion_io::capture::{Frame, FrameKind};
use pdo::Frame as OnBus;

/// What a node said, by identifier, in order; of error control, states that repeat count once.
pub type Said = BTreeMap<u16, Vec<Vec<u8>>>;

/// Whether a frame of the bus comes from the node, by the predefined connection set.
fn is_of(node: NodeId, frame: &Frame) -> bool {
    let base = (frame.id as u16).checked_sub(u16::from(node.raw()));
    !frame.extended
        && frame.kind == FrameKind::Data
        && matches!(base, Some(0x80 | 0x180 | 0x280 | 0x380 | 0x480 | 0x580 | 0x700))
}

fn add(said: &mut Said, node: NodeId, id: u16, data: &[u8]) {
    let list = said.entry(id).or_default();
    let error_control = id == 0x700 + u16::from(node.raw());
    if !(error_control && list.last().is_some_and(|last| last == data)) {
        list.push(data.to_vec());
    }
}

/// What the recorded node said.
#[must_use]
pub fn recorded(node: NodeId, frames: &[(Duration, Frame)]) -> Said {
    let mut said = Said::new();
    for (_, frame) in frames.iter().filter(|(_, frame)| is_of(node, frame)) {
        add(&mut said, node, frame.id as u16, frame.data());
    }
    said
}

/// What our node says to the frames of the others, at their recorded times.
pub fn replayed(mut ours: impl Node, node: NodeId, frames: &[(Duration, Frame)]) -> Said {
    let mut said = Said::new();
    let Some((start, _)) = frames.first() else { return said };
    let mut poll = |ours: &mut dyn Node, now| {
        while let Some(frame) = ours.poll_transmit(now) {
            if let Some(id) = frame.standard_id() {
                add(&mut said, node, id, frame.data());
            }
        }
    };
    let mut now = Duration::ZERO;
    poll(&mut ours, now);
    for (time, frame) in frames.iter().filter(|(_, frame)| !is_of(node, frame)) {
        let at = time.saturating_sub(*start);
        while let Some(due) = ours.poll_timeout().filter(|due| *due <= at) {
            now = now.max(due);
            ours.handle_timeout(now);
            poll(&mut ours, now);
        }
        now = at;
        if let Some(frame) = OnBus::from_can(frame) {
            ours.handle_frame(now, &frame);
        }
        poll(&mut ours, now);
    }
    said
}
