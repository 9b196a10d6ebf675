//! The same recording gives the same outputs, bit for bit: played twice, and recorded anew while it is
//! played. `.ci/run determinism` compares with a Cortex-M.
//!
//! `cargo test -p conformance --test determinism -- --ignored` makes the recording that is committed: anew
//! when the controller asks its drives something else than it did, so that the recorded answers do not fit.

mod record;

use determinism::{Counts, RECORDING, Record, Replica, What, records, replay};
use motion_core::STORAGE_LEN;

fn memory() -> (Vec<u8>, Vec<u8>) {
    (vec![0xFF; STORAGE_LEN], vec![0; 65_536])
}

fn played() -> (Counts, Vec<u64>) {
    let (mut storage, mut ram) = memory();
    let mut hashes = Vec::new();
    let (counts, last) = replay(&mut storage, &mut ram, |_, hash| hashes.push(hash)).unwrap();
    hashes.push(last);
    (counts, hashes)
}

/// Whether the recording is what was meant, and enough of it.
fn assert_meant(counts: &Counts) {
    assert!(counts.cycles >= 1_500, "{counts:?}");
    assert!(counts.homed && counts.arrived.iter().all(|&arrived| arrived >= 2), "{counts:?}");
    assert!(counts.frames.iter().all(|&frames| frames > 3_000), "{counts:?}");
    assert!(counts.answers > 200 && counts.failures >= 2, "{counts:?}");
}

#[test]
fn the_recording_gives_the_same_outputs_twice() {
    let (counts, hashes) = played();
    // What drives answer fits the questions of the engines of then. That all of them still move is looked
    // at where the recording is compared with other machines.
    assert!(counts.cycles >= 1_500 && counts.homed && counts.answers > 200, "{counts:?}");
    assert!(hashes.len() > 6 && hashes.windows(2).all(|pair| pair[0] != pair[1]), "{hashes:x?}");
    assert_eq!(played(), (counts, hashes));
}

/// One count of an encoder for one cycle is another hash.
#[test]
fn another_input_gives_another_hash() {
    let play = |change: bool| {
        let (mut storage, mut ram) = memory();
        let mut replica = Replica::new(&mut storage, &mut ram);
        let mut changes = change;
        for record in records(RECORDING) {
            let mut record = record.unwrap();
            if let What::Cycle { encoders: [Some(encoder), ..], .. } = &mut record.what
                && record.micros > 3_000_000
                && core::mem::take(&mut changes)
            {
                encoder.count += 1;
            }
            replica.take(&record, |_, _| ());
        }
        assert!(!changes, "no encoder moved");
        replica.hash()
    };
    assert_ne!(play(true), play(false));
}

#[test]
fn what_is_recorded_plays_as_it_was() {
    let (recording, counts, hash) = record::record();
    assert_meant(&counts);
    let (mut storage, mut ram) = memory();
    let mut replica = Replica::new(&mut storage, &mut ram);
    for record in records(&recording) {
        replica.take(&record.unwrap(), |_, _| ());
    }
    assert_eq!((*replica.counts(), replica.hash()), (counts, hash));
    assert_eq!(record::record().0, recording, "the devices are not the same twice");
}

#[test]
fn damage_is_told() {
    let whole = records(RECORDING).count();
    let cut: Vec<Result<Record<'_>, _>> = records(&RECORDING[..RECORDING.len() - 1]).collect();
    assert_eq!(cut.len(), whole);
    assert!(cut.last().is_some_and(Result::is_err));
}

#[test]
#[ignore = "makes the recording that is committed"]
fn make_the_recording() {
    let (recording, counts, hash) = record::record();
    assert_meant(&counts);
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../determinism/recording.bin");
    std::fs::write(path, &recording).unwrap();
    println!("{} B, {counts:?}, {hash:016x}", recording.len());
}
