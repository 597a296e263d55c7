//! A name whose owner is alive is not given to another port; one whose owner is gone is, at once.

use std::time::Duration;

use tokio::net::TcpListener;
use yarp_nameserver::{Server, ServerOptions};
use yarp_ports::{Network, Port, PortError, PortOptions};

fn options() -> ServerOptions {
    ServerOptions::default().at("127.0.0.1", 0)
}

async fn serve() -> Server {
    Server::start(options()).await.unwrap()
}

async fn first_line(network: &Network, request: &str) -> String {
    let answer = network.ask(request).await.unwrap();
    answer.lines().next().unwrap_or_default().to_owned()
}

#[tokio::test]
async fn a_live_port_keeps_its_name() {
    let server = serve().await;
    let network = server.network();
    let owner = Port::open(&network, "/a", PortOptions::new())
        .await
        .unwrap();
    let place = network.query("/a").await.unwrap();

    let Err(error) = Port::open(&network, "/a", PortOptions::new()).await else {
        panic!("the name was given away");
    };
    assert!(matches!(error, PortError::Refused { .. }), "{error}");
    let line = first_line(&network, "register /a tcp 127.0.0.1 9").await;
    let expected = format!(
        "refused: /a belongs to a port that is there, at 127.0.0.1:{}",
        owner.tcp_port()
    );
    assert!(line.starts_with(&expected), "{line}");
    assert_eq!(network.query("/a").await.unwrap(), place);
    let line = first_line(&network, "register /root").await;
    assert!(line.starts_with("refused: /root belongs"), "{line}");

    // The owner itself may register again, and its name is free when it is gone.
    let again = format!("register /a tcp {} {}", place.host, place.port);
    assert_eq!(first_line(&network, &again).await, place.to_string());
    owner.close().await;
    let next = Port::open(&network, "/a", PortOptions::new())
        .await
        .unwrap();
    next.close().await;
    server.close().await;
}

/// A program that was killed and restarts while its old lease and properties exist.
#[tokio::test]
async fn the_name_of_a_port_that_is_gone_is_free() {
    let server = serve().await;
    let network = server.network();
    let gone = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let number = gone.local_addr().unwrap().port();
    drop(gone);
    let ask = |line: String| {
        let network = network.clone();
        async move { first_line(&network, &line).await }
    };
    ask(format!("register /a tcp 127.0.0.1 {number}")).await;
    ask("set /a process 1".to_owned()).await;
    ask(format!("lease /a 127.0.0.1 {number}")).await;
    let next = Port::open(&network, "/a", PortOptions::new())
        .await
        .unwrap();
    assert_ne!(next.tcp_port(), number);
    next.close().await;
    server.close().await;
}

#[tokio::test]
async fn a_stuck_port_keeps_its_name() {
    let server = serve().await;
    let network = server.network();
    // Accepts connections and sends nothing.
    let stuck = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let number = stuck.local_addr().unwrap().port();
    let stranger = Port::open(&network, "/stranger", PortOptions::new().unregistered())
        .await
        .unwrap();
    for (name, number) in [("/stuck", number), ("/b", stranger.tcp_port())] {
        let request = format!("register {name} tcp 127.0.0.1 {number}");
        let line = first_line(&network, &request).await;
        assert!(line.starts_with("registration"), "{line}");
        first_line(&network, &format!("announce {name}")).await;
    }
    let line = first_line(&network, "register /stuck").await;
    assert!(line.starts_with("refused: "), "{line}");
    let line = first_line(&network, "register /b").await;
    assert!(line.starts_with("registration name /b "), "{line}");
    stranger.close().await;
    server.close().await;
}

/// Two programs that want one name at the same time: the second must not take it from the first
/// before that listens.
#[tokio::test]
async fn a_port_that_has_just_registered_has_time_to_listen() {
    let server = serve().await;
    let network = server.network();
    let reserved = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let number = reserved.local_addr().unwrap().port();
    drop(reserved);
    first_line(&network, &format!("register /a tcp 127.0.0.1 {number}")).await;
    let thief = tokio::spawn({
        let network = network.clone();
        async move { first_line(&network, "register /a").await }
    });
    tokio::time::sleep(Duration::from_millis(100)).await;
    let options = PortOptions::new().unregistered().tcp_port(number);
    let owner = Port::open(&network, "/a", options).await.unwrap();
    let line = thief.await.unwrap();
    assert!(line.starts_with("refused: "), "{line}");
    owner.close().await;
    server.close().await;
}

#[tokio::test]
async fn stock_behaviour_is_available() {
    let server = Server::start(options().replace()).await.unwrap();
    let network = server.network();
    let owner = Port::open(&network, "/a", PortOptions::new())
        .await
        .unwrap();
    let line = first_line(&network, "register /a tcp 127.0.0.1 9").await;
    assert_eq!(line, "registration name /a ip 127.0.0.1 port 9 type tcp");
    owner.close().await;
    server.close().await;
}
