//! A signal ends a command, and its names are unregistered.

#![cfg(unix)]

use crate::common;

use common::Home;

/// Exit code of `timeout` when the time was over.
const TIMED_OUT: i32 = 124;

#[track_caller]
fn check(line: &str, port: &str, code: i32) {
    let home = Home::new();
    let _server = home.serve();
    for signal in ["INT", "TERM", "HUP"] {
        let running = home.start(line).see(&format!("Port {port} active at"));
        let running = running.signal(signal).see("Interrupting...");
        running.finish().with(code);
        assert_eq!(home.names(), Vec::<String>::new(), "{line} {signal}");
    }
}

#[test]
fn read_exits_with_success() {
    check("read /a", "/a", 0);
}

#[test]
fn periodic_senders_exit_with_success() {
    check("sample --output /a --rate 20", "/a", 0);
    check("clock --name /a", "/a", 0);
    check("trafficgen /a", "/a", 0);
}

#[test]
fn other_commands_exit_with_failure() {
    check("write /a", "/a", 1);
    check("readwrite /a /b", "/b", 1);
    check("rpcserver /a", "/a", 1);
    check("rpc --client /a", "/a", 1);
    check("repeat /a", "/a", 1);
}

#[test]
fn the_name_server_exits_with_success() {
    let home = Home::new();
    home.serve().signal("TERM").finish().with(0);
    home.run("where").with(1);
}

/// `timeout` sends its signal twice, to the command and to its group: the second once ended the command before its names
/// were unregistered.
#[test]
fn names_are_unregistered_when_timeout_signals_twice() {
    let home = Home::new();
    let _server = home.serve();
    for line in ["read /a", "rpcserver /a", "camera --name /a"] {
        let mut command = std::process::Command::new("timeout");
        command.args(["--signal=TERM", "3", env!("CARGO_BIN_EXE_yarp")]);
        command.args(line.split_whitespace());
        let running = home.spawn(command, line);
        // Registered before the time is over.
        let registered = home.run_until("name list", " /a ");
        assert_eq!(registered.code, Some(0), "{line}");
        running.finish().with(TIMED_OUT);
        assert_eq!(home.names(), Vec::<String>::new(), "{line}");
    }
}

/// So do service managers and terminals that close; the second signal once ended serving commands at once.
#[test]
fn names_are_unregistered_by_serving_commands_that_are_signalled_twice() {
    let home = Home::new();
    let _server = home.serve();
    for line in [
        "camera --name /a",
        "dev --device fakeFrameGrabber --name /a",
        "run --server /a --insecure",
    ] {
        for signal in ["TERM", "HUP"] {
            let running = home.start(line);
            home.run_until("name list", " /a ");
            let running = running.signal(signal).signal(signal);
            running.finish().with(0);
            assert_eq!(home.names(), Vec::<String>::new(), "{line} {signal}");
        }
    }
}
