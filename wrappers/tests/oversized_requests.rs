//! A request or command of more than 256 KiB ends its connection, and the device is served on.

use crate::support;

use support::{Stage, eventually};
use yarp_devices::{Axes, Encoders};
use yarp_ports::PortOptions;
use yarp_wire::Bottle;

/// Writes messages to a port until the port ends the connection; returns true if it ended at the first.
fn is_refused(stage: &Stage, name: &str, to: &str, bytes: usize) -> bool {
    let writer = stage.port(name, PortOptions::new());
    let connected = stage.runtime.block_on(writer.connect(to));
    connected.expect("the port accepts connections");
    let message = Bottle::of("x".repeat(bytes));
    stage.runtime.block_on(writer.write(&message));
    // A connection that still takes a second message did not end at the first.
    let taken = stage.runtime.block_on(writer.write(&Bottle::of("small")));
    stage.runtime.block_on(writer.close());
    taken == 0
}

fn check(stage: &Stage, port: &str) {
    let tag = port.replace('/', "_");
    assert!(
        !is_refused(stage, &format!("/small{tag}"), port, 250 << 10),
        "{port} refuses 250 KiB"
    );
    assert!(
        is_refused(stage, &format!("/large{tag}"), port, 260 << 10),
        "{port} takes 260 KiB"
    );
}

#[test]
fn oversized_requests_end_their_connection() {
    let stage = Stage::new();
    let arm = stage.serve_arm();
    for suffix in ["rpc:i", "command:i"] {
        check(&stage, &format!("/wam/{suffix}"));
    }
    let remote = stage.remote("/after");
    eventually("a state", || remote.encoder_readings(Axes::All).is_ok());
    drop(remote);
    stage.runtime.block_on(arm.close());
    let camera = stage.serve_camera();
    check(&stage, "/grabber/rpc");
    stage.runtime.block_on(camera.close());
}
