//! The screen: which part of each table is seen, and what the keys change of that.

use ratatui::Frame;
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use ratatui::layout::Rect;
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::Line;

use super::Step;
use super::sheet::{Sheet, Table, Tone};

/// Fewest lines of a table: its title, the names of its columns, and a row.
const FEWEST: usize = 3;
/// Columns that one press of a key moves sideways.
const SIDEWAYS: usize = 8;

/// What a key asks for that is not about the screen alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Wish {
    Nothing,
    Quit,
    Go(Step),
}

/// Where the eye is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Eye {
    color: bool,
    /// Whether the subject has other moments to go to.
    steps: bool,
    pub(super) paused: bool,
    /// One table has the whole screen.
    alone: bool,
    focus: usize,
    tables: usize,
    /// Rows above the first one that is seen, or of tables whose end is to be seen, below the last one.
    rows: Vec<usize>,
    /// Characters left of the first one that is seen.
    left: usize,
    /// Rows of the table in focus, at the last drawing.
    page: usize,
}

impl Eye {
    pub(super) fn new(color: bool, steps: bool) -> Self {
        let (focus, tables, left, page) = (0, 1, 0, 1);
        Self { color, steps, paused: false, alone: false, focus, tables, rows: Vec::new(), left, page }
    }

    pub(super) fn key(&mut self, key: KeyEvent) -> Wish {
        if key.modifiers.contains(KeyModifiers::CONTROL) {
            return if key.code == KeyCode::Char('c') { Wish::Quit } else { Wish::Nothing };
        }
        let (focus, tables) = (self.focus, self.tables.max(1));
        match key.code {
            KeyCode::Char('q' | 'Q') | KeyCode::Esc => return Wish::Quit,
            KeyCode::Char('p' | 'P' | ' ') => self.paused = !self.paused,
            KeyCode::Char('z' | 'Z') | KeyCode::Enter => self.alone = !self.alone,
            KeyCode::Tab => self.focus = (focus + 1) % tables,
            KeyCode::BackTab => self.focus = (focus + tables - 1) % tables,
            KeyCode::Char(digit @ '1'..='9') => {
                let table = digit as usize - '1' as usize;
                self.focus = if table < tables { table } else { focus };
            }
            KeyCode::Left => self.left = self.left.saturating_sub(SIDEWAYS),
            KeyCode::Right => self.left = self.left.saturating_add(SIDEWAYS),
            KeyCode::Up => self.scroll(-1),
            KeyCode::Down => self.scroll(1),
            KeyCode::PageUp => self.scroll(-(self.page as isize)),
            KeyCode::PageDown => self.scroll(self.page as isize),
            KeyCode::Char('.') => return Wish::Go(Step::Forth),
            KeyCode::Char(',') => return Wish::Go(Step::Back),
            KeyCode::Char('>') => return Wish::Go(Step::FarForth),
            KeyCode::Char('<') => return Wish::Go(Step::FarBack),
            KeyCode::Home => return Wish::Go(Step::Start),
            KeyCode::End => return Wish::Go(Step::End),
            _ => {}
        }
        Wish::Nothing
    }

    /// Moves the table in focus; what is too far is taken back when it is drawn.
    fn scroll(&mut self, by: isize) {
        if let Some(rows) = self.rows.get_mut(self.focus) {
            *rows = rows.saturating_add_signed(by);
        }
    }

    /// Draws what there is room for.
    pub(super) fn draw(&mut self, frame: &mut Frame<'_>, sheet: &Sheet) {
        let area = frame.area();
        self.tables = sheet.tables.len();
        self.focus = self.focus.min(self.tables.saturating_sub(1));
        self.rows.resize(self.tables, 0);
        let paused = if self.paused { "PAUSED  " } else { "" };
        put(frame, area, 0, &format!("{paused}{}", sheet.head), 0, Style::new().add_modifier(Modifier::BOLD));
        let height = usize::from(area.height);
        let room = height.saturating_sub(2);
        let needs: Vec<usize> = sheet.tables.iter().map(needed).collect();
        let parts = match heights(room, &needs, self.focus) {
            Some(parts) if !self.alone => parts,
            _ => (0..self.tables).map(|at| if at == self.focus { room } else { 0 }).collect(),
        };
        let mut top = 1;
        for (at, (table, lines)) in sheet.tables.iter().zip(parts).enumerate() {
            self.table(frame, area, table, at, top, lines);
            top += lines;
        }
        if height > 1 {
            let time = if self.steps { "  , . < > Home End time" } else { "" };
            let keys = format!("q quit  Tab table  arrows scroll  z alone  p pause{time}");
            put(frame, area, height - 1, &keys, 0, Style::new().add_modifier(Modifier::REVERSED));
        }
    }

    fn table(
        &mut self,
        frame: &mut Frame<'_>,
        area: Rect,
        table: &Table,
        at: usize,
        top: usize,
        lines: usize,
    ) {
        if lines == 0 {
            return;
        }
        let focused = at == self.focus;
        let mut style = Style::new().add_modifier(Modifier::BOLD);
        if focused {
            style = style.add_modifier(Modifier::UNDERLINED);
        }
        let names = usize::from(!table.columns.is_empty());
        let room = lines.saturating_sub(1 + names);
        let count = table.rows.len();
        let most = count.saturating_sub(room);
        let moved = self.rows.get(at).copied().unwrap_or(0).min(most);
        if focused {
            self.page = room.max(1);
        }
        if let Some(rows) = self.rows.get_mut(at) {
            *rows = moved;
        }
        // Of a table whose end is to be seen, Up goes to what is older.
        let first = if table.tail { most - moved } else { moved };
        let which = match count > room && room > 0 {
            true => format!("  {}-{} of {count}", first + 1, (first + room).min(count)),
            false => String::new(),
        };
        put(frame, area, top, &format!("{} {}{which}", at + 1, table.title), 0, style);
        if count == 0 {
            if lines > 1 {
                put(frame, area, top + 1, &format!("  {}", table.empty), 0, Style::new());
            }
            return;
        }
        let widths = table.widths();
        let left = if focused { self.left } else { 0 };
        if names == 1 && lines > 1 {
            let style = Style::new().add_modifier(Modifier::DIM);
            put(frame, area, top + 1, &table.line(&widths, None), left, style);
        }
        for (line, row) in table.rows.iter().skip(first).take(room).enumerate() {
            let style = self.style(row.tone);
            put(frame, area, top + 1 + names + line, &table.line(&widths, Some(row)), left, style);
        }
    }

    fn style(&self, tone: Tone) -> Style {
        let plain = Style::new();
        match (tone, self.color) {
            (Tone::Good, true) => plain.fg(Color::Green),
            (Tone::Warn, true) => plain.fg(Color::Yellow),
            (Tone::Bad, true) => plain.fg(Color::Red),
            (Tone::Warn | Tone::Bad, false) => plain.add_modifier(Modifier::BOLD),
            (Tone::Faint, _) => plain.add_modifier(Modifier::DIM),
            _ => plain,
        }
    }
}

/// One line of the area.
fn put(frame: &mut Frame<'_>, area: Rect, line: usize, text: &str, left: usize, style: Style) {
    let line = u16::try_from(line).unwrap_or(u16::MAX);
    if line < area.height {
        let text: String = text.chars().skip(left).collect();
        let area = Rect { y: area.y + line, height: 1, ..area };
        frame.render_widget(Line::styled(text, style), area);
    }
}

/// Lines that a table would like to have.
fn needed(table: &Table) -> usize {
    if table.tail {
        return usize::MAX;
    }
    let names = usize::from(!table.columns.is_empty() && !table.rows.is_empty());
    1 + names + table.rows.len().max(1)
}

/// How many of `room` lines each table gets; `None` where they do not all have the fewest.
fn heights(room: usize, needs: &[usize], focus: usize) -> Option<Vec<usize>> {
    let mut parts: Vec<usize> = needs.iter().map(|need| FEWEST.min(*need)).collect();
    let mut left = room.checked_sub(parts.iter().sum())?;
    let mut give = |at: usize, most: usize, left: &mut usize| {
        if let (Some(part), Some(need)) = (parts.get_mut(at), needs.get(at)) {
            let more = (need - *part).min(most).min(*left);
            *part += more;
            *left -= more;
        }
    };
    // Nobody takes more than half of what is left from those that come after it.
    let half = left.div_ceil(2);
    give(focus, half, &mut left);
    for at in (0..needs.len()).filter(|at| *at != focus) {
        let half = left.div_ceil(2);
        give(at, half, &mut left);
    }
    for at in 0..needs.len() {
        let all = left;
        give(at, all, &mut left);
    }
    Some(parts)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;

    fn sheet() -> Sheet {
        let mut nodes = Table::new("Nodes", &["node>", "state"], "nobody");
        (1..=20).for_each(|node| nodes.push(Tone::Good, [format!("{node}"), format!("state {node}")]));
        let mut story = Table::new("Story", &[], "nothing");
        story.tail = true;
        (1..=50).for_each(|line| story.push(Tone::Plain, [format!("line {line}")]));
        let empty = Table::new("Empty", &["a"], "nothing here");
        Sheet { head: "a bus  1.0 s".into(), tables: vec![nodes, empty, story] }
    }

    fn screen(eye: &mut Eye, width: u16, height: u16) -> Vec<String> {
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        terminal.draw(|frame| eye.draw(frame, &sheet())).unwrap();
        let buffer = terminal.backend().buffer().clone();
        let rows = buffer.content.chunks(usize::from(width).max(1));
        rows.map(|row| {
            row.iter().map(ratatui::buffer::Cell::symbol).collect::<String>().trim_end().to_owned()
        })
        .collect()
    }

    fn press(eye: &mut Eye, code: KeyCode) -> Wish {
        eye.key(KeyEvent::new(code, KeyModifiers::NONE))
    }

    #[test]
    fn every_table_has_its_part() {
        let mut eye = Eye::new(true, false);
        let lines = screen(&mut eye, 60, 24);
        assert_eq!(lines.len(), 24);
        assert_eq!(lines[0], "a bus  1.0 s");
        assert_eq!(lines[1], "1 Nodes  1-11 of 20");
        assert_eq!(&lines[2..5], ["  node  state", "     1  state 1", "     2  state 2"]);
        assert_eq!(&lines[14..17], ["2 Empty", "  nothing here", "3 Story  45-50 of 50"]);
        assert_eq!(lines[22], "  line 50");
        assert!(lines[23].starts_with("q quit"), "{lines:#?}");
    }

    #[test]
    fn keys_move_what_is_seen() {
        let mut eye = Eye::new(false, true);
        screen(&mut eye, 60, 24);
        (0..100).for_each(|_| assert_eq!(press(&mut eye, KeyCode::Down), Wish::Nothing));
        assert_eq!(screen(&mut eye, 60, 24)[1], "1 Nodes  10-20 of 20");
        press(&mut eye, KeyCode::Up);
        assert_eq!(screen(&mut eye, 60, 24)[1], "1 Nodes  9-19 of 20");
        // Alone on the screen.
        press(&mut eye, KeyCode::Char('z'));
        assert_eq!(screen(&mut eye, 60, 24)[1], "1 Nodes");
        press(&mut eye, KeyCode::BackTab);
        let lines = screen(&mut eye, 60, 24);
        assert_eq!((lines[1].as_str(), lines[22].as_str()), ("3 Story  30-50 of 50", "  line 50"));
        press(&mut eye, KeyCode::PageUp);
        press(&mut eye, KeyCode::Char('2'));
        assert_eq!(screen(&mut eye, 60, 24)[1], "2 Empty");
        press(&mut eye, KeyCode::Tab);
        assert_eq!(screen(&mut eye, 60, 24)[22], "  line 50");
        press(&mut eye, KeyCode::Right);
        assert_eq!(screen(&mut eye, 60, 24)[22], "0");
        press(&mut eye, KeyCode::Char('p'));
        let lines = screen(&mut eye, 60, 24);
        assert!(lines[0].starts_with("PAUSED") && lines[23].contains(", . < >"), "{lines:#?}");
        for (code, wish) in [
            (KeyCode::Char('q'), Wish::Quit),
            (KeyCode::Esc, Wish::Quit),
            (KeyCode::Char('.'), Wish::Go(Step::Forth)),
            (KeyCode::Home, Wish::Go(Step::Start)),
        ] {
            assert_eq!(press(&mut eye, code), wish);
        }
        assert_eq!(eye.key(KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL)), Wish::Quit);
    }

    /// Whatever the size, nothing panics, and the table in focus is what is seen.
    #[test]
    fn small_terminals() {
        for width in [0, 1, 2, 7, 20, 200] {
            for height in 0..30 {
                let mut eye = Eye::new(true, true);
                for _ in 0..3 {
                    let lines = screen(&mut eye, width, height);
                    if width == 20 && height >= 3 {
                        let titles = ["1 Nodes", "2 Empty", "3 Story"];
                        assert!(titles.iter().any(|title| lines[1].contains(title)), "{lines:?}");
                    }
                    press(&mut eye, KeyCode::Down);
                    press(&mut eye, KeyCode::PageDown);
                    press(&mut eye, KeyCode::Right);
                    screen(&mut eye, width, height);
                    press(&mut eye, KeyCode::BackTab);
                    press(&mut eye, KeyCode::BackTab);
                }
            }
        }
        // No tables at all.
        let mut terminal = Terminal::new(TestBackend::new(10, 3)).unwrap();
        let mut eye = Eye::new(true, true);
        press(&mut eye, KeyCode::Tab);
        terminal.draw(|frame| eye.draw(frame, &Sheet { head: String::new(), tables: Vec::new() })).unwrap();
    }

    #[test]
    fn colours_only_where_they_are_wanted() {
        for (color, expected) in [(true, Color::Green), (false, Color::Reset)] {
            let mut terminal = Terminal::new(TestBackend::new(40, 24)).unwrap();
            terminal.draw(|frame| Eye::new(color, false).draw(frame, &sheet())).unwrap();
            let cell = terminal.backend().buffer().cell((8, 3)).unwrap();
            assert_eq!((cell.symbol(), cell.fg), ("s", expected));
        }
    }

    #[test]
    fn heights_add_up() {
        assert_eq!(heights(5, &[10, 10], 0), None);
        assert_eq!(heights(6, &[10, 10], 0), Some(vec![3, 3]));
        assert_eq!(heights(100, &[10, 10], 0), Some(vec![10, 10]));
        assert_eq!(heights(20, &[3, 40, usize::MAX], 1).unwrap().iter().sum::<usize>(), 20);
        assert_eq!(heights(0, &[], 0), Some(Vec::new()));
    }
}
