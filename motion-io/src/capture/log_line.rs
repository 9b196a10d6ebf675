//! Lines as `candump -l` writes nearly all of them, several characters at once:
//! `(1436509052.249713) can0 581#4B41600018028FAF`.

use super::record::{Bus, FrameKind, Record, Time};
use super::scan::{SECONDS, decimal, decimal_of_8, hex_of_16, nibble};

/// What such a line mostly has in common with the one before.
#[derive(Debug)]
pub(super) struct LogLines {
    /// `(1436509052.`, and these seconds in nanoseconds.
    seconds: ([u8; 12], i64),
    bus: Bus,
    /// `) can0 ` with zeros behind it.
    behind_time: [u8; 16],
    /// The bits of it that count; none before a bus is known.
    mask: [u8; 16],
    len: usize,
}

impl Default for LogLines {
    fn default() -> Self {
        // Nothing is equal to the text, which lies outside of the mask.
        Self { seconds: ([0; 12], 0), bus: Bus(0), behind_time: [1; 16], mask: [0; 16], len: 0 }
    }
}

impl LogLines {
    /// The bus that lines are expected from from now on, unless its name is very long.
    pub(super) fn set_bus(&mut self, bus: Bus, name: &str) {
        if self.len != 0 && self.bus == bus {
            return;
        }
        let (mut text, mut mask) = ([0; 16], [0; 16]);
        let len = 2 + name.len() + 1;
        let (Some(text_room), Some(mask_room)) = (text.get_mut(..len), mask.get_mut(..len)) else { return };
        text_room.fill(b' ');
        if let [bracket, _, name_room @ .., _] = text_room {
            *bracket = b')';
            name_room.copy_from_slice(name.as_bytes());
        }
        mask_room.fill(0xFF);
        *self = Self { seconds: self.seconds, bus, behind_time: text, mask, len };
    }

    /// A line at the start of what is held: epoch time with microseconds, the expected bus, a data frame
    /// with an 11-bit identifier. Its length with its end; `None` of any other.
    #[inline]
    pub(super) fn line(&mut self, held: &[u8], record: &mut Record) -> Option<usize> {
        let (seconds, rest) = held.split_first_chunk::<12>()?;
        let (&[a, b, c, d, e, f], rest) = rest.split_first_chunk::<6>()?;
        let behind_time = u128::from_le_bytes(*rest.first_chunk()?) & u128::from_le_bytes(self.mask);
        if behind_time.to_le_bytes() != self.behind_time {
            return None;
        }
        let (&[i, j, k, b'#'], rest) = rest.get(self.len..)?.split_first_chunk::<4>()? else { return None };
        let (i, j, k) = (nibble(i), nibble(j), nibble(k));
        if i | j | k > 0x0F || i > 7 {
            return None;
        }
        let (digits, bytes) = hex_of_16(rest.first_chunk()?);
        let end = match rest.get(digits..)? {
            [b'\n', ..] => 1,
            [b'\r', b'\n', ..] => 2,
            _ => return None,
        };
        if digits % 2 != 0 {
            return None;
        }
        let micros = decimal_of_8([b'0', b'0', a, b, c, d, e, f])?;
        if self.seconds.0 != *seconds {
            let &[b'(', ref text @ .., b'.'] = seconds else { return None };
            let whole = i64::try_from(decimal(text)?).ok()?;
            self.seconds = (*seconds, whole.checked_mul(SECONDS)?);
        }
        record.time = Some(Time(self.seconds.1.checked_add(i64::from(micros) * 1000)?));
        record.bus = Some(self.bus);
        record.direction = None;
        record.loopback = false;
        let frame = &mut record.frame;
        frame.id = u32::from(i) << 8 | u32::from(j) << 4 | u32::from(k);
        frame.extended = false;
        frame.kind = FrameKind::Data;
        frame.len = (digits / 2) as u8;
        *frame.data.first_chunk_mut()? = bytes;
        Some(12 + 6 + self.len + 4 + digits + end)
    }
}
