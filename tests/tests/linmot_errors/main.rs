//! Every error that a LinMot drive or its wire can bring, by its name, over every carrier: the links of
//! motion-io against the virtual drive, on wires that lose, repeat and falsify answers.

mod bench;
mod blocks;
mod parameters;
mod wire;
