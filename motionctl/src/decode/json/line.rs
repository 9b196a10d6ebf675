//! The object of a frame made from that of another one of the same identifier: they mostly differ in
//! the decimals of the time and in the data only.

use motion_io::capture::Frame;

use super::Kind;
use super::text::{Moment, hex_of_8};

/// The last object of an identifier.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line {
    bus: u16,
    /// Bytes of data.
    len: usize,
    seconds: u64,
    /// What it is, where what follows the data depends on nothing else.
    kind: Option<Kind>,
    text: [u8; 256],
    text_len: usize,
    decimals_at: usize,
    data_at: usize,
    /// The 16 characters from there on, zeros for digits of the data; which are digits.
    around: u128,
    mask: u128,
}

impl Line {
    /// The line of a frame from its text, and where in it the digits of the data stand; `None` of one
    /// that is too long. `kind`: where it alone says what follows the data.
    pub(super) fn new(
        bus: u16,
        frame: &Frame,
        kind: Option<Kind>,
        moment: Moment,
        text: &[u8],
        data_at: usize,
    ) -> Option<Self> {
        let len = frame.len();
        let mask = 1_u128.checked_shl(16 * u32::try_from(len).ok()?).map_or(u128::MAX, |bit| bit - 1);
        let mut line = Self {
            bus,
            len,
            seconds: moment.seconds,
            kind,
            text: [0; 256],
            text_len: text.len(),
            decimals_at: 1 + text.iter().position(|&byte| byte == b'.')?,
            data_at,
            around: u128::from_le_bytes(*text.get(data_at..)?.first_chunk()?) & !mask,
            mask,
        };
        line.text.get_mut(..text.len())?.copy_from_slice(text);
        Some(line)
    }

    /// Whether the line of a frame at that moment differs before its data in nothing but the decimals.
    #[inline]
    pub(super) fn begins_like(&self, bus: u16, moment: Moment) -> bool {
        self.bus == bus && self.seconds == moment.seconds
    }

    /// Whether what follows the data is the same, and stands at the same place.
    #[inline]
    pub(super) fn ends_like(&self, frame: &Frame, kind: &Kind) -> bool {
        self.len == frame.len() && self.kind.as_ref() == Some(kind)
    }

    /// Writes what stands before the data.
    pub(super) fn put_head(&self, out: &mut Vec<u8>, moment: Moment) {
        self.put_text(out, self.data_at, moment);
    }

    /// Writes the line with other data.
    #[inline]
    pub(super) fn put(&self, out: &mut Vec<u8>, moment: Moment, data: [u8; 8]) {
        let text = self.put_text(out, self.text_len, moment);
        if let Some(digits) = text.get_mut(self.data_at..).and_then(<[u8]>::first_chunk_mut) {
            *digits = (self.around | hex_of_8(data) & self.mask).to_le_bytes();
        }
    }

    /// Writes so much of the text, with the decimals of a moment.
    #[inline]
    fn put_text<'a>(&self, out: &'a mut Vec<u8>, len: usize, moment: Moment) -> &'a mut [u8] {
        let from = out.len();
        out.extend_from_slice(self.text.get(..len).unwrap_or(&[]));
        let text = out.get_mut(from..).unwrap_or(&mut []);
        if let Some(decimals) = text.get_mut(self.decimals_at..).and_then(<[u8]>::first_chunk_mut) {
            *decimals = moment.decimals();
        }
        text
    }
}
