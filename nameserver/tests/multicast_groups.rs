//! Ports that share a multicast group, which the server assigns and reclaims: one of them
//! transmits.

use std::time::Duration;

use yarp_nameserver::{Server, ServerOptions};
use yarp_ports::{Network, Port, PortError, PortOptions, Queue};
use yarp_wire::Bottle;

const TIMEOUT: Duration = Duration::from_secs(20);

async fn server() -> Server {
    let options = ServerOptions::default().at("127.0.0.1", 0);
    Server::start(options).await.unwrap()
}

fn reading() -> PortOptions {
    PortOptions::new().queue(Queue::Wait(100))
}

async fn next(port: &Port) -> Bottle {
    let read = tokio::time::timeout(TIMEOUT, port.read()).await;
    read.unwrap().unwrap().bottle().unwrap()
}

async fn names(network: &Network) -> Vec<String> {
    let list = network.ask("list").await.unwrap();
    list.registrations()
        .into_iter()
        .map(|port| port.name)
        .collect()
}

#[tokio::test]
async fn readers_share_one_multicast_transmission() {
    let server = server().await;
    let network = server.network();
    let first = Port::open(&network, "/first", reading()).await.unwrap();
    let second = Port::open(&network, "/second", reading()).await.unwrap();
    let writer = Port::open(&network, "/writer", PortOptions::new())
        .await
        .unwrap();
    writer.connect_over("/first", "mcast").await.unwrap();
    writer.connect_over("/second", "mcast").await.unwrap();
    let groups = |names: Vec<String>| {
        names
            .iter()
            .filter(|name| name.starts_with("/tmp/"))
            .count()
    };
    assert_eq!(groups(names(&network).await), 1);

    for number in 0..20 {
        // One of the two connections transmits for both.
        assert_eq!(writer.write(&Bottle::of(number)).await, 1);
        for reader in [&first, &second] {
            assert_eq!(next(reader).await, Bottle::of(number));
        }
    }
    // The transmitting connection ends; the other takes over.
    assert!(writer.disconnect("/first").await);
    assert_eq!(writer.write(&Bottle::of("still")).await, 1);
    assert_eq!(next(&second).await, Bottle::of("still"));
    assert!(writer.disconnect("/second").await);
    assert_eq!(groups(names(&network).await), 0);
    for port in [first, second, writer] {
        port.close().await;
    }
    server.close().await;
}

/// Copies of received messages have their own group: readers of the owner's messages do not get
/// them.
#[tokio::test]
async fn copies_use_another_group() {
    let server = server().await;
    let network = server.network();
    let open = async |name| Port::open(&network, name, reading()).await.unwrap();
    let (looked_at, reader) = (open("/looked_at").await, open("/reader").await);
    let lookers = [open("/first").await, open("/second").await];
    let writer = open("/writer").await;
    writer.connect_over("/looked_at", "tcp").await.unwrap();
    looked_at.connect_over("/reader", "mcast").await.unwrap();
    for looker in &lookers {
        looked_at
            .connect_over(looker.name(), "mcast+log.in")
            .await
            .unwrap();
    }

    for number in 0..20 {
        assert_eq!(writer.write(&Bottle::of(number)).await, 1);
        for looker in &lookers {
            assert_eq!(next(looker).await, Bottle::of(number));
        }
        assert_eq!(looked_at.write(&Bottle::of(-number)).await, 1);
        assert_eq!(next(&reader).await, Bottle::of(-number));
    }
    // The transmitting connection ends; the other takes over.
    assert!(looked_at.disconnect("/first").await);
    assert_eq!(writer.write(&Bottle::of("still")).await, 1);
    assert_eq!(next(&lookers[1]).await, Bottle::of("still"));
    assert!(lookers[0].try_read().is_none());
    assert!(reader.try_read().is_none());
    server.close().await;
}

/// The connection itself has no reply: the writer asks the reader over another connection.
#[tokio::test]
async fn readers_without_the_modifier_are_refused() {
    let server = server().await;
    let network = server.network();
    let reader = Port::open(&network, "/reader", reading()).await.unwrap();
    let writer = Port::open(&network, "/writer", PortOptions::new())
        .await
        .unwrap();
    let lacking = writer.connect_over("/reader", "mcast+recv.nonesuch").await;
    let error = lacking.unwrap_err();
    assert!(matches!(error, PortError::Declined { .. }), "{error:?}");
    assert!(writer.outputs().is_empty());
    assert!(
        !names(&network)
            .await
            .iter()
            .any(|name| name.starts_with("/tmp/"))
    );
    let statistics = "mcast+recv.portmonitor+type.dll+file.statistics";
    writer.connect_over("/reader", statistics).await.unwrap();
    assert_eq!(writer.write(&Bottle::of(1)).await, 1);
    assert_eq!(next(&reader).await, Bottle::of(1));
    reader.close().await;
    writer.close().await;
    server.close().await;
}
