//! A port of another program that calls one of ours gets replies in its wire version, also if its
//! requests look the same in all wire versions.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use bytes::BytesMut;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use yarp_nameserver::{Server, ServerOptions};
use yarp_ports::{AdminClient, Answer, Network, Port, PortOptions, Queue, Received};
use yarp_wire::bottle::detect;
use yarp_wire::carrier::Carrier;
use yarp_wire::connection::{Acceptor, Event};
use yarp_wire::message::Command;
use yarp_wire::{Bottle, Limits, WireVersion};

/// Timeout of every step.
const DEADLINE: Duration = Duration::from_secs(60);

const REPLY: &str = "1.5 (2.5 3.5)";

/// A port of another program, with its answer to any admin request, and the number of these
/// requests.
struct Caller {
    name: String,
    asked: Arc<AtomicUsize>,
}

impl Caller {
    /// Opens a port with this answer; it does not answer without one.
    async fn open(network: &Network, name: &str, answer: Option<&'static str>) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let number = listener.local_addr().unwrap().port();
        let request = format!("register {name} tcp 127.0.0.1 {number}");
        network.ask(&request).await.unwrap();
        let asked = Arc::new(AtomicUsize::new(0));
        let count = asked.clone();
        tokio::spawn(async move {
            while let Ok((stream, _)) = listener.accept().await {
                tokio::spawn(answer_all(stream, number, answer, count.clone()));
            }
        });
        let name = name.to_owned();
        Self { name, asked }
    }

    /// Calls a port of ours over a carrier, and returns the wire version of the reply.
    async fn call(&self, port: &Port, carrier: &str) -> WireVersion {
        let carrier = Carrier::by_name(carrier).unwrap();
        let address = ("127.0.0.1", port.tcp_port());
        let network = Network::none().with_timeout(DEADLINE);
        let opening = AdminClient::open(port.name(), address, carrier, &self.name, &network);
        let mut client = opening.await.unwrap();
        let command = Command::Data {
            reply: true,
            envelope: None,
        };
        let request = Bottle::parse("[get] [pos]").unwrap();
        let reply = client.request(&command, &request).await.unwrap();
        let bytes = reply.bytes();
        let wire_version = detect(&bytes, Limits::DEFAULT).expect("it has floats");
        let read = Bottle::decode(&bytes, wire_version, Limits::DEFAULT).unwrap();
        assert_eq!(read.to_string(), REPLY);
        wire_version
    }
}

async fn answer_all(
    mut stream: TcpStream,
    number: u16,
    answer: Option<&str>,
    asked: Arc<AtomicUsize>,
) {
    let mut acceptor = Acceptor::new(number, WireVersion::V4, Limits::DEFAULT);
    let (mut input, mut output) = (BytesMut::new(), BytesMut::new());
    loop {
        while let Some(event) = acceptor.poll(&mut input, &mut output).unwrap() {
            let Event::Message(message) = event else {
                continue;
            };
            assert_eq!(message.command, Command::Admin);
            asked.fetch_add(1, Ordering::Relaxed);
            match answer {
                Some(answer) => acceptor.reply(&Bottle::parse(answer).unwrap(), &mut output),
                None => std::future::pending().await,
            }
            acceptor.acknowledge(&mut output);
        }
        stream.write_all_buf(&mut output).await.unwrap();
        match stream.read_buf(&mut input).await {
            Ok(0) | Err(_) => return,
            Ok(_) => {}
        }
    }
}

async fn network() -> (Server, Network) {
    let server = Server::start(ServerOptions::default().at("127.0.0.1", 0))
        .await
        .unwrap();
    let network = server.network().with_timeout(DEADLINE);
    (server, network)
}

/// Opens a port of ours that replies with floats.
async fn replying(network: &Network, name: &str, wire_version: WireVersion) -> Port {
    let handler = |_: &mut Received| Answer::reply(Bottle::parse(REPLY).unwrap());
    let options = PortOptions::new()
        .handler(handler)
        .wire_version(wire_version);
    Port::open(network, name, options).await.unwrap()
}

/// Answers of 3.5.0 and 4.0.0 to a request for their process id.
const ANSWERS: [(&str, WireVersion); 2] = [
    ("1 \"\" 4412", WireVersion::V3),
    (
        "[fail] \"send [help] for list of valid commands\"",
        WireVersion::V4,
    ),
];

#[tokio::test]
async fn replies_use_the_wire_version_of_their_reader() {
    let (_server, network) = network().await;
    for (answer, reads) in ANSWERS {
        let caller = Caller::open(&network, &format!("/caller/{reads}"), Some(answer)).await;
        for default in [WireVersion::V3, WireVersion::V4] {
            let port = replying(&network, &format!("/{reads}/{default}"), default).await;
            for carrier in ["tcp", "fast_tcp"] {
                // On a machine that stalls the answer comes too late.
                let mut tries = 1;
                while caller.call(&port, carrier).await != reads {
                    assert!(tries < 10, "over {carrier}");
                    tries += 1;
                }
            }
            port.close().await;
        }
    }
}

#[tokio::test]
async fn unknown_readers_get_the_default_wire_version() {
    let (_server, network) = network().await;
    let silent = Caller::open(&network, "/silent", None).await;
    let strange = Caller::open(&network, "/strange", Some("what?")).await;
    let ours = Caller::open(&network, "/ours", Some("1 \"\" 4412 either")).await;
    let program = Caller {
        name: "program".to_owned(),
        asked: Arc::default(),
    };
    let unknown = Caller {
        name: "/unknown".to_owned(),
        asked: Arc::default(),
    };
    for default in [WireVersion::V3, WireVersion::V4] {
        let port = replying(&network, &format!("/{default}"), default).await;
        for caller in [&silent, &strange, &ours, &program, &unknown] {
            assert_eq!(caller.call(&port, "tcp").await, default, "{}", caller.name);
        }
        port.close().await;
    }
    assert_eq!(silent.asked.load(Ordering::Relaxed), 2);
}

#[tokio::test]
async fn one_way_writers_are_not_probed() {
    let (_server, network) = network().await;
    let caller = Caller::open(&network, "/caller", Some("[fail]")).await;
    let options = PortOptions::new().queue(Queue::Latest);
    let port = Port::open(&network, "/reader", options).await.unwrap();
    let carrier = Carrier::by_name("tcp").unwrap();
    let address = ("127.0.0.1", port.tcp_port());
    let mut client = AdminClient::open("/reader", address, carrier, &caller.name, &network)
        .await
        .unwrap();
    let command = Command::Data {
        reply: true,
        envelope: None,
    };
    client
        .request(&command, &Bottle::parse("1").unwrap())
        .await
        .unwrap();
    assert_eq!(caller.asked.load(Ordering::Relaxed), 0);
}
