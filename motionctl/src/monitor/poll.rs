//! Asks a controller for what its monitor shows, over and over, in a thread of its own: a device that does not
//! answer holds up neither the screen nor the keys.

use core::time::Duration;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::Instant;

use motion_core::parameters::Entry;
use motion_io::lb2::{CallError, Client, Remark};
use serde_json::Value;

use super::Subject;
use super::cli::Monitor;
use super::controller::{Controller, Heard, Place, asked};
use super::sheet::Sheet;
use crate::can::value::{named_type, number};
use crate::cli::{Global, Line};
use crate::connect::{connect, endpoint};
use crate::exit::Exit;
use crate::lb2::Identity;
use crate::output::Output;
use crate::params::entry;

/// Failures and RAM are asked for again after so many parameters.
const STRIDE: usize = 8;
/// After silence, the device is given so long before it is asked again.
const RESPITE: Duration = Duration::from_millis(500);
/// Most bytes of RAM in one answer.
const MOST: usize = lb2::telegram::MAX_BANK_DATA;

/// Of an answer, or of the end.
type Answer = Result<Heard, Exit>;

/// A controller that is asked.
pub(super) struct Asking {
    answers: Receiver<Answer>,
    start: Instant,
    controller: Controller,
}

impl Asking {
    /// With `patient`, silence and refusals are shown; without, they are the end.
    pub(super) fn open(
        out: &Output,
        global: &Global,
        line: &Line,
        args: &Monitor,
        patient: bool,
    ) -> Result<Self, Exit> {
        let watched = args.param.iter().map(|key| entry(key)).collect::<Result<Vec<Entry>, _>>()?;
        let places = args.ram.iter().map(|text| place(text)).collect::<Result<Vec<_>, _>>()?;
        let title = endpoint(global, line)?.to_string();
        let client = connect(out, global, line)?;
        let (sender, answers) = sync_channel(64);
        let mut parameters: Vec<u16> = watched.iter().map(Entry::index).chain(asked()).collect();
        let mut seen = std::collections::BTreeSet::new();
        parameters.retain(|index| seen.insert(*index));
        let mut asker = Asker { client, sender, patient, parameters, places: places.clone() };
        std::thread::spawn(move || while asker.round().is_some() {});
        Ok(Self { answers, start: Instant::now(), controller: Controller::new(title, watched, places) })
    }
}

/// `OFFSET:TYPE[:NAME]`.
fn place(text: &str) -> Result<Place, Exit> {
    let wrong = |what: &str| Exit::usage(format!("--ram {text}: {what}"));
    let mut parts = text.splitn(3, ':');
    let (Some(offset), Some(kind)) = (parts.next(), parts.next()) else {
        return Err(wrong("OFFSET:TYPE[:NAME] expected, such as 0x10:i32:position"));
    };
    let offset = number(offset).and_then(|offset| u16::try_from(offset).ok());
    let offset =
        offset.ok_or_else(|| wrong("an offset of 0 to 65535 expected, or hex as 0x1000 or 1000h"))?;
    let data_type = named_type(kind).map_err(|error| error.context(&format!("--ram {text}")))?;
    let Some(len) = data_type.size().map(usize::from) else {
        return Err(wrong("a type of a certain length expected: bool, u8 to u64, i8 to i64, f32, f64"));
    };
    if usize::from(offset) + len > lb2::telegram::BANK_LEN {
        return Err(wrong("it passes the bank's end at 65536"));
    }
    let name = parts.next().filter(|name| !name.is_empty()).unwrap_or(text).to_owned();
    Ok(Place { offset, len, data_type, name })
}

/// The one that asks.
struct Asker {
    client: Client,
    sender: SyncSender<Answer>,
    patient: bool,
    parameters: Vec<u16>,
    places: Vec<Place>,
}

impl Asker {
    /// Asks for everything once; `None` when nobody wants to know any more, or the line is gone.
    fn round(&mut self) -> Option<()> {
        self.ask("identity", |client| Identity::read(client).map(Heard::Identity))?;
        self.often()?;
        for at in 0..self.parameters.len() {
            if at > 0 && at % STRIDE == 0 {
                self.often()?;
            }
            if let Some(&index) = self.parameters.get(at) {
                self.ask(&format!("parameter [{index:03}]"), |client| {
                    client.read_parameter(index).map(|value| Heard::Parameter(index, value))
                })?;
            }
        }
        self.send(Ok(Heard::Round))
    }

    /// What changes quickly.
    fn often(&mut self) -> Option<()> {
        self.ask("failures", |client| client.failures().map(Heard::Failures))?;
        for at in 0..self.places.len() {
            let (offset, len) = self.places.get(at).map(|place| (place.offset, place.len.min(MOST)))?;
            self.ask(&format!("RAM at {offset}"), |client| {
                let mut bytes = vec![0; len];
                client.read_bank(false, lb2::telegram::bank::RAM, offset, &mut bytes)?;
                Ok(Heard::Ram(at, bytes))
            })?;
        }
        Some(())
    }

    fn ask(&mut self, what: &str, call: impl FnOnce(&mut Client) -> Result<Heard, CallError>) -> Option<()> {
        let called = call(&mut self.client);
        for remark in self.client.take_remarks() {
            let words = match remark {
                Remark::SecondAnswer => "two devices answered",
                _ => "an answer came after its time",
            };
            self.send(Ok(Heard::Remark(words.into())))?;
        }
        match called {
            Ok(heard) => self.send(Ok(heard)),
            Err(CallError::NoAnswer { .. }) if self.patient => {
                self.send(Ok(Heard::Silence(format!("no answer, asked for: {what}"))))?;
                std::thread::sleep(RESPITE);
                Some(())
            }
            Err(error @ (CallError::Refused { .. } | CallError::WrongEcho(_))) if self.patient => {
                self.send(Ok(Heard::Refused(format!("{what}: {error}"))))
            }
            Err(error) => {
                let _ = self.send(Err(Exit::from(error).context(what)));
                None
            }
        }
    }

    fn send(&self, answer: Answer) -> Option<()> {
        self.sender.send(answer).ok()
    }
}

impl Subject for Asking {
    fn advance(&mut self, wait: Duration) -> Result<(), Exit> {
        let end = Instant::now() + wait;
        loop {
            match self.answers.recv_timeout(end.saturating_duration_since(Instant::now())) {
                Ok(answer) => {
                    self.controller.set_now(self.start.elapsed());
                    self.controller.hear(answer?);
                }
                Err(RecvTimeoutError::Timeout) => break,
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(Exit::trouble("the thread that asks has ended"));
                }
            }
        }
        self.controller.set_now(self.start.elapsed());
        Ok(())
    }

    fn enough(&self, _: Duration) -> bool {
        self.controller.rounds() > 0
    }

    fn sheet(&self) -> Sheet {
        self.controller.sheet()
    }

    fn document(&self) -> Value {
        self.controller.document()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_in_ram() {
        let read = place("0x10:i32:position").unwrap();
        assert_eq!((read.offset, read.len, read.name.as_str()), (16, 4, "position"));
        assert_eq!(place("65535:u8").unwrap().name, "65535:u8");
        for wrong in ["", "5", "x:u8", "65536:u8", "65535:u16", "0:word", "0:string", "-1:u8"] {
            assert_eq!(place(wrong).unwrap_err().status, 2, "{wrong}");
        }
    }
}
