//! Drives a stock control board with our client, and prints `ok` or `FAIL` per check.
//!
//! ```text
//! drive_stock /fake
//! ```
//!
//! Made for `fakeMotionControl` behind `controlBoard_nws_yarp` of 3.5.0 and of 4.0.0, whose moves
//! arrive at once. Requests that this version refuses (`[don]`, `[sto]`, `[rel]`) are not sent.
//! Exits with 1 if any check failed.

mod stock_motor_checks;

use std::process::ExitCode;
use std::time::Duration;

use yarp_client::{
    Axes, AxisIndex, AxisInfo, ControlMode, DeviceError, Encoders, JointType, Mode, MotionControl,
    PositionControl, Robot, VelocityControl,
};
use yarp_conformance::live_checks::Checks;

/// Maximum error of a joint, in degrees.
const POSITION_TOLERANCE: f64 = 0.1;

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
    let mut checks = Checks::new();
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
    let now = || robot.control_modes(Axes::All);
    checks.until("modes arrive", now, |found| *found == modes);
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
    arrives(&mut checks, "one arrives", &robot, 0, 12.0);
    let targets: Vec<f64> = (0..axes).map(|axis| 5.0 + axis as f64).collect();
    checks.check("move all", robot.position_move(Axes::All, &targets), |()| {
        true
    });
    for (axis, target) in targets.iter().enumerate() {
        arrives(&mut checks, "each arrives", &robot, axis, *target);
    }
    checks.check(
        "velocity mode",
        robot.set_control_modes(first, &[Mode::Velocity]),
        |()| true,
    );
    let mode = || robot.control_modes(first);
    checks.until("mode arrives", mode, |found| *found == [Mode::Velocity]);
    let before = targets[0];
    let moves = || {
        robot.velocity_move(first, &[10.0])?;
        std::thread::sleep(Duration::from_millis(20));
        position(&robot, 0)
    };
    checks.until("velocity moves it", moves, |found| *found > before + 1.0);
    checks.check(
        "an axis too many is refused",
        refusal(robot.position_move(Axes::One(AxisIndex::new(axes)), &[0.0])),
        |_| true,
    );
    stock_motor_checks::drive(&mut checks, &robot);
    checks.exit_code()
}

fn position(robot: &Robot, axis: usize) -> Result<f64, DeviceError> {
    Ok(robot.encoder_readings(Axes::All)?[axis].position)
}

pub(crate) fn arrives(checks: &mut Checks, what: &str, robot: &Robot, axis: usize, target: f64) {
    let now = || position(robot, axis);
    checks.until(what, now, |found| {
        (found - target).abs() < POSITION_TOLERANCE
    });
}

/// Returns an expected error as a value.
fn refusal(result: Result<(), DeviceError>) -> Result<DeviceError, DeviceError> {
    match result {
        Err(error) => Ok(error),
        Ok(()) => Err(DeviceError::NotSupported {
            what: "a refusal".to_owned(),
        }),
    }
}
