//! LB2 over CAN: the byte stream cut into data frames of up to 8 bytes, on one 11-bit identifier per
//! direction (decision 10, project-defined: manual A 7.2 names "LB2 over CAN" and says no more).
//!
//! The bytes are those of a serial line, heads and doubled 82h included: what [`frames`] sends,
//! [`bytes`] gives back, and the engines of [`crate::master`] and [`crate::device`] never know.

use embedded_can::{Frame, Id, StandardId};

/// Identifier of frames to the device.
pub const TO_DEVICE: StandardId = id(0x7A0);
/// Identifier of frames from the device.
pub const FROM_DEVICE: StandardId = id(0x7A1);

const fn id(raw: u16) -> StandardId {
    match StandardId::new(raw) {
        Some(id) => id,
        None => StandardId::ZERO,
    }
}

/// Frames that carry `bytes`, in order. Fewer than the bytes need only if `F` refuses data frames.
///
/// ```
/// # #[derive(Debug)]
/// # struct Frame(Vec<u8>);
/// # impl embedded_can::Frame for Frame {
/// #     fn new(_: impl Into<embedded_can::Id>, data: &[u8]) -> Option<Self> { Some(Self(data.to_vec())) }
/// #     fn new_remote(_: impl Into<embedded_can::Id>, _: usize) -> Option<Self> { None }
/// #     fn is_extended(&self) -> bool { false }
/// #     fn is_remote_frame(&self) -> bool { false }
/// #     fn id(&self) -> embedded_can::Id { lb2::can::TO_DEVICE.into() }
/// #     fn dlc(&self) -> usize { self.0.len() }
/// #     fn data(&self) -> &[u8] { &self.0 }
/// # }
/// // "Read parameter [005]" is one telegram of 8 bytes; the reply to it takes two frames.
/// let request = [0x82, 0x96, 0x05, 0xCC, 0x30, 0x05, 0x00, 0xFC];
/// let frames: Vec<Frame> = lb2::can::frames(lb2::can::TO_DEVICE, &request).collect();
/// assert_eq!(frames.len(), 1);
/// assert_eq!(lb2::can::bytes(lb2::can::TO_DEVICE, &frames[0]), Some(&request[..]));
/// ```
pub fn frames<F: Frame>(id: StandardId, bytes: &[u8]) -> impl Iterator<Item = F> {
    bytes.chunks(8).map_while(move |chunk| F::new(id, chunk))
}

/// The bytes of a frame, if it is a data frame with this identifier.
pub fn bytes<F: Frame>(id: StandardId, frame: &F) -> Option<&[u8]> {
    (frame.id() == Id::Standard(id) && !frame.is_remote_frame()).then(|| frame.data())
}
