//! What every parameter of axes, inputs and outputs does, through the whole controller on a plant: one
//! test a parameter, over all of its instances and the modes it works in.

mod bench;
mod calibration;
mod control;
mod gearing;
mod inputs;
mod jog;
mod limits;
mod motion;
mod outputs;
mod ramps;
mod routes;
mod signals;
mod window;
