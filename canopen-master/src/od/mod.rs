//! The object dictionary of the slave role (CiA 301, 7.4): a constant table of entries, the values in
//! memory that the caller gives, no allocation.
//!
//! [`Table`] says what exists; [`Dictionary`] holds the values and answers a
//! [`Server`](crate::sdo::Server); [`Hooks`] is the application's part; [`Pdos`] has the communication and
//! mapping parameters of the PDOs, which may change at run time, and moves process data; [`Objects`] joins
//! both for the server. Another dictionary than this one has PDOs too if it implements [`ProcessData`].

mod dictionary;
mod entry;
mod hooks;
mod objects;
mod pdos;
mod table;

pub use dictionary::{Dictionary, LOAD, RamError, SAVE};
pub use entry::{Entry, Initial, Limits, Place, Rights};
pub use hooks::{Hooks, Stored};
pub use objects::{Objects, ProcessData};
pub use pdo::Communication;
pub use pdos::{PdoSlot, Pdos};
pub use table::{Table, TableError, View};
