//! Messages through shared memory; killed peers, and the objects they leave. The layouts themselves
//! are tested beside the code; live stock peers in `conformance/live/carriers.py`.

mod common;

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

use common::{Raw, at, bottle, connect, next, open, until, within};
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

/// The environment variable with the task of a child process.
const CHILD: &str = "YARP_TEST_SHMEM_CHILD";

/// No test: the process that is killed. Writes to the contact in its environment as fast as it can.
#[tokio::test]
async fn child_that_writes() {
    let Ok(contact) = std::env::var(CHILD) else {
        return;
    };
    let writer = open("/child", PortOptions::new()).await;
    within(writer.connect(&contact)).await.unwrap();
    let message = Bottle::of("x".repeat(300_000));
    loop {
        writer.write(&message).await;
    }
}

/// Not a test: the process to be killed. Reads, and prints its TCP port.
#[tokio::test]
async fn child_that_reads() {
    if std::env::var(CHILD).is_err() {
        return;
    }
    let reader = open("/child", PortOptions::new().queue(Queue::Wait(1))).await;
    println!("\nport={}", reader.tcp_port());
    while reader.read().await.is_ok() {}
}

fn child(name: &str, wish: &str) -> std::process::Child {
    Command::new(std::env::current_exe().unwrap())
        .args(["--exact", name, "--nocapture"])
        .env(CHILD, wish)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap()
}

#[tokio::test]
async fn a_writer_that_is_killed_is_noticed_and_may_come_again() {
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(1))).await;
    for _ in 0..3 {
        let mut child = child("child_that_writes", &at(&reader, "shmem"));
        for _ in 0..5 {
            let read = within(reader.read()).await.unwrap();
            assert_eq!(&*read.from, "/child");
        }
        child.kill().unwrap();
        child.wait().unwrap();
        let gone = until(|| {
            while reader.try_read().is_some() {}
            reader.inputs().is_empty()
        });
        gone.await;
    }
}

#[tokio::test]
async fn a_reader_that_is_killed_is_noticed_and_may_come_again() {
    let writer = open("/writer", PortOptions::new()).await;
    for _ in 0..3 {
        let mut child = child("child_that_reads", "read");
        let output = BufReader::new(child.stdout.take().unwrap());
        let mut lines = output.lines().map_while(Result::ok);
        let number = lines.find_map(|line| line.strip_prefix("port=").map(str::to_owned));
        let contact = format!("shmem://127.0.0.1:{}/child", number.unwrap());
        within(writer.connect(&contact)).await.unwrap();
        let message = Bottle::of("x".repeat(300_000));
        for _ in 0..5 {
            assert_eq!(within(writer.write(&message)).await, 1);
        }
        child.kill().unwrap();
        child.wait().unwrap();
        let gone = async {
            while !writer.outputs().is_empty() {
                writer.write(&message).await;
            }
        };
        within(gone).await;
    }
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
