//! Small messages allocate nothing once a connection has warmed up, neither where they are written
//! nor where they are read.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use bytes::{BufMut, BytesMut};
use yarp_conformance::counting::{Counting, calls};
use yarp_ports::{Answer, Network, Port, PortOptions, Queue};
use yarp_wire::Dialect;
use yarp_wire::message::WireObject;

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

#[tokio::test]
async fn in_steady_state_there_are_none() {
    let mut found = Vec::new();
    for carrier in ["tcp", "fast_tcp"] {
        for way in [Way::Write, Way::Strict, Way::IfIdle] {
            for reading in [Reading::Handler, Reading::Queue] {
                let measuring = measure(carrier, way, reading);
                let measuring = tokio::time::timeout(PATIENCE, measuring);
                let allocations = measuring.await.expect("it gets through");
                println!("{carrier} {way:?} {reading:?}: {allocations} for {MESSAGES} messages");
                if allocations > 0 {
                    found.push((carrier, way, reading, allocations));
                }
            }
        }
    }
    assert!(found.is_empty(), "{found:#?}");
}
