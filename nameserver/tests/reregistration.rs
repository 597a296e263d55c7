//! Ports register again with a name server that was restarted without its names.

use std::net::TcpListener;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use yarp_nameserver::registry::{Body, Registry, Settings};
use yarp_nameserver::{Server, ServerOptions};
use yarp_ports::{Answer, Network, Port, PortOptions};
use yarp_wire::Bottle;
use yarp_wire::message::RawText;
use yarp_wire::name_service::{Command, Request};

const TIMEOUT: Duration = Duration::from_secs(90);

fn free_port() -> u16 {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    listener.local_addr().unwrap().port()
}

async fn is_back(network: &Network, port: &Port, type_name: &str) {
    let began = Instant::now();
    loop {
        if let Ok(place) = network.query(port.name()).await {
            assert_eq!(place.port, port.tcp_port());
            let property = network
                .ask(&format!("get {} type", port.name()))
                .await
                .unwrap();
            let line = property.lines().next().unwrap_or_default().to_owned();
            if line.ends_with(&format!("= {type_name}")) {
                return;
            }
        }
        assert!(
            began.elapsed() < TIMEOUT,
            "{} does not come back",
            port.name()
        );
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
}

#[tokio::test]
async fn with_a_server_of_ours() {
    let place = ServerOptions::default().at("127.0.0.1", free_port());
    let server = Server::start(place.clone()).await.unwrap();
    let network = Network::at("127.0.0.1", server.port());
    let options = || PortOptions::new().type_name("yarp/vector");
    let first = Port::open(&network, "/first", options()).await.unwrap();
    let closed = Port::open(&network, "/closed", options()).await.unwrap();
    closed.close().await;
    // A lease renewed between the two starts tells them apart.
    let began = Instant::now();
    while !server.port_statuses().iter().any(|known| known.leased) {
        assert!(began.elapsed() < TIMEOUT, "no lease");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    server.close().await;

    let server = Server::start(place).await.unwrap();
    is_back(&network, &first, "yarp/vector").await;
    assert!(network.query("/closed").await.is_err());
    first.close().await;
    assert!(network.query("/first").await.is_err());
    server.close().await;
}

/// Starts a stock-like name server, without leases and states.
async fn stock(number: u16, process: u32) -> Port {
    let registry = Arc::new(Mutex::new(Registry::new(Settings::at("127.0.0.1", number))));
    let handler = move |message: &mut yarp_ports::Received| {
        let bottle = message.bottle().unwrap_or_else(|_| Bottle::new());
        let mut request = Request::from_bottle(&bottle);
        if matches!(request.command, Command::Lease { .. }) {
            request.command = Command::Other(bottle);
        }
        if matches!(&request.command, Command::Get { name, .. } if name == "/root") {
            let line = format!("port /root property process = {process}");
            return Answer::reply(RawText(format!("{line}\r\n*** end of message\r\n")));
        }
        let mut registry = registry.lock().unwrap();
        match registry
            .handle(Instant::now(), Some(message.address), &request)
            .body
        {
            Body::Bottle(bottle) => Answer::reply(bottle),
            lines => Answer::reply(RawText(lines.into_text())),
        }
    };
    let options = PortOptions::new()
        .unregistered()
        .tcp_port(number)
        .handler(handler);
    let network = Network::at("127.0.0.1", number);
    Port::open(&network, "/root", options).await.unwrap()
}

#[tokio::test]
async fn with_a_server_of_stock() {
    let number = free_port();
    let server = stock(number, 1).await;
    let network = Network::at("127.0.0.1", number);
    let options = PortOptions::new().type_name("yarp/vector");
    let port = Port::open(&network, "/a", options).await.unwrap();
    server.close().await;
    let server = stock(number, 2).await;
    is_back(&network, &port, "yarp/vector").await;
    port.close().await;
    server.close().await;
}
