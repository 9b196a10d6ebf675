//! `motionctl linmot …`: LinMot drives; `motionctl sim linmot`: a virtual one.

mod build;
pub(crate) mod cli;
mod connect;
mod curve;
mod params;
mod pvl;
pub(crate) mod sim;
mod table;
mod table_file;

use core::time::Duration;
use std::time::Instant;

use linmot::link::{Link, LinkExt};
use linmot::request::{Request, Value};
use linmot::upid::Layer;
use motion_io::linmot::LinkError;
use serde_json::json;

use crate::cli::Global;
use crate::exit::Exit;
use crate::output::{Output, counted};
use cli::{Drive, Linmot};
use connect::{AnyLink, connect};

/// Longest time that a restart is waited for.
const RESTART: Duration = Duration::from_secs(15);

pub(crate) fn run(out: &Output, global: &Global, command: &Linmot) -> Result<(), Exit> {
    match command {
        Linmot::Params { command } => params::run(out, global, command),
        Linmot::Curve { command } => curve::run(out, global, command),
        Linmot::Table { command } => table::run(out, global, command),
        Linmot::Errors { drive } => errors(out, global, drive),
        Linmot::Pvl { command } => pvl::run(out, global, command),
        Linmot::Restart { drive, wait } => restart(out, global, drive, *wait),
    }
}

fn errors(out: &Output, global: &Global, drive: &Drive) -> Result<(), Exit> {
    let mut link = connect(global, drive)?;
    let [_, logged, occurred] = link.ask(Request::ErrorCounts)?.words;
    let mut list = Vec::new();
    for entry in 0..logged {
        let error = link.logged_error(entry)?;
        let mut text = [0; 32];
        let len = link.error_text(error.code, &mut text)?;
        list.push((entry, error, String::from_utf8_lossy(text.get(..len).unwrap_or(&[])).into_owned()));
    }
    let json: Vec<_> = list
        .iter()
        .map(|(entry, error, text)| {
            json!({
                "entry": entry, "code": error.code, "hours": error.hours,
                "ms": error.milliseconds, "text": text,
            })
        })
        .collect();
    out.document(json!({ "logged": logged, "occurred": occurred, "errors": json }), || {
        println!("{} logged, {occurred} occurred", counted(logged.into(), "error", "errors"));
        for (entry, error, text) in &list {
            let seconds = f64::from(error.milliseconds) / 1000.0;
            println!("{entry:2}  {:04X}h  {} h {seconds:.3} s  {text}", error.code, error.hours);
        }
    });
    Ok(())
}

fn restart(out: &Output, global: &Global, drive: &Drive, wait: bool) -> Result<(), Exit> {
    if out.only_plans(|| "would restart the drive".into()) {
        return Ok(());
    }
    out.confirm_on_terminal(global.yes, "Restart the drive? Its motion stops.")?;
    let mut link = connect(global, drive)?;
    if wait {
        // It may be restarting already.
        answers(&mut link)?;
    }
    link.ask(Request::Restart)?;
    if wait {
        // The answer to a first question may still come from before the restart.
        std::thread::sleep(Duration::from_millis(100));
        answers(&mut link)?;
    }
    out.document(json!({ "restarted": true, "answers": wait }), || {
        println!("{}", if wait { "restarted, the drive answers" } else { "restarting" });
    });
    Ok(())
}

/// Waits until the drive answers.
fn answers(link: &mut AnyLink) -> Result<(), Exit> {
    let began = Instant::now();
    let [tree_id, ..] = Layer::Os.identity();
    let question = Request::Read { value: Value::Ram, upid: tree_id };
    loop {
        match link.call(&question) {
            Ok(_) => return Ok(()),
            Err(error @ (LinkError::Port(_) | LinkError::NotCarried(_))) => return Err(error.into()),
            Err(error) if began.elapsed() > RESTART => return Err(error.into()),
            Err(_) => {}
        }
    }
}

/// Runs `work` with the MC software stopped, and starts it again whatever happens.
fn stopped<T>(link: &mut AnyLink, work: impl FnOnce(&mut AnyLink) -> Result<T, Exit>) -> Result<T, Exit> {
    link.ask(Request::Stop)?;
    let done = work(link);
    let started = link.ask(Request::Start);
    match (done, started) {
        (Ok(done), started) => started.map(|_| done).map_err(Exit::from),
        (Err(exit), Ok(_)) => Err(exit),
        (Err(exit), Err(_)) => Err(exit.context("the MC software stays stopped")),
    }
}

/// Text of a drive or a file: 8-bit characters.
fn text(bytes: &[u8]) -> String {
    linmot::pvl::LineDecoder::new().decode(bytes).into_owned()
}
