//! `yarp up` starts everything, or prints one line with the reason.

#![cfg(unix)]

use crate::common;

use common::Home;
use yarp_testing::eventually;

const PORTS: [&str; 9] = [
    "view",
    "view/in:i",
    "rpc:i",
    "nws/rpc:i",
    "command:i",
    "state:o",
    "stateExt:o",
    "async:o",
    "stop/rpc:i",
];

#[test]
fn with_a_name_server_of_its_own() {
    let home = Home::new();
    let up = home
        .start("up --name /robot/left_arm")
        .see("Ctrl-C ends it.");
    assert!(
        home.run("where")
            .with(0)
            .says("Name server /root is available")
    );
    let names = home.names();
    for port in PORTS {
        assert!(
            names.contains(&format!("/robot/left_arm/{port}")),
            "{names:?}"
        );
    }
    let axes = home
        .run_with("rpc /robot/left_arm/rpc:i", "[get] [axes]\n")
        .with(0);
    assert!(axes.says("[is] [axes] 7"), "{axes:?}");
    let ended = up.signal("TERM").finish().with(0);
    assert!(ended.says("started here") && ended.says("/robot/left_arm/state:o"));
    home.run("where").with(1);
}

/// The address comes before everything else, also before the log; the page is served.
#[test]
fn the_first_line_is_the_address_of_the_live_view() {
    let home = Home::new();
    let up = home.start("up").see("Ctrl-C ends it.");
    let ended = up.signal("TERM").finish().with(0);
    let address = ended.out[0].strip_prefix("Live view: http://");
    assert!(
        address.is_some_and(|address| address.ends_with('/')),
        "{ended:?}"
    );
    assert!(ended.says("Port /wam/view active at"), "{ended:?}");
}

#[test]
fn without_a_live_view() {
    let home = Home::new();
    let up = home.start("up --no-view").see("Ctrl-C ends it.");
    assert_eq!(home.names().len(), PORTS.len() - 2);
    let ended = up.signal("TERM").finish().with(0);
    assert!(!ended.says("Live view"), "{ended:?}");
    home.run("up --no-view --control").with(1);
}

#[test]
fn with_an_arm_that_has_masses_and_friction() {
    let home = Home::new();
    let up = home.start("up --simulation dynamic").see("Ctrl-C ends it.");
    let modes = home
        .run_with("rpc /wam/rpc:i", "[get] [icmd] [cmod] 0\n")
        .with(0);
    assert!(modes.says("[pos]"), "{modes:?}");
    up.signal("TERM").finish().with(0);
    home.run("up --simulation ghost").with(1);
}

#[test]
fn with_an_arm_without_a_wrist() {
    let home = Home::new();
    let up = home
        .start("up --joints 4 --simulation dynamic --cartesian")
        .see("Ctrl-C ends it.");
    let axes = home.run_with("rpc /wam/rpc:i", "[get] [axes]\n").with(0);
    assert!(axes.says("[is] [axes] 4"), "{axes:?}");
    let asked = home.run_with("rpc /cartController/wam/rpc:i", "[get] [dof]\n");
    assert!(asked.with(0).says("[ack] (1 1 1 1)"));
    let ended = up.signal("TERM").finish().with(0);
    assert!(
        ended.says("Simulated WAM arm /wam, four joints"),
        "{ended:?}"
    );
    let refused = home.run("up --joints 6").with(1);
    assert!(refused.err[0].contains("expected 4 or 7"), "{refused:?}");
}

#[test]
fn with_an_arm_that_is_brought_up_like_a_real_one() {
    let home = Home::new();
    let up = home
        .start("up --simulation real --home-confirmed")
        .see("Ctrl-C ends it.");
    let asked = "[get] [icmd] [cmod] 0\n";
    let before = home.run_with("rpc /wam/rpc:i", asked).with(0);
    assert!(before.says("[hwfa]"), "not active: {before:?}");
    let pressed = home.run("wam press activate").with(0);
    assert!(pressed.says("the pendant shows: active"), "{pressed:?}");
    eventually("the motors follow", || {
        home.run_with("rpc /wam/rpc:i", asked).with(0).says("[pos]")
    });
    let refused = home.run("wam press party").with(1);
    assert!(refused.says("activate"), "{refused:?}");
    home.run("wam press power-off").with(0);
    eventually("no puck answers", || {
        home.run_with("rpc /wam/rpc:i", "[get] [encs]\n")
            .says("[fail]")
    });
    let ended = up.signal("TERM").finish().with(0);
    assert!(
        ended.says("yarp wam press activate --name /wam"),
        "{ended:?}"
    );
}

#[test]
fn a_real_arm_has_no_button_that_a_program_presses() {
    let home = Home::new();
    let up = home.start("up --simulation dynamic").see("Ctrl-C ends it.");
    home.run("wam press activate").with(1);
    up.signal("TERM").finish().with(0);
}

#[test]
fn with_a_controller_of_the_tool() {
    let home = Home::new();
    let up = home.start("up --cartesian").see("Ctrl-C ends it.");
    assert_eq!(home.names().len(), PORTS.len() + 4);
    let lines =
        "[set] [time] 100.0\n[go] [xyz] 0 (0.4 0.1 0.4)\n[get] [done]\n[stop]\n[get] [done]\n";
    let asked = home
        .run_with("rpc /cartController/wam/rpc:i", lines)
        .with(0);
    assert!(
        asked.says("[ack] [fals]") && asked.says("[ack] [true]"),
        "{asked:?}"
    );
    let ended = up.signal("TERM").finish().with(0);
    assert!(ended.says("/cartController/wam/events:o"), "{ended:?}");
}

/// The log once named a refused command without saying that it was refused, or why.
#[test]
fn refused_commands_are_logged_with_their_reason() {
    let home = Home::new();
    let up = home.start("up --cartesian").see("Ctrl-C ends it.");
    let lines = "[set] [icmd] [cmod] 0 [posd]\n[set] [pos] 0 10.0\n";
    let asked = home.run_with("rpc /wam/rpc:i", lines).with(0);
    assert!(asked.says("[fail]"), "{asked:?}");
    let lines = "[go] [xyz] 9999.0 (0.4 0.1 0.4)\n";
    let asked = home
        .run_with("rpc /cartController/wam/rpc:i", lines)
        .with(0);
    assert!(asked.says("[nack]"), "{asked:?}");
    let ended = up.signal("TERM").finish().with(0);
    // The first one is a warning.
    let mut warnings = ended.err.iter();
    let line = warnings.find(|line| line.contains("[set] [pos] 0 10.0"));
    let reason = "refused: joint 0 is in ";
    assert!(line.is_some_and(|line| line.contains(reason)), "{ended:?}");
    let line = ended.err.iter().find(|line| line.contains("[go] [xyz]"));
    assert!(
        line.is_some_and(|line| line.contains("refused: ")),
        "{ended:?}"
    );
}

#[test]
fn with_a_running_name_server() {
    let home = Home::new();
    let _server = home.serve();
    let up = home.start("up").see("Ctrl-C ends it.");
    assert_eq!(home.names().len(), PORTS.len());
    let second = home.run("up").with(1);
    assert_eq!(second.err.len(), 1, "{second:?}");
    assert!(second.err[0].contains("/wam/rpc:i"), "{second:?}");
    assert_eq!(home.names().len(), PORTS.len());
    let ended = up.signal("INT").finish().with(0);
    assert!(ended.says("was there"));
    assert!(home.names().is_empty());
}

#[test]
fn invalid_arguments_are_refused() {
    let home = Home::new();
    home.run("up --name wam").with(1);
    std::fs::write(home.path().join("yarp.conf"), "garbage\n").unwrap();
    let refused = home.run("up").with(1);
    assert!(refused.err[0].contains("yarp.conf:1"), "{refused:?}");
}

#[test]
fn a_port_in_use_is_reported() {
    let home = Home::new();
    let listener = std::net::TcpListener::bind("0.0.0.0:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    home.run(&format!("conf 127.0.0.1 {port}")).with(0);
    let refused = home.run("up").with(1);
    assert_eq!(refused.err.len(), 1, "{refused:?}");
    assert!(refused.err[0].contains(&port.to_string()), "{refused:?}");
}
