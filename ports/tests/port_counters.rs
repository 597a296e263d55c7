//! A port counts the messages of each of its connections, and reports the counts on request.

use crate::common;

use std::time::{SystemTime, UNIX_EPOCH};

use common::{Raw, connect, open, until, within};
use yarp_ports::{Answer, ConnectionCounters, Port, PortOptions, Queue, Traffic};
use yarp_wire::{Bottle, Stamp};

fn only(port: &Port) -> ConnectionCounters {
    let counters = port.counters();
    assert_eq!(counters.connections.len(), 1, "{counters:?}");
    counters.connections[0].clone()
}

fn figures(traffic: Traffic) -> (u64, u64, u64) {
    (traffic.messages, traffic.bytes, traffic.dropped)
}

/// A bottle of one integer: code, count, code of the item, item.
const LENGTH: u64 = 12;

#[tokio::test]
async fn both_ends_count_messages_and_bytes() {
    for carrier in ["tcp", "fast_tcp", "udp"] {
        let reader = open("/rd", PortOptions::new().queue(Queue::Wait(100))).await;
        let writer = open("/wr", PortOptions::new()).await;
        connect(&writer, &reader, carrier).await;
        for i in 0..5 {
            assert_eq!(within(writer.write(&Bottle::of(i))).await, 1);
        }
        within(writer.flush()).await;
        until(|| reader.counters().waiting == 5).await;
        let (sent, received) = (only(&writer), only(&reader));
        assert_eq!((sent.peer.as_str(), sent.incoming), ("/rd", false));
        assert_eq!((received.peer.as_str(), received.incoming), ("/wr", true));
        assert_eq!(
            (sent.carrier.as_str(), received.carrier.as_str()),
            (carrier, carrier)
        );
        assert_eq!(figures(sent.traffic), (5, 5 * LENGTH, 0));
        assert_eq!(figures(received.traffic), (5, 5 * LENGTH, 0));
        assert_eq!((sent.queued, sent.unanswered), (0, 0));
        assert_eq!((sent.age, received.age), (None, None));
    }
}

#[tokio::test]
async fn counts_of_closed_connections_remain() {
    let reader = open("/rd", PortOptions::new().queue(Queue::Wait(100))).await;
    let writer = open("/wr", PortOptions::new()).await;
    for _ in 0..2 {
        connect(&writer, &reader, "tcp").await;
        assert_eq!(within(writer.write(&Bottle::of(1))).await, 1);
        assert!(within(writer.disconnect("/rd")).await);
        until(|| reader.inputs().is_empty()).await;
    }
    let (sent, received) = (writer.counters(), reader.counters());
    assert!(sent.connections.is_empty() && received.connections.is_empty());
    assert_eq!(figures(sent.sent), (2, 2 * LENGTH, 0));
    assert_eq!(figures(received.received), (2, 2 * LENGTH, 0));
    assert_eq!(figures(received.sent), (0, 0, 0));
}

#[tokio::test]
async fn a_dropped_message_counts_for_the_connection_that_brought_it() {
    let reader = open("/rd", PortOptions::new().queue(Queue::DropOldest(1))).await;
    let (first, second) = (
        open("/first", PortOptions::new()).await,
        open("/second", PortOptions::new()).await,
    );
    connect(&first, &reader, "tcp").await;
    connect(&second, &reader, "tcp").await;
    for writer in [&first, &first, &second, &second, &second] {
        assert_eq!(within(writer.write(&Bottle::of(1))).await, 1);
    }
    // The last message of each has arrived: dropped ones have been counted.
    let counters = reader.counters();
    let dropped = |peer: &str| {
        let mut all = counters.connections.iter();
        all.find(|counted| counted.peer == peer)
            .unwrap()
            .traffic
            .dropped
    };
    assert_eq!((dropped("/first"), dropped("/second")), (2, 2));
    assert_eq!((counters.received.dropped, reader.dropped()), (4, 4));
    assert_eq!(counters.waiting, 1);
}

#[tokio::test]
async fn a_message_that_a_busy_reader_missed_counts_as_dropped() {
    let reader = open("/rd", PortOptions::new().queue(Queue::Wait(1))).await;
    let writer = open("/wr", PortOptions::new()).await;
    connect(&writer, &reader, "tcp").await;
    let message = Bottle::of(1);
    assert_eq!(within(writer.write(&message)).await, 1);
    // The reader has no room for this one: it is not acknowledged.
    assert_eq!(within(writer.write_strict(&message, None)).await, 1);
    assert_eq!(writer.write_if_idle(&message, None), 0);
    let sent = only(&writer);
    assert_eq!(figures(sent.traffic), (2, 2 * LENGTH, 1));
    assert_eq!(sent.unanswered, 1);
    within(reader.read()).await.unwrap();
    within(writer.flush()).await;
    assert_eq!(only(&writer).unanswered, 0);
}

#[tokio::test]
async fn the_queue_grows_before_a_reader_that_stops_and_is_empty_once_it_has_read() {
    let writer = open("/wr", PortOptions::new()).await;
    let mut reader = Raw::text(&writer, "/rd").await;
    reader.send("r\r\n").await;
    until(|| writer.outputs() == ["/rd"]).await;
    // Far more than sockets hold.
    let message = Bottle::of("x".repeat(100_000));
    let mut written = 0;
    let queued = || only(&writer).queued;
    let filling = async {
        while queued() < 3 * 100_000 {
            written += writer.try_write(&message, None, 100);
            tokio::task::yield_now().await;
        }
    };
    within(filling).await;
    let before = queued();
    assert_eq!(writer.try_write(&message, None, 100), 1);
    assert!(queued() >= before + 100_000, "{} {before}", queued());
    assert_eq!(figures(only(&writer).traffic).0, written as u64 + 1);
    let line = format!("D\r\n{message}\r\n");
    for _ in 0..=written {
        reader.expect(&line).await;
    }
    until(|| queued() == 0).await;
}

#[tokio::test]
async fn the_age_is_that_of_the_newest_stamp() {
    let reader = open("/rd", PortOptions::new().queue(Queue::Wait(100))).await;
    let writer = open("/wr", PortOptions::new()).await;
    connect(&writer, &reader, "tcp").await;
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
    let hour_ago = Stamp::new(7, now.as_secs_f64() - 3600.0);
    let message = Bottle::of(1);
    within(writer.write_with(&message, Some("0 1.5".into()))).await;
    within(writer.write_with(&message, Some(hour_ago.into()))).await;
    // A message without envelope says nothing about age.
    within(writer.write(&message)).await;
    for counted in [only(&writer), only(&reader)] {
        assert_eq!(counted.stamp.unwrap().count, 7);
        assert!(counted.age.unwrap() >= 3599.0, "{counted:?}");
    }
    within(writer.write_with(&message, Some("no stamp".into()))).await;
    assert_eq!((only(&reader).stamp, only(&reader).age), (None, None));
}

#[tokio::test]
async fn requests_count_and_administration_does_not() {
    let server = open(
        "/srv",
        PortOptions::new().handler(|_| Answer::reply(Bottle::of(1))),
    )
    .await;
    let client = open("/cl", PortOptions::new().rpc_client()).await;
    connect(&client, &server, "tcp").await;
    let _: Bottle = within(client.call(&Bottle::of(1))).await.unwrap();
    let mut admin = Raw::text(&server, "admin").await;
    let ask = "a\r\n[prop] [get] counters\r\n";
    let zero = "(messages 0) (bytes 0) (dropped 0)";
    let one = format!("(messages 1) (bytes {LENGTH}) (dropped 0)");
    let answer = format!(
        "(port (received {one}) (sent {zero}) (waiting 0)) \
         (in (from \"/cl\") (carrier tcp) {one}) (in (from admin) (carrier text) {zero})\r\n"
    );
    for _ in 0..2 {
        admin.send(ask).await;
        admin.expect(&answer).await;
    }
    let mut admin = Raw::text(&client, "admin").await;
    admin.send(ask).await;
    admin
        .expect(format!(
            "(port (received {zero}) (sent {one}) (waiting 0)) (in (from admin) (carrier text) {zero}) \
             (out (to \"/srv\") (carrier tcp) {one} (queued 0) (unanswered 0))\r\n"
        ))
        .await;
}

/// Properties belong to programs: in stock `counters` is a name like any other.
#[tokio::test]
async fn a_property_of_that_name_goes_first() {
    let port = open("/rd", PortOptions::new()).await;
    let mut admin = Raw::text(&port, "admin").await;
    admin
        .send("a\r\n[prop] [set] counters 5\r\na\r\n[prop] [get] counters\r\n")
        .await;
    admin.expect("[ok]\r\n5\r\n").await;
}
