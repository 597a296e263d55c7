//! Small messages allocate nothing once a connection has warmed up, neither where they are written
//! nor where they are read; on carriers that make something of each, no more than that.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use bytes::{Buf, BufMut, Bytes, BytesMut};
use yarp_conformance::counting::{Counting, calls};
use yarp_ports::{Answer, Network, Port, PortOptions, Queue};
use yarp_wire::Dialect;
use yarp_wire::bottle::DecodeError;
use yarp_wire::message::{ReadObject, WireObject};

#[global_allocator]
static COUNTING: Counting = Counting;

/// Messages whose allocations are counted, and those before them.
const MESSAGES: usize = 2000;
const WARM_UP: usize = 2000;
/// The most that a step may take; nothing is right or wrong because of it.
const PATIENCE: Duration = Duration::from_secs(30);

/// A bottle of one integer.
struct Small(i32);

impl WireObject for Small {
    fn write_binary(&self, out: &mut BytesMut, _dialect: Dialect) {
        for word in [257, 1, self.0] {
            out.put_i32_le(word);
        }
    }
}

impl ReadObject for Small {
    fn read_binary(bytes: &Bytes, _dialect: Dialect) -> Result<Self, DecodeError> {
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

/// Allocations while messages go from one port to another, one at a time.
async fn measure(carrier: &str, way: Way, reading: Reading) -> usize {
    let network = Network::none().with_deadline(PATIENCE);
    let arrived = Arc::new(AtomicUsize::new(0));
    let options = PortOptions::new().unregistered();
    let counted = arrived.clone();
    let options = match reading {
        Reading::Queue => options.reading(Queue::Wait(10)),
        Reading::Handler => options.handler(move |_| {
            counted.fetch_add(1, Ordering::Relaxed);
            Answer::Nothing
        }),
    };
    let reader = Port::open(&network, "/reader", options).await.unwrap();
    let options = PortOptions::new().unregistered();
    let writer = Port::open(&network, "/writer", options).await.unwrap();
    let contact = format!("{carrier}://127.0.0.1:{}/reader", reader.number());
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
                // The last may not have been acknowledged yet.
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

/// Allocations while requests are answered, one at a time.
async fn measure_calls(carrier: &str) -> usize {
    let network = Network::none().with_deadline(PATIENCE);
    let options = PortOptions::new().unregistered();
    let options = options.handler(|request| request.read().map_or(Answer::Nothing, reply));
    let server = Port::open(&network, "/server", options).await.unwrap();
    let options = PortOptions::new().unregistered().calling();
    let client = Port::open(&network, "/client", options).await.unwrap();
    let contact = format!("{carrier}://127.0.0.1:{}/server", server.number());
    client.connect(&contact).await.unwrap();
    let mut before = 0;
    for number in 0..WARM_UP + MESSAGES {
        if number == WARM_UP {
            before = calls();
        }
        let answer: Small = client.call(&Small(number as i32)).await.unwrap();
        assert_eq!(answer.0, number as i32);
    }
    let allocations = calls() - before;
    client.close().await;
    server.close().await;
    allocations
}

fn reply(small: Small) -> Answer {
    Answer::reply(small)
}

/// Allocations per message, at most: over others than streams with an index and shared memory,
/// something is made for each.
const CARRIERS: [(&str, usize); 9] = [
    ("tcp", 0),
    ("fast_tcp", 0),
    ("shmem", 0),
    // One, and another by chance: who waits awake gives way in between.
    ("unix_stream", 2),
    ("unix_stream+ack", 2),
    // Datagrams that wait are apart.
    ("udp", 3),
    // The message itself is what is handed over.
    ("local", 3),
    // Content becomes text, and is read as such.
    ("text", 9),
    ("text_ack", 11),
];

/// Allocations per call, at most: the reply that the handler gives, the place where the caller waits
/// for it, and what the carrier makes of both messages.
const CALLS: [(&str, usize); 5] = [
    ("tcp", 2),
    ("fast_tcp", 2),
    ("shmem", 2),
    ("unix_stream", 4),
    ("local", 12),
];

/// Whether there were more than so many for each; a few come by chance where there are any.
fn is_too_many(allocations: usize, each: usize) -> bool {
    allocations > each * MESSAGES + each * MESSAGES / 10
}

#[tokio::test]
async fn in_steady_state_there_are_none_or_few() {
    let mut found = Vec::new();
    for (carrier, each) in CARRIERS {
        for way in [Way::Write, Way::Strict, Way::IfIdle] {
            for reading in [Reading::Handler, Reading::Queue] {
                let measuring = measure(carrier, way, reading);
                let measuring = tokio::time::timeout(PATIENCE, measuring);
                let allocations = measuring.await.expect("it gets through");
                println!("{carrier} {way:?} {reading:?}: {allocations} for {MESSAGES} messages");
                if is_too_many(allocations, each) {
                    found.push((carrier, way, reading, allocations));
                }
            }
        }
    }
    for (carrier, each) in CALLS {
        let measuring = tokio::time::timeout(PATIENCE, measure_calls(carrier));
        let allocations = measuring.await.expect("it gets through");
        println!("{carrier}: {allocations} for {MESSAGES} calls");
        assert!(!is_too_many(allocations, each), "{carrier}: {allocations}");
    }
    assert!(found.is_empty(), "{found:#?}");
}
