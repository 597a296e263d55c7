//! Reads everything a control board reports, then moves its first joint there and back.
//!
//! ```sh
//! cargo run -p yarp-wrappers --example drive_board -- HOST PORT /wam
//! ```

use std::error::Error;
use std::fmt::Debug;
use std::time::{Duration, Instant};

use yarp_devices::{
    Axes, AxisIndex, AxisInfo, ControlLimits, ControlMode, DeviceError, Encoders, Mode,
    MotionControl, PositionControl, VelocityControl,
};
use yarp_ports::Network;
use yarp_wrappers::{RemoteControlBoard, RemoteControlBoardOptions};

/// Distance by which the first joint is moved, degrees or metres.
const DISTANCE: f64 = 2.0;

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [host, port, remote] = &words[..] else {
        return Err("expected HOST PORT REMOTE".into());
    };
    let local = format!("/drive-{}", std::process::id());
    let network = Network::at(host, port.parse()?);
    let options = RemoteControlBoardOptions::new(remote, local);
    let board = RemoteControlBoard::open(&network, options)?;
    describe(&board);
    drive(&board);
    Ok(())
}

fn describe(board: &RemoteControlBoard) {
    println!("axes: {}", board.axes());
    for axis in (0..board.axes()).map(AxisIndex::from) {
        tell("name", board.axis_name(axis));
        tell("kind", board.joint_type(axis));
        tell("position limits", board.position_limits(axis));
        tell("velocity limits", board.velocity_limits(axis));
    }
    let begun = Instant::now();
    while board.encoder_readings(Axes::All).is_err() && begun.elapsed() < Duration::from_secs(2) {
        std::thread::sleep(Duration::from_millis(5));
    }
    tell("encoders", board.encoder_readings(Axes::All));
    tell("modes", board.control_modes(Axes::All));
    tell("targets", board.target_positions(Axes::All));
    tell("reference speeds", board.reference_speeds(Axes::All));
    tell(
        "reference accelerations",
        board.reference_accelerations(Axes::All),
    );
    tell(
        "reference velocities",
        board.reference_velocities(Axes::All),
    );
}

fn drive(board: &RemoteControlBoard) {
    let first = AxisIndex::from(0);
    let axis = Axes::One(first);
    let at = || {
        board
            .encoder_readings(axis)
            .map(|readings| readings[0].position)
    };
    tell(
        "position mode",
        board.set_control_modes(axis, &[Mode::Position]),
    );
    tell("speed 10", board.set_reference_speeds(axis, &[10.0]));
    let Ok(start) = at() else { return };
    let target = start + DISTANCE;
    tell("move of one", board.position_move(axis, &[target]));
    std::thread::sleep(Duration::from_millis(800));
    tell("it is at", at());
    tell("its target", board.target_positions(axis));
    tell("is done", board.motion_done(axis));
    let all = vec![start; board.axes()];
    tell("move of all", board.position_move(Axes::All, &all));
    std::thread::sleep(Duration::from_millis(800));
    tell("it is at", at());
    tell(
        "velocity mode",
        board.set_control_modes(axis, &[Mode::Velocity]),
    );
    tell("velocity 5 of one", board.velocity_move(axis, &[5.0]));
    std::thread::sleep(Duration::from_millis(400));
    tell("it is at", at());
    tell("its reference", board.reference_velocities(axis));
    tell(
        "velocity 0 of a group",
        board.velocity_move(Axes::Group(&[first]), &[0.0]),
    );
    tell("stop", board.stop(axis));
    std::thread::sleep(Duration::from_millis(200));
    tell(
        "its speed",
        board
            .encoder_readings(axis)
            .map(|readings| readings[0].speed),
    );
    tell(
        "position mode",
        board.set_control_modes(axis, &[Mode::Position]),
    );
    // Last, because the fake motors of YARP 3.5 end their program after this query.
    tell("all are done", board.motion_done(Axes::All));
}

fn tell<T: Debug>(what: &str, outcome: Result<T, DeviceError>) {
    match outcome {
        Ok(value) => println!("{what}: {value:?}"),
        Err(error) => println!("{what}: {error}"),
    }
}
