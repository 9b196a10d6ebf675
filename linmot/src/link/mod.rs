//! What takes more than one command: lists, strings, curves, table entries, the error log.
//!
//! All of it runs over a [`Link`], which carries one command and waits for its answer; motion-io has
//! links over ports, and any carrier of your own is one method.

mod fault;

use crate::code::Status;
use crate::curve::{INFO_SIZE, INFO_WORDS, InfoBlock};
use crate::drive::LoggedError;
use crate::range::Range;
use crate::request::{Access, List, Memory, Reply, Request, Value};
use crate::table::{ENTRY_SIZE, ENTRY_WORDS, Entry, ListNumber, Presence};
use crate::upid::{Layer, STRINGLETS, TreeIdentity, Upid, Usage};

pub use fault::Fault;

/// Carries one command to a drive and brings its answer.
pub trait Link {
    /// Why no answer came.
    type Error;

    /// Carries one command. An answer of any status is `Ok`; "running" and "busy" are waited for.
    ///
    /// # Errors
    /// No answer came.
    fn call(&mut self, request: &Request) -> Result<Reply, Self::Error>;
}

/// One item of a UPID list.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Item {
    /// The parameter.
    pub upid: Upid,
    /// Its usage; of the modified list it is not told.
    pub usage: Option<Usage>,
}

/// Procedures over a link.
pub trait LinkExt: Link {
    /// Carries a command that must be answered with 00h or 04h.
    ///
    /// # Errors
    /// [`Fault::Carrier`], [`Fault::Refused`].
    fn ask(&mut self, request: Request) -> Result<Reply, Fault<Self::Error>> {
        let reply = self.call(&request).map_err(Fault::Carrier)?;
        if reply.status.is_done() { Ok(reply) } else { Err(Fault::Refused { request, reply }) }
    }

    /// One value of a parameter, raw.
    ///
    /// # Errors
    /// [`Fault::Carrier`], [`Fault::Refused`].
    fn read(&mut self, upid: Upid, value: Value) -> Result<u32, Fault<Self::Error>> {
        self.ask(Request::Read { value, upid }).map(|reply| reply.value())
    }

    /// Minimum and maximum of a parameter.
    ///
    /// # Errors
    /// [`Fault::Carrier`], [`Fault::Refused`].
    fn range(&mut self, upid: Upid) -> Result<Range, Fault<Self::Error>> {
        Ok(Range::new(self.read(upid, Value::Minimum)?, self.read(upid, Value::Maximum)?))
    }

    /// Writes a parameter, raw: not before its range has been asked for, since a drive cuts off what
    /// is too wide (manual B 2.5), and not without reading it back.
    ///
    /// # Errors
    /// [`Fault::Range`] before anything was written, [`Fault::ReadBack`] afterwards;
    /// [`Fault::Carrier`], [`Fault::Refused`].
    fn write(&mut self, upid: Upid, memory: Memory, value: u32) -> Result<(), Fault<Self::Error>> {
        let range = self.range(upid)?;
        if !range.contains(value) {
            return Err(Fault::Range { upid, value: range.number(value), range });
        }
        self.ask(Request::Write { memory, upid, value })?;
        self.verify(upid, memory, value, &range)
    }

    /// Reads back what was written, as far as it can be read.
    ///
    /// # Errors
    /// [`Fault::ReadBack`] for any other value; [`Fault::Carrier`], [`Fault::Refused`].
    fn verify(
        &mut self,
        upid: Upid,
        memory: Memory,
        value: u32,
        range: &Range,
    ) -> Result<(), Fault<Self::Error>> {
        for from in memory.values() {
            let found = match self.read(upid, *from) {
                Ok(found) => range.number(found),
                // It can be written only.
                Err(Fault::Refused { reply, .. }) if reply.status == Status::USAGE => continue,
                Err(fault) => return Err(fault),
            };
            let written = range.number(value);
            if found != written {
                return Err(Fault::ReadBack { upid, memory: *from, written, found });
            }
        }
        Ok(())
    }

    /// Reads a list of UPIDs, one call of `each` an item. The next item is never asked for twice:
    /// after a lost answer the list starts again behind the last UPID known, once an item.
    ///
    /// # Errors
    /// [`Fault::Carrier`] when the second attempt fails too, [`Fault::Refused`].
    fn list(&mut self, list: List, from: Upid, mut each: impl FnMut(Item)) -> Result<(), Fault<Self::Error>>
    where
        Self: Sized,
    {
        self.ask(Request::StartList { list, from })?;
        let (mut next, mut lost) = (Some(from), false);
        loop {
            let request = Request::NextItem(list);
            let reply = match self.call(&request) {
                Ok(reply) => reply,
                Err(error) if lost => return Err(Fault::Carrier(error)),
                Err(_) => {
                    lost = true;
                    let Some(from) = next else { return Ok(()) };
                    self.ask(Request::StartList { list, from })?;
                    continue;
                }
            };
            if reply.status == Status::END {
                return Ok(());
            }
            if !reply.status.is_done() {
                return Err(Fault::Refused { request, reply });
            }
            lost = false;
            let [upid, usage, _] = reply.words;
            next = upid.checked_add(1).map(Upid);
            each(Item { upid: Upid(upid), usage: (list == List::All).then_some(Usage(usage)) });
        }
    }

    /// A string by its own UPID: its stringlets' characters up to the first 00h.
    ///
    /// # Errors
    /// [`Fault::Carrier`], [`Fault::Refused`] when even the first stringlet is.
    fn read_text(
        &mut self,
        upid: Upid,
        value: Value,
        text: &mut [u8; 32],
    ) -> Result<usize, Fault<Self::Error>> {
        *text = [0; 32];
        for (number, four) in (0..STRINGLETS).zip(text.as_chunks_mut::<4>().0) {
            let Some(stringlet) = upid.stringlet(number) else { break };
            match self.read(stringlet, value) {
                Ok(raw) => *four = raw.to_le_bytes(),
                // A shorter string ends here.
                Err(Fault::Refused { reply, .. }) if number > 0 && reply.status == Status::UPID => break,
                Err(fault) => return Err(fault),
            }
        }
        Ok(text.iter().position(|byte| *byte == 0).unwrap_or(32))
    }

    /// Writes a string by its own UPID, stringlet by stringlet, filled with 00h, and reads it back.
    ///
    /// # Errors
    /// [`Fault::Text`] before anything was written; after [`Fault::Carrier`] and [`Fault::Refused`] the
    /// string may be written in part; [`Fault::TextReadBack`].
    fn write_text(&mut self, upid: Upid, memory: Memory, text: &[u8]) -> Result<(), Fault<Self::Error>> {
        if text.len() > 4 * usize::from(STRINGLETS) || text.contains(&0) || upid.stringlet(7).is_none() {
            return Err(Fault::Text { upid, len: text.len() });
        }
        for number in 0..STRINGLETS {
            let Some(stringlet) = upid.stringlet(number) else { break };
            let value = crate::upid::stringlet(text, number);
            match self.ask(Request::Write { memory, upid: stringlet, value }) {
                // A shorter string ends here; characters that do not fit are refused.
                Err(Fault::Refused { reply, .. })
                    if number > 0 && value == 0 && reply.status == Status::UPID =>
                {
                    break;
                }
                other => other.map(|_| ())?,
            }
        }
        for memory in memory.values() {
            let mut found = [0; 32];
            match self.read_text(upid, *memory, &mut found) {
                Ok(len) if found.get(..len) == Some(text) => {}
                Ok(_) => return Err(Fault::TextReadBack { upid, memory: *memory }),
                // It can be written only.
                Err(Fault::Refused { reply, .. }) if reply.status == Status::USAGE => {}
                Err(fault) => return Err(fault),
            }
        }
        Ok(())
    }

    /// Tree ID and versions of one layer.
    ///
    /// # Errors
    /// [`Fault::Carrier`], [`Fault::Refused`].
    fn identity(&mut self, layer: Layer) -> Result<TreeIdentity, Fault<Self::Error>> {
        let [tree_id, main_version, sub_version] = layer.identity();
        Ok(TreeIdentity {
            tree_id: self.read(tree_id, Value::Ram)?,
            main_version: self.read(main_version, Value::Ram)?,
            sub_version: self.read(sub_version, Value::Ram)?,
        })
    }

    /// The info block of a curve, which [`read_setpoint`](Self::read_setpoint) can follow. `None` for
    /// one that is not present.
    ///
    /// # Errors
    /// [`Fault::Carrier`], [`Fault::Refused`], [`Fault::Size`], [`Fault::BlockLength`].
    fn curve_info(&mut self, id: u16) -> Result<Option<InfoBlock>, Fault<Self::Error>> {
        let access = Access::Get;
        let request = Request::StartCurve { access, curve: id, info: 0, data: 0 };
        let [_, info_size, data_size] = match self.ask(request) {
            Ok(reply) => reply.words,
            Err(Fault::Refused { reply, .. }) if reply.status == Status::DEFINED => return Ok(None),
            Err(fault) => return Err(fault),
        };
        if !(INFO_SIZE..=INFO_WORDS as u16 * 4).contains(&info_size) {
            return Err(Fault::Size { request, size: info_size, expected: "70" });
        }
        let mut words = [0; INFO_WORDS];
        for (done, word) in (1..).zip(&mut words) {
            *word = self.block_word(Request::CurveInfo { access, curve: id, value: 0 }, done, INFO_WORDS)?;
        }
        let info = InfoBlock::parse(&words);
        if u32::from(data_size) != info.data_size() {
            return Err(Fault::Size { request, size: data_size, expected: "what the info block says" });
        }
        Ok(Some(info))
    }

    /// The next setpoint of a curve whose info block was read; `number` counts from 1.
    ///
    /// # Errors
    /// [`Fault::Carrier`], [`Fault::Refused`], [`Fault::BlockLength`].
    fn read_setpoint(&mut self, info: &InfoBlock, number: usize) -> Result<i32, Fault<Self::Error>> {
        let request = Request::CurveData { access: Access::Get, curve: info.id, value: 0 };
        self.block_word(request, number, info.setpoints.into()).map(|raw| raw as i32)
    }

    /// Begins to add or modify a curve in RAM; [`write_setpoint`](Self::write_setpoint) follows for
    /// each setpoint, so that a curve of any length needs no memory.
    ///
    /// # Errors
    /// [`Fault::Curve`] before anything was sent; [`Fault::Carrier`], [`Fault::Refused`],
    /// [`Fault::BlockLength`]. A curve that was being added is not there then; of one that was being
    /// modified the info block may be new and the setpoints old.
    fn start_curve(&mut self, access: Access, info: &InfoBlock) -> Result<(), Fault<Self::Error>> {
        let curve = info.id;
        info.check().map_err(|error| Fault::Curve { curve, error })?;
        // Checked: at most 16383 setpoints of 4 bytes.
        let data = info.setpoints * info.setpoint_size;
        self.ask(Request::StartCurve { access, curve, info: INFO_SIZE, data })?;
        for (done, value) in (1..).zip(info.encode()) {
            self.block_word(Request::CurveInfo { access, curve, value }, done, INFO_WORDS)?;
        }
        Ok(())
    }

    /// One setpoint of a curve that was started; `number` counts from 1.
    ///
    /// # Errors
    /// As [`start_curve`](Self::start_curve).
    fn write_setpoint(
        &mut self,
        access: Access,
        info: &InfoBlock,
        number: usize,
        setpoint: i32,
    ) -> Result<(), Fault<Self::Error>> {
        let request = Request::CurveData { access, curve: info.id, value: setpoint as u32 };
        self.block_word(request, number, info.setpoints.into()).map(|_| ())
    }

    /// One word of a block of `all`: the drive must say "not finished" before the last and "done"
    /// with it.
    ///
    /// # Errors
    /// [`Fault::Carrier`], [`Fault::Refused`], [`Fault::BlockLength`].
    fn block_word(&mut self, request: Request, done: usize, all: usize) -> Result<u32, Fault<Self::Error>> {
        let reply = self.ask(request)?;
        if (reply.status == Status::OK) == (done == all) {
            Ok(reply.value())
        } else {
            Err(Fault::BlockLength { request, done, expected: all })
        }
    }

    /// Which command table entries exist.
    ///
    /// # Errors
    /// [`Fault::Carrier`], [`Fault::Refused`].
    fn presence(&mut self) -> Result<Presence, Fault<Self::Error>> {
        let mut presence = Presence::default();
        for list in ListNumber::all() {
            let reply = self.ask(Request::Presence { list })?;
            presence.set_list(list.get(), reply.value());
        }
        Ok(presence)
    }

    /// Reads one command table entry.
    ///
    /// # Errors
    /// [`Fault::Carrier`], [`Fault::Refused`], [`Fault::Size`], [`Fault::Entry`].
    fn read_entry(&mut self, entry: u16) -> Result<Entry, Fault<Self::Error>> {
        let request = Request::GetEntry { entry };
        let [_, size, _] = self.ask(request)?.words;
        if usize::from(size) != ENTRY_SIZE {
            return Err(Fault::Size { request, size, expected: "64" });
        }
        let mut words = [0; ENTRY_WORDS];
        for (done, word) in (1..).zip(&mut words) {
            *word = self.block_word(Request::GetEntryData { entry }, done, ENTRY_WORDS)?;
        }
        Entry::from_words(&words).map_err(|error| Fault::Entry { entry, error })
    }

    /// Writes one command table entry in RAM.
    ///
    /// # Errors
    /// [`Fault::Carrier`], [`Fault::Refused`], [`Fault::BlockLength`]; the entry is as it was then.
    fn write_entry(&mut self, entry: u16, content: &Entry) -> Result<(), Fault<Self::Error>> {
        self.ask(Request::WriteEntry { entry, size: ENTRY_SIZE as u16 })?;
        for (done, value) in (1..).zip(content.words()) {
            self.block_word(Request::WriteEntryData { entry, value }, done, ENTRY_WORDS)?;
        }
        Ok(())
    }

    /// One entry of the error log, 0…24.
    ///
    /// # Errors
    /// [`Fault::Carrier`], [`Fault::Refused`].
    fn logged_error(&mut self, entry: u16) -> Result<LoggedError, Fault<Self::Error>> {
        let [_, code, _] = self.ask(Request::ErrorCode { entry })?.words;
        let milliseconds = self.ask(Request::ErrorTimeLow { entry })?.value();
        let hours = self.ask(Request::ErrorTimeHigh { entry })?.value();
        Ok(LoggedError { code, hours, milliseconds })
    }

    /// The text of an error code: 32 characters at most; returns how many.
    ///
    /// # Errors
    /// [`Fault::Carrier`], [`Fault::Refused`].
    fn error_text(&mut self, code: u16, text: &mut [u8; 32]) -> Result<usize, Fault<Self::Error>> {
        *text = [0; 32];
        for (stringlet, four) in (0..STRINGLETS).zip(text.as_chunks_mut::<4>().0) {
            *four = self.ask(Request::ErrorText { code, stringlet })?.value().to_le_bytes();
        }
        Ok(text.iter().position(|byte| *byte == 0).unwrap_or(32))
    }
}

impl<L: Link + ?Sized> LinkExt for L {}
