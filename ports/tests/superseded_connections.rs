//! A newer connection from the same port supersedes the older one.

use crate::common;

use common::{ACK, Raw, bottle, next, open, tcp_header, tcp_message, until};
use yarp_ports::{PortOptions, Queue};

#[tokio::test]
async fn a_newer_connection_of_a_port_ends_the_older() {
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(10))).await;
    let old = Raw::tcp(&reader, "/writer").await;
    until(|| reader.inputs() == ["/writer"]).await;
    let mut new = Raw::tcp(&reader, "/writer").await;
    assert!(old.ended().await.is_empty());
    until(|| reader.inputs() == ["/writer"]).await;
    new.send(tcp_message(b'D', &bottle("new"))).await;
    assert_eq!(next(&reader).await, "new");
    new.expect(ACK).await;
}

#[tokio::test]
async fn the_carrier_makes_no_difference() {
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(10))).await;
    let old = Raw::tcp(&reader, "/writer").await;
    let mut new = Raw::text(&reader, "/writer").await;
    assert!(old.ended().await.is_empty());
    new.send("d\r\nnew\r\n").await;
    assert_eq!(next(&reader).await, "new");
}

/// An older connection that waited for room, or for an answer, was not ended.
#[tokio::test]
async fn an_older_connection_that_waits_for_room_is_ended_too() {
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(1))).await;
    let mut old = Raw::tcp(&reader, "/writer").await;
    old.send(tcp_message(b'D', &bottle("1"))).await;
    old.expect(ACK).await;
    old.send(tcp_message(b'D', &bottle("2"))).await;
    old.send(tcp_message(b'D', &bottle("3"))).await;
    let mut new = Raw::tcp(&reader, "/writer").await;
    old.ended().await;
    new.send(tcp_message(b'D', &bottle("new"))).await;
    let mut last = next(&reader).await;
    assert_eq!(last, "1");
    while last != "new" {
        last = next(&reader).await;
    }
}

/// The connection whose header was read first was taken for the older one: a writer that ended its
/// connection and made another at once could lose the new one to the old.
#[tokio::test]
async fn the_newer_connection_stays_also_if_its_header_is_read_first() {
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(10))).await;
    for carrier in ["tcp", "text", "udp"] {
        let header = match carrier {
            "tcp" => tcp_header("/writer"),
            "udp" => b"YA\x61\x1e\0\0RP\x08\0\0\0/writer\0".to_vec(),
            _ => b"CONNECT /writer\r\n".to_vec(),
        };
        let (first, last) = header.split_at(header.len() - 1);
        let mut old = Raw::to(&reader).await;
        old.send(first).await;
        // The later connection is answered later.
        let between = Raw::tcp(&reader, "/between").await;
        let mut new = Raw::tcp(&reader, "/writer").await;
        old.send(last).await;
        assert_eq!(old.ended().await, b"", "{carrier}");
        new.send(tcp_message(b'D', &bottle("new"))).await;
        assert_eq!(next(&reader).await, "new", "{carrier}");
        new.expect(ACK).await;
        assert_eq!(reader.inputs(), ["/between", "/writer"], "{carrier}");
        drop((between, new));
        until(|| reader.inputs().is_empty()).await;
    }
}

#[tokio::test]
async fn programs_that_are_not_ports_do_not_supersede_each_other() {
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(10))).await;
    let mut first = Raw::text(&reader, "admin").await;
    let mut second = Raw::text(&reader, "admin").await;
    for raw in [&mut first, &mut second] {
        raw.send("d\r\nhere\r\n").await;
        assert_eq!(next(&reader).await, "here");
    }
    assert_eq!(reader.inputs(), ["admin", "admin"]);
}

#[tokio::test]
async fn other_ports_stay() {
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(10))).await;
    let mut other = Raw::tcp(&reader, "/other").await;
    let old = Raw::tcp(&reader, "/writer").await;
    let _new = Raw::tcp(&reader, "/writer").await;
    old.ended().await;
    other.send(tcp_message(b'D', &bottle("still here"))).await;
    assert_eq!(next(&reader).await, "still here");
}
