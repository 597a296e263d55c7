//! Datagrams that are lost, duplicated, reordered or damaged: received messages are whole, lost
//! ones are counted, and afterwards transmission recovers.

use crate::common;

use std::net::{Ipv4Addr, SocketAddrV4};

use common::{Raw, open, until, within};
use tokio::io::{AsyncReadExt, AsyncWriteExt, copy_bidirectional};
use tokio::net::{TcpListener, TcpStream, UdpSocket};
use tokio::sync::watch;
use yarp_ports::{Port, PortOptions, Queue};
use yarp_wire::carrier::Carrier;
use yarp_wire::connection::put_message;
use yarp_wire::message::Command;
use yarp_wire::{Bottle, WireVersion, datagram, framed_number};

/// Messages sent while the network is bad.
const MESSAGES: i32 = 400;

/// Returns the message of a number: every seventh is larger than a datagram.
fn content(number: i32) -> Bottle {
    let length = match number % 7 {
        0 => 150_000,
        _ => usize::try_from(number).unwrap(),
    };
    Bottle::from_iter([number.into(), "x".repeat(length).into()])
}

fn number_of(content: &Bottle) -> i32 {
    content.get(0).and_then(|value| value.as_i64()).unwrap() as i32
}

/// A network that does something to one datagram in four.
#[derive(Default)]
struct Mischief {
    seed: u64,
    late: Option<Vec<u8>>,
    done: [u32; 5],
}

impl Mischief {
    fn random(&mut self) -> usize {
        // A generator of Lehmer's.
        self.seed = (self.seed + 1) * 48_271 % 0x7fff_ffff;
        self.seed as usize
    }

    /// Returns the datagrams that leave the proxy when `datagram` enters it.
    fn pass(&mut self, mut datagram: Vec<u8>) -> Vec<Vec<u8>> {
        let kind = self.random() % 20;
        let place = self.random() % datagram.len();
        if let Some(done) = self.done.get_mut(kind) {
            *done += 1;
        }
        let mut out = Vec::new();
        match kind {
            0 => {}
            1 => out = vec![datagram.clone(), datagram],
            // After the next.
            2 if self.late.is_none() => {
                self.late = Some(datagram);
                return out;
            }
            3 => {
                datagram[place] ^= 1 << (place % 8);
                out.push(datagram);
            }
            4 => out.push(datagram[..place].to_vec()),
            _ => out.push(datagram),
        }
        out.extend(self.late.take());
        out
    }

    /// Returns whether it has done everything that it can do.
    #[track_caller]
    fn has_done_all(&self) {
        assert!(self.done.iter().all(|times| *times > 0), "{:?}", self.done);
    }
}

/// Runs a proxy between a writer over `udp` and `reader`; it disturbs datagrams while `bad` is set.
async fn proxy(reader: &Port, bad: watch::Receiver<bool>) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let contact = format!("udp://{}{}", listener.local_addr().unwrap(), reader.name());
    let to = reader.tcp_port();
    tokio::spawn(async move {
        loop {
            let (mut writer, _) = listener.accept().await.unwrap();
            let mut reader = TcpStream::connect(("127.0.0.1", to)).await.unwrap();
            let mut magic = [0; 8];
            writer.read_exact(&mut magic).await.unwrap();
            reader.write_all(&magic).await.unwrap();
            if Carrier::detect(&magic).unwrap().name != "udp" {
                // Questions and goodbyes.
                copy_bidirectional(&mut writer, &mut reader).await.unwrap();
                continue;
            }
            let inside = UdpSocket::bind("127.0.0.1:0").await.unwrap();
            let outside = UdpSocket::bind("127.0.0.1:0").await.unwrap();
            let own = i32::from(inside.local_addr().unwrap().port());
            let mut name = vec![0; 4];
            writer.read_exact(&mut name).await.unwrap();
            let length = u32::from_le_bytes(name[..].try_into().unwrap());
            name.resize(4 + length as usize, 0);
            writer.read_exact(&mut name[4..]).await.unwrap();
            reader.write_all(&name).await.unwrap();
            reader.read_exact(&mut magic).await.unwrap();
            let there = framed_number::decode(&magic).unwrap() as u16;
            outside.connect(("127.0.0.1", there)).await.unwrap();
            writer.write_all(&framed_number::encode(own)).await.unwrap();
            let bad = bad.clone();
            tokio::spawn(async move {
                let mut mischief = Mischief::default();
                let mut buffer = vec![0; 70_000];
                loop {
                    let length = inside.recv(&mut buffer).await.unwrap();
                    let datagram = buffer[..length].to_vec();
                    let out = match *bad.borrow() {
                        true => mischief.pass(datagram),
                        false => {
                            mischief.has_done_all();
                            vec![datagram]
                        }
                    };
                    for datagram in out {
                        // A datagram that the system does not accept is lost as well.
                        let _ = outside.send(&datagram).await;
                    }
                }
            });
        }
    });
    contact
}

/// Reads until the message `last` arrives; returns the number of earlier ones. All are whole.
async fn read_until(reader: &Port, last: i32) -> i32 {
    let mut count = 0;
    loop {
        let read = within(reader.read()).await.unwrap();
        let bottle = read.bottle().unwrap();
        let number = number_of(&bottle);
        assert!(bottle == content(number), "{number} is not whole");
        if number == last {
            return count;
        }
        count += 1;
    }
}

#[tokio::test]
async fn a_writer_and_a_reader_survive_a_bad_network() {
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(10_000))).await;
    let writer = open("/writer", PortOptions::new()).await;
    let (set, bad) = watch::channel(true);
    let contact = proxy(&reader, bad).await;
    within(writer.connect(&contact)).await.unwrap();
    until(|| reader.inputs() == ["/writer"]).await;
    for number in 0..MESSAGES {
        assert_eq!(within(writer.write(&content(number))).await, 1);
        within(writer.flush()).await;
        // Not more than the buffers of the system hold.
        tokio::time::sleep(std::time::Duration::from_micros(200)).await;
    }
    set.send_replace(false);
    // The first may still be lost with what was late.
    let last = MESSAGES + 1;
    let recovering = async {
        loop {
            writer.write(&content(last)).await;
            tokio::time::sleep(std::time::Duration::from_millis(10)).await;
        }
    };
    let count = tokio::select! {
        count = read_until(&reader, last) => count,
        () = recovering => unreachable!(),
    };
    assert!(count > MESSAGES / 2, "{count} of {MESSAGES}");
    let received = reader.counters().received;
    assert!(received.dropped > 0, "{received:?}");
    while reader.try_read().is_some() {}
    for number in 0..20 {
        assert_eq!(within(writer.write(&content(number))).await, 1);
        // Repeated or delayed datagrams may arrive before it.
        read_until(&reader, number).await;
    }
    within(writer.close()).await;
    until(|| reader.inputs().is_empty()).await;
    within(reader.close()).await;
}

#[tokio::test]
async fn a_reader_of_a_group_survives_a_bad_network() {
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(10_000))).await;
    let socket = UdpSocket::bind("127.0.0.1:0").await.unwrap();
    // A number that nobody has now.
    let group = SocketAddrV4::new(
        Ipv4Addr::new(239, 255, 77, 2),
        socket.local_addr().unwrap().port(),
    );
    let raw = socket2::SockRef::from(&socket);
    raw.set_multicast_if_v4(&Ipv4Addr::LOCALHOST).unwrap();
    raw.set_multicast_loop_v4(true).unwrap();
    // The header of a writer, and the group.
    let mut header = Raw::to(&reader).await;
    header.send(b"YA\x62\x1e\0\0RP\x08\0\0\0/writer\0").await;
    header.send(group.ip().octets()).await;
    header.send(group.port().to_be_bytes()).await;
    until(|| reader.inputs() == ["/writer"]).await;

    let carrier = Carrier::by_name("mcast").unwrap();
    let datagrams = |number: i32| -> Vec<Vec<u8>> {
        let mut message = bytes::BytesMut::new();
        let content = content(number);
        let command = Command::data(false);
        put_message(
            &mut message,
            carrier,
            &command,
            Some(&content),
            WireVersion::V3,
        );
        datagram::split(&message, 60_000).collect()
    };
    let mut mischief = Mischief::default();
    for number in 0..MESSAGES {
        for datagram in datagrams(number) {
            for datagram in mischief.pass(datagram) {
                socket.send_to(&datagram, group).await.unwrap();
            }
        }
        tokio::time::sleep(std::time::Duration::from_micros(200)).await;
    }
    mischief.has_done_all();
    let last = MESSAGES + 1;
    let recovering = async {
        loop {
            for datagram in datagrams(last) {
                socket.send_to(&datagram, group).await.unwrap();
            }
            tokio::time::sleep(std::time::Duration::from_millis(10)).await;
        }
    };
    let count = tokio::select! {
        count = read_until(&reader, last) => count,
        () = recovering => unreachable!(),
    };
    assert!(count > MESSAGES / 2, "{count} of {MESSAGES}");
    assert!(reader.counters().received.dropped > 0);
    within(reader.close()).await;
}

/// One lost part of a message was not counted.
#[tokio::test]
async fn a_message_that_comes_incomplete_is_counted() {
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(10))).await;
    let mut header = Raw::to(&reader).await;
    header.send(b"YA\x61\x1e\0\0RP\x08\0\0\0/writer\0").await;
    let reply: [u8; 8] = header.receive(8).await.try_into().unwrap();
    let there = framed_number::decode(&reply).unwrap() as u16;
    let socket = UdpSocket::bind("127.0.0.1:0").await.unwrap();
    socket.connect(("127.0.0.1", there)).await.unwrap();
    let mut message = bytes::BytesMut::new();
    let carrier = Carrier::by_name("udp").unwrap();
    let command = Command::data(false);
    let long = content(100);
    put_message(
        &mut message,
        carrier,
        &command,
        Some(&long),
        WireVersion::V3,
    );
    let datagrams: Vec<_> = datagram::split(&message, 40).collect();
    for (place, datagram) in datagrams.iter().enumerate() {
        if place != 1 {
            socket.send(datagram).await.unwrap();
        }
    }
    for datagram in &datagrams {
        socket.send(datagram).await.unwrap();
    }
    assert_eq!(within(reader.read()).await.unwrap().bottle().unwrap(), long);
    let received = reader.counters().received;
    assert_eq!((received.messages, received.dropped), (1, 1));
    within(reader.close()).await;
}
