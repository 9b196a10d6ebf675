//! motionctl
fn main() {}
