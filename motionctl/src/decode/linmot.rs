//! Objects 2000h to FFFFh of LinMot drives in words: the sub-index is a command, the index the parameter,
//! curve or entry that it is for (LinMot document 0185-1076).

use canopen_master::Address;
use linmot::request::{Access as Curve, List, Memory, Request, Value};
use linmot::sdo::{Access, BASE, CURVE_RESULT, FLASH_STATE, TABLE_RESULT};
use linmot::upid::Upid;

/// Vendor ID of NTI AG LinMot & MagSpring.
pub(super) const VENDOR: u32 = 0x156;

/// The command that an object carries, whichever way it is accessed.
fn request(at: Address) -> Option<Request> {
    let access = |write| Access { index: at.index, sub: at.sub, write };
    access(None).request(false).or_else(|| access(Some([0; 4])).request(false))
}

/// What an object is; `None` of one that no command has.
pub(super) fn object(at: Address) -> Option<String> {
    match (at.index, at.sub) {
        (BASE, FLASH_STATE) => return Some("state of flash".into()),
        (BASE, CURVE_RESULT) => return Some("result of the last curve command".into()),
        (BASE, TABLE_RESULT) => return Some("result of the last command table command".into()),
        _ => {}
    }
    Some(match request(at)? {
        // One object for reading and writing; what both mean is told by the verb.
        Request::Read { value, upid } => {
            let which = match value {
                Value::Ram => "RAM value",
                Value::Rom => "ROM value",
                Value::Minimum => "minimum",
                Value::Maximum => "maximum",
                Value::Default => "default",
            };
            format!("UPID {upid}, {which}")
        }
        Request::Write { memory, upid, .. } => {
            let which = match memory {
                Memory::Ram => "RAM value",
                Memory::Rom => "ROM value",
                Memory::Both => "RAM and ROM value",
            };
            format!("UPID {upid}, {which}")
        }
        Request::StartList { list, .. } => format!("start of the list of {} UPIDs", of(list)),
        Request::NextItem(list) => format!("next of the {} UPIDs", of(list)),
        Request::Restart => "restart of the drive".into(),
        Request::Defaults(layer) => format!("ROM to defaults, layer {layer}"),
        Request::Stop => "stop of MC and application software".into(),
        Request::Start => "start of MC and application software".into(),
        Request::SaveCurves => "curves from RAM to flash".into(),
        Request::DeleteCurves => "deletion of all curves in RAM".into(),
        Request::StartCurve { access, curve, .. } => format!("curve {curve}, {}: start", done(access)),
        Request::CurveInfo { access, curve, .. } => format!("curve {curve}, {}: info block", done(access)),
        Request::CurveData { access, curve, .. } => format!("curve {curve}, {}: data block", done(access)),
        Request::ErrorCounts => "numbers of logged and occurred errors".into(),
        Request::ErrorCode { entry } => format!("error log entry {entry}, code"),
        Request::ErrorTimeLow { entry } => format!("error log entry {entry}, time, low word"),
        Request::ErrorTimeHigh { entry } => format!("error log entry {entry}, time, high word"),
        Request::ErrorText { code, stringlet } => format!("text of error {code:04X}h, part {stringlet}"),
        Request::SaveTable => "command table from RAM to flash".into(),
        Request::ClearTable => "deletion of the command table in RAM".into(),
        Request::DeleteEntry { entry } => format!("command table entry {entry}, deletion"),
        Request::WriteEntry { entry, .. } => format!("command table entry {entry}, start of writing"),
        Request::WriteEntryData { entry, .. } => format!("command table entry {entry}, data to write"),
        Request::GetEntry { entry } => format!("command table entry {entry}, start of reading"),
        Request::GetEntryData { entry } => format!("command table entry {entry}, data"),
        Request::Presence { list } => format!("presence of command table entries, part {}", list.get()),
        _ => return None,
    })
}

/// The value of a parameter as a number; `None` of another object.
pub(super) fn value(at: Address, data: &[u8]) -> Option<String> {
    let value = u32::from_le_bytes(data.try_into().ok()?);
    match request(at)? {
        Request::Read { upid: Upid(1..), .. } | Request::Write { upid: Upid(1..), .. } => {
            Some(format!("{} ({value:X}h)", value as i32))
        }
        _ => None,
    }
}

const fn of(list: List) -> &'static str {
    match list {
        List::All => "all",
        List::Modified => "modified",
    }
}

const fn done(access: Curve) -> &'static str {
    match access {
        Curve::Add => "add",
        Curve::Modify => "modify",
        Curve::Get => "get",
    }
}
