//! A small conformance test of one CANopen node against CiA 301 and its own device file.
//!
//! It does no harm: nothing is stored (1010h, 1011h are never written), no program is loaded, what it
//! writes is what it has read before, and at the end the node's communication is reset. Objects of the
//! device's profile and of its maker, behind which axes and outputs are, are written only if
//! [`Config::permitted`]; a node that is operational when the test comes is left alone without that.
//!
//! Everything goes over a [`Wire`]: a real bus, or a virtual node on virtual time.

mod bench;
mod line;
mod network;
mod objects;
mod pdos;
mod sdo;
mod tester;
mod values;
mod words;

use core::fmt;
use core::time::Duration;
use std::io;

use canopen_master::eds::Device;
use canopen_master::nmt::Command;
use canopen_master::{Address, NodeId};

use crate::report::{Case, Outcome};
pub use bench::Bench;
pub use line::Line;
pub use tester::Wire;
use tester::{Checked, Tester};

/// What is tested, and what may be done.
#[derive(Debug, Clone)]
pub struct Config<'a> {
    /// The node's address.
    pub node: NodeId,
    /// Its device file.
    pub device: &'a Device,
    /// Longest time from a request to its answer.
    pub answer: Duration,
    /// A person answers for it that outputs and axes may move.
    pub permitted: bool,
}

/// Why a test was not begun, or not ended.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TestError {
    /// The wire failed.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The node does not answer at all.
    #[error("node {0} does not answer a request for 1000h")]
    Silent(NodeId),
    /// The node is at work.
    #[error("node {0} is operational: a test resets it, which needs permission")]
    Operational(NodeId),
}

/// How a check ends early.
enum Problem {
    Fail(String),
    Skip(String),
    Io(io::Error),
}

impl From<io::Error> for Problem {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

fn fail<T>(why: impl Into<String>) -> Checked<T> {
    Err(Problem::Fail(why.into()))
}

fn skip<T>(why: impl Into<String>) -> Checked<T> {
    Err(Problem::Skip(why.into()))
}

/// One check.
#[derive(Clone, Copy)]
pub struct Check {
    /// Short name.
    pub id: &'static str,
    /// What must hold.
    pub title: &'static str,
    /// Where the standard says so.
    pub clause: &'static str,
    /// What it does to the node beside reading.
    pub touches: &'static str,
    run: fn(&mut Tester<'_>) -> Checked,
}

impl fmt::Debug for Check {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Check").field("id", &self.id).finish_non_exhaustive()
    }
}

const fn check(
    id: &'static str,
    clause: &'static str,
    title: &'static str,
    touches: &'static str,
    run: fn(&mut Tester<'_>) -> Checked,
) -> Check {
    Check { id, title, clause, touches, run }
}

/// Before the objects of the device file are read and written, one by one.
const BEFORE: [&[Check]; 4] = [network::BOOT, sdo::CHECKS, sdo::BLOCKS, values::CHECKS];
/// After it.
const AFTER: [&[Check]; 2] = [network::CHECKS, pdos::CHECKS];

/// All checks, in the order in which they are made; among them every object of the device file is
/// compared, read and written.
#[must_use]
pub fn checks() -> Vec<Check> {
    BEFORE.iter().chain(&AFTER).copied().flatten().copied().collect()
}

/// Whether the node is operational, as far as it shows by itself or when asked.
fn is_operational(tester: &mut Tester<'_>) -> Checked<bool> {
    let id = tester.error_control();
    let period = tester.read_number(Address::new(0x1017, 0)).unwrap_or(0).min(5000);
    if period == 0 {
        tester.guard_request()?;
    }
    let until = tester.now() + tester.config.answer + Duration::from_millis(2 * period);
    Ok(tester.wait(id, until)?.is_some_and(|data| data.first().is_some_and(|state| state & 0x7F == 5)))
}

fn case(tester: &mut Tester<'_>, check: &Check) -> io::Result<Case> {
    let start = tester.now();
    let outcome = outcome((check.run)(tester))?;
    let time = tester.now().saturating_sub(start);
    Ok(Case { id: check.id.into(), title: check.title.into(), clause: check.clause.into(), outcome, time })
}

/// A case of one value of the device file.
fn object_case(
    tester: &mut Tester<'_>,
    at: Address,
    what: &str,
    title: String,
    clause: &str,
    run: impl FnOnce(&mut Tester<'_>) -> Checked,
) -> io::Result<Case> {
    let start = tester.now();
    let outcome = outcome(run(tester))?;
    let time = tester.now().saturating_sub(start);
    let id = format!("object.{:04X}.{:02X}.{what}", at.index, at.sub);
    Ok(Case { id, title, clause: clause.into(), outcome, time })
}

fn outcome(checked: Checked) -> io::Result<Outcome> {
    match checked {
        Ok(()) => Ok(Outcome::Passed),
        Err(Problem::Fail(why)) => Ok(Outcome::Failed(why)),
        Err(Problem::Skip(why)) => Ok(Outcome::Skipped(why)),
        Err(Problem::Io(error)) => Err(error),
    }
}

/// Tests a node; `told` hears of each case as it ends.
///
/// # Errors
/// [`TestError`]. What the node does wrong is no error but a case that has failed.
pub fn test(
    wire: &mut dyn Wire,
    config: &Config<'_>,
    mut told: impl FnMut(&Case),
) -> Result<Vec<Case>, TestError> {
    let mut tester = Tester::new(wire, config);
    let io_only = |problem| match problem {
        Problem::Io(error) => error,
        Problem::Fail(why) | Problem::Skip(why) => io::Error::other(why),
    };
    let request = canopen_master::sdo::message::Request::InitiateUpload { at: Address::new(0x1000, 0) };
    if tester.ask_raw(request.encode()).map_err(io_only)?.is_none() {
        return Err(TestError::Silent(config.node));
    }
    if !config.permitted && is_operational(&mut tester).map_err(io_only)? {
        return Err(TestError::Operational(config.node));
    }
    let mut cases = Vec::new();
    let mut ended = |case: Case| {
        told(&case);
        cases.push(case);
    };
    for check in BEFORE.into_iter().flatten() {
        ended(case(&mut tester, check)?);
    }
    values::test(&mut tester, &mut ended)?;
    objects::test(&mut tester, &mut ended)?;
    for check in AFTER.into_iter().flatten() {
        ended(case(&mut tester, check)?);
    }
    // As it was after power-on.
    tester.command(Command::ResetCommunication).map_err(io_only)?;
    Ok(cases)
}
