//! `eds check|show|convert` as people run it.

#[allow(dead_code, reason = "what other tests use")]
mod common;

use common::Bench;

const EDS: &str = "; hand made\r\n[FileInfo]\r\nFileName=a.eds\r\n[DeviceInfo]\r\nVendorName=V\r\nBaudRate_500=1\r\n\
    [MandatoryObjects]\r\nSupportedObjects=2\r\n1=0x1000\r\n2=0x1001\r\n\
    [1000]\r\nParameterName=Device type\r\nDataType=7\r\nAccessType=ro\r\nDefaultValue=0x191\r\n\
    [1001]\r\nParameterName=Error register\r\nDataType=5\r\nAccessType=ro ; odd\r\n\
    [OptionalObjects]\r\nSupportedObjects=2\r\n1=0x1017\r\n2=0x1800\r\n\
    [1017]\r\nParameterName=Heartbeat\r\nDataType=6\r\nAccessType=rw\r\nDefaultValue=0\r\n\
    [1800]\r\nParameterName=TPDO\r\nObjectType=9\r\nSubNumber=1\r\n\
    [1800sub1]\r\nParameterName=COB-ID\r\nDataType=7\r\nAccessType=rw\r\nDefaultValue=$NODEID+0x180\r\n\
    [ManufacturerObjects]\r\nSupportedObjects=0\r\n";

fn bench() -> Bench {
    let bench = Bench::new();
    std::fs::write(bench.path("a.eds"), EDS).unwrap();
    bench
}

#[test]
fn check_names_line_and_clause() {
    let bench = bench();
    let json = bench.run(&["--json", "eds", "check", "a.eds"]).ends(1).json();
    assert_eq!(json["errors"], 2);
    assert_eq!(json["format"], "EDS");
    assert_eq!(json["objects"], 4);
    let odd = json["diagnostics"].as_array().unwrap().iter().find(|d| d["rule"] == "spelling").unwrap();
    assert_eq!(odd["line"], 19);
    assert_eq!(odd["severity"], "warning");
    assert_eq!(odd["clause"], "CiA 306-1, 6.3");
    bench
        .run(&["eds", "check", "a.eds"])
        .ends(1)
        .says("a.eds:19: warning: AccessType=\"ro ; odd\" is taken as ro");
    let lenient = bench.run(&["--json", "eds", "check", "--lenient", "a.eds"]).ends(0).json();
    assert_eq!(lenient["diagnostics"].as_array().unwrap().len(), 1, "{lenient}");

    bench.run(&["eds", "check", "--lenient", "--strict", "a.eds"]).ends(1).says("0 errors, 1 warnings");
    let broken = EDS.replace("DataType=6", "DataType=six");
    std::fs::write(bench.path("broken.eds"), broken).unwrap();
    bench.run(&["eds", "check", "broken.eds"]).ends(1).says("DataType is no number");

    std::fs::write(bench.path("b.eds"), "what is this\n").unwrap();
    let refused = bench.run(&["eds", "check", "b.eds"]).ends(1);
    assert_eq!(refused.stdout().matches("no device description: no section of an object").count(), 1);
    assert!(!refused.stderr().contains("no device description"), "{}", refused.stderr());
    bench.run(&["eds", "check", "absent.eds"]).ends(5);
}

#[test]
fn show_resolves_the_node_id() {
    let bench = bench();
    bench.run(&["eds", "show", "a.eds", "--node", "5"]).ends(0).says("default $NODEID+0x180 (0x185)");
    let json =
        bench.run(&["--json", "eds", "show", "a.eds", "Heartbeat", "1800h:1", "--node", "5"]).ends(0).json();
    let objects = json["objects"].as_array().unwrap();
    assert_eq!(objects.len(), 2);
    assert_eq!(objects[0]["entries"][0]["data_type"], "UNSIGNED16");
    assert_eq!(objects[1]["entries"][0]["data"], "85010000");
    bench.run(&["eds", "show", "a.eds", "0x2000"]).ends(2).says("0x2000 is not in a.eds");
    bench.run(&["eds", "show", "a.eds", "Herzschlag"]).ends(2);
}

#[test]
fn convert_changes_what_it_is_told_and_nothing_else() {
    let bench = bench();
    bench.run(&["eds", "convert", "a.eds", "same.eds"]).ends(0);
    bench.run(&["eds", "convert", "a.eds", "--output", "option.eds"]).ends(0);
    assert_eq!(std::fs::read_to_string(bench.path("option.eds")).unwrap(), EDS);
    bench.run(&["eds", "convert", "a.eds"]).ends(2);
    assert_eq!(std::fs::read_to_string(bench.path("same.eds")).unwrap(), EDS);

    let set =
        ["eds", "convert", "a.eds", "a.dcf", "--node", "5", "--bit-rate", "500", "--set", "Heartbeat=1000"];
    bench.run(&set).ends(0);
    let dcf = std::fs::read_to_string(bench.path("a.dcf")).unwrap();
    let expected = EDS
        .replace(
            "BaudRate_500=1\r\n",
            "BaudRate_500=1\r\n[DeviceComissioning]\r\nNodeID=5\r\nBaudrate=500\r\n\r\n",
        )
        .replace(
            "AccessType=rw\r\nDefaultValue=0\r\n",
            "AccessType=rw\r\nDefaultValue=0\r\nParameterValue=1000\r\n",
        );
    assert_eq!(dcf, expected);

    bench.run(&["eds", "convert", "a.dcf", "a.bin"]).ends(0);
    let concise = std::fs::read(bench.path("a.bin")).unwrap();
    assert_eq!(concise, [1, 0, 0, 0, 0x17, 0x10, 0, 2, 0, 0, 0, 0xE8, 0x03]);
    bench.run(&["eds", "convert", "a.eds", "b.xdc", "--concise", "a.bin", "--node", "5"]).ends(0);
    bench.run(&["eds", "show", "b.xdc", "0x1017"]).ends(0).says("= 0x03E8");

    bench.run(&["eds", "convert", "a.dcf", "back.eds"]).ends(0).says("1 configured values");
    assert_eq!(std::fs::read_to_string(bench.path("back.eds")).unwrap(), EDS);

    bench.run(&["--dry-run", "eds", "convert", "a.eds", "dry.xdd"]).ends(0).says("would write");
    assert!(!bench.path("dry.xdd").exists());
    bench.run(&["eds", "convert", "a.eds", "x", "--node", "5"]).ends(2).says("--to KIND");
    bench
        .run(&["eds", "convert", "a.eds", "x.dcf", "--set", "Heartbeat=100000"])
        .ends(2)
        .says("out of range");
}

/// What a description should not hold is kept where nothing is to change, and not put into one.
#[test]
fn a_description_stays_as_it_is_and_takes_no_values() {
    let bench = bench();
    let commissioning = "AccessType=rw\r\nDefaultValue=0\r\nParameterValue=5\r\n";
    let odd = EDS.replace("AccessType=rw\r\nDefaultValue=0\r\n", commissioning)
        + "[DeviceComissioning]\r\nNodeID=5\r\n";
    std::fs::write(bench.path("odd.eds"), &odd).unwrap();
    bench
        .run(&["eds", "convert", "odd.eds", "same.eds"])
        .ends(0)
        .says("a description should not: it is kept");
    assert_eq!(std::fs::read_to_string(bench.path("same.eds")).unwrap(), odd);
    bench.run(&["eds", "convert", "odd.eds", "other.xdd"]).ends(0).says("1 configured values");

    for change in [["--set", "0x1017:0=500"], ["--node", "5"], ["--bit-rate", "500"], ["--concise", "a.bin"]]
    {
        for name in ["x.eds", "x.xdd"] {
            let command = [&["eds", "convert", "a.eds", name], &change[..]].concat();
            bench.run(&command).ends(2).says("holds no configured values").says("a .dcf, .xdc or .bin");
            assert!(!bench.path(name).exists());
        }
    }
}

#[test]
fn a_configuration_without_values_and_one_that_no_device_takes_are_told() {
    let bench = bench();
    bench
        .run(&["eds", "convert", "a.eds", "a.bin", "--node", "5"])
        .ends(0)
        .says("a.eds configures nothing")
        .says("0 values, 4 bytes");
    bench
        .run(&["eds", "convert", "a.eds", "b.bin", "--node", "5", "--set", "0x1000=3"])
        .ends(0)
        .says("0x1000 cannot be written")
        .says("0 values");
}

/// A PDO of which the COB-ID depends on the node ID cannot be taken out of service without it.
#[test]
fn a_mapping_needs_the_node_id_for_a_concise_dcf() {
    let bench = Bench::new();
    let more = "[1A00]\r\nParameterName=Map\r\nObjectType=9\r\nSubNumber=1\r\n[1A00sub1]\r\nParameterName=1\r\n\
        DataType=7\r\nAccessType=rw\r\nDefaultValue=0\r\nParameterValue=0x10010008\r\n";
    std::fs::write(bench.path("a.dcf"), format!("{EDS}{more}")).unwrap();
    bench
        .run(&["eds", "convert", "a.dcf", "a.bin"])
        .ends(2)
        .says("1800h:01: depends on the node ID: give it by --node N");
    assert!(!bench.path("a.bin").exists());
    bench.run(&["eds", "convert", "a.dcf", "a.bin", "--node", "5"]).ends(0).says("5 values, 53 bytes");
    let concise = std::fs::read(bench.path("a.bin")).unwrap();
    assert_eq!(concise[..15], [5, 0, 0, 0, 0x00, 0x18, 1, 4, 0, 0, 0, 0x85, 1, 0, 0x80]);
}

/// An EDS has no word for `noAccess`: what gets lost is said.
#[test]
fn an_xdd_object_without_access_is_told_when_it_becomes_an_eds() {
    let bench = Bench::new();
    let xdd = "<ISO15745ProfileContainer><ISO15745Profile><ProfileBody>\
        <ApplicationProcess><parameterList><parameter uniqueID=\"P\" access=\"noAccess\"><UDINT/></parameter>\
        </parameterList></ApplicationProcess><ApplicationLayers><CANopenObjectList>\
        <CANopenObject index=\"1000\" name=\"Device type\" objectType=\"7\" dataType=\"0007\" accessType=\"ro\"/>\
        <CANopenObject index=\"2000\" name=\"Speed\" objectType=\"7\" uniqueIDRef=\"P\"/>\
        </CANopenObjectList></ApplicationLayers></ProfileBody></ISO15745Profile></ISO15745ProfileContainer>";
    std::fs::write(bench.path("a.xdd"), xdd).unwrap();
    bench
        .run(&["eds", "convert", "a.xdd", "b.eds"])
        .ends(0)
        .says("not carried over: that 2000h:00 has no access: it is written without AccessType");
    let text = std::fs::read_to_string(bench.path("b.eds")).unwrap();
    assert_eq!(text.matches("AccessType=").count(), 1, "{text}");
}

/// A file that is no device file: what `check` finds is a finding (1), for everybody else it is trouble with
/// a file (5), and so it is for a file that is not there.
#[test]
fn a_file_that_is_no_device_file_has_one_status_everywhere() {
    let bench = Bench::new();
    std::fs::write(bench.path("log"), "can0 701#05\n").unwrap();
    std::fs::write(bench.path("letter"), "Dear reader,\n").unwrap();
    std::fs::write(bench.path("other.xml"), "<letter/>").unwrap();
    std::fs::write(bench.path("empty"), "").unwrap();
    for name in ["letter", "other.xml", "empty", "nowhere"] {
        let named = format!("1={name}");
        let check = if name == "nowhere" { 5 } else { 1 };
        bench.run(&["eds", "check", name]).ends(check).says(name);
        bench.run(&["eds", "show", name]).ends(5).says(name);
        bench.run(&["eds", "convert", name, "out.dcf"]).ends(5).says(name);
        bench.run(&["decode", "log", "--eds", &named]).ends(5).says(name);
        bench.run(&["conform", "--can", "virtual:a", "--node", "1", "--eds", name]).ends(5).says(name);
    }
    assert!(!bench.path("out.dcf").exists());
}

/// What is read through a pipe, or from a file of any name, is what the content says.
#[test]
fn a_description_without_a_name_keeps_what_it_holds() {
    let bench = Bench::new();
    let odd = EDS.replace(
        "AccessType=rw\r\nDefaultValue=0\r\n",
        "AccessType=rw\r\nDefaultValue=0\r\nParameterValue=5\r\n",
    );
    std::fs::write(bench.path("odd.txt"), &odd).unwrap();
    bench.run(&["eds", "convert", "odd.txt", "same.eds"]).ends(0).says("it is kept");
    assert_eq!(std::fs::read_to_string(bench.path("same.eds")).unwrap(), odd);
    std::fs::write(bench.path("dcf.txt"), odd + "[DeviceComissioning]\r\nNodeID=5\r\n").unwrap();
    bench.run(&["eds", "convert", "dcf.txt", "other.eds"]).ends(0).says("1 configured values");
}

#[cfg(unix)]
#[test]
fn an_output_that_was_there_keeps_who_may_read_it() {
    use std::os::unix::fs::PermissionsExt as _;
    let bench = bench();
    let mode = |name: &str| std::fs::metadata(bench.path(name)).unwrap().permissions().mode() & 0o777;
    std::fs::write(bench.path("a.xdd"), "").unwrap();
    std::fs::set_permissions(bench.path("a.xdd"), std::fs::Permissions::from_mode(0o640)).unwrap();
    bench.run(&["eds", "convert", "a.eds", "a.xdd"]).ends(0);
    bench.run(&["eds", "convert", "a.eds", "new.xdd"]).ends(0);
    assert_eq!((mode("a.xdd"), mode("new.xdd")), (0o640, 0o644));
}
