//! Connections that do not speak YARP, and idle ones, do not affect others.

use crate::common;

use std::io::{self, Write};
use std::sync::{Arc, Mutex};

use common::{Raw, bottle, connect, next, open, tcp_header, within};
use yarp_ports::{Port, PortOptions, Queue};
use yarp_wire::Bottle;
use yarp_wire::connection::REFUSAL;

/// Returns byte sequences that end a connection in any state.
fn garbage() -> Vec<Vec<u8>> {
    let header = tcp_header("/bad");
    let index = |len: u8, lengths: &[i32]| {
        let mut bytes = header.clone();
        bytes.extend_from_slice(b"YA\x0a\0\0\0RP");
        bytes.extend_from_slice(&[len, 0, 255, 255, 255, 255, 255, 255, 255, 255]);
        lengths
            .iter()
            .for_each(|length| bytes.extend_from_slice(&length.to_le_bytes()));
        bytes
    };
    vec![
        b"GARBAGE!".to_vec(),
        b"\0\0\0\0\0\0\0\0".to_vec(),
        vec![0xff; 100_000],
        [&b"YA\xe4\x1e\0\0RP"[..], &(-1i32).to_le_bytes()].concat(),
        [&b"YA\xe4\x1e\0\0RP"[..], &i32::MAX.to_le_bytes()].concat(),
        [&header[..], b"GARBAGE!"].concat(),
        index(1, &[-1]),
        index(1, &[i32::MAX]),
        index(255, &[i32::MAX; 255]),
        index(0, &[]),
        [index(1, &[8]), b"\0\0\0\0!D\0\x01".to_vec()].concat(),
        [index(1, &[10]), b"\x02\0\0\0~\0\0\x01qq".to_vec()].concat(),
        [b"CONNECT ".to_vec(), vec![b'x'; 100_000]].concat(),
    ]
}

#[tokio::test]
async fn other_connections_lose_nothing() {
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(10))).await;
    let mut writers = Vec::new();
    for carrier in ["tcp", "fast_tcp", "text", "text_ack"] {
        let writer = open(&format!("/writer/{carrier}"), PortOptions::new()).await;
        connect(&writer, &reader, carrier).await;
        writers.push(writer);
    }
    let mut number = 0;
    for bytes in garbage() {
        let mut bad = Raw::to(&reader).await;
        // The port may have ended it before all is sent.
        tokio::spawn(async move {
            bad.send(&bytes).await;
            bad.ended().await;
        });
        for writer in &writers {
            assert_eq!(within(writer.write(&Bottle::of(number))).await, 1);
            assert_eq!(next(&reader).await, number.to_string());
            number += 1;
        }
    }
}

#[tokio::test]
async fn garbage_ends_its_connection() {
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(10))).await;
    for bytes in garbage() {
        let mut bad = Raw::to(&reader).await;
        let length = bytes.len();
        if length < 10_000 {
            bad.send(bytes).await;
            bad.ended().await;
        }
    }
    common::until(|| reader.inputs().is_empty()).await;
    assert!(reader.try_read().is_none());
}

#[tokio::test]
async fn unknown_magic_is_told_what_to_try() {
    let port = open("/port", PortOptions::new()).await;
    let mut stranger = Raw::to(&port).await;
    stranger.send("GARBAGE!").await;
    assert_eq!(String::from_utf8(stranger.ended().await).unwrap(), REFUSAL);
}

#[tokio::test]
async fn idle_connections_cost_nothing() {
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(10))).await;
    let starts = [
        &b""[..],
        b"C",
        b"CONNECT",
        b"CONNECT ",
        b"YA\xe4\x1e\0\0RP\x04\0\0\0/w",
    ];
    let mut silent = Vec::new();
    for round in 0..100 {
        let mut raw = Raw::to(&reader).await;
        raw.send(starts[round % starts.len()]).await;
        silent.push(raw);
    }
    let writer = open("/writer", PortOptions::new()).await;
    connect(&writer, &reader, "tcp").await;
    for number in 0..100 {
        assert_eq!(within(writer.write(&Bottle::of(number))).await, 1);
        assert_eq!(next(&reader).await, number.to_string());
    }
    assert_eq!(reader.inputs(), ["/writer"]);
    // They may come to life late.
    let mut late = silent.swap_remove(4);
    late.send(b"r\0").await;
    late.expect(yarp_wire::framed_number::encode(reader.tcp_port().into()))
        .await;
    within(reader.close()).await;
    for raw in silent {
        raw.ended().await;
    }
}

/// A content that is no bottle is the owner's to judge, and not the end of the connection.
#[tokio::test]
async fn content_that_cannot_be_read_is_an_error_of_that_message_alone() {
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(10))).await;
    let mut raw = Raw::tcp(&reader, "/odd").await;
    for content in [
        &b""[..],
        b"x",
        b"\x59\0\0\0\x01\0\0\0",
        b"\0\x01\0\0\xff\xff\xff\x7f",
    ] {
        let mut message = common::tcp_message(b'D', &Bottle::new());
        message.truncate(message.len() - 8);
        message[22..26].copy_from_slice(&(content.len() as i32).to_le_bytes());
        message.extend_from_slice(content);
        raw.send(message).await;
        assert!(within(reader.read()).await.unwrap().bottle().is_err());
        raw.expect(common::ACK).await;
    }
    raw.send(common::tcp_message(b'D', &bottle("good"))).await;
    assert_eq!(next(&reader).await, "good");
}

/// Collects the log.
#[derive(Clone, Default)]
struct Log(Arc<Mutex<Vec<u8>>>);

impl Log {
    /// Collects the log of this thread until the guard is dropped.
    fn begin() -> (Self, tracing::subscriber::DefaultGuard) {
        let log = Self::default();
        let written = log.clone();
        let subscriber = tracing_subscriber::fmt().with_writer(move || written.clone());
        let guard = tracing::subscriber::set_default(subscriber.finish());
        (log, guard)
    }

    fn has(&self, text: &str) -> bool {
        String::from_utf8_lossy(&self.0.lock().unwrap()).contains(text)
    }
}

impl Write for Log {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Has connections to `reader` begin and end, with these bytes, until it takes them for a flood.
async fn flood(reader: &Port, bytes: &[u8], log: &Log) {
    let flooding = async {
        while !log.has("throttling accepts") {
            Raw::to(reader).await.send(bytes).await;
        }
    };
    within(flooding).await;
}

#[tokio::test]
async fn a_flood_of_invalid_connections_is_throttled() {
    let garbage = [&tcp_header("/bad")[..], b"GARBAGE!"].concat();
    // One of the same name takes the place of the one before, so that not all are found to be garbage.
    for bytes in [&garbage[..], &tcp_header("/bad")] {
        let (log, _logging) = Log::begin();
        let reader = open("/reader", PortOptions::new().queue(Queue::Wait(1))).await;
        flood(&reader, bytes, &log).await;
        let writer = open("/writer", PortOptions::new()).await;
        connect(&writer, &reader, "tcp").await;
        assert_eq!(within(writer.write(&bottle("still here"))).await, 1);
        assert_eq!(next(&reader).await, "still here");
    }
}

#[tokio::test]
async fn many_valid_connections_are_not_throttled() {
    let (log, _logging) = Log::begin();
    let reader = open("/reader", PortOptions::new()).await;
    for _ in 0..500 {
        assert!(!common::ask(&reader, &bottle("[ver]")).await.is_empty());
    }
    assert!(!log.has("throttling accepts"));
}
