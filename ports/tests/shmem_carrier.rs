//! Messages through shared memory. Killed peers are tested in `shmem_killed_peers.rs`, the layouts beside the code, live
//! stock peers in `conformance/live/carriers.py`.

use crate::common;

use common::{Raw, bottle, connect, next, open, until, within};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpListener;
use yarp_ports::{Answer, PortOptions, Queue};
use yarp_wire::{Bottle, Stamp};

#[tokio::test]
async fn messages_of_every_size_arrive_and_are_answered() {
    let server = PortOptions::new().handler(|request| {
        let answer = request.bottle().unwrap();
        Answer::reply(answer.with(request.stamp().map_or(-1, |stamp| stamp.count)))
    });
    let server = open("/server", server).await;
    let client = open("/client", PortOptions::new().rpc_client()).await;
    connect(&client, &server, "shmem").await;
    for length in [0, 1, 4000, 70_000, 1_000_000, 5_000_000, 3] {
        let request = Bottle::of("x".repeat(length));
        let answer: Bottle = within(client.call(&request)).await.unwrap();
        assert_eq!(answer, request.with(-1), "{length}");
    }

    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(1))).await;
    let writer = open("/writer", PortOptions::new()).await;
    connect(&writer, &reader, "shmem").await;
    let stamp = Stamp::new(3, 4.5);
    let message = Bottle::of("y".repeat(1_000_000));
    for _ in 0..20 {
        let writing = writer.write_with(&message, Some(stamp.into()));
        let (_, read) = within(async { tokio::join!(writing, reader.read()) }).await;
        let read = read.unwrap();
        assert_eq!(read.stamp(), Some(stamp));
        assert_eq!(read.bottle().unwrap(), message);
    }
    // A slow reader holds up its writer, and nothing is lost.
    let writing = async {
        for number in 0..200 {
            writer
                .write(&Bottle::from_iter([
                    number.into(),
                    "z".repeat(20_000).into(),
                ]))
                .await;
        }
    };
    let reading = async {
        for number in 0..200 {
            let read = reader.read().await.unwrap().bottle().unwrap();
            assert_eq!(read.get(0).and_then(|value| value.as_i32()), Some(number));
        }
    };
    within(async { tokio::join!(writing, reading) }).await;
    within(writer.close()).await;
    until(|| reader.inputs().is_empty()).await;
}

/// A peer that lacks the carrier refuses at once, or closes the connection.
#[tokio::test]
async fn a_peer_without_the_carrier_is_a_clear_error() {
    let refusing = yarp_wire::connection::REFUSAL;
    for (carrier, answer, word) in [
        ("shmem", refusing, "it has no carrier shmem"),
        ("unix_stream", refusing, "it has no carrier unix_stream"),
        ("shmem", "", "it may not support shmem"),
    ] {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let number = listener.local_addr().unwrap().port();
        let refusing = tokio::spawn(async move {
            while let Ok((mut stream, _)) = listener.accept().await {
                let mut header = [0; 20];
                let begun = stream.read_exact(&mut header[..8]).await;
                if begun.is_err() || header.starts_with(b"CONNACK ") {
                    // The probe of the wire version gets no answer.
                    continue;
                }
                // All of it: what is unread when a connection ends takes the answer along.
                if stream.read_exact(&mut header[8..]).await.is_ok() {
                    let _ = stream.write_all(answer.as_bytes()).await;
                }
            }
        });
        let writer = open("/writer", PortOptions::new()).await;
        let contact = format!("{carrier}://127.0.0.1:{number}/reader");
        let error = within(writer.connect(&contact))
            .await
            .unwrap_err()
            .error_chain();
        assert!(error.contains(word) && error.contains("/reader"), "{error}");
        assert!(writer.outputs().is_empty());
        refusing.abort();
    }
}

#[tokio::test]
async fn an_abandoned_shmem_offer_has_no_effect() {
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(1))).await;
    let mut strangers = Vec::new();
    for _ in 0..5 {
        let mut stranger = Raw::to(&reader).await;
        stranger.send(b"YA\x6f\x1e\0\0RP\x09\0\0\0/strange\0").await;
        stranger.receive(8).await;
        strangers.push(stranger);
    }
    let writer = open("/writer", PortOptions::new()).await;
    connect(&writer, &reader, "shmem").await;
    writer.write(&bottle("hello")).await;
    assert_eq!(next(&reader).await, "hello");
    until(|| reader.inputs() == ["/writer"]).await;
}
