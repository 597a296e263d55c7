//! A killed writer over `udp` or `mcast` is dropped; a silent one is not.

use crate::common;

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use common::Home;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use yarp_ports::{Network, Port, PortOptions, Queue};
use yarp_wire::Bottle;

/// Longer than any step takes.
const TIMEOUT: Duration = Duration::from_secs(60);

fn network(home: &Home) -> Network {
    Network::at("127.0.0.1", home.server_port()).with_timeout(TIMEOUT)
}

/// Opens a reader that probes silent writers often.
async fn reader(home: &Home) -> Port {
    let options = PortOptions::new().queue(Queue::Wait(100));
    let options = options.datagram_timeout(Duration::from_millis(200));
    Port::open(&network(home), "/r", options).await.unwrap()
}

#[track_caller]
fn until(condition: impl Fn() -> bool) -> impl Future<Output = ()> {
    let caller = std::panic::Location::caller();
    let waiting = async move {
        while !condition() {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    };
    async move {
        let waited = tokio::time::timeout(TIMEOUT, waiting).await;
        waited.unwrap_or_else(|_| panic!("stuck at {caller}"));
    }
}

/// Lets `writer` write `text` until the reader has received it: datagrams may be lost.
async fn arrives(writer: &Port, reader: &Port, text: &str) {
    let arriving = async {
        loop {
            writer.write(&Bottle::of(text)).await;
            let reading = tokio::time::timeout(Duration::from_millis(300), reader.read()).await;
            if let Ok(Ok(message)) = reading
                && message.bottle().unwrap() == Bottle::of(text)
            {
                break;
            }
        }
    };
    tokio::time::timeout(TIMEOUT, arriving).await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn killed_writers_are_dropped_and_silent_ones_kept() {
    let home = Home::new();
    let _server = home.serve();
    let asked = Arc::new(AtomicUsize::new(0));
    let counted = asked.clone();
    let options = PortOptions::new().on_connection_change(move |change| {
        if change.incoming && change.began && change.from == "admin" {
            counted.fetch_add(1, Ordering::Relaxed);
        }
    });
    let silent = Port::open(&network(&home), "/silent", options)
        .await
        .unwrap();
    for carrier in ["udp", "mcast"] {
        let reader = reader(&home).await;
        silent.connect(&format!("{carrier}://r")).await.unwrap();
        // A process of its own.
        let killed = home.start("write /killed").see("active at");
        home.run(&format!("connect /killed /r {carrier}")).with(0);
        until(|| reader.inputs() == ["/silent", "/killed"]).await;
        killed.kill();
        until(|| reader.inputs() == ["/silent"]).await;
        // A writer that answers every probe stays.
        let before = asked.load(Ordering::Relaxed);
        until(|| asked.load(Ordering::Relaxed) > before + 5).await;
        until(|| reader.inputs() == ["/silent"]).await;
        arrives(&silent, &reader, carrier).await;
        reader.close().await;
        until(|| silent.outputs().is_empty()).await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn restarted_writers_without_their_connection_are_dropped() {
    let home = Home::new();
    let _server = home.serve();
    let reader = reader(&home).await;
    let network = network(&home);
    let lives = Port::open(&network, "/w", PortOptions::new()).await;
    // The connection of an earlier run.
    let mut header = TcpStream::connect(("127.0.0.1", reader.tcp_port()))
        .await
        .unwrap();
    header
        .write_all(b"YA\x61\x1e\0\0RP\x03\0\0\0/w\0")
        .await
        .unwrap();
    // The reply to its header: it is in the list.
    header.read_exact(&mut [0; 8]).await.unwrap();
    until(|| reader.inputs().is_empty()).await;
    lives.unwrap().close().await;
}
