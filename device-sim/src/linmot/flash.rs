//! What survives a loss of power, and its form as bytes.

use std::collections::BTreeMap;

use linmot::curve::INFO_WORDS;
use linmot::table::{ENTRY_SIZE, Entry};

/// A curve as the drive holds it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StoredCurve {
    /// The info block's words.
    pub info: [u32; INFO_WORDS],
    /// The setpoints.
    pub data: Vec<u32>,
}

/// Curves by ID.
pub(super) type Curves = BTreeMap<u16, StoredCurve>;
/// Command table entries by number.
pub(super) type Table = BTreeMap<u16, Entry>;

/// Non-volatile memory: parameters are written one by one, curves and command table as a whole.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct Flash {
    pub(super) rom: BTreeMap<u16, u32>,
    /// `None`: power was lost while the area was being written.
    pub(super) curves: Option<Curves>,
    pub(super) table: Option<Table>,
}

/// Why bytes are no image of a drive's non-volatile memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("no image of a virtual LinMot drive's memory: {0}")]
pub struct ImageError(&'static str);

const MAGIC: u32 = 0x314D_4C56;
const ABSENT: u32 = u32::MAX;

impl Flash {
    /// As 32-bit words, low byte first: magic, then counted lists.
    pub(super) fn to_bytes(&self) -> Vec<u8> {
        let mut words = vec![MAGIC, self.rom.len() as u32];
        words.extend(self.rom.iter().flat_map(|(upid, value)| [u32::from(*upid), *value]));
        words.push(self.curves.as_ref().map_or(ABSENT, |curves| curves.len() as u32));
        for (id, curve) in self.curves.iter().flatten() {
            words.extend([u32::from(*id), curve.data.len() as u32]);
            words.extend(curve.info);
            words.extend(&curve.data);
        }
        words.push(self.table.as_ref().map_or(ABSENT, |table| table.len() as u32));
        for (number, entry) in self.table.iter().flatten() {
            words.push((*number).into());
            words.extend(entry.words());
        }
        words.iter().flat_map(|word| word.to_le_bytes()).collect()
    }

    pub(super) fn from_bytes(bytes: &[u8]) -> Result<Self, ImageError> {
        let (words, []) = bytes.as_chunks::<4>() else {
            return Err(ImageError("its length is no multiple of 4 bytes"));
        };
        let mut words = words.iter().map(|four| u32::from_le_bytes(*four));
        let mut next = || words.next().ok_or(ImageError("it is cut off"));
        if next()? != MAGIC {
            return Err(ImageError("it does not begin with VLM1"));
        }
        let key = |word: u32| {
            u16::try_from(word).map_err(|_| ImageError("a UPID, curve or entry number is above 65535"))
        };
        let mut flash = Self::default();
        for _ in 0..next()? {
            flash.rom.insert(key(next()?)?, next()?);
        }
        let curves = next()?;
        if curves != ABSENT {
            let mut stored = Curves::new();
            for _ in 0..curves {
                let (id, len) = (key(next()?)?, next()?);
                let mut curve = StoredCurve { info: [0; INFO_WORDS], data: Vec::new() };
                for word in &mut curve.info {
                    *word = next()?;
                }
                for _ in 0..len {
                    curve.data.push(next()?);
                }
                stored.insert(id, curve);
            }
            flash.curves = Some(stored);
        }
        let entries = next()?;
        if entries != ABSENT {
            let mut table = Table::new();
            for _ in 0..entries {
                let number = key(next()?)?;
                let mut words = [0; ENTRY_SIZE / 4];
                for word in &mut words {
                    *word = next()?;
                }
                let entry =
                    Entry::from_words(&words).map_err(|_| ImageError("a command table entry is none"))?;
                table.insert(number, entry);
            }
            flash.table = Some(table);
        }
        Ok(flash)
    }
}
