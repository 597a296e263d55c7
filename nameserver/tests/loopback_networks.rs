//! Ports of a network whose name server is at a loopback address are reached from this machine alone.

use std::net::{Ipv4Addr, TcpStream};

use yarp_nameserver::{Server, ServerOptions};
use yarp_ports::{Port, PortOptions};

/// Another address of this machine than the one that ports listen at.
const OTHER: &str = "127.0.0.2";

fn reached(address: &str, number: u16) -> bool {
    TcpStream::connect((address, number)).is_ok()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn ports_listen_at_loopback_and_are_registered_there() {
    let server = Server::start(ServerOptions::default().at("127.0.0.1", 0)).await;
    let server = server.unwrap();
    assert!(reached("127.0.0.1", server.port()) && !reached(OTHER, server.port()));
    let network = server.network();
    assert_eq!(network.listen_address(), Ipv4Addr::LOCALHOST);
    let port = Port::open(&network, "/p", PortOptions::new())
        .await
        .unwrap();
    assert!(reached("127.0.0.1", port.tcp_port()) && !reached(OTHER, port.tcp_port()));
    assert_eq!(network.query("/p").await.unwrap().host, "127.0.0.1");
    let ips = network.ask("get /p ips").await.unwrap();
    assert_eq!(ips.lines().next(), Some("port /p property ips = 127.0.0.1"));
    port.close().await;
    server.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn another_address_can_be_chosen() {
    let options = ServerOptions::default().at("127.0.0.1", 0);
    let server = Server::start(options.bind(Ipv4Addr::UNSPECIFIED)).await;
    let server = server.unwrap();
    assert!(reached(OTHER, server.port()), "explicitly at all addresses");
    let all = server.network().with_bind(Ipv4Addr::UNSPECIFIED);
    let port = Port::open(&all, "/all", PortOptions::new()).await.unwrap();
    assert!(reached("127.0.0.1", port.tcp_port()) && reached(OTHER, port.tcp_port()));
    port.close().await;
    let other = server.network().with_bind(OTHER.parse().unwrap());
    let port = Port::open(&other, "/other", PortOptions::new())
        .await
        .unwrap();
    assert!(!reached("127.0.0.1", port.tcp_port()) && reached(OTHER, port.tcp_port()));
    assert_eq!(other.query("/other").await.unwrap().host, OTHER);
    port.close().await;
    // An option of the port goes before the network's.
    let options = PortOptions::new().address(OTHER.parse().unwrap());
    let port = Port::open(&all, "/one", options).await.unwrap();
    assert!(!reached("127.0.0.1", port.tcp_port()) && reached(OTHER, port.tcp_port()));
    port.close().await;
    server.close().await;
}
