//! The real program against a real pseudo-terminal.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Output, Stdio};

/// A directory of its own for one test.
pub(crate) struct Bench {
    pub(crate) directory: tempfile::TempDir,
}

impl Bench {
    pub(crate) fn new() -> Self {
        Self { directory: tempfile::tempdir().unwrap() }
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.directory.path().join(name)
    }

    /// The files in the directory, by name.
    #[allow(dead_code)] // not in every test program
    pub(crate) fn names(&self) -> Vec<std::ffi::OsString> {
        let entries = std::fs::read_dir(self.directory.path()).unwrap();
        let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name()).collect();
        names.sort();
        names
    }

    pub(crate) fn run(&self, arguments: &[&str]) -> Ran {
        Ran(self.command(arguments).output().unwrap())
    }

    /// The program with these arguments, without what the environment may say.
    pub(crate) fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_motionctl"));
        command.args(arguments).current_dir(self.directory.path()).stdin(Stdio::null());
        for name in ["MOTIONCTL_PORT", "MOTIONCTL_CAN", "MOTIONCTL_CONFIG"] {
            command.env_remove(name);
        }
        command
    }

    /// A virtual controller on LINE, ready to answer, with its flash in FLASH.
    #[allow(dead_code)] // not in every test program
    pub(crate) fn controller(&self, more: &[&str]) -> Controller {
        self.controller_on("pty:LINE", more)
    }

    /// The same on another endpoint.
    #[allow(dead_code)] // not in every test program
    pub(crate) fn controller_on(&self, endpoint: &str, more: &[&str]) -> Controller {
        let mut arguments = vec!["sim", "controller", "--serial", endpoint, "--state", "FLASH"];
        arguments.extend(more);
        self.device(&arguments)
    }

    /// A virtual device, ready to answer.
    pub(crate) fn device(&self, arguments: &[&str]) -> Controller {
        self.device_says(arguments).0
    }

    /// The same, and what it said when it was ready.
    pub(crate) fn device_says(&self, arguments: &[&str]) -> (Controller, String) {
        let mut child = Command::new(env!("CARGO_BIN_EXE_motionctl"))
            .args(arguments)
            .current_dir(self.directory.path())
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut said = BufReader::new(child.stdout.take().unwrap());
        let mut line = String::new();
        said.read_line(&mut line).unwrap();
        let device = Controller { child, _said: said };
        assert!(line.contains("listening on "), "{line:?}");
        (device, line)
    }
}

/// A running virtual controller; killed, as by a power failure, when dropped.
pub(crate) struct Controller {
    child: Child,
    _said: BufReader<ChildStdout>,
}

impl Controller {
    #[allow(dead_code)] // not in every test program
    pub(crate) fn kill(mut self) {
        self.end();
    }

    fn end(&mut self) {
        // SIGKILL: nothing is tidied up.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Drop for Controller {
    fn drop(&mut self) {
        self.end();
    }
}

/// What a command left.
pub(crate) struct Ran(pub Output);

impl Ran {
    pub(crate) fn stdout(&self) -> String {
        String::from_utf8_lossy(&self.0.stdout).into_owned()
    }

    pub(crate) fn stderr(&self) -> String {
        String::from_utf8_lossy(&self.0.stderr).into_owned()
    }

    #[allow(dead_code)] // not in every test program
    pub(crate) fn json(&self) -> serde_json::Value {
        let value: serde_json::Value = serde_json::from_slice(&self.0.stdout).unwrap();
        assert_eq!(value["schema_version"], 1);
        value
    }

    #[track_caller]
    pub(crate) fn ends(self, status: i32) -> Self {
        assert_eq!(self.0.status.code(), Some(status), "{}\n{}", self.stdout(), self.stderr());
        self
    }

    #[allow(dead_code)] // not in every test program
    #[track_caller]
    pub(crate) fn says(self, words: &str) -> Self {
        let all = self.stdout() + &self.stderr();
        assert!(all.contains(words), "{words:?} expected in:\n{all}");
        self
    }
}

/// Replaces a text in a file.
#[allow(dead_code)] // not in every test program
pub(crate) fn edit(path: &Path, from: &str, to: &str) {
    let text = std::fs::read_to_string(path).unwrap();
    assert!(text.contains(from), "{from:?} is not in {}", path.display());
    std::fs::write(path, text.replacen(from, to, 1)).unwrap();
}
