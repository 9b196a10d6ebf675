//! Virtual CANopen nodes: [`Node`] is the communication of any device, made of the slave's engines of
//! `canopen-master`; a [`Device`] is what it does. There are a servo drive ([`Ld2000`]), an I/O node
//! ([`RemoteIo`]) and a node with the objects of any EDS ([`FileNode`]).
//!
//! Every node has stores for tests at 2000h:01 (64 KiB) and :02 (1 MiB), and a text longer than four bytes at 100Ah.

mod common;
mod description;
mod drive;
mod file;
mod io;
mod node;
mod objects;
mod pdo;

use core::time::Duration;

pub use ::pdo::Address;
use canopen_master::emcy::Emergency;
use canopen_master::nmt::State;
use canopen_master::sdo::AbortCode;

pub use description::device_file;
pub use drive::{Fault, Ld2000};
pub use file::{FileNode, FileNodeError};
pub use io::RemoteIo;
pub use node::{Node, Settings};
pub use objects::{Entry, Objects, Rights};

/// Longest content of 2000h:01, in bytes.
pub const STORE: usize = 64 * 1024;
/// Longest content of 2000h:02, for transfers that take long, in bytes.
pub const LONG_STORE: usize = 1024 * 1024;

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

    /// An object has been written, over SDO or by a PDO.
    fn written(&mut self, context: &mut Context<'_>, at: Address);

    /// Brings what the objects show up to `context.now`. Called before objects are read or sent, on SYNC
    /// and when [`poll_timeout`](Self::poll_timeout) says so.
    fn update(&mut self, context: &mut Context<'_>);

    /// Whether a change does not yet cause the event-driven TPDO with this number (from 0).
    fn holds_back(&mut self, _context: &mut Context<'_>, _tpdo: u16) -> bool {
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
    /// The node's NMT state.
    pub state: State,
    /// Emergencies to send.
    pub emergencies: &'a mut Vec<Emergency>,
}
