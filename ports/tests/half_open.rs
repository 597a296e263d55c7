//! Connections that stop in the middle of anything cost others nothing; those that stop before their header is complete
//! end after the timeout of the header, the others stay.

mod common;

use std::time::Duration;

use common::{Raw, bottle, connect, open, tcp_header, tcp_message, within};
use yarp_ports::port_limits::ProcessLimits;
use yarp_ports::{Answer, PortOptions};
use yarp_wire::Bottle;

/// Timeout of the header, 30 s by default.
const HEADER_TIMEOUT: Duration = Duration::from_secs(1);
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
async fn half_open_connections_end_after_the_header_timeout_or_stay() {
    ProcessLimits::default()
        .with_header_timeout(HEADER_TIMEOUT)
        .apply();
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
    let call = async |number: i32| {
        let request = Bottle::of(number);
        let reply: Bottle = within(caller.call(&request)).await.unwrap();
        assert_eq!(reply, request);
    };
    let incomplete = || held.iter().filter(|(_, has_header)| !has_header);
    let ending = async {
        for number in 0.. {
            call(number).await;
            if incomplete().all(|(raw, _)| !raw.is_open()) {
                return;
            }
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    };
    within(ending).await;
    let mut complete = held.iter().filter(|(_, has_header)| *has_header);
    assert!(complete.all(|(raw, _)| raw.is_open()));
    call(-1).await;
    // And none holds up the end.
    within(caller.close()).await;
    within(port.close()).await;
    for (raw, _) in held {
        raw.ended().await;
    }
}
