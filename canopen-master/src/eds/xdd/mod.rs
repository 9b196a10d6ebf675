//! XDD and XDC (CiA 311): what EDS and DCF say, as XML.
//!
//! An object's attributes may stand in its `CANopenObject` element or in the `parameter` that its
//! `uniqueIDRef` names; the element has precedence. Names are compared without their namespace prefix,
//! because generators disagree about which elements have one.

mod reader;
mod update;
mod writer;

use super::types::Access;
use crate::data_type::DataType;

pub(crate) use reader::{lines, read};
pub(crate) use update::update;
pub use writer::write as write_xdd;

/// How a value of a header is written in XML.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Kind {
    /// As it is.
    Text,
    /// `true`, `false`; in an EDS 1, 0.
    Bool,
    /// `2023-03-17`; in an EDS 03-17-2023.
    Date,
    /// `16:49:28…`; in an EDS 04:49PM.
    Time,
    /// `500 Kbps`; in an EDS 500.
    BitRate,
}

/// Attribute, key of the EDS, form.
type Row = (&'static str, &'static str, Kind);

/// Attributes of `ProfileBody` and their keys in `[FileInfo]`.
const FILE_INFO: [Row; 8] = [
    ("fileName", "FileName", Kind::Text),
    ("fileCreator", "CreatedBy", Kind::Text),
    ("fileCreationDate", "CreationDate", Kind::Date),
    ("fileCreationTime", "CreationTime", Kind::Time),
    ("fileModifiedBy", "ModifiedBy", Kind::Text),
    ("fileModificationDate", "ModificationDate", Kind::Date),
    ("fileModificationTime", "ModificationTime", Kind::Time),
    ("fileVersion", "FileVersion", Kind::Text),
];

/// Elements of `DeviceIdentity` and their keys in `[DeviceInfo]`.
const IDENTITY: [(&str, &str); 6] = [
    ("vendorName", "VendorName"),
    ("vendorID", "VendorNumber"),
    ("productName", "ProductName"),
    ("productID", "ProductNumber"),
    ("orderNumber", "OrderCode"),
    ("specificationRevision", "RevisionNumber"),
];

/// Attributes of `CANopenGeneralFeatures` and their keys in `[DeviceInfo]`.
const GENERAL: [Row; 9] = [
    ("groupMessaging", "GroupMessaging", Kind::Bool),
    ("dynamicChannels", "DynamicChannelsSupported", Kind::Text),
    ("selfStartingDevice", "SelfStartingDevice", Kind::Bool),
    ("SDORequestingDevice", "SDORequestingDevice", Kind::Bool),
    ("granularity", "Granularity", Kind::Text),
    ("nrOfRxPDO", "NrOfRXPDO", Kind::Text),
    ("nrOfTxPDO", "NrOfTXPDO", Kind::Text),
    ("bootUpSlave", "SimpleBootUpSlave", Kind::Bool),
    ("layerSettingServiceSlave", "LSS_Supported", Kind::Bool),
];

/// Attributes of `CANopenMasterFeatures` and their keys in `[DeviceInfo]`.
const MASTER: [Row; 4] = [
    ("bootUpMaster", "SimpleBootUpMaster", Kind::Bool),
    ("flyingMaster", "FlyingMaster", Kind::Bool),
    ("SDOManager", "SDOManager", Kind::Bool),
    ("layerSettingServiceMaster", "LSS_Master", Kind::Bool),
];

/// Attributes of `deviceCommissioning` and their keys in `[DeviceComissioning]`.
const COMMISSIONING: [Row; 6] = [
    ("nodeID", "NodeID", Kind::Text),
    ("nodeName", "NodeName", Kind::Text),
    ("actualBaudRate", "Baudrate", Kind::BitRate),
    ("networkNumber", "NetNumber", Kind::Text),
    ("networkName", "NetworkName", Kind::Text),
    ("CANopenManager", "CANopenManager", Kind::Bool),
];

/// Elements that name a simple type (CiA 311, table of IEC 61131-3 types). The first line of a type is
/// the one that is written.
const TYPES: [(&str, DataType); 19] = [
    ("BOOL", DataType::BOOLEAN),
    ("SINT", DataType::INTEGER8),
    ("INT", DataType::INTEGER16),
    ("DINT", DataType::INTEGER32),
    ("LINT", DataType::INTEGER64),
    ("USINT", DataType::UNSIGNED8),
    ("UINT", DataType::UNSIGNED16),
    ("UDINT", DataType::UNSIGNED32),
    ("ULINT", DataType::UNSIGNED64),
    ("REAL", DataType::REAL32),
    ("LREAL", DataType::REAL64),
    ("STRING", DataType::VISIBLE_STRING),
    ("WSTRING", DataType::UNICODE_STRING),
    ("BITSTRING", DataType::OCTET_STRING),
    ("CHAR", DataType::INTEGER8),
    ("BYTE", DataType::UNSIGNED8),
    ("WORD", DataType::UNSIGNED16),
    ("DWORD", DataType::UNSIGNED32),
    ("LWORD", DataType::UNSIGNED64),
];

/// Words of a parameter's `access`.
const ACCESS: [(&str, Access); 6] = [
    ("const", Access::Const),
    ("read", Access::ReadOnly),
    ("write", Access::WriteOnly),
    ("readWrite", Access::ReadWrite),
    ("readWriteInput", Access::ReadWriteInput),
    ("readWriteOutput", Access::ReadWriteOutput),
];

#[cfg(test)]
mod tests {
    use alloc::format;
    use alloc::string::String;

    use super::super::read;
    use super::*;

    fn file(object: &str, management: &str) -> String {
        format!(
            "<ISO15745ProfileContainer xmlns=\"http://www.canopen.org/xml/1.1\"><!-- kept --><ISO15745Profile>\
             <CANopenObjectList>{object}</CANopenObjectList><NetworkManagement>{management}</NetworkManagement>\
             </ISO15745Profile></ISO15745ProfileContainer>"
        )
    }

    #[test]
    fn findings_quote_the_standard_of_xml() {
        let object = "<CANopenObject index=\"1000\" name=\"a\" dataType=\"0005\" accessType=\"ro\" defaultValue=\"256\" />";
        let found = super::super::check(&read(file(object, "").as_bytes()).unwrap());
        let clauses: alloc::vec::Vec<_> = found.iter().map(super::super::Diagnostic::clause).collect();
        assert_eq!(clauses, ["CiA 301, 7.5.2", "CiA 301, 7.5.2", "CiA 311", "CiA 301, 7.5.2"], "{found:?}");
    }

    /// Into which PDOs a value may go is said by the access where an EDS has a word for it.
    #[test]
    fn pdo_directions_get_into_an_eds_or_are_told() {
        let cases = [
            ("rw", "RPDO", "rww", ""),
            ("rw", "TPDO", "rwr", ""),
            ("ro", "TPDO", "ro", ""),
            ("wo", "RPDO", "wo", ""),
            ("rw", "optional", "rw", ""),
            ("rw", "no", "rw", ""),
            ("ro", "RPDO", "ro", "PDOmapping=\"RPDO\" of 2000h:00: it is written as mappable"),
            ("rw", "default", "rw", "PDOmapping=\"default\" of 2000h:00: it is written as mappable"),
        ];
        for (access, mapping, written, lost) in cases {
            let object = format!(
                "<CANopenObject index=\"2000\" name=\"a\" dataType=\"0005\" accessType=\"{access}\" PDOmapping=\"{mapping}\" />"
            );
            let device = read(file(&object, "").as_bytes()).unwrap().device;
            let text = super::super::write_eds(&device);
            assert!(text.contains(&format!("AccessType={written}\r\n")), "{access} {mapping}: {text}");
            assert!(text.contains(&format!("PDOMapping={}\r\n", u8::from(mapping != "no"))), "{text}");
            assert_eq!(super::super::lost_in_eds(&device).join(""), lost, "{access} {mapping}");
        }
    }

    /// XML makes blanks of tabs and line ends as they are, not of those that character references give.
    #[test]
    fn character_references_survive_in_values() {
        let object = "<CANopenObject index=\"2000\" name=\"a\" dataType=\"0009\" defaultValue=\"tab&#9;and\tline&#10;end\" \
            uniqueIDRef=\"P\" /><parameter uniqueID=\"P\"><actualValue value=\"x&#x9;y\" /></parameter>";
        let device = read(file(object, "").as_bytes()).unwrap().device;
        let own = &device.object(0x2000).unwrap().own;
        assert_eq!(own.default.as_deref(), Some("tab\tand line\nend"));
        assert_eq!(own.value.as_deref(), Some("x\ty"));
        assert_eq!(read(write_xdd(&device).0.as_bytes()).unwrap().device, device);
        // An EDS has a place for the tab, none for the line's end.
        let eds = read(super::super::write_eds(&device).as_bytes()).unwrap().device;
        assert_eq!(eds.object(0x2000).unwrap().own.default.as_deref(), Some("tab\tand line end"));
        assert_eq!(
            super::super::lost_in_eds(&device),
            ["line ends in DefaultValue of 2000h:00: blanks stand for them"]
        );
    }

    /// Found by fuzzing: blanks that XML takes from such a value made it another one when written.
    #[test]
    fn a_truth_value_may_have_blanks_around_it() {
        let text = file(
            "<CANopenObject index=\"1000\" name=\"a\" />",
            "<CANopenMasterFeatures bootUpMaster=\"true \" />",
        );
        let device = read(text.as_bytes()).unwrap().device;
        assert_eq!(device.device_info.get("SimpleBootUpMaster"), Some("1"));
        assert_eq!(read(write_xdd(&device).0.as_bytes()).unwrap().device, device);
    }

    /// Found by fuzzing: the first of two such elements was changed, where the second one counts.
    #[test]
    fn elements_that_contradict_each_other_are_written_anew() {
        let object = "<CANopenObject index=\"1000\" name=\"a\" />";
        let element = |node: u8| format!("<deviceCommissioning nodeID=\"{node}\" />");
        let (once, twice) = (file(object, &element(2)), file(object, &(element(1) + &element(2))));
        for (text, keeps_comments) in [(once, true), (twice, false)] {
            let reading = read(text.as_bytes()).unwrap();
            let mut changed = reading.device.clone();
            changed.commissioning.set("NodeID", "3");
            let updated = reading.update(&changed);
            assert_eq!(read(updated.as_bytes()).unwrap().device, changed, "{updated}");
            assert_eq!(updated.contains("kept"), keeps_comments, "{updated}");
        }
    }
}
