//! Moves the first joint of the arm of `make run` to 20 degrees: `cargo run --example arm`.

use std::time::Duration;

use yarp_client::prelude::*;

fn main() -> Result<()> {
    let arm = Robot::connect("/wam")?;
    let joint = Axes::One(0.into());
    arm.set_control_modes(joint, &[Mode::Position])?;
    arm.set_reference_speeds(joint, &[40.0])?; // deg/s
    arm.position_move(joint, &[20.0])?; // deg
    let done = arm.wait_motion_done(joint, Duration::from_secs(10))?;
    println!("done: {done}, joint 0 at {:.1} deg", arm.positions()?[0]);
    Ok(())
}
