//! The tables of manual B (LinMot Drive Configuration over Fieldbus Interfaces SG5), row by row, as the
//! library and the virtual drive have them.

mod codes;
mod module;
mod objects;
