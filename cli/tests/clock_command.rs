//! `yarp clock` publishes a time on a port.

mod common;

use std::time::{Duration, Instant};

use common::Home;

/// Returns the seconds that a clock shows.
fn seconds(home: &Home, port: &str) -> i64 {
    let read = home.run(&format!("read ... {port} once")).with(0);
    let mut lines = read.out.iter().filter(|line| !line.starts_with('['));
    let numbers: Vec<i64> = lines
        .next()
        .unwrap_or_else(|| panic!("{read:?}"))
        .split(' ')
        .map(|number| number.parse().unwrap())
        .collect();
    assert!(
        numbers.len() == 2 && (0..1_000_000_000).contains(&numbers[1]),
        "{read:?}"
    );
    numbers[0]
}

#[test]
fn a_clock_runs_at_the_requested_rate() {
    let home = Home::new();
    let _server = home.serve();
    let line = "clock --name /fast --period 10 --rtf 1000";
    let clock = home.start(line).see("yarp clock running happily...");
    let start = Instant::now();
    // A thousand seconds of the clock are one real second.
    while seconds(&home, "/fast") < 1000 {
        assert!(start.elapsed() < Duration::from_secs(60), "it stands still");
    }
    let ended = clock.signal("INT").finish().with(0);
    let told = [
        "period 10.000 msec",
        "name   /fast",
        "rtf    1000.000",
        "system false",
    ];
    assert_eq!(ended.out[0], "Clock configuration is the following:");
    assert_eq!(ended.out[1..5], told);
}

#[test]
fn a_clock_may_show_the_time_of_day() {
    let home = Home::new();
    let _server = home.serve();
    let _clock = home.start("clock --systemTime").see("running happily");
    assert!(seconds(&home, "/clock") > 1_700_000_000);
}

#[test]
fn the_environment_names_a_clock() {
    let home = Home::new();
    let _server = home.serve();
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_yarp"));
    command.arg("clock").env("YARP_CLOCK", "/sim/clock");
    let _clock = home
        .spawn(command, "clock")
        .see("Port /sim/clock active at");
}
