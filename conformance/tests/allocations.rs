//! Small messages and calls allocate nothing once a connection is warm, neither in the writer nor
//! in the reader.

use std::fmt::Write;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use bytes::{Buf, BufMut, Bytes, BytesMut};
use yarp_conformance::counting_allocator::{Counting, calls};
use yarp_nameserver::{Server, ServerOptions};
use yarp_ports::{Answer, Network, Port, PortOptions, Queue};
use yarp_wire::WireVersion;
use yarp_wire::bottle::DecodeError;
use yarp_wire::message::{ReadObject, WireObject};

#[global_allocator]
static COUNTING: Counting = Counting;

/// Number of messages whose allocations are counted, and of warm-up messages.
const MESSAGES: usize = 2000;
const WARM_UP: usize = 2000;
/// Timeout of a step.
const TIMEOUT: Duration = Duration::from_secs(30);

/// A bottle of one integer.
struct Small(i32);

impl WireObject for Small {
    fn write_binary(&self, out: &mut BytesMut, _wire_version: WireVersion) {
        for word in [257, 1, self.0] {
            out.put_i32_le(word);
        }
    }

    /// Without this, the message would be converted to a bottle first.
    fn write_text(&self, out: &mut BytesMut) {
        let _ = writeln!(out, "{}\r", self.0);
    }
}

impl ReadObject for Small {
    fn read_binary(bytes: &Bytes, _wire_version: WireVersion) -> Result<Self, DecodeError> {
        let mut last = &bytes[bytes.len() - 4..];
        Ok(Self(last.get_i32_le()))
    }
}

#[derive(Clone, Copy, Debug)]
enum Way {
    Write,
    Strict,
    IfIdle,
}

#[derive(Clone, Copy, Debug)]
enum Reading {
    Handler,
    Queue,
}

/// Counts allocations while messages are sent from one port to another, one at a time.
async fn measure(network: &Network, carrier: &str, way: Way, reading: Reading) -> usize {
    let arrived = Arc::new(AtomicUsize::new(0));
    let options = PortOptions::new().unregistered();
    let counted = arrived.clone();
    let options = match reading {
        Reading::Queue => options.queue(Queue::Wait(10)),
        Reading::Handler => options.handler(move |_| {
            counted.fetch_add(1, Ordering::Relaxed);
            Answer::Nothing
        }),
    };
    let reader = Port::open(network, "/reader", options).await.unwrap();
    let options = PortOptions::new().unregistered();
    let writer = Port::open(network, "/writer", options).await.unwrap();
    let contact = format!("{carrier}://127.0.0.1:{}/reader", reader.tcp_port());
    writer.connect(&contact).await.unwrap();
    let mut before = 0;
    for number in 0..WARM_UP + MESSAGES {
        if number == WARM_UP {
            before = calls();
        }
        let message = Small(number as i32);
        match way {
            Way::Write => assert_eq!(writer.write(&message).await, 1),
            Way::Strict => assert_eq!(writer.write_strict(&message, None).await, 1),
            Way::IfIdle => {
                // The last message may not be acknowledged yet.
                while writer.write_if_idle(&message, None) == 0 {
                    tokio::task::yield_now().await;
                }
            }
        }
        match reading {
            Reading::Queue => drop(reader.read().await.unwrap()),
            Reading::Handler => {
                while arrived.load(Ordering::Relaxed) <= number {
                    tokio::task::yield_now().await;
                }
            }
        }
    }
    let allocations = calls() - before;
    writer.close().await;
    reader.close().await;
    allocations
}

/// Counts allocations while requests are answered, one at a time.
async fn measure_calls(carrier: &str, reading: Reading) -> usize {
    let network = Network::none().with_timeout(TIMEOUT);
    let options = PortOptions::new().unregistered();
    let options = match reading {
        Reading::Handler => {
            options.handler(|request| request.read().map_or(Answer::Nothing, reply))
        }
        Reading::Queue => options.rpc_server(),
    };
    let server = Port::open(&network, "/server", options).await.unwrap();
    let options = PortOptions::new().unregistered().rpc_client();
    let client = Port::open(&network, "/client", options).await.unwrap();
    let contact = format!("{carrier}://127.0.0.1:{}/server", server.tcp_port());
    client.connect(&contact).await.unwrap();
    let mut before = 0;
    let answer = async || {
        if let Reading::Queue = reading {
            let mut request = server.read().await.unwrap();
            request.reply(request.read::<Small>().unwrap());
        }
    };
    for number in 0..WARM_UP + MESSAGES {
        if number == WARM_UP {
            before = calls();
        }
        let request = Small(number as i32);
        let (answer, ()) = tokio::join!(client.call::<Small>(&request), answer());
        assert_eq!(answer.unwrap().0, number as i32);
    }
    let allocations = calls() - before;
    client.close().await;
    server.close().await;
    allocations
}

fn reply(small: Small) -> Answer {
    Answer::reply(small)
}

const CARRIERS: [&str; 11] = [
    "tcp",
    "fast_tcp",
    "shmem",
    "unix_stream",
    "unix_stream+ack",
    "udp",
    "mcast",
    "local",
    "text",
    "text_ack",
    "name_ser",
];

const CALLS: [&str; 5] = ["tcp", "fast_tcp", "shmem", "unix_stream", "local"];

/// Returns the maximum number of allocations. On a Unix socket some happen at random: a reader that
/// polls and then sleeps occasionally registers with the runtime anew.
fn most(carrier: &str) -> usize {
    match carrier.starts_with("unix_stream") {
        true => MESSAGES / 2,
        false => 0,
    }
}

/// Returns the minimum of a few attempts, stopping at the first within the maximum: allocations per
/// message do not happen at random.
async fn fewest(most: usize, measure: impl AsyncFn() -> usize) -> usize {
    let mut fewest = usize::MAX;
    for _ in 0..5 {
        let measuring = tokio::time::timeout(TIMEOUT, measure()).await;
        fewest = fewest.min(measuring.expect("it gets through"));
        if fewest <= most {
            break;
        }
    }
    fewest
}

#[tokio::test]
async fn in_steady_state_there_are_none() {
    // Multicast groups come from a name server.
    let options = ServerOptions::default().at("127.0.0.1", 0);
    let server = Server::start(options).await.unwrap();
    let network = server.network().with_timeout(TIMEOUT);
    let mut found = Vec::new();
    for carrier in CARRIERS {
        for way in [Way::Write, Way::Strict, Way::IfIdle] {
            for reading in [Reading::Handler, Reading::Queue] {
                let most = most(carrier);
                let allocations = fewest(most, || measure(&network, carrier, way, reading)).await;
                println!("{carrier} {way:?} {reading:?}: {allocations} for {MESSAGES} messages");
                if allocations > most {
                    found.push((carrier, way, reading, allocations));
                }
            }
        }
    }
    server.close().await;
    assert!(found.is_empty(), "{found:#?}");
    // In the same test, because the counters are those of the process.
    for carrier in CALLS {
        for reading in [Reading::Handler, Reading::Queue] {
            let most = most(carrier);
            let allocations = fewest(most, || measure_calls(carrier, reading)).await;
            println!("{carrier} {reading:?}: {allocations} for {MESSAGES} calls");
            assert!(allocations <= most, "{carrier} {reading:?}: {allocations}");
        }
    }
}
