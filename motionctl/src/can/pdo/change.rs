//! Changing a PDO of a node, and putting back what was before where the node refuses a part of it.

use canopen_master::Address;
use canopen_master::sdo::Outcome;
use pdo::mapping::MAX_ENTRIES;

use super::{Access, OFF, Place};
use crate::can::session::TransferError;
use crate::exit::Exit;

impl Access<'_> {
    /// What is to be changed, as it is now.
    pub(super) fn earlier(&mut self, place: Place, cob: u32, wanted: &Setup) -> Result<Setup, Exit> {
        let com = place.communication;
        let transmission = wanted.transmission.map(|_| self.read(com, 2)).transpose()?;
        let inhibit = wanted.inhibit.map(|_| self.read(com, 3)).transpose()?;
        let event = wanted.event.map(|_| self.read(com, 5)).transpose()?;
        let mut mapping = None;
        if wanted.mapping.is_some() {
            let count = self.read(place.mapping, 0)? as u8;
            // Above 64 (CiA 301: FEh and FFh are multiplex PDOs) there are no entries to read.
            let subs = 1..=if usize::from(count) > MAX_ENTRIES { 0 } else { count };
            let entries = subs.map(|sub| self.read(place.mapping, sub)).collect::<Result<_, _>>()?;
            mapping = Some((count, entries));
        }
        Ok(Setup {
            cob,
            transmission: transmission.map(|number| number as u8),
            inhibit: inhibit.map(|time| time as u16),
            event: event.map(|time| time as u16),
            mapping,
        })
    }
}

/// What a PDO is set to; `None` stays as it is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Setup {
    pub(super) cob: u32,
    pub(super) transmission: Option<u8>,
    /// 100 µs
    pub(super) inhibit: Option<u16>,
    /// 1 ms
    pub(super) event: Option<u16>,
    /// Number of mapped objects, and the objects.
    pub(super) mapping: Option<(u8, Vec<u32>)>,
}

impl Setup {
    /// What a node that has taken this does not show when it is read back.
    pub(super) fn differs(&self, kept: &Self) -> Vec<&'static str> {
        // Bit 30 is the device's: whether it answers remote frames.
        let identifier = |cob: u32| cob & 0x1FFF_FFFF;
        [
            (identifier(self.cob) != identifier(kept.cob), "identifier"),
            (
                self.cob & OFF != kept.cob & OFF,
                if self.cob & OFF == 0 { "switched on" } else { "switched off" },
            ),
            (self.transmission != kept.transmission, "transmission type"),
            (self.inhibit != kept.inhibit, "inhibit time"),
            (self.event != kept.event, "event timer"),
            (self.mapping != kept.mapping, "mapping"),
        ]
        .into_iter()
        .filter_map(|(differs, what)| differs.then_some(what))
        .collect()
    }

    /// What is written, in the order of CiA 301, 7.5.2.38: off, count 0, entries, count, on.
    fn steps(&self, place: Place) -> Vec<(Address, Vec<u8>, String)> {
        let com = |sub| Address::new(place.communication, sub);
        let map = |sub| Address::new(place.mapping, sub);
        let count = || "number of mapped objects".to_owned();
        let mut steps =
            vec![(com(1), (self.cob | OFF).to_le_bytes().to_vec(), "switching the PDO off".into())];
        if let Some(number) = self.transmission {
            steps.push((com(2), vec![number], "transmission type".into()));
        }
        if let Some(time) = self.inhibit {
            steps.push((com(3), time.to_le_bytes().to_vec(), "inhibit time".into()));
        }
        if let Some(time) = self.event {
            steps.push((com(5), time.to_le_bytes().to_vec(), "event timer".into()));
        }
        if let Some((number, entries)) = &self.mapping {
            steps.push((map(0), vec![0], count()));
            for (entry, sub) in entries.iter().zip(1..) {
                steps.push((map(sub), entry.to_le_bytes().to_vec(), format!("mapped object {sub}")));
            }
            steps.push((map(0), vec![*number], count()));
        }
        if self.cob & OFF == 0 {
            steps.push((com(1), self.cob.to_le_bytes().to_vec(), "switching the PDO on".into()));
        }
        steps
    }
}

/// In which state a PDO is left whose change failed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Left {
    /// Nothing was changed.
    Unchanged,
    /// What was before was put back.
    Restored,
    /// Off, its parameters partly changed: why what was before could not be put back.
    Off(String),
    /// Nobody answered: it may be off.
    Unknown,
}

impl Left {
    pub(super) const fn name(&self) -> &'static str {
        match self {
            Self::Unchanged => "unchanged",
            Self::Restored => "restored",
            Self::Off(_) => "off",
            Self::Unknown => "unknown",
        }
    }
}

impl core::fmt::Display for Left {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Unchanged => f.write_str("the PDO is unchanged"),
            Self::Restored => f.write_str("the PDO is again as it was before"),
            Self::Off(why) => write!(
                f,
                "the PDO is left switched off, its parameters partly changed: \
                 what was before could not be put back ({why})"
            ),
            Self::Unknown => f.write_str("the PDO may be switched off: nobody answers"),
        }
    }
}

/// A change of a PDO that failed.
#[derive(Debug)]
pub(super) struct Failed {
    pub(super) what: String,
    pub(super) error: TransferError,
    pub(super) left: Left,
}

/// Writes one object.
pub(super) type Write<'a> = dyn FnMut(Address, Vec<u8>) -> Result<Result<(), TransferError>, Exit> + 'a;

/// Writes step by step; where one fails, how many were done and which it was. `off`: the PDO is off already.
fn carry_out(
    write: &mut Write<'_>,
    off: bool,
    steps: Vec<(Address, Vec<u8>, String)>,
) -> Result<Result<(), (usize, String, TransferError)>, Exit> {
    for (done, (at, data, what)) in steps.into_iter().enumerate() {
        let written = write(at, data).map_err(|exit| {
            let left = if off || done > 0 { "; the PDO is left switched off" } else { "" };
            Exit { message: format!("{what}: {}{left}", exit.message), ..exit }
        })?;
        if let Err(error) = written {
            return Ok(Err((done, what, error)));
        }
    }
    Ok(Ok(()))
}

/// Changes a PDO; where that fails, puts back what was before.
pub(super) fn change(
    write: &mut Write<'_>,
    place: Place,
    before: &Setup,
    wanted: &Setup,
) -> Result<Result<(), Failed>, Exit> {
    let Err((done, what, error)) = carry_out(write, false, wanted.steps(place))? else { return Ok(Ok(())) };
    let refused = matches!(error.outcome, Outcome::Aborted(_));
    let left = if done == 0 && refused {
        Left::Unchanged
    } else {
        match carry_out(write, done > 0, before.steps(place))? {
            Ok(()) => Left::Restored,
            Err(_) if done == 0 => Left::Unknown,
            Err((_, what, error)) => Left::Off(format!("{what}: {error}")),
        }
    };
    Ok(Err(Failed { what, error, left }))
}

#[cfg(test)]
mod tests {
    use canopen_master::sdo::AbortCode;

    use super::*;

    const PLACE: Place = Place { communication: 0x1801, mapping: 0x1A01, transmit: true };

    fn before() -> Setup {
        Setup {
            cob: 0x285,
            transmission: Some(255),
            inhibit: None,
            event: None,
            mapping: Some((1, vec![0x6401_0110])),
        }
    }

    fn wanted() -> Setup {
        Setup { transmission: Some(1), mapping: Some((2, vec![0x6401_0210, 0x1000_0020])), ..before() }
    }

    fn failed(at: Address, outcome: Outcome) -> TransferError {
        TransferError { node: 5, at, outcome, instead: None }
    }

    /// What is written to a node that answers as `answer` says (the number of the write, from 0), and how
    /// the PDO is left.
    fn changed(mut answer: impl FnMut(usize) -> Outcome) -> (Vec<(Address, Vec<u8>)>, Option<Left>) {
        let mut written = Vec::new();
        let mut write = |at, data: Vec<u8>| {
            let outcome = answer(written.len());
            written.push((at, data));
            Ok(if matches!(outcome, Outcome::Done(_)) { Ok(()) } else { Err(failed(at, outcome)) })
        };
        let left = change(&mut write, PLACE, &before(), &wanted()).unwrap();
        (written, left.err().map(|failed| failed.left))
    }

    const REFUSED: Outcome = Outcome::Aborted(AbortCode::NOT_MAPPABLE);
    /// Writes up to the second mapped object.
    const SECOND: usize = 4;

    #[test]
    fn a_refused_change_is_undone_in_the_order_of_cia_301() {
        let (written, left) = changed(|number| if number == SECOND { REFUSED } else { Outcome::Done(4) });
        assert_eq!(left, Some(Left::Restored));
        let (com, map) = (|sub| Address::new(0x1801, sub), |sub| Address::new(0x1A01, sub));
        let off = (com(1), vec![0x85, 2, 0, 0x80]);
        let expected = [
            off.clone(),
            (com(2), vec![1]),
            (map(0), vec![0]),
            (map(1), vec![0x10, 2, 1, 0x64]),
            (map(2), vec![0x20, 0, 0, 0x10]),
            off,
            (com(2), vec![255]),
            (map(0), vec![0]),
            (map(1), vec![0x10, 1, 1, 0x64]),
            (map(0), vec![1]),
            (com(1), vec![0x85, 2, 0, 0]),
        ];
        assert_eq!(written, expected);
    }

    #[test]
    fn a_change_that_cannot_be_undone_says_that_the_pdo_is_off() {
        let (written, left) =
            changed(|number| if number == SECOND || number == 8 { REFUSED } else { Outcome::Done(4) });
        assert_eq!(written.len(), 9);
        let Some(left @ Left::Off(_)) = left else { panic!("{left:?}") };
        let text = left.to_string();
        assert!(text.contains("left switched off") && text.contains("mapped object 1: "), "{text}");
        // Silent in the middle, too.
        let (_, left) = changed(|number| if number >= SECOND { Outcome::TimedOut } else { Outcome::Done(4) });
        assert!(matches!(left, Some(Left::Off(_))), "{left:?}");
    }

    #[test]
    fn a_refused_first_step_changes_nothing_and_a_silent_one_is_not_known() {
        let (written, left) = changed(|_| REFUSED);
        assert_eq!((written.len(), left), (1, Some(Left::Unchanged)));
        let (written, left) = changed(|_| Outcome::TimedOut);
        assert_eq!((written.len(), left), (2, Some(Left::Unknown)));
        // Only its answer was lost: what was before is put back.
        let (_, left) = changed(|number| if number == 0 { Outcome::TimedOut } else { Outcome::Done(4) });
        assert_eq!(left, Some(Left::Restored));
    }

    #[test]
    fn a_change_that_is_stopped_is_undone() {
        let (written, left) =
            changed(|number| if number == SECOND { Outcome::Cancelled } else { Outcome::Done(4) });
        assert_eq!((written.len(), left), (11, Some(Left::Restored)));
    }

    #[test]
    fn what_a_node_acknowledges_and_does_not_keep_is_named() {
        assert_eq!(wanted().differs(&wanted()), [""; 0]);
        assert_eq!(wanted().differs(&before()), ["transmission type", "mapping"]);
        let off = Setup { cob: 0x286 | OFF, ..wanted() };
        assert_eq!(off.differs(&wanted()), ["identifier", "switched off"]);
        assert_eq!(wanted().differs(&Setup { cob: 0x285 | 1 << 30, ..wanted() }), [""; 0]);
    }

    #[test]
    fn an_endpoint_that_fails_in_the_middle_says_that_the_pdo_is_off() {
        let ended = |fails: usize| {
            let mut writes = 0..;
            let mut write = |_, _| match writes.next() {
                Some(number) if number == fails => Err(Exit::trouble("the endpoint failed")),
                _ => Ok(Ok(())),
            };
            change(&mut write, PLACE, &before(), &wanted()).unwrap_err().message
        };
        assert_eq!(ended(0), "switching the PDO off: the endpoint failed");
        assert_eq!(ended(1), "transmission type: the endpoint failed; the PDO is left switched off");
    }
}
