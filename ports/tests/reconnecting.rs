//! A reconnecting connection follows restarts of its reader, and reports its state to its owner.

use crate::common;

use std::time::Duration;

use common::{at, next, open, until, within};
use tokio::net::TcpListener;
use yarp_ports::{
    ConnectionState, Port, PortOptions, Queue, ReconnectOptions, ReconnectingConnection,
};
use yarp_wire::Bottle;

fn quick() -> ReconnectOptions {
    ReconnectOptions::new().backoff(Duration::from_millis(1), Duration::from_millis(20))
}

async fn reader(number: u16) -> Port {
    let options = PortOptions::new().queue(Queue::Wait(10)).tcp_port(number);
    open("/rd", options).await
}

async fn lost(link: &ReconnectingConnection) {
    let mut states = link.watch();
    let lost = states.wait_for(|state| matches!(state, ConnectionState::Disconnected { .. }));
    within(lost).await.unwrap();
}

/// Waits until it has been tried again a few times without success.
async fn tried_often(link: &mut ReconnectingConnection) {
    let tried = async {
        while !matches!(link.changed().await, ConnectionState::Connecting { attempt } if attempt > 3)
        {
        }
    };
    within(tried).await;
}

/// The message is written until it arrives: a connection that is up may be about to break.
async fn arrives(writer: &Port, reader: &Port, content: &str) {
    let message = Bottle::of(content);
    let writing = async {
        while writer.write(&message).await == 0 {
            tokio::task::yield_now().await;
        }
    };
    within(writing).await;
    assert_eq!(next(reader).await, content);
}

#[tokio::test]
async fn a_restarted_reader_is_reconnected() {
    for carrier in ["tcp", "fast_tcp", "text_ack"] {
        let first = reader(0).await;
        let number = first.tcp_port();
        let writer = open("/wr", PortOptions::new()).await;
        let link = writer.connect_persistent(&at(&first, carrier), quick());
        assert!(within(link.connected()).await);
        arrives(&writer, &first, "once").await;
        within(first.close()).await;
        lost(&link).await;
        let second = reader(number).await;
        assert!(within(link.connected()).await);
        arrives(&writer, &second, "again").await;
    }
}

#[tokio::test]
async fn a_reader_that_is_not_there_yet_is_waited_for() {
    let place = reader(0).await;
    let (number, contact) = (place.tcp_port(), at(&place, "tcp"));
    within(place.close()).await;
    let writer = open("/wr", PortOptions::new()).await;
    let mut link = writer.connect_persistent(&contact, quick());
    lost(&link).await;
    tried_often(&mut link).await;
    let reader = reader(number).await;
    assert!(within(link.connected()).await);
    arrives(&writer, &reader, "hello").await;
}

#[tokio::test]
async fn dropping_it_ends_the_connection() {
    let reader = reader(0).await;
    let writer = open("/wr", PortOptions::new()).await;
    for dropped in [true, false] {
        let link = writer.connect_persistent(&at(&reader, "tcp"), quick());
        assert!(within(link.connected()).await);
        until(|| reader.inputs() == ["/wr"]).await;
        match dropped {
            true => drop(link),
            false => within(link.end()).await,
        }
        until(|| writer.outputs().is_empty() && reader.inputs().is_empty()).await;
    }
}

#[tokio::test]
async fn releasing_leaves_the_connection_without_reconnecting() {
    let reader = reader(0).await;
    let writer = open("/wr", PortOptions::new()).await;
    let link = writer.connect_persistent(&at(&reader, "tcp"), quick());
    assert!(within(link.connected()).await);
    let mut states = link.watch();
    link.release();
    let gone = async { while states.changed().await.is_ok() {} };
    within(gone).await;
    arrives(&writer, &reader, "still").await;
}

#[tokio::test]
async fn a_closed_connection_is_reestablished() {
    let reader = reader(0).await;
    let writer = open("/wr", PortOptions::new()).await;
    let link = writer.connect_persistent(&at(&reader, "tcp"), quick());
    assert!(within(link.connected()).await);
    assert!(within(writer.disconnect("/rd")).await);
    until(|| writer.outputs() == ["/rd"]).await;
    assert!(within(link.connected()).await);
    arrives(&writer, &reader, "back").await;
}

#[tokio::test]
async fn it_ends_with_its_port() {
    let reader = reader(0).await;
    let writer = open("/wr", PortOptions::new()).await;
    let mut up = writer.connect_persistent(&at(&reader, "tcp"), quick());
    let mut never = writer.connect_persistent("tcp://127.0.0.1:1/nobody", quick());
    assert!(within(up.connected()).await);
    within(writer.close()).await;
    for link in [&mut up, &mut never] {
        let ended = async { while link.changed().await != ConnectionState::Closed {} };
        within(ended).await;
        assert!(!within(link.connected()).await);
    }
    until(|| reader.inputs().is_empty()).await;
}

/// A reader that takes each connection and drops it at once is tried again and again, one pause
/// after the other.
#[tokio::test]
async fn a_reader_that_closes_at_once_is_reported_each_time() {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let writer = open("/wr", PortOptions::new()).await;
    let mut link = writer.connect_persistent(&format!("tcp://{address}/rd"), quick());
    let hanging_up = async {
        loop {
            drop(listener.accept().await.unwrap());
        }
    };
    tokio::select! {
        never = hanging_up => never,
        () = tried_often(&mut link) => {}
    }
    assert!(writer.outputs().is_empty());
}

/// An attempt with a reader that accepts the connection without answering times out.
#[tokio::test]
async fn an_unresponsive_reader_times_out() {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let writer = open("/wr", PortOptions::new()).await;
    let options = quick().connect_timeout(Duration::from_millis(10));
    let link = writer.connect_persistent(&format!("tcp://{address}/rd"), options);
    let mut states = link.watch();
    let reason = "connecting timed out".into();
    let lost = ConnectionState::Disconnected { reason };
    within(states.wait_for(|state| *state == lost))
        .await
        .unwrap();
}
