//! The server hands out the TCP ports of its range, and ports use no others.

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
    assert!(
        matches!(error, PortError::Listen { number, .. } if number == only),
        "{error:?}"
    );
    assert!(
        network.query("/p").await.is_err(),
        "the name is left behind"
    );
}
