//! Writers that send a byte now and then get all their messages through, and delay nobody.

mod common;

use std::time::Duration;

use common::{ACK, Raw, bottle, connect, open, tcp_header, tcp_message, within};
use yarp_ports::{Answer, PortOptions};
use yarp_wire::{Bottle, Dialect, number};

/// Writers of each kind.
const EACH: usize = 20;
/// Instead of a second between two bytes of a writer: nothing in a port depends on it.
const PAUSE: Duration = Duration::from_millis(5);

/// What a writer of one kind sends, and all that it is answered.
fn kinds(port: u16) -> Vec<(Vec<u8>, Vec<u8>)> {
    let request = bottle("slow 1 (2 3)");
    let reply = request.encode(Dialect::V3);
    let header_reply = number::encode(port.into());
    let fast_header = {
        let mut header = tcp_header("slow");
        header[2] = 0x64;
        header
    };
    let message = tcp_message(b'd', &request);
    vec![
        (
            [tcp_header("slow"), message.clone()].concat(),
            [&header_reply[..], &reply, ACK].concat(),
        ),
        (
            [fast_header, message].concat(),
            [&header_reply[..], &reply].concat(),
        ),
        (
            b"CONNECT slow\r\nd\r\nslow 1 (2 3)\r\n".to_vec(),
            b"Welcome slow\r\nslow 1 (2 3)\r\n".to_vec(),
        ),
        (
            b"CONNACK slow\r\nd\r\nslow 1 (2 3)\r\n".to_vec(),
            b"Welcome slow\r\nslow 1 (2 3)\r\n<ACK>\r\n".to_vec(),
        ),
    ]
}

#[tokio::test]
async fn a_byte_at_a_time_from_many() {
    let options = PortOptions::new()
        .handler(|message| message.bottle().map_or(Answer::Nothing, Answer::reply));
    let port = open("/port", options).await;
    let mut slow = Vec::new();
    for (bytes, answers) in kinds(port.number()) {
        for _ in 0..EACH {
            slow.push((Raw::to(&port).await, bytes.clone(), answers.clone()));
        }
    }
    let caller = open("/caller", PortOptions::new().calling()).await;
    connect(&caller, &port, "tcp").await;
    let longest = slow.iter().map(|(_, bytes, _)| bytes.len()).max().unwrap();
    for at in 0..longest {
        for (raw, bytes, _) in &mut slow {
            if let Some(byte) = bytes.get(at) {
                raw.send([*byte]).await;
            }
        }
        // While all of them are in the middle of something.
        let request = Bottle::of(at as i32);
        let reply: Bottle = within(caller.call(&request)).await.unwrap();
        assert_eq!(reply, request);
        tokio::time::sleep(PAUSE).await;
    }
    for (mut raw, _, answers) in slow {
        raw.expect(answers).await;
    }
    within(caller.close()).await;
    within(port.close()).await;
}
