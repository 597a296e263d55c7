//! The server hands out the TCP ports of its range, and ports use no others.

use std::io::ErrorKind;

use yarp_nameserver::{Server, ServerOptions};
use yarp_ports::{Port, PortError, PortOptions};

/// Returns a TCP port in use by a program unknown to the name server.
fn stranger() -> (std::net::TcpListener, u16) {
    let listener = std::net::TcpListener::bind("0.0.0.0:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    (listener, port)
}

/// Returns such a port with free ports above it.
fn stranger_with_room(room: u16) -> (std::net::TcpListener, u16) {
    loop {
        let (listener, port) = stranger();
        if port < u16::MAX - room {
            return (listener, port);
        }
    }
}

#[tokio::test]
async fn numbers_in_use_are_skipped_within_the_range() {
    let (_stranger, first) = stranger_with_room(20);
    let range = first..=first + 20;
    let options = ServerOptions::default().at("127.0.0.1", 0);
    let server = Server::start(options.port_range(range.clone()))
        .await
        .unwrap();
    let network = server.network();
    let port = Port::open(&network, "/p", PortOptions::new())
        .await
        .unwrap();
    assert!(range.contains(&port.tcp_port()) && port.tcp_port() != first);
    assert_eq!(network.query("/p").await.unwrap().port, port.tcp_port());
    // Names used in between are gone.
    let names = server.registrations();
    let names: Vec<_> = names.iter().map(|held| held.name.as_str()).collect();
    assert_eq!(names, ["/p", "/root", "fallback"]);
    // The same name again: its last number is free again.
    let number = port.tcp_port();
    port.close().await;
    let again = Port::open(&network, "/p", PortOptions::new())
        .await
        .unwrap();
    assert!(
        range.contains(&again.tcp_port()) && again.tcp_port() != first,
        "{number}"
    );
}

/// Another robot's ports on the same machine.
#[tokio::test]
async fn a_hundred_numbers_in_a_row_are_skipped() {
    let (mut strangers, mut first) = (Vec::new(), 0);
    while strangers.len() < 100 {
        strangers.clear();
        first = stranger_with_room(120).1;
        let numbers = first..first + 100;
        let listen = |number| std::net::TcpListener::bind(("0.0.0.0", number));
        strangers.extend(numbers.map_while(|number| listen(number).ok()));
    }
    let options = ServerOptions::default().at("127.0.0.1", 0);
    let server = Server::start(options.port_range(first..=first + 120))
        .await
        .unwrap();
    let network = server.network();
    let port = Port::open(&network, "/p", PortOptions::new())
        .await
        .unwrap();
    assert!(port.tcp_port() >= first + 100, "{}", port.tcp_port());
    let names = server.registrations();
    assert_eq!(names.len(), 3, "{names:?}");
}

#[tokio::test]
async fn anonymous_names_are_kept_when_their_number_is_in_use() {
    // It was handed out in between, and returned.
    let (_stranger, first) = stranger_with_room(20);
    let options = ServerOptions::default().at("127.0.0.1", 0);
    let server = Server::start(options.port_range(first..=first + 20))
        .await
        .unwrap();
    let network = server.network();
    let port = Port::open(&network, "...", PortOptions::new())
        .await
        .unwrap();
    assert_ne!(port.tcp_port(), first);
    let place = network.query(port.name()).await.unwrap();
    assert_eq!(place.port, port.tcp_port());
}

#[tokio::test]
async fn nothing_outside_the_range_is_used() {
    let (_stranger, only) = stranger();
    let options = ServerOptions::default().at("127.0.0.1", 0);
    let server = Server::start(options.port_range(only..=only))
        .await
        .unwrap();
    let network = server.network();
    let error = Port::open(&network, "/p", PortOptions::new())
        .await
        .unwrap_err();
    let PortError::Listen { number, source, .. } = &error else {
        panic!("{error:?}");
    };
    assert_eq!((*number, source.kind()), (only, ErrorKind::AddrInUse));
    let text = source.to_string();
    assert!(
        text.contains("so are 0 other TCP ports") && text.contains(&format!("{only}")),
        "the server's reason to assign no other: {text}"
    );
    assert!(
        network.query("/p").await.is_err(),
        "the name is left behind"
    );
}
