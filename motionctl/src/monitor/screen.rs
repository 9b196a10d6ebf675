//! The terminal: taken and given back whatever happens, keys in, the screen out.

use core::sync::atomic::Ordering;
use core::time::Duration;
use std::io::{self, IsTerminal, Stdout, Write, stdin, stdout};
use std::time::Instant;

use ratatui::backend::CrosstermBackend;
use ratatui::crossterm::event::{Event, KeyEventKind, poll, read};
use ratatui::crossterm::style::force_color_output;
use ratatui::crossterm::terminal::{
    EnterAlternateScreen, LeaveAlternateScreen, disable_raw_mode, enable_raw_mode, size,
};
use ratatui::crossterm::{cursor, execute};
use ratatui::layout::Rect;
use ratatui::{Terminal, TerminalOptions, Viewport};

use super::draw::{Eye, Wish};
use super::{Step, Subject};
use crate::exit::Exit;
use crate::output::Output;

/// The longest wait between two looks at the keys.
pub(super) const TURN: Duration = Duration::from_millis(20);
/// The screen is drawn so often.
const REFRESH: Duration = Duration::from_millis(100);
/// Of a terminal that does not know its size.
const USUAL: (u16, u16) = (80, 24);

fn trouble(error: io::Error) -> Exit {
    Exit::file("the terminal", &error)
}

/// The screen and the keys have to be a terminal.
pub(super) fn needs_terminal() -> Result<(), Exit> {
    for (what, is) in [("standard output", stdout().is_terminal()), ("standard input", stdin().is_terminal())]
    {
        if !is {
            return Err(Exit::usage(format!(
                "{what} is no terminal, which the screen needs; --once prints one snapshot, with --json as a document"
            )));
        }
    }
    Ok(())
}

/// A terminal in our hands; dropped, it is as it was.
struct Screen {
    terminal: Terminal<CrosstermBackend<Stdout>>,
}

impl Screen {
    fn open() -> io::Result<Self> {
        let hook = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            restore();
            hook(panic);
        }));
        enable_raw_mode()?;
        let opened = || -> io::Result<Self> {
            execute!(stdout(), EnterAlternateScreen, cursor::Hide)?;
            let backend = CrosstermBackend::new(stdout());
            let viewport = match size() {
                Ok((width, height)) if width > 0 && height > 0 => Viewport::Fullscreen,
                _ => Viewport::Fixed(Rect::new(0, 0, USUAL.0, USUAL.1)),
            };
            let terminal = Terminal::with_options(backend, TerminalOptions { viewport })?;
            Ok(Self { terminal })
        };
        opened().inspect_err(|_| restore())
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        restore();
    }
}

/// As it was; that a terminal which is gone cannot be restored is no trouble.
fn restore() {
    let _ = disable_raw_mode();
    let _ = execute!(stdout(), LeaveAlternateScreen, cursor::Show);
    let _ = stdout().flush();
}

/// Shows the subject until somebody has had enough, or for `limit`.
pub(super) fn show(out: &Output, subject: &mut dyn Subject, limit: Option<Duration>) -> Result<(), Exit> {
    let stop = crate::can::stop_flag()?;
    let color = out.colors(stdout().is_terminal());
    force_color_output(color);
    let mut eye = Eye::new(color, subject.go(Step::End)?);
    let mut screen = Screen::open().map_err(trouble)?;
    let start = Instant::now();
    let mut sheet = subject.sheet();
    let mut due = Duration::ZERO;
    while !stop.load(Ordering::Relaxed) && limit.is_none_or(|limit| start.elapsed() < limit) {
        while poll(Duration::ZERO).map_err(trouble)? {
            due = Duration::ZERO;
            let Event::Key(key) = read().map_err(trouble)? else { continue };
            if key.kind == KeyEventKind::Release {
                continue;
            }
            match eye.key(key) {
                Wish::Nothing => {}
                Wish::Quit => return Ok(()),
                Wish::Go(step) => {
                    subject.go(step)?;
                    sheet = subject.sheet();
                }
            }
        }
        let now = start.elapsed();
        if now >= due {
            if !eye.paused {
                sheet = subject.sheet();
            }
            screen.terminal.draw(|frame| eye.draw(frame, &sheet)).map_err(trouble)?;
            due = now + REFRESH;
        }
        subject.advance(TURN)?;
    }
    Ok(())
}
