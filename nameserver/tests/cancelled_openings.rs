//! A port whose opening is cancelled, or that is dropped, leaves no name behind.

use std::pin::pin;
use std::task::Poll;
use std::time::Duration;

use yarp_nameserver::{Server, ServerOptions};
use yarp_ports::{Network, Port, PortOptions, wait_for_dropped_ports};

const TIMEOUT: Duration = Duration::from_secs(60);

/// Begins to open the port and cancels at the `polls`th wait; returns whether it was open by then.
async fn cancelled_at(network: &Network, polls: usize) -> bool {
    let mut opening = pin!(Port::open(network, "/given/up", PortOptions::new()));
    for _ in 0..polls {
        let mut opened = false;
        std::future::poll_fn(|context| {
            opened = opening.as_mut().poll(context).is_ready();
            Poll::Ready(())
        })
        .await;
        if opened {
            return true;
        }
        tokio::time::sleep(Duration::from_micros(50)).await;
    }
    false
}

/// The opening is cancelled before, while and after the name server gives the name.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_name_is_free_whenever_the_opening_is_cancelled() {
    let options = ServerOptions::default().at("127.0.0.1", 0);
    let server = Server::start(options).await.unwrap();
    let network = Network::at("127.0.0.1", server.port());
    let mut opened = 0;
    for polls in 0.. {
        opened += u32::from(cancelled_at(&network, polls).await);
        let waiting = tokio::time::timeout(TIMEOUT, wait_for_dropped_ports());
        waiting.await.expect("closes");
        let found = network.query("/given/up").await;
        assert!(found.is_err(), "at wait {polls}: {found:?}");
        if opened == 20 {
            break;
        }
    }
}
