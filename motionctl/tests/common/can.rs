//! The real program on a virtual bus.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Output, Stdio};

use serde_json::Value;

/// A process that runs until it is dropped.
pub(crate) struct Running {
    pub(crate) child: Child,
    /// Open as long as the process runs, so that what it says has somewhere to go.
    _said: BufReader<ChildStdout>,
}

impl Running {
    /// Starts the program and waits for its first line.
    pub(crate) fn start(arguments: &[&str], directory: &Path) -> (Self, Value) {
        let mut child = Command::new(env!("CARGO_BIN_EXE_motionctl"))
            .args(arguments)
            .arg("--json")
            .current_dir(directory)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut said = BufReader::new(child.stdout.take().unwrap());
        let mut line = String::new();
        said.read_line(&mut line).unwrap();
        let ready = serde_json::from_str(&line).unwrap_or_else(|error| panic!("{line:?}: {error}"));
        (Self { child, _said: said }, ready)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

pub(crate) struct Bench {
    pub(crate) directory: tempfile::TempDir,
    pub(crate) endpoint: String,
    running: Vec<Running>,
}

impl Bench {
    pub(crate) fn new() -> Self {
        let directory = tempfile::tempdir().unwrap();
        let (bus, ready) =
            Running::start(&["bus", "--listen", "127.0.0.1:0", "--bitrate", "1000000"], directory.path());
        let endpoint = format!("socketcand:{}/can0", ready["listen"].as_str().unwrap());
        Self { directory, endpoint, running: vec![bus] }
    }

    pub(crate) fn sim(&mut self, arguments: &[&str]) {
        let arguments: Vec<&str> = ["sim"].iter().chain(arguments).copied().collect();
        let arguments = [&arguments[..], &["--can", &self.endpoint]].concat();
        let (node, ready) = Running::start(&arguments, self.directory.path());
        assert_eq!(ready["event"], "ready");
        self.running.push(node);
        // It is there when it answers.
        self.can(&["scan", "--nodes", "1"], 0);
    }

    /// Starts a command.
    #[allow(dead_code)] // not in every test program
    pub(crate) fn spawn(&self, arguments: &[&str]) -> Child {
        let mut command = Command::new(env!("CARGO_BIN_EXE_motionctl"));
        command.args(arguments).env("MOTIONCTL_CAN", &self.endpoint).current_dir(self.directory.path());
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
    }

    pub(crate) fn run(&self, arguments: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_motionctl"))
            .args(["--json", "can"])
            .args(arguments)
            .env("MOTIONCTL_CAN", &self.endpoint)
            .current_dir(self.directory.path())
            .env_remove("MOTIONCTL_CONFIG")
            .stdin(Stdio::null())
            .output()
            .unwrap()
    }

    #[track_caller]
    pub(crate) fn can(&self, arguments: &[&str], status: i32) -> Value {
        let output = self.run(arguments);
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(status), "{arguments:?}: {text}\n{error}");
        text.lines().last().map_or(Value::Null, |line| serde_json::from_str(line).unwrap())
    }
}
