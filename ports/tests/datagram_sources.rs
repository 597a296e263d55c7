//! Only the program that announced itself is heard over `udp`: its host, and of that the first port.

use crate::common;

use bytes::BytesMut;
use std::net::{Ipv4Addr, SocketAddrV4};

use common::{Raw, bottle, next, open, until, within};
use tokio::net::UdpSocket;
use yarp_ports::{Port, PortOptions, Queue};
use yarp_wire::carrier::Carrier;
use yarp_wire::connection::put_message;
use yarp_wire::message::Command;
use yarp_wire::{WireVersion, datagram};

/// One datagram that holds a message.
fn packet(text: &str) -> Vec<u8> {
    packet_over("udp", text)
}

fn packet_over(carrier: &str, text: &str) -> Vec<u8> {
    let mut message = BytesMut::new();
    let carrier = Carrier::by_name(carrier).unwrap();
    let (command, content) = (Command::data(false), bottle(text));
    put_message(
        &mut message,
        carrier,
        &command,
        Some(&content),
        WireVersion::V3,
    );
    datagram::encode(0, &message).to_vec()
}

/// Sends the header of `/writer` from 127.0.0.1; where its datagrams go is the answer.
async fn announce(reader: &Port) -> (&'static str, u16) {
    let mut header = Raw::to(reader).await;
    header.send(b"YA\x61\x1e\0\0RP\x08\0\0\0/writer\0").await;
    let reply = header.receive(8).await;
    let number = i32::from_le_bytes(reply[2..6].try_into().unwrap());
    ("127.0.0.1", u16::try_from(number).unwrap())
}

#[tokio::test]
async fn datagrams_of_others_are_dropped() {
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(100))).await;
    let place = announce(&reader).await;
    let writer = UdpSocket::bind("127.0.0.1:0").await.unwrap();
    let others = ["127.0.0.66:0", "127.0.0.1:0"];
    let other_host = UdpSocket::bind(others[0]).await.unwrap();
    let other_port = UdpSocket::bind(others[1]).await.unwrap();
    // Before the writer has sent anything only its host is known.
    other_host.send_to(&packet("bad 1"), place).await.unwrap();
    writer.send_to(&packet("good 1"), place).await.unwrap();
    other_port.send_to(&packet("bad 2"), place).await.unwrap();
    writer.send_to(&packet("good 2"), place).await.unwrap();
    for expected in ["good 1", "good 2"] {
        assert_eq!(next(&reader).await, expected);
    }
    let counted = || reader.counters().received.dropped;
    assert_eq!(counted(), 2);
    // The system keeps others out of the buffer from now on; an error of the sender is the system's answer.
    for other in [&other_host, &other_port] {
        let _ = other.send_to(&packet("bad 3"), place).await;
    }
    writer.send_to(&packet("good 3"), place).await.unwrap();
    assert_eq!(next(&reader).await, "good 3");
    assert_eq!(counted(), 2);
    within(reader.close()).await;
}

/// A socket of an address that sends to groups of this machine.
async fn group_sender(address: &str) -> UdpSocket {
    let socket = UdpSocket::bind((address, 0)).await.unwrap();
    let raw = socket2::SockRef::from(&socket);
    raw.set_multicast_if_v4(&Ipv4Addr::LOCALHOST).unwrap();
    raw.set_multicast_loop_v4(true).unwrap();
    socket
}

#[tokio::test]
async fn a_group_drops_datagrams_of_other_hosts() {
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(100))).await;
    let writer = group_sender("127.0.0.1").await;
    // Another connection of the writer may be the one that transmits.
    let also_writer = group_sender("127.0.0.1").await;
    let other_host = group_sender("127.0.0.66").await;
    // A number that nobody has now.
    let number = writer.local_addr().unwrap().port();
    let group = SocketAddrV4::new(Ipv4Addr::new(239, 255, 77, 3), number);
    let mut header = Raw::to(&reader).await;
    header.send(b"YA\x62\x1e\0\0RP\x08\0\0\0/writer\0").await;
    header.send(group.ip().octets()).await;
    header.send(number.to_be_bytes()).await;
    until(|| reader.inputs() == ["/writer"]).await;
    for (socket, text) in [
        (&other_host, "bad 1"),
        (&writer, "good 1"),
        (&other_host, "bad 2"),
        (&also_writer, "good 2"),
    ] {
        let packet = packet_over("mcast", text);
        socket.send_to(&packet, group).await.unwrap();
    }
    for expected in ["good 1", "good 2"] {
        assert_eq!(next(&reader).await, expected);
    }
    assert_eq!(reader.counters().received.dropped, 2);
    within(reader.close()).await;
}
