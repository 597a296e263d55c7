//! Runs the same code on a local arm and on a remote one.
//!
//! ```text
//! nod             a simulated WAM inside this program
//! nod /wam        the arm behind the control board /wam, wherever it runs
//! ```

use std::error::Error;
use std::sync::Arc;
use std::thread::sleep;
use std::time::{Duration, Instant};

use yarp_client::{Axes, AxisIndex, Device, Mode, Robot};
use yarp_devices::wam::SimulatedWam;

/// The elbow of the WAM.
const ELBOW: AxisIndex = AxisIndex::new(3);
/// Amplitude of the nod, in degrees.
const NOD_DEGREES: f64 = -10.0;

fn main() -> Result<(), Box<dyn Error>> {
    let arm: Arc<dyn Device> = match std::env::args().nth(1) {
        Some(name) => Robot::connect(&name)?.device(),
        None => Arc::new(SimulatedWam::new()),
    };
    nod(arm.as_ref())
}

/// Moves the elbow a little and back, and prints its position.
fn nod(arm: &dyn Device) -> Result<(), Box<dyn Error>> {
    let modes = arm.control_mode().ok_or("the arm has no control modes")?;
    let encoders = arm.encoders().ok_or("the arm has no encoders")?;
    let motion = arm.position_control().ok_or("the arm cannot be moved")?;
    let elbow = Axes::One(ELBOW);
    let position = || {
        encoders
            .encoder_readings(elbow)
            .map(|readings| readings[0].position)
    };

    modes.set_control_modes(elbow, &[Mode::Position])?;
    motion.set_reference_speeds(elbow, &[20.0])?;
    let start = position()?;
    println!("the elbow stands at {start:.1} degrees");
    for target in [start + NOD_DEGREES, start] {
        motion.position_move(elbow, &[target])?;
        let deadline = Instant::now() + Duration::from_secs(10);
        while !motion.motion_done(elbow)? && Instant::now() < deadline {
            sleep(Duration::from_millis(20));
        }
        // The last state of a remote arm may be one period old.
        sleep(Duration::from_millis(50));
        println!("the elbow stands at {:.1} degrees", position()?);
    }
    Ok(())
}
