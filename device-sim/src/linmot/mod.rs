//! A LinMot SG5 drive without its motor: parameter tree in ROM and RAM, curves and command table in
//! RAM and flash, error log, restart (manual B). It implements [`linmot::drive::Drive`], so every
//! carrier of the `linmot` crate serves it.

mod drive;
mod flash;
mod node;
mod objects;
mod tree;

pub use drive::{Times, VirtualDrive};
pub use flash::{ImageError, StoredCurve};
pub use node::CanDrive;
pub use tree::{generated, sg5};
