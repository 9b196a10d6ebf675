//! Reading EDS and DCF files against python-canopen, in the same run, on the recorded files that both
//! read; from the disk to the objects. Each counts the processor's time of its own.
//!
//! `cargo bench -p benches --bench device_files` ends with status 1 when the ratio is below its bar;
//! `-- --smoke` reads one file once and judges nothing. Needs `../shared/recorded`, and a Python with
//! canopen: that of `.ci/run eds`, or `python3`.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, ExitCode, Stdio};

use benches::{median, thread_time};
use canopen_master::eds;

/// Of the recorded files, every so many-th.
const EVERY: usize = 4;
const ROUNDS: usize = 7;
const BAR: f64 = 30.0;

/// Tells which of the files named on the command line it reads, then reads these whenever asked.
const PEER: &str = "
import logging, sys, time
import canopen
logging.disable(logging.CRITICAL)
files = []
for path in sys.argv[1:]:
    try:
        canopen.import_od(path, 5)
        files.append(path)
    except Exception:
        pass
print('\\t'.join(files), flush=True)
for _ in sys.stdin:
    start = time.process_time()
    count = sum(len(canopen.import_od(path, 5)) for path in files)
    print(count, time.process_time() - start, flush=True)
";

struct Peer {
    child: Child,
    ask: ChildStdin,
    answer: BufReader<ChildStdout>,
}

impl Peer {
    /// The peer, and the files that it reads; `None` without a Python that has canopen.
    fn start(files: &[PathBuf]) -> Option<(Self, Vec<PathBuf>)> {
        let venv = Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/interop-venv/bin/python");
        let python = if venv.exists() { venv } else { "python3".into() };
        let mut child = Command::new(python)
            .args(["-c", PEER])
            .args(files)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .ok()?;
        let (ask, answer) = (child.stdin.take()?, BufReader::new(child.stdout.take()?));
        let mut peer = Self { child, ask, answer };
        let read = peer.line();
        let read: Vec<PathBuf> =
            read.split('\t').filter(|path| !path.is_empty()).map(PathBuf::from).collect();
        (!read.is_empty()).then_some((peer, read))
    }

    fn line(&mut self) -> String {
        let mut line = String::new();
        self.answer.read_line(&mut line).expect("the peer answers");
        line.trim_end().to_owned()
    }

    /// Reads all files once: how many objects there are, and the seconds that it took.
    fn read(&mut self) -> (usize, f64) {
        self.ask.write_all(b"\n").expect("the peer listens");
        let line = self.line();
        let (count, seconds) = line.split_once(' ').expect("two numbers");
        (count.parse().expect("a count"), seconds.parse().expect("seconds"))
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn read(files: &[PathBuf]) -> usize {
    let one = |path| eds::read(&std::fs::read(path).expect("a file")).expect("a device description");
    files.iter().map(|path| one(path).device.objects.len()).sum()
}

fn main() -> ExitCode {
    let smoke = std::env::args().any(|argument| argument == "--smoke");
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/recorded/eds");
    let Ok(entries) = std::fs::read_dir(folder) else {
        println!("device files: ignored: needs ../shared/recorded");
        return ExitCode::SUCCESS;
    };
    let mut files: Vec<PathBuf> = entries
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "eds" || extension == "dcf"))
        .collect();
    files.sort();
    files = files.into_iter().step_by(EVERY).collect();
    if smoke {
        files.truncate(1);
    }
    let Some((mut peer, files)) = Peer::start(&files) else {
        println!(
            "device files: {} objects; python-canopen ignored: needs a Python with canopen",
            read(&files)
        );
        return ExitCode::SUCCESS;
    };
    let bytes: u64 = files.iter().filter_map(|path| Some(path.metadata().ok()?.len())).sum();
    // It counts the data types of [DummyUsage] too.
    let there = peer.read().0;
    println!(
        "device files: {} files, {bytes} bytes, {} objects here, {there} there",
        files.len(),
        read(&files)
    );
    let rounds = if smoke { 1 } else { ROUNDS };
    let times = (0..rounds).map(|_| {
        let start = thread_time();
        assert!(read(&files) > 0);
        ((thread_time() - start).as_secs_f64(), peer.read().1)
    });
    let (ours, theirs): (Vec<f64>, Vec<f64>) = times.unzip();
    let ratio = median(theirs.iter().zip(&ours).map(|(theirs, ours)| theirs / ours));
    for (name, times) in [("this", ours), ("python-canopen", theirs)] {
        let time = median(times.into_iter());
        println!("  {name:15} {:10.3} ms, {:8.2} MB/s", time * 1e3, bytes as f64 / time / 1e6);
    }
    println!("  {ratio:.0} x as fast as python-canopen (at least {BAR} expected)");
    if smoke || ratio >= BAR { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
