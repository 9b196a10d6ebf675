//! Non-volatile memory of virtual controllers, kept in a file.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::Path;

use motion_core::storage::{Storage, StorageError};
use motion_core::{Model, STORAGE_LEN, is_damaged, stored_model};

use crate::exit::Exit;
use crate::output::Output;

/// Bytes of a state that was made before it had the model at its end.
const BEFORE_MODEL: usize = 141_072;

/// Non-volatile memory in a file, which no other program may use meanwhile.
pub(crate) struct FileStorage(File);

impl FileStorage {
    /// That of a controller of this model, and no other; told where it is damaged.
    pub(crate) fn of(out: &Output, path: &Path, model: Model) -> Result<Self, Exit> {
        let name = path.display();
        let trouble = |error: &dyn core::fmt::Display| Exit::file(&name.to_string(), error);
        let storage = Self::open(path).map_err(|error| trouble(&error))?;
        if let Some(stored) = stored_model(&storage).filter(|stored| *stored != model.number()) {
            return Err(trouble(&format!("the state of a GEL {stored}, GEL {} expected", model.number())));
        }
        if is_damaged(&storage).map_err(|error| trouble(&error))? {
            out.remark(format!(
                "{name} is damaged: what cannot be read of it is as it was saved before, or as delivered"
            ));
        }
        Ok(storage)
    }

    fn open(path: &Path) -> std::io::Result<Self> {
        let file = File::options().read(true).write(true).create(true).truncate(false).open(path)?;
        file.try_lock().map_err(|_| std::io::Error::other("in use by another program"))?;
        match file.metadata()?.len() as usize {
            len @ (0 | BEFORE_MODEL) => {
                (&file).seek(SeekFrom::End(0))?;
                (&file).write_all(&vec![0xFF; STORAGE_LEN - len])?;
            }
            STORAGE_LEN => {}
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
