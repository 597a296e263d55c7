//! A browser at a port, in its own process: requests, an endless response, a websocket.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use yarp_ports::Network;
use yarp_wire::{Bottle, WireVersion};

use crate::Failure;
use crate::peer_programs::{print_times, wait_for_count};

/// Any mask will do.
const MASK: [u8; 4] = [0x5a, 0x01, 0xc3, 0x7e];

/// Runs the program selected by these words; `None` if they select none.
pub(crate) fn work(words: &[&str]) -> Option<Result<(), Failure>> {
    Some(match words {
        ["question", name, n] => question(name, n),
        ["listen", name] => listen(name),
        ["frames", name, n] => frames(name, n),
        ["frame-call", name, n] => frame_call(name, n),
        _ => return None,
    })
}

fn connect(name: &str) -> Result<TcpStream, Failure> {
    let (host, port) = place(name)?;
    let stream = TcpStream::connect((host.as_str(), port))?;
    stream.set_nodelay(true)?;
    Ok(stream)
}

fn place(name: &str) -> Result<(String, u16), Failure> {
    let asking = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
    let place = asking.block_on(Network::from_process()?.query(name))?;
    Ok((place.host, place.port))
}

/// Sends requests over `http`, a connection each, as pages do; prints the time of each.
fn question(name: &str, n: &str) -> Result<(), Failure> {
    let (host, port) = place(name)?;
    let mut times = Vec::new();
    let mut answer = String::new();
    for _ in 0..n.parse()? {
        let begin = Instant::now();
        let mut stream = TcpStream::connect((host.as_str(), port))?;
        stream.write_all(b"GET /?req=1+2 HTTP/1.1\r\nHost: localhost\r\n\r\n")?;
        answer.clear();
        stream.read_to_string(&mut answer)?;
        times.push(begin.elapsed());
        if !answer.contains("\n[1, 2, ") {
            return Err(format!("{name}: an unexpected answer: {answer}").into());
        }
    }
    print_times(&times)
}

/// Reads at `/r` what the port writes; each input line is a count, answered when it is reached.
fn listen(name: &str) -> Result<(), Failure> {
    let mut stream = connect(name)?;
    stream.write_all(b"GET /r HTTP/1.1\r\nHost: localhost\r\n\r\n")?;
    let mut chunks = BufReader::new(stream);
    let mut line = String::new();
    while line != "\r\n" {
        line.clear();
        if chunks.read_line(&mut line)? == 0 {
            return Err(format!("{name} ended before its page began").into());
        }
    }
    println!("ready");
    let count = Arc::new(AtomicU64::new(0));
    let counter = count.clone();
    thread::spawn(move || {
        // The end is noticed by the task that waits for the count.
        let _ = read_chunks(chunks, &counter);
    });
    for goal in std::io::stdin().lines().map_while(Result::ok) {
        println!("{}", wait_for_count(&count, goal.trim().parse()?));
    }
    Ok(())
}

/// Counts the chunks that contain a message.
fn read_chunks(mut chunks: impl BufRead, count: &AtomicU64) -> Result<(), Failure> {
    let mut line = String::new();
    let mut body = Vec::new();
    loop {
        line.clear();
        chunks.read_line(&mut line)?;
        let length = usize::from_str_radix(line.trim(), 16)?;
        body.resize(length + 2, 0);
        chunks.read_exact(&mut body)?;
        if body.windows(4).any(|part| part == b"{7 7") {
            count.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// Opens a websocket at the port.
fn open_websocket(name: &str) -> Result<TcpStream, Failure> {
    let mut stream = connect(name)?;
    stream.write_all(
        b"GET /?ws HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
          Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n",
    )?;
    let mut head = Vec::new();
    let mut byte = [0];
    while !head.ends_with(b"\r\n\r\n") {
        stream.read_exact(&mut byte)?;
        head.push(byte[0]);
    }
    if !head.starts_with(b"HTTP/1.1 101") {
        return Err(format!("{name}: {}", String::from_utf8_lossy(&head)).into());
    }
    Ok(stream)
}

/// Returns a short message in a frame, masked as by browsers.
fn frame(letter: u8, content: &Bottle) -> Vec<u8> {
    let mut body = vec![0, 0, 0, 0, b'~', letter, 0, 1];
    body.extend_from_slice(&content.encode(WireVersion::V3));
    assert!(body.len() < 126, "a longer one begins otherwise");
    let masked = body
        .iter()
        .zip(MASK.iter().cycle())
        .map(|(byte, mask)| byte ^ mask);
    let head = [0x82, 0x80 | body.len() as u8];
    head.into_iter().chain(MASK).chain(masked).collect()
}

/// Sends messages to the port, each in its own frame and system call, as browsers do.
fn frames(name: &str, n: &str) -> Result<(), Failure> {
    let mut stream = open_websocket(name)?;
    let blob = Bottle::from_iter([yarp_wire::Value::Blob(vec![7; 16].into())]);
    let frame = frame(b'D', &blob);
    let begin = Instant::now();
    for _ in 0..n.parse()? {
        stream.write_all(&frame)?;
    }
    let time = begin.elapsed();
    print_times(&[time])?;
    // The connection stays open while the reader counts.
    std::io::stdin().lines().for_each(drop);
    Ok(())
}

/// Sends requests over one websocket, one after another; prints the time of each.
fn frame_call(name: &str, n: &str) -> Result<(), Failure> {
    let mut stream = open_websocket(name)?;
    let bottle = Bottle::from_iter([1.into(), 2.into()]);
    let request = frame(b'd', &bottle);
    let expected = bottle.encode(WireVersion::V3);
    let n: usize = n.parse()?;
    let mut times: Vec<Duration> = Vec::with_capacity(n);
    let mut answer = vec![0; 2 + expected.len()];
    for _ in 0..n {
        let begin = Instant::now();
        stream.write_all(&request)?;
        stream.read_exact(&mut answer)?;
        times.push(begin.elapsed());
        if answer[2..] != expected[..] {
            return Err(format!("{name}: an unexpected answer: {answer:?}").into());
        }
    }
    print_times(&times)
}
