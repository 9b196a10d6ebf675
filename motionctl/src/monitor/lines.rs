//! Lines of what happened.

use std::collections::VecDeque;

use serde::Serialize;

use super::sheet::{Table, Tone};

/// So many are kept.
const MOST: usize = 500;

/// The last lines, the oldest first.
#[derive(Debug, Default, Serialize)]
pub(super) struct Lines(VecDeque<String>);

impl Lines {
    pub(super) fn push(&mut self, line: String) {
        if self.0.len() == MOST {
            self.0.pop_front();
        }
        self.0.push_back(line);
    }

    /// As a table, whose end is to be seen; `empty` is said where there are none.
    pub(super) fn table(&self, empty: &'static str) -> Table {
        let mut table = Table::new("What happened", &[], empty);
        table.tail = true;
        self.0.iter().for_each(|line| table.push(Tone::Plain, [line.clone()]));
        table
    }
}
