//! Persistent connections and topics are restored whenever one of their ends comes back.

use crate::common;

use common::{Home, Running};

/// Kills the writer, the reader and both, and restarts them; each time messages flow again.
fn check(home: &Home, carrier: &str) {
    let reader = || home.start("read /r").see("Port /r active at");
    let writer = || home.start("write /w").see("Port /w active at");
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
    home.run(&format!("exists /w {carrier}://r")).with(0);
}

#[test]
fn persistent_connections_are_restored() {
    let home = Home::new();
    let _server = home.serve();
    home.run("connect --persist /w /r").with(0);
    check(&home, "tcp");
}

#[test]
fn persistent_connections_keep_their_carrier() {
    let home = Home::new();
    let _server = home.serve();
    home.run("connect --persist /w /r fast_tcp").with(0);
    check(&home, "fast_tcp");
}

#[test]
fn topics_connect_ports_that_appear() {
    let home = Home::new();
    let _server = home.serve();
    home.run("topic /t").with(0);
    home.run("connect /w topic://t").with(0);
    home.run("connect topic://t /r").with(0);
    check(&home, "tcp");
}
