//! Replies that are no bottles, parsed by the caller.

use std::time::Duration;

use bytes::{BufMut, BytesMut};
use yarp_ports::{AdminClient, Answer, Network, Port, PortError, PortOptions, Received};
use yarp_wire::carrier::Carrier;
use yarp_wire::message::WireObject;
use yarp_wire::{Bottle, WireVersion};

use crate::common::{open, within};

/// As many bytes as a request says.
struct Bytes(usize);

impl WireObject for Bytes {
    fn write_binary(&self, out: &mut BytesMut, _: WireVersion) {
        out.put_bytes(7, self.0);
    }
}

async fn call(
    server: &Port,
    network: &Network,
    carrier: &str,
    length: i32,
    needed: usize,
) -> Result<usize, PortError> {
    let carrier = Carrier::by_name(carrier).unwrap();
    let address = ("127.0.0.1", server.tcp_port());
    let client = AdminClient::open("/server", address, carrier, "/client", network).await?;
    let parse = |bytes: &[u8]| match bytes.first() {
        Some(byte) if *byte != 7 => Err(format!("got {byte}")),
        _ => Ok((bytes.len() >= needed).then_some(needed)),
    };
    client.call_parsed(&Bottle::of(length), 10_000, parse).await
}

#[tokio::test]
async fn a_caller_decides_what_a_reply_is() {
    let answer = |received: &mut Received| {
        let length = received
            .bottle()
            .ok()
            .and_then(|asked| asked.get(0)?.as_i32());
        Answer::reply(Bytes(length.unwrap_or(0) as usize))
    };
    let server = open("/server", PortOptions::new().handler(answer)).await;
    let network = server.network();
    for carrier in ["tcp", "fast_tcp"] {
        assert_eq!(
            call(&server, network, carrier, 5000, 5000).await.unwrap(),
            5000
        );
    }
    // Over fast_tcp nothing follows a reply: the limit alone ends the wait.
    let short = network.clone().with_timeout(Duration::from_millis(300));
    let late = call(&server, &short, "fast_tcp", 9_000, 20_000).await;
    assert!(matches!(late, Err(PortError::Timeout { .. })), "{late:?}");
    let long = call(&server, network, "fast_tcp", 10_001, 20_000).await;
    assert!(
        matches!(&long, Err(PortError::Lost { reason, .. }) if reason.contains("exceeds 10000 bytes")),
        "{long:?}"
    );
    // Without bytes of its own the reply over tcp is an acknowledgement.
    let wrong = call(&server, network, "tcp", 0, 1).await;
    assert!(
        matches!(&wrong, Err(PortError::Lost { reason, .. }) if reason == "got 89"),
        "{wrong:?}"
    );
    within(server.close()).await;
}
