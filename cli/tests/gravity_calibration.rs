//! `yarp wam calibrate-gravity` on the simulated arm, which runs on a fast clock.

use std::process::Command;
use std::time::Duration;

use crate::common;

use common::{Home, Running};

/// Longer than a calibration takes on a busy machine.
const TIMEOUT: Duration = Duration::from_secs(240);

/// Returns a command on the clock of the simulation.
fn following(line: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_yarp"));
    let words = line.split_whitespace();
    command.args(words).env("YARP_CLOCK", "/clock");
    command
}

/// A name server, a clock that is this much faster than real time, and an arm on it.
fn laboratory(home: &Home, rate: u32) -> [Running; 3] {
    let server = home.serve();
    let clock = home.start("clock --period 2").see("running happily");
    home.run_with("rpc /clock/rpc:i", &format!("rate {rate}\n"));
    let arm = home
        .spawn(following("up --simulation dynamic --no-view"), "up")
        .see("Port /wam/stateExt:o active at");
    [server, clock, arm]
}

#[test]
fn moments_are_measured_verified_and_written_for_the_driver() {
    let home = Home::new();
    let lab = laboratory(&home, 20);
    let file = home.path().join("arm.ini");
    let line = format!("wam calibrate-gravity --confirmed --out {}", file.display());
    let mut calibration = home.spawn(following(&line), "wam");
    assert!(
        calibration.sees_within("Written to", TIMEOUT),
        "{:?}",
        calibration.printed()
    );
    let ended = calibration.finish().with(0);
    assert!(
        ended.out.iter().any(|line| line == "pose 12 of 12"),
        "{ended:?}"
    );
    let text = std::fs::read_to_string(&file).unwrap();
    let list = text.split(['(', ')']).nth(1).expect("a list");
    assert_eq!(list.split_whitespace().count(), 21, "{text}");
    drop(lab);
    // The driver takes it.
    let _server = home.serve();
    let line = format!(
        "up --simulation dynamic --no-view --arm-config {}",
        file.display()
    );
    home.start(&line).see("Port /wam/stateExt:o active at");
}

#[test]
fn nothing_moves_without_a_confirmation_and_nothing_is_written_after_a_signal() {
    let home = Home::new();
    let _lab = laboratory(&home, 1);
    let file = home.path().join("arm.ini");
    let line = format!("wam calibrate-gravity --out {}", file.display());
    let ended = home.run_with(&line, "no\n").with(1);
    assert!(
        ended
            .out
            .iter()
            .any(|line| line.contains("The arm does not move")),
        "{ended:?}"
    );
    let line = format!("{line} --confirmed");
    let calibration = home.spawn(following(&line), "wam").see("Ctrl-C stops it");
    let ended = calibration.signal("INT").finish().with(1);
    assert!(
        ended.out.iter().any(|line| line.contains("Stopped.")),
        "{ended:?}"
    );
    assert!(!file.exists());
}
