//! Small messages allocate nothing once a connection has warmed up, neither where they are written
//! nor where they are read.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use bytes::{BufMut, BytesMut};
use yarp_conformance::counting::{Counting, calls};
use yarp_ports::{Answer, Network, Port, PortOptions};
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

/// Allocations per message, once for every way and carrier.
async fn measure(carrier: &str, way: Way) -> f64 {
    let network = Network::none().with_deadline(PATIENCE);
    let arrived = Arc::new(AtomicUsize::new(0));
    let counted = arrived.clone();
    let options = PortOptions::new().unregistered().handler(move |_| {
        counted.fetch_add(1, Ordering::Relaxed);
        Answer::Nothing
    });
    let reader = Port::open(&network, "/reader", options).await.unwrap();
    let options = PortOptions::new().unregistered();
    let writer = Port::open(&network, "/writer", options).await.unwrap();
    let contact = format!("{carrier}://127.0.0.1:{}/reader", reader.number());
    writer.connect(&contact).await.unwrap();
    let mut sent = 0;
    let mut before = 0;
    for number in 0..WARM_UP + MESSAGES {
        if number == WARM_UP {
            before = calls();
        }
        let message = Small(number as i32);
        sent += match way {
            Way::Write => writer.write(&message).await,
            Way::Strict => writer.write_strict(&message, None).await,
            Way::IfIdle => writer.write_if_idle(&message, None),
        };
        // One at a time: a queue that grows is no steady state.
        while arrived.load(Ordering::Relaxed) < sent {
            tokio::task::yield_now().await;
        }
    }
    let allocations = calls() - before;
    writer.close().await;
    reader.close().await;
    assert!(sent > MESSAGES, "{carrier} {way:?}: {sent}");
    allocations as f64 / MESSAGES as f64
}

#[tokio::test]
async fn in_steady_state_there_are_none() {
    let mut found = Vec::new();
    for carrier in ["tcp", "fast_tcp", "text_ack"] {
        for way in [Way::Write, Way::Strict, Way::IfIdle] {
            let measuring = tokio::time::timeout(PATIENCE, measure(carrier, way));
            let allocations = measuring.await.expect("it gets through");
            println!("{carrier} {way:?}: {allocations} allocations per message");
            // Reading from the buffer now and then needs a new one.
            if allocations > 0.0 {
                found.push(format!("{carrier} {way:?}: {allocations}"));
            }
        }
    }
    assert!(found.is_empty(), "{found:#?}");
}
