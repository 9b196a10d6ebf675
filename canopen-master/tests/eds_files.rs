//! Every recorded device description (needs `../shared/recorded`).
#![cfg(feature = "eds")]

use std::path::{Path, PathBuf};

use canopen_master::eds;

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
fn every_file_reads_or_is_refused_with_a_reason() {
    let Some(files) = files() else { return };
    for file in &files {
        let name = file.file_name().unwrap().to_string_lossy();
        match eds::read(&std::fs::read(file).unwrap()) {
            Ok(reading) => {
                let device = &reading.device;
                let subs: usize = device.objects.iter().map(|object| object.entries().len()).sum();
                println!(
                    "{name}: {} objects, {subs} entries, {} findings",
                    device.objects.len(),
                    reading.diagnostics.len()
                );
                for d in reading.diagnostics.iter().take(6) {
                    println!("    {d}");
                }
            }
            Err(error) => {
                println!("{name}: refused: {error}");
                assert!(!name.ends_with(".eds") && !name.ends_with(".dcf"), "{name}");
            }
        }
    }
}
