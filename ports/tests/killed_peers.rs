//! A peer that dies in the middle of a message or a reply takes only its own connection with it.

use crate::common;

use common::{ACK, Raw, bottle, connect, next, open, tcp_header, tcp_message, until, within};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpListener;
use yarp_ports::{Answer, PortError, PortOptions, Queue};
use yarp_wire::Bottle;

#[tokio::test]
async fn a_writer_that_dies_in_a_message_leaves_nothing_of_it() {
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(10))).await;
    let good = open("/good", PortOptions::new()).await;
    connect(&good, &reader, "tcp").await;
    let whole = [tcp_header("/bad"), tcp_message(b'D', &bottle("bad 1 2 3"))].concat();
    for end in 1..whole.len() {
        let mut bad = Raw::to(&reader).await;
        bad.send(&whole[..end]).await;
        drop(bad);
        assert_eq!(within(good.write(&Bottle::of(end as i32))).await, 1);
        assert_eq!(next(&reader).await, end.to_string());
    }
    until(|| reader.inputs() == ["/good"]).await;
    assert!(reader.try_read().is_none());
}

#[tokio::test]
async fn a_writer_that_dies_in_a_line_leaves_nothing_of_it() {
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(10))).await;
    let good = open("/good", PortOptions::new()).await;
    connect(&good, &reader, "text").await;
    let whole = "CONNECT /bad\r\nD\r\n(bad\r\n1 2)\r";
    for end in 1..=whole.len() {
        let mut bad = Raw::to(&reader).await;
        bad.send(&whole[..end]).await;
        drop(bad);
        assert_eq!(within(good.write(&Bottle::of(end as i32))).await, 1);
        assert_eq!(next(&reader).await, end.to_string());
    }
    until(|| reader.inputs() == ["/good"]).await;
    assert!(reader.try_read().is_none());
}

/// The acknowledgement of a message waited until the next had room, too.
#[tokio::test]
async fn messages_sent_before_a_writer_dies_arrive() {
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(1))).await;
    let mut dying = Raw::tcp(&reader, "/dying").await;
    for number in 0..5 {
        dying.send(tcp_message(b'D', &Bottle::of(number))).await;
    }
    for number in 0..4 {
        assert_eq!(next(&reader).await, number.to_string());
        dying.expect(ACK).await;
    }
    assert_eq!(next(&reader).await, "4");
}

#[tokio::test]
async fn a_caller_that_dies_while_waiting_affects_no_other() {
    let server = open("/server", PortOptions::new().rpc_server()).await;
    for _ in 0..20 {
        let mut dying = Raw::tcp(&server, "/dying").await;
        dying.send(tcp_message(b'd', &bottle("last words"))).await;
        let mut request = within(server.read()).await.unwrap();
        drop(dying);
        // Nothing reads it.
        request.reply(Bottle::of("x".repeat(1_000_000)));
    }
    let client = open("/client", PortOptions::new().rpc_client()).await;
    connect(&client, &server, "tcp").await;
    let request = bottle("hello");
    let serving = async { server.read().await.unwrap().reply(bottle("hi")) };
    let calling = client.call::<Bottle>(&request);
    let ((), answer) = within(async { tokio::join!(serving, calling) }).await;
    assert_eq!(answer.unwrap().to_string(), "hi");
    until(|| server.inputs() == ["/client"]).await;
}

/// Returns a server that answers the header on any connection, then sends `reply` and dies.
async fn dying_server(reply: Vec<u8>) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let number = listener.local_addr().unwrap().port();
    tokio::spawn(async move {
        while let Ok((mut stream, _)) = listener.accept().await {
            let mut magic = [0; 8];
            if stream.read_exact(&mut magic).await.is_err() || magic[..2] != *b"YA" {
                // The probe of the wire version gets no answer.
                continue;
            }
            let header = yarp_wire::framed_number::encode(number.into());
            let _ = stream.write_all(&header).await;
            // Wait for the request, so that the reply does not come before it.
            let mut request = [0; 4096];
            let mut seen = 0;
            while seen < 13 + tcp_message(b'd', &bottle("hello")).len() - 8 {
                match stream.read(&mut request).await {
                    Ok(0) | Err(_) => break,
                    Ok(count) => seen += count,
                }
            }
            let _ = stream.write_all(&reply).await;
        }
    });
    format!("tcp://127.0.0.1:{number}/dying")
}

#[tokio::test]
async fn a_server_that_dies_in_its_reply_is_an_error() {
    let reply = bottle("some reply (1 2)").encode(yarp_wire::WireVersion::V3);
    for end in 0..reply.len() {
        let server = dying_server(reply[..end].to_vec()).await;
        let client = open("/client", PortOptions::new().rpc_client()).await;
        within(client.connect(&server)).await.unwrap();
        let error = within(client.call::<Bottle>(&bottle("hello")))
            .await
            .unwrap_err();
        assert!(matches!(error, PortError::Lost { .. }), "{end} {error}");
        until(|| client.outputs().is_empty()).await;
        let error = within(client.call::<Bottle>(&bottle("hello")))
            .await
            .unwrap_err();
        assert!(matches!(error, PortError::NotConnected { .. }), "{error}");
    }
}

#[tokio::test]
async fn a_reader_that_dies_is_dropped_and_the_rest_goes_on() {
    for carrier in ["tcp", "fast_tcp", "text", "text_ack"] {
        let writer = open("/writer", PortOptions::new()).await;
        let keeps = open("/keeps", PortOptions::new().queue(Queue::Wait(1))).await;
        let dies = open("/dies", PortOptions::new().queue(Queue::Wait(1))).await;
        within(writer.connect(&common::at(&dies, carrier)))
            .await
            .unwrap();
        within(writer.connect(&common::at(&keeps, carrier)))
            .await
            .unwrap();
        let message = Bottle::of("x".repeat(100_000));
        for _ in 0..3 {
            writer.write_if_idle(&message, None);
        }
        within(dies.close()).await;
        until(|| writer.outputs() == ["/keeps"]).await;
        for number in 0..10 {
            let last = Bottle::of(number);
            let read =
                async { while within(keeps.read()).await.unwrap().bottle().unwrap() != last {} };
            let (taken, ()) = within(async { tokio::join!(writer.write(&last), read) }).await;
            assert_eq!(taken, 1, "{carrier}");
        }
    }
}

/// A handler that panicked left its connection in the list for ever.
#[tokio::test]
async fn a_handler_that_panics_ends_its_connection_only() {
    let options = PortOptions::new().handler(|request| {
        assert_ne!(&*request.from, "/unlucky", "as the test wants it");
        Answer::reply(bottle("ok"))
    });
    let server = open("/server", options).await;
    let lucky = open("/lucky", PortOptions::new().rpc_client()).await;
    connect(&lucky, &server, "tcp").await;
    let unlucky = open("/unlucky", PortOptions::new().rpc_client()).await;
    connect(&unlucky, &server, "tcp").await;
    let error = within(unlucky.call::<Bottle>(&bottle("x")))
        .await
        .unwrap_err();
    assert!(matches!(error, PortError::Lost { .. }), "{error}");
    until(|| server.inputs() == ["/lucky"]).await;
    within(lucky.call::<Bottle>(&bottle("x"))).await.unwrap();
    within(server.close()).await;
}
