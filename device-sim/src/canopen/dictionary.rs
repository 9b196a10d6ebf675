//! The objects and the device as the slave's engine works on them.

use canopen_master::data_type::DataType;
use canopen_master::od::{LOAD, ProcessData, SAVE};
use canopen_master::sdo::{AbortCode, Access, Piece, Total, read_slice};
use pdo::{Address, Payload};

use super::Device;
use super::objects::{Entry, Objects};

/// Everything of a node but its PDO parameters.
#[derive(Debug)]
pub(super) struct Dictionary<D> {
    pub(super) device: D,
    pub(super) objects: Objects,
    /// A download in several frames.
    download: Vec<u8>,
}

impl<D: Device> Dictionary<D> {
    pub(super) const fn new(device: D, objects: Objects) -> Self {
        Self { device, objects, download: Vec::new() }
    }

    pub(super) fn writable(&self, at: Address) -> Result<&Entry, AbortCode> {
        let entry = self.objects.found(at)?;
        if entry.rights.can_write() { Ok(entry) } else { Err(AbortCode::READ_ONLY) }
    }

    fn store(&mut self, at: Address, value: &[u8]) -> Result<(), AbortCode> {
        self.writable(at)?.check(value)?;
        match at.index {
            // What these do is up to the node.
            0x1010 | 0x1011 => {
                let signature = if at.index == 0x1010 { SAVE } else { LOAD };
                return if value == signature { Ok(()) } else { Err(AbortCode::CANNOT_STORE) };
            }
            _ => self.device.check(&self.objects, at, value)?,
        }
        if let Some(entry) = self.objects.entry_mut(at) {
            entry.value.clear();
            entry.value.extend_from_slice(value);
        }
        Ok(())
    }
}

impl<D: Device> Access for Dictionary<D> {
    fn read(&mut self, at: Address, offset: u32, out: &mut [u8]) -> Result<(usize, Total), AbortCode> {
        let entry = self.objects.found(at)?;
        if !entry.rights.can_read() {
            return Err(AbortCode::WRITE_ONLY);
        }
        Ok(read_slice(&entry.value, offset, out))
    }

    fn begin_write(&mut self, at: Address, size: Option<u32>) -> Result<(), AbortCode> {
        let longest = self.writable(at)?.longest();
        self.download.clear();
        if size.is_some_and(|size| size as usize > longest) { Err(AbortCode::TOO_LONG) } else { Ok(()) }
    }

    fn write(&mut self, at: Address, piece: &Piece<'_>) -> Result<(), AbortCode> {
        let entry = self.writable(at)?;
        if let Some(size) = entry.data_type.size() {
            return self.store(at, piece.exactly(size.into())?);
        }
        let longest = entry.longest();
        self.download.truncate(piece.offset as usize);
        if self.download.len() + piece.data.len() > longest {
            return Err(AbortCode::TOO_LONG);
        }
        self.download.extend_from_slice(piece.data);
        if piece.last {
            let value = core::mem::take(&mut self.download);
            return self.store(at, &value);
        }
        Ok(())
    }

    fn abandon(&mut self, _at: Address) {
        self.download.clear();
    }
}

impl<D: Device> ProcessData for Dictionary<D> {
    fn mapped_type(&self, at: Address, rpdo: bool) -> Result<DataType, AbortCode> {
        let entry = self.objects.entry(at).ok_or(AbortCode::NO_OBJECT)?;
        if entry.mappable && entry.rights.can_map(rpdo) {
            Ok(entry.data_type)
        } else {
            Err(AbortCode::NOT_MAPPABLE)
        }
    }

    fn bits(&self, at: Address) -> u64 {
        let value = self.objects.entry(at).map_or(&[][..], |entry| &entry.value);
        Payload::from_slice(value).word()
    }

    fn set_bits(&mut self, at: Address, bits: u64) {
        let len = self.objects.entry(at).map_or(0, |entry| entry.value.len().min(8));
        // A value that the object does not take leaves it as it was.
        let _ = self.store(at, bits.to_le_bytes().get(..len).unwrap_or(&[]));
    }
}
