//! Helpers shared by the whole-family tests and the fuzz targets.

pub mod fuzz;
