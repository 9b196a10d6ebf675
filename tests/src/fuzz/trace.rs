//! The passive decoder on arbitrary frames.

use core::time::Duration;

use canopen_master::trace::{Kind, MAX_KEPT, Tracer};
use canopen_master::{Frame, NodeId};
use embedded_can::{ExtendedId, Id, StandardId};

use super::Input;

/// Identifiers of services that talk to each other, for a start: two nodes and two buses.
const IDS: [u16; 16] = [
    0x000, 0x080, 0x081, 0x100, 0x101, 0x181, 0x201, 0x281, 0x581, 0x601, 0x582, 0x602, 0x701, 0x702, 0x7E4,
    0x7E5,
];

/// A frame is a byte that says which, its length, and the data. Whatever comes, transfers are
/// counted once and no frame belongs to two.
pub fn trace(data: &[u8]) {
    let mut input = Input(data);
    let mut tracer = Tracer::new();
    tracer.set_can_link(input.u8() & 1 != 0);
    let (mut sdo_frames, mut told) = (0_u64, 0_u64);
    let mut now = Duration::ZERO;
    while !input.is_empty() {
        let which = input.u8();
        let bus = u16::from(which >> 7);
        let id = match which & 0x7F {
            which @ 0..=0x5F => Id::Standard(StandardId::new(IDS[usize::from(which) % 16]).expect("11 bits")),
            0x60..=0x6F => Id::Standard(StandardId::new(input.u16() & 0x7FF).expect("11 bits")),
            _ => Id::Extended(ExtendedId::new(u32::from(input.u16())).expect("29 bits")),
        };
        let len = input.u8();
        let frame = if len & 0x10 != 0 {
            Frame::remote_frame(id, usize::from(len & 0x0F).min(8))
        } else {
            Frame::data_frame(id, input.bytes(if len & 0x20 != 0 { 8 } else { (len & 0x0F).min(8) }))
        };
        let Some(frame) = frame else { continue };
        now += Duration::from_micros(u64::from(len));
        let looked = tracer.look(bus, &frame);
        let kind = tracer.handle_frame((len & 0x40 == 0).then_some(now), bus, &frame);
        assert_eq!(core::mem::discriminant(&looked), core::mem::discriminant(&kind));
        let _ = tracer.mapped(bus, &kind, frame.data()).count();
        let sdo = matches!(kind, Kind::SdoRequest(_) | Kind::SdoResponse(_) | Kind::SdoAbort(_));
        sdo_frames += u64::from(sdo);
        told += ended(&mut tracer);
        assert!(told <= sdo_frames, "a frame belongs to two transfers");
    }
    tracer.finish();
    told += ended(&mut tracer);
    assert!(told <= sdo_frames, "a frame belongs to two transfers");
    tracer.finish();
    assert_eq!(ended(&mut tracer), 0, "a transfer ends twice");
    NodeId::all().for_each(|node| _ = tracer.state(0, node));
}

/// Frames of the transfers that have ended.
fn ended(tracer: &mut Tracer) -> u64 {
    let mut frames = 0;
    while let Some(transfer) = tracer.poll_event() {
        assert!(transfer.frames >= 1);
        assert!(transfer.data.len() as u64 == transfer.size || transfer.data.len() == MAX_KEPT);
        frames += transfer.frames;
    }
    frames
}
