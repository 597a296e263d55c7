//! A port that finds no descriptor for a newcomer takes that of a connection that says nothing.

mod common;

use common::captured_log::Log;
use common::{Raw, open, within};
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use tokio::net::TcpStream;
use yarp_ports::{PortOptions, Queue};

#[tokio::test]
async fn a_newcomer_is_served_although_no_descriptor_is_left() {
    let log = Log::capture();
    let port = open("/port", PortOptions::new().queue(Queue::Wait(10))).await;
    let address = ("127.0.0.1", port.tcp_port());
    let mut silent = Vec::new();
    for _ in 0..20 {
        silent.push(within(TcpStream::connect(address)).await.unwrap());
    }
    // All of them have been accepted, and more than one is to make room.
    let mut known = Raw::text(&port, "known").await;
    let before = getrlimit(Resource::Nofile);
    let used = std::fs::read_dir("/proc/self/fd").unwrap().count() - 1;
    let current = Some(used as u64 + 1);
    setrlimit(Resource::Nofile, Rlimit { current, ..before }).unwrap();
    let mut files = Vec::new();
    while let Ok(file) = std::fs::File::open("/dev/null") {
        files.push(file);
    }
    let mut newcomers = Vec::new();
    for number in 0..3 {
        // Room for the end that connects, and for no other.
        drop(files.pop());
        let mut newcomer = Raw::text(&port, &format!("newcomer{number}")).await;
        newcomer.send("*\r\n").await;
        assert!(!newcomer.receive(10).await.is_empty());
        newcomers.push(newcomer);
    }
    // Each of them was refused at first.
    let lines = log.lines_with("cannot accept");
    assert_eq!(lines.len(), 1, "one line a minute: {lines:?}");
    known.send("*\r\n").await;
    assert!(
        !known.receive(10).await.is_empty(),
        "who has a header stays"
    );
    setrlimit(Resource::Nofile, before).unwrap();
    within(port.close()).await;
}
