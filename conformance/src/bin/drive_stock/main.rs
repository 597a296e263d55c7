//! Drives a stock control board with our client, and prints `ok` or `FAIL` per check.
//!
//! ```text
//! drive_stock /fake
//! ```
//!
//! Made for `fakeMotionControl` behind `controlBoard_nws_yarp` of 3.5.0 and of 4.0.0, whose
//! moves arrive at once. What that version itself refuses (`[don]`, `[sto]`, `[rel]`) is not asked.
//! Ends with 1 if any check failed.

mod motors;

use std::process::ExitCode;
use std::time::{Duration, Instant};

use yarp_client::{
    Axes, AxisIndex, AxisInfo, ControlMode, DeviceError, Encoders, JointType, Mode, MotionControl,
    PositionControl, Robot, VelocityControl,
};

const PATIENCE: Duration = Duration::from_secs(10);
/// Degrees by which a joint may miss its target.
const CLOSE: f64 = 0.1;

struct Checks {
    failed: usize,
}

impl Checks {
    fn check<T: std::fmt::Debug>(
        &mut self,
        what: &str,
        found: Result<T, DeviceError>,
        good: impl Fn(&T) -> bool,
    ) {
        let fine = found.as_ref().is_ok_and(good);
        self.failed += usize::from(!fine);
        println!("{} {what}: {found:?}", if fine { "ok  " } else { "FAIL" });
    }
}

fn main() -> ExitCode {
    let Some(name) = std::env::args().nth(1) else {
        eprintln!("usage: drive_stock NAME");
        return ExitCode::from(2);
    };
    let robot = match Robot::connect(&name) {
        Ok(robot) => robot,
        Err(error) => {
            println!("FAIL opens: {error:?}");
            return ExitCode::FAILURE;
        }
    };
    let mut checks = Checks { failed: 0 };
    let axes = robot.axes();
    println!("ok   opens: {axes} axes");
    let first = Axes::One(AxisIndex::new(0));

    checks.check("name", robot.axis_name(AxisIndex::new(0)), |name| {
        name == "joint0"
    });
    checks.check("type", robot.joint_type(AxisIndex::new(0)), |kind| {
        *kind == JointType::Revolute
    });
    let modes = vec![Mode::Position; axes];
    checks.check(
        "position mode",
        robot.set_control_modes(Axes::All, &modes),
        |()| true,
    );
    checks.check(
        "modes arrive",
        eventually(|| robot.control_modes(Axes::All), |m| *m == modes),
        |_| true,
    );
    let speeds = vec![30.0; axes];
    checks.check(
        "set speeds",
        robot.set_reference_speeds(Axes::All, &speeds),
        |()| true,
    );
    checks.check("speeds", robot.reference_speeds(Axes::All), |found| {
        *found == speeds
    });
    let accelerations = vec![20.0; axes];
    checks.check(
        "set accelerations",
        robot.set_reference_accelerations(Axes::All, &accelerations),
        |()| true,
    );
    checks.check("move one", robot.position_move(first, &[12.0]), |()| true);
    checks.check("target of one", robot.target_positions(first), |found| {
        *found == [12.0]
    });
    checks.check("one arrives", arrives(&robot, 0, 12.0), |_| true);
    let targets: Vec<f64> = (0..axes).map(|axis| 5.0 + axis as f64).collect();
    checks.check("move all", robot.position_move(Axes::All, &targets), |()| {
        true
    });
    for (axis, target) in targets.iter().enumerate() {
        checks.check("each arrives", arrives(&robot, axis, *target), |_| true);
    }
    checks.check(
        "velocity mode",
        robot.set_control_modes(first, &[Mode::Velocity]),
        |()| true,
    );
    let mode = || robot.control_modes(first);
    checks.check(
        "mode arrives",
        eventually(mode, |m| *m == [Mode::Velocity]),
        |_| true,
    );
    let before = targets[0];
    let moved = eventually(
        || {
            robot.velocity_move(first, &[10.0])?;
            std::thread::sleep(Duration::from_millis(20));
            position(&robot, 0)
        },
        |found| *found > before + 1.0,
    );
    checks.check("velocity moves it", moved, |_| true);
    checks.check(
        "an axis too many is refused",
        refusal(robot.position_move(Axes::One(AxisIndex::new(axes)), &[0.0])),
        |_| true,
    );
    motors::drive(&mut checks, &robot);
    if checks.failed == 0 {
        ExitCode::SUCCESS
    } else {
        println!("{} checks failed", checks.failed);
        ExitCode::FAILURE
    }
}

fn position(robot: &Robot, axis: usize) -> Result<f64, DeviceError> {
    Ok(robot.encoder_readings(Axes::All)?[axis].position)
}

fn arrives(robot: &Robot, axis: usize, target: f64) -> Result<f64, DeviceError> {
    eventually(
        || position(robot, axis),
        |found| (found - target).abs() < CLOSE,
    )
}

/// The first value that is good; the last one tried, as an error, if none is in time.
fn eventually<T: std::fmt::Debug>(
    look: impl Fn() -> Result<T, DeviceError>,
    good: impl Fn(&T) -> bool,
) -> Result<T, DeviceError> {
    let deadline = Instant::now() + PATIENCE;
    loop {
        let found = look();
        match found {
            Ok(found) if good(&found) => return Ok(found),
            Ok(found) if Instant::now() > deadline => {
                return Err(DeviceError::NotSupported {
                    what: format!("what was waited for; the last was {found:?}"),
                });
            }
            Err(error) if Instant::now() > deadline => return Err(error),
            _ => std::thread::sleep(Duration::from_millis(10)),
        }
    }
}

/// An error that was expected.
fn refusal(result: Result<(), DeviceError>) -> Result<DeviceError, DeviceError> {
    match result {
        Err(error) => Ok(error),
        Ok(()) => Err(DeviceError::NotSupported {
            what: "a refusal".to_owned(),
        }),
    }
}
