//! The cases on the terminal, as they end.

use core::fmt;

use conformance::report::{Case, Outcome};

use crate::output::Output;

/// Tells each case; of the many objects, those that passed are only counted, and those that were skipped
/// for the same reason are one line.
#[derive(Debug)]
pub(super) struct Teller<'a> {
    out: &'a Output,
    skipped: Vec<Group>,
}

/// Entries skipped for one reason.
#[derive(Debug)]
struct Group {
    reason: String,
    clause: String,
    entries: usize,
    /// First and last index of each row of objects.
    rows: Vec<(u16, u16)>,
}

/// The index in `object.1600.00.write`.
fn index(id: &str) -> Option<u16> {
    u16::from_str_radix(id.strip_prefix("object.")?.get(..4)?, 16).ok()
}

impl<'a> Teller<'a> {
    pub(super) const fn new(out: &'a Output) -> Self {
        Self { out, skipped: Vec::new() }
    }

    pub(super) fn tell(&mut self, case: &Case) {
        let Case { id, title, clause, outcome, .. } = case;
        let object = index(id);
        if object.is_none() {
            self.finish();
        }
        match outcome {
            Outcome::Passed if object.is_some() => {}
            Outcome::Passed => self.out.say(&format!("passed   {id}: {title} ({clause})")),
            Outcome::Failed(why) => {
                self.out.say(&format!("FAILED   {id}: {title} ({clause})\n         {why}"));
            }
            Outcome::Skipped(why) => match object {
                Some(index) => self.skip(index, why, clause),
                None => self.out.say(&format!("skipped  {id}: {why} ({clause})")),
            },
        }
    }

    fn skip(&mut self, index: u16, reason: &str, clause: &str) {
        let group = self.skipped.iter_mut().find(|group| group.reason == reason && group.clause == clause);
        let Some(group) = group else {
            let rows = vec![(index, index)];
            self.skipped.push(Group { reason: reason.into(), clause: clause.into(), entries: 1, rows });
            return;
        };
        group.entries += 1;
        match group.rows.last_mut() {
            Some((_, last)) if index.checked_sub(*last).is_some_and(|step| step <= 1) => *last = index,
            _ => group.rows.push((index, index)),
        }
    }

    /// Tells what has been gathered.
    pub(super) fn finish(&mut self) {
        for group in self.skipped.drain(..) {
            self.out.say(&format!("skipped  {group}"));
        }
    }
}

/// `1600h to 1603h, 1A00h, 325 entries: why (clause)`.
impl fmt::Display for Group {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (first, last) in &self.rows {
            match last - first {
                0 => write!(f, "{first:04X}h, ")?,
                _ => write!(f, "{first:04X}h to {last:04X}h, ")?,
            }
        }
        let entries = if self.entries == 1 { "entry" } else { "entries" };
        write!(f, "{} {entries}: {} ({})", self.entries, self.reason, self.clause)
    }
}
