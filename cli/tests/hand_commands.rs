//! A simulated hand and its servers, each in its own process.

#![cfg(unix)]

use crate::common;

use std::process::Command;
use std::time::{Duration, Instant};

use common::Home;
use yarp_devices::Hand;
use yarp_devices::hand::node::{RemoteHand, RemoteHandOptions};

const TIMEOUT: Duration = Duration::from_secs(60);

#[test]
fn a_finger_moves_by_rpc_and_through_the_hand_server() {
    let home = Home::new();
    let line = home.path().join("line-of-the-hand");
    let line = line.to_str().expect("its name is text");
    let there = home
        .start(&format!("hand-sim --link {line} --speed 2"))
        .see(line);
    let server = home.serve();

    let board = home
        .start(&format!("hand-board --serial {line}"))
        .see("served as /hand");
    let moved = home.run_with("rpc /hand/rpc:i", "[set] [pos] 2 30.0\n");
    assert!(moved.says("Response: [ok]"), "{moved:?}");
    // On a busy machine the finger may pass its target first; the spread is blocked by closed fingers.
    let begin = Instant::now();
    while !home
        .run_with("rpc /hand/rpc:i", "[get] [don] 2\n")
        .with(0)
        .says("[don] 1")
    {
        assert!(begin.elapsed() < TIMEOUT, "the finger does not arrive");
    }
    let axes = home.run_with("rpc /hand/rpc:i", "[get] [axes]\n").with(0);
    assert!(axes.says("[is] [axes] 4"), "{axes:?}");
    let grasp = home
        .run_with("rpc /hand/hand/rpc:i", "grasp rect\n")
        .with(0);
    assert!(grasp.says("Response: [ok]"), "{grasp:?}");
    let stopped = home.run_with("rpc /hand/stop/rpc:i", "stop\n").with(0);
    assert!(stopped.says("[ok] stopped"), "{stopped:?}");
    let refused = home.run_with("rpc /hand/hand/rpc:i", "grasp peg\n");
    assert!(refused.says("software stop"), "{refused:?}");
    let released = home.run_with("rpc /hand/stop/rpc:i", "release\n").with(0);
    assert!(released.says("[ok] released"), "{released:?}");
    let where_it_is = home
        .run_with("rpc /hand/hand/rpc:i", "gcl 4FGET P\n")
        .with(0);
    assert!(
        where_it_is.says("Response: [ok] \"1500\""),
        "{where_it_is:?}"
    );
    board.signal("TERM").finish().with(0);

    let options = RemoteHandOptions::new()
        .connect_timeout(TIMEOUT)
        .motion_timeout(TIMEOUT);
    let remote = RemoteHand::listen("127.0.0.1:0", options).expect("a port is free");
    let place = remote.address();
    let node = home
        .start(&format!("hand-node --serial {line} --driver {place}"))
        .see("looking for a driver");
    remote.initialise().expect("a hand is behind the server");
    assert_eq!(remote.finger_positions().expect("it answers"), [0.0; 4]);
    node.signal("TERM").finish().with(0);
    there.signal("TERM").finish().with(0);
    drop(server);
}

/// Without a reader of its output the command ends, and its names are unregistered.
#[test]
fn a_hand_without_output_leaves_no_names() {
    let home = Home::new();
    let line = home.path().join("line-of-the-hand");
    let line = line.to_str().expect("its name is text");
    let _there = home
        .start(&format!("hand-sim --link {line} --speed 2"))
        .see(line);
    let _server = home.serve();
    let mut command = Command::new("sh");
    let yarp = env!("CARGO_BIN_EXE_yarp");
    command.args([
        "-c",
        &format!("exec {yarp} hand-board --serial {line} >/dev/full"),
    ]);
    let board = home.spawn(command, "hand-board, without output");
    home.run_until("name query /hand/rpc:i", "registration name");
    board.signal("INT").finish().with(0);
    assert_eq!(home.names(), Vec::<String>::new());
}

#[test]
fn a_missing_serial_port_is_reported() {
    let home = Home::new();
    let told = home.run("hand-node --serial /nowhere/hand").with(1);
    assert!(told.err[0].contains("/nowhere/hand"), "{told:?}");
}
