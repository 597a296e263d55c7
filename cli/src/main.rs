//! The `yarp` command.
fn main() {}
