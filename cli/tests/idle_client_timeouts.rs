//! Idle clients of the name server are disconnected, and do not block others.

use crate::common;

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use common::{Home, Running};

const TIMEOUT: Duration = Duration::from_secs(60);

fn connect(port: u16) -> TcpStream {
    let stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
    stream.set_read_timeout(Some(TIMEOUT)).unwrap();
    stream
}

/// Connects a client that has completed the handshake; on a busy machine not at the first attempt.
///
/// Each client has its own name: a second one with the same name would replace the first.
fn greeted(port: u16, index: usize) -> BufReader<TcpStream> {
    let began = Instant::now();
    loop {
        let mut client = BufReader::new(connect(port));
        let mut line = String::new();
        // The handshake may have timed out.
        let hello = format!("CONNACK /idle/{index}\r\n");
        let _ = client.get_mut().write_all(hello.as_bytes());
        if client.read_line(&mut line).is_ok() && line.starts_with("Welcome") {
            return client;
        }
        assert!(began.elapsed() < TIMEOUT, "never welcome: {line:?}");
    }
}

/// Returns true if a client after its handshake is still answered.
fn is_answered(client: &mut BufReader<TcpStream>) -> bool {
    let mut line = String::new();
    let asked = client.get_mut().write_all(b"d\r\nquery /root\r\n");
    asked.is_ok()
        && client.read_line(&mut line).is_ok()
        && line.starts_with("registration name /root ")
}

/// Returns true if a new client is answered at once.
fn answers(port: u16) -> bool {
    let mut stream = connect(port);
    stream.write_all(b"NAME_SERVER query /root\n").unwrap();
    let mut line = String::new();
    let read = BufReader::new(stream).read_line(&mut line);
    read.is_ok() && line.starts_with("registration name /root ")
}

/// Returns true if the server has closed the connection.
fn is_ended(mut client: impl Read) -> bool {
    match client.read(&mut [0; 64]) {
        Ok(count) => count == 0,
        Err(error) => error.kind() == std::io::ErrorKind::ConnectionReset,
    }
}

fn descriptors(server: &Running) -> usize {
    std::fs::read_dir(format!("/proc/{}/fd", server.id()))
        .unwrap()
        .count()
}

/// Waits until the server has no more than `most` file descriptors.
fn falls_to(server: &Running, most: usize) {
    let began = Instant::now();
    loop {
        let held = descriptors(server);
        if held <= most {
            return;
        }
        assert!(
            began.elapsed() < TIMEOUT,
            "{held} descriptors, expected {most}"
        );
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Such connections were once kept forever.
#[test]
fn clients_without_a_handshake_are_disconnected() {
    let home = Home::new();
    let server = home.serve_with("--handshake-timeout 1");
    let port = home.server_port();
    let before = descriptors(&server);
    let silent: Vec<_> = (0..100).map(|_| connect(port)).collect();
    let halfway: Vec<_> = (0..100)
        .map(|_| {
            let mut stream = connect(port);
            stream.write_all(b"CONNACK /half").unwrap();
            stream
        })
        .collect();
    let mut known: Vec<_> = (0..20).map(|index| greeted(port, index)).collect();
    assert!(silent.iter().chain(&halfway).all(is_ended));
    falls_to(&server, before + known.len());
    assert!(known.iter_mut().all(is_answered));
    drop(server);
}

#[test]
fn idle_clients_are_disconnected_on_request() {
    let home = Home::new();
    let server = home.serve_with("--idle-timeout 1");
    let port = home.server_port();
    let before = descriptors(&server);
    let known: Vec<_> = (0..50).map(|index| greeted(port, index)).collect();
    assert!(known.into_iter().all(is_ended));
    falls_to(&server, before);
    drop(server);
}

#[test]
fn idle_clients_are_displaced_by_new_ones() {
    let home = Home::new();
    let server = home.serve_with("--connections 20 --handshake-timeout 0");
    let port = home.server_port();
    let before = descriptors(&server);
    let mut known = greeted(port, 0);
    let silent: Vec<_> = (0..200).map(|_| connect(port)).collect();
    for _ in 0..20 {
        assert!(answers(port));
    }
    falls_to(&server, before + 20);
    assert!(silent[..180].iter().all(is_ended));
    assert!(is_answered(&mut known), "it was not the most silent");
    drop((silent, server));
}

#[test]
fn invalid_limits_are_refused() {
    let home = Home::new();
    for (option, value) in [
        ("--connections", "0"),
        ("--connections", "many"),
        ("--max-names", "0"),
        ("--max-memory", "much"),
        ("--handshake-timeout", "-1"),
        ("--idle-timeout", "long"),
    ] {
        let ended = home.run(&format!("server --local --socket 1 {option}={value}"));
        let ended = ended.with(1);
        let said = |line: &String| line.starts_with(&format!("{option} {value}: expected"));
        assert!(ended.err.iter().any(said), "{ended:?}");
    }
}
