//! Commands without valid arguments print stock 3.5.0's messages.

use crate::common;

use common::Home;

#[track_caller]
fn check(line: &str, code: i32, expected: &[&str]) {
    let ended = Home::new().run(line).with(code);
    assert_eq!(ended.out, expected, "{line}");
}

#[test]
fn commands_without_arguments() {
    check(
        "",
        0,
        &[
            "This is the YARP companion.",
            "Call with the argument \"help\" to see a list of ways to use this program.",
        ],
    );
    check("admin", 1, &["[ERROR] Please supply a command"]);
    check(
        "nonsense",
        255,
        &["[ERROR] Could not find command \"nonsense\""],
    );
}

#[test]
fn commands_with_missing_arguments() {
    let ports = "[ERROR] Please specify a port name";
    check("exists", 1, &[ports]);
    check("exists a b c", 1, &[ports]);
    check(
        "disconnect /a",
        1,
        &["[ERROR] Must have two arguments, a sender port and receiver port"],
    );
    check(
        "readwrite /a",
        1,
        &["[ERROR] Please supply the read and write port names"],
    );
    check(
        "write",
        1,
        &["[ERROR] Please supply the port name, and optionally some targets"],
    );
    check("conf x", 1, &["[ERROR] Command not understood"]);
    check("detect x", 1, &["[ERROR] Argument not understood"]);
    check(
        "rpcserver --nonsense /a",
        1,
        &["[ERROR] Option not recognized: --nonsense"],
    );
}

#[test]
fn every_command_is_listed_and_explained() {
    let home = Home::new();
    for line in ["help", "--help", "-h"] {
        let help = home.run(line).with(0);
        assert!(help.says("where            report where the yarp name server is running"));
        assert!(help.says("up               bring up a whole network with a simulated arm"));
    }
    for command in [
        "read",
        "write",
        "connect",
        "rpc",
        "up",
        "server",
        "namespace",
        "wait",
    ] {
        let help = home.run(&format!("{command} --help")).with(0);
        assert!(help.says(&format!("Usage: yarp {command}")), "{help:?}");
    }
    assert_eq!(home.file("yarp_namespace.conf"), None);
}
