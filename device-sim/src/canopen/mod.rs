//! Virtual CANopen nodes: [`Node`] is any device, its communication the slave of `canopen-master`; a
//! [`Device`] is what it does. There are a servo drive ([`Ld2000`]), an I/O node
//! ([`RemoteIo`]) and a node with the objects of any EDS ([`FileNode`]).
//!
//! Every node has stores for tests at 2000h:01 (64 KiB) and :02 (1 MiB), and a text longer than four bytes at
//! 100Ah, unless its device file has objects of its own there.

mod common;
mod description;
mod dictionary;
mod drive;
mod file;
mod io;
mod node;
mod objects;
mod served;

use core::time::Duration;

use canopen_master::emcy::ErrorCode;
use canopen_master::nmt::State;
use canopen_master::od;
use canopen_master::sdo::AbortCode;

pub use canopen_master::od::{Limits, Rights};
pub use description::device_file;
pub use drive::{Fault, Ld2000};
pub use file::{FileNode, FileNodeError};
pub use io::RemoteIo;
pub use node::{Node, Settings};
pub use objects::{Entry, Objects};
pub use pdo::Address;

use common::{MAPPED, PDOS};

/// Longest content of 2000h:01, in bytes.
pub const STORE: usize = 64 * 1024;
/// Longest content of 2000h:02, for transfers that take long, in bytes.
pub const LONG_STORE: usize = 1024 * 1024;

/// The PDOs of a node: four of each direction.
pub type Pdos = od::Pdos<PDOS, PDOS, MAPPED>;

/// What a device does with its objects and with time.
pub trait Device {
    /// May refuse a value that is about to be written over SDO; type, length, rights and limits have been
    /// checked.
    ///
    /// # Errors
    /// The abort code for the client.
    fn check(&mut self, _objects: &Objects, _at: Address, _value: &[u8]) -> Result<(), AbortCode> {
        Ok(())
    }

    /// An object has been written: over SDO, a PDO parameter too, or by a PDO.
    fn written(&mut self, context: &mut Context<'_>, at: Address);

    /// Brings what the objects show up to `context.now`. Called before objects are read or sent, on SYNC
    /// and when [`poll_timeout`](Self::poll_timeout) says so.
    fn update(&mut self, context: &mut Context<'_>);

    /// Whether a change does not yet cause the event-driven TPDO with this number (from 0).
    fn holds_back(&mut self, _context: &mut Context<'_>, _tpdo: usize) -> bool {
        false
    }

    /// Whether the PDO parameters that there are, and who may write them, are those among the node's objects
    /// (1400h to 1BFFh). Otherwise it has all that the engine has.
    fn describes_pdos(&self) -> bool {
        false
    }

    /// When to call [`update`](Self::update) even if nobody asks.
    fn poll_timeout(&self) -> Option<Duration> {
        None
    }

    /// The NMT state has changed; [`State::BootUp`]: the objects have been reset.
    fn state(&mut self, _context: &mut Context<'_>, _state: State) {}

    /// The master is no longer heard (life guarding or heartbeat), or is back.
    fn master(&mut self, _context: &mut Context<'_>, _lost: bool) {}
}

/// What a device works with.
#[derive(Debug)]
pub struct Context<'a> {
    /// Virtual time.
    pub now: Duration,
    /// The node's objects.
    pub objects: &'a mut Objects,
    /// The node's PDOs.
    pub pdos: &'a mut Pdos,
    /// The node's NMT state.
    pub state: State,
    errors: &'a mut Vec<Error>,
}

impl Context<'_> {
    /// An error has occurred: as [`Slave::raise`](canopen_master::slave::Slave::raise).
    pub fn raise(&mut self, code: ErrorCode, data: [u8; 5]) {
        self.errors.push(Error::Raised(code, data));
    }

    /// An error is gone: as [`Slave::clear`](canopen_master::slave::Slave::clear).
    pub fn clear(&mut self, code: ErrorCode) {
        self.errors.push(Error::Gone(code));
    }

    /// Something was wrong and is over: as [`Slave::mention`](canopen_master::slave::Slave::mention).
    pub fn mention(&mut self, code: ErrorCode, data: [u8; 5]) {
        self.errors.push(Error::Mentioned(code, data));
    }
}

/// What a device has to tell of an error.
#[derive(Debug)]
enum Error {
    Raised(ErrorCode, [u8; 5]),
    Gone(ErrorCode),
    Mentioned(ErrorCode, [u8; 5]),
}
