//! `[FileInfo]`, `[DeviceInfo]`, `[DummyUsage]`, `[DeviceComissioning]` (CiA 306-1, 6.4, 6.5, 7.3.5).

use alloc::format;

use super::super::diagnostic::Rule;
use super::super::model::{Device, Fields, strip_prefix};
use super::super::reader::{Findings, shorten};
use super::super::value::Number;
use super::Places;

/// What a value must look like.
#[derive(Clone, Copy)]
enum Form {
    /// Any text of at most this length.
    Text(usize),
    /// A number up to this one.
    Number(i128),
    /// 0 or 1.
    Flag,
    /// `4.0`.
    Version,
    /// `hh:mm(AM|PM)`.
    Time,
    /// `mm-dd-yyyy`.
    Date,
}

impl Form {
    fn fits(self, value: &str) -> bool {
        let number = || Number::parse(value).filter(|number| !number.node_id).map(|number| number.value);
        match self {
            Self::Text(length) => value.chars().count() <= length,
            Self::Number(most) => number().is_some_and(|number| (0..=most).contains(&number)),
            Self::Flag => number().is_some_and(|number| matches!(number, 0 | 1)),
            Self::Version => {
                matches!(value.as_bytes(), [major, b'.', minor] if major.is_ascii_digit() && minor.is_ascii_digit())
            }
            Self::Time => matches!(value.as_bytes(), [h, i, b':', m, n, b'A' | b'P', b'M']
                if [h, i, m, n].into_iter().all(u8::is_ascii_digit)
                    && (1..=12).contains(&(10 * (h - b'0') + i - b'0')) && *m < b'6'),
            Self::Date => matches!(value.as_bytes(), [m, n, b'-', d, e, b'-', year @ ..]
                if [m, n, d, e].into_iter().chain(year).all(u8::is_ascii_digit) && year.len() == 4
                    && (1..=12).contains(&(10 * (m - b'0') + n - b'0'))
                    && (1..=31).contains(&(10 * (d - b'0') + e - b'0'))),
        }
    }
}

impl core::fmt::Display for Form {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Text(length) => write!(f, "text of at most {length} characters"),
            Self::Number(most) => write!(f, "number of 0…{most}"),
            Self::Flag => f.write_str("0 or 1"),
            Self::Version => f.write_str("version such as 4.0"),
            Self::Time => f.write_str("time as hh:mmAM or hh:mmPM"),
            Self::Date => f.write_str("date as mm-dd-yyyy"),
        }
    }
}

const U8: i128 = u8::MAX as i128;
const U32: i128 = u32::MAX as i128;

/// CiA 306-1, table 1.
const FILE_INFO: [(&str, Form); 11] = [
    ("FileName", Form::Text(246)),
    ("FileVersion", Form::Number(U8)),
    ("FileRevision", Form::Number(U8)),
    ("EDSVersion", Form::Version),
    ("Description", Form::Text(243)),
    ("CreationTime", Form::Time),
    ("CreationDate", Form::Date),
    ("CreatedBy", Form::Text(245)),
    ("ModificationTime", Form::Time),
    ("ModificationDate", Form::Date),
    ("ModifiedBy", Form::Text(244)),
];

/// CiA 306-1, table 2.
const DEVICE_INFO: [(&str, Form); 22] = [
    ("VendorName", Form::Text(244)),
    ("VendorNumber", Form::Number(U32)),
    ("ProductName", Form::Text(243)),
    ("ProductNumber", Form::Number(U32)),
    ("RevisionNumber", Form::Number(U32)),
    ("OrderCode", Form::Text(245)),
    ("BaudRate_10", Form::Flag),
    ("BaudRate_20", Form::Flag),
    ("BaudRate_50", Form::Flag),
    ("BaudRate_125", Form::Flag),
    ("BaudRate_250", Form::Flag),
    ("BaudRate_500", Form::Flag),
    ("BaudRate_800", Form::Flag),
    ("BaudRate_1000", Form::Flag),
    ("SimpleBootUpMaster", Form::Flag),
    ("SimpleBootUpSlave", Form::Flag),
    ("Granularity", Form::Number(64)),
    ("DynamicChannelsSupported", Form::Number(U8)),
    ("GroupMessaging", Form::Flag),
    ("NrOfRXPDO", Form::Number(512)),
    ("NrOfTXPDO", Form::Number(512)),
    ("LSS_Supported", Form::Flag),
];

/// CiA 306-1, table 12.
const COMMISSIONING: [(&str, Form); 6] = [
    ("NodeID", Form::Number(127)),
    ("NodeName", Form::Text(246)),
    ("Baudrate", Form::Number(1000)),
    ("NetNumber", Form::Number(U32)),
    ("NetworkName", Form::Text(243)),
    ("CANopenManager", Form::Flag),
];

fn rows(
    section: &str,
    rule: Rule,
    rows: &[(&str, Form)],
    fields: &Fields,
    places: &Places<'_>,
    findings: &mut Findings,
) {
    if fields.is_empty() {
        return;
    }
    for (key, form) in rows {
        let line = places.named_line(section, key);
        match fields.get(key) {
            None => findings.add(line, rule, format!("{key} is missing: {form}")),
            Some(value) if !form.fits(value) => {
                findings.add(line, rule, format!("{key}=\"{}\" is no {form}", shorten(value)));
            }
            Some(_) => {}
        }
    }
}

pub(super) fn check(device: &Device, places: &Places<'_>, findings: &mut Findings) {
    rows("FileInfo", Rule::FileInfo, &FILE_INFO, &device.file_info, places, findings);
    let info = &device.device_info;
    rows("DeviceInfo", Rule::DeviceInfo, &DEVICE_INFO, info, places, findings);
    let mut add = |key: &str, message| {
        findings.add(places.named_line("DeviceInfo", key), Rule::DeviceInfo, message);
    };
    if !info.is_empty() && device.bit_rates().next().is_none() {
        add("", "no bit rate is supported: no BaudRate_… is 1".into());
    }
    for (subindex, key) in [(1, "VendorNumber"), (2, "ProductNumber"), (3, "RevisionNumber")] {
        let entry = device.entry(0x1018, subindex);
        let value = entry.and_then(|entry| Number::parse(entry.in_force()?));
        if let (Some(info), Some(object)) = (info.number(key), value)
            && info != object.value
        {
            add(key, format!("{key} is {info:#X}, 1018h:0{subindex} says {:#X}", object.value));
        }
    }
    let compact = info.flag("CompactPDO");
    for (key, base) in [("NrOfRXPDO", 0x1400_u16), ("NrOfTXPDO", 0x1800)] {
        let described = device.objects.iter().filter(|object| object.index & !0x1FF == base).count();
        let described = i128::try_from(described).unwrap_or(i128::MAX);
        // CompactPDO implies those that are not described.
        let fits = |declared| described == declared || (compact && described < declared);
        if let Some(declared) = info.number(key).filter(|declared| !fits(*declared)) {
            add(key, format!("{key} says {declared}, described are {described}"));
        }
    }
    for (key, value) in device.dummy_usage.iter() {
        let digits = strip_prefix(key, "Dummy").unwrap_or_default();
        let index = u16::from_str_radix(digits, 16).ok().filter(|_| digits.len() == 4);
        let line = places.named_line("DummyUsage", key);
        if index.is_none() {
            let message = format!("{} is no DummyNNNN with the index of a data type", shorten(key));
            findings.add(line, Rule::DummyUsage, message);
        } else if !Form::Flag.fits(value) {
            findings.add(line, Rule::DummyUsage, format!("{key}=\"{}\" is no 0 or 1", shorten(value)));
        }
    }
}

/// Bit rates in kbit/s that CiA 301 knows.
const BIT_RATES: [i128; 8] = [10, 20, 50, 125, 250, 500, 800, 1000];

pub(super) fn check_commissioning(device: &Device, places: &Places<'_>, findings: &mut Findings) {
    let fields = &device.commissioning;
    rows("DeviceComissioning", Rule::Commissioning, &COMMISSIONING, fields, places, findings);
    let mut add = |key: &str, message| {
        findings.add(places.named_line("DeviceComissioning", key), Rule::Commissioning, message);
    };
    let serial = fields.get("LSS_SerialNumber").filter(|serial| !Form::Number(U32).fits(serial));
    if let Some(serial) = serial {
        add(
            "LSS_SerialNumber",
            format!("LSS_SerialNumber=\"{}\" is no {}", shorten(serial), Form::Number(U32)),
        );
    }
    if fields.number("NodeID") == Some(0) {
        add("NodeID", "NodeID=0 is no node ID: 1…127".into());
    }
    if let Some(rate) = fields.number("Baudrate").filter(|rate| !BIT_RATES.contains(rate)) {
        add("Baudrate", format!("Baudrate={rate} is no bit rate of CiA 301: {BIT_RATES:?}"));
    }
}
