//! CAN 1 and CAN 2: frames both ways.

use core::time::Duration;

use embedded_can::{ExtendedId, Id, StandardId};
use motion_core::bus::CanBus;
use pdo::Frame;

use crate::controller::Controller;

/// A classic CAN frame.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[repr(C)]
pub struct CanFrame {
    /// 11 or 29 bits.
    pub id: u32,
    /// A 29-bit identifier.
    pub extended: bool,
    /// A remote frame.
    pub remote: bool,
    /// Bytes, 0…8.
    pub len: u8,
    /// The first `len` of them count.
    pub data: [u8; 8],
}

impl CanFrame {
    fn read(&self) -> Option<Frame> {
        let id: Id = if self.extended {
            ExtendedId::new(self.id)?.into()
        } else {
            StandardId::new(u16::try_from(self.id).ok()?)?.into()
        };
        let data = self.data.get(..usize::from(self.len))?;
        if self.remote { Frame::remote_frame(id, data.len()) } else { Frame::data_frame(id, data) }
    }

    fn new(frame: &Frame) -> Self {
        let (id, extended) = match frame.id() {
            Id::Standard(id) => (u32::from(id.as_raw()), false),
            Id::Extended(id) => (id.as_raw(), true),
        };
        let mut data = [0; 8];
        data.iter_mut().zip(frame.data()).for_each(|(to, from)| *to = *from);
        Self { id, extended, remote: frame.is_remote(), len: frame.len() as u8, data }
    }
}

/// The bus with a number 1 or 2.
///
/// # Safety
/// `controller` is null or from `motion_controller_new`.
unsafe fn bus<'a>(controller: *mut Controller, number: u8) -> Option<&'a mut CanBus> {
    // SAFETY: null or valid, by the caller's promise.
    unsafe { controller.as_mut() }?.0.bus(usize::from(number).checked_sub(1)?)
}

/// Gives a frame that came on CAN 1 or 2 at `now` (µs) to the controller. False if there is no such bus
/// or the frame is none: a length above 8, an identifier out of range.
///
/// # Safety
/// `controller` is null or from `motion_controller_new`; `frame` is null or valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motion_can_receive(
    controller: *mut Controller,
    number: u8,
    now: u64,
    frame: *const CanFrame,
) -> bool {
    // SAFETY: as the caller promises for both pointers.
    let (bus, frame) = unsafe { (bus(controller, number), frame.as_ref()) };
    let (Some(bus), Some(frame)) = (bus, frame.and_then(CanFrame::read)) else { return false };
    bus.handle_frame(Duration::from_micros(now), &frame);
    true
}

/// The next frame to send on CAN 1 or 2; false when there is none.
///
/// # Safety
/// `controller` is null or from `motion_controller_new`; `frame` is null or valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motion_can_transmit(
    controller: *mut Controller,
    number: u8,
    now: u64,
    frame: *mut CanFrame,
) -> bool {
    // SAFETY: as the caller promises for both pointers.
    let (bus, frame) = unsafe { (bus(controller, number), frame.as_mut()) };
    let (Some(bus), Some(to)) = (bus, frame) else { return false };
    let Some(next) = bus.poll_transmit(Duration::from_micros(now)) else { return false };
    *to = CanFrame::new(&next);
    true
}

/// Lets time pass on CAN 1 or 2, to be called once a cycle at least. When it is to be called next (µs);
/// `UINT64_MAX` when the bus waits for nothing.
///
/// # Safety
/// `controller` is null or from `motion_controller_new`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motion_can_timeout(controller: *mut Controller, number: u8, now: u64) -> u64 {
    // SAFETY: as the caller promises.
    let Some(bus) = (unsafe { bus(controller, number) }) else { return u64::MAX };
    bus.handle_timeout(Duration::from_micros(now));
    bus.poll_timeout().map_or(u64::MAX, |at| u64::try_from(at.as_micros()).unwrap_or(u64::MAX))
}
