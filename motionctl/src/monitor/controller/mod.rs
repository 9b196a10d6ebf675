//! What is known of a controller by asking it over LB2.
//!
//! LB2 has no function for positions, inputs or the PLC's state (manual A, Appendix 1): what there is are
//! identity, failures and parameters, and what the PLC program keeps in RAM bank 12.

mod show;

use core::time::Duration;
use std::collections::{BTreeMap, BTreeSet};

use canopen_master::data_type::DataType;
use lb2::code::StoredFailure;
use motion_core::parameters::{Entry, Values, get};

use super::lines::Lines;
use crate::lb2::Identity;

/// An answer, or that there was none.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Heard {
    Identity(Identity),
    Failures(Vec<StoredFailure>),
    Parameter(u16, i32),
    /// Bytes of the watched place of this number.
    Ram(usize, Vec<u8>),
    /// It answered that it will not.
    Refused(String),
    Silence(String),
    Remark(String),
    /// Everything has been asked for once more.
    Round,
}

/// A place in RAM bank 12 that is watched.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Place {
    pub(super) offset: u16,
    pub(super) len: usize,
    pub(super) data_type: DataType,
    pub(super) name: String,
}

/// First numbers of the parameters of every axis, input or output, and how many of them there are.
const ASKED: [(u16, u16); 19] = [
    (0, 1),   // activated axes
    (3, 3),   // PLC active, what a PLC stop does, device number
    (26, 6),  // decimal points of the axes
    (100, 6), // actual value inputs: type
    (107, 6), // state
    (254, 6), // object
    (300, 4), // CAN: type, CAN Link
    (310, 8), // CAN 1, objects: node address
    (326, 8), // type
    (334, 8), // master bypass
    (342, 8), // CAN 2
    (358, 8),
    (366, 8),
    (450, 6),  // nominal value outputs: type
    (486, 6),  // object
    (600, 6),  // axes: controlling mode
    (606, 12), // actual value input, nominal value output
    (642, 6),  // V max.
    (684, 6),  // V Work
];

/// Numbers of all parameters that the tables need.
pub(super) fn asked() -> impl Iterator<Item = u16> {
    ASKED.into_iter().flat_map(|(first, count)| first..first + count).filter(|index| get(*index).is_some())
}

/// A controller at the other end of a line.
pub(super) struct Controller {
    title: String,
    now: Duration,
    identity: Option<Identity>,
    failures: Option<Vec<StoredFailure>>,
    values: BTreeMap<u16, i32>,
    /// Parameters that somebody wants to see.
    watched: Vec<Entry>,
    ram: Vec<(Place, Option<Vec<u8>>)>,
    /// Since when it has not answered.
    silent: Option<Duration>,
    rounds: u64,
    lines: Lines,
    /// Refusals and remarks among them, also of lines that are no longer kept.
    told: BTreeSet<String>,
}

impl Controller {
    pub(super) fn new(title: String, watched: Vec<Entry>, ram: Vec<Place>) -> Self {
        Self {
            title,
            now: Duration::ZERO,
            identity: None,
            failures: None,
            values: BTreeMap::new(),
            watched,
            ram: ram.into_iter().map(|place| (place, None)).collect(),
            silent: None,
            rounds: 0,
            lines: Lines::default(),
            told: BTreeSet::new(),
        }
    }

    pub(super) const fn rounds(&self) -> u64 {
        self.rounds
    }

    pub(super) const fn set_now(&mut self, now: Duration) {
        self.now = now;
    }

    fn tell(&mut self, what: &str) {
        self.lines.push(format!("{:>12.6}  {what}", self.now.as_secs_f64()));
    }

    pub(super) fn hear(&mut self, heard: Heard) {
        let answers = !matches!(heard, Heard::Silence(_) | Heard::Remark(_) | Heard::Round);
        if answers && let Some(since) = self.silent.take() {
            let silence = self.now.saturating_sub(since).as_secs_f64();
            self.tell(&format!("answers again, after {silence:.1} s"));
        }
        match heard {
            Heard::Identity(identity) => {
                if self.identity.as_ref() != Some(&identity) {
                    let Identity { model, axes, os_version, .. } = &identity;
                    self.tell(&format!("GEL {model}, {axes} axes, operating system {os_version}"));
                    self.identity = Some(identity);
                }
            }
            Heard::Failures(failures) => self.take_failures(failures),
            Heard::Parameter(index, value) => {
                let before = self.values.insert(index, value);
                if let Some((before, entry)) = before.filter(|before| *before != value).zip(get(index)) {
                    let display = self.display();
                    let (was, is) = (entry.format(before, &display), entry.format(value, &display));
                    self.tell(&format!("{entry}: {was} -> {is}"));
                }
            }
            Heard::Ram(at, bytes) => {
                if let Some((_, known)) = self.ram.get_mut(at) {
                    *known = Some(bytes);
                }
            }
            Heard::Refused(what) | Heard::Remark(what) => {
                // Asked for again and again, told once.
                if !self.told.contains(&what) {
                    self.tell(&what);
                    self.told.insert(what);
                }
            }
            Heard::Silence(what) => {
                if self.silent.is_none() {
                    self.silent = Some(self.now);
                    self.tell(&what);
                }
            }
            Heard::Round => self.rounds += 1,
        }
    }

    fn take_failures(&mut self, failures: Vec<StoredFailure>) {
        let before = self.failures.take().unwrap_or_default();
        let known = |stored: &&StoredFailure| before.contains(stored);
        if !before.is_empty() && failures.is_empty() {
            self.tell("the stored failures have been deleted");
        }
        for stored in failures.iter().filter(|stored| !known(stored)) {
            self.tell(&format!("failure {}, {}: {}", stored.failure.0, source(stored), stored.failure));
        }
        self.failures = Some(failures);
    }

    /// The values as far as they are in range, factory defaults elsewhere.
    fn display(&self) -> Values {
        let mut values = Values::factory();
        for (&index, &value) in &self.values {
            // Out of range: the default's decimal point will do.
            let _ = values.set(index, value);
        }
        values
    }
}

/// Where a failure comes from.
fn source(stored: &StoredFailure) -> String {
    match stored.axis {
        0 => "system".into(),
        axis => format!("axis {axis}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lb2::code::Failure;
    use motion_core::parameters::find;
    use serde_json::json;

    fn told(controller: &Controller) -> String {
        let story = serde_json::to_value(&controller.lines).unwrap();
        let lines = story.as_array().unwrap().iter().map(|line| line.as_str().unwrap().trim_start());
        lines.map(|line| format!("{line}\n")).collect()
    }

    #[test]
    fn what_changes_is_told() {
        let place = Place { offset: 16, len: 2, data_type: DataType::INTEGER16, name: "speed".into() };
        let mut controller = Controller::new("COM".into(), vec![find("642").unwrap()], vec![place]);
        let identity =
            Identity { model: 8231, axes: 6, os_version: "5.15".into(), custom_version: "0.00".into() };
        let failure = |axis, number| StoredFailure { axis, failure: Failure(number) };
        for heard in [
            Heard::Identity(identity.clone()),
            Heard::Failures(vec![failure(0, 26)]),
            Heard::Parameter(642, 5000),
            Heard::Ram(0, vec![0xFE, 0xFF]),
            Heard::Round,
            Heard::Identity(identity),
            Heard::Failures(vec![failure(0, 26), failure(2, 5)]),
            Heard::Parameter(642, 6000),
        ] {
            controller.hear(heard);
        }
        controller.set_now(Duration::from_secs(1));
        (0..3).for_each(|_| controller.hear(Heard::Silence("no answer to function 50h".into())));
        controller.set_now(Duration::from_secs(3));
        assert!(controller.sheet().head.starts_with("NO ANSWER for 2.0 s"), "{}", controller.sheet().head);
        assert_eq!(controller.document()["answers"], false);
        controller.hear(Heard::Failures(Vec::new()));
        assert_eq!(
            told(&controller),
            "0.000000  GEL 8231, 6 axes, operating system 5.15\n\
             0.000000  failure 26, system: stop bit error\n\
             0.000000  failure 5, axis 2: DeltaS > DeltaS max.\n\
             0.000000  [642] V max., Axis 1: 5000 -> 6000\n\
             1.000000  no answer to function 50h\n\
             3.000000  answers again, after 2.0 s\n\
             3.000000  the stored failures have been deleted\n"
        );
        let document = controller.document();
        assert_eq!(
            (&document["parameters"][0]["value"], &document["ram"][0]["value"]),
            (&json!(6000), &json!(-2))
        );
        assert_eq!(controller.rounds(), 1);
        let text = controller.sheet().text();
        assert!(text.contains("speed") && text.contains("-2"), "{text}");
    }

    /// Each of more than 20 refusals was told anew in every round.
    #[test]
    fn a_refusal_is_told_once_in_all() {
        let mut controller = Controller::new("COM".into(), Vec::new(), Vec::new());
        for number in (0..30).cycle().take(90) {
            controller.hear(Heard::Refused(format!("parameter [{number:03}]: refused")));
        }
        assert_eq!(told(&controller).lines().count(), 30);
    }

    #[test]
    fn axes_and_buses_from_their_parameters() {
        let mut controller = Controller::new("COM".into(), Vec::new(), Vec::new());
        assert_eq!(controller.document()["can"], json!([]));
        for entry in asked().filter_map(get) {
            controller.hear(Heard::Parameter(entry.index(), entry.default()));
        }
        // [310] ff.: object IN 1 of CAN 1 is the digital inputs of node 7; CAN 2 is on CAN Link.
        for (index, value) in [(310, 7), (326, 1), (303, 1), (606, 3), (642, 1234), (26, 2)] {
            controller.hear(Heard::Parameter(index, value));
        }
        let document = controller.document();
        let bus = |at: usize| document["can"][at].clone();
        assert_eq!(bus(0)["role"], "CANopen master");
        assert_eq!(bus(0)["objects"][0], json!({ "object": "IN1", "type": "Digital", "node": 7 }));
        assert_eq!(bus(1), json!({ "can": 2, "role": "CAN Link", "objects": [] }));
        let axis = &document["axes"][0];
        assert_eq!((&axis["input"], axis["input_type"].is_string()), (&json!("Input 3"), true));
        assert!(axis["v_max"].as_str().unwrap().starts_with("12.34"), "{axis}");
        assert_eq!(document["axes"].as_array().unwrap().len(), 6);
    }
}
