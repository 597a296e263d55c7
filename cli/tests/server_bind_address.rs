//! A name server that listens on one address of the machine.

use crate::common;

use std::net::TcpListener;

use common::Home;

/// Returns a port that is in use on one address and free on others.
fn taken() -> (TcpListener, u16) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let number = listener.local_addr().unwrap().port();
    (listener, number)
}

#[test]
fn it_listens_on_one_address_and_announces_it() {
    let home = Home::new();
    let (elsewhere, number) = taken();
    // Listening on all addresses is impossible: another socket listens on one of them.
    let words = format!("server --ip 127.0.0.1 --socket {number} --write");
    let ended = home.run(&words).with(1);
    let conflict = |line: &String| line.contains("address conflict");
    assert!(ended.err.iter().any(conflict), "{ended:?}");
    let words = format!("server --bind 127.0.0.2 --socket {number} --write");
    let server = home.start(&words).see("Ok. Ready!");
    let place = format!("127.0.0.2 {number} yarp\n");
    assert_eq!(home.file("yarp.conf"), Some(place));
    let own = format!("registration name /root ip 127.0.0.2 port {number} type tcp");
    assert!(home.run("name query /root").with(0).says(&own));
    assert!(
        home.run("name get /root ips")
            .with(0)
            .says("ips = 127.0.0.2")
    );
    let ended = server.signal("INT").finish().with(0);
    // The server once announced the default address instead.
    assert!(
        ended.says(&format!("Port /root active at tcp://127.0.0.2:{number}/")),
        "{ended:?}"
    );
    let warned = |line: &String| line.contains("No auth.conf");
    assert!(
        !ended.err.iter().any(warned),
        "nobody else can reach it: {ended:?}"
    );
    drop(elsewhere);
}

#[test]
fn another_address_can_be_advertised() {
    let home = Home::new();
    let (elsewhere, number) = taken();
    let words = format!("server --bind 127.0.0.2 --advertise 127.0.0.1 --socket {number} --write");
    let server = home.start(&words).see("Ok. Ready!");
    assert_eq!(
        home.file("yarp.conf"),
        Some(format!("127.0.0.1 {number} yarp\n"))
    );
    std::fs::write(
        home.path().join("yarp.conf"),
        format!("127.0.0.2 {number}\n"),
    )
    .unwrap();
    let own = format!("registration name /root ip 127.0.0.1 port {number} type tcp");
    assert!(home.run("name query /root").with(0).says(&own));
    drop((elsewhere, server));
}

#[test]
fn foreign_addresses_are_refused() {
    let home = Home::new();
    let ended = home
        .run("server --local --bind localhost --socket 1")
        .with(1);
    assert!(ended.says("--bind: expected an IPv4 address"), "{ended:?}");
    let (_elsewhere, number) = taken();
    let words = format!("server --local --memory --bind 192.0.2.77 --socket {number}");
    let ended = home.run(&words).with(1);
    assert!(
        ended
            .err
            .iter()
            .any(|line| line.contains("192.0.2.77") && !line.contains("conflict")),
        "{ended:?}"
    );
}

/// It took the host from the configuration and the TCP port from elsewhere, and then asked for `--read`.
#[test]
fn read_takes_host_and_port_from_the_configuration() {
    let home = Home::new();
    let server = home.serve();
    let before = home.file("yarp.conf");
    server.signal("TERM").finish().with(0);
    let again = home.start("server --read --memory").see("Ok. Ready!");
    assert_eq!(home.file("yarp.conf"), before);
    home.run("where").with(0);
    again.signal("TERM").finish().with(0);
    let empty = Home::new();
    empty.run("server --read --memory").with(1);
}
