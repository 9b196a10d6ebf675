//! Conformance: a test of any CANopen node against the standard and its device file ([`node`]), recorded
//! traffic replayed through our engines ([`replay`]), and the report of both ([`report`]). What the
//! whole-family tests and the fuzz targets share is here, too.

pub mod controllers;
pub mod fuzz;
pub mod node;
pub mod replay;
pub mod report;
