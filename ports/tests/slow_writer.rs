//! Writers that send a byte at a time get all their messages through, and delay no others.

use crate::common;
use crate::conversation;

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use common::{ACK, Raw, bottle, connect, open, tcp_header, tcp_message, within};
use tokio::net::TcpStream;
use tokio::task::JoinSet;
use yarp_ports::{Answer, PortOptions};
use yarp_wire::{Bottle, WireVersion, framed_number};

/// Writers of each kind.
const EACH: usize = 20;
/// Instead of a second between two bytes of a writer: nothing in a port depends on it.
const WRITE_INTERVAL: Duration = Duration::from_millis(5);

/// Returns the bytes of each kind of writer, and the complete answers.
fn kinds(port: u16) -> Vec<(Vec<u8>, Vec<u8>)> {
    let request = bottle("slow 1 (2 3)");
    let reply = request.encode(WireVersion::V3);
    let header_reply = framed_number::encode(port.into());
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
    for (bytes, answers) in kinds(port.tcp_port()) {
        for _ in 0..EACH {
            slow.push((Raw::to(&port).await, bytes.clone(), answers.clone()));
        }
    }
    let caller = open("/caller", PortOptions::new().rpc_client()).await;
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
        tokio::time::sleep(WRITE_INTERVAL).await;
    }
    for (mut raw, _, answers) in slow {
        raw.expect(answers).await;
    }
    within(caller.close()).await;
    within(port.close()).await;
}

/// Over a Unix socket, in frames, as a browser, and as a viewer of images. Each has a port of its
/// own: of several connections of the same name a port keeps the last.
///
/// Regression: a browser's request in pieces was not answered, because the low-water mark was the
/// length of the whole request.
#[tokio::test]
async fn a_byte_at_a_time_over_every_carrier() {
    let (question, answer) = (bottle("slow 1 (2 3)"), bottle("fast 4"));
    let asked = Arc::new(AtomicUsize::new(0));
    let (mut slow, mut others) = (JoinSet::new(), Vec::new());
    let mut questions = 0;
    let callers = conversation::callers(&question, &answer).into_iter();
    let viewers = conversation::viewers(&question).into_iter();
    for conversation in callers.chain(viewers.filter(|viewer| viewer.spelled == "mjpeg")) {
        let (expected, given, counted) = (question.clone(), answer.clone(), asked.clone());
        let options = PortOptions::new().handler(move |message| {
            if message.bottle().is_ok_and(|bottle| bottle == expected) {
                counted.fetch_add(1, Ordering::Relaxed);
            }
            Answer::reply(given.clone())
        });
        let port = open("/port", options).await;
        let stream = within(TcpStream::connect(("127.0.0.1", port.tcp_port())));
        let stream = stream.await.unwrap();
        let (is_viewer, is_browser) = (
            conversation.spelled == "mjpeg",
            conversation.spelled == "http",
        );
        let payload = conversation.cuts("payload");
        questions += usize::from(!is_viewer && !is_browser && !payload.is_empty());
        // A viewer would need an image to be written.
        let cut = match is_viewer {
            true => payload[0],
            false => conversation.cuts("rest")[0],
        };
        let conversation = conversation.slowly(WRITE_INTERVAL);
        slow.spawn(async move { conversation.hold(stream, cut).await });
        let caller = open("/caller", PortOptions::new().rpc_client()).await;
        connect(&caller, &port, "tcp").await;
        others.push((port, caller));
    }
    let mut held = Vec::new();
    while !slow.is_empty() {
        // While each of them is in the middle of something.
        for (_, caller) in &others {
            let reply: Bottle = within(caller.call(&bottle("quick"))).await.unwrap();
            assert_eq!(reply, answer);
        }
        while let Some(done) = slow.try_join_next() {
            held.push(done.unwrap());
        }
        tokio::time::sleep(WRITE_INTERVAL).await;
    }
    assert!(questions > 0);
    assert_eq!(asked.load(Ordering::Relaxed), questions);
    for (port, caller) in others {
        within(caller.close()).await;
        within(port.close()).await;
    }
}
