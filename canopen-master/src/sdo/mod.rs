//! Service data objects: reading ("upload") and writing ("download") entries of a node's object
//! dictionary, expedited, in segments and in blocks (CiA 301, 7.2.4).
//!
//! [`Client`] and [`Server`] are the engines, one per channel (a pair of identifiers), each carrying
//! one transfer at a time. `message` has the bytes on the wire.
//!
//! What CiA 301 itself cannot detect: an expedited or segmented transfer has no check sum of its own,
//! its data are only as safe as the CRC of the CAN frames; two answers to like requests carry nothing
//! to tell them apart (see [`Client`] for what is done about it).

mod abort;
mod block;
mod buffer;
mod client;
pub mod message;
mod server;

use core::fmt;

use pdo::NodeId;
use pdo::cob::{SDO_REQUEST, SDO_RESPONSE};

pub use abort::AbortCode;
pub use block::MAX_BLOCK_SIZE;
#[cfg(feature = "alloc")]
pub(crate) use block::check_sum;
pub use buffer::{Buffer, Either, Small};
pub use client::{ANSWER, Block, Client, Fault, Finished, Options, Outcome, Refused, SubmitError, Ticket};
pub use pdo::Address;
pub use server::{Access, NEXT_REQUEST, Piece, Server, Total, read_slice};

/// What an abort names whose sender cannot tell the object: 0000h:00.
pub(crate) const UNNAMED: Address = Address::new(0, 0);

/// The two identifiers of an SDO connection (11 bits).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Channel {
    /// From the client to the server.
    pub request: u16,
    /// From the server to the client.
    pub response: u16,
}

impl Channel {
    /// The default SDO of a node: 600h + node ID and 580h + node ID.
    #[must_use]
    pub const fn default_of(node: NodeId) -> Self {
        let node = node.raw() as u16;
        Self { request: SDO_REQUEST + node, response: SDO_RESPONSE + node }
    }
}

impl fmt::Display for Channel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "SDO {:03X}h/{:03X}h", self.request, self.response)
    }
}

/// The data of a frame if it is a data frame on this 11-bit identifier.
#[inline]
fn data_on<F: embedded_can::Frame>(id: u16, frame: &F) -> Option<&[u8]> {
    match frame.id() {
        embedded_can::Id::Standard(standard) if standard.as_raw() == id && frame.is_data_frame() => {
            Some(frame.data())
        }
        _ => None,
    }
}
