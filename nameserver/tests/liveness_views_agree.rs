//! The page, its JSON, `yarp name list --state` and `Server::port_statuses` agree about liveness.
//!
//! They once kept separate states, so that a port was gone on the page and alive in the list.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use serde_json::Value;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpSocket, TcpStream};
use yarp_nameserver::registry::{Liveness, PortStatus};
use yarp_nameserver::{Server, ServerOptions};
use yarp_ports::{Port, PortOptions};

const TIMEOUT: Duration = Duration::from_secs(60);

type States = BTreeMap<String, String>;

/// Returns the states of `/api/names`, from which the page is made.
async fn on_the_page(server: &Server) -> States {
    let exchange = async {
        let mut stream = TcpStream::connect(("127.0.0.1", server.port())).await?;
        let request = b"GET /api/names?wait=0 HTTP/1.1\r\nHost: localhost\r\n\r\n";
        stream.write_all(request).await?;
        let mut answer = String::new();
        stream.read_to_string(&mut answer).await.map(|_| answer)
    };
    let answer = tokio::time::timeout(TIMEOUT, exchange).await;
    let answer = answer.expect("an answer").unwrap();
    let (_, body) = answer.split_once("\r\n\r\n").expect("a body");
    let names: Value = serde_json::from_str(body).unwrap();
    let names = names["names"].as_array().expect("a list").clone();
    let text = |entry: &Value, key: &str| entry[key].as_str().unwrap().to_owned();
    names
        .iter()
        .map(|entry| (text(entry, "name"), text(entry, "state")))
        .collect()
}

/// Returns the states that `yarp name list --state` prints.
async fn in_the_list(server: &Server) -> States {
    let answer = server.network().ask("state ").await.unwrap();
    let split = |line: &str| {
        let words: Vec<_> = line.split(' ').map(str::to_owned).collect();
        let [.., state] = &words[..] else {
            panic!("{line}")
        };
        (words[2].clone(), state.clone())
    };
    answer.lines().map(split).collect()
}

fn of(known: &[PortStatus]) -> States {
    let pair = |known: &PortStatus| (known.registration.name.clone(), known.state.to_string());
    known.iter().map(pair).collect()
}

fn ages(known: &[PortStatus]) -> Vec<(Liveness, Instant)> {
    known
        .iter()
        .map(|known| (known.state, known.since))
        .collect()
}

/// Compares all views until `/a` has this state in each.
async fn until(server: &Server, state: Liveness) {
    let began = Instant::now();
    loop {
        let before = server.port_statuses();
        let page = on_the_page(server).await;
        let list = in_the_list(server).await;
        let after = server.port_statuses();
        if ages(&before) == ages(&after) {
            // Nothing has changed in between.
            assert_eq!(page, of(&before));
            assert_eq!(list, of(&before));
            if page["/a"] == state.to_string() {
                return;
            }
        }
        assert!(began.elapsed() < TIMEOUT, "never {state}: {page:?}");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}

/// Socket at the port number of `/a`, until dropped.
enum There {
    Nobody,
    Stuck(TcpListener),
    Port(Port),
}

async fn put(server: &Server, state: Liveness, number: u16) -> There {
    match state {
        Liveness::Gone => There::Nobody,
        Liveness::Unreachable => {
            let socket = TcpSocket::new_v4().unwrap();
            socket.set_reuseaddr(true).unwrap();
            socket.bind(([0, 0, 0, 0], number).into()).unwrap();
            There::Stuck(socket.listen(64).unwrap())
        }
        Liveness::Alive => {
            let options = PortOptions::new().unregistered().tcp_port(number);
            There::Port(Port::open(&server.network(), "/a", options).await.unwrap())
        }
    }
}

/// Runs with probes of the server alone, of the page alone, and of both.
async fn check(looks: Option<Duration>, survey: Option<Duration>) {
    let mut options = ServerOptions::default().at("127.0.0.1", 0).survey(survey);
    options.probe_interval = looks;
    options.expire_after = None;
    let server = Server::start(options).await.unwrap();
    // The number stays reserved while no socket listens.
    let kept = TcpSocket::new_v4().unwrap();
    kept.set_reuseaddr(true).unwrap();
    kept.bind(([0, 0, 0, 0], 0).into()).unwrap();
    let number = kept.local_addr().unwrap().port();
    let request = format!("register /a tcp 127.0.0.1 {number}");
    server.network().ask(&request).await.unwrap();
    let (alive, stuck, gone) = (Liveness::Alive, Liveness::Unreachable, Liveness::Gone);
    // Every transition between two states.
    for state in [alive, stuck, gone, alive, gone, stuck, alive] {
        let there = put(&server, state, number).await;
        until(&server, state).await;
        match there {
            There::Port(port) => port.close().await,
            There::Stuck(listener) => drop(listener),
            There::Nobody => {}
        }
    }
    server.close().await;
}

const OFTEN: Option<Duration> = Some(Duration::from_millis(50));

#[tokio::test]
async fn views_agree_with_probes_of_the_server() {
    check(OFTEN, None).await;
}

#[tokio::test]
async fn views_agree_with_probes_of_the_page() {
    check(None, OFTEN).await;
}

#[tokio::test]
async fn views_agree_with_both_probes() {
    check(OFTEN, OFTEN).await;
}
