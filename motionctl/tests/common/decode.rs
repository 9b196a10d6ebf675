//! The JSON of `motionctl decode`.

use serde_json::Value;

use crate::common::Bench;

/// The objects that a capture gives.
pub(crate) fn objects(content: &[u8], more: &[&str]) -> Vec<Value> {
    let bench = Bench::new();
    std::fs::write(bench.path("capture"), content).unwrap();
    let mut arguments = vec!["--json", "decode", "capture"];
    arguments.extend(more);
    let ran = bench.run(&arguments).0;
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    let text = String::from_utf8(ran.stdout).unwrap();
    text.lines()
        .map(|line| serde_json::from_str(line).unwrap_or_else(|error| panic!("{error}: {line}")))
        .collect()
}

/// Whether an object has these members.
pub(crate) fn has(object: &Value, members: Value) -> bool {
    members.as_object().unwrap().iter().all(|(key, value)| object.get(key) == Some(value))
}
