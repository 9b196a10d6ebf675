//! Layouts of PDOs that device profiles and the LD 2000 drive come with. Any other is free: a
//! [`Mapping`](crate::Mapping) of one's own.

pub mod ds401;
pub mod ds402;
pub mod ld2000;
