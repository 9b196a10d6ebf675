//! Memory that survives the loss of power, and records in it that are never half written
//! (manual A: "parameter values are taken over by the power failure-safe flash memory", 6.1).
//!
//! A [`Record`] has two slots. A save goes to the slot that does not hold the newest state: its commit
//! byte is cleared, then sequence number, words and check sum are written, then the commit byte is set.
//! A power cut at any byte leaves the other slot as it was.

/// Byte-wise non-volatile memory. A power cut may leave any number of bytes of a write undone.
pub trait Storage {
    /// Fills `out` from `offset` on.
    ///
    /// # Errors
    /// [`StorageError`] if the memory cannot be read.
    fn read(&self, offset: usize, out: &mut [u8]) -> Result<(), StorageError>;

    /// Writes `data` from `offset` on, first byte first.
    ///
    /// # Errors
    /// [`StorageError`] if the memory cannot be written.
    fn write(&mut self, offset: usize, data: &[u8]) -> Result<(), StorageError>;

    /// Returns when all that was written will survive a loss of power. As provided for memories
    /// whose `write` does so by itself.
    ///
    /// # Errors
    /// [`StorageError`] if the memory cannot be written.
    fn sync(&mut self) -> Result<(), StorageError> {
        Ok(())
    }
}

/// The memory failed, or is smaller than [`crate::STORAGE_LEN`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("non-volatile memory failed at byte {offset}")]
pub struct StorageError {
    /// First byte of the access.
    pub offset: usize,
}

impl Storage for [u8] {
    fn read(&self, offset: usize, out: &mut [u8]) -> Result<(), StorageError> {
        let from = self.get(offset..offset.saturating_add(out.len())).ok_or(StorageError { offset })?;
        out.copy_from_slice(from);
        Ok(())
    }

    fn write(&mut self, offset: usize, data: &[u8]) -> Result<(), StorageError> {
        let to = self.get_mut(offset..offset.saturating_add(data.len())).ok_or(StorageError { offset })?;
        to.copy_from_slice(data);
        Ok(())
    }
}

impl<S: Storage + ?Sized> Storage for &mut S {
    fn read(&self, offset: usize, out: &mut [u8]) -> Result<(), StorageError> {
        (**self).read(offset, out)
    }

    fn write(&mut self, offset: usize, data: &[u8]) -> Result<(), StorageError> {
        (**self).write(offset, data)
    }

    fn sync(&mut self) -> Result<(), StorageError> {
        (**self).sync()
    }
}

#[cfg(any(test, feature = "alloc"))]
impl Storage for alloc::vec::Vec<u8> {
    fn read(&self, offset: usize, out: &mut [u8]) -> Result<(), StorageError> {
        self.as_slice().read(offset, out)
    }

    fn write(&mut self, offset: usize, data: &[u8]) -> Result<(), StorageError> {
        self.as_mut_slice().write(offset, data)
    }
}

/// Commit byte of a complete slot; anything else means that the slot is not complete.
const COMPLETE: u8 = 0xA5;
/// Commit byte of a slot whose save has begun.
const BEGUN: u8 = 0;
/// Commit byte of a slot never used.
const ERASED: u8 = 0xFF;
/// Commit byte, 3 bytes unused, sequence number, check sum.
const HEADER: usize = 12;
const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// Place of a record: two slots of `words` 32-bit words each.
#[derive(Debug, Clone, Copy)]
pub struct Record {
    base: usize,
    words: usize,
}

impl Record {
    /// A record at byte `base`.
    #[must_use]
    pub const fn new(base: usize, words: usize) -> Self {
        Self { base, words }
    }

    /// First byte after the record.
    #[must_use]
    pub const fn end(&self) -> usize {
        self.base + 2 * self.slot_len()
    }

    const fn slot_len(&self) -> usize {
        HEADER + 4 * self.words
    }

    /// Whether a slot is not what a save, begun or done, or none has left there: a bit has changed since.
    ///
    /// # Errors
    /// [`StorageError`] if the memory cannot be read.
    pub fn is_damaged(&self, storage: &(impl Storage + ?Sized)) -> Result<bool, StorageError> {
        for slot in 0..2 {
            let mut commit = [0];
            storage.read(self.base + slot * self.slot_len(), &mut commit)?;
            let [commit] = commit;
            if !matches!(commit, BEGUN | ERASED) && self.sequence(storage, slot)?.is_none() {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Sequence number of a slot that is complete and whose check sum is right.
    fn sequence(&self, storage: &(impl Storage + ?Sized), slot: usize) -> Result<Option<u32>, StorageError> {
        let base = self.base + slot * self.slot_len();
        let mut header = [0; HEADER];
        storage.read(base, &mut header)?;
        let [COMPLETE, _, _, _, s0, s1, s2, s3, c0, c1, c2, c3] = header else { return Ok(None) };
        let mut crc = CRC.digest();
        crc.update(&[s0, s1, s2, s3]);
        for word in 0..self.words {
            let mut bytes = [0; 4];
            storage.read(base + HEADER + 4 * word, &mut bytes)?;
            crc.update(&bytes);
        }
        let good = crc.finalize() == u32::from_le_bytes([c0, c1, c2, c3]);
        Ok(good.then_some(u32::from_le_bytes([s0, s1, s2, s3])))
    }

    /// The slot with the newest state and its sequence number.
    fn newest(&self, storage: &(impl Storage + ?Sized)) -> Result<Option<(usize, u32)>, StorageError> {
        Ok(match (self.sequence(storage, 0)?, self.sequence(storage, 1)?) {
            // The sequence number wraps: the newer one is at most half the circle ahead.
            (Some(a), Some(b)) if a.wrapping_sub(b) < 1 << 31 => Some((0, a)),
            (_, Some(b)) => Some((1, b)),
            (Some(a), None) => Some((0, a)),
            (None, None) => None,
        })
    }

    /// Reads the newest state into `words`; `false` if there is none.
    ///
    /// # Errors
    /// [`StorageError`] if the memory cannot be read.
    pub fn load(&self, storage: &(impl Storage + ?Sized), words: &mut [i32]) -> Result<bool, StorageError> {
        let Some((slot, _)) = self.newest(storage)? else { return Ok(false) };
        let base = self.base + slot * self.slot_len() + HEADER;
        for (at, word) in words.iter_mut().take(self.words).enumerate() {
            let mut bytes = [0; 4];
            storage.read(base + 4 * at, &mut bytes)?;
            *word = i32::from_le_bytes(bytes);
        }
        Ok(true)
    }

    /// Makes `words` the newest state; missing words are zeros.
    ///
    /// # Errors
    /// [`StorageError`] if the memory cannot be read or written; the old state is still there.
    pub fn save(&self, storage: &mut (impl Storage + ?Sized), words: &[i32]) -> Result<(), StorageError> {
        let (slot, sequence) = match self.newest(storage)? {
            Some((slot, sequence)) => (1 - slot, sequence.wrapping_add(1)),
            None => (0, 0),
        };
        let base = self.base + slot * self.slot_len();
        let sequence = sequence.to_le_bytes();
        storage.write(base, &[BEGUN])?;
        storage.sync()?;
        let mut crc = CRC.digest();
        crc.update(&sequence);
        let words = words.iter().copied().chain(core::iter::repeat(0)).take(self.words);
        for (at, word) in words.enumerate() {
            let bytes = word.to_le_bytes();
            crc.update(&bytes);
            storage.write(base + HEADER + 4 * at, &bytes)?;
        }
        storage.write(base + 4, &sequence)?;
        storage.write(base + 8, &crc.finalize().to_le_bytes())?;
        storage.sync()?;
        storage.write(base, &[COMPLETE])?;
        storage.sync()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;
    use alloc::vec::Vec;

    /// Memory whose power fails after so many bytes.
    struct Cut {
        bytes: Vec<u8>,
        left: usize,
    }

    impl Storage for Cut {
        fn read(&self, offset: usize, out: &mut [u8]) -> Result<(), StorageError> {
            self.bytes.read(offset, out)
        }

        fn write(&mut self, offset: usize, data: &[u8]) -> Result<(), StorageError> {
            let len = data.len().min(self.left);
            self.left -= len;
            self.bytes.write(offset, &data[..len])?;
            if len < data.len() { Err(StorageError { offset }) } else { Ok(()) }
        }
    }

    const RECORD: Record = Record::new(3, 20);

    fn state(n: i32) -> [i32; 20] {
        core::array::from_fn(|at| n * 1000 + at as i32)
    }

    fn loaded(bytes: &[u8]) -> Option<[i32; 20]> {
        let mut words = [0; 20];
        RECORD.load(bytes, &mut words).unwrap().then_some(words)
    }

    #[test]
    fn a_cut_at_any_byte_leaves_the_old_or_the_new_state() {
        // From memory never used, and from both orders of the slots.
        for saved in 0..4 {
            let mut bytes = vec![0xFF; RECORD.end()];
            for n in 0..saved {
                RECORD.save(&mut bytes, &state(n)).unwrap();
            }
            let (old, new) = ((saved > 0).then(|| state(saved - 1)), Some(state(saved)));
            let mut seen = (false, false);
            for left in 0.. {
                let mut cut = Cut { bytes: bytes.clone(), left };
                let done = RECORD.save(&mut cut, &state(saved)).is_ok();
                let now = loaded(&cut.bytes);
                assert!(now == old || now == new, "cut after {left} bytes: {now:?}");
                assert!(!done || now == new);
                assert_eq!(RECORD.is_damaged(&cut.bytes), Ok(false), "cut after {left} bytes");
                seen = (seen.0 | (now == old), seen.1 | (now == new));
                // The next save works from whatever the cut has left.
                RECORD.save(&mut cut.bytes, &state(77)).unwrap();
                assert_eq!(loaded(&cut.bytes), Some(state(77)));
                if done {
                    break;
                }
            }
            assert_eq!(seen, (true, true));
        }
    }

    #[test]
    fn a_flipped_bit_falls_back_to_the_older_state() {
        let mut bytes = vec![0xFF; RECORD.end()];
        RECORD.save(&mut bytes, &state(1)).unwrap();
        RECORD.save(&mut bytes, &state(2)).unwrap();
        let second = RECORD.base + RECORD.slot_len();
        for at in second..second + RECORD.slot_len() {
            for bit in 0..8 {
                let mut bytes = bytes.clone();
                bytes[at] ^= 1 << bit;
                let unused = (second + 1..second + 4).contains(&at);
                assert_eq!(RECORD.is_damaged(&bytes), Ok(!unused));
                assert_eq!(loaded(&bytes), Some(state(if unused { 2 } else { 1 })), "byte {at}, bit {bit}");
            }
        }
    }

    #[test]
    fn sequence_numbers_wrap() {
        let mut bytes = vec![0; RECORD.end()];
        RECORD.save(&mut bytes, &state(0)).unwrap();
        let mut crc = CRC.digest();
        crc.update(&u32::MAX.to_le_bytes());
        state(0).iter().for_each(|word| crc.update(&word.to_le_bytes()));
        bytes[RECORD.base + 4..RECORD.base + 8].copy_from_slice(&u32::MAX.to_le_bytes());
        bytes[RECORD.base + 8..RECORD.base + 12].copy_from_slice(&crc.finalize().to_le_bytes());
        assert_eq!(loaded(&bytes), Some(state(0)));
        for n in 1..4 {
            RECORD.save(&mut bytes, &state(n)).unwrap();
            assert_eq!(loaded(&bytes), Some(state(n)));
        }
    }

    #[test]
    fn memory_that_is_too_small_is_an_error() {
        let mut bytes = vec![0; RECORD.end() - 1];
        assert!(RECORD.save(&mut bytes, &state(0)).is_ok(), "the first slot fits");
        assert!(RECORD.save(&mut bytes, &state(1)).is_err());
    }
}
