//! One command of the configuration module and its answer, whatever carries them (manual B 7.2.1).

use crate::code::{Command, Status};
use crate::table::ListNumber;
use crate::upid::{Layer, Upid};

/// Which value of a parameter to read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Value {
    /// 10h: the non-volatile value.
    Rom,
    /// 11h: the value that the firmware runs on.
    Ram,
    /// 15h.
    Minimum,
    /// 16h.
    Maximum,
    /// 17h.
    Default,
}

/// Which memory to write.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Memory {
    /// 12h: acts at the next start.
    Rom,
    /// 13h: acts at once; live parameters only.
    Ram,
    /// 14h.
    Both,
}

impl Memory {
    /// The values that a write changes.
    #[must_use]
    pub const fn values(self) -> &'static [Value] {
        match self {
            Self::Rom => &[Value::Rom],
            Self::Ram => &[Value::Ram],
            Self::Both => &[Value::Ram, Value::Rom],
        }
    }
}

/// Which UPIDs to list.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum List {
    /// 20h, 21h.
    All,
    /// 22h, 23h: those whose ROM value is not the default.
    Modified,
}

/// What is done with a curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    /// 50h, 51h, 52h.
    Add,
    /// 53h, 54h, 55h.
    Modify,
    /// 60h, 61h, 62h.
    Get,
}

/// A command with its arguments.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Request {
    /// 00h
    NoOperation,
    /// 10h, 11h, 15h, 16h, 17h
    Read {
        /// Which value.
        value: Value,
        /// Of which parameter.
        upid: Upid,
    },
    /// 12h, 13h, 14h
    Write {
        /// Where to.
        memory: Memory,
        /// Which parameter.
        upid: Upid,
        /// Raw value.
        value: u32,
    },
    /// 20h, 22h
    StartList {
        /// Which list.
        list: List,
        /// Search from this UPID on.
        from: Upid,
    },
    /// 21h, 23h
    NextItem(List),
    /// 30h
    Restart,
    /// 31h…34h
    Defaults(Layer),
    /// 35h
    Stop,
    /// 36h
    Start,
    /// 40h
    SaveCurves,
    /// 41h
    DeleteCurves,
    /// 50h, 53h, 60h; for `Get` the sizes are 0 and come with the answer.
    StartCurve {
        /// What is to be done.
        access: Access,
        /// Curve ID, 1…100.
        curve: u16,
        /// Size of the info block in bytes.
        info: u16,
        /// Size of the data block in bytes.
        data: u16,
    },
    /// 51h, 54h, 61h
    CurveInfo {
        /// What is done.
        access: Access,
        /// Curve ID.
        curve: u16,
        /// The next 4 bytes; 0 for `Get`.
        value: u32,
    },
    /// 52h, 55h, 62h
    CurveData {
        /// What is done.
        access: Access,
        /// Curve ID.
        curve: u16,
        /// The next 4 bytes; 0 for `Get`.
        value: u32,
    },
    /// 70h
    ErrorCounts,
    /// 71h
    ErrorCode {
        /// 0…24.
        entry: u16,
    },
    /// 72h: milliseconds.
    ErrorTimeLow {
        /// 0…24.
        entry: u16,
    },
    /// 73h: hours.
    ErrorTimeHigh {
        /// 0…24.
        entry: u16,
    },
    /// 74h
    ErrorText {
        /// Error code.
        code: u16,
        /// 0…7.
        stringlet: u16,
    },
    /// 80h
    SaveTable,
    /// 81h
    ClearTable,
    /// 82h
    DeleteEntry {
        /// 1…255.
        entry: u16,
    },
    /// 83h
    WriteEntry {
        /// 1…255.
        entry: u16,
        /// Size in bytes, even: 64.
        size: u16,
    },
    /// 84h
    WriteEntryData {
        /// 1…255.
        entry: u16,
        /// The next 4 bytes.
        value: u32,
    },
    /// 85h
    GetEntry {
        /// 1…255.
        entry: u16,
    },
    /// 86h
    GetEntryData {
        /// 1…255.
        entry: u16,
    },
    /// 87h…8Eh
    Presence {
        /// Which of them.
        list: ListNumber,
    },
}

const fn split(value: u32) -> (u16, u16) {
    (value as u16, (value >> 16) as u16)
}

const fn join(low: u16, high: u16) -> u32 {
    (high as u32) << 16 | low as u32
}

impl Request {
    /// Its command ID.
    #[must_use]
    pub const fn command(&self) -> Command {
        match *self {
            Self::NoOperation => Command::NO_OPERATION,
            Self::Read { value, .. } => match value {
                Value::Rom => Command::READ_ROM,
                Value::Ram => Command::READ_RAM,
                Value::Minimum => Command::READ_MINIMUM,
                Value::Maximum => Command::READ_MAXIMUM,
                Value::Default => Command::READ_DEFAULT,
            },
            Self::Write { memory, .. } => match memory {
                Memory::Rom => Command::WRITE_ROM,
                Memory::Ram => Command::WRITE_RAM,
                Memory::Both => Command::WRITE_BOTH,
            },
            Self::StartList { list: List::All, .. } => Command::START_LIST,
            Self::StartList { list: List::Modified, .. } => Command::START_MODIFIED,
            Self::NextItem(List::All) => Command::NEXT_ITEM,
            Self::NextItem(List::Modified) => Command::NEXT_MODIFIED,
            Self::Restart => Command::RESTART,
            Self::Defaults(layer) => match layer {
                Layer::Os => Command::DEFAULT_OS,
                Layer::MotionControl => Command::DEFAULT_MC,
                Layer::Interface => Command::DEFAULT_INTERFACE,
                Layer::Application => Command::DEFAULT_APPLICATION,
            },
            Self::Stop => Command::STOP,
            Self::Start => Command::START,
            Self::SaveCurves => Command::SAVE_CURVES,
            Self::DeleteCurves => Command::DELETE_CURVES,
            Self::StartCurve { access, .. } => match access {
                Access::Add => Command::ADD_CURVE,
                Access::Modify => Command::MODIFY_CURVE,
                Access::Get => Command::GET_CURVE,
            },
            Self::CurveInfo { access, .. } => match access {
                Access::Add => Command::ADD_CURVE_INFO,
                Access::Modify => Command::MODIFY_CURVE_INFO,
                Access::Get => Command::GET_CURVE_INFO,
            },
            Self::CurveData { access, .. } => match access {
                Access::Add => Command::ADD_CURVE_DATA,
                Access::Modify => Command::MODIFY_CURVE_DATA,
                Access::Get => Command::GET_CURVE_DATA,
            },
            Self::ErrorCounts => Command::ERROR_COUNTS,
            Self::ErrorCode { .. } => Command::ERROR_CODE,
            Self::ErrorTimeLow { .. } => Command::ERROR_TIME_LOW,
            Self::ErrorTimeHigh { .. } => Command::ERROR_TIME_HIGH,
            Self::ErrorText { .. } => Command::ERROR_TEXT,
            Self::SaveTable => Command::SAVE_TABLE,
            Self::ClearTable => Command::CLEAR_TABLE,
            Self::DeleteEntry { .. } => Command::DELETE_ENTRY,
            Self::WriteEntry { .. } => Command::WRITE_ENTRY,
            Self::WriteEntryData { .. } => Command::WRITE_ENTRY_DATA,
            Self::GetEntry { .. } => Command::GET_ENTRY,
            Self::GetEntryData { .. } => Command::GET_ENTRY_DATA,
            Self::Presence { list } => Command(Command::PRESENCE_0.0 + list.get()),
        }
    }

    /// Words 2, 3 and 4 of the request (manual B 7.2.1.1…19); unused words are 0.
    #[must_use]
    pub const fn words(&self) -> [u16; 3] {
        match *self {
            Self::Read { upid, .. } => [upid.0, 0, 0],
            Self::Write { upid, value, .. } => {
                let (low, high) = split(value);
                [upid.0, low, high]
            }
            Self::StartList { from, .. } => [from.0, 0, 0],
            Self::StartCurve { curve, info, data, .. } => [curve, info, data],
            Self::CurveInfo { curve, value, .. } | Self::CurveData { curve, value, .. } => {
                let (low, high) = split(value);
                [curve, low, high]
            }
            Self::ErrorCode { entry }
            | Self::ErrorTimeLow { entry }
            | Self::ErrorTimeHigh { entry }
            | Self::DeleteEntry { entry }
            | Self::GetEntry { entry }
            | Self::GetEntryData { entry } => [entry, 0, 0],
            Self::ErrorText { code, stringlet } => [code, stringlet, 0],
            Self::WriteEntry { entry, size } => [entry, size, 0],
            Self::WriteEntryData { entry, value } => {
                let (low, high) = split(value);
                [entry, low, high]
            }
            _ => [0; 3],
        }
    }

    /// The request with this command ID and these words; `None` for an ID that manual B does not name.
    #[must_use]
    pub const fn parse(command: Command, words: [u16; 3]) -> Option<Self> {
        let [first, low, high] = words;
        let value = join(low, high);
        let (upid, curve, entry) = (Upid(first), first, first);
        let access = match command.0 & 0xF {
            _ if command.0 >> 4 == 6 => Access::Get,
            0..=2 => Access::Add,
            _ => Access::Modify,
        };
        Some(match command {
            Command::NO_OPERATION => Self::NoOperation,
            Command::READ_ROM => Self::Read { value: Value::Rom, upid },
            Command::READ_RAM => Self::Read { value: Value::Ram, upid },
            Command::WRITE_ROM => Self::Write { memory: Memory::Rom, upid, value },
            Command::WRITE_RAM => Self::Write { memory: Memory::Ram, upid, value },
            Command::WRITE_BOTH => Self::Write { memory: Memory::Both, upid, value },
            Command::READ_MINIMUM => Self::Read { value: Value::Minimum, upid },
            Command::READ_MAXIMUM => Self::Read { value: Value::Maximum, upid },
            Command::READ_DEFAULT => Self::Read { value: Value::Default, upid },
            Command::START_LIST => Self::StartList { list: List::All, from: upid },
            Command::NEXT_ITEM => Self::NextItem(List::All),
            Command::START_MODIFIED => Self::StartList { list: List::Modified, from: upid },
            Command::NEXT_MODIFIED => Self::NextItem(List::Modified),
            Command::RESTART => Self::Restart,
            Command::DEFAULT_OS => Self::Defaults(Layer::Os),
            Command::DEFAULT_MC => Self::Defaults(Layer::MotionControl),
            Command::DEFAULT_INTERFACE => Self::Defaults(Layer::Interface),
            Command::DEFAULT_APPLICATION => Self::Defaults(Layer::Application),
            Command::STOP => Self::Stop,
            Command::START => Self::Start,
            Command::SAVE_CURVES => Self::SaveCurves,
            Command::DELETE_CURVES => Self::DeleteCurves,
            Command::ADD_CURVE | Command::MODIFY_CURVE | Command::GET_CURVE => {
                Self::StartCurve { access, curve, info: low, data: high }
            }
            Command::ADD_CURVE_INFO | Command::MODIFY_CURVE_INFO | Command::GET_CURVE_INFO => {
                Self::CurveInfo { access, curve, value }
            }
            Command::ADD_CURVE_DATA | Command::MODIFY_CURVE_DATA | Command::GET_CURVE_DATA => {
                Self::CurveData { access, curve, value }
            }
            Command::ERROR_COUNTS => Self::ErrorCounts,
            Command::ERROR_CODE => Self::ErrorCode { entry },
            Command::ERROR_TIME_LOW => Self::ErrorTimeLow { entry },
            Command::ERROR_TIME_HIGH => Self::ErrorTimeHigh { entry },
            Command::ERROR_TEXT => Self::ErrorText { code: first, stringlet: low },
            Command::SAVE_TABLE => Self::SaveTable,
            Command::CLEAR_TABLE => Self::ClearTable,
            Command::DELETE_ENTRY => Self::DeleteEntry { entry },
            Command::WRITE_ENTRY => Self::WriteEntry { entry, size: low },
            Command::WRITE_ENTRY_DATA => Self::WriteEntryData { entry, value },
            Command::GET_ENTRY => Self::GetEntry { entry },
            Command::GET_ENTRY_DATA => Self::GetEntryData { entry },
            Command(id) => match id.checked_sub(Command::PRESENCE_0.0) {
                Some(list) => match ListNumber::new(list) {
                    Some(list) => Self::Presence { list },
                    None => return None,
                },
                None => return None,
            },
        })
    }

    /// Whether carrying it out twice does the same as once. A list's next item and a block's next
    /// word are not repeatable: a repetition would skip one.
    #[must_use]
    pub const fn is_repeatable(&self) -> bool {
        matches!(
            self,
            Self::Read { .. }
                | Self::StartList { .. }
                | Self::StartCurve { access: Access::Get, .. }
                | Self::ErrorCounts
                | Self::ErrorCode { .. }
                | Self::ErrorTimeLow { .. }
                | Self::ErrorTimeHigh { .. }
                | Self::ErrorText { .. }
                | Self::GetEntry { .. }
                | Self::Presence { .. }
        )
    }
}

/// The answer to a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reply {
    /// How it went.
    pub status: Status,
    /// Words 2, 3 and 4.
    pub words: [u16; 3],
}

impl Reply {
    /// An answer with these words.
    #[must_use]
    pub const fn new(status: Status, words: [u16; 3]) -> Self {
        Self { status, words }
    }

    /// An answer with word 2 and the 32-bit value in words 3 and 4.
    #[must_use]
    pub const fn with_value(status: Status, first: u16, value: u32) -> Self {
        let (low, high) = split(value);
        Self { status, words: [first, low, high] }
    }

    /// The 32-bit value in words 3 (low) and 4 (high).
    #[must_use]
    pub const fn value(&self) -> u32 {
        let [_, low, high] = self.words;
        join(low, high)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use proptest::prelude::*;

    pub(crate) fn any_request() -> impl Strategy<Value = Request> {
        (0..Command::ALL.len(), any::<[u16; 3]>())
            .prop_map(|(n, words)| Request::parse(Command::ALL[n], words).unwrap())
    }

    proptest! {
        #[test]
        fn requests_come_back_from_their_words(request in any_request()) {
            prop_assert_eq!(Request::parse(request.command(), request.words()), Some(request));
        }
    }

    /// Manual B 7.2.1.1…19: which word says what.
    #[test]
    fn words_lie_where_the_manual_says() {
        let write = Request::Write { memory: Memory::Both, upid: Upid(0x13A2), value: 0x0001_0002 };
        assert_eq!((write.command(), write.words()), (Command(0x14), [0x13A2, 2, 1]));
        let add = Request::StartCurve { access: Access::Add, curve: 1, info: 70, data: 164 };
        assert_eq!((add.command(), add.words()), (Command(0x50), [1, 70, 164]));
        let text = Request::ErrorText { code: 0x64, stringlet: 3 };
        assert_eq!((text.command(), text.words()), (Command(0x74), [0x64, 3, 0]));
        let entry = Request::WriteEntry { entry: 5, size: 64 };
        assert_eq!((entry.command(), entry.words()), (Command(0x83), [5, 64, 0]));
        for (list, id) in ListNumber::all().zip(0x87..=0x8E) {
            let request = Request::Presence { list };
            assert_eq!((request.command(), request.words()), (Command(id), [0; 3]));
        }
        // There is no list behind 8Eh, and none that another number could be taken for.
        assert_eq!(ListNumber::new(8), None);
        assert_eq!([0x18, 0x8F, 0xFF].map(|id| Request::parse(Command(id), [0; 3])), [None; 3]);
        for (access, ids) in [
            (Access::Add, [0x50, 0x51, 0x52]),
            (Access::Modify, [0x53, 0x54, 0x55]),
            (Access::Get, [0x60, 0x61, 0x62]),
        ] {
            let requests = [
                Request::StartCurve { access, curve: 9, info: 0, data: 0 },
                Request::CurveInfo { access, curve: 9, value: 0 },
                Request::CurveData { access, curve: 9, value: 0 },
            ];
            assert_eq!(requests.map(|r| r.command().0), ids);
        }
    }
}
