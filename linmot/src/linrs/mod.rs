//! LinRS: the configuration service over RS-232 and RS-485 (LinMot document 0185-1082).
//!
//! Frames, the mapping of commands to messages, a master and a slave engine. Messages that the
//! document has are used as they are; the commands that it does not have go as they are in a message
//! of their own (main ID [`TUNNEL`], project-defined).

mod frame;
mod master;
mod message;
mod slave;

pub use frame::{Checksum, Decoder, MAX_DATA, MAX_FRAME, Message};
pub use master::{Config, Event, Master, Outcome, SubmitError, Ticket};
pub use message::{TUNNEL, reply, request, response, telegram};
pub use slave::Slave;
