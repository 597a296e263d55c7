//! The rehearsal in `docs/bringing-up-your-wam.md`, command by command, and the guards that it promises.

#![cfg(unix)]

use crate::common;

use std::time::{Duration, Instant};

use common::{Ended, Home};

const GUIDE: &str = include_str!("../../docs/bringing-up-your-wam.md");

/// Returns the commands of the guide that the simulator can run, each with a text that it prints.
fn steps() -> Vec<(&'static str, &'static str)> {
    let blocks = GUIDE.split("```rehearsal\n").skip(1);
    let lines = blocks.flat_map(|block| block.split("```").next().unwrap_or("").lines());
    let lines: Vec<_> = lines.collect();
    let pairs = lines.chunks(2).map(|pair| {
        let command = pair[0].strip_prefix("$ ").expect("a command");
        (command, *pair.get(1).expect("what it prints"))
    });
    pairs.collect()
}

/// Runs a command of the guide: `yarp WORDS`, or `echo 'LINE' | yarp WORDS`.
fn run(home: &Home, command: &str) -> Ended {
    match command.strip_prefix("echo '") {
        Some(rest) => {
            let (line, words) = rest.split_once("' | yarp ").expect("a pipe");
            home.run_with(words, &format!("{line}\n"))
        }
        None => home.run(command.strip_prefix("yarp ").expect("a command of ours")),
    }
}

#[test]
fn each_step_does_what_the_guide_says() {
    let home = Home::new();
    let mut running = Vec::new();
    let steps = steps();
    assert!(steps.len() >= 8, "{steps:?}");
    for (command, expected) in steps {
        if expected == "Ctrl-C ends it." {
            let words = command.strip_prefix("yarp ").expect("a command of ours");
            running.push(home.start(words).see(expected));
            continue;
        }
        let ended = run(&home, command);
        let lines = || ended.out.iter().chain(&ended.err);
        assert!(
            lines().any(|line| line.contains(expected)),
            "{command} does not say {expected:?}: {ended:?}"
        );
    }
    for up in running.into_iter().rev() {
        up.signal("TERM").finish().with(0);
    }
}

/// Returns the position of the base, degrees.
fn base(home: &Home) -> f64 {
    let told = home.run_with("rpc /wam/rpc:i", "[get] [enc] 0\n").with(0);
    let line = told.out.join(" ");
    let mut words = line.split_whitespace().skip_while(|word| *word != "[enc]");
    let number = words.nth(1).expect("a position");
    number.parse().expect("a number")
}

/// The client is gone as soon as it has commanded the velocity.
#[test]
fn a_velocity_ends_when_its_client_is_gone() {
    let home = Home::new();
    let up = home.start("up --simulation dynamic").see("Ctrl-C ends it.");
    let mode = "[set] [icmd] [cmod] 0 [vel]\n";
    home.run_with("rpc /wam/rpc:i", mode).with(0);
    let velocity = "([vmo] 0) (20.0)\n";
    home.run_with("write ... /wam/command:i", velocity).with(0);
    let deadline = Instant::now() + Duration::from_secs(60);
    let mut before = base(&home);
    loop {
        std::thread::sleep(Duration::from_millis(300));
        let now = base(&home);
        if (now - before).abs() < 0.01 && now > 5.0 {
            break;
        }
        assert!(Instant::now() < deadline, "still moving, at {now}");
        before = now;
    }
    // Its limit is at 149.
    let rest = base(&home);
    assert!(rest < 120.0, "it went on to {rest}");
    up.signal("TERM").finish().with(0);
}

#[test]
fn wider_settings_are_logged_and_contradictions_refused() {
    let home = Home::new();
    let up = home
        .start("up --simulation dynamic --no-guard")
        .see("Ctrl-C ends it.");
    let ended = up.signal("TERM").finish().with(0);
    ended.complains("no guards in front of the arm");
    home.run("up --guard --no-guard").with(1);
    let ended = home.run("up --arm-config /nowhere/arm.ini").with(1);
    ended.complains("/nowhere/arm.ini");
}
