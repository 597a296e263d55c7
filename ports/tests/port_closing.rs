//! Closing and dropping a port end, whatever its peers do.

use crate::common;

use std::sync::{Arc, OnceLock};

use common::{ACK, Raw, bottle, connect, open, tcp_command, tcp_message, until, within};
use yarp_ports::{Answer, Port, PortError, PortOptions, Queue};
use yarp_wire::Bottle;

/// Returns a port with problematic peers: idle, blocked and half-open ones, and messages in
/// transit.
async fn troubled() -> (Port, Vec<Raw>) {
    let port = open("/troubled", PortOptions::new().queue(Queue::Wait(1))).await;
    let mut peers = Vec::new();
    for start in [&b""[..], b"CONN", b"YA\xe4\x1e\0\0RP\x04\0\0\0/w"] {
        let mut raw = Raw::to(&port).await;
        raw.send(start).await;
        peers.push(raw);
    }
    // Fills the queue, and waits for room with the next message.
    let mut full = Raw::tcp(&port, "/full").await;
    for _ in 0..3 {
        full.send(tcp_message(b'D', &bottle("x"))).await;
    }
    peers.push(full);
    // It never reads the reply.
    for (name, number) in [("/stuck/1", 1), ("/stuck/2", 2)] {
        let mut stuck = Raw::tcp(&port, name).await;
        stuck.send(tcp_command(b'r')).await;
        stuck.expect(ACK).await;
        until(|| port.outputs().len() == number).await;
        peers.push(stuck);
    }
    for _ in 0..3 {
        port.write_strict(&Bottle::of("x".repeat(500_000)), None)
            .await;
        if port.write_if_idle(&bottle("x"), None) == 0 {
            break;
        }
    }
    (port, peers)
}

#[tokio::test]
async fn closing_ends_whatever_peers_do() {
    let (port, peers) = troubled().await;
    within(port.close()).await;
    for peer in peers {
        peer.ended().await;
    }
}

#[tokio::test]
async fn dropping_closes_in_the_background() {
    let (port, peers) = troubled().await;
    drop(port);
    for peer in peers {
        peer.ended().await;
    }
}

#[tokio::test]
async fn a_number_is_free_again_after_closing() {
    let port = open("/port", PortOptions::new()).await;
    let number = port.tcp_port();
    let writer = open("/writer", PortOptions::new()).await;
    connect(&writer, &port, "tcp").await;
    within(port.close()).await;
    let port = open("/port", PortOptions::new().tcp_port(number)).await;
    assert_eq!(port.tcp_port(), number);
    until(|| writer.outputs().is_empty()).await;
    connect(&writer, &port, "tcp").await;
}

#[tokio::test]
async fn waiting_readers_are_notified() {
    let port = Arc::new(open("/port", PortOptions::new().queue(Queue::Latest)).await);
    let waiting: Vec<_> = (0..5)
        .map(|_| {
            let port = port.clone();
            tokio::spawn(async move { port.read().await.map(drop) })
        })
        .collect();
    tokio::task::yield_now().await;
    port.interrupt();
    for reader in waiting {
        let error = within(reader).await.unwrap().unwrap_err();
        assert!(matches!(error, PortError::Closed { .. }), "{error}");
    }
}

#[tokio::test]
async fn a_caller_is_told_when_the_server_closes() {
    let server = open("/server", PortOptions::new().rpc_server()).await;
    let client = open("/client", PortOptions::new().rpc_client()).await;
    connect(&client, &server, "tcp").await;
    let call = tokio::spawn(async move { client.call::<Bottle>(&bottle("x")).await });
    let request = within(server.read()).await.unwrap();
    within(server.close()).await;
    drop(request);
    let error = within(call).await.unwrap().unwrap_err();
    assert!(matches!(error, PortError::Lost { .. }), "{error}");
}

#[tokio::test]
async fn an_answer_that_never_comes_does_not_hold_up_closing() {
    let options = PortOptions::new().handler(|_| Answer::Later(Box::pin(std::future::pending())));
    let server = open("/server", options).await;
    let mut caller = Raw::tcp(&server, "/caller").await;
    caller.send(tcp_message(b'd', &bottle("x"))).await;
    until(|| server.inputs() == ["/caller"]).await;
    within(server.close()).await;
    caller.ended().await;
}

#[tokio::test]
async fn ports_connected_in_a_circle_close_together() {
    let ports = [
        open("/a", PortOptions::new().queue(Queue::Latest)).await,
        open("/b", PortOptions::new().queue(Queue::Latest)).await,
    ];
    connect(&ports[0], &ports[1], "tcp").await;
    connect(&ports[1], &ports[0], "tcp").await;
    let itself = open("/c", PortOptions::new().queue(Queue::Latest)).await;
    connect(&itself, &itself, "tcp").await;
    assert_eq!(within(itself.write(&bottle("to me"))).await, 1);
    let [a, b] = ports;
    within(async { tokio::join!(a.close(), b.close(), itself.close()) }).await;
}

/// Regression: the list of connections was locked during the owner's callback for a closed one,
/// which deadlocked when it queried the list.
#[tokio::test]
async fn an_owner_may_query_the_connections_in_its_callback() {
    let port: Arc<OnceLock<Port>> = Arc::default();
    let seen = port.clone();
    let (told, mut changes) = tokio::sync::mpsc::unbounded_channel();
    let options = PortOptions::new().on_connection_change(move |change| {
        let now = seen
            .get()
            .map(|port| (port.outputs().len(), port.inputs().len()));
        let _ = told.send((change.to.clone(), change.began, now));
    });
    let writer = open("/writer", options).await;
    port.set(writer).unwrap();
    let writer = port.get().unwrap();
    let reader = open("/reader", PortOptions::new().queue(Queue::Latest)).await;
    connect(writer, &reader, "tcp").await;
    let began = within(changes.recv()).await.unwrap();
    assert_eq!((began.0.as_str(), began.1), ("/reader", true));
    // Regression: the callback ran before the reader was among the outputs: an immediate write
    // missed it.
    assert_eq!(began.2, Some((1, 0)));
    within(reader.close()).await;
    until(|| writer.outputs().is_empty()).await;
    let ended = within(async {
        loop {
            let change = changes.recv().await.unwrap();
            if change.0 == "/reader" && !change.1 {
                break change;
            }
        }
    });
    assert_eq!(ended.await.2, Some((0, 0)));
}

/// A reply that was given just before the port closed never left: the caller saw the connection
/// end instead.
#[tokio::test]
async fn a_reply_given_before_closing_arrives() {
    for _ in 0..50 {
        let server = open("/server", PortOptions::new().rpc_server()).await;
        // No port of its own, which the server would tell of the end first.
        let mut caller = Raw::tcp(&server, "anon_rpc").await;
        caller.send(tcp_message(b'd', &bottle("question"))).await;
        let mut request = within(server.read()).await.unwrap();
        request.reply_and_close(bottle("answer"));
        within(server.close()).await;
        let mut expected = bottle("answer").encode(yarp_wire::WireVersion::V3).to_vec();
        expected.extend_from_slice(ACK);
        assert_eq!(caller.ended().await, expected);
    }
}

/// A handler that panicked while the port closed ended all other connections at once, and with
/// them replies that were about to be given.
#[tokio::test]
async fn a_handler_that_panics_while_closing_takes_no_reply_from_others() {
    // The patience of a closing port is short, and this machine may be slow.
    for _ in 0..20 {
        let (release, released) = tokio::sync::watch::channel(0);
        let options = PortOptions::new().handler(move |request| {
            let turn = if &*request.from == "unlucky" { 1 } else { 2 };
            let mut released = released.clone();
            Answer::Later(Box::pin(async move {
                released.wait_for(|now| *now >= turn).await.unwrap();
                assert_ne!(turn, 1, "as the test wants it");
                Answer::reply(bottle("answer"))
            }))
        });
        let server = open("/server", options).await;
        let mut unlucky = Raw::tcp(&server, "unlucky").await;
        unlucky.send(tcp_message(b'd', &bottle("x"))).await;
        let mut lucky = Raw::tcp(&server, "lucky").await;
        lucky.send(tcp_message(b'd', &bottle("x"))).await;
        let count = || server.counters().received.messages;
        until(|| count() == 2).await;
        let number = server.tcp_port();
        let closing = tokio::spawn(server.close());
        let refused = async {
            while tokio::net::TcpStream::connect(("127.0.0.1", number))
                .await
                .is_ok()
            {}
        };
        within(refused).await;
        release.send_replace(1);
        unlucky.ended().await;
        release.send_replace(2);
        let answer = lucky.ended().await;
        within(closing).await.unwrap();
        if !answer.is_empty() {
            let mut expected = bottle("answer").encode(yarp_wire::WireVersion::V3).to_vec();
            expected.extend_from_slice(ACK);
            assert_eq!(answer, expected);
            return;
        }
    }
    panic!("no reply ever came");
}
