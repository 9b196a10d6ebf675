//! `motionctl sim linmot`: a virtual drive on an endpoint.

use core::sync::atomic::Ordering;
use core::time::Duration;
use std::fs::File;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use device_sim::linmot::{CanDrive, Times, VirtualDrive, generated};
use linmot::drive::{Drive as _, LoggedError};
use linmot::linrs::{Checksum, Slave};
use linmot::upid::Usage;
use motion_io::can::Driver;
use motion_io::endpoint::{CanEndpoint, Endpoint, EndpointError};
use motion_io::linmot::serve_linrs;
use motion_io::port::{Role, open};
use serde_json::json;

use super::cli::SimLinmot;
use super::connect::checksum;
use crate::can::stop_flag;
use crate::cli::Global;
use crate::connect::{ChoiceOf, choose};
use crate::exit::Exit;
use crate::output::Output;

/// The drive looks for the signal that stops it so often.
const TURN: Duration = Duration::from_millis(50);

pub(crate) fn run(out: &Output, global: &Global, arguments: &SimLinmot) -> Result<(), Exit> {
    if arguments.can.is_none() && arguments.serial.is_none() {
        return Err(Exit::usage("where the drive shall be: --can EP or --serial EP expected"));
    }
    let tree = generated(arguments.parameters);
    let writable = tree.iter().filter(|parameter| parameter.usage.contains(Usage::ROM_WRITE)).count();
    if writable < arguments.parameters {
        return Err(Exit::usage(format!("--parameters {}: up to {writable} expected", arguments.parameters)));
    }
    let node = if arguments.can.is_some() { crate::can::sim::address(arguments.node)? } else { None };
    let places = || [&arguments.can, &arguments.serial].into_iter().flatten().cloned().collect::<Vec<_>>();
    if out.only_plans(|| format!("would be a LinMot drive {} on {}", arguments.node, places().join(", "))) {
        return Ok(());
    }
    let mut drive = VirtualDrive::new(tree, Times::default());
    // What a drive without motor data has logged by the time it is first used.
    drive.log_error(LoggedError { code: 0x01, hours: 0, milliseconds: 120 });
    drive.log_error(LoggedError { code: 0x64, hours: 920, milliseconds: 10_433 });
    let mut state = arguments.state.as_deref().map(State::new);
    if let Some(state) = &mut state {
        state.load(&mut drive).map_err(|error| Exit::file(&state.path.display().to_string(), &error))?;
    }
    let stop = stop_flag()?;
    let ready = |endpoint: &str| {
        let node = arguments.node;
        out.document(json!({ "event": "ready", "node": node, "endpoint": endpoint }), || {
            out.say(&format!("LinMot drive {node} listening on {endpoint}"));
        });
    };
    let mut keep = |drive: &VirtualDrive| state.as_mut().map_or(Ok(()), |state| state.keep(drive));
    let usage = |error: EndpointError| Exit::usage(error.to_string());
    if let Some(can) = &arguments.can {
        let can = &choose(global, Some(can), ChoiceOf::Can)?;
        let endpoint: CanEndpoint = can.parse().map_err(usage)?;
        let port = motion_io::can::open(&endpoint).map_err(|error| Exit::trouble(error.to_string()))?;
        let (mut driver, mut node) = (Driver::new(port), CanDrive::new(drive, node, arguments.serial_number));
        ready(can);
        while !stop.load(Ordering::Relaxed) {
            let limit = driver.now().saturating_add(TURN);
            driver.turn(&mut node, limit, |_, _, _| ()).map_err(|error| Exit::file(can, &error))?;
            keep(node.drive()).map_err(|error| Exit::file("the state file", &error))?;
        }
        return Ok(());
    }
    let serial = &choose(global, arguments.serial.as_deref(), ChoiceOf::Port)?;
    let endpoint: Endpoint = serial.parse().map_err(usage)?;
    let mut port = open(&endpoint, Role::Device).map_err(|error| Exit::trouble(error.to_string()))?;
    if let Some(sum) = arguments.checksum.map(checksum) {
        drive.set_rom(Checksum::UPID, sum.raw());
        drive.set_ram(Checksum::UPID, sum.raw());
    }
    let mut slave = Slave::new(arguments.node, Slave::checksum(&drive).unwrap_or_default());
    ready(serial);
    serve_linrs(port.as_mut(), &mut slave, &mut drive, &stop, |drive, _| keep(drive))
        .map_err(|error| Exit::file(serial, &error))
}

/// Non-volatile memory in a file, which no other program may use meanwhile.
struct State {
    path: PathBuf,
    /// Holds the lock. The file itself is replaced with each write, so the lock moves on to the new one.
    file: Option<File>,
    /// Writes of the drive that the file holds.
    kept: u64,
}

impl State {
    fn new(path: &Path) -> Self {
        Self { path: path.into(), file: None, kept: 0 }
    }

    fn load(&mut self, drive: &mut VirtualDrive) -> io::Result<()> {
        let mut file = match File::open(&self.path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return self.write(drive),
            opened => opened?,
        };
        lock(&file)?;
        let mut image = Vec::new();
        file.read_to_end(&mut image)?;
        self.file = Some(file);
        drive.load_image(&image).map_err(io::Error::other)
    }

    fn keep(&mut self, drive: &VirtualDrive) -> io::Result<()> {
        if self.kept != drive.writes() {
            self.kept = drive.writes();
            self.write(drive)?;
        }
        Ok(())
    }

    /// The old file stays until the new one is complete.
    fn write(&mut self, drive: &VirtualDrive) -> io::Result<()> {
        let directory = self.path.parent().filter(|parent| !parent.as_os_str().is_empty());
        let mut file = tempfile::NamedTempFile::new_in(directory.unwrap_or(Path::new(".")))?;
        file.write_all(&drive.image())?;
        lock(file.as_file())?;
        self.file = Some(file.persist(&self.path)?);
        Ok(())
    }
}

fn lock(file: &File) -> io::Result<()> {
    file.try_lock().map_err(|_| io::Error::other("in use by another program"))
}
