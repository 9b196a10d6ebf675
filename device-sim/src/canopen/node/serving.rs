//! What the SDO server of a virtual node reads and writes.

use core::time::Duration;

use canopen_master::emcy::Emergency;
use canopen_master::nmt::State;
use canopen_master::sdo::{self, AbortCode, Access, Piece, Total, read_slice};
use pdo::Address;

use super::Node;
use crate::canopen::objects::Objects;
use crate::canopen::pdo::check;
use crate::canopen::{Context, Device};

/// "save" and "load", the signatures of 1010h and 1011h (CiA 301, 7.5.2.13).
const SAVE: &[u8] = b"save";
const LOAD: &[u8] = b"load";

impl<D: Device> Node<D> {
    pub(super) fn serve<T>(
        &mut self,
        now: Duration,
        work: impl FnOnce(&mut sdo::Server, &mut Serving<'_, D>) -> T,
    ) -> T {
        let mut emergencies = Vec::new();
        let mut changed = Vec::new();
        let done = {
            let mut serving = Serving {
                now,
                state: self.nmt.state(),
                device: &mut self.device,
                objects: &mut self.objects,
                download: &mut self.download,
                emergencies: &mut emergencies,
                changed: &mut changed,
            };
            work(&mut self.sdo, &mut serving)
        };
        for emergency in emergencies {
            self.emergency(emergency);
        }
        for at in changed {
            self.changed(now, at);
        }
        done
    }

    /// After a write over SDO.
    fn changed(&mut self, now: Duration, at: Address) {
        match at.index {
            0x1003 => {
                self.emergencies.clear_history();
                self.show_history();
            }
            0x1010 => {
                self.objects.set(0x1010, 1, 1);
                let mut kept = self.objects.clone();
                kept.set(0x1001, 0, 0);
                self.stored = Some(kept);
            }
            // The factory's values come back with the next start (CiA 301, 7.5.2.14).
            0x1011 => {
                self.objects.set(0x1011, 1, 1);
                self.stored = None;
            }
            0x1005 | 0x1006 | 0x100C | 0x100D | 0x1015..=0x1017 | 0x1019 => self.configure(now),
            _ => {}
        }
    }
}

/// The objects as the SDO server sees them.
pub(super) struct Serving<'a, D> {
    now: Duration,
    state: State,
    device: &'a mut D,
    objects: &'a mut Objects,
    download: &'a mut Vec<u8>,
    emergencies: &'a mut Vec<Emergency>,
    changed: &'a mut Vec<Address>,
}

impl<D: Device> Serving<'_, D> {
    fn context(&mut self) -> (&mut D, Context<'_>) {
        let Self { now, state, device, objects, emergencies, .. } = self;
        (device, Context { now: *now, objects, state: *state, emergencies })
    }

    fn may_write(&self, at: Address) -> Result<(), AbortCode> {
        let entry = self.objects.entry(at).ok_or_else(|| self.objects.missing(at))?;
        if entry.rights.write { Ok(()) } else { Err(AbortCode::READ_ONLY) }
    }

    fn store(&mut self, at: Address, value: &[u8]) -> Result<(), AbortCode> {
        self.may_write(at)?;
        if let Some(entry) = self.objects.entry(at) {
            entry.check(value)?;
        }
        match at.index {
            0x1003 if value != [0] => return Err(AbortCode::INVALID_VALUE),
            0x1010 if value != SAVE => return Err(AbortCode::CANNOT_STORE),
            0x1011 if value != LOAD => return Err(AbortCode::CANNOT_STORE),
            _ => {}
        }
        if let Some(allowed) = check(self.objects, at, value) {
            allowed?;
        }
        self.device.check(self.objects, at, value)?;
        if let Some(entry) = self.objects.entry_mut(at) {
            entry.value.clear();
            entry.value.extend_from_slice(value);
        }
        let (device, mut context) = self.context();
        device.written(&mut context, at);
        self.changed.push(at);
        Ok(())
    }
}

impl<D: Device> Access for Serving<'_, D> {
    fn read(&mut self, at: Address, offset: u32, out: &mut [u8]) -> Result<(usize, Total), AbortCode> {
        if offset == 0 {
            let (device, mut context) = self.context();
            device.update(&mut context);
        }
        let entry = self.objects.entry(at).ok_or_else(|| self.objects.missing(at))?;
        if !entry.rights.read {
            return Err(AbortCode::WRITE_ONLY);
        }
        Ok(read_slice(&entry.value, offset, out))
    }

    fn begin_write(&mut self, at: Address, size: Option<u32>) -> Result<(), AbortCode> {
        self.may_write(at)?;
        self.download.clear();
        let longest = self.longest(at);
        if size.is_some_and(|size| size as usize > longest) { Err(AbortCode::TOO_LONG) } else { Ok(()) }
    }

    fn write(&mut self, at: Address, piece: &Piece<'_>) -> Result<(), AbortCode> {
        if piece.is_whole() {
            // Without indicated size the object knows how many of the bytes count.
            let own = self.objects.entry(at).and_then(|entry| entry.data_type.size()).map(usize::from);
            let len = own.filter(|_| piece.size.is_none()).unwrap_or(piece.data.len());
            let data = piece.data.get(..len).unwrap_or(piece.data);
            return self.store(at, data);
        }
        if piece.offset == 0 {
            self.download.clear();
        }
        self.download.truncate(piece.offset as usize);
        if self.download.len() + piece.data.len() > self.longest(at) {
            return Err(AbortCode::TOO_LONG);
        }
        self.download.extend_from_slice(piece.data);
        if piece.last {
            let value = core::mem::take(self.download);
            return self.store(at, &value);
        }
        Ok(())
    }

    fn abandon(&mut self, _at: Address) {
        self.download.clear();
    }
}

impl<D> Serving<'_, D> {
    fn longest(&self, at: Address) -> usize {
        let entry = self.objects.entry(at);
        entry.map_or(0, |entry| entry.data_type.size().map_or(entry.longest, usize::from))
    }
}
