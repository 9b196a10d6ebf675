//! Non-volatile memory of virtual controllers, kept in a file.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::Path;

use motion_core::STORAGE_LEN;
use motion_core::storage::{Storage, StorageError};

/// Non-volatile memory in a file, which no other program may use meanwhile.
pub(crate) struct FileStorage(File);

impl FileStorage {
    pub(crate) fn open(path: &Path) -> std::io::Result<Self> {
        let file = File::options().read(true).write(true).create(true).truncate(false).open(path)?;
        file.try_lock().map_err(|_| std::io::Error::other("in use by another program"))?;
        match file.metadata()?.len() {
            // New.
            0 => (&file).write_all(&vec![0xFF; STORAGE_LEN])?,
            len if len == STORAGE_LEN as u64 => {}
            // Somebody's file, which must not become another one's memory.
            len => {
                let text = format!("no state of a controller: {STORAGE_LEN} bytes expected, it has {len}");
                return Err(std::io::Error::other(text));
            }
        }
        file.sync_all()?;
        Ok(Self(file))
    }
}

impl Storage for FileStorage {
    fn read(&self, offset: usize, out: &mut [u8]) -> Result<(), StorageError> {
        let mut file = &self.0;
        file.seek(SeekFrom::Start(offset as u64))
            .and_then(|_| file.read_exact(out))
            .map_err(|_| StorageError { offset })
    }

    fn write(&mut self, offset: usize, data: &[u8]) -> Result<(), StorageError> {
        self.0
            .seek(SeekFrom::Start(offset as u64))
            .and_then(|_| self.0.write_all(data))
            .map_err(|_| StorageError { offset })
    }

    fn sync(&mut self) -> Result<(), StorageError> {
        self.0.sync_data().map_err(|_| StorageError { offset: 0 })
    }
}
