//! The software stop is served beside every arm that a command moves, on a port of its own.

#![cfg(unix)]

use crate::common;

use common::{Home, Running};

/// The stop ends a move, keeps the next one away, and is gone with the command.
#[track_caller]
fn stops(home: &Home, serving: Running, name: &str) {
    let port = format!("{name}/stop/rpc:i");
    let moved = |answer: &str| {
        let told = home.run_with(
            &format!("rpc {name}/rpc:i"),
            "[get] [axes]\n[set] [pos] 0 1.0\n",
        );
        assert!(told.says(answer), "{told:?}");
    };
    moved("[ok]");
    let stopped = home.run_with(&format!("rpc {port}"), "stop\n").with(0);
    assert!(stopped.says("[ok] stopped"), "{stopped:?}");
    moved("[fail]");
    home.run(&format!("wam release --name {name}")).with(0);
    moved("[ok]");
    serving.signal("TERM").finish();
    assert!(!home.names().contains(&port));
}

#[test]
fn dev_serves_the_stop_of_what_moves() {
    for device in ["simulatedWam", "dynamicWam", "fakeMotionControl"] {
        let home = Home::new();
        let _server = home.serve();
        let dev = home
            .start(&format!("dev --device {device} --name /arm --nopark"))
            .see("device active");
        stops(&home, dev, "/arm");
    }
}

#[test]
fn dev_serves_no_stop_of_a_camera() {
    let home = Home::new();
    let _server = home.serve();
    let _dev = home
        .start("dev --device fakeFrameGrabber --name /eye")
        .see("device active");
    assert!(!home.names().iter().any(|name| name.contains("/stop/")));
}

/// A board of two arms stops both, whichever joints it shows.
#[test]
fn robotinterface_serves_the_stop_of_boards() {
    let home = Home::new();
    let _server = home.serve();
    let text = r#"
[robot]
name = "two"
portprefix = "/two"
[[device]]
name = "left"
type = "simulatedWam"
[[device]]
name = "right"
type = "dynamicWam"
[[device]]
name = "left_nws"
type = "controlBoard_nws_yarp"
params = { name = "/two/left" }
action = [{ phase = "startup", level = 5, type = "attach", params = { networks = ["part"], part = "left" } }]
[[device]]
name = "both"
type = "controlboardremapper"
params = { networks = ["l", "r"], joints = 2, l = [0, 0, 3, 3], r = [1, 1, 3, 3] }
action = [{ phase = "startup", level = 5, type = "attach", params = { networks = ["l", "r"], l = "left", r = "right" } }]
[[device]]
name = "both_nws"
type = "controlBoard_nws_yarp"
params = { name = "/two/both" }
action = [{ phase = "startup", level = 6, type = "attach", params = { networks = ["part"], part = "both" } }]
"#;
    let file = home.path().join("two.toml");
    std::fs::write(&file, text).unwrap();
    let robot = home
        .start(&format!("robotinterface --config {}", file.display()))
        .see("running happily");
    let ask = |port: &str, request: &str| {
        let told = home.run_with(&format!("rpc {port}"), &format!("{request}\n"));
        told.with(0).out.join("\n")
    };
    let told = ask("/two/both/stop/rpc:i", "stop");
    assert!(told.contains("[ok] stopped"), "{told}");
    // The left arm has a board of its own, which is stopped too.
    let told = ask("/two/left/stop/rpc:i", "status");
    assert!(told.contains("stopped"), "{told}");
    let told = ask("/two/both/rpc:i", "[set] [pos] 1 150.0");
    assert!(told.contains("[fail]"), "{told}");
    // One of two arms is released: the board does not count as stopped.
    ask("/two/left/stop/rpc:i", "release");
    let told = ask("/two/both/stop/rpc:i", "status");
    assert!(told.contains("released"), "{told}");
    ask("/two/both/stop/rpc:i", "release");
    stops(&home, robot, "/two/left");
}

/// The PC in the arm stops it beside the driver, whose commands are refused then.
#[test]
fn wam_node_serves_the_stop_of_its_arm() {
    let home = Home::new();
    let ports = super::embedded_arm_processes::free_ports();
    let up = home
        .start(&format!("up --arm embedded --ports {ports}"))
        .see("Ctrl-C ends it.");
    let node = home
        .start(&format!(
            "wam-node --arm simulated --name /inside --ports {ports}"
        ))
        .see("/inside/stop/rpc:i stops the arm.")
        .see("The driver is connected.");
    let answered = |question: &str, answer: &str| {
        (0..600).any(|_| {
            let told = home.run_with("rpc /wam/rpc:i", &format!("{question}\n"));
            told.says(answer)
        })
    };
    assert!(answered("[get] [icmd] [cmod] 3", "[pos]"));
    assert!(answered("[set] [pos] 3 100.0", "[ok]"));
    home.run("wam stop --name /inside").with(0);
    let place = || {
        let told = home
            .run_with("rpc /wam/rpc:i", "[get] [enc] 3\n")
            .out
            .join(" ");
        let value = told
            .split("[enc] ")
            .nth(1)
            .and_then(|rest| rest.split(' ').next());
        value.map(|value| value.parse::<f64>().unwrap())
    };
    let rests = (0..600).any(|_| place().is_some() && place() == place());
    assert!(rests, "{:?}", place());
    assert!(answered("[set] [pos] 3 90.0", "[fail]"));
    home.run("wam release --name /inside").with(0);
    assert!(answered("[set] [pos] 3 90.0", "[ok]"));
    node.signal("TERM").finish().with(0);
    up.signal("TERM").finish().with(0);
}

/// The arm does not depend on the network: its PC serves it without a name server, and says what is missing.
#[test]
fn wam_node_needs_no_name_server() {
    let home = Home::new();
    let ports = super::embedded_arm_processes::free_ports();
    let line = format!("wam-node --arm simulated --listen 127.0.0.1 --ports {ports}");
    let node = home.start(&line).see("Ctrl-C ends it.");
    let ended = node.signal("TERM").finish().with(0);
    assert!(
        ended
            .err
            .iter()
            .any(|line| line.contains("the software stop has no port")),
        "{ended:?}"
    );
    let refused = home.run(&format!("{line} --name /inside"));
    assert_ne!(refused.code, Some(0), "{refused:?}");
}
