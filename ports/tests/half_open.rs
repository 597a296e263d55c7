//! Connections that stop at any byte and stay open for a minute do not affect others.
//!
//! The only test with a real delay: the minute is its subject.

mod common;

use std::time::{Duration, Instant};

use common::{Raw, bottle, connect, open, tcp_header, tcp_message, within};
use yarp_ports::{Answer, PortOptions};
use yarp_wire::Bottle;

const HELD: Duration = Duration::from_secs(60);
/// Connections per place where they stop.
const EACH: usize = 20;

/// Returns the bytes that a peer may have sent before it stops.
fn beginnings() -> Vec<Vec<u8>> {
    // No name of a port, so that one does not displace the other.
    let header = tcp_header("silent");
    let message = tcp_message(b'd', &bottle("never finished"));
    let mut whole = header.clone();
    whole.extend_from_slice(&message);
    vec![
        Vec::new(),
        header[..5].to_vec(),
        header[..10].to_vec(),
        header.clone(),
        whole[..header.len() + 12].to_vec(),
        whole[..whole.len() - 3].to_vec(),
        b"CONNECT silen".to_vec(),
        b"CONNACK silent\r\nd\r\n(never closed".to_vec(),
        b"NAME_SERVER lis".to_vec(),
        b"GET / HTTP/1.1\r\nHost: ".to_vec(),
    ]
}

#[tokio::test]
async fn half_open_connections_are_held_for_a_minute() {
    let options = PortOptions::new()
        .handler(|message| message.bottle().map_or(Answer::Nothing, Answer::reply));
    let port = open("/port", options).await;
    let mut held = Vec::new();
    for beginning in beginnings() {
        for _ in 0..EACH {
            let mut raw = Raw::to(&port).await;
            raw.send(&beginning).await;
            held.push(raw);
        }
    }
    let caller = open("/caller", PortOptions::new().rpc_client()).await;
    connect(&caller, &port, "tcp").await;
    let begun = Instant::now();
    let mut number = 0;
    while begun.elapsed() < HELD {
        let request = Bottle::of(number);
        let reply: Bottle = within(caller.call(&request)).await.unwrap();
        assert_eq!(reply, request);
        number += 1;
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    assert!(held.iter().all(Raw::is_open), "none was dropped");
    // And none holds up the end.
    within(caller.close()).await;
    within(port.close()).await;
    for raw in held {
        raw.ended().await;
    }
}
