//! A large text that is the reply of many connections: none copies it, and none keeps it for long.

use crate::common;
use crate::websocket_carrier::{frame, message, page};

use std::sync::Arc;

use common::{Raw, bottle, open, tcp_command, tcp_message, until, within};
use yarp_ports::{Answer, Port, PortOptions, SharedReply};
use yarp_wire::message::{Form, RawText};
use yarp_wire::{Bottle, Value, WireVersion};

/// More than the system takes from somebody whose peer does not read.
const LENGTH: usize = 24 << 20;

/// A port that answers `shared` with a text that it shares, and other messages with one that is copied; and what is dropped with
/// the shared one.
async fn answering(length: usize) -> (Port, Arc<()>) {
    let guard = Arc::new(());
    let held = guard.clone();
    let text = SharedReply::text("x".repeat(length), held);
    let text = std::sync::Mutex::new(Some(text));
    let options = PortOptions::new().handler(move |message| {
        let words = message.bottle().unwrap().to_string();
        let shared = || text.lock().unwrap().clone().expect("it is there");
        match words.as_str() {
            "shared" => {
                let shared = shared();
                Answer::Later(Box::pin(async { Answer::reply(shared) }))
            }
            "at once" => Answer::reply(shared()),
            "forget" => {
                text.lock().unwrap().take();
                Answer::Nothing
            }
            _ => Answer::reply(RawText("x".repeat(length))),
        }
    });
    (open("/port", options).await, guard)
}

#[tokio::test]
async fn it_is_the_same_on_every_carrier() {
    let (port, _guard) = answering(300_000).await;
    for words in ["shared", "[at] once"] {
        let mut replies = Vec::new();
        for words in ["copied", words] {
            let mut text = Raw::text(&port, "text").await;
            text.send(format!("d\r\n{words}\r\nd\r\n{words}\r\nq\r\n"))
                .await;
            let mut acknowledged = Raw::to(&port).await;
            acknowledged.send("CONNACK ack\r\n").await;
            acknowledged
                .send(format!("d\r\n{words}\r\nd\r\n{words}\r\nq\r\n"))
                .await;
            let mut tcp = Raw::tcp(&port, "/tcp").await;
            tcp.send(tcp_message(b'd', &bottle(words))).await;
            tcp.send(tcp_message(b'd', &bottle(words))).await;
            tcp.send(tcp_command(b'q')).await;
            let mut web = page(&port).await;
            web.send(message(b'd', &bottle(words))).await;
            web.send(message(b'd', &bottle(words))).await;
            web.send(frame(0x88, b"\x03\xe8")).await;
            let mut got = Vec::new();
            for raw in [text, acknowledged, tcp, web] {
                got.push(raw.ended().await);
            }
            replies.push(got);
        }
        for (copied, shared) in replies[0].iter().zip(&replies[1]) {
            assert!(copied.len() >= 600_000, "{}", copied.len());
            assert!(copied == shared, "{} {}", copied.len(), shared.len());
        }
    }
    within(port.close()).await;
}

/// A bottle that many send is the same in all forms, of which one is not copied.
#[tokio::test]
async fn a_bottle_is_the_same_in_every_form() {
    let binary = Form::Binary(WireVersion::V3);
    let list = (0..30_000).map(|n| Value::from(format!("/port/{n}")));
    let list: Bottle = list.collect();
    let shared = [Form::Text, binary].map(|form| SharedReply::encode(&list, form, ()));
    let options = PortOptions::new().handler(move |message| {
        let reply = match message.bottle().unwrap().to_string().as_str() {
            "text" => Answer::reply(shared[0].clone()),
            "binary" => Answer::reply(shared[1].clone()),
            _ => return Answer::reply(list.clone()),
        };
        Answer::Later(Box::pin(async { reply }))
    });
    let port = open("/port", options).await;
    let mut replies = Vec::new();
    for words in ["copied", "text", "binary"] {
        let mut text = Raw::text(&port, "text").await;
        text.send(format!("d\r\n{words}\r\nd\r\n{words}\r\nq\r\n"))
            .await;
        let mut tcp = Raw::tcp(&port, "/tcp").await;
        tcp.send(tcp_message(b'd', &bottle(words))).await;
        tcp.send(tcp_message(b'd', &bottle(words))).await;
        tcp.send(tcp_command(b'q')).await;
        let mut web = page(&port).await;
        web.send(message(b'd', &bottle(words))).await;
        web.send(frame(0x88, b"\x03\xe8")).await;
        let mut got = Vec::new();
        for raw in [text, tcp, web] {
            got.push(raw.ended().await);
        }
        assert!(got.iter().all(|reply| reply.len() > 300_000));
        replies.push(got);
    }
    assert!(replies[0] == replies[1], "the shared text differs");
    assert!(replies[0] == replies[2], "the shared binary form differs");
    within(port.close()).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn who_does_not_read_does_not_keep_it() {
    let (port, guard) = answering(LENGTH).await;
    let mut stuck = Raw::text(&port, "stuck").await;
    stuck.send("d\r\nshared\r\n").await;
    stuck.expect("x").await;
    let mut reader = Raw::text(&port, "reader").await;
    reader.send("d\r\nshared\r\nd\r\nforget\r\n").await;
    reader.expect("x".repeat(LENGTH)).await;
    assert_eq!(Arc::strong_count(&guard), 2, "somebody still gets it");
    until(|| Arc::strong_count(&guard) == 1).await;
    let got = stuck.ended().await.len();
    assert!(got < LENGTH - 1, "{got}");
    assert!(reader.is_open());
    within(port.close()).await;
}
