//! Concise DCF: a device's configuration as bytes, the value of 1F22h (CiA 302-3, "configuration
//! manager").
//!
//! A count (u32), then for each entry index (u16), sub-index (u8), length (u32) and data; everything
//! little-endian. The entries are written to the device in this order.

use alloc::collections::BTreeMap;
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

use super::model::{Device, Entry};
use super::value::{ValueError, from_bytes, to_bytes};
use crate::data_type::DataType;

/// One value to write.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct ConciseEntry {
    /// Index.
    pub index: u16,
    /// Sub-index.
    pub subindex: u8,
    /// The value as SDO transfers it.
    pub data: Vec<u8>,
}

/// Why bytes are no concise DCF.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConciseError {
    /// The bytes end inside an entry.
    #[error("{} needs {needs} bytes at offset {offset}, {left} are there", place(*entry, *count))]
    Short {
        /// Position of the entry, from 1; 0 for the count itself.
        entry: u32,
        /// Entries announced.
        count: u32,
        /// Offset of the piece that does not fit.
        offset: usize,
        /// Bytes of the piece.
        needs: usize,
        /// Bytes up to the end.
        left: usize,
    },
    /// Bytes follow the last entry.
    #[error("{0} bytes follow the last entry")]
    Surplus(usize),
}

fn place(entry: u32, count: u32) -> String {
    if entry == 0 { "the number of entries".into() } else { format!("entry {entry} of {count}") }
}

/// A value of a device that cannot be put into a concise DCF.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("{index:04X}h:{subindex:02X}: {error}")]
pub struct ConciseValueError {
    /// Index.
    pub index: u16,
    /// Sub-index.
    pub subindex: u8,
    /// What is wrong with it.
    pub error: ValueError,
}

/// Takes a concise DCF apart.
///
/// # Errors
/// [`ConciseError`] where count, lengths and bytes do not agree.
pub fn parse_concise(bytes: &[u8]) -> Result<Vec<ConciseEntry>, ConciseError> {
    let mut rest = Rest { bytes, offset: 0, entry: 0, count: 0 };
    let count = u32::from_le_bytes(rest.array()?);
    rest.count = count;
    let mut entries = Vec::new();
    for entry in 1..=count {
        rest.entry = entry;
        let index = u16::from_le_bytes(rest.array()?);
        let [subindex] = rest.array()?;
        let length = u32::from_le_bytes(rest.array()?);
        let data = rest.take(usize::try_from(length).unwrap_or(usize::MAX))?.to_vec();
        entries.push(ConciseEntry { index, subindex, data });
    }
    match bytes.len() - rest.offset {
        0 => Ok(entries),
        surplus => Err(ConciseError::Surplus(surplus)),
    }
}

struct Rest<'a> {
    bytes: &'a [u8],
    offset: usize,
    entry: u32,
    count: u32,
}

impl<'a> Rest<'a> {
    fn take(&mut self, length: usize) -> Result<&'a [u8], ConciseError> {
        let end = self.offset.checked_add(length);
        let piece = end.and_then(|end| self.bytes.get(self.offset..end)).ok_or(ConciseError::Short {
            entry: self.entry,
            count: self.count,
            offset: self.offset,
            needs: length,
            left: self.bytes.len() - self.offset,
        })?;
        self.offset += length;
        Ok(piece)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], ConciseError> {
        let piece = self.take(N)?;
        let mut array = [0; N];
        array.copy_from_slice(piece);
        Ok(array)
    }
}

/// The bytes of a concise DCF. Entries beyond 2³²−1, which no memory holds, are left out.
#[must_use]
pub fn encode_concise(entries: &[ConciseEntry]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let count = u32::try_from(entries.len()).unwrap_or(u32::MAX);
    bytes.extend(count.to_le_bytes());
    for entry in entries {
        bytes.extend(entry.index.to_le_bytes());
        bytes.push(entry.subindex);
        bytes.extend(u32::try_from(entry.data.len()).unwrap_or(u32::MAX).to_le_bytes());
        bytes.extend(&entry.data);
    }
    bytes
}

/// Bit 31 of a PDO's COB-ID: the PDO does not exist (CiA 301, 7.5.2.35).
const INVALID: u32 = 1 << 31;

impl Device {
    /// What is to be written to bring a device to this configuration, whatever it holds: every
    /// `ParameterValue` that may be written, and the whole mapping of a PDO of which a part is configured.
    /// "Save" and "load" (1010h, 1011h) are orders, and not written where they are their defaults.
    ///
    /// In ascending order, except PDOs, which are taken out of service while their mapping changes, as
    /// CiA 301, 7.5.2.36 asks: COB-ID invalid, communication parameters, number of mapped objects 0,
    /// mapping, number of mapped objects, COB-ID.
    ///
    /// # Errors
    /// The first value that cannot be put into bytes; the COB-ID of a PDO that changes, where it is not known.
    pub fn to_concise(&self, node_id: Option<u8>) -> Result<Vec<ConciseEntry>, ConciseValueError> {
        let node_id = node_id.or_else(|| self.node_id());
        let mut changes: BTreeMap<(u16, u8), Vec<u8>> = BTreeMap::new();
        for object in &self.objects {
            for entry in object.entries().iter().filter(|entry| can_write(entry)) {
                let Some(value) = entry.value_bytes(node_id) else { continue };
                let at = (object.index, entry.subindex);
                let value =
                    value.map_err(|error| ConciseValueError { index: at.0, subindex: at.1, error })?;
                let order = matches!(object.index, 0x1010 | 0x1011);
                if !order || entry.default_bytes(node_id) != Some(Ok(value.clone())) {
                    changes.insert(at, value);
                }
            }
        }
        let mut mappings: Vec<u16> = changes.keys().map(|(index, _)| *index).collect();
        mappings.retain(|index| matches!(index, 0x1600..=0x17FF | 0x1A00..=0x1BFF));
        mappings.dedup();
        for index in mappings {
            self.complete_mapping(index, node_id, &mut changes)?;
        }
        let mut entries = Vec::new();
        while let Some(((index, subindex), data)) = changes.pop_first() {
            let pdo = match index {
                0x1400..=0x15FF | 0x1800..=0x19FF => index,
                0x1600..=0x17FF | 0x1A00..=0x1BFF => index - 0x200,
                _ => {
                    entries.push(ConciseEntry { index, subindex, data });
                    continue;
                }
            };
            changes.insert((index, subindex), data);
            take_pdo(pdo, self.cob_id(pdo, node_id)?, &mut changes, &mut entries);
        }
        Ok(entries)
    }

    /// Adds what belongs to a mapping of which a part changes: it is written as a whole, with its number
    /// of objects last.
    fn complete_mapping(
        &self,
        index: u16,
        node_id: Option<u8>,
        changes: &mut BTreeMap<(u16, u8), Vec<u8>>,
    ) -> Result<(), ConciseValueError> {
        let highest = changes.range((index, 0)..=(index, u8::MAX)).next_back().map_or(0, |(at, _)| at.1);
        let number = match self.entry(index, 0) {
            Some(entry) if !can_write(entry) => return Ok(()),
            Some(entry) => self.in_the_end(index, entry, node_id)?,
            None => None,
        };
        let number = number.unwrap_or_else(|| [highest].into());
        for subindex in 1..=number.first().copied().unwrap_or(0) {
            if let Some(entry) = self.entry(index, subindex).filter(|entry| can_write(entry))
                && let Some(mapped) = self.in_the_end(index, entry, node_id)?
            {
                changes.entry((index, subindex)).or_insert(mapped);
            }
        }
        changes.entry((index, 0)).or_insert(number);
        Ok(())
    }

    /// What an entry shall hold in the end: its value, otherwise its default.
    fn in_the_end(
        &self,
        index: u16,
        entry: &Entry,
        node_id: Option<u8>,
    ) -> Result<Option<Vec<u8>>, ConciseValueError> {
        let value = entry.value_bytes(node_id).or_else(|| entry.default_bytes(node_id)).transpose();
        value.map_err(|error| ConciseValueError { index, subindex: entry.subindex, error })
    }

    /// Takes the values of a concise DCF as `ParameterValue`s. Gives the entries that the device does
    /// not describe, and those of which the bytes are no value of the object's data type or a text
    /// that a line of a file does not hold; leaves these out.
    pub fn apply_concise(&mut self, entries: &[ConciseEntry]) -> Vec<ConciseEntry> {
        let mut refused = Vec::new();
        for concise in entries {
            let base = self
                .entry(concise.index, concise.subindex)
                .map(|entry| self.base_type(entry.data_type.unwrap_or(DataType::DOMAIN)));
            let place = self.object_mut(concise.index).and_then(|object| object.entry_mut(concise.subindex));
            match (place, base) {
                (Some(entry), Some(base)) => match text_of(&concise.data, base) {
                    Some(text) => entry.value = Some(text),
                    None => refused.push(concise.clone()),
                },
                _ => refused.push(concise.clone()),
            }
        }
        refused
    }

    /// COB-ID that a PDO shall have in the end, from value or default; `None` where it cannot be written or
    /// the file does not say it.
    fn cob_id(&self, pdo: u16, node_id: Option<u8>) -> Result<Option<u32>, ConciseValueError> {
        let Some(entry) = self.entry(pdo, 1).filter(|entry| can_write(entry)) else { return Ok(None) };
        let bytes = self.in_the_end(pdo, entry, node_id)?;
        Ok(bytes.and_then(|bytes| Some(u32::from_le_bytes(bytes.try_into().ok()?))))
    }
}

fn can_write(entry: &Entry) -> bool {
    entry.access.is_some_and(super::types::Access::can_write)
}

/// The text of which a file gives exactly these bytes back; a text file has no zero bytes.
fn text_of(bytes: &[u8], data_type: DataType) -> Option<String> {
    let text = from_bytes(bytes, data_type);
    let holds = !text.is_empty() && text.trim() == text && !text.contains(['\r', '\n', '\0']);
    (holds && to_bytes(&text, data_type, None).as_deref() == Ok(bytes)).then_some(text)
}

/// Moves the changes of one PDO in the order that its mapping needs.
fn take_pdo(
    pdo: u16,
    cob_id: Option<u32>,
    changes: &mut BTreeMap<(u16, u8), Vec<u8>>,
    entries: &mut Vec<ConciseEntry>,
) {
    let mapping = pdo + 0x200;
    let mut push = |index, subindex, data| entries.push(ConciseEntry { index, subindex, data });
    let of = |index: u16, changes: &mut BTreeMap<(u16, u8), Vec<u8>>| -> Vec<(u8, Vec<u8>)> {
        let keys: Vec<_> = changes.range((index, 0)..=(index, u8::MAX)).map(|(key, _)| *key).collect();
        keys.into_iter().filter_map(|key| Some((key.1, changes.remove(&key)?))).collect()
    };
    if let Some(cob_id) = cob_id {
        push(pdo, 1, (cob_id | INVALID).to_le_bytes().to_vec());
    }
    for (subindex, data) in of(pdo, changes).into_iter().filter(|(subindex, _)| *subindex != 1) {
        push(pdo, subindex, data);
    }
    let (number, objects): (Vec<_>, Vec<_>) =
        of(mapping, changes).into_iter().partition(|(subindex, _)| *subindex == 0);
    if !number.is_empty() {
        push(mapping, 0, [0].to_vec());
    }
    for (subindex, data) in objects.into_iter().chain(number) {
        push(mapping, subindex, data);
    }
    if let Some(cob_id) = cob_id {
        push(pdo, 1, cob_id.to_le_bytes().to_vec());
    }
}

#[cfg(test)]
mod tests {
    use super::super::read;
    use super::*;
    use alloc::string::ToString;
    use alloc::vec;

    const DCF: &str = "[DeviceComissioning]\nNodeID=5\n[1017]\nParameterName=H\nDataType=6\nAccessType=rw\nDefaultValue=0\n\
        ParameterValue=1000\n[1018]\nParameterName=C\nDataType=7\nAccessType=ro\nParameterValue=1\n\
        [1800]\nParameterName=T\nObjectType=9\nSubNumber=2\n[1800sub1]\nParameterName=COB\nDataType=7\nAccessType=rw\n\
        DefaultValue=$NODEID+0x180\n[1800sub2]\nParameterName=Type\nDataType=5\nAccessType=rw\nDefaultValue=255\nParameterValue=1\n\
        [1A00]\nParameterName=M\nObjectType=9\nSubNumber=2\n[1A00sub0]\nParameterName=N\nDataType=5\nAccessType=rw\n\
        DefaultValue=0\nParameterValue=1\n[1A00sub1]\nParameterName=A\nDataType=7\nAccessType=rw\nParameterValue=0x60410010\n\
        [6000]\nParameterName=same\nDataType=5\nAccessType=rw\nDefaultValue=0x10\nParameterValue=16\n";

    #[test]
    fn pdos_are_out_of_service_while_mapped() {
        let device = read(DCF.as_bytes()).unwrap().device;
        let entries = device.to_concise(None).unwrap();
        let texts: Vec<_> =
            entries.iter().map(|e| format!("{:04X}:{} {:02X?}", e.index, e.subindex, e.data)).collect();
        assert_eq!(
            texts,
            [
                "1017:0 [E8, 03]",
                "1800:1 [85, 01, 00, 80]",
                "1800:2 [01]",
                "1A00:0 [00]",
                "1A00:1 [10, 00, 41, 60]",
                "1A00:0 [01]",
                "1800:1 [85, 01, 00, 00]",
                // A device may hold anything: also what is the default is written.
                "6000:0 [10]",
            ]
        );
        let bytes = encode_concise(&entries);
        assert_eq!(bytes[..13], [8, 0, 0, 0, 0x17, 0x10, 0, 2, 0, 0, 0, 0xE8, 3]);
        assert_eq!(parse_concise(&bytes), Ok(entries.clone()));

        let mut other = device.clone();
        for object in &mut other.objects {
            object.own.value = None;
            object.subs.iter_mut().for_each(|entry| entry.value = None);
        }
        assert_eq!(other.apply_concise(&entries), []);
        assert_eq!(other.to_concise(Some(5)).unwrap(), entries);
    }

    fn written(device: &Device) -> Vec<String> {
        let entries = device.to_concise(Some(5)).unwrap();
        entries.iter().map(|e| format!("{:04X}:{} {:02X?}", e.index, e.subindex, e.data)).collect()
    }

    /// With one of its objects configured, and the rest of it as the device has it, a PDO would be left
    /// with any mapping, or none.
    #[test]
    fn a_mapping_is_written_as_a_whole() {
        let text = "[1800]\nParameterName=T\nObjectType=9\nSubNumber=2\n[1800sub1]\nParameterName=COB\nDataType=7\n\
            AccessType=rw\nDefaultValue=$NODEID+0x180\n\
            [1A00]\nParameterName=M\nObjectType=9\nSubNumber=4\n[1A00sub0]\nParameterName=N\nDataType=5\nAccessType=rw\n\
            DefaultValue=2\n[1A00sub1]\nParameterName=A\nDataType=7\nAccessType=rw\nDefaultValue=0x60410010\n\
            [1A00sub2]\nParameterName=B\nDataType=7\nAccessType=rw\nDefaultValue=0x60640020\nParameterValue=0x60610008\n\
            [1A00sub3]\nParameterName=C\nDataType=7\nAccessType=rw\nDefaultValue=0x606C0020\n";
        let device = read(text.as_bytes()).unwrap().device;
        let whole = [
            "1800:1 [85, 01, 00, 80]",
            "1A00:0 [00]",
            "1A00:1 [10, 00, 41, 60]",
            "1A00:2 [08, 00, 61, 60]",
            "1A00:0 [02]",
            "1800:1 [85, 01, 00, 00]",
        ];
        assert_eq!(written(&device), whole);
        // A number that the file does not say is that of the objects that it configures.
        let silent = read(text.replace("DefaultValue=2\n", "").as_bytes()).unwrap().device;
        assert_eq!(written(&silent), whole);
        // One that cannot be written is left alone, and so is the identifier.
        let fixed = text.replacen("AccessType=rw\nDefaultValue=$", "AccessType=ro\nDefaultValue=$", 1);
        let fixed = read(fixed.replace("DataType=5\nAccessType=rw", "DataType=5\nAccessType=ro").as_bytes());
        assert_eq!(written(&fixed.unwrap().device), ["1A00:2 [08, 00, 61, 60]"]);
    }

    #[test]
    fn orders_that_are_defaults_are_not_given() {
        let text = "[1011]\nParameterName=L\nObjectType=9\nSubNumber=2\n[1011sub1]\nParameterName=all\nDataType=7\n\
            AccessType=rw\nDefaultValue=1\nParameterValue=1\n";
        assert_eq!(written(&read(text.as_bytes()).unwrap().device), [""; 0]);
        let order = text.replace("ParameterValue=1", "ParameterValue=0x64616F6C");
        assert_eq!(written(&read(order.as_bytes()).unwrap().device), ["1011:1 [6C, 6F, 61, 64]"]);
    }

    /// Written while the PDO is in service, a mapping is refused, or changes what moves meanwhile.
    #[test]
    fn a_mapping_is_not_written_while_the_cob_id_is_unknown() {
        let text = DCF.replace("[DeviceComissioning]\nNodeID=5\n", "");
        let device = read(text.as_bytes()).unwrap().device;
        let error = ConciseValueError { index: 0x1800, subindex: 1, error: ValueError::NeedsNodeId };
        assert_eq!(device.to_concise(None), Err(error));
        assert_eq!(device.to_concise(Some(5)).unwrap().len(), 8);
    }

    #[test]
    fn damage_is_named() {
        let error = ConciseError::Short { entry: 0, count: 0, offset: 0, needs: 4, left: 3 };
        assert_eq!(parse_concise(&[1, 0, 0]), Err(error));
        let bytes = [1, 0, 0, 0, 0x17, 0x10, 0, 0xFF, 0xFF, 0xFF, 0xFF, 1];
        let error = ConciseError::Short { entry: 1, count: 1, offset: 11, needs: 0xFFFF_FFFF, left: 1 };
        assert_eq!(parse_concise(&bytes), Err(error));
        let bytes = [1, 0, 0, 0, 0x17, 0x10, 0, 5, 0, 0, 0, 1, 2];
        let told = "entry 1 of 1 needs 5 bytes at offset 11, 2 are there";
        assert_eq!(parse_concise(&bytes).unwrap_err().to_string(), told);
        assert_eq!(parse_concise(&[0, 0, 0, 0, 9]), Err(ConciseError::Surplus(1)));
        let unknown = vec![ConciseEntry { index: 0x2000, subindex: 0, data: vec![1] }];
        assert_eq!(read(DCF.as_bytes()).unwrap().device.apply_concise(&unknown), unknown);
    }

    #[test]
    fn bytes_of_another_length_are_no_value() {
        let text = "[2000]\nParameterName=a\nDataType=6\nAccessType=rw\n[2001]\nParameterName=b\nDataType=9\nAccessType=rw\n";
        let mut device = read(text.as_bytes()).unwrap().device;
        let entry = |index, data: &[u8]| ConciseEntry { index, subindex: 0, data: data.to_vec() };
        let refused = vec![entry(0x2000, &[1]), entry(0x2000, &[1, 2, 3]), entry(0x2001, b"two\nlines")];
        assert_eq!(device.apply_concise(&refused), refused);
        assert_eq!(device.to_concise(None), Ok(vec![]));
        let taken = vec![entry(0x2000, &[1, 2]), entry(0x2001, b"one line")];
        assert_eq!(device.apply_concise(&taken), []);
        assert_eq!(device.to_concise(None), Ok(taken));
    }
}
