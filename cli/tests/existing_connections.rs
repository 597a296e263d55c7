//! `yarp exists A B` finds a connection over any carrier; a carrier in front of the destination is required.

#![cfg(unix)]

use crate::common;

use common::Home;

#[test]
fn a_connection_exists_over_the_carrier_it_was_made_with() {
    let home = Home::new();
    let _server = home.serve();
    let _reader = home.start("read /r").see("active at");
    let _writer = home.start("sample --output /w --rate 10").see("active at");
    for carrier in [
        "tcp",
        "fast_tcp",
        "udp",
        "mcast",
        "text",
        "shmem",
        "tcp+log.in",
    ] {
        home.run("exists /w /r").with(1);
        home.run(&format!("connect /w /r {carrier}")).with(0);
        let found = home.run("exists /w /r").with(0);
        let lines: Vec<_> = [found.out, found.err].concat();
        let said = |text: &str| lines.iter().any(|line| line.contains(text));
        assert!(said(&format!("using carrier {carrier}")), "{lines:?}");
        assert!(!said("No connection"), "{carrier}: {lines:?}");
        let base = carrier.split('+').next().unwrap();
        home.run(&format!("exists /w {base}://r")).with(0);
        home.run(&format!("exists /w {carrier}://r")).with(0);
        let other = if base == "udp" { "tcp" } else { "udp" };
        home.run(&format!("exists /w {other}://r")).with(1);
        home.run("disconnect /w /r").with(0);
    }
}

/// Over these the reader connects to the writer, which the writer alone does not tell.
#[test]
fn a_connection_that_the_reader_made_exists() {
    let home = Home::new();
    let _server = home.serve();
    let _camera = home.start("camera --name /eye --width 32 --height 24");
    home.run_until("name query /eye", "registration");
    let _reader = home.start("read /r").see("active at");
    home.run("connect /eye /r mjpeg").with(0);
    home.run("exists /eye /r").with(0);
    home.run("exists /eye mjpeg://r").with(0);
    home.run("exists /eye tcp://r").with(1);
}

#[test]
fn the_reader_tells_why_it_refuses_a_monitor() {
    let home = Home::new();
    let _server = home.serve();
    let _reader = home.start("read /r").see("active at");
    let _writer = home.start("sample --output /w --rate 10").see("active at");
    let carrier = "tcp+recv.portmonitor+type.dll+file.nonesuch";
    let refused = home.run(&format!("connect /w /r {carrier}")).with(1);
    let lines = [refused.out, refused.err].concat().join(" ");
    assert!(
        lines.contains("there are no monitors") || lines.contains("no monitor"),
        "{lines}"
    );
    assert!(lines.contains("nonesuch"), "{lines}");
}
