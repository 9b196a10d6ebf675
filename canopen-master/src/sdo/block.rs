//! What both sides of a block transfer have in common (CiA 301, 7.2.4.2.10…15): who sends counts
//! segments and goes back to the one that was lost, who receives takes them in order.

use super::message::SEGMENT;

/// The most segments of a sub-block.
pub const MAX_BLOCK_SIZE: u8 = 127;

/// Sub-blocks in a row without any segment arriving before the transfer is given up.
pub(super) const STALLS: u8 = 4;

/// Whether a block size is allowed.
pub(super) const fn is_block_size(block_size: u8) -> bool {
    matches!(block_size, 1..=MAX_BLOCK_SIZE)
}

/// A small target has no room for a table, and time: a segment comes at most every 0.1 ms.
#[cfg(target_pointer_width = "32")]
type Steps = crc::NoTable;
#[cfg(not(target_pointer_width = "32"))]
type Steps = crc::Table<1>;

const CRC: crc::Crc<u16, Steps> = crc::Crc::<u16, Steps>::new(&crc::CRC_16_XMODEM);

/// The check sum over a block transfer: x^16 + x^12 + x^5 + 1, initially 0, not reflected (7.2.4.3.16).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Crc(pub(super) u16);

impl Crc {
    #[inline]
    pub(super) fn update(&mut self, bytes: &[u8]) {
        let mut digest = CRC.digest_with_initial(self.0);
        digest.update(bytes);
        self.0 = digest.finalize();
    }
}

/// The check sum over all data of a block transfer.
#[cfg(feature = "alloc")]
pub(crate) fn check_sum(data: &[u8]) -> u16 {
    let mut crc = Crc::default();
    crc.update(data);
    crc.0
}

/// The sending side.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Sender {
    /// Segments per sub-block, set by the receiver.
    pub(super) block_size: u8,
    /// Segments sent in this sub-block.
    sent: u8,
    /// Bytes of the last segment of all; known once it was sent.
    last: Option<u8>,
    stalls: u8,
    /// Segments were sent again.
    pub(super) repeated: bool,
    /// Over the first `checked` bytes: those sent again are not counted twice.
    crc: Crc,
    checked: u32,
}

/// What the receiver's confirmation means to the sender.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Confirmed {
    /// So many bytes arrived; go on after them.
    Bytes(u32),
    /// So many bytes arrived, and these were the last.
    All(u32),
    /// More than was sent: so many segments.
    TooMany(u8),
    /// Nothing has arrived too often.
    Stalled,
}

impl Sender {
    /// Of no transfer.
    pub(super) const EMPTY: Self =
        Self { block_size: 0, sent: 0, last: None, stalls: 0, repeated: false, crc: Crc(0), checked: 0 };

    pub(super) const fn new(block_size: u8) -> Self {
        Self { block_size, ..Self::EMPTY }
    }

    /// Whether the sub-block is complete and a confirmation is due.
    #[inline]
    pub(super) const fn is_done(&self) -> bool {
        self.last.is_some() || self.sent >= self.block_size
    }

    /// Where the next segment begins, from the beginning of the sub-block.
    #[inline]
    pub(super) fn offset(&self) -> u32 {
        u32::from(self.sent) * SEGMENT as u32
    }

    /// Counts a segment and returns its number.
    #[inline]
    pub(super) fn push(&mut self, offset: u32, data: &[u8], last: bool) -> u8 {
        if offset == self.checked {
            self.crc.update(data);
            self.checked = self.checked.wrapping_add(data.len() as u32);
        }
        self.sent = self.sent.saturating_add(1);
        self.last = last.then_some(data.len() as u8);
        self.sent
    }

    /// Bytes of the last segment that are no data, and the check sum.
    #[inline]
    pub(super) fn end(&self) -> (u8, u16) {
        ((SEGMENT as u8).saturating_sub(self.last.unwrap_or(0)), self.crc.0)
    }

    /// The receiver has confirmed the first `sequence` segments.
    pub(super) fn confirm(&mut self, sequence: u8, block_size: u8) -> Confirmed {
        if sequence > self.sent {
            return Confirmed::TooMany(self.sent);
        }
        let bytes = u32::from(sequence) * SEGMENT as u32;
        if let Some(last) = self.last
            && sequence == self.sent
        {
            return Confirmed::All(bytes - SEGMENT as u32 + u32::from(last));
        }
        self.stalls = if sequence == 0 { self.stalls + 1 } else { 0 };
        if self.stalls >= STALLS {
            return Confirmed::Stalled;
        }
        self.repeated |= sequence < self.sent;
        (self.sent, self.last, self.block_size) = (0, None, block_size);
        Confirmed::Bytes(bytes)
    }
}

/// The receiving side.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Receiver {
    block_size: u8,
    /// Segments received in order in this sub-block.
    sequence: u8,
    /// Something of this sub-block was received.
    heard: bool,
    /// The last segment of all was received.
    pub(super) ended: bool,
    stalls: u8,
    /// A segment came out of order, or twice.
    pub(super) disordered: bool,
    /// Over what was taken, but for the last segment.
    pub(super) crc: Crc,
    pub(super) check: bool,
}

impl Receiver {
    /// Of no transfer.
    pub(super) const EMPTY: Self = Self {
        block_size: 0,
        sequence: 0,
        heard: false,
        ended: false,
        stalls: 0,
        disordered: false,
        crc: Crc(0),
        check: false,
    };

    pub(super) const fn new(block_size: u8, check: bool) -> Self {
        Self { block_size, check, ..Self::EMPTY }
    }

    pub(super) const fn block_size(&self) -> u8 {
        self.block_size
    }

    /// A segment came. Whether it is the next in order, and whether the sub-block is over.
    #[inline]
    pub(super) fn segment(&mut self, sequence: u8, last: bool) -> (bool, bool) {
        self.heard = true;
        let next = sequence == self.sequence.wrapping_add(1);
        if next {
            self.sequence = sequence;
            self.ended = last;
        } else {
            self.disordered = true;
        }
        // An older segment once more ends nothing.
        let over = sequence > self.sequence || next;
        (next, over && (last || sequence >= self.block_size))
    }

    /// Whether a silence means that the end of the sub-block was lost.
    pub(super) const fn is_cut_short(&self) -> bool {
        self.heard
    }

    /// Number of the last segment to confirm; the next sub-block begins. `None`: stalled.
    #[inline]
    pub(super) fn confirm(&mut self) -> Option<u8> {
        let sequence = core::mem::take(&mut self.sequence);
        self.heard = false;
        self.stalls = if sequence == 0 { self.stalls + 1 } else { 0 };
        (self.stalls < STALLS).then_some(sequence)
    }

    #[inline]
    pub(super) fn update(&mut self, bytes: &[u8]) {
        if self.check {
            self.crc.update(bytes);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// CiA 301, 7.2.4.3.16: the check value of this CRC.
    #[test]
    fn crc() {
        let mut whole = Crc::default();
        whole.update(b"123456789");
        assert_eq!(whole, Crc(0x31C3));
        let mut pieces = Crc::default();
        pieces.update(b"1234567");
        pieces.update(b"89");
        assert_eq!(pieces, whole);
    }

    #[test]
    fn segments_sent_again_are_checked_once() {
        let mut sender = Sender::new(3);
        let mut all = Crc::default();
        all.update(&[1; 21]);
        for i in 0..3 {
            assert_eq!(sender.push(i * 7, &[1; 7], false), i as u8 + 1);
        }
        assert!(sender.is_done());
        assert_eq!(sender.confirm(1, 5), Confirmed::Bytes(7));
        assert_eq!(sender.push(7, &[1; 7], false), 1);
        assert_eq!(sender.push(14, &[1; 7], true), 2);
        assert_eq!((sender.end(), sender.confirm(2, 5)), ((0, all.0), Confirmed::All(14)));
        assert_eq!(sender.confirm(3, 5), Confirmed::TooMany(2));
    }

    #[test]
    fn segments_are_taken_in_order() {
        let mut receiver = Receiver::new(4, true);
        assert_eq!(receiver.segment(1, false), (true, false));
        assert_eq!(receiver.segment(1, false), (false, false), "twice");
        assert_eq!(receiver.segment(3, false), (false, false), "2 is lost");
        assert_eq!(receiver.segment(4, false), (false, true));
        assert_eq!(receiver.confirm(), Some(1));
        assert_eq!(receiver.segment(1, true), (true, true));
        assert!(receiver.ended);
    }

    #[test]
    fn no_progress_ends() {
        let (mut receiver, mut sender) = (Receiver::new(4, true), Sender::new(4));
        for _ in 1..STALLS {
            assert_eq!(receiver.confirm(), Some(0));
            assert_eq!(sender.confirm(0, 4), Confirmed::Bytes(0));
        }
        assert_eq!(receiver.confirm(), None);
        assert_eq!(sender.confirm(0, 4), Confirmed::Stalled);
    }
}
