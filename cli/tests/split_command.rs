//! `yarp split` splits messages into elements.

use crate::common;

use std::time::Duration;

use common::{Home, Running};

/// Sends the same message until `other` prints `expected`: the connection may not exist yet.
fn repeat(writer: &mut Running, other: &mut Running, expected: &str) {
    for _ in 0..200 {
        writer.type_text("alpha two (3 4)\n");
        if other.sees_within(expected, Duration::from_millis(300)) {
            return;
        }
    }
    panic!("no {expected:?} in {:?}", other.printed());
}

#[test]
fn each_element_is_sent_from_its_port() {
    let home = Home::new();
    let _server = home.serve();
    let mut writer = home.start("write /w").see("Port /w active at");
    let mut splitter = home
        .start("split /w --carrier tcp")
        .see("Waiting for data..");
    writer = writer.see("Sending output");
    repeat(&mut writer, &mut splitter, "Ready");
    splitter = splitter.see("Received a Bottle of 3 elements.");
    for (element, expected) in ["alpha", "two", "(3 4)"].iter().enumerate() {
        let remote = format!("/w/split{element}:o");
        let mut reader = home.start(&format!("read ... {remote}"));
        assert!(reader.sees("Receiving input"));
        repeat(&mut writer, &mut reader, expected);
        drop(reader.see_often(expected, 1));
    }
    writer.type_text("1 2\n");
    splitter = splitter.see("[ERROR] Data with invalid size received.");
    splitter.signal("INT").finish().with(0);
    let names = home.names();
    let left = names.iter().any(|name| name.starts_with("/w/"));
    assert!(!left, "{names:?}");
}

#[test]
fn splitting_a_missing_port_fails() {
    let home = Home::new();
    let _server = home.serve();
    assert!(
        home.run("split /nothing")
            .with(255)
            .says("[ERROR] Failed to connect.")
    );
}
