//! Times in nanoseconds, for people and for JSON.

use serde_json::{Value, json};

/// Seconds for JSON, to the microsecond.
pub(super) fn seconds(nanos: Option<i64>) -> Value {
    nanos.map_or(Value::Null, |nanos| json!((nanos / 1000) as f64 / 1e6))
}

pub(super) fn in_ms(nanos: i64) -> String {
    format!("{:.1} ms", nanos as f64 / 1e6)
}

/// How long ago something was.
pub(super) fn since(now: Option<i64>, then: Option<i64>) -> Option<i64> {
    now.zip(then).map(|(now, then)| now.saturating_sub(then))
}

/// The same in words.
pub(super) fn age(now: Option<i64>, then: Option<i64>) -> String {
    let Some(age) = since(now, then) else { return String::new() };
    match age as f64 / 1e9 {
        age if age < 100.0 => format!("{age:.1} s"),
        age if age < 6000.0 => format!("{:.0} min", age / 60.0),
        age => format!("{:.0} h", age / 3600.0),
    }
}
