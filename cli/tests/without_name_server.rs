//! Without a name server every command ends soon, and prints the reason.

use crate::common;

use common::Home;

fn homes() -> [Home; 2] {
    let away = Home::new();
    // No program listens on TCP port 1.
    std::fs::write(away.path().join("yarp.conf"), "127.0.0.1 1 yarp\n").unwrap();
    [Home::new(), away]
}

#[test]
fn where_suggests_solutions() {
    for home in homes() {
        let ended = home.run("where").with(1);
        assert!(ended.says("== PROBLEM"));
        assert!(ended.says("== $ yarp detect --write"));
    }
}

#[test]
fn queries_exit_with_failure() {
    for home in homes() {
        for line in [
            "exists /a",
            "exists /a /b",
            "connect /a /b",
            "disconnect /a /b",
            "connect --persist /a /b",
            "name list",
            "name query /a",
            "name register /a",
            "ping /a",
            "rpc /a",
            "topic --list",
            "clean",
        ] {
            let ended = home.run(line).with(1);
            assert!(!ended.err.is_empty(), "{line}: {ended:?}");
        }
    }
}

#[test]
fn ports_do_not_open_without_their_name_server() {
    let [_, away] = homes();
    for line in [
        "read /a",
        "write /a",
        "readwrite /a /b",
        "repeat /a",
        "rpcserver /a",
    ] {
        let ended = away.run(line).with(1);
        let failed = ended
            .err
            .iter()
            .any(|line| line.contains("failed to activate"));
        assert!(failed, "{line}: {ended:?}");
    }
}

#[test]
fn check_needs_no_name_server() {
    for home in homes() {
        let ended = home.run("check").with(0);
        assert!(ended.says("*** Read number 42"));
        assert!(ended.says("*** YARP seems okay, but there is no name server available."));
    }
}
