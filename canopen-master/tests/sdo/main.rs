//! SDO client and server through their public API: conversations byte by byte, and both against each
//! other on virtual time.

mod client;
mod pair;
mod server;
mod transfers;
