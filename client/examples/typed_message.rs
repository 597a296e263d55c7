//! Publishes a message with a type of its own: `cargo run --example typed_message`, then `yarp read ... /grasps`.

use std::thread;
use std::time::Duration;

use yarp_client::prelude::*;

/// A grasp; stock's tools print it as `cup 2.5 (10.0 20.0)`.
#[derive(Clone, Debug, Message, PartialEq)]
struct PlannedGrasp {
    object: String,
    force: f64,        // N
    fingers: Vec<f64>, // deg
}

fn main() -> Result<()> {
    let publisher = Publisher::open("/grasps")?;
    let fingers = vec![10.0, 20.0];
    let object = "cup".to_owned();
    let grasp = PlannedGrasp {
        object,
        force: 2.5,
        fingers,
    };
    loop {
        publisher.publish(&grasp);
        thread::sleep(Duration::from_millis(100));
    }
}
