//! SDO client and server through their public API: conversations byte by byte, and both against each
//! other on virtual time.

mod blocks;
mod client;
mod faults;
mod messages;
mod pair;
mod server;
mod transfers;
