//! A port with a key accepts connections of peers with the key only.

use crate::common;

use bytes::BytesMut;
use common::{DEADLINE, Raw, bottle, next, until, within};
use yarp_ports::{AdminClient, Answer, AuthFailure, Network, Port, PortError, PortOptions, Queue};
use yarp_wire::auth::{Key, KeyHandshake, STEP_LEN};
use yarp_wire::carrier::Carrier;
use yarp_wire::message::Command;

/// Returns a network without name server whose programs hold this key.
fn network(secret: &str) -> Network {
    let network = Network::none().with_timeout(DEADLINE);
    network.with_key(Key::new(secret.as_bytes()))
}

async fn open(network: &Network, name: &str, options: PortOptions) -> Port {
    within(Port::open(network, name, options.unregistered()))
        .await
        .unwrap()
}

#[tokio::test]
async fn ports_that_share_a_key_connect_over_every_carrier() {
    let network = network("my_secret_key");
    let reading = || PortOptions::new().queue(Queue::Wait(8));
    let reader = open(&network, "/reader", reading()).await;
    for carrier in ["tcp", "fast_tcp", "text", "text_ack", "udp", "unix_stream"] {
        let writer = open(&network, "/writer", PortOptions::new()).await;
        common::connect(&writer, &reader, carrier).await;
        within(writer.write(&bottle("hello 1.5"))).await;
        assert_eq!(next(&reader).await, "hello 1.5", "{carrier}");
        within(writer.close()).await;
    }
}

#[tokio::test]
async fn admin_clients_perform_the_key_handshake() {
    let network = network("my_secret_key");
    let echo = PortOptions::new().handler(|message| match message.bottle() {
        Ok(bottle) => Answer::reply(bottle),
        Err(_) => Answer::Nothing,
    });
    let port = open(&network, "/echo", echo).await;
    let carrier = Carrier::by_name("tcp").unwrap();
    let address = ("127.0.0.1", port.tcp_port());
    let opening = AdminClient::open("/echo", address, carrier, "/asker", &network);
    let mut client = within(opening).await.unwrap();
    let (command, question) = (Command::data(true), bottle("a b"));
    let reply = within(client.request(&command, &question)).await.unwrap();
    assert_eq!(reply.to_bottle().unwrap(), question);
}

/// Otherwise a port that is asked for images could be reached without the key.
#[tokio::test]
async fn a_pulling_port_performs_the_key_handshake() {
    let network = network("my_secret_key");
    let camera = open(&network, "/camera", PortOptions::new()).await;
    let viewer = open(&network, "/viewer", PortOptions::new().queue(Queue::Latest)).await;
    within(viewer.connect(&common::at(&camera, "mjpeg")))
        .await
        .unwrap();
    until(|| viewer.inputs() == ["/camera"]).await;
}

#[tokio::test]
async fn another_key_is_refused_on_both_sides() {
    let reader = open(&network("one"), "/reader", PortOptions::new()).await;
    let writer = open(&network("two"), "/writer", PortOptions::new()).await;
    for carrier in ["tcp", "text", "mjpeg"] {
        let error = within(writer.connect(&common::at(&reader, carrier))).await;
        let Err(PortError::Authentication { peer, source, .. }) = error else {
            panic!("{carrier}: {error:?}");
        };
        assert_eq!(peer, "/reader");
        assert!(matches!(source, AuthFailure::Wrong(_)), "{source:?}");
    }
    assert!(reader.inputs().is_empty());
}

#[tokio::test]
async fn a_peer_without_a_key_is_refused() {
    let reader = open(&network("one"), "/reader", PortOptions::new()).await;
    let writer = common::open("/writer", PortOptions::new()).await;
    let error = within(writer.connect(&common::at(&reader, "fast_tcp"))).await;
    assert!(error.is_err());
    assert!(reader.inputs().is_empty());
}

#[tokio::test]
async fn a_port_with_a_key_refuses_peers_without() {
    let reader = common::open("/reader", PortOptions::new()).await;
    let writer = open(&network("one"), "/writer", PortOptions::new()).await;
    let error = within(writer.connect(&common::at(&reader, "fast_tcp"))).await;
    let Err(PortError::Authentication { source, .. }) = error else {
        panic!("{error:?}");
    };
    assert!(matches!(source, AuthFailure::Silent { .. }), "{source:?}");
    assert!(reader.inputs().is_empty());
}

/// The whole of a header and a command: none of it may be taken for anything but a wrong answer.
#[tokio::test]
async fn nothing_is_read_from_a_peer_without_the_key() {
    let options = PortOptions::new().queue(Queue::Wait(8));
    let port = open(&network("one"), "/reader", options).await;
    let other = Key::new(b"two").unwrap();
    let mut forged = BytesMut::new();
    let mut initiator = KeyHandshake::initiate(other.clone(), [2; 8]);
    let mut challenge = BytesMut::new();
    KeyHandshake::accept(other, [[1; 8], [3; 8]], &mut challenge);
    assert_eq!(initiator.poll(&mut challenge, &mut forged), Ok(false));
    let text = b"CONNECT /writer\r\nd\r\nhello to the reader behind the key\r\n";
    for early in [&text[..], &[forged.to_vec(), text.to_vec()].concat()] {
        let mut raw = Raw::to(&port).await;
        raw.try_send(early).await;
        let said = raw.ended().await;
        assert!(
            said.len() <= STEP_LEN,
            "it says more than its challenge: {said:?}"
        );
    }
    assert!(port.try_read().is_none());
    assert!(port.inputs().is_empty());
}

#[tokio::test]
async fn an_idle_handshake_times_out() {
    let port = open(&network("one"), "/reader", PortOptions::new()).await;
    let raw = Raw::to(&port).await;
    assert_eq!(raw.ended().await.len(), STEP_LEN);
}

/// The nonces of two connections are never the same.
#[tokio::test]
async fn every_challenge_is_another() {
    let port = open(&network("one"), "/reader", PortOptions::new()).await;
    let mut seen = std::collections::HashSet::new();
    for _ in 0..8 {
        let mut raw = Raw::to(&port).await;
        assert!(seen.insert(raw.receive(STEP_LEN).await));
    }
}

/// A closing port does not wait for peers in the middle of the key handshake.
#[tokio::test]
async fn closing_does_not_wait_for_unauthenticated_peers() {
    let port = open(&network("one"), "/reader", PortOptions::new()).await;
    let mut raw = Raw::to(&port).await;
    raw.receive(STEP_LEN).await;
    within(port.close()).await;
    assert!(raw.ended().await.is_empty());
}
