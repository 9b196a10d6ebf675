//! Objects of the standards (CiA 301, 302, 401, 402): what they are called, their kind and type.

use alloc::format;
use alloc::string::String;

use super::types::ObjectType;
use crate::data_type::DataType;

/// An object that a standard describes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct StandardObject {
    /// First index, and last one of a row of equal objects.
    indices: (u16, u16),
    /// As the standard calls it.
    pub name: &'static str,
    /// What it is in short, with the unit of its value.
    pub words: &'static str,
    /// VAR, ARRAY or RECORD.
    pub object_type: ObjectType,
    /// Type of its value, or of its sub-objects from 1 on as far as they do not differ.
    pub data_type: DataType,
}

const fn row(
    first: u16,
    last: u16,
    name: &'static str,
    words: &'static str,
    object_type: ObjectType,
    data_type: DataType,
) -> StandardObject {
    StandardObject { indices: (first, last), name, words, object_type, data_type }
}

const VAR: ObjectType = ObjectType::VAR;
const ARRAY: ObjectType = ObjectType::ARRAY;
const RECORD: ObjectType = ObjectType::RECORD;
const U8: DataType = DataType::UNSIGNED8;
const U16: DataType = DataType::UNSIGNED16;
const U32: DataType = DataType::UNSIGNED32;
const I8: DataType = DataType::INTEGER8;
const I16: DataType = DataType::INTEGER16;
const I32: DataType = DataType::INTEGER32;
const TEXT: DataType = DataType::VISIBLE_STRING;

#[rustfmt::skip]
const OBJECTS: &[StandardObject] = &[
    row(0x1000, 0x1000, "Device type", "device type", VAR, U32),
    row(0x1001, 0x1001, "Error register", "error register", VAR, U8),
    row(0x1002, 0x1002, "Manufacturer status register", "manufacturer status register", VAR, U32),
    row(0x1003, 0x1003, "Pre-defined error field", "error history", ARRAY, U32),
    row(0x1005, 0x1005, "COB-ID SYNC message", "COB-ID of SYNC", VAR, U32),
    row(0x1006, 0x1006, "Communication cycle period", "SYNC period in us", VAR, U32),
    row(0x1007, 0x1007, "Synchronous window length", "SYNC window in us", VAR, U32),
    row(0x1008, 0x1008, "Manufacturer device name", "device name", VAR, TEXT),
    row(0x1009, 0x1009, "Manufacturer hardware version", "hardware version", VAR, TEXT),
    row(0x100A, 0x100A, "Manufacturer software version", "software version", VAR, TEXT),
    row(0x100B, 0x100B, "Node-ID", "node ID", VAR, U8),
    row(0x100C, 0x100C, "Guard time", "guard time in ms", VAR, U16),
    row(0x100D, 0x100D, "Life time factor", "life time factor", VAR, U8),
    row(0x1010, 0x1010, "Store parameters", "store parameters", ARRAY, U32),
    row(0x1011, 0x1011, "Restore default parameters", "restore defaults", ARRAY, U32),
    row(0x1012, 0x1012, "COB-ID time stamp object", "COB-ID of TIME", VAR, U32),
    row(0x1014, 0x1014, "COB-ID EMCY", "COB-ID of EMCY", VAR, U32),
    row(0x1015, 0x1015, "Inhibit time EMCY", "EMCY inhibit time in 100 us", VAR, U16),
    row(0x1016, 0x1016, "Consumer heartbeat time", "heartbeat to watch", ARRAY, U32),
    row(0x1017, 0x1017, "Producer heartbeat time", "heartbeat period in ms", VAR, U16),
    row(0x1018, 0x1018, "Identity object", "identity", RECORD, U32),
    row(0x1019, 0x1019, "Synchronous counter overflow value", "SYNC counter overflow", VAR, U8),
    row(0x1020, 0x1020, "Verify configuration", "verify configuration", ARRAY, U32),
    row(0x1029, 0x1029, "Error behavior object", "error behaviour", ARRAY, U8),
    row(0x1200, 0x127F, "SDO server parameter", "SDO server", RECORD, U32),
    row(0x1280, 0x12FF, "SDO client parameter", "SDO client", RECORD, U32),
    row(0x1400, 0x15FF, "RPDO communication parameter", "RPDO", RECORD, U32),
    row(0x1600, 0x17FF, "RPDO mapping parameter", "mapping of RPDO", RECORD, U32),
    row(0x1800, 0x19FF, "TPDO communication parameter", "TPDO", RECORD, U32),
    row(0x1A00, 0x1BFF, "TPDO mapping parameter", "mapping of TPDO", RECORD, U32),
    row(0x1F50, 0x1F50, "Program data", "program data", ARRAY, DataType::DOMAIN),
    row(0x1F51, 0x1F51, "Program control", "program control", ARRAY, U8),
    row(0x1F56, 0x1F56, "Program software identification", "program identification", ARRAY, U32),
    row(0x1F57, 0x1F57, "Flash status identification", "flash status", ARRAY, U32),
    row(0x1F80, 0x1F80, "NMT startup", "NMT start-up", VAR, U32),
    row(0x6000, 0x6000, "Read input 8-bit", "digital inputs", ARRAY, U8),
    row(0x6200, 0x6200, "Write output 8-bit", "digital outputs", ARRAY, U8),
    row(0x6401, 0x6401, "Read analogue input 16-bit", "analogue inputs", ARRAY, I16),
    row(0x6411, 0x6411, "Write analogue output 16-bit", "analogue outputs", ARRAY, I16),
    row(0x6002, 0x6002, "Polarity input 8-bit", "polarity of digital inputs", ARRAY, U8),
    row(0x6202, 0x6202, "Change polarity output 8-bit", "polarity of digital outputs", ARRAY, U8),
    row(0x6206, 0x6206, "Error mode output 8-bit", "error mode of digital outputs", ARRAY, U8),
    row(0x6207, 0x6207, "Error value output 8-bit", "error value of digital outputs", ARRAY, U8),
    row(0x6423, 0x6423, "Analogue input global interrupt enable", "interrupts of analogue inputs", VAR, DataType::BOOLEAN),
    row(0x6426, 0x6426, "Analogue input interrupt delta unsigned", "delta of analogue inputs", ARRAY, U32),
    row(0x603F, 0x603F, "Error code", "error code", VAR, U16),
    row(0x6040, 0x6040, "Controlword", "control word", VAR, U16),
    row(0x6041, 0x6041, "Statusword", "status word", VAR, U16),
    row(0x605A, 0x605A, "Quick stop option code", "quick stop option", VAR, I16),
    row(0x6060, 0x6060, "Modes of operation", "mode", VAR, I8),
    row(0x6061, 0x6061, "Modes of operation display", "mode display", VAR, I8),
    row(0x6062, 0x6062, "Position demand value", "position demand", VAR, I32),
    row(0x6063, 0x6063, "Position actual internal value", "position actual, internal", VAR, I32),
    row(0x6064, 0x6064, "Position actual value", "position actual", VAR, I32),
    row(0x6065, 0x6065, "Following error window", "following error window", VAR, U32),
    row(0x6067, 0x6067, "Position window", "position window", VAR, U32),
    row(0x606B, 0x606B, "Velocity demand value", "velocity demand", VAR, I32),
    row(0x606C, 0x606C, "Velocity actual value", "velocity actual", VAR, I32),
    row(0x6071, 0x6071, "Target torque", "target torque", VAR, I16),
    row(0x6072, 0x6072, "Max torque", "maximum torque", VAR, U16),
    row(0x6073, 0x6073, "Max current", "maximum current", VAR, U16),
    row(0x6077, 0x6077, "Torque actual value", "torque actual", VAR, I16),
    row(0x6078, 0x6078, "Current actual value", "current actual", VAR, I16),
    row(0x607A, 0x607A, "Target position", "target position", VAR, I32),
    row(0x607C, 0x607C, "Home offset", "home offset", VAR, I32),
    row(0x607D, 0x607D, "Software position limit", "software position limit", ARRAY, I32),
    row(0x607F, 0x607F, "Max profile velocity", "maximum profile velocity", VAR, U32),
    row(0x6080, 0x6080, "Max motor speed", "maximum motor speed", VAR, U32),
    row(0x6081, 0x6081, "Profile velocity", "profile velocity", VAR, U32),
    row(0x6083, 0x6083, "Profile acceleration", "profile acceleration", VAR, U32),
    row(0x6084, 0x6084, "Profile deceleration", "profile deceleration", VAR, U32),
    row(0x6085, 0x6085, "Quick stop deceleration", "quick stop deceleration", VAR, U32),
    row(0x6098, 0x6098, "Homing method", "homing method", VAR, I8),
    row(0x6099, 0x6099, "Homing speeds", "homing speeds", ARRAY, U32),
    row(0x609A, 0x609A, "Homing acceleration", "homing acceleration", VAR, U32),
    row(0x60C1, 0x60C1, "Interpolation data record", "interpolation data", RECORD, I32),
    row(0x60C2, 0x60C2, "Interpolation time period", "interpolation period", RECORD, U8),
    row(0x60F4, 0x60F4, "Following error actual value", "following error actual", VAR, I32),
    row(0x60FD, 0x60FD, "Digital inputs", "digital inputs", VAR, U32),
    row(0x60FE, 0x60FE, "Digital outputs", "digital outputs", ARRAY, U32),
    row(0x60FF, 0x60FF, "Target velocity", "target velocity", VAR, I32),
    row(0x6502, 0x6502, "Supported drive modes", "supported modes", VAR, U32),
];

/// What the standards say of an index. 6000h and up are CiA 401's and CiA 402's, whatever profile the device has.
#[must_use]
pub fn standard_object(index: u16) -> Option<&'static StandardObject> {
    OBJECTS.iter().find(|object| (object.indices.0..=object.indices.1).contains(&index))
}

/// What a sub-object of a standard object is in short, and its type; `None` where the object says it.
#[must_use]
pub fn standard_sub_object(index: u16, subindex: u8) -> Option<(&'static str, DataType)> {
    Some(match (index, subindex) {
        (0x1018, 1) => ("vendor", U32),
        (0x1018, 2) => ("product", U32),
        (0x1018, 3) => ("revision", U32),
        (0x1018, 4) => ("serial number", U32),
        (0x1400..=0x15FF | 0x1800..=0x19FF, 1) => ("identifier", U32),
        (0x1400..=0x15FF | 0x1800..=0x19FF, 2) => ("transmission type", U8),
        (0x1400..=0x15FF | 0x1800..=0x19FF, 3) => ("inhibit time in 100 us", U16),
        (0x1400..=0x15FF | 0x1800..=0x19FF, 4) => ("reserved", U8),
        (0x1400..=0x15FF | 0x1800..=0x19FF, 5) => ("event timer in ms", U16),
        (0x1800..=0x19FF, 6) => ("SYNC start value", U8),
        (0x1600..=0x17FF | 0x1A00..=0x1BFF, 0) => ("number of objects", U8),
        (0x1200..=0x12FF, 1) => ("identifier to the server", U32),
        (0x1200..=0x12FF, 2) => ("identifier from the server", U32),
        (0x1200..=0x12FF, 3) => ("node", U8),
        (0x60C2, 1) => ("value", U8),
        (0x60C2, 2) => ("power of ten in s", I8),
        (_, 0) if standard_object(index)?.object_type != VAR => ("number of entries", U8),
        _ => return None,
    })
}

/// The `ParameterName` of an object (`subindex` = `None`) or sub-object as the standards have it.
#[must_use]
pub fn standard_name(index: u16, subindex: Option<u8>) -> Option<String> {
    let object = standard_object(index)?;
    let pdo = matches!(index, 0x1400..=0x1BFF);
    let Some(subindex) = subindex else {
        return Some(match index.checked_sub(object.indices.0) {
            Some(position) if pdo => format!("{} {}", object.name, position + 1),
            _ => object.name.into(),
        });
    };
    let name = match (index, subindex) {
        (0x1003, 0) => "Number of errors",
        (0x1003, _) => return Some(format!("Standard error field {subindex}")),
        (0x1010, 1) => "Save all parameters",
        (0x1011, 1) => "Restore all default parameters",
        (0x1018, 1) => "Vendor-ID",
        (0x1018, 2) => "Product code",
        (0x1018, 3) => "Revision number",
        (0x1018, 4) => "Serial number",
        (0x1020, 1) => "Configuration date",
        (0x1020, 2) => "Configuration time",
        (0x1029, 1) => "Communication error",
        (0x1400..=0x15FF, 1) => "COB-ID used by RPDO",
        (0x1800..=0x19FF, 1) => "COB-ID used by TPDO",
        (0x1400..=0x15FF | 0x1800..=0x19FF, 2) => "Transmission type",
        (0x1400..=0x15FF | 0x1800..=0x19FF, 3) => "Inhibit time",
        (0x1400..=0x15FF | 0x1800..=0x19FF, 5) => "Event timer",
        (0x1800..=0x19FF, 6) => "SYNC start value",
        (0x60C2, 1) => "Interpolation time period value",
        (0x60C2, 2) => "Interpolation time index",
        (0x1600..=0x17FF | 0x1A00..=0x1BFF, 0) => "Number of mapped application objects in PDO",
        (0x1600..=0x17FF | 0x1A00..=0x1BFF, _) => return Some(format!("Application object {subindex}")),
        (_, 0) => "Highest sub-index supported",
        _ => return Some(format!("{} {subindex}", object.name)),
    };
    Some(name.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_kinds_and_rows_of_equal_objects() {
        assert!(OBJECTS.iter().all(|object| object.indices.0 <= object.indices.1));
        let name = |index, sub| standard_name(index, sub).unwrap();
        assert_eq!(name(0x1017, None), "Producer heartbeat time");
        assert_eq!(name(0x1801, None), "TPDO communication parameter 2");
        assert_eq!(name(0x1A01, Some(3)), "Application object 3");
        assert_eq!(name(0x1003, Some(0)), "Number of errors");
        assert_eq!(name(0x1016, Some(2)), "Consumer heartbeat time 2");
        assert_eq!(standard_object(0x15FF).map(|object| object.words), Some("RPDO"));
        assert_eq!(standard_object(0x1003).map(|object| object.object_type), Some(ObjectType::ARRAY));
        assert_eq!(standard_name(0x2000, None), None);
    }

    /// CiA 301, 7.5.2.35 and 7.5.2.37; CiA 402-2, 60C2h.
    #[test]
    fn sub_objects_that_differ_from_their_object() {
        let data_type = |index, sub| standard_sub_object(index, sub).map(|(_, data_type)| data_type);
        for object in OBJECTS {
            let count = (object.object_type != VAR).then_some(U8);
            assert_eq!(data_type(object.indices.0, 0), count, "{}", object.name);
        }
        for index in [0x1400, 0x1800] {
            assert_eq!([1, 2, 3, 4, 5].map(|sub| data_type(index, sub)), [U32, U8, U16, U8, U16].map(Some));
        }
        assert_eq!([1, 2].map(|sub| data_type(0x60C2, sub)), [Some(U8), Some(I8)]);
        assert_eq!(data_type(0x2000, 0), None);
    }
}
