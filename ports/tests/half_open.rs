//! Connections that stop in the middle of anything and stay so for a minute cost others nothing; those that stop before
//! their header is complete are ended meanwhile.
//!
//! The one test that takes its time: the minute is what it is about.

mod common;

use std::time::{Duration, Instant};

use common::{Raw, bottle, connect, open, tcp_header, tcp_message, within};
use yarp_ports::{Answer, PortOptions};
use yarp_wire::Bottle;

const HELD: Duration = Duration::from_secs(60);
/// Connections per place where they stop.
const EACH: usize = 20;

/// Everything a peer may have said when it falls silent, and whether its header is complete then.
fn beginnings() -> Vec<(Vec<u8>, bool)> {
    // No name of a port, so that one does not displace the other.
    let header = tcp_header("silent");
    let message = tcp_message(b'd', &bottle("never finished"));
    let mut whole = header.clone();
    whole.extend_from_slice(&message);
    vec![
        (Vec::new(), false),
        (header[..5].to_vec(), false),
        (header[..10].to_vec(), false),
        (header.clone(), true),
        (whole[..header.len() + 12].to_vec(), true),
        (whole[..whole.len() - 3].to_vec(), true),
        (b"CONNECT silen".to_vec(), false),
        (b"CONNACK silent\r\nd\r\n(never closed".to_vec(), true),
        (b"NAME_SERVER lis".to_vec(), true),
        (b"GET / HTTP/1.1\r\nHost: ".to_vec(), false),
    ]
}

#[tokio::test]
async fn half_open_connections_are_held_for_a_minute() {
    let options = PortOptions::new()
        .handler(|message| message.bottle().map_or(Answer::Nothing, Answer::reply));
    let port = open("/port", options).await;
    let mut held = Vec::new();
    for (beginning, has_header) in beginnings() {
        for _ in 0..EACH {
            let mut raw = Raw::to(&port).await;
            raw.send(&beginning).await;
            held.push((raw, has_header));
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
    let as_expected = |(raw, has_header): &(Raw, bool)| raw.is_open() == *has_header;
    assert!(held.iter().all(as_expected));
    // And none holds up the end.
    within(caller.close()).await;
    within(port.close()).await;
    for (raw, _) in held {
        raw.ended().await;
    }
}
