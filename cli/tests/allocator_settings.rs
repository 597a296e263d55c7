//! Memory of servers for large messages.

use std::io::{Read, Write};
use std::net::TcpStream;

use crate::common::Home;

/// Number of large messages, one after another.
const MESSAGES: usize = 40;
/// Bytes of each. Its text, values and reply take several times as much while it is handled.
const MESSAGE_LEN: usize = 300_000;
/// Bytes of a page of memory.
const PAGE: usize = 4096;

/// Returns the number of pages that a process was given so far.
fn page_faults(process: u32) -> usize {
    let text = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap();
    let fields = text.rsplit(") ").next().unwrap();
    fields.split(' ').nth(7).unwrap().parse().unwrap()
}

fn send_form(port: u16) {
    let mut stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
    let body = format!("cmd={}", "a".repeat(MESSAGE_LEN));
    let head = "POST /form HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/x-www-form-urlencoded\r\n";
    let request = format!("{head}Content-Length: {}\r\n\r\n{body}", body.len());
    stream.write_all(request.as_bytes()).unwrap();
    let mut reply = String::new();
    stream.read_to_string(&mut reply).unwrap();
    assert!(reply.starts_with("HTTP/1.1 200"), "{reply}");
}

/// The memory of each large message went back to the system at once. While it comes and goes, all threads wait that need some: with
/// hundreds of forms at once the state of an arm paused for a tenth of a second.
#[test]
fn the_memory_of_a_large_message_serves_for_the_next() {
    let home = Home::new();
    let server = home.serve();
    let port = home.server_port();
    let send_all = || (0..MESSAGES).for_each(|_| send_form(port));
    // Each of the threads that may handle one has memory of its own.
    send_all();
    let before = page_faults(server.id());
    send_all();
    let faults = page_faults(server.id()) - before;
    let of_all = MESSAGES * MESSAGE_LEN / PAGE;
    assert!(
        faults < of_all / 2,
        "{faults} pages, {of_all} with all messages"
    );
}
