//! A device obeys requests over HTTP as curl sends them.

#![cfg(unix)]

use crate::common;

use std::io::{Read, Write};
use std::net::TcpStream;

use common::Home;

/// Returns the body of the answer to `GET /TARGET` at a port.
fn get(home: &Home, port: &str, target: &str) -> String {
    let place = home.run_until(&format!("name query {port}"), "registration");
    let words: Vec<&str> = place.out[0].split_whitespace().collect();
    let after = |key: &str| {
        let at = words.iter().position(|word| *word == key).unwrap();
        words[at + 1]
    };
    let number = words.iter().rev().find_map(|word| word.parse::<u16>().ok());
    let mut stream = TcpStream::connect((after("ip"), number.unwrap())).unwrap();
    let request = format!(
        "GET /{target} HTTP/1.1\r\nHost: {}:{}\r\n\r\n",
        after("ip"),
        number.unwrap()
    );
    stream.write_all(request.as_bytes()).unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    answer
}

#[test]
fn a_move_is_commanded_and_its_target_is_read_back() {
    let home = Home::new();
    let _server = home.serve();
    let _board = home.start("dev --device fakeMotionControl --GENERAL::Joints 2 --name /fake");
    let answer = get(&home, "/fake/rpc:i", "?req=set+pos+0+20");
    assert!(answer.contains("[\"ok\"]"), "{answer}");
    let target = get(&home, "/fake/rpc:i", "?req=get+pos+0");
    assert!(target.contains("\"pos\", 20.0,"), "{target}");
    // An extra value of one's own is still refused.
    let refused = get(&home, "/fake/rpc:i", "?req=set+pos+0+20+3");
    assert!(refused.contains("[\"fail\"]"), "{refused}");
}
