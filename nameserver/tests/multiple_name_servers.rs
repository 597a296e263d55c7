//! With several name servers, ports register with all of them and are found through any.

use std::io;
use std::path::Path;

use yarp_nameserver::{Server, ServerOptions};
use yarp_ports::config::{Configuration, Environment};
use yarp_ports::{Network, Port, PortError, PortOptions};
use yarp_wire::name_service::RegisterRequest;

async fn server(namespace: &str) -> Server {
    let options = ServerOptions::default().at("127.0.0.1", 0);
    Server::start(options.namespace(namespace)).await.unwrap()
}

/// Returns the network of a process configured for `/a` and `/b` at these ports.
fn network(a: u16, b: u16) -> Network {
    let variables = [("YARP_CONFIG_HOME", "/c"), ("YARP_NAMESPACE", "/a /b")];
    let read = |file: &Path| match file.to_str() {
        Some("/c/_a.conf") => Ok(format!("127.0.0.1 {a} yarp\n")),
        Some("/c/_b.conf") => Ok(format!("127.0.0.1 {b} yarp\n")),
        _ => Err(io::ErrorKind::NotFound.into()),
    };
    let environment = variables.into_iter().collect::<Environment>();
    Network::from_configuration(Configuration::load(environment, read).unwrap())
}

/// Returns a TCP port on which no program listens.
fn nobody() -> u16 {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    listener.local_addr().unwrap().port()
}

#[tokio::test]
async fn a_port_is_known_to_every_server_until_it_closes() {
    let (a, b) = (server("/a").await, server("/b").await);
    let network = network(a.port(), b.port());
    assert_eq!(
        (network.namespace(), network.server().unwrap().1),
        ("/a", a.port())
    );
    for name in ["/p", "..."] {
        let port = Port::open(&network, name, PortOptions::new())
            .await
            .unwrap();
        for server in [&a, &b] {
            let place = server.network().query(port.name()).await.unwrap();
            assert_eq!(place.port, port.tcp_port());
            let ips = format!("get {} ips", port.name());
            let answer = server.network().ask(&ips).await.unwrap();
            assert!(answer.property().is_some_and(|ips| !ips.values.is_empty()));
        }
        let name = port.name().to_owned();
        port.close().await;
        for server in [&a, &b] {
            let gone = server.network().query(&name).await;
            assert!(matches!(gone, Err(PortError::Unknown { .. })), "{gone:?}");
        }
    }
}

#[tokio::test]
async fn a_port_is_found_through_the_first_server_that_knows_it() {
    let (a, b) = (server("/a").await, server("/b").await);
    let network = network(a.port(), b.port());
    let register = |server: &Server, name: &str, number: u16| {
        let asking = RegisterRequest {
            number: Some(number.into()),
            ..RegisterRequest::named(name)
        };
        let network = server.network();
        async move { network.register(asking).await.unwrap() }
    };
    register(&a, "/both", 1111).await;
    register(&b, "/both", 2222).await;
    register(&b, "/only", 3333).await;
    assert_eq!(network.query("/both").await.unwrap().port, 1111);
    assert_eq!(network.query("/only").await.unwrap().port, 3333);
    assert_eq!(network.query("/b").await.unwrap().port, b.port());
    let unknown = network.query("/none").await;
    assert!(
        matches!(unknown, Err(PortError::Unknown { .. })),
        "{unknown:?}"
    );
}

#[tokio::test]
async fn one_unreachable_server_does_not_affect_the_others() {
    let b = server("/b").await;
    for network in [network(nobody(), b.port()), network(b.port(), nobody())] {
        let port = Port::open(&network, "/p", PortOptions::new())
            .await
            .unwrap();
        assert_eq!(network.query("/p").await.unwrap().port, port.tcp_port());
        let unknown = network.query("/none").await;
        assert!(
            matches!(unknown, Err(PortError::Unknown { .. })),
            "{unknown:?}"
        );
        port.close().await;
        assert!(network.query("/p").await.is_err());
    }
    let network = network(nobody(), nobody());
    let error = Port::open(&network, "/p", PortOptions::new())
        .await
        .unwrap_err();
    assert!(matches!(error, PortError::NameServer { .. }), "{error:?}");
}
