//! What goes to standard output and standard error.

use core::cell::RefCell;
use std::borrow::Cow;
use std::io::{BufWriter, ErrorKind, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Value, json};

use crate::cli::{Color, Global};
use crate::exit::Exit;

/// Version of the JSON documents.
pub(crate) const SCHEMA_VERSION: u32 = 1;

#[derive(Debug)]
pub(crate) struct Output {
    pub(crate) json: bool,
    quiet: bool,
    dry_run: bool,
    color: Color,
    /// Remarks go into the next document, or to standard error.
    remarks: RefCell<Vec<String>>,
}

impl Output {
    pub(crate) fn new(global: &Global) -> Self {
        let &Global { json, quiet, dry_run, color, .. } = global;
        Self { json, quiet, dry_run, color, remarks: RefCell::default() }
    }

    /// Whether there are to be colours, on what is a terminal or is not.
    pub(crate) fn colors(&self, terminal: bool) -> bool {
        match self.color {
            Color::Always => true,
            Color::Never => false,
            Color::Auto => terminal && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty()),
        }
    }

    /// The one document of a command: JSON, or what `text` prints.
    pub(crate) fn document(&self, document: Value, text: impl FnOnce()) {
        if !self.json {
            return text();
        }
        let mut whole = json!({ "schema_version": SCHEMA_VERSION });
        let remarks = self.remarks.take();
        if let (Some(whole), Value::Object(document)) = (whole.as_object_mut(), document) {
            whole.extend(document);
            if !remarks.is_empty() {
                whole.insert("remarks".into(), json!(remarks));
            }
        }
        put(format!("{whole}\n"));
    }

    /// A line of a stream: one JSON object, or what `text` says.
    pub(crate) fn line(&self, document: Value, text: impl FnOnce() -> String) {
        self.document(document, || println!("{}", text()));
    }

    /// A line about what happens, for people.
    pub(crate) fn say(&self, text: &str) {
        if !self.json && !self.quiet {
            println!("{text}");
        }
    }

    /// What a dry run would have done: its result.
    pub(crate) fn plan(&self, text: &str) {
        self.document(json!({ "dry_run": true, "plan": text }), || println!("{text}"));
    }

    /// In a dry run, tells what would have been done, which is then all that is done.
    pub(crate) fn only_plans(&self, plan: impl FnOnce() -> String) -> bool {
        if self.dry_run {
            self.plan(&plan());
        }
        self.dry_run
    }

    /// Something worth knowing that is no result.
    pub(crate) fn remark(&self, text: impl Into<String>) {
        let text = text.into();
        if self.json {
            self.remarks.borrow_mut().push(text);
        } else {
            eprintln!("note: {text}");
        }
    }

    pub(crate) fn failed(&self, exit: &Exit) {
        let (red, plain) =
            if self.colors(std::io::stderr().is_terminal()) { ("\x1b[31m", "\x1b[0m") } else { ("", "") };
        complain(&format!("{red}error:{plain} {}\n", harmless(&exit.message)));
    }

    /// A progress bar on standard error, where that is a terminal.
    pub(crate) fn progress(&self, what: &'static str, len: usize) -> ProgressBar {
        if self.quiet || self.json || !std::io::stderr().is_terminal() {
            return ProgressBar::hidden();
        }
        let bar = ProgressBar::new(len as u64).with_message(what);
        if let Ok(style) = ProgressStyle::with_template("{msg:12} [{bar:40}] {pos}/{len}  {eta}") {
            bar.set_style(style);
        }
        bar
    }

    /// Asks on a terminal; without one, nothing is asked.
    pub(crate) fn confirm_on_terminal(&self, yes: bool, question: &str) -> Result<(), Exit> {
        self.confirm(yes || !std::io::stdin().is_terminal(), question)
    }

    /// Asks on a terminal; without one, `--yes` must have been given.
    pub(crate) fn confirm(&self, yes: bool, question: &str) -> Result<(), Exit> {
        if yes {
            return Ok(());
        }
        if !std::io::stdin().is_terminal() {
            return Err(Exit::usage(format!("{question} Without a terminal to ask on, --yes must say so")));
        }
        complain(&harmless(&format!("{question} [y/N] ")));
        let mut answer = String::new();
        std::io::stdin().read_line(&mut answer).map_err(|error| Exit::file("standard input", &error))?;
        match answer.trim() {
            "y" | "Y" | "yes" => Ok(()),
            _ => Err(Exit::check("not done")),
        }
    }
}

/// Why standard output took no more, other than that nobody reads it.
static LOST: OnceLock<String> = OnceLock::new();

/// Writes to standard output. That nobody reads to the end, as with `| head`, is no trouble: a command that
/// runs until it is stopped stops as if told to, any other one goes on to its end, so that nothing is left
/// half done.
pub(crate) fn put(bytes: impl AsRef<[u8]>) {
    let mut stdout = std::io::stdout().lock();
    if let Err(error) = stdout.write_all(bytes.as_ref()).and_then(|()| stdout.flush()) {
        if error.kind() != ErrorKind::BrokenPipe {
            LOST.get_or_init(|| error.to_string());
        }
        crate::can::stop();
    }
}

/// Trouble with standard output that [`put`] has met.
pub(crate) fn lost() -> Result<(), Exit> {
    LOST.get().map_or(Ok(()), |error| Err(Exit::file("standard output", error)))
}

/// The same of text for people, made [`harmless`].
pub(crate) fn put_text(text: &str) {
    put(harmless(text).as_bytes());
}

/// Writes to standard error, if anybody listens.
pub(crate) fn complain(text: &str) {
    let _ = std::io::stderr().write_all(text.as_bytes());
}

/// Text without control characters, which would steer a terminal: names come from files and devices. They are
/// written as in Rust, `\u{1b}`; line ends and tabs remain.
pub(crate) fn harmless(text: &str) -> Cow<'_, str> {
    let harms = |letter: char| letter.is_control() && !matches!(letter, '\n' | '\t');
    if !text.contains(harms) {
        return text.into();
    }
    let mut harmless = String::with_capacity(text.len());
    for letter in text.chars() {
        match harms(letter) {
            true => harmless.extend(letter.escape_default()),
            false => harmless.push(letter),
        }
    }
    harmless.into()
}

/// Makes text for people [`harmless`] on its way; each piece is written whole.
#[derive(Debug)]
pub(crate) struct Harmless<W>(pub(crate) W);

impl<W: Write> Write for Harmless<W> {
    fn write(&mut self, text: &[u8]) -> std::io::Result<usize> {
        self.0.write_all(harmless(&String::from_utf8_lossy(text)).as_bytes())?;
        Ok(text.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.0.flush()
    }
}

/// Writes a file beside its place and moves it there when it is complete, so that an older one is never half
/// overwritten and nothing incomplete bears its name. What is no file, such as a pipe, is written to.
pub(crate) fn write_file<T>(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> Result<T, Exit>,
) -> Result<T, Exit> {
    let name = path.display().to_string();
    let trouble = |error: &dyn core::fmt::Display| Exit::file(&name, error);
    if std::fs::metadata(path).is_ok_and(|found| !found.is_file()) {
        let file = std::fs::OpenOptions::new().write(true).open(path).map_err(|error| trouble(&error))?;
        let mut file = BufWriter::new(file);
        let done = write(&mut file)?;
        file.flush().map_err(|error| trouble(&error))?;
        return Ok(done);
    }
    let (path, mut file) = beside(path).map_err(|error| trouble(&error))?;
    let mut writer = BufWriter::new(file.as_file_mut());
    let done = write(&mut writer)?;
    writer.flush().map_err(|error| trouble(&error))?;
    drop(writer);
    #[cfg(unix)]
    {
        use std::os::unix::fs::{MetadataExt, PermissionsExt, fchown};
        // An older one goes on to belong to whom it belonged, and is read by whom it was.
        let before = std::fs::metadata(&path).ok();
        if let Some(before) = &before {
            let _ = fchown(file.as_file(), Some(before.uid()), Some(before.gid()));
        }
        let mode = before.map_or(0o644, |before| before.mode());
        let _ = file.as_file().set_permissions(std::fs::Permissions::from_mode(mode));
    }
    file.as_file().sync_all().map_err(|error| trouble(&error))?;
    file.persist(&path).map_err(|error| trouble(&error))?;
    Ok(done)
}

/// The same of bytes.
pub(crate) fn write_beside(path: &Path, bytes: &[u8]) -> Result<(), Exit> {
    let trouble = |error| Exit::file(&path.display().to_string(), &error);
    write_file(path, |file| file.write_all(bytes).map_err(trouble))
}

/// A new file beside the place of another, which is given with links followed. Trouble is told without the
/// name of the new file.
fn beside(path: &Path) -> std::io::Result<(PathBuf, tempfile::NamedTempFile)> {
    // A link goes on leading to the file.
    let path = path.canonicalize().unwrap_or_else(|_| path.into());
    let directory = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    std::fs::metadata(directory)?;
    let file = tempfile::NamedTempFile::new_in(directory).map_err(|error| error.kind())?;
    Ok((path, file))
}

/// Whether a file can be written in the end, asked before the work that it is to report.
pub(crate) fn writable(path: &Path) -> Result<(), Exit> {
    let tried = match std::fs::metadata(path) {
        Ok(found) if found.is_dir() => Err(ErrorKind::IsADirectory.into()),
        Ok(found) if !found.is_file() => Ok(()),
        _ => beside(path).map(drop),
    };
    tried.map_err(|error| Exit::file(&path.display().to_string(), &error))
}

/// Refuses two files of one command that are one: what is written would destroy what is read, or the other one.
pub(crate) fn apart(one: (&str, &Path), other: (&str, &Path)) -> Result<(), Exit> {
    let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.into());
    // Devices and pipes, such as /dev/null, take any number of writers.
    let special = std::fs::metadata(one.1).is_ok_and(|found| !found.is_file());
    if special || real(one.1) != real(other.1) {
        return Ok(());
    }
    let (name, (what, with)) = (one.1.display(), (one.0, other.0));
    Err(Exit::usage(format!("{name}: {what} and {with} are the same file")))
}

/// `1 curve`, `2 curves`.
pub(crate) fn counted(count: usize, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}
