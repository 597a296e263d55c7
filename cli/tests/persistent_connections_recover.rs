//! Persistent connections and topics are restored whenever one of their ends comes back.

use crate::common;

use common::{Home, Running};

/// Kills the writer, the reader and both, and restarts them; each time messages flow again.
///
/// Each test has names of its own: the number of a killed port may go to a port of another test at once, and would be
/// taken for the killed one if its name were the same.
fn check(home: &Home, carrier: &str, test: &str) {
    let port = |command: &str, name: &str| {
        let started = home.start(&format!("{command} {name}"));
        started.see(&format!("Port {name} active at"))
    };
    let reader = || port("read", &format!("/{test}/r"));
    let writer = || port("write", &format!("/{test}/w"));
    let mut ends: (Running, Running) = (writer(), reader());
    ends.0.reaches(&mut ends.1, "at first");
    ends.1.kill();
    ends.1 = reader();
    ends.0.reaches(&mut ends.1, "the reader is back");
    ends.0.kill();
    ends.0 = writer();
    ends.0.reaches(&mut ends.1, "the writer is back");
    ends.0.kill();
    ends.1.kill();
    ends = (writer(), reader());
    ends.0.reaches(&mut ends.1, "both are back");
    // And after an orderly end.
    ends.1.signal("INT").finish().with(0);
    ends.1 = reader();
    ends.0.reaches(&mut ends.1, "once more");
    home.run(&format!("exists /{test}/w {carrier}://{test}/r"))
        .with(0);
}

#[test]
fn persistent_connections_are_restored() {
    let home = Home::new();
    let _server = home.serve();
    home.run("connect --persist /restored/w /restored/r")
        .with(0);
    check(&home, "tcp", "restored");
}

#[test]
fn persistent_connections_keep_their_carrier() {
    let home = Home::new();
    let _server = home.serve();
    home.run("connect --persist /carrier/w /carrier/r fast_tcp")
        .with(0);
    check(&home, "fast_tcp", "carrier");
}

#[test]
fn topics_connect_ports_that_appear() {
    let home = Home::new();
    let _server = home.serve();
    home.run("topic /t").with(0);
    home.run("connect /topic/w topic://t").with(0);
    home.run("connect topic://t /topic/r").with(0);
    check(&home, "tcp", "topic");
}
