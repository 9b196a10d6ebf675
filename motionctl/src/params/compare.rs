//! Differences between two sets of parameters.

use motion_core::parameters::{Entry, get};
use serde_json::json;

use super::file::Backup;
use crate::exit::Exit;
use crate::output::Output;

/// Tells what differs; status 1 if anything does, or if a value is out of range.
pub(crate) fn run(out: &Output, here: &Backup, there: &Backup) -> Result<(), Exit> {
    let (display_here, display_there) = (here.display(), there.display());
    let mut indices: Vec<u16> = here.values.keys().chain(there.values.keys()).copied().collect();
    indices.sort_unstable();
    indices.dedup();
    let (mut equal, mut different, mut only_here, mut only_there, mut out_of_range) =
        (0, vec![], vec![], vec![], vec![]);
    let mut lines = Vec::new();
    for entry in indices.into_iter().filter_map(get) {
        let index = entry.index();
        let (a, b) = (here.values.get(&index).copied(), there.values.get(&index).copied());
        let text = |value: Option<i32>, display| {
            value.map(|value| Entry::format(&entry, value, display).to_string())
        };
        let (a_text, b_text) = (text(a, &display_here), text(b, &display_there));
        let item = json!({
            "index": index, "name": entry.name(), "group": entry.group(),
            "here": a, "there": b, "here_text": a_text, "there_text": b_text,
        });
        if [a, b].into_iter().flatten().any(|value| !entry.allows(value)) {
            out_of_range.push(item.clone());
            lines.push(format!("out of range  {entry}: {} to {} expected", entry.minimum(), entry.maximum()));
        }
        match (a, b) {
            (Some(a), Some(b)) if a == b => equal += 1,
            (Some(_), Some(_)) => {
                different.push(item);
                let (a, b) = (a_text.unwrap_or_default(), b_text.unwrap_or_default());
                lines.push(format!("different     {entry}: here {a}, there {b}"));
            }
            (Some(_), None) => {
                only_here.push(item);
                lines.push(format!("only here     {entry}: {}", a_text.unwrap_or_default()));
            }
            _ => {
                only_there.push(item);
                lines.push(format!("only there    {entry}: {}", b_text.unwrap_or_default()));
            }
        }
    }
    if let (Some(a), Some(b)) = (&here.identity, &there.identity)
        && a != b
    {
        out.remark(format!(
            "here GEL {} with operating system {}, there GEL {} with {}",
            a.model, a.os_version, b.model, b.os_version
        ));
    }
    let same = lines.is_empty();
    let counts = format!(
        "{equal} equal, {} different, {} only here, {} only there, {} out of range",
        different.len(),
        only_here.len(),
        only_there.len(),
        out_of_range.len()
    );
    let document = json!({
        "equal": equal, "different": different, "only_here": only_here, "only_there": only_there,
        "out_of_range": out_of_range,
    });
    let count = lines.len();
    out.document(document, || {
        lines.iter().for_each(|line| println!("{line}"));
        println!("{counts}");
    });
    if same {
        Ok(())
    } else {
        Err(Exit::check(format!("{count} difference{}", if count == 1 { "" } else { "s" })))
    }
}
