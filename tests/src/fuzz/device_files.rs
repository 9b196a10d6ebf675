//! Device description files: whatever a file says, its model survives being written.

use canopen_master::eds::{self, Device, Fields, Format, Reading};

/// Reads with good will, and strictly too; a file that nothing changed is given back as it came.
fn read(data: &[u8], format: Format) -> Option<Reading> {
    let reading = eds::read(data).ok().filter(|reading| reading.source.format == format)?;
    let findings = eds::check(&reading);
    assert!(findings.len() >= reading.diagnostics.len());
    let lines = reading.source.text.split(['\n', '\r']).count();
    assert!(findings.iter().all(|finding| finding.line as usize <= lines), "a line that is not there");
    assert_eq!(reading.update(&reading.device), reading.source.text);
    Some(reading)
}

/// What the text says, which must read.
fn again(text: &str) -> Device {
    match eds::read(text.as_bytes()) {
        Ok(reading) => reading.device,
        Err(error) => panic!("{error}: {text}"),
    }
}

/// The device with a node ID, and with values for its last object.
fn configured(device: &Device) -> Device {
    let mut device = device.clone();
    device.commissioning.set("NodeID", "5");
    if let Some(object) = device.objects.last_mut() {
        let subindices: Vec<u8> = object.entries().iter().map(|entry| entry.subindex).collect();
        for entry in subindices {
            object.entry_mut(entry).expect("a sub-index of its own").value = Some("0x12".into());
        }
    }
    device
}

/// The device with the keys of every section in alphabetical order: a change may put new ones at
/// another place, and attributes in XML have no order.
fn sorted(mut device: Device) -> Device {
    let sort = |fields: &mut Fields| {
        let mut pairs: Vec<_> =
            fields.iter().map(|(key, value)| (key.to_owned(), value.to_owned())).collect();
        pairs.sort();
        *fields = pairs.into_iter().collect();
    };
    for fields in [&mut device.file_info, &mut device.device_info, &mut device.commissioning] {
        sort(fields);
    }
    for object in &mut device.objects {
        sort(&mut object.own.other);
        object.subs.iter_mut().for_each(|entry| sort(&mut entry.other));
    }
    device
}

/// EDS and DCF: read, written anew, read again; changed in place, read again.
pub fn eds_read(data: &[u8]) {
    let Some(reading) = read(data, Format::Eds) else { return };
    let text = eds::write_eds(&reading.device);
    assert_eq!(again(&text), reading.device, "{text}");
    let changed = configured(&reading.device);
    let text = reading.update(&changed);
    assert_eq!(sorted(again(&text)), sorted(changed), "{text}");
    let _ = reading.device.to_concise(None);
    let _ = reading.device.implied_pdos();
}

/// XDD and XDC: read, written anew, read again; changed in place, read again.
pub fn xdd_read(data: &[u8]) {
    let Some(reading) = read(data, Format::Xdd) else { return };
    let (text, _) = eds::write_xdd(&reading.device);
    assert_eq!(sorted(again(&text)), sorted(reading.device.clone()), "{text}");
    let changed = configured(&reading.device);
    let text = reading.update(&changed);
    assert_eq!(sorted(again(&text)), sorted(changed), "{text}");
}

/// A device with an object of every kind of value at 2000h + data type.
const EVERY_TYPE: &str = "[DeviceComissioning]\nNodeID=5\n\
    [2001]\nParameterName=boolean\nDataType=1\nAccessType=rw\n\
    [2002]\nParameterName=integer\nDataType=2\nAccessType=rw\nDefaultValue=-1\n\
    [2007]\nParameterName=unsigned\nDataType=7\nAccessType=rw\n\
    [2008]\nParameterName=real\nDataType=8\nAccessType=rw\nDefaultValue=1.5\n\
    [2009]\nParameterName=text\nDataType=9\nAccessType=rw\n\
    [200A]\nParameterName=octets\nDataType=0xA\nAccessType=rw\n\
    [200B]\nParameterName=unicode\nDataType=0xB\nAccessType=rw\n\
    [200C]\nParameterName=time\nDataType=0xC\nAccessType=rw\n\
    [200F]\nParameterName=domain\nDataType=0xF\nAccessType=rw\n\
    [2011]\nParameterName=long real\nDataType=0x11\nAccessType=rw\n\
    [2016]\nParameterName=24 bits\nDataType=0x16\nAccessType=rw\n\
    [201B]\nParameterName=64 bits\nDataType=0x1B\nAccessType=rw\n\
    [1400]\nParameterName=RPDO\nObjectType=9\nSubNumber=3\n\
    [1400sub0]\nParameterName=highest\nDataType=5\nAccessType=ro\nDefaultValue=2\n\
    [1400sub1]\nParameterName=COB-ID\nDataType=7\nAccessType=rw\nDefaultValue=$NODEID+0x200\n\
    [1400sub2]\nParameterName=type\nDataType=5\nAccessType=rw\nDefaultValue=255\n\
    [1600]\nParameterName=mapping\nObjectType=9\nSubNumber=2\n\
    [1600sub0]\nParameterName=mapped\nDataType=5\nAccessType=rw\nDefaultValue=0\n\
    [1600sub1]\nParameterName=first\nDataType=7\nAccessType=rw\n";

/// Concise DCF: bytes that are one are given back; values that a device takes come out of it as they
/// went in, and a second time the same.
pub fn eds_concise(data: &[u8]) {
    let Ok(entries) = eds::parse_concise(data) else { return };
    assert_eq!(eds::encode_concise(&entries), data);
    let mut device = again(EVERY_TYPE);
    let refused = device.apply_concise(&entries);
    for entry in entries.iter().filter(|entry| !refused.contains(entry)) {
        let place = (entry.index, entry.subindex);
        let last = entries
            .iter()
            .rfind(|other| (other.index, other.subindex) == place && !refused.contains(other))
            .expect("it is one of them");
        let taken = device.entry(entry.index, entry.subindex).expect("only what is there is taken");
        assert_eq!(taken.value_bytes(None), Some(Ok(last.data.clone())), "{:04X}h:{:02X}", place.0, place.1);
    }
    assert_eq!(again(&eds::write_eds(&device)), device);
    if let Ok(first) = device.to_concise(None) {
        let mut other = again(EVERY_TYPE);
        assert_eq!(other.apply_concise(&first), []);
        assert_eq!(other.to_concise(None).as_ref(), Ok(&first));
        let bytes = eds::encode_concise(&first);
        assert_eq!(eds::parse_concise(&bytes), Ok(first));
    }
}
