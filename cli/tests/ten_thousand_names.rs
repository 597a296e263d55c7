//! Ten thousand names, and hundreds of concurrent short-lived programs.

use crate::common;

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::time::Duration;

use common::Home;

const NAMES: usize = 10_000;
const PROGRAMS: usize = 500;

/// Sends all requests over one connection; returns the answers, each without its last line.
fn ask_all(port: u16, requests: &[String]) -> Vec<String> {
    let stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
    stream
        .set_read_timeout(Some(Duration::from_secs(60)))
        .unwrap();
    let mut writer = stream.try_clone().unwrap();
    let text: String = requests
        .iter()
        .map(|line| format!("d\r\n{line}\r\n"))
        .collect();
    // Answers are read while requests are written.
    let writing = std::thread::spawn(move || {
        writer.write_all(b"CONNECT /lab\r\n").unwrap();
        writer.write_all(text.as_bytes()).unwrap();
    });
    let mut reader = BufReader::new(stream);
    let mut line = String::new();
    reader.read_line(&mut line).unwrap();
    assert!(line.starts_with("Welcome"), "{line}");
    let answers = requests.iter().map(|request| {
        let mut answer = String::new();
        loop {
            let before = answer.len();
            let count = reader.read_line(&mut answer).unwrap();
            assert!(count > 0, "`{request}` has no answer");
            if answer[before..].starts_with("*** end of message") {
                answer.truncate(before);
                return answer;
            }
        }
    });
    let answers = answers.collect();
    writing.join().unwrap();
    answers
}

/// Sends one request on its own connection, like stock clients.
fn ask(port: u16, request: &str) -> String {
    let mut stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
    stream
        .set_read_timeout(Some(Duration::from_secs(60)))
        .unwrap();
    stream
        .write_all(format!("NAME_SERVER {request}\n").as_bytes())
        .unwrap();
    let mut answer = String::new();
    for line in BufReader::new(stream).lines() {
        let line = line.unwrap();
        if line.starts_with("***") {
            return answer;
        }
        answer.push_str(&line);
        answer.push('\n');
    }
    panic!("the answer to `{request}` breaks off: {answer}");
}

fn get(port: u16, target: &str) -> String {
    let mut stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
    stream
        .set_read_timeout(Some(Duration::from_secs(60)))
        .unwrap();
    stream
        .write_all(format!("GET {target} HTTP/1.1\r\nHost: localhost\r\n\r\n").as_bytes())
        .unwrap();
    stream.shutdown(Shutdown::Write).unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    answer
}

/// Does what a short-lived program does.
fn come_and_go(port: u16, index: usize) {
    let name = format!("/visitor/{index}");
    let there = |answer: &str| answer.starts_with(&format!("registration name {name} "));
    assert!(there(&ask(port, &format!("register {name}"))));
    for property in ["offers tcp fast_tcp udp", "ips 127.0.0.1", "process 7"] {
        let answer = ask(port, &format!("set {name} {property}"));
        assert!(
            answer.starts_with(&format!("port {name} property ")),
            "{answer}"
        );
    }
    assert!(there(&ask(port, &format!("query {name}"))));
    assert_eq!(ask(port, &format!("unregister {name}")), "");
    assert_eq!(ask(port, &format!("query {name}")), "");
}

#[test]
fn ten_thousand_names_survive_churn_and_a_kill() {
    let home = Home::new();
    let server = home.serve();
    let port = home.server_port();
    let dead = TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap();
    let number = dead.port();
    let requests: Vec<_> = (0..NAMES)
        .map(|index| format!("register /robot/{index:05}/state:o tcp 127.0.0.1 {number}"))
        .collect();
    let answers = ask_all(port, &requests);
    assert!(
        answers
            .iter()
            .all(|answer| answer.starts_with("registration name /robot/"))
    );

    std::thread::scope(|scope| {
        for index in 0..PROGRAMS {
            scope.spawn(move || come_and_go(port, index));
        }
    });
    assert_eq!(ask(port, "list /visitor"), "");
    let listed = ask(port, "list /robot");
    assert_eq!(listed.lines().count(), NAMES);
    let page = get(port, "/api/names?wait=0");
    assert_eq!(page.matches("{\"name\":\"/robot/").count(), NAMES);

    server.kill();
    let words = format!("server --ip 127.0.0.1 --socket {port} --write");
    let server = home.start(&words).see("Ok. Ready!");
    assert_eq!(ask(port, "list /robot"), listed);
    assert_eq!(ask(port, "list /visitor"), "");
    drop(server);
}
