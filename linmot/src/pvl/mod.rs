//! PVL files: parameter objects of each layer, curves (manual B 8).
//!
//! Both sides work line by line, so a file of any size needs constant memory: [`Parser`] takes
//! lines and gives [`Event`]s, [`Writer`] takes values and gives lines. What the manual's figures
//! leave open is read in every form: with or without `@` and the `h` of hex numbers, separated by
//! commas, semicolons, tabs or blanks, columns in any order (decision 26).

mod event;
mod parse;
mod row;
#[cfg(feature = "alloc")]
mod text;
mod write;

pub use event::{Event, Excerpt, Problem, Severity};
pub use parse::Parser;
#[cfg(feature = "alloc")]
pub use text::{Encoding, LineDecoder};
pub use write::Writer;
