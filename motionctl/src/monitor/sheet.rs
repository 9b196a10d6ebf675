//! Tables as they are shown, on a screen or as plain text.

use crate::output::harmless;

/// How a row is to strike the eye.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Tone {
    #[default]
    Plain,
    /// All well.
    Good,
    /// Something to look at.
    Warn,
    /// A fault.
    Bad,
    /// No longer there.
    Faint,
}

/// A column of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Column {
    pub(super) name: &'static str,
    /// Numbers stand at the right.
    pub(super) right: bool,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Row {
    pub(super) cells: Vec<String>,
    pub(super) tone: Tone,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Table {
    pub(super) title: &'static str,
    /// None: lines of text.
    pub(super) columns: Vec<Column>,
    pub(super) rows: Vec<Row>,
    /// What is said where there are no rows.
    pub(super) empty: &'static str,
    /// The last rows are the ones to be seen.
    pub(super) tail: bool,
}

/// All that is shown.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Sheet {
    /// The first line.
    pub(super) head: String,
    pub(super) tables: Vec<Table>,
}

impl Table {
    /// A table; names of columns of numbers end with `>`.
    pub(super) fn new(title: &'static str, columns: &[&'static str], empty: &'static str) -> Self {
        let column = |name: &&'static str| Column {
            name: name.strip_suffix('>').unwrap_or(name),
            right: name.ends_with('>'),
        };
        let columns = columns.iter().map(column).collect();
        Self { title, columns, rows: Vec::new(), empty, tail: false }
    }

    /// Adds a row. What is in a cell remains in its line.
    pub(super) fn push(&mut self, tone: Tone, cells: impl IntoIterator<Item = String>) {
        let line = |cell: String| harmless(&cell).replace(['\n', '\t'], " ");
        self.rows.push(Row { cells: cells.into_iter().map(line).collect(), tone });
    }

    /// Characters that each column needs.
    pub(super) fn widths(&self) -> Vec<usize> {
        let cells = |at: usize| self.rows.iter().filter_map(move |row| row.cells.get(at));
        let widest = |at| cells(at).map(|cell| cell.chars().count()).max().unwrap_or(0);
        self.columns.iter().enumerate().map(|(at, column)| widest(at).max(column.name.len())).collect()
    }

    /// A line of it; without cells, that with the names of the columns.
    pub(super) fn line(&self, widths: &[usize], row: Option<&Row>) -> String {
        let mut line = String::new();
        let cells: Vec<&str> = match row {
            Some(row) => row.cells.iter().map(String::as_str).collect(),
            None => self.columns.iter().map(|column| column.name).collect(),
        };
        for (at, cell) in cells.into_iter().enumerate() {
            let room = widths.get(at).copied().unwrap_or(0).saturating_sub(cell.chars().count());
            let right = self.columns.get(at).is_some_and(|column| column.right);
            line.push_str("  ");
            line.extend(core::iter::repeat_n(' ', if right { room } else { 0 }));
            line.push_str(cell);
            line.extend(core::iter::repeat_n(' ', if right { 0 } else { room }));
        }
        line.truncate(line.trim_end().len());
        line
    }
}

impl Sheet {
    /// As plain text.
    pub(super) fn text(&self) -> String {
        let mut out = format!("{}\n", self.head);
        for table in &self.tables {
            let mut put = |line: &str| {
                out.push_str(line);
                out.push('\n');
            };
            put("");
            put(table.title);
            if table.rows.is_empty() {
                put(&format!("  {}", table.empty));
                continue;
            }
            let widths = table.widths();
            if !table.columns.is_empty() {
                put(&table.line(&widths, None));
            }
            table.rows.iter().for_each(|row| put(&table.line(&widths, Some(row))));
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_text_stands_in_columns() {
        let mut table = Table::new("Nodes", &["node>", "name"], "nobody");
        table.push(Tone::Plain, ["1".into(), "SD\u{1b}[2J\n03".into()]);
        table.push(Tone::Bad, ["127".into(), String::new()]);
        let sheet = Sheet { head: "bus".into(), tables: vec![table, Table::new("Rest", &[], "nothing")] };
        assert_eq!(
            sheet.text(),
            "bus\n\nNodes\n  node  name\n     1  SD\\u{1b}[2J 03\n   127\n\nRest\n  nothing\n"
        );
    }
}
