//! `eds check`: findings by line.

use canopen_master::eds::{self, Diagnostic, Severity};
use serde_json::{Value, json};

use super::cli::Input;
use super::{bytes, counts, diagnostic_json, kind_word, read_bytes};
use crate::exit::Exit;
use crate::output::{Output, put_text};

pub(super) fn run(out: &Output, input: &Input, lenient: bool, strict: bool) -> Result<(), Exit> {
    let name = input.file.display().to_string();
    let reading = match read_bytes(input, &bytes(&input.file)?) {
        Ok(reading) => reading,
        Err(error) => {
            let line = if let eds::ReadError::Xml { line, .. } = &error { *line } else { 0 };
            let refused = json!({ "line": line, "severity": "error", "rule": "refused", "clause": null, "message": error.to_string() });
            let document = json!({ "file": name, "format": null, "refused": true, "diagnostics": [refused] });
            out.document(document, || println!("{name}: refused: {error}"));
            return Err(Exit::check(format!("{name}: 1 error")));
        }
    };
    let diagnostics = if lenient { reading.diagnostics.clone() } else { eds::check(&reading) };
    let (objects, entries) = counts(&reading.device);
    let count = |severity| diagnostics.iter().filter(|diagnostic| diagnostic.severity() == severity).count();
    let (errors, warnings) = (count(Severity::Error), count(Severity::Warning));
    let document = json!({
        "file": name,
        "format": kind_word(&reading),
        "encoding": reading.source.encoding.name(),
        "refused": false,
        "objects": objects,
        "entries": entries,
        "errors": errors,
        "warnings": warnings,
        "diagnostics": diagnostics.iter().map(diagnostic_json).collect::<Vec<Value>>(),
    });
    out.document(document, || {
        let lines: String = diagnostics.iter().map(|diagnostic| line(&name, diagnostic)).collect();
        let kind = kind_word(&reading);
        let encoding = reading.source.encoding.name();
        put_text(&format!("{lines}{name}: {kind}, {encoding}, {objects} objects, {entries} entries\n"));
    });
    let total = format!("{name}: {errors} errors, {warnings} warnings");
    if errors == 0 && !(strict && warnings > 0) {
        out.remark(total);
        return Ok(());
    }
    Err(Exit::check(total))
}

/// As compilers say it, so that editors find the place.
fn line(name: &str, diagnostic: &Diagnostic) -> String {
    let Diagnostic { line, rule, message, .. } = diagnostic;
    let place = if *line > 0 { format!("{name}:{line}") } else { name.to_owned() };
    format!("{place}: {}: {message} [{}, {}]\n", rule.severity(), rule.word(), diagnostic.clause())
}
