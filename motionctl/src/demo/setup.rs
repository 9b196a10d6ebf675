//! The parameter part of the example: a virtual controller behind a real pseudo-terminal is configured
//! over LB2, and keeps what it was told.

use core::sync::atomic::{AtomicBool, Ordering};
use std::path::{Path, PathBuf};
use std::thread::JoinHandle;

use lb2::telegram::BANK_LEN;
use motion_core::parameters::{Values, get};
use motion_core::{Controller, Model, STORAGE_LEN};
use motion_io::endpoint::{Endpoint, Settings};
use motion_io::lb2::{Client, TIMES, serve};
use motion_io::port::{Role, open};
use serde_json::{Value, json};
use std::sync::Arc;

use crate::exit::Exit;
use crate::output::Output;

/// The settings of 6.11, in an order that the loader accepts as a whole: inputs 2…6 inactive, two axes
/// activated, axis 2 without control, input and output 1 on the CAN bus; then "at least" V max. for
/// 3000 rpm, t max. acceleration 0.5 s and the jog velocities; and the control parameters that the
/// manual leaves to the user: KSP 20/s, a tolerance of 100 units, following errors of half a turn.
const SETTINGS: [(u16, i32); 20] = [
    (108, 0),
    (109, 0),
    (110, 0),
    (111, 0),
    (112, 0),
    (0, 2),
    (601, 0),
    (100, 2),
    (450, 2),
    (642, 3_276_800),
    (654, 500),
    (756, 65_536),
    (762, 655_360),
    (768, 65_536),
    (774, 655_360),
    (648, 200),
    (708, 100),
    (714, 100),
    (696, 32_768),
    (702, 32_768),
];

/// What came of it.
pub(super) struct Configured {
    /// The controller's non-volatile memory.
    pub(super) storage: Vec<u8>,
    pub(super) model: u16,
    pub(super) document: Value,
}

/// A virtual controller that runs behind a pseudo-terminal.
struct Running {
    stop: Arc<AtomicBool>,
    thread: JoinHandle<std::io::Result<Vec<u8>>>,
}

impl Running {
    fn power_on(storage: Vec<u8>, link: &Path) -> Result<Self, Exit> {
        let endpoint = Endpoint::Pty { link: link.to_path_buf() };
        let mut port = open(&endpoint, Role::Device).map_err(|error| Exit::trouble(error.to_string()))?;
        let stop = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            let mut controller = Controller::power_on(Model::Gel8230, storage, vec![0; BANK_LEN]);
            let retain = |controller: &mut Controller<_, _>, elapsed| {
                // Memory does not fail.
                let _ = controller.advance(elapsed);
            };
            serve(port.as_mut(), &mut controller, &flag, retain)?;
            Ok(controller.power_off())
        });
        Ok(Self { stop, thread })
    }

    /// Takes the power away: what is left is the non-volatile memory.
    fn power_off(self) -> Result<Vec<u8>, Exit> {
        self.stop.store(true, Ordering::Relaxed);
        match self.thread.join() {
            Ok(Ok(storage)) => Ok(storage),
            Ok(Err(error)) => Err(Exit::file("virtual controller", &error)),
            Err(_) => Err(Exit::trouble("the virtual controller stopped unexpectedly")),
        }
    }
}

fn client(link: &Path) -> Result<Client, Exit> {
    let endpoint = Endpoint::Serial { path: link.display().to_string(), settings: Settings::default() };
    let port = open(&endpoint, Role::Master).map_err(|error| Exit::trouble(error.to_string()))?;
    Ok(Client::new(port, TIMES, 2))
}

pub(super) fn configure(out: &Output) -> Result<Configured, Exit> {
    let directory = tempfile::tempdir().map_err(|error| Exit::file("temporary directory", &error))?;
    let link: PathBuf = directory.path().join("com2");
    let running = Running::power_on(vec![0xFF; STORAGE_LEN], &link)?;
    out.say(&format!("A virtual GEL 8230 is on, LB2 at {} (19200 baud, 8E1).", link.display()));

    let mut controller = client(&link)?;
    let (model, axes) = controller.device_type()?;
    let version = controller.os_version()?;
    out.say(&format!("identify: GEL {model}, {axes} axes, operating system {version}"));

    for (index, value) in SETTINGS {
        set(out, &mut controller, index, value)?;
    }
    if let Some(index) = controller.call_loader()? {
        return Err(Exit::refused(format!("the loader refused parameter [{index:03}]")));
    }
    out.say("loader: no warning, no error");
    controller.save_parameters()?;
    out.say("saved to flash");

    drop(controller);
    let storage = running.power_off()?;
    out.say("power off … power on");
    let running = Running::power_on(storage, &link)?;
    let mut controller = client(&link)?;
    let mut list = Vec::new();
    let mut wrong = 0;
    for (index, value) in SETTINGS {
        let found = controller.read_parameter(index)?;
        let Some(entry) = get(index) else { continue };
        let verified = found == value;
        wrong += usize::from(!verified);
        let text = entry.format(found, &Values::factory()).to_string();
        let verdict = if verified { "verified" } else { "WRONG" };
        out.say(&format!("{verdict}: {entry} = {text} {}", entry.unit()));
        list.push(json!({
            "index": index, "name": entry.name(), "group": entry.group(), "value": found, "text": text,
            "verified": verified,
        }));
    }
    let storage = running.power_off()?;
    if wrong > 0 {
        return Err(Exit::check(format!("{wrong} values were lost")));
    }
    out.say(&format!("{0} of {0} values survived the power cycle", SETTINGS.len()));
    let document = json!({
        "model": model, "axes": axes, "os_version": version.to_string(), "verified": true, "parameters": list,
    });
    Ok(Configured { storage, model, document })
}

/// Writes one parameter, telling what it was.
fn set(out: &Output, controller: &mut Client, index: u16, value: i32) -> Result<(), Exit> {
    let entry = get(index).ok_or_else(|| Exit::check(format!("there is no parameter [{index:03}]")))?;
    let old = controller.read_parameter(index)?;
    let (code, text) = controller.write_parameter(index, value)?;
    if code.is_error() {
        return Err(Exit::refused(format!("{entry}: {text}")));
    }
    let values = Values::factory();
    let (old, new) = (entry.format(old, &values), entry.format(value, &values));
    let remark = if code.is_warning() { format!("  ({text})") } else { String::new() };
    out.say(&format!("set: {entry}: {old} -> {new} {}{remark}", entry.unit()));
    Ok(())
}
