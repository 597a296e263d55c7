//! A server that is restarted with a smaller budget than its stored names need.

use std::path::Path;

use yarp_nameserver::registry::Capacity;
use yarp_nameserver::store::{Durability, SqliteStore};
use yarp_nameserver::{Server, ServerOptions};
use yarp_ports::Network;

async fn start(file: &Path, capacity: Capacity) -> Server {
    let mut options = ServerOptions::default().at("127.0.0.1", 0);
    options.capacity = capacity;
    options.probe_interval = None;
    let store = SqliteStore::open(file, Durability::Process).unwrap();
    Server::start_with(options, store).await.unwrap()
}

async fn first_line(network: &Network, request: &str) -> String {
    let answer = network.ask(request).await.unwrap();
    answer.lines().next().unwrap_or_default().to_owned()
}

/// Capacity for names and bytes, all of it for one address.
fn capacity(names: usize, memory: usize) -> Capacity {
    Capacity {
        names,
        names_per_address: names,
        memory,
        memory_per_address: memory,
    }
}

fn name(index: usize) -> String {
    format!("/{index}/{}", "n".repeat(900))
}

/// A killed server could not come up: it held twice what was stored while it started.
#[tokio::test]
async fn names_above_the_budget_are_left_out_and_stay_in_the_store() {
    const STORED: usize = 30;
    let whole = capacity(1000, 1 << 20);
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("names.db");
    let server = start(&file, whole).await;
    let network = server.network();
    let own = server.registrations().len();
    for index in 0..STORED {
        let request = format!("register {} tcp 127.0.0.1 9", name(index));
        let line = first_line(&network, &request).await;
        assert!(line.starts_with("registration"), "{line}");
    }
    server.close().await;

    // Too many names; then few enough, with too many bytes.
    for less in [capacity(10, 1 << 20), capacity(1000, 40_000)] {
        let server = start(&file, less).await;
        let held = server.registrations().len();
        let bytes: usize = server
            .registrations()
            .iter()
            .map(|held| held.name.len())
            .sum();
        assert!((own + 1..own + STORED).contains(&held), "{held} names");
        assert!(
            held - own <= less.names && bytes <= less.memory,
            "{held} names, {bytes} bytes"
        );
        let network = server.network();
        let line = first_line(&network, "query /root").await;
        assert!(line.starts_with("registration name /root"), "{line}");
        // The server is full, but for what its own entries took while it started.
        let (mut refused, mut added) = (None, Vec::new());
        for index in 0..4 {
            let new = format!("register /new/{index}{} tcp 127.0.0.1 9", "n".repeat(900));
            let line = first_line(&network, &new).await;
            if !line.starts_with("registration") {
                refused.get_or_insert(line);
            }
            let new = format!("unregister /new/{index}{}", "n".repeat(900));
            added.push(new);
        }
        let refused = refused.expect("a server that is full");
        let expected = "refused: the server holds at most";
        assert!(refused.starts_with(expected), "{refused}");
        for request in added {
            first_line(&network, &request).await;
        }
        server.close().await;
    }

    let server = start(&file, whole).await;
    assert_eq!(server.registrations().len(), own + STORED);
    server.close().await;
}
