//! The name server applies the roles to each request.

use yarp_nameserver::{Server, ServerOptions};
use yarp_ports::roles::Roles;
use yarp_ports::{AdminClient, Network, Port, PortOptions};
use yarp_wire::Bottle;
use yarp_wire::auth::Key;
use yarp_wire::carrier::Carrier;
use yarp_wire::message::Command;

const ROLES: &str = "
[lookup]
ports /root
rights read
[arm]
ports /wam/* /boss/*
from boss
rights all
[caretaker]
ports /root
from boss
rights administer
";

async fn server(text: &str) -> (Server, tempfile::TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("roles.conf");
    std::fs::write(&file, text).unwrap();
    let options = ServerOptions::default().at("127.0.0.1", 0);
    let options = options.roles(Roles::from_file(&file).unwrap());
    (Server::start(options).await.unwrap(), folder)
}

/// Returns the answer to a client named `name`, without its quotes.
async fn ask(network: &Network, name: &str, request: &str) -> String {
    let carrier = Carrier::by_name("text_ack").unwrap();
    let server = network.server().unwrap();
    let opening = AdminClient::open("/root", server, carrier, name, network);
    let mut client = opening.await.unwrap();
    let request = Bottle::parse(&format!("NAME_SERVER {request}")).unwrap();
    let payload = client.request(&Command::data(true), &request).await;
    let text = payload.unwrap().to_bottle().unwrap().to_string();
    text.replace('"', "")
}

#[tokio::test]
async fn names_are_given_to_who_may_administer_them() {
    let (server, _folder) = server(ROLES).await;
    let network = server.network();
    for request in [
        "register /wam/rpc:i tcp 127.0.0.1 12345",
        "unregister /wam/rpc:i",
        "set /wam/rpc:i key value",
        "set /mine owns /wam/rpc:i",
        "announce /wam/rpc:i 0",
        "lease /wam/rpc:i 127.0.0.1 12345",
        "passed /wam/rpc:i 127.0.0.1 12345",
        "subscribe tcp://wam/state:o /mine",
        "subscribe /mine tcp://wam/rpc:i",
        "unsubscribe /wam/state:o /mine",
        "topic /wam/topic",
        "untopic topic://wam/topic",
        "gc",
        "type yarp name value",
    ] {
        let answer = ask(&network, "/other", request).await;
        assert!(answer.contains("refused: "), "{request}: {answer}");
        let answer = ask(&network, "boss", request).await;
        assert!(!answer.contains("refused: "), "{request}: {answer}");
    }
    let answer = ask(&network, "/other", "register /free tcp 127.0.0.1 12346").await;
    assert!(answer.contains("registration name /free "), "{answer}");
}

#[tokio::test]
async fn looking_up_needs_the_right_to_read() {
    let (server, _folder) = server("[a]\nports /root\nfrom /friend\nrights read\n").await;
    let network = server.network();
    for request in [
        "list",
        "query /root",
        "get /root ips",
        "help",
        "subscribe",
        "topic",
    ] {
        let answer = ask(&network, "/other", request).await;
        assert!(answer.contains("refused: "), "{request}: {answer}");
        let answer = ask(&network, "/friend", request).await;
        assert!(!answer.contains("refused: "), "{request}: {answer}");
    }
    // Programs that ask without a name have no role.
    assert!(network.query("/root").await.is_err());
}

#[tokio::test]
async fn a_port_without_the_right_to_its_name_does_not_open() {
    let (server, _folder) = server(ROLES).await;
    let network = server.network();
    let refused = Port::open(&network, "/wam/rpc:i", PortOptions::new()).await;
    let error = refused.unwrap_err().to_string();
    assert!(
        error.contains("no right to administer on /wam/rpc:i"),
        "{error}"
    );
    let port = Port::open(&network, "/mine", PortOptions::new())
        .await
        .unwrap();
    assert_eq!(network.query("/mine").await.unwrap().port, port.tcp_port());
    port.close().await;
    server.close().await;
}

#[tokio::test]
async fn a_server_with_a_key_serves_clients_with_the_key() {
    let key = Key::new(b"my_secret_key");
    let options = ServerOptions::default().at("127.0.0.1", 0).key(key);
    let server = Server::start(options).await.unwrap();
    let network = server.network();
    let port = Port::open(&network, "/mine", PortOptions::new())
        .await
        .unwrap();
    assert_eq!(network.query("/mine").await.unwrap().port, port.tcp_port());
    for other in [None, Key::new(b"another")] {
        let refused = network.with_key(other).query("/mine").await;
        assert!(refused.is_err());
    }
    port.close().await;
    server.close().await;
}
