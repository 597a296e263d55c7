//! Ports of this implementation decode each other's floats, whatever was requested and whichever
//! side sends them first; the question for the wire version leaves no trace.

use crate::common;

use std::time::Duration;

use common::{bottle, connect, open, within};
use tokio::io::AsyncWriteExt;
use tokio::net::{TcpListener, TcpStream};
use yarp_ports::{AdminClient, Answer, Port, PortOptions, Received};
use yarp_wire::WireVersion;
use yarp_wire::carrier::Carrier;

/// The request does not reveal the wire version, and the reply ends with values that the two encode
/// differently.
#[tokio::test]
async fn a_reply_with_floats_is_understood_though_the_request_had_none() {
    for wire_version in [WireVersion::V3, WireVersion::V4] {
        for reply in ["1.5", "[ok] (1.5 2.5)", "1 45.0 0.0", "(1.0 2.0) [ok]"] {
            let handler = move |_: &mut Received| Answer::reply(bottle(reply));
            let options = PortOptions::new()
                .handler(handler)
                .wire_version(wire_version);
            let server = open("/server", options).await;
            let client = open("/client", PortOptions::new()).await;
            connect(&client, &server, "tcp").await;
            for _ in 0..2 {
                assert_eq!(asked(&client, "[get] [pos]").await, reply);
            }
            assert_eq!(asked(&client, "[set] 2.5").await, reply);
            client.close().await;
            server.close().await;
        }
    }
}

async fn asked(client: &Port, request: &str) -> String {
    let request = bottle(request);
    let answer: yarp_wire::Bottle = within(client.call(&request)).await.unwrap();
    answer.to_string()
}

/// Forwards connections to a port; the port hears that the client has ended its side after a delay.
async fn late_ends(port: &Port, delay: Duration) -> u16 {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let own = listener.local_addr().unwrap().port();
    let target = ("127.0.0.1", port.tcp_port());
    tokio::spawn(async move {
        while let Ok((client, _)) = listener.accept().await {
            let server = TcpStream::connect(target).await.unwrap();
            let (mut from_client, mut to_client) = client.into_split();
            let (mut from_server, mut to_server) = server.into_split();
            tokio::spawn(async move {
                let _ = tokio::io::copy(&mut from_client, &mut to_server).await;
                tokio::time::sleep(delay).await;
                let _ = to_server.shutdown().await;
            });
            tokio::spawn(async move {
                let _ = tokio::io::copy(&mut from_server, &mut to_client).await;
            });
        }
    });
    own
}

/// Connects as `yarp admin rpc` does, and asks the port for the connections that it has.
async fn listed(server: &Port, end_delay: Duration) -> String {
    let port = late_ends(server, end_delay).await;
    let carrier = Carrier::by_name("tcp").unwrap();
    let opening = AdminClient::open(
        "/server",
        ("127.0.0.1", port),
        carrier,
        "asker",
        server.network(),
    );
    let mut client = within(opening).await.unwrap();
    let listed = within(client.admin(&bottle("[list] [in]"))).await.unwrap();
    listed.to_string()
}

/// `yarp admin rpc` once listed a connection of its own that it had closed before.
#[tokio::test]
async fn the_connection_that_asked_for_the_wire_version_has_ended_before_the_next_begins() {
    let server = open("/server", PortOptions::new()).await;
    assert_eq!(listed(&server, Duration::from_millis(50)).await, "asker");
    // A peer that never notices is not waited for.
    assert_eq!(
        listed(&server, Duration::from_secs(600)).await,
        "admin asker"
    );
    server.close().await;
}
