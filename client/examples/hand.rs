//! Closes the hand of `yarp hand-board` and opens it again: `cargo run --example hand`.

use yarp_client::prelude::*;

fn main() -> Result<()> {
    let hand = Hand::connect("/hand")?;
    hand.initialise()?;
    hand.grasp(GraspKind::Rectangular)?;
    hand.close_fingers()?;
    println!("closed");
    hand.open_fingers()?;
    println!("open");
    Ok(())
}
