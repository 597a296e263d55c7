//! `yarp up --arm embedded` and `yarp wam-node`: an arm on the network whose PC is another process.

#![cfg(unix)]

use crate::common;

use std::net::TcpListener;

use common::Home;

/// Returns two free TCP ports.
pub(crate) fn free_ports() -> String {
    let listen = || TcpListener::bind("127.0.0.1:0").unwrap();
    let (one, other) = (listen(), listen());
    let port = |listener: &TcpListener| listener.local_addr().unwrap().port();
    format!("{},{}", port(&one), port(&other))
}

/// Sends a request to the arm until it replies `text`.
fn answers(home: &Home, arm: &str, question: &str, text: &str) {
    for _ in 0..600 {
        let told = home.run_with(&format!("rpc {arm}/rpc:i"), &format!("{question}\n"));
        if told.says(text) {
            return;
        }
    }
    panic!("{question} is not answered {text}");
}

#[test]
fn the_driver_reconnects_to_a_restarted_pc() {
    let home = Home::new();
    let ports = free_ports();
    let up = home
        .start(&format!("up --arm embedded --ports {ports}"))
        .see("run `yarp wam-node` on it")
        .see("Ctrl-C ends it.");
    // The PC is not connected yet.
    answers(&home, "/wam", "[get] [icmd] [cmod] 0", "[hwfa]");
    let line = format!("wam-node --arm simulated --ports {ports}");
    let node = home.start(&line).see("The driver is connected.");
    answers(&home, "/wam", "[get] [icmd] [cmod] 0", "[pos]");
    // If the machine stalls until the connection times out, the arm stops; so the command is
    // repeated.
    let arrived = (0..100).any(|_| {
        home.run_with("rpc /wam/rpc:i", "[set] [pos] 3 175.0\n");
        (0..50).any(|_| {
            let told = home.run_with("rpc /wam/rpc:i", "[get] [enc] 3\n");
            told.says("175.0") || told.says("174.99999") || told.says("175.00000")
        })
    });
    assert!(arrived);
    node.kill();
    answers(&home, "/wam", "[get] [icmd] [cmod] 0", "[hwfa]");
    let refused = home.run_with("rpc /wam/rpc:i", "[set] [pos] 3 170.0\n");
    assert!(!refused.says("[ok]"), "{refused:?}");
    let again = home.start(&line).see("The driver is connected.");
    answers(&home, "/wam", "[get] [icmd] [cmod] 0", "[pos]");
    let ended = up.signal("TERM").finish().with(0);
    assert!(ended.says("behind its PC"), "{ended:?}");
    let again = again.see("The driver is gone (");
    again.signal("TERM").finish().with(0);
}

/// Moves the tool through both PCs; no command is refused because the arm's own PC connects later.
#[test]
fn the_tool_moves_through_both_pcs() {
    let home = Home::new();
    let ports = free_ports();
    let up = home
        .start(&format!("up --arm embedded --cartesian --ports {ports}"))
        .see("bring the tool there")
        .see("Ctrl-C ends it.");
    let node = home
        .start(&format!("wam-node --arm dynamic --ports {ports}"))
        .see("The driver is connected.");
    answers(&home, "/wam", "[get] [icmd] [cmod] 0", "[pos]");
    let order = "[go] [xyz] 1.0 (-0.2 0.05 0.05)\n";
    let told = home.run_with("rpc /cartController/wam/rpc:i", order);
    assert!(told.says("[ack]"), "{told:?}");
    answers(&home, "/wam", "[get] [icmd] [cmod] 0", "[posd]");
    answers(&home, "/cartController/wam", "[get] [done]", "[ack] [true]");
    up.signal("TERM").finish().with(0);
    node.signal("TERM").finish().with(0);
}

#[test]
fn the_pc_listens() {
    let home = Home::new();
    let ports = free_ports();
    let node = home
        .start(&format!("wam-node --listen 127.0.0.1 --ports {ports}"))
        .see("dynamic WAM arm waits for the driver");
    let up = home
        .start(&format!(
            "up --arm embedded --connect localhost --ports {ports}"
        ))
        .see("Ctrl-C ends it.");
    let node = node.see("The driver is connected.");
    answers(&home, "/wam", "[get] [icmd] [cmod] 0", "[pos]");
    up.signal("TERM").finish().with(0);
    node.signal("INT").finish().with(0);
}

#[test]
fn contradicting_arguments_are_refused() {
    let home = Home::new();
    for line in [
        "wam-node --arm embedded",
        "wam-node --arm ghost",
        "wam-node --ports 1",
        "wam-node --listen 127.0.0.1 --connect localhost",
        "up --arm embedded --ports 1,2,3",
        "up --arm dynamic --simulation ideal",
    ] {
        home.run(line).with(1);
    }
}
