//! Messages travel in datagrams; other datagrams have no effect.

use crate::common;

use common::{Raw, at, bottle, connect, next, open, until, within};
use tokio::net::UdpSocket;
use yarp_ports::{PortOptions, Queue};
use yarp_wire::Bottle;
use yarp_wire::datagram;

#[tokio::test]
async fn messages_small_and_large_arrive_with_their_envelope() {
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(100))).await;
    let writer = open("/writer", PortOptions::new()).await;
    connect(&writer, &reader, "udp").await;
    // Larger than one datagram; one at a time, so that no buffer runs over.
    for message in [
        bottle("1 2.5 hello"),
        Bottle::of("x".repeat(200_000)),
        bottle("last"),
    ] {
        assert_eq!(writer.write_with(&message, Some("7 1.5".into())).await, 1);
        let received = within(reader.read()).await.unwrap();
        assert_eq!(received.bottle().unwrap(), message);
        assert_eq!(received.stamp().unwrap().count, 7);
        assert_eq!(&*received.from, "/writer");
    }
    within(writer.close()).await;
    // The reader was notified over a separate connection.
    until(|| reader.inputs().is_empty()).await;
    within(reader.close()).await;
}

/// Connecting them a second time makes the reader drop its input from the writer, not its output to
/// it.
#[tokio::test]
async fn others_connect_two_ports_both_ways() {
    use yarp_ports::{Network, remote_admin};
    let left = open("/left", PortOptions::new().queue(Queue::Wait(10))).await;
    let right = open("/right", PortOptions::new().queue(Queue::Wait(10))).await;
    let network = Network::none().with_timeout(common::DEADLINE);
    for (from, to) in [(&left, &right), (&right, &left)] {
        let (from, to) = (at(from, "tcp"), at(to, "tcp"));
        let said = within(remote_admin::connect(&network, &from, &to, Some("udp"))).await;
        said.unwrap();
    }
    for (from, to) in [(&left, &right), (&right, &left)] {
        assert_eq!(from.write(&bottle("hello")).await, 1);
        assert_eq!(next(to).await, "hello");
    }
    within(left.close()).await;
    within(right.close()).await;
}

#[tokio::test]
async fn foreign_datagrams_have_no_effect() {
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(100))).await;
    // The header by hand, to learn where the datagrams go.
    let mut header = Raw::to(&reader).await;
    header.send(b"YA\x61\x1e\0\0RP\x08\0\0\0/writer\0").await;
    let reply = header.receive(8).await;
    let number = i32::from_le_bytes(reply[2..6].try_into().unwrap());
    let socket = UdpSocket::bind("127.0.0.1:0").await.unwrap();
    socket
        .connect(("127.0.0.1", u16::try_from(number).unwrap()))
        .await
        .unwrap();
    drop(header);

    let mut message = bytes::BytesMut::new();
    let carrier = yarp_wire::carrier::Carrier::by_name("udp").unwrap();
    let content = bottle("good 1");
    yarp_wire::connection::put_message(
        &mut message,
        carrier,
        &yarp_wire::message::Command::data(false),
        Some(&content),
        yarp_wire::WireVersion::V3,
    );
    let good = datagram::encode(0, &message);
    let mut damaged = good.clone();
    damaged[30] ^= 1;
    let lying = {
        // An index that announces a gigabyte.
        let mut bytes = message.to_vec();
        bytes[18..22].copy_from_slice(&1_000_000_000i32.to_le_bytes());
        datagram::encode(0, &bytes)
    };
    for stranger in [&b""[..], b"x", &[0xff; 100], &damaged, &lying, &good[..20]] {
        socket.send(stranger).await.unwrap();
        socket.send(&good).await.unwrap();
        assert_eq!(next(&reader).await, "good 1");
    }
    within(reader.close()).await;
}

#[tokio::test]
async fn a_closed_reader_delays_no_other() {
    let reader = open("/reader", PortOptions::new().queue(Queue::Latest)).await;
    let writer = open("/writer", PortOptions::new()).await;
    within(writer.connect(&at(&reader, "udp"))).await.unwrap();
    drop(reader);
    for number in 0..100 {
        within(writer.write(&Bottle::of(number))).await;
    }
    within(writer.close()).await;
}
