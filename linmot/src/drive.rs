//! The drive's side: what a [`Drive`] must be able to do, the [`Service`] that carries commands out
//! on it for every carrier, and the handshake of the process data carrier.

use core::time::Duration;

use crate::code::{ParameterType, Status};
use crate::curve::{IDS, INFO_SIZE, INFO_WORDS, MAX_SETPOINTS, SETPOINT_SIZE};
use crate::module::{Input, Output};
use crate::request::{Access, List, Memory, Reply, Request, Value};
use crate::table::{ENTRIES, ENTRY_SIZE, ENTRY_WORDS, Entry, Presence};
use crate::upid::{Layer, Upid, Usage};

/// A parameter as its drive describes it (manual B 3).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Parameter {
    /// Its ID.
    pub upid: Upid,
    /// Its type.
    pub kind: ParameterType,
    /// What may be done with it.
    pub usage: Usage,
    /// Raw value.
    pub minimum: u32,
    /// Raw value.
    pub maximum: u32,
    /// Raw value.
    pub default: u32,
}

impl Parameter {
    /// Whether a raw value, of which the bits of its type count, lies between minimum and maximum.
    #[must_use]
    pub fn takes(&self, raw: u32) -> bool {
        if self.kind == ParameterType::FLOAT {
            let [low, value, high] = [self.minimum, raw, self.maximum].map(f32::from_bits);
            return (low..=high).contains(&value);
        }
        let [low, value, high] = [self.minimum, raw, self.maximum].map(|raw| self.kind.number(raw));
        (low..=high).contains(&value)
    }
}

/// Whether an operation is over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// It is.
    Done,
    /// It goes on; [`Drive::is_busy`] tells when it ends.
    Running,
}

/// An error log entry: code, hours, milliseconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LoggedError {
    /// Error code.
    pub code: u16,
    /// Time high.
    pub hours: u32,
    /// Time low.
    pub milliseconds: u32,
}

/// A curve's block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Block {
    /// 18 words.
    Info,
    /// A word a setpoint.
    Data,
}

/// The storage and programs of a drive. Arguments have been checked against the parameter's
/// description, the ranges of IDs and the state of the transfer before a method is called.
pub trait Drive {
    /// The description of a parameter.
    fn parameter(&self, upid: Upid) -> Option<Parameter>;
    /// The first parameter with this UPID or a greater one.
    fn next_parameter(&self, from: Upid) -> Option<Parameter>;
    /// ROM value of a parameter that exists.
    fn rom(&self, upid: Upid) -> u32;
    /// RAM value of a parameter that exists.
    fn ram(&self, upid: Upid) -> u32;
    /// Writes the ROM value.
    fn set_rom(&mut self, upid: Upid, value: u32);
    /// Writes the RAM value.
    fn set_ram(&mut self, upid: Upid, value: u32);
    /// 31h…34h: ROM values of a layer to their defaults.
    fn defaults(&mut self, layer: Layer);

    /// 30h: the drive is away from now on and comes back with ROM copied to RAM.
    fn restart(&mut self, now: Duration);
    /// Whether the drive is restarting and answers nothing.
    fn is_restarting(&self, now: Duration) -> bool;
    /// 35h
    fn stop(&mut self, now: Duration) -> Progress;
    /// 36h
    fn start(&mut self, now: Duration) -> Progress;
    /// Whether the MC software is stopped.
    fn is_stopped(&self) -> bool;
    /// Whether an operation that returned [`Progress::Running`] still goes on.
    fn is_busy(&self, now: Duration) -> bool;
    /// When the state changes by itself; `None` = never.
    fn poll_timeout(&self) -> Option<Duration>;
    /// Time passes: what has ended by `now` takes effect. Called before every command.
    fn advance(&mut self, now: Duration);

    /// Sizes in bytes of the info and data block of a curve in RAM.
    fn curve(&self, id: u16) -> Option<(u16, u16)>;
    /// One word of a curve in RAM.
    fn curve_word(&self, id: u16, block: Block, word: u16) -> u32;
    /// Makes room for a curve of this data size, or takes a copy of the existing one if `modify`;
    /// not visible before [`commit_curve`](Self::commit_curve). `false` if there is no room.
    fn open_curve(&mut self, id: u16, data_size: u16, modify: bool) -> bool;
    /// Writes one word of the curve that was opened.
    fn put_curve_word(&mut self, block: Block, word: u16, value: u32);
    /// The curve that was opened replaces the one in RAM. `false` if its blocks contradict.
    fn commit_curve(&mut self) -> bool;
    /// 41h
    fn delete_curves(&mut self);
    /// 40h
    fn save_curves(&mut self, now: Duration) -> Progress;

    /// 70h: logged and occurred errors.
    fn error_counts(&self) -> (u16, u16);
    /// 71h…73h: entry 0…24.
    fn error(&self, entry: u16) -> Option<LoggedError>;
    /// 74h: the text of a code, 32 bytes at most.
    fn error_text(&self, code: u16) -> &[u8];

    /// Entries that exist in RAM.
    fn presence(&self) -> Presence;
    /// One entry of the command table in RAM.
    fn entry(&self, entry: u16) -> Option<Entry>;
    /// Writes or deletes one.
    fn set_entry(&mut self, entry: u16, content: Option<Entry>);
    /// 80h
    fn save_table(&mut self, now: Duration) -> Progress;
}

#[derive(Debug, Clone, Copy)]
struct CurveTransfer {
    access: Access,
    id: u16,
    /// Words of each block, and how many were transferred.
    info: (u16, u16),
    data: (u16, u16),
}

#[derive(Debug, Clone, Copy)]
struct EntryTransfer {
    write: bool,
    entry: u16,
    done: usize,
    words: [u32; ENTRY_WORDS],
}

/// Carries commands out, in the order in which carriers hand them over, and keeps what reaches over
/// several of them: the list that is being read, the curve and the table entry under way.
#[derive(Debug, Clone, Default)]
pub struct Service {
    lists: [Option<u32>; 2],
    curve: Option<CurveTransfer>,
    entry: Option<EntryTransfer>,
}

impl Service {
    /// Nothing under way, as after a restart.
    #[must_use]
    pub const fn new() -> Self {
        Self { lists: [None; 2], curve: None, entry: None }
    }

    /// Carries one command out. [`Status::RUNNING`] means that it goes on until
    /// [`Drive::is_busy`] says otherwise; until then every other command is answered with
    /// [`Status::BUSY`].
    pub fn execute(&mut self, now: Duration, request: &Request, drive: &mut impl Drive) -> Reply {
        drive.advance(now);
        let [first, ..] = request.words();
        let done = |status| Reply::new(status, [first, 0, 0]);
        let progress = |progress| match progress {
            Progress::Done => Status::OK,
            Progress::Running => Status::RUNNING,
        };
        if drive.is_busy(now) && *request != Request::NoOperation {
            return done(Status::BUSY);
        }
        match *request {
            Request::NoOperation => done(Status::OK),
            Request::Read { value, upid } => match read(drive, value, upid) {
                Ok(value) => Reply::with_value(Status::OK, upid.0, value),
                Err(status) => done(status),
            },
            Request::Write { memory, upid, value } => match write(drive, memory, upid, value) {
                Ok(value) => Reply::with_value(Status::OK, upid.0, value),
                Err(status) => Reply::with_value(status, upid.0, value),
            },
            Request::StartList { list, from } => {
                *self.list(list) = Some(from.0.into());
                done(Status::OK)
            }
            Request::NextItem(list) => self.next_item(list, drive),
            Request::Restart => {
                *self = Self::new();
                drive.restart(now);
                done(Status::OK)
            }
            Request::Defaults(layer) => {
                drive.defaults(layer);
                done(Status::OK)
            }
            Request::Stop => done(progress(drive.stop(now))),
            Request::Start => done(progress(drive.start(now))),
            Request::SaveCurves if drive.is_stopped() => done(progress(drive.save_curves(now))),
            Request::SaveTable if drive.is_stopped() => done(progress(drive.save_table(now))),
            Request::SaveCurves | Request::SaveTable => done(Status::NOT_STOPPED),
            Request::DeleteCurves => {
                self.curve = None;
                drive.delete_curves();
                done(Status::OK)
            }
            Request::StartCurve { access, curve, info, data } => {
                self.start_curve(access, curve, info, data, drive)
            }
            Request::CurveInfo { access, curve, value } => {
                self.curve_word(access, curve, Block::Info, value, drive)
            }
            Request::CurveData { access, curve, value } => {
                self.curve_word(access, curve, Block::Data, value, drive)
            }
            Request::ErrorCounts => {
                let (logged, occurred) = drive.error_counts();
                Reply::new(Status::OK, [0, logged, occurred])
            }
            Request::ErrorCode { entry } => error(drive, entry, |error| error.code.into()),
            Request::ErrorTimeLow { entry } => error(drive, entry, |error| error.milliseconds),
            Request::ErrorTimeHigh { entry } => error(drive, entry, |error| error.hours),
            Request::ErrorText { code, stringlet } if stringlet < crate::upid::STRINGLETS => {
                let text = crate::upid::stringlet(drive.error_text(code), stringlet);
                Reply::with_value(Status::OK, code, text)
            }
            Request::ErrorText { .. } => done(Status::RANGE),
            Request::ClearTable => {
                self.entry = None;
                ENTRIES.for_each(|entry| drive.set_entry(entry, None));
                done(Status::OK)
            }
            Request::DeleteEntry { entry } => match drive.entry(entry) {
                Some(_) => {
                    drive.set_entry(entry, None);
                    done(Status::OK)
                }
                None => done(Status::DEFINED),
            },
            Request::WriteEntry { entry, size } => {
                if !ENTRIES.contains(&entry) {
                    return done(Status::DEFINED);
                }
                if usize::from(size) != ENTRY_SIZE {
                    return Reply::new(Status::SIZE, [entry, size, 0]);
                }
                self.entry = Some(EntryTransfer { write: true, entry, done: 0, words: [0; ENTRY_WORDS] });
                Reply::new(Status::OK, [entry, size, 0])
            }
            Request::GetEntry { entry } => match drive.entry(entry) {
                Some(content) => {
                    self.entry = Some(EntryTransfer { write: false, entry, done: 0, words: content.words() });
                    Reply::new(Status::OK, [entry, ENTRY_SIZE as u16, 0])
                }
                None => done(Status::DEFINED),
            },
            Request::WriteEntryData { entry, value } => self.entry_word(entry, Some(value), drive),
            Request::GetEntryData { entry } => self.entry_word(entry, None, drive),
            Request::Presence { list } => {
                let list = list.get();
                Reply::with_value(Status::OK, u16::from(list) * 4, drive.presence().list(list))
            }
        }
    }

    fn list(&mut self, list: List) -> &mut Option<u32> {
        let [all, modified] = &mut self.lists;
        match list {
            List::All => all,
            List::Modified => modified,
        }
    }

    fn next_item(&mut self, list: List, drive: &impl Drive) -> Reply {
        let Some(mut from) = *self.list(list) else { return Reply::new(Status::NO_START, [0; 3]) };
        loop {
            let found = u16::try_from(from).ok().and_then(|from| drive.next_parameter(Upid(from)));
            let Some(parameter) = found else {
                *self.list(list) = Some(u32::from(u16::MAX) + 1);
                return Reply::new(Status::END, [u16::MAX, 0, 0]);
            };
            from = u32::from(parameter.upid.0) + 1;
            *self.list(list) = Some(from);
            let upid = parameter.upid;
            match list {
                List::All => {
                    return Reply::new(Status::OK, [upid.0, parameter.usage.0, parameter.kind.0.into()]);
                }
                List::Modified
                    if parameter.usage.contains(Usage::ROM_WRITE) && drive.rom(upid) != parameter.default =>
                {
                    return Reply::with_value(Status::OK, upid.0, drive.rom(upid));
                }
                List::Modified => {}
            }
        }
    }

    fn start_curve(
        &mut self,
        access: Access,
        id: u16,
        info: u16,
        data: u16,
        drive: &mut impl Drive,
    ) -> Reply {
        let (max, present) = (MAX_SETPOINTS * SETPOINT_SIZE, drive.curve(id));
        let sizes_are_good = info == INFO_SIZE
            && data.is_multiple_of(SETPOINT_SIZE)
            && (2 * SETPOINT_SIZE..=max).contains(&data);
        let status = match (access, present) {
            _ if !IDS.contains(&id) => Status::DEFINED,
            (Access::Add, Some(_)) | (Access::Modify | Access::Get, None) => Status::DEFINED,
            (Access::Add, None) if !sizes_are_good => Status::SIZE,
            (Access::Modify, Some(present)) if (info, data) != present => Status::SIZE,
            (Access::Add | Access::Modify, _) if !drive.open_curve(id, data, access == Access::Modify) => {
                Status::SIZE
            }
            _ => Status::OK,
        };
        if status != Status::OK {
            return Reply::new(status, [id, info, data]);
        }
        let (info, data) = match (access, present) {
            (Access::Get, Some(present)) => present,
            _ => (info, data),
        };
        let words = data / SETPOINT_SIZE;
        self.curve = Some(CurveTransfer { access, id, info: (INFO_WORDS as u16, 0), data: (words, 0) });
        Reply::new(Status::OK, [id, info, data])
    }

    fn curve_word(
        &mut self,
        access: Access,
        id: u16,
        block: Block,
        value: u32,
        drive: &mut impl Drive,
    ) -> Reply {
        let finished = Reply::with_value(Status::ODD_ADDRESS, id, value);
        let Some(transfer) = &mut self.curve else { return finished };
        if transfer.id != id || transfer.access != access {
            return Reply::with_value(Status::DEFINED, id, value);
        }
        let (all, done) = match block {
            Block::Info => &mut transfer.info,
            Block::Data => &mut transfer.data,
        };
        if *done >= *all {
            return finished;
        }
        let word = *done;
        *done += 1;
        let block_ended = *done == *all;
        let both_ended = transfer.info.0 == transfer.info.1 && transfer.data.0 == transfer.data.1;
        let value = match access {
            Access::Get => drive.curve_word(id, block, word),
            Access::Add | Access::Modify => {
                drive.put_curve_word(block, word, value);
                value
            }
        };
        let commit = match access {
            Access::Get => false,
            // A new curve exists when it is complete; of an existing one a block may be left as it is.
            Access::Add => both_ended,
            Access::Modify => block_ended,
        };
        if commit && !drive.commit_curve() {
            self.curve = None;
            return Reply::with_value(Status::SIZE, id, value);
        }
        let status = if block_ended { Status::OK } else { Status::NOT_FINISHED };
        Reply::with_value(status, id, value)
    }

    fn entry_word(&mut self, entry: u16, write: Option<u32>, drive: &mut impl Drive) -> Reply {
        let reply = |status, value| Reply::with_value(status, entry, value);
        let Some(transfer) = &mut self.entry else { return reply(Status::ODD_ADDRESS, 0) };
        if transfer.entry != entry || transfer.write != write.is_some() {
            return reply(Status::DEFINED, 0);
        }
        let Some(word) = transfer.words.get_mut(transfer.done) else { return reply(Status::ODD_ADDRESS, 0) };
        transfer.done += 1;
        if let Some(value) = write {
            *word = value;
        }
        let value = *word;
        if transfer.done < ENTRY_WORDS {
            return reply(Status::NOT_FINISHED, value);
        }
        if write.is_some() {
            match Entry::from_words(&transfer.words) {
                Ok(content) => drive.set_entry(entry, Some(content)),
                Err(_) => return reply(Status::RANGE, value),
            }
        }
        reply(Status::OK, value)
    }
}

fn read(drive: &impl Drive, value: Value, upid: Upid) -> Result<u32, Status> {
    let parameter = drive.parameter(upid).ok_or(Status::UPID)?;
    let may = |usage| if parameter.usage.contains(usage) { Ok(()) } else { Err(Status::USAGE) };
    if parameter.kind == ParameterType::STRING {
        return Err(Status::TYPE);
    }
    Ok(match value {
        Value::Rom => may(Usage::ROM_READ).map(|()| drive.rom(upid))?,
        Value::Ram => may(Usage::RAM_READ).map(|()| drive.ram(upid))?,
        Value::Minimum => parameter.minimum,
        Value::Maximum => parameter.maximum,
        Value::Default => parameter.default,
    })
}

/// Returns what was written: the bits that belong to the parameter's type.
fn write(drive: &mut impl Drive, memory: Memory, upid: Upid, value: u32) -> Result<u32, Status> {
    let parameter = drive.parameter(upid).ok_or(Status::UPID)?;
    if parameter.kind == ParameterType::STRING {
        return Err(Status::TYPE);
    }
    let needed = match memory {
        Memory::Rom => Usage::ROM_WRITE,
        Memory::Ram => Usage::RAM_WRITE,
        Memory::Both => Usage::RAM_WRITE | Usage::ROM_WRITE,
    };
    if !parameter.usage.contains(needed) {
        return Err(Status::USAGE);
    }
    let value = value & parameter.kind.mask();
    if !parameter.takes(value) {
        return Err(Status::RANGE);
    }
    if memory != Memory::Ram {
        drive.set_rom(upid, value);
    }
    if memory != Memory::Rom {
        drive.set_ram(upid, value);
    }
    Ok(value)
}

fn error(drive: &impl Drive, entry: u16, field: impl Fn(LoggedError) -> u32) -> Reply {
    match drive.error(entry) {
        Some(error) => Reply::with_value(Status::OK, entry, field(error)),
        None => Reply::new(Status::RANGE, [entry, 0, 0]),
    }
}

/// The drive's side of the process data carrier.
///
/// - Input: [`handle_output`](Self::handle_output), [`handle_timeout`](Self::handle_timeout).
/// - Output: [`image`](Self::image) for a cyclic carrier, or [`poll_transmit`](Self::poll_transmit)
///   when it changes.
#[derive(Debug, Clone)]
pub struct Module {
    service: Service,
    input: Input,
    changed: bool,
    /// The command in the image goes on, or waits.
    running: bool,
    /// Waits for the end of what the drive is busy with.
    waiting: Option<Request>,
    away: bool,
}

impl Default for Module {
    fn default() -> Self {
        Self::new()
    }
}

impl Module {
    /// As after a restart: count 0.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            service: Service::new(),
            input: Input::IDLE,
            changed: false,
            running: false,
            waiting: None,
            away: false,
        }
    }

    /// The process data from the drive as they are now.
    #[must_use]
    pub const fn image(&self) -> [u8; 8] {
        self.input.encode()
    }

    /// Takes the process data to the drive, whenever they arrive. A command is carried out when its
    /// count is not the one echoed last.
    pub fn handle_output(&mut self, now: Duration, image: [u8; 8], drive: &mut impl Drive) {
        self.handle_timeout(now, drive);
        let output = Output::parse(image);
        if drive.is_restarting(now) {
            return;
        }
        if output.count == self.input.count || self.running {
            // The master repeats itself, so it may have missed what was shown.
            self.changed = true;
            return;
        }
        self.input.count = output.count;
        match Request::parse(output.command, output.words) {
            Some(request) => self.execute(now, &request, drive),
            // Manual B has no status for it; project-defined.
            None => self.show(Reply::new(Status::RANGE, output.words)),
        }
        self.away = drive.is_restarting(now);
    }

    fn show(&mut self, reply: Reply) {
        self.running = reply.status.is_running();
        self.input.reply = reply;
        self.changed = true;
    }

    /// A command that finds the drive busy shows that until its turn comes (project-defined).
    fn execute(&mut self, now: Duration, request: &Request, drive: &mut impl Drive) {
        let reply = self.service.execute(now, request, drive);
        self.waiting = (reply.status == Status::BUSY).then_some(*request);
        self.show(reply);
    }

    /// Shows the end of a command that was running, carries out one that had to wait, and shows the idle
    /// image after a restart.
    pub fn handle_timeout(&mut self, now: Duration, drive: &mut impl Drive) {
        if drive.is_restarting(now) {
            self.away = true;
            return;
        }
        if self.away {
            *self = Self { changed: true, ..Self::new() };
        }
        if self.running && !drive.is_busy(now) {
            match self.waiting.take() {
                Some(request) => self.execute(now, &request, drive),
                None => self.show(Reply { status: Status::OK, ..self.input.reply }),
            }
            self.away = drive.is_restarting(now);
        }
    }

    /// The process data, when they have changed.
    pub fn poll_transmit(&mut self) -> Option<[u8; 8]> {
        core::mem::take(&mut self.changed).then(|| self.image())
    }
}
