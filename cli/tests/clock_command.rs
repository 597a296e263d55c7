//! `yarp clock` publishes a time on a port.

use crate::common;

use std::time::{Duration, Instant};

use common::{Home, Running};

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

/// Returns a command whose clock is `/clock`.
fn following(line: &str) -> std::process::Command {
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_yarp"));
    command
        .args(line.split_whitespace())
        .env("YARP_CLOCK", "/clock");
    command
}

/// Starts the clock `/clock`, which stands until it is asked to go on.
fn paused_clock(home: &Home) -> Running {
    home.start("clock --period 10 --paused")
        .see("running happily")
}

/// Sends a request to the clock and returns the reply.
fn ask(home: &Home, request: &str) -> String {
    let asked = home.run_with("rpc /clock/rpc:i", &format!("{request}\n"));
    let reply = asked.out.iter().find(|line| line.contains("Response:"));
    let reply = reply.unwrap_or_else(|| panic!("{request}: {asked:?}"));
    reply.replace("Response: ", "").trim().to_owned()
}

#[test]
fn requests_pause_step_and_pace_a_clock() {
    let home = Home::new();
    let _server = home.serve();
    let _clock = paused_clock(&home);
    for (request, reply) in [
        ("get", "[ok] 0 0 paused 1.0"),
        ("step 2.5", "[ok] 2 500000000 paused 1.0"),
        ("rate 0.5", "[ok] 2 500000000 paused 0.5"),
        ("pause", "[ok] 2 500000000 paused 0.5"),
        (
            "step -1",
            "[fail] \"expected step SECONDS, more than 0 and up to 86400\"",
        ),
        ("rate 0", "[fail] \"expected rate FACTOR, 0.001 to 1000\""),
        (
            "stop",
            "[fail] \"expected get, pause, resume, step SECONDS, rate FACTOR or help\"",
        ),
        ("get", "[ok] 2 500000000 paused 0.5"),
    ] {
        assert_eq!(ask(&home, request), reply, "{request}");
    }
    // A paused clock shows its time to programs that start.
    assert_eq!(seconds(&home, "/clock"), 2);
    assert!(ask(&home, "resume").ends_with("running 0.5"));
    assert!(ask(&home, "rate 1000").ends_with("running 1000.0"));
    let start = Instant::now();
    while seconds(&home, "/clock") < 100 {
        assert!(start.elapsed() < Duration::from_secs(60), "it stands still");
    }
}

#[test]
fn programs_show_the_time_of_the_clock_and_stand_still_with_it() {
    let home = Home::new();
    let server = home.serve();
    let clock = paused_clock(&home);
    let time = home.spawn(following("time"), "time").see("0.000000");
    assert!(home.names().iter().any(|name| name.ends_with("/clock:i")));
    ask(&home, "step 5");
    let time = time.see("5.000000");
    // Ten messages per second are those of the sampler: without time there are none.
    let mut sampler = home
        .spawn(
            following("sample --output /sampled --rate 1 --show"),
            "sample",
        )
        .see("Port /sampled active at");
    let mut writer = home.start("write /w /sampled").see("Port /w active at");
    writer.reaches(&mut sampler, "first");
    writer.type_text("second\n");
    assert!(!sampler.sees_within("second", Duration::from_millis(300)));
    ask(&home, "step 1");
    let sampler = sampler.see("second");
    // Ctrl-C works although the clock stands.
    sampler.signal("INT").finish().with(0);
    // A clock that comes back is followed again, though it begins anew.
    clock.signal("INT").finish().with(0);
    let _clock = paused_clock(&home);
    let time = time.see_often("0.000000", 2);
    ask(&home, "step 7");
    time.see("7.000000").signal("INT").finish().with(0);
    assert!(!home.names().iter().any(|name| name.ends_with("/clock:i")));
    drop(server);
}

#[test]
fn a_missing_clock_ends_a_program_with_advice() {
    let home = Home::new();
    let _server = home.serve();
    let mut command = following("time");
    command.env("YARP_CLOCK_TIMEOUT", "0.2");
    let ended = home
        .spawn(command, "time")
        .see("waiting for the clock /clock (YARP_CLOCK), at most 0.2 s")
        .finish()
        .with(1);
    ended.complains("no time came from the clock /clock (YARP_CLOCK) within 0.2 s");
    ended.complains("`yarp clock --name /clock`");
    // Without the timeout it can be ended at once.
    home.spawn(following("camera"), "camera")
        .see("waiting for the clock /clock")
        .signal("INT")
        .finish()
        .with(1)
        .complains("interrupted while waiting for the clock /clock");
    let mut command = following("time");
    command.env("YARP_CLOCK_TIMEOUT", "soon");
    let ended = home.spawn(command, "time").finish().with(1);
    ended.complains("YARP_CLOCK_TIMEOUT");
    assert_eq!(home.names(), Vec::<String>::new());
}

#[test]
fn a_simulated_arm_publishes_in_the_time_of_the_clock() {
    let home = Home::new();
    let _server = home.serve();
    let _clock = paused_clock(&home);
    ask(&home, "step 1000");
    let _arm = home
        .spawn(following("up --no-view"), "up")
        .see("Port /wam/stateExt:o active at");
    let mut reader = home
        .start("read /r /wam/state:o envelope")
        .see("Port /r active at");
    let begun = Instant::now();
    let mut time = 1001;
    ask(&home, "step 1");
    // Stamps are those of the clock, whatever the number of periods in a step.
    while !reader.sees_within(&format!(" {time}"), Duration::from_millis(200)) {
        assert!(
            begun.elapsed() < Duration::from_secs(60),
            "{:?}",
            reader.printed()
        );
        ask(&home, "step 1");
        time += 1;
    }
}
