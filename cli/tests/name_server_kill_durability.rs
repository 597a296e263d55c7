//! A name server that is killed at any instruction, under load, loses no acknowledged change.

use crate::common;

use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use common::Home;

const ROUNDS: usize = 8;
const CLIENTS: usize = 6;
/// Maximum number of connections per client and round: a server has a limit.
const LINKS: usize = 50;
const END: &str = "*** end of message\r\n";

/// Sends one request on its own connection; returns `None` without a complete answer.
fn ask(port: u16, request: &str) -> Option<String> {
    let mut stream = TcpStream::connect(("127.0.0.1", port)).ok()?;
    stream
        .set_read_timeout(Some(Duration::from_secs(30)))
        .ok()?;
    stream
        .write_all(format!("NAME_SERVER {request}\n").as_bytes())
        .ok()?;
    let mut answer = String::new();
    let mut chunk = [0; 4096];
    while !answer.ends_with(END) && !answer.ends_with("[ok]\r\n") {
        match stream.read(&mut chunk) {
            Ok(count) if count > 0 => answer.push_str(std::str::from_utf8(&chunk[..count]).ok()?),
            _ => return None,
        }
    }
    Some(answer)
}

/// State known to one client: for each name the possible values of its property, `None` if the name
/// may be missing. There are several if a request was never answered.
type Known = BTreeMap<String, Vec<Option<String>>>;

/// Registers, sets, connects and unregisters until the server is gone.
fn work(port: u16, client: usize, round: usize, stop: &AtomicBool, known: &mut Known) {
    for step in 0.. {
        if stop.load(Ordering::Relaxed) {
            return;
        }
        // Few names, so that most of them change repeatedly.
        let name = format!("/client{client}/{}", (step * 7) % 23);
        let mut old = known.get(&name).cloned().unwrap_or(vec![None]);
        let value = format!("round{round}.step{step}");
        let there = Some(String::new());
        let steps = [
            (
                format!("register {name} tcp 127.0.0.1 {}", 20_000 + client),
                there,
            ),
            (format!("set {name} value {value}"), Some(value)),
        ];
        let gone = (step % 3 == 0).then(|| (format!("unregister {name}"), None));
        for (request, new) in steps.into_iter().chain(gone) {
            // Until there is an answer both values are possible.
            let mut either = old.clone();
            either.push(new.clone());
            known.insert(name.clone(), either);
            if ask(port, &request).is_none() {
                return;
            }
            old = vec![new];
            known.insert(name.clone(), old.clone());
        }
        if step >= LINKS {
            continue;
        }
        let link = format!("{name} /reader{round}.{step}");
        let link_name = format!("link {link}");
        known.insert(link_name.clone(), vec![None, Some(String::new())]);
        if ask(port, &format!("subscribe {link}")).is_none() {
            return;
        }
        known.insert(link_name, vec![Some(String::new())]);
    }
}

/// Returns the server's state of a name.
fn found(port: u16, name: &str, links: &str) -> Option<String> {
    if let Some(link) = name.strip_prefix("link ") {
        let (from, to) = link.split_once(' ').unwrap();
        let text = format!("(src \"{from}\") (dest \"{to}\")");
        return links.contains(&text).then(String::new);
    }
    let answer = ask(port, &format!("get {name} value")).expect("a server that runs answers");
    let value = answer
        .lines()
        .next()?
        .split_once(" = ")
        .map(|(_, value)| value.to_owned());
    match (value, answer.contains(" property value =")) {
        (Some(value), _) => Some(value),
        (None, true) => Some(String::new()),
        (None, false) => None,
    }
}

#[test]
fn acknowledged_changes_survive_kills_under_load() {
    let home = Home::new();
    let mut server = home.serve();
    let port = home.server_port();
    let mut known = vec![Known::new(); CLIENTS];
    for round in 0..ROUNDS {
        let stop = AtomicBool::new(false);
        std::thread::scope(|scope| {
            for (client, known) in known.iter_mut().enumerate() {
                let stop = &stop;
                scope.spawn(move || work(port, client, round, stop, known));
            }
            // Each round ends at another moment.
            std::thread::sleep(Duration::from_millis(150 + 37 * round as u64));
            drop(server);
            stop.store(true, Ordering::Relaxed);
        });
        server = home
            .start(&format!("server --ip 127.0.0.1 --socket {port} --write"))
            .see("Ok. Ready!");
        let links = ask_links(port);
        let mut checked = 0;
        for known in &mut known {
            for (name, may_be) in known.iter_mut() {
                let found = found(port, name, &links);
                assert!(
                    may_be.contains(&found),
                    "{name}: {found:?}, expected one of {may_be:?}"
                );
                *may_be = vec![found];
                checked += 1;
            }
        }
        assert!(checked > CLIENTS, "hardly anything was asked: {checked}");
    }
}

/// Returns all persistent connections.
fn ask_links(port: u16) -> String {
    let mut stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
    stream
        .write_all(b"CONNACK admin\r\nd\r\nsubscribe\r\n")
        .unwrap();
    let mut answer = Vec::new();
    let mut chunk = [0; 65536];
    while !answer.ends_with(b"<ACK>\r\n") {
        let count = stream.read(&mut chunk).unwrap();
        assert!(count > 0, "the answer breaks off");
        answer.extend_from_slice(&chunk[..count]);
    }
    String::from_utf8(answer).unwrap()
}
