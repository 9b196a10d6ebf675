//! Every parameter has a test that shows its effect, named after its index, or a reason why not.
//!
//! `cargo test -p conformance --test parameter_list -- --nocapture` prints the list.

use std::collections::BTreeMap;
use std::path::Path;

use motion_core::parameters::iter;

/// Parameters without an effect of their own in this family.
const REASONS: [(u16, &str); 2] = [
    (1, "language of the device's own display; this family's texts are English"),
    (32, "copyright window on the device's own display"),
];

/// Inputs, outputs and axes: what they do is seen with the whole controller on a plant.
fn on_a_plant(first: u16) -> bool {
    matches!(first, 100..300 | 450..)
}

/// Names of tests that begin with `parameter_` or `parameters_`, by the numbers in them.
fn tests(directory: &Path, found: &mut BTreeMap<u16, String>) {
    for entry in std::fs::read_dir(directory).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            tests(&path, found);
            continue;
        }
        if path.extension().is_none_or(|extension| extension != "rs") {
            continue;
        }
        let text = std::fs::read_to_string(&path).unwrap();
        let mut lines = text.lines();
        while let Some(line) = lines.next() {
            if line.trim() != "#[test]" {
                continue;
            }
            let name = lines.next().and_then(|line| line.trim().strip_prefix("fn ")).unwrap_or("");
            let name = name.split('(').next().unwrap_or("");
            if !name.starts_with("parameter_") && !name.starts_with("parameters_") {
                continue;
            }
            let file = path.strip_prefix(Path::new(env!("CARGO_MANIFEST_DIR")).join("..")).unwrap();
            for number in name.split('_').filter(|part| part.len() == 3).filter_map(|part| part.parse().ok())
            {
                found.entry(number).or_insert_with(|| format!("{}: {name}", file.display()));
            }
        }
    }
}

#[test]
fn every_parameter_has_its_test_or_a_reason() {
    let family = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    // What is looked at closed loop, on a plant, is named before what is looked at alone.
    let mut closed = BTreeMap::new();
    tests(&family.join("device-sim/tests"), &mut closed);
    let mut found = closed.clone();
    tests(&family.join("motion-core/src"), &mut found);
    tests(&family.join("motion-core/tests"), &mut found);
    let (mut missing, mut open_loop) = (Vec::new(), Vec::new());
    let (mut tested, mut reasoned) = (0, 0);
    for entry in iter() {
        // Instances share a row, whose first index names its test.
        let first = entry.index() - entry.instance() as u16;
        let own = found.get(&entry.index()).or_else(|| found.get(&first));
        if on_a_plant(first) && !closed.contains_key(&first) {
            open_loop.push(entry.index());
        }
        let reason = REASONS.iter().find(|(index, _)| *index == first);
        match (own, reason) {
            (Some(test), None) => {
                tested += 1;
                println!("[{:03}] {entry}: {test}", entry.index());
            }
            (None, Some((_, reason))) => {
                reasoned += 1;
                println!("[{:03}] {entry}: no test: {reason}", entry.index());
            }
            _ => missing.push(entry.index()),
        }
    }
    println!("{tested} parameters with a test, {reasoned} with a reason");
    assert!(open_loop.is_empty(), "without a test on a plant: {open_loop:?}");
    assert!(missing.is_empty(), "without a test or a reason, or with both: {missing:?}");
    assert_eq!(tested + reasoned, 606);
}
