//! Every recorded device description (needs `../shared/recorded`).
#![cfg(feature = "eds")]

use std::path::{Path, PathBuf};

use canopen_master::eds::{self, Format};

/// The files that are no device description, and what is said of them.
const REFUSED: [(&str, &str); 4] = [
    ("jiujiujiur0000__CANopenEditor__NewCANopenProject.cpj", "a project file that holds no device"),
    ("lbgitlove__CANopenEditorLB__demo_device.xdd", "root element is DeviceProfile"),
    ("lbgitlove__CANopenEditorLB__incomplete_device.xdd", "root element is DeviceProfile"),
    ("lbgitlove__CANopenEditorLB__mixed_case_device.xdd", "root element is DeviceProfile"),
];

fn files() -> Option<Vec<PathBuf>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/recorded/eds");
    let Ok(entries) = std::fs::read_dir(&folder) else {
        println!("ignored: needs ../shared/recorded");
        return None;
    };
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    files.sort();
    Some(files)
}

#[test]
fn every_file_survives_being_written_or_is_refused_with_a_reason() {
    let Some(files) = files() else { return };
    assert!(files.len() >= 218, "{} files", files.len());
    let mut refused = Vec::new();
    for file in &files {
        let name = file.file_name().unwrap().to_string_lossy();
        let bytes = std::fs::read(file).unwrap();
        let reading = match eds::read(&bytes) {
            Ok(reading) => reading,
            Err(error) => {
                println!("{name}: refused: {error}");
                refused.push((name.into_owned(), error.to_string()));
                continue;
            }
        };
        let device = &reading.device;
        let text = match reading.source.format {
            Format::Eds => eds::write_eds(device),
            Format::Xdd => eds::write_xdd(device).0,
        };
        assert_eq!(&eds::read(text.as_bytes()).unwrap().device, device, "{name}, written anew");
        assert_eq!(reading.source.encode(&reading.update(device)), bytes, "{name}, unchanged");
        let subs: usize = device.objects.iter().map(|object| object.entries().len()).sum();
        println!(
            "{name}: {} objects, {subs} entries, {} doubtful places, {} findings in all; written and read again: same",
            device.objects.len(),
            reading.diagnostics.len(),
            eds::check(&reading).len(),
        );
    }
    assert_eq!(refused.len(), REFUSED.len(), "{refused:#?}");
    for ((name, error), (expected, words)) in refused.iter().zip(REFUSED) {
        assert_eq!(name, expected);
        assert!(error.contains(words), "{name}: {error}");
    }
}

/// 1.7 MB of text became 1.1 GB of sub-objects.
#[test]
fn a_small_file_does_not_fill_the_memory() {
    let object =
        |index: u16| format!("[{index:X}]\nParameterName=a\nDataType=7\nAccessType=rw\nCompactSubObj=254\n");
    let text: String = (0x2000..0x6000).map(object).collect();
    let reading = eds::read(text.as_bytes()).unwrap();
    let entries: usize = reading.device.objects.iter().map(|object| object.subs.len()).sum();
    assert!((100_000..500_000).contains(&entries), "{entries}");
    assert!(reading.diagnostics.iter().any(|found| found.message.contains("passed over")));
    assert!(matches!(eds::read(&vec![b'\n'; (4 << 20) + 1]), Err(eds::ReadError::TooLong)));
}
