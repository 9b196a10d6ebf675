//! What tests came to, as JUnit XML and JSON.

use core::fmt;
use core::fmt::Write as _;
use core::time::Duration;

use serde_json::{Value, json};

/// How a case ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Outcome {
    /// As it must be.
    Passed,
    /// Otherwise, and how.
    Failed(String),
    /// Not made, and why.
    Skipped(String),
}

impl Outcome {
    /// One word.
    #[must_use]
    pub const fn word(&self) -> &'static str {
        match self {
            Self::Passed => "passed",
            Self::Failed(_) => "failed",
            Self::Skipped(_) => "skipped",
        }
    }

    /// The reason, of one that has not passed.
    #[must_use]
    pub fn reason(&self) -> Option<&str> {
        match self {
            Self::Passed => None,
            Self::Failed(reason) | Self::Skipped(reason) => Some(reason),
        }
    }
}

/// One case of a report.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Case {
    /// Short name.
    pub id: String,
    /// What must hold.
    pub title: String,
    /// Where the standard says so; empty where it is not about a standard.
    pub clause: String,
    /// How it ended.
    pub outcome: Outcome,
    /// How long it took.
    pub time: Duration,
}

/// How many cases passed, failed and were skipped.
#[must_use]
pub fn counts(cases: &[Case]) -> (usize, usize, usize) {
    let count = |word| cases.iter().filter(|case| case.outcome.word() == word).count();
    (count("passed"), count("failed"), count("skipped"))
}

/// The cases as a JSON array.
#[must_use]
pub fn json(cases: &[Case]) -> Value {
    let case = |case: &Case| {
        json!({
            "id": case.id,
            "title": case.title,
            "clause": case.clause,
            "outcome": case.outcome.word(),
            "reason": case.outcome.reason(),
            "seconds": case.time.as_secs_f64(),
        })
    };
    cases.iter().map(case).collect()
}

/// Text between tags and in attributes; characters that XML 1.0 has not become `?`.
struct Escaped<'a>(&'a str);

impl fmt::Display for Escaped<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.chars().try_for_each(|character| match character {
            '&' => f.write_str("&amp;"),
            '<' => f.write_str("&lt;"),
            '>' => f.write_str("&gt;"),
            '"' => f.write_str("&quot;"),
            '\t' | '\n' => f.write_str(" "),
            '\0'..='\u{1F}' | '\u{FFFE}' | '\u{FFFF}' => f.write_char('?'),
            other => f.write_char(other),
        })
    }
}

/// The cases as JUnit XML, as continuous integration servers read it.
#[must_use]
pub fn junit(suite: &str, cases: &[Case]) -> String {
    let (_, failed, skipped) = counts(cases);
    let seconds: Duration = cases.iter().map(|case| case.time).sum();
    let mut xml = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
    let _ = writeln!(
        xml,
        "<testsuite name=\"{}\" tests=\"{}\" failures=\"{failed}\" errors=\"0\" skipped=\"{skipped}\" time=\"{:.3}\">",
        Escaped(suite),
        cases.len(),
        seconds.as_secs_f64(),
    );
    for case in cases {
        let clause = if case.clause.is_empty() { String::new() } else { format!(" ({})", case.clause) };
        let _ = write!(
            xml,
            "  <testcase classname=\"{}\" name=\"{}\" time=\"{:.3}\"",
            Escaped(&format!("{suite}.{}", case.id)),
            Escaped(&format!("{}{clause}", case.title)),
            case.time.as_secs_f64(),
        );
        let _ = match &case.outcome {
            Outcome::Passed => writeln!(xml, "/>"),
            Outcome::Failed(reason) => {
                writeln!(xml, "><failure message=\"{}\"/></testcase>", Escaped(reason))
            }
            Outcome::Skipped(reason) => {
                writeln!(xml, "><skipped message=\"{}\"/></testcase>", Escaped(reason))
            }
        };
    }
    xml.push_str("</testsuite>\n");
    xml
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_forms() {
        let case = |id: &str, outcome| Case {
            id: id.into(),
            title: "1 < 2".into(),
            clause: "CiA 301, 7.2".into(),
            outcome,
            time: Duration::from_millis(1500),
        };
        let cases = [case("a", Outcome::Passed), case("b", Outcome::Failed("\"x\" & y\n".into()))];
        assert_eq!(
            junit("node", &cases),
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
             <testsuite name=\"node\" tests=\"2\" failures=\"1\" errors=\"0\" skipped=\"0\" time=\"3.000\">\n\
             \x20 <testcase classname=\"node.a\" name=\"1 &lt; 2 (CiA 301, 7.2)\" time=\"1.500\"/>\n\
             \x20 <testcase classname=\"node.b\" name=\"1 &lt; 2 (CiA 301, 7.2)\" time=\"1.500\">\
             <failure message=\"&quot;x&quot; &amp; y \"/></testcase>\n\
             </testsuite>\n"
        );
        assert_eq!(json(&cases)[1]["reason"], "\"x\" & y\n");
        assert_eq!(counts(&cases), (1, 1, 0));
    }
}
