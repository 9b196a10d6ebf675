//! Every violation of CiA 306-1 that reading alone does not show: `check`.

mod header;
mod objects;
mod pdo;
mod standard;

use alloc::collections::BTreeMap;
use alloc::string::String;
use alloc::vec::Vec;

use super::diagnostic::{Diagnostic, Rule};
use super::ini::{Document, LineKind, Section};
use super::model::Device;
use super::name::{ModulePart, Name, Part};
use super::reader::Findings;
use super::{Format, Reading, xdd};

/// What reading found, and every other violation of the standard, by line.
#[must_use]
pub fn check(reading: &Reading) -> Vec<Diagnostic> {
    let mut findings = Findings { list: reading.diagnostics.clone(), format: reading.source.format };
    let device = &reading.device;
    let text = reading.source.text.as_str();
    match reading.source.format {
        Format::Eds => {
            let document = Document::parse(text);
            layout(&document, &mut findings);
            numbering(&document, &mut findings);
            let places = Places::of_document(&document);
            header::check(device, &places, &mut findings);
            header::check_commissioning(device, &places, &mut findings);
            contents(device, &places, &mut findings);
        }
        Format::Xdd => {
            let places = Places { lines: xdd::lines(text), ..Places::default() };
            header::check_commissioning(device, &places, &mut findings);
            contents(device, &places, &mut findings);
        }
    }
    let mut diagnostics = findings.list;
    diagnostics.sort_by_key(|diagnostic| diagnostic.line);
    diagnostics
}

fn contents(device: &Device, places: &Places<'_>, findings: &mut Findings) {
    objects::check(device, places, findings);
    pdo::check(device, places, findings);
    standard::check(device, places, findings);
}

/// Where things stand in the file.
#[derive(Default)]
struct Places<'a> {
    /// Line of the section or element of an object (`None`) or sub-object.
    lines: BTreeMap<(u16, Option<u8>), u32>,
    /// The sections themselves, where the file has sections: mostly one.
    sections: BTreeMap<(u16, Option<u8>), Vec<&'a Section<'a>>>,
    /// Sections that are no objects, by upper-case name.
    named: BTreeMap<String, &'a Section<'a>>,
}

impl<'a> Places<'a> {
    fn of_document(document: &'a Document<'a>) -> Self {
        let mut places = Self::default();
        for section in document.sections.iter().filter(|section| section.line != 0) {
            let key = match Name::parse(section.name) {
                Name::Object(index, Part::Own) => (index, None),
                Name::Object(index, Part::Sub(subindex)) => (index, Some(subindex)),
                Name::Commissioning(_) => {
                    places.named.insert("DEVICECOMISSIONING".into(), section);
                    continue;
                }
                _ => {
                    places.named.insert(section.name.to_ascii_uppercase(), section);
                    continue;
                }
            };
            places.lines.insert(key, section.line);
            places.sections.entry(key).or_default().push(section);
        }
        places
    }

    /// Line of a key of an object or sub-object; of its section where it has no such key; of the
    /// object where the sub-object has no section of its own.
    fn line(&self, index: u16, subindex: Option<u8>, key: &str) -> u32 {
        let keys = [(index, subindex), (index, None)];
        let sections = keys.iter().find_map(|at| self.sections.get(at)).into_iter().flatten();
        let line = sections.rev().find_map(|section| section.entry(key)).map(|(line, _)| line);
        line.or_else(|| keys.iter().find_map(|at| self.lines.get(at).copied())).unwrap_or_default()
    }

    /// Line of a key of another section, or of the section.
    fn named_line(&self, section: &str, key: &str) -> u32 {
        let Some(section) = self.named.get(&section.to_ascii_uppercase()) else { return 0 };
        section.entry(key).map_or(section.line, |(line, _)| line)
    }
}

/// Longest line (CiA 306-1, 6.2).
const LINE_LENGTH: usize = 255;

fn layout(document: &Document<'_>, findings: &mut Findings) {
    for line in document.sections.iter().flat_map(|section| &section.lines) {
        let length = line.raw.trim_end_matches(['\r', '\n']).chars().count();
        if length > LINE_LENGTH {
            let message = alloc::format!("{length} characters, {LINE_LENGTH} at most");
            findings.add(line.number, Rule::LineLength, message);
        }
        if line.kind == LineKind::Comment && line.raw.trim_start().starts_with('#') {
            findings.add(line.number, Rule::Line, "a comment begins with ;, not with #");
        }
    }
}

/// Entries of lists are numbered from 1 without a gap; other readers take the first ones, as many as the
/// count says.
fn numbering(document: &Document<'_>, findings: &mut Findings) {
    for section in &document.sections {
        let rule = match Name::parse(section.name) {
            Name::List(_) => Rule::ListCount,
            Name::Object(_, Part::Links) => Rule::Links,
            Name::Module(_, ModulePart::FixedObjects | ModulePart::SubExtends) => Rule::Modules,
            _ => continue,
        };
        let numbers: BTreeMap<u32, u32> =
            section.entries().filter_map(|(line, key, _)| Some((key.parse().ok()?, line))).collect();
        let gap = (1..).zip(&numbers).find(|(expected, (number, _))| expected != *number);
        if let Some((expected, (number, line))) = gap {
            let message =
                alloc::format!("entry {number} of [{}] stands where {expected} should", section.name);
            findings.add(*line, rule, message);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Rule, read};
    use super::check;
    use alloc::vec::Vec;

    /// A file that violates nothing.
    const GOOD: &str = "[FileInfo]\nFileName=good.eds\nFileVersion=1\nFileRevision=1\nEDSVersion=4.0\n\
        Description=test\nCreationTime=09:00AM\nCreationDate=03-17-2023\nCreatedBy=A\nModificationTime=12:59PM\n\
        ModificationDate=12-31-2023\nModifiedBy=B\n\
        [DeviceInfo]\nVendorName=V\nVendorNumber=0x123\nProductName=P\nProductNumber=1\nRevisionNumber=2\n\
        OrderCode=O\nBaudRate_10=0\nBaudRate_20=0\nBaudRate_50=0\nBaudRate_125=1\nBaudRate_250=1\nBaudRate_500=1\n\
        BaudRate_800=0\nBaudRate_1000=1\nSimpleBootUpMaster=0\nSimpleBootUpSlave=1\nGranularity=8\n\
        DynamicChannelsSupported=0\nGroupMessaging=0\nNrOfRXPDO=1\nNrOfTXPDO=0\nLSS_Supported=0\n\
        [DummyUsage]\nDummy0005=1\n\
        [MandatoryObjects]\nSupportedObjects=3\n1=0x1000\n2=0x1001\n3=0x1018\n\
        [1000]\nParameterName=Device type\nObjectType=0x7\nDataType=0x0007\nAccessType=ro\nDefaultValue=0x191\nPDOMapping=0\n\
        [1001]\nParameterName=Error register\nObjectType=0x7\nDataType=0x0005\nAccessType=ro\nPDOMapping=1\n\
        [1018]\nParameterName=Identity\nObjectType=0x9\nSubNumber=2\n\
        [1018sub0]\nParameterName=Highest sub-index\nObjectType=0x7\nDataType=0x0005\nAccessType=const\nDefaultValue=1\nPDOMapping=0\n\
        [1018sub1]\nParameterName=Vendor ID\nObjectType=0x7\nDataType=0x0007\nAccessType=ro\nDefaultValue=0x123\nPDOMapping=0\n\
        [OptionalObjects]\nSupportedObjects=2\n1=0x1400\n2=0x1600\n\
        [1400]\nParameterName=RPDO\nObjectType=0x9\nSubNumber=2\n\
        [1400sub0]\nParameterName=Highest sub-index\nObjectType=0x7\nDataType=0x0005\nAccessType=ro\nDefaultValue=1\nPDOMapping=0\n\
        [1400sub1]\nParameterName=COB-ID\nObjectType=0x7\nDataType=0x0007\nAccessType=rw\nDefaultValue=$NODEID+0x200\nPDOMapping=0\n\
        [1600]\nParameterName=Mapping\nObjectType=0x9\nSubNumber=3\n\
        [1600sub0]\nParameterName=Mapped\nObjectType=0x7\nDataType=0x0005\nAccessType=rw\nDefaultValue=2\nPDOMapping=0\n\
        [1600sub1]\nParameterName=First\nObjectType=0x7\nDataType=0x0007\nAccessType=rw\nDefaultValue=0x00050008\nPDOMapping=0\n\
        [1600sub2]\nParameterName=Second\nObjectType=0x7\nDataType=0x0007\nAccessType=rw\nDefaultValue=0x20000010\nPDOMapping=0\n\
        [ManufacturerObjects]\nSupportedObjects=1\n1=0x2000\n\
        [2000]\nParameterName=Speed\nObjectType=0x7\nDataType=0x0003\nAccessType=rww\nDefaultValue=-5\nPDOMapping=1\n\
        LowLimit=-10\nHighLimit=10\n";

    fn findings(text: &str) -> Vec<alloc::string::String> {
        let reading = read(text.as_bytes()).unwrap();
        check(&reading).iter().map(alloc::string::ToString::to_string).collect()
    }

    #[test]
    fn a_good_file_has_no_findings() {
        assert_eq!(findings(GOOD), [""; 0]);
    }

    #[test]
    fn every_mutation_is_found_with_its_rule() {
        let cases: [(&str, &str, Rule); 49] = [
            ("[FileInfo]", "[FileInfos]", Rule::MissingSection),
            ("EDSVersion=4.0", "EDSVersion=four", Rule::FileInfo),
            ("FileVersion=1\n", "", Rule::FileInfo),
            ("CreationTime=09:00AM", "CreationTime=21:00", Rule::FileInfo),
            ("CreationDate=03-17-2023", "CreationDate=2023-03-17", Rule::FileInfo),
            ("VendorName=V\n", "", Rule::DeviceInfo),
            ("Granularity=8", "Granularity=65", Rule::DeviceInfo),
            ("BaudRate_125=1", "BaudRate_125=yes", Rule::DeviceInfo),
            ("VendorNumber=0x123", "VendorNumber=0x124", Rule::DeviceInfo),
            ("NrOfRXPDO=1", "NrOfRXPDO=0", Rule::DeviceInfo),
            ("Dummy0005=1", "Dummy0005=2", Rule::DummyUsage),
            ("Dummy0005=1", "Dummies=1", Rule::DummyUsage),
            ("SupportedObjects=3", "SupportedObjects=4", Rule::ListCount),
            ("3=0x1018", "3=0x2000", Rule::List),
            ("1=0x2000", "1=0x2001", Rule::List),
            ("2=0x1001\n", "2=0x1001\n4=0x1002\n", Rule::List),
            ("1=0x1400\n2=0x1600", "1=0x1400\n2=0x1600\n3=0x2000", Rule::List),
            ("[1001]", "[1002]", Rule::Mandatory),
            ("[1018sub1]", "[1018sub1", Rule::Line),
            ("[1018sub1]", "[1019sub1]", Rule::Orphan),
            ("3=0x1018", "4=0x1018", Rule::ListCount),
            ("NrOfRXPDO=1", "NrOfRXPDO=2", Rule::DeviceInfo),
            ("NrOfTXPDO=0", "NrOfTXPDO=1", Rule::DeviceInfo),
            ("SubNumber=2", "SubNumber=9", Rule::SubNumber),
            ("ParameterName=Speed\n", "", Rule::MissingEntry),
            ("DataType=0x0003\n", "", Rule::MissingEntry),
            ("AccessType=rww", "AccessType=all", Rule::Value),
            ("AccessType=rww", "AccessType=r/w", Rule::Spelling),
            ("ObjectType=0x7\nDataType=0x0003", "ObjectType=0x4\nDataType=0x0003", Rule::Value),
            ("DataType=0x0003", "DataType=0x0030", Rule::Value),
            ("SubNumber=3\n", "SubNumber=3\nDataType=0x7\n", Rule::SurplusEntry),
            ("LowLimit=-10", "LowLimit=low", Rule::Range),
            ("LowLimit=-10", "LowLimit=11", Rule::Range),
            ("DefaultValue=-5", "DefaultValue=-50", Rule::Range),
            ("DefaultValue=-5", "DefaultValue=100000", Rule::Range),
            ("DefaultValue=-5", "DefaultValue=08", Rule::Spelling),
            ("$NODEID+0x200", "0x200+$NODEID", Rule::NodeId),
            ("DefaultValue=0x191", "DefaultValue=0x191\nDefaultValue=0x192", Rule::DuplicateKey),
            ("[1000]", "[2000]", Rule::DuplicateSection),
            ("HighLimit=10", "HighLimit=10\nObjFlags=0x10", Rule::ObjFlags),
            (
                "DataType=0x0007\nAccessType=ro\nDefaultValue=0x191",
                "DataType=0x0006\nAccessType=ro\nDefaultValue=0x191",
                Rule::Standard,
            ),
            ("$NODEID+0x200", "$NODEID+0x580", Rule::Standard),
            ("0x20000010", "0x20000020", Rule::PdoMapping),
            ("0x20000010", "0x20010010", Rule::PdoMapping),
            ("0x20000010", "0x10000020", Rule::PdoMapping),
            ("0x00050008", "0x00070020", Rule::PdoMapping),
            ("ParameterName=Speed", "ParameterName=Spëed", Rule::Encoding),
            ("[1018sub0]", "[1018subx]", Rule::Header),
            ("HighLimit=10\n", "HighLimit=10\n[DeviceComissioning]\nNodeID=128\n", Rule::Commissioning),
        ];
        for (from, to, rule) in cases {
            let text = GOOD.replacen(from, to, 1);
            assert_ne!(text, GOOD, "{from}");
            let found = check(&read(text.as_bytes()).unwrap());
            assert!(found.iter().any(|finding| finding.rule == rule), "{from} -> {to}: {found:#?}");
        }
        let long =
            GOOD.replacen("ParameterName=Speed", &alloc::format!("ParameterName={}", "x".repeat(250)), 1);
        let found = check(&read(long.as_bytes()).unwrap());
        assert!(found.iter().any(|finding| finding.rule == Rule::LineLength));
        assert!(found.iter().any(|finding| finding.rule == Rule::NameLength));
    }

    /// The PDOs that `CompactPDO` implies need no description; a gap is told where it is.
    #[test]
    fn counts_of_pdos_and_numbers_of_lists() {
        let more = GOOD.replacen("NrOfRXPDO=1", "NrOfRXPDO=3", 1);
        assert!(findings(&more)[0].contains("NrOfRXPDO says 3, described are 1"), "{:?}", findings(&more));
        let compact = more.replacen("LSS_Supported=0", "LSS_Supported=0\nCompactPDO=0x3", 1);
        assert_eq!(findings(&compact), [""; 0]);
        let gap = GOOD.replacen("2=0x1001\n3=0x1018", "3=0x1001\n4=0x1018", 1);
        let found = findings(&gap);
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].contains("entry 3 of [MandatoryObjects] stands where 2 should"), "{found:?}");
    }

    /// Of two values of one sub-object the last one counts, and FFh is none; files are as they are all the same.
    #[test]
    fn compact_storage_with_doubtful_entries() {
        let compact = |count: u8, values: &str| {
            let sub_number = "[1018]\nParameterName=Identity\nObjectType=0x9\nSubNumber=2\n";
            let list = alloc::format!(
                "{sub_number}[2001]\nParameterName=L\nObjectType=0x8\nDataType=0x5\nAccessType=rw\nPDOMapping=0\n\
                 CompactSubObj={count}\n[2001Value]\n{values}"
            );
            let text = GOOD.replacen(sub_number, &list, 1).replacen(
                "SupportedObjects=1\n1=0x2000",
                "SupportedObjects=2\n1=0x2000\n2=0x2001",
                1,
            );
            let reading = read(text.as_bytes()).unwrap();
            (findings(&text), reading.device.object(0x2001).unwrap().subs.len())
        };
        assert_eq!(compact(254, "NrOfEntries=1\n1=5\n"), (Vec::new(), 255));
        let (found, subs) = compact(255, "NrOfEntries=1\n1=5\n");
        assert_eq!((found.len(), subs), (1, 256), "{found:?}");
        assert!(found[0].contains("CompactSubObj=255, 254 at most"), "{found:?}");
        let (found, _) = compact(3, "NrOfEntries=2\n1=5\n1=6\n");
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].contains("1 is there already"), "{found:?}");
    }

    /// What the sections of one object say together is not missing in each.
    #[test]
    fn sections_that_are_joined_need_each_key_once() {
        let split = |from: &str, name: &str, keys: &str| {
            let text = GOOD.replacen(from, &alloc::format!("{from}[{name}]\nParameterName=again\n{keys}"), 1);
            assert_ne!(text, GOOD);
            findings(&text)
        };
        let joined = split("DefaultValue=0x191\nPDOMapping=0\n", "1000", "");
        assert_eq!(joined.len(), 1, "{joined:#?}");
        assert!(joined[0].contains("[1000] is there already"), "{joined:#?}");
        // The number of sub-objects may stand in the first section, and a key in the second one.
        let joined = split("ObjectType=0x9\nSubNumber=2\n", "1018", "");
        assert_eq!(joined.len(), 1, "{joined:#?}");
        let joined = split("DefaultValue=1\nPDOMapping=0\n", "1018sub0", "");
        assert_eq!(joined.len(), 1, "{joined:#?}");
        let text = GOOD.replacen("AccessType=rww\n", "", 1);
        assert!(findings(&text)[0].contains("[2000] has no AccessType"));
        assert_eq!(findings(&(text + "[2000]\nAccessType=rww\n")).len(), 1);
    }

    /// As editors write it into every DCF: the defaults stay what the device has.
    #[test]
    fn an_empty_parameter_value_hides_no_mapping() {
        let configured = GOOD.replace("PDOMapping=0\n", "PDOMapping=0\nParameterValue=\n");
        let commissioned = configured
            + "[DeviceComissioning]\nNodeID=5\nNodeName=n\nBaudrate=500\nNetNumber=1\n\
            NetworkName=n\nCANopenManager=0\n";
        let mapping = |text: &str| -> Vec<_> {
            findings(text).into_iter().filter(|finding| finding.contains("maps")).collect()
        };
        assert_eq!(mapping(&commissioned), [""; 0]);
        let read_only = commissioned.replace("AccessType=rww", "AccessType=ro");
        let found = mapping(&read_only);
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(
            found[0].contains("1600h:02 maps 20000010h: its access is ro, which goes into TPDOs only"),
            "{found:?}"
        );
    }
}
