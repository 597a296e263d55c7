//! Connections that say nothing keep nobody out: the oldest of them make room, and all of them end in time.

mod common;

use std::time::Duration;

use common::{Raw, ask, bottle, connect, next, open, until, within};
use tokio::io::AsyncReadExt;
use tokio::net::TcpStream;
use yarp_ports::port_limits::ProcessLimits;
use yarp_ports::{PortOptions, Queue};

/// Far fewer than connect in vain.
const PLACES: usize = 50;

fn descriptors() -> usize {
    std::fs::read_dir("/proc/self/fd").unwrap().count()
}

/// Waits for the end of a connection.
async fn ended(mut stream: TcpStream) {
    let mut byte = [0];
    let read = within(stream.read(&mut byte)).await;
    assert!(!matches!(read, Ok(1..)));
}

#[tokio::test]
async fn newcomers_are_served_and_ports_stay() {
    let limits = ProcessLimits::default().with_connections(PLACES);
    limits.apply();
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(10))).await;
    let writer = open("/writer", PortOptions::new()).await;
    connect(&writer, &reader, "tcp").await;
    let before = descriptors();
    let address = ("127.0.0.1", reader.tcp_port());
    let mut silent = Vec::new();
    for _ in 0..4 * PLACES {
        silent.push(within(TcpStream::connect(address)).await.unwrap());
    }
    let first = silent.swap_remove(0);
    ended(first).await;
    assert!(!ask(&reader, &bottle("[ver]")).await.is_empty());
    // Of anonymous connections those make room that are idle.
    let mut anonymous = Raw::to(&reader).await;
    anonymous.send(b"CONNECT somebody\r\n").await;
    assert_eq!(anonymous.receive(7).await, b"Welcome");
    assert_eq!(writer.write(&bottle("1 2 3")).await, 1);
    assert_eq!(next(&reader).await, "1 2 3");
    // A name that begins with a slash is that of a port.
    assert_eq!(reader.inputs()[0], "/writer");
    drop((silent, anonymous));
    until(|| descriptors() <= before).await;
    // Those that stay silent end in time, without anybody who needs their place.
    let timeout = Duration::from_millis(20);
    limits.with_header_timeout(timeout).apply();
    let silent = within(TcpStream::connect(address)).await.unwrap();
    ended(silent).await;
    let mut slow = within(TcpStream::connect(address)).await.unwrap();
    let beginning = b"GET /?data=1 HTTP/1.1\r\nHost: localhost\r\n";
    tokio::io::AsyncWriteExt::write_all(&mut slow, beginning)
        .await
        .unwrap();
    ended(slow).await;
    let mut known = Raw::to(&reader).await;
    known.send(b"CONNECT somebody\r\n").await;
    assert_eq!(known.receive(7).await, b"Welcome");
    let silent = within(TcpStream::connect(address)).await.unwrap();
    ended(silent).await;
    known.send(b"a\r\n[ver]\r\n").await;
    assert!(!known.receive(3).await.is_empty(), "who has a header stays");
    assert_eq!(writer.write(&bottle("4")).await, 1);
    assert_eq!(next(&reader).await, "4");
    within(writer.close()).await;
    within(reader.close()).await;
}
