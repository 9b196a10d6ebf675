//! What a slave needs of its objects.

use core::time::Duration;

use pdo::{Frame, Handled, RpdoFault};

use crate::od::{self, ProcessData};
use crate::sdo::Access;

/// The objects of a [`Slave`](super::Slave): a dictionary that an SDO server can serve and, if there
/// are any, its PDOs. A dictionary without PDOs implements [`Access`] and leaves this as it is.
pub trait Objects: Access {
    /// The node enters operational: PDOs start.
    fn start(&mut self, now: Duration) {
        let _ = now;
    }

    /// The node leaves operational: PDOs stop.
    fn stop(&mut self) {}

    /// Takes a frame that may be a PDO, in operational only.
    fn handle_frame(&mut self, now: Duration, frame: &Frame) -> Handled {
        let _ = (now, frame);
        Handled::Ignored
    }

    /// A SYNC has come, with its counter if it has one, in operational only.
    fn handle_sync(&mut self, counter: Option<u8>) {
        let _ = counter;
    }

    /// Lets everything happen whose time has come.
    fn handle_timeout(&mut self, now: Duration) {
        let _ = now;
    }

    /// The next PDO to send.
    fn poll_transmit(&mut self, now: Duration) -> Option<Frame> {
        let _ = now;
        None
    }

    /// Writes what RPDOs brought to the dictionary; tells which (from 0) and what, until `None`.
    fn poll_event(&mut self) -> Option<(usize, Result<(), RpdoFault>)> {
        None
    }

    /// When to call [`handle_timeout`](Self::handle_timeout).
    fn poll_timeout(&self) -> Option<Duration> {
        None
    }
}

impl<D: Access + ProcessData, const R: usize, const T: usize, const M: usize> Objects
    for od::Objects<D, R, T, M>
{
    fn start(&mut self, _now: Duration) {
        self.pdos.start();
    }

    fn stop(&mut self) {
        self.pdos.stop();
    }

    fn handle_frame(&mut self, now: Duration, frame: &Frame) -> Handled {
        self.pdos.handle_frame(now, frame)
    }

    fn handle_sync(&mut self, counter: Option<u8>) {
        self.pdos.handle_sync(counter, &self.dictionary);
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.pdos.handle_timeout(now);
    }

    fn poll_transmit(&mut self, now: Duration) -> Option<Frame> {
        self.pdos.poll_transmit(now, &self.dictionary)
    }

    fn poll_event(&mut self) -> Option<(usize, Result<(), RpdoFault>)> {
        self.pdos.poll_event(&mut self.dictionary)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.pdos.poll_timeout()
    }
}
