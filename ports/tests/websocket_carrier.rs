//! A web page at a port: it sends requests and messages, reads, and closes, in WebSocket frames.

use crate::common;

use common::{Raw, bottle, next, open, until, within};
use yarp_ports::{Answer, Port, PortOptions, Queue};
use yarp_wire::{Bottle, WireVersion};

const REQUEST: &str = "GET /?ws HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\n\
    Connection: Upgrade\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\
    Sec-WebSocket-Version: 13\r\n\r\n";
const RESPONSE: &str = "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\n\
    Connection: Upgrade\r\nSec-WebSocket-Accept: s3pPLMBiTxaQ9kYGzzhZRbK+xOo=\r\n\r\n";

pub(crate) async fn page(port: &Port) -> Raw {
    let mut raw = Raw::to(port).await;
    raw.send(REQUEST).await;
    raw.expect(RESPONSE).await;
    raw
}

/// Returns a short frame as a browser sends it, under a mask that changes nothing.
pub(crate) fn frame(first: u8, body: &[u8]) -> Vec<u8> {
    assert!(body.len() < 126);
    [&[first, 0x80 | body.len() as u8, 0, 0, 0, 0], body].concat()
}

/// Returns a short frame of a port.
fn answer(body: &[u8]) -> Vec<u8> {
    [&[0x82, body.len() as u8], body].concat()
}

fn block(letter: u8) -> [u8; 8] {
    [0, 0, 0, 0, b'~', letter, 0, 1]
}

pub(crate) fn message(letter: u8, content: &Bottle) -> Vec<u8> {
    let content = content.encode(WireVersion::V3);
    frame(0x82, &[&block(letter)[..], &content].concat())
}

#[tokio::test]
async fn a_page_asks_and_sends() {
    let options = PortOptions::new()
        .handler(|message| message.bottle().map_or(Answer::Nothing, Answer::reply));
    let port = open("/port", options).await;
    let mut raw = page(&port).await;
    until(|| port.inputs() == ["web"]).await;
    let question = bottle("how \"much\" 1");
    raw.send(message(b'd', &question)).await;
    raw.expect(answer(&question.encode(WireVersion::V3))).await;
    raw.send(frame(0x89, b"there?")).await;
    raw.expect(b"\x8a\x06there?").await;
    raw.send(message(b'a', &bottle("[ver]"))).await;
    raw.expect(answer(&bottle("[ver] 1 2 3").encode(WireVersion::V3)))
        .await;
    raw.send(frame(0x88, b"\x03\xe8")).await;
    assert_eq!(raw.ended().await, b"\x88\x02\x03\xe8");
    until(|| port.inputs().is_empty()).await;
    within(port.close()).await;
}

#[tokio::test]
async fn a_message_may_be_cut_into_frames() {
    let port = open("/port", PortOptions::new().queue(Queue::Wait(4))).await;
    let mut raw = page(&port).await;
    let content = bottle("a (b c)").encode(WireVersion::V3);
    raw.send(frame(0x01, &block(b'D')[..3])).await;
    raw.send(frame(0x89, b"")).await;
    raw.send(frame(0x00, &block(b'D')[3..])).await;
    raw.send(frame(0x80, &content)).await;
    raw.expect(b"\x8a\x00").await;
    assert_eq!(next(&port).await, "a (b c)");
    raw.send(frame(0x82, &block(b'q'))).await;
    assert_eq!(raw.ended().await, b"\x88\x02\x03\xe8");
    within(port.close()).await;
}

/// Regression: the port waited for the length of the whole message once more, and so forever.
#[tokio::test]
async fn a_large_message_may_come_in_parts() {
    let port = open("/port", PortOptions::new().queue(Queue::Wait(4))).await;
    let mut raw = page(&port).await;
    let text = "x".repeat(100_000);
    let content = Bottle::of(text.as_str()).encode(WireVersion::V3);
    let message = [&block(b'D')[..], &content].concat();
    let (first, rest) = message.split_at(60_000);
    for (head, part) in [(0x02, first), (0x80, rest)] {
        let length = (part.len() as u16).to_be_bytes();
        raw.send([&[head, 0x80 | 126, length[0], length[1], 0, 0, 0, 0], part].concat())
            .await;
        raw.send(frame(0x89, b"")).await;
        // It has read that far.
        raw.expect(b"\x8a\x00").await;
    }
    assert_eq!(next(&port).await, text);
    within(port.close()).await;
}

#[tokio::test]
async fn a_page_reads_what_the_port_writes() {
    let port = open("/port", PortOptions::new()).await;
    let mut raw = page(&port).await;
    raw.send(frame(0x82, &block(b'r'))).await;
    until(|| port.outputs() == ["web"]).await;
    let small = bottle("1 2");
    assert_eq!(within(port.write(&small)).await, 1);
    raw.expect([answer(&block(b'D')), answer(&small.encode(WireVersion::V3))].concat())
        .await;
    // Large enough to be sent from where it is.
    let large = Bottle::of("x".repeat(100_000));
    let bytes = large.encode(WireVersion::V3);
    assert_eq!(within(port.write(&large)).await, 1);
    let head = [&[0x82, 127][..], &(bytes.len() as u64).to_be_bytes()].concat();
    raw.expect([&answer(&block(b'D')), &head, &bytes[..]].concat())
        .await;
    raw.send(frame(0x89, b"x")).await;
    raw.expect(b"\x8a\x01x").await;
    within(port.close()).await;
    let goodbye = raw.ended().await;
    assert!(goodbye.ends_with(b"\x88\x02\x03\xe8"), "{goodbye:02x?}");
}

/// Regression: the connection was closed before the answer arrived, which reset it: browsers
/// reported that to the page.
#[tokio::test]
async fn a_port_that_closes_waits_for_the_answer_of_its_reader() {
    // On a machine that stalls for long enough the wait has timed out.
    for left in (0..5).rev() {
        let port = open("/port", PortOptions::new()).await;
        let mut pages = Vec::new();
        for number in 1..=2 {
            let mut raw = page(&port).await;
            raw.send(frame(0x82, &block(b'r'))).await;
            until(|| port.outputs().len() == number).await;
            pages.push(raw);
        }
        let closing = tokio::spawn(port.close());
        for raw in &mut pages {
            let goodbye = raw.rest().await;
            assert!(goodbye.ends_with(b"\x88\x02\x03\xe8"), "{goodbye:02x?}");
            raw.try_send(frame(0x88, b"\x03\xe8")).await;
        }
        within(closing).await.unwrap();
        let resets = pages.iter().filter(|raw| raw.was_reset()).count();
        if resets == 0 {
            return;
        }
        assert!(left > 0, "each time {resets} resets");
    }
}

#[tokio::test]
async fn a_port_that_closes_leaves_a_reader_that_does_not_answer() {
    let port = open("/port", PortOptions::new()).await;
    let mut raw = page(&port).await;
    raw.send(frame(0x82, &block(b'r'))).await;
    until(|| port.outputs() == ["web"]).await;
    within(port.close()).await;
    let goodbye = raw.ended().await;
    assert!(goodbye.ends_with(b"\x88\x02\x03\xe8"), "{goodbye:02x?}");
}

/// Regression: its close frame was not answered: browsers reported an aborted connection to the
/// page.
#[tokio::test]
async fn a_reader_that_closes_is_answered_and_forgotten() {
    let port = open("/port", PortOptions::new()).await;
    let mut raw = page(&port).await;
    raw.send(frame(0x82, &block(b'r'))).await;
    until(|| port.outputs() == ["web"]).await;
    raw.send(frame(0x88, b"\x03\xe9gone")).await;
    assert_eq!(raw.ended().await, b"\x88\x02\x03\xe9");
    until(|| port.outputs().is_empty()).await;
    within(port.close()).await;
}

#[tokio::test]
async fn protocol_violations_close_the_connection() {
    let port = open("/port", PortOptions::new()).await;
    for bad in [
        b"\x82\x01a".to_vec(),
        frame(0xc2, b"a"),
        frame(0x80, b"a"),
        frame(0x82, b"no block"),
        [&b"\x82\xff"[..], &u64::MAX.to_be_bytes()].concat(),
    ] {
        let mut raw = page(&port).await;
        raw.send(bad).await;
        assert_eq!(raw.ended().await, b"");
    }
    let mut raw = Raw::to(&port).await;
    raw.send(b"GET /?ws HTTP/1.1\r\n\r\n").await;
    assert!(
        raw.ended()
            .await
            .starts_with(b"HTTP/1.1 400 Bad Request\r\n")
    );
    within(port.close()).await;
}

#[tokio::test]
async fn a_port_cannot_begin_it() {
    let port = open("/port", PortOptions::new()).await;
    let reader = open("/reader", PortOptions::new().queue(Queue::Latest)).await;
    let error = within(port.connect(&common::at(&reader, "websocket"))).await;
    assert!(matches!(
        error,
        Err(yarp_ports::PortError::NoCarrier { .. })
    ));
}
