//! However much is asked at once, answers take little memory until they are read.

use crate::common;

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use common::{Raw, bottle, open, until, within};
use yarp_ports::{Answer, Port, PortOptions};
use yarp_wire::Bottle;

const REPLY: usize = 64 * 1024;

/// A port that answers each message with so many letters, and counts them.
async fn answering(letters: usize) -> (Port, Arc<AtomicUsize>) {
    let count = Arc::new(AtomicUsize::new(0));
    let counted = count.clone();
    let options = PortOptions::new().handler(move |_| {
        counted.fetch_add(1, Ordering::SeqCst);
        Answer::reply(Bottle::of("x".repeat(letters)))
    });
    (open("/port", options).await, count)
}

/// All that had come was answered before any answer went out: 150 MB for 4 kB.
#[tokio::test]
async fn who_does_not_read_is_answered_no_further() {
    // As many as are read at once, in the first room that is offered.
    const MESSAGES: usize = 600;
    const REPLY: usize = 256 * 1024;
    let (port, count) = answering(REPLY).await;
    let mut raw = Raw::text(&port, "greedy").await;
    raw.send("d\r\n1\r\n".repeat(MESSAGES)).await;
    until(|| count.load(Ordering::SeqCst) > 0).await;
    // Whatever else it would answer, it would by then.
    for _ in 0..50 {
        common::ask(&port, &bottle("[ver]")).await;
    }
    // What the system takes, and 128 KiB.
    let answered = count.load(Ordering::SeqCst);
    assert!(answered < MESSAGES / 2, "{answered}");
    let line = [&b"x".repeat(REPLY)[..], b"\r\n"].concat();
    for _ in 0..MESSAGES {
        raw.expect(&line).await;
    }
    assert_eq!(count.load(Ordering::SeqCst), MESSAGES);
    within(port.close()).await;
}

async fn post(port: &Port, lines: &str) -> String {
    let mut raw = Raw::to(port).await;
    let body = format!("cmd={}", lines.replace('\n', "%0A"));
    raw.send(format!(
        "POST /form HTTP/1.1\r\nContent-Length: {}\r\n\
         Content-Type: application/x-www-form-urlencoded\r\n\r\n{body}",
        body.len()
    ))
    .await;
    String::from_utf8(raw.ended().await).unwrap()
}

/// A form of 420 kB made answers of gigabytes.
#[tokio::test]
async fn a_form_is_answered_with_a_megabyte_at_most() {
    let (port, count) = answering(REPLY).await;
    let page = post(&port, &"d\n1\n".repeat(900)).await;
    assert!(page.len() < (1 << 20) + 8 * 1024, "{}", page.len());
    assert!(page.contains("(No more is answered here"));
    let answered = count.load(Ordering::SeqCst);
    assert!(answered <= 17, "{answered}");
    within(port.close()).await;
}

#[tokio::test]
async fn a_form_has_a_thousand_lines_at_most() {
    let (port, count) = answering(1).await;
    let page = post(&port, &"d\n1\n".repeat(1001)).await;
    assert!(page.contains("(No more is answered here"));
    assert_eq!(count.load(Ordering::SeqCst), 1000);
    let page = post(&port, &"d\n1\n".repeat(999)).await;
    assert!(!page.contains("(No more is answered here"));
    within(port.close()).await;
}

/// All that had been read was handled before any other task ran: ten thousand messages in 64 KiB.
#[tokio::test]
async fn others_have_their_turn_among_many_messages() {
    const MESSAGES: usize = 100_000;
    let count = Arc::new(AtomicUsize::new(0));
    let counted = count.clone();
    let options = PortOptions::new().handler(move |_| {
        counted.fetch_add(1, Ordering::SeqCst);
        Answer::Nothing
    });
    let port = open("/port", options).await;
    let mut raw = Raw::text(&port, "talker").await;
    let sending = tokio::spawn(async move {
        raw.send("D\r\n1\r\n".repeat(MESSAGES)).await;
        raw
    });
    let (mut seen, mut most) = (0, 0);
    let watching = async {
        while seen < MESSAGES {
            tokio::task::yield_now().await;
            let now = count.load(Ordering::SeqCst);
            most = most.max(now - seen);
            seen = now;
        }
    };
    within(watching).await;
    // A turn lasts 500 µs; a message takes more than 61 ns.
    assert!(most <= 8192, "{most} at once");
    drop(sending.await);
    within(port.close()).await;
}
