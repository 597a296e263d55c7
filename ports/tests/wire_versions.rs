//! Ports of this implementation decode each other's floats, whatever was requested and whichever
//! side sends them first.

use crate::common;

use common::{bottle, connect, open, within};
use yarp_ports::{Answer, Port, PortOptions, Received};
use yarp_wire::WireVersion;

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
