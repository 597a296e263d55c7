//! Moves the tool of `yarp up --cartesian` in space: `cargo run --example cartesian_tool`.

use std::time::Duration;

use yarp_client::prelude::*;

fn main() -> Result<()> {
    let tool = CartesianTool::connect("/cartController/wam")?;
    tool.go_to_sync(Target::Position([0.4, 0.1, 0.4]), Some(2.0))?; // m, s
    let done = tool.wait_motion_done(Duration::from_millis(50), Duration::from_secs(20))?;
    println!("done: {done}, tool at {:?} m", tool.pose()?.pose.position);
    Ok(())
}
