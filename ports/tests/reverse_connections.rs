//! A connection that sends `r` reads the port's messages from then on.

use crate::common;

use common::{ACK, Raw, bottle, open, tcp_command, tcp_message, until, within};
use yarp_ports::{PortOptions, Queue};
use yarp_wire::Bottle;

#[tokio::test]
async fn over_text() {
    let port = open("/writer", PortOptions::new()).await;
    let mut raw = Raw::text(&port, "me").await;
    raw.send("r\r\n").await;
    until(|| port.outputs() == ["me"]).await;
    assert!(port.inputs().is_empty());
    for text in ["hello", "1 2 (3)", "\"a b\""] {
        assert_eq!(within(port.write(&bottle(text))).await, 1);
        raw.expect(format!("D\r\n{text}\r\n")).await;
    }
    drop(raw);
    until(|| port.outputs().is_empty()).await;
}

#[tokio::test]
async fn over_text_with_acknowledgements() {
    let port = open("/writer", PortOptions::new()).await;
    let mut raw = Raw::to(&port).await;
    raw.send("CONNACK me\r\nr\r\n").await;
    raw.expect("Welcome me\r\n<ACK>\r\n").await;
    until(|| port.outputs() == ["me"]).await;
    for text in ["hello", "5"] {
        let message = bottle(text);
        let reading = async {
            raw.expect(format!("D\r\n{text}\r\n")).await;
            raw.send("<ACK>\r\n").await;
        };
        let (taken, ()) = within(async { tokio::join!(port.write(&message), reading) }).await;
        assert_eq!(taken, 1);
    }
}

#[tokio::test]
async fn over_tcp() {
    let port = open("/writer", PortOptions::new()).await;
    let mut raw = Raw::tcp(&port, "/me").await;
    raw.send(tcp_command(b'r')).await;
    raw.expect(ACK).await;
    until(|| port.outputs() == ["/me"]).await;
    for text in ["hello", "1 2 (3)"] {
        let message = bottle(text);
        let reading = async {
            raw.expect(tcp_message(b'D', &message)).await;
            raw.send(ACK).await;
        };
        let (taken, ()) = within(async { tokio::join!(port.write(&message), reading) }).await;
        assert_eq!(taken, 1);
    }
    let closing = async {
        raw.expect(tcp_command(b'q')).await;
        raw.send(ACK).await;
        raw.ended().await
    };
    let ((), rest) = within(async { tokio::join!(port.close(), closing) }).await;
    assert!(rest.is_empty());
}

/// Messages that the peer sends before it reverses the connection still arrive.
#[tokio::test]
async fn messages_before_the_reversal_still_arrive() {
    let port = open("/both", PortOptions::new().queue(Queue::Wait(10))).await;
    let mut raw = Raw::tcp(&port, "/me").await;
    raw.send([tcp_message(b'D', &bottle("first")), tcp_command(b'r')].concat())
        .await;
    raw.expect([ACK, ACK].concat()).await;
    assert_eq!(common::next(&port).await, "first");
    until(|| port.outputs() == ["/me"]).await;
    let message = Bottle::of("back");
    assert_eq!(port.write_if_idle(&message, None), 1);
    raw.expect(tcp_message(b'D', &message)).await;
    // Not acknowledged yet: the next is not for it.
    assert_eq!(port.write_if_idle(&message, None), 0);
    raw.send(ACK).await;
    within(port.flush()).await;
}

#[tokio::test]
async fn a_port_asks_and_the_reader_answers() {
    let port = open("/caller", PortOptions::new().rpc_client()).await;
    let mut raw = Raw::tcp(&port, "/me").await;
    raw.send(tcp_command(b'r')).await;
    raw.expect(ACK).await;
    until(|| port.outputs() == ["/me"]).await;
    let (request, reply) = (bottle("how much"), bottle("42"));
    let answering = async {
        raw.expect(tcp_message(b'd', &request)).await;
        raw.send(reply.encode(yarp_wire::WireVersion::V3)).await;
        raw.send(ACK).await;
    };
    let calling = port.call::<Bottle>(&request);
    let (answer, ()) = within(async { tokio::join!(calling, answering) }).await;
    assert_eq!(answer.unwrap(), reply);
}
