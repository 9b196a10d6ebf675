//! Six axes on two CAN buses with LD 2000 drives, through the whole controller on virtual time.

mod failures;
mod hour;
mod limits;
mod modes;
mod objects;
mod rig;
