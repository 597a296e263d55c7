//! A reader that stops reading delays nobody else.

use crate::common;

use std::time::Duration;

use common::{ACK, Raw, at, bottle, connect, next, open, tcp_command, tcp_header, until, within};
use yarp_ports::{Answer, Port, PortOptions, Queue};
use yarp_wire::Bottle;
use yarp_wire::message::{ReadObject, WireObject};
use yarp_wire::typed::{Image, PixelCode};

/// Lets `name` read from `writer` over `text`, and never does.
async fn stuck_text(writer: &Port, name: &str) -> Raw {
    let before = writer.outputs().len();
    let mut stuck = Raw::text(writer, name).await;
    stuck.send("r\r\n").await;
    until(|| writer.outputs().len() > before).await;
    stuck
}

/// Lets `name` read from `writer` over `tcp`; it never reads, nor acknowledges.
async fn stuck_tcp(writer: &Port, name: &str) -> Raw {
    let before = writer.outputs().len();
    let mut stuck = Raw::tcp(writer, name).await;
    stuck.send(tcp_command(b'r')).await;
    stuck.expect(ACK).await;
    until(|| writer.outputs().len() > before).await;
    stuck
}

/// Far more than sockets and queues hold.
fn heavy(number: i32) -> Bottle {
    Bottle::from_iter([number.into(), "x".repeat(200_000).into()])
}

async fn expect_heavy(reader: &Port, number: i32) {
    let text = next(reader).await;
    assert!(text.starts_with(&format!("{number} x")), "{text:.20}");
}

/// Regression: the writer waited for room in the queue of each reader in turn, so that a full one
/// delayed the message for all later ones.
#[tokio::test]
async fn messages_reach_others_at_once() {
    let writer = open("/writer", PortOptions::new()).await;
    let _text = stuck_text(&writer, "/stuck/text").await;
    let _tcp = stuck_tcp(&writer, "/stuck/tcp").await;
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(1))).await;
    within(writer.connect(&common::at(&reader, "tcp")))
        .await
        .unwrap();
    for number in 0..100 {
        let message = heavy(number);
        tokio::select! {
            biased;
            () = expect_heavy(&reader, number) => {}
            taken = writer.write(&message) => panic!("{taken} took it, one of them cannot"),
        }
    }
}

#[tokio::test]
async fn writers_that_do_not_wait_reach_others_at_once() {
    let writer = open("/writer", PortOptions::new()).await;
    let _text = stuck_text(&writer, "/stuck/text").await;
    let _tcp = stuck_tcp(&writer, "/stuck/tcp").await;
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(1))).await;
    within(writer.connect(&common::at(&reader, "tcp")))
        .await
        .unwrap();
    for number in 0..100 {
        let message = heavy(number);
        let writing = writer.write_strict(&message, None);
        // It may still wait for room elsewhere after this reader has its message.
        let both = async {
            tokio::select! {
                () = expect_heavy(&reader, number) => {}
                () = async { writing.await; std::future::pending().await } => {}
            }
        };
        within(both).await;
    }
}

/// A peer that does not read from a port.
enum Stuck {
    Raw(Raw),
    Port(Port),
}

/// Connects a reader to `writer` that sends `said`, and never reads.
async fn stuck_after(writer: &Port, said: &[&[u8]]) -> Stuck {
    let mut raw = Raw::to(writer).await;
    for bytes in said {
        raw.send(bytes).await;
    }
    until(|| writer.outputs().len() == 1).await;
    Stuck::Raw(raw)
}

/// Connects `writer` to a port that is never read.
async fn stuck_port(writer: &Port, carrier: &str) -> Stuck {
    let stuck = open("/stuck", PortOptions::new().queue(Queue::Wait(1))).await;
    connect(writer, &stuck, carrier).await;
    Stuck::Port(stuck)
}

/// Writes the messages beside one who is stuck; another reads all of them, and the port closes.
async fn all_reach_another<T>(writer: Port, stuck: Stuck, messages: impl Iterator<Item = T>)
where
    T: WireObject + ReadObject + PartialEq + std::fmt::Debug,
{
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(1))).await;
    within(writer.connect(&at(&reader, "tcp"))).await.unwrap();
    for message in messages {
        let both = async {
            tokio::select! {
                read = reader.read() => assert_eq!(read.unwrap().read::<T>().unwrap(), message),
                () = async {
                    writer.write_strict(&message, None).await;
                    std::future::pending().await
                } => {}
            }
        };
        within(both).await;
    }
    let counters = writer.counters();
    let mut behind = counters
        .connections
        .iter()
        .filter(|to| to.peer != "/reader");
    assert!(
        behind.any(|to| to.queued > 0),
        "nobody is stuck: {counters:?}"
    );
    within(writer.close()).await;
    within(reader.close()).await;
    match stuck {
        Stuck::Raw(raw) => drop(raw),
        Stuck::Port(port) => within(port.close()).await,
    }
}

#[tokio::test]
async fn messages_reach_others_whatever_carrier_is_stuck() {
    let mut fast_header = tcp_header("/stuck");
    fast_header[2] = 0x64;
    let turn = tcp_command(b'r');
    let upgrade = b"GET /?ws HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\n\
        Connection: Upgrade\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\
        Sec-WebSocket-Version: 13\r\n\r\n";
    let turn_in_frame = [0x82, 0x88, 0, 0, 0, 0, 0, 0, 0, 0, b'~', b'r', 0, 1];
    for kind in [
        "fast_tcp",
        "websocket",
        "http",
        "unix_stream",
        "unix_stream+ack",
        "shmem",
    ] {
        println!("{kind}");
        let writer = open("/writer", PortOptions::new()).await;
        let stuck = match kind {
            "fast_tcp" => stuck_after(&writer, &[&fast_header, &turn]).await,
            "websocket" => stuck_after(&writer, &[upgrade, &turn_in_frame]).await,
            "http" => stuck_after(&writer, &[b"GET /r HTTP/1.1\r\n\r\n"]).await,
            carrier => stuck_port(&writer, carrier).await,
        };
        all_reach_another(writer, stuck, (0..100).map(heavy)).await;
    }
}

#[tokio::test]
async fn a_blocked_viewer_delays_no_other() {
    let writer = open("/writer", PortOptions::new()).await;
    let request = b"GET /?action=stream HTTP/1.1\r\nHost: localhost\r\n\r\n";
    let stuck = stuck_after(&writer, &[request]).await;
    // Incompressible data.
    let picture = |number: u32| {
        let noise = (0..640 * 480 * 3_u32).map(|at| (at.wrapping_mul(2_654_435_761) >> 13) as u8);
        let pixels: Vec<u8> = noise
            .map(|pixel| pixel.wrapping_add(number as u8))
            .collect();
        Image::from_packed(PixelCode::RGB, 640, 480, pixels).unwrap()
    };
    all_reach_another(writer, stuck, (0..60).map(picture)).await;
}

#[tokio::test]
async fn a_real_time_writer_goes_on_with_others() {
    let writer = open("/writer", PortOptions::new()).await;
    let _tcp = stuck_tcp(&writer, "/stuck").await;
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(1))).await;
    within(writer.connect(&common::at(&reader, "tcp")))
        .await
        .unwrap();
    assert_eq!(writer.write_if_idle(&heavy(0), None), 2);
    expect_heavy(&reader, 0).await;
    for number in 1..50 {
        let sent = async {
            while writer.write_if_idle(&heavy(number), None) == 0 {
                tokio::task::yield_now().await;
            }
        };
        within(sent).await;
        expect_heavy(&reader, number).await;
    }
}

#[tokio::test]
async fn a_blocked_reader_is_skipped_above_the_backlog() {
    let writer = open("/writer", PortOptions::new()).await;
    let _text = stuck_text(&writer, "/stuck").await;
    for number in 0..4 {
        assert_eq!(writer.try_write(&heavy(number), None, 3), 1);
    }
    // Messages in the socket buffers do not count as pending.
    let filling = async {
        while writer.try_write(&heavy(4), None, 3) == 1 {
            tokio::task::yield_now().await;
        }
    };
    within(filling).await;
}

#[tokio::test]
async fn inputs_and_requests_are_served_meanwhile() {
    let answering = PortOptions::new().handler(|_| Answer::reply(Bottle::of("ok")));
    let busy = open("/busy", answering).await;
    let _stuck = stuck_tcp(&busy, "/stuck").await;
    for number in 0..20 {
        busy.write_if_idle(&heavy(number), None);
    }
    let client = open("/client", PortOptions::new().rpc_client()).await;
    connect(&client, &busy, "tcp").await;
    for _ in 0..20 {
        let answer: Bottle = within(client.call(&bottle("?"))).await.unwrap();
        assert_eq!(answer.to_string(), "ok");
    }
}

#[tokio::test]
async fn a_slow_handler_holds_only_its_own_connection() {
    let (release, released) = tokio::sync::watch::channel(false);
    let server = PortOptions::new().handler(move |request| {
        let slow = &*request.from == "/slow";
        let mut released = released.clone();
        Answer::Later(Box::pin(async move {
            if slow {
                released.wait_for(|go| *go).await.unwrap();
            }
            Answer::reply(Bottle::of("ok"))
        }))
    });
    let server = open("/server", server).await;
    let slow = open("/slow", PortOptions::new().rpc_client()).await;
    let quick = open("/quick", PortOptions::new().rpc_client()).await;
    connect(&slow, &server, "tcp").await;
    connect(&quick, &server, "tcp").await;
    let slow_call = tokio::spawn(async move { slow.call::<Bottle>(&bottle("x")).await });
    for _ in 0..50 {
        within(quick.call::<Bottle>(&bottle("y"))).await.unwrap();
    }
    assert!(!slow_call.is_finished());
    release.send_replace(true);
    assert!(within(slow_call).await.unwrap().is_ok());
}

#[tokio::test]
async fn a_call_that_is_never_answered_ends_at_its_deadline() {
    let server = PortOptions::new().handler(|_| Answer::Later(Box::pin(std::future::pending())));
    let server = open("/server", server).await;
    let client = open("/client", PortOptions::new().rpc_client()).await;
    connect(&client, &server, "tcp").await;
    let request = bottle("x");
    let call = client.call_within::<Bottle>(&request, Duration::from_millis(20));
    let error = within(call).await.unwrap_err();
    assert!(
        matches!(error, yarp_ports::PortError::Timeout { step: "reply", .. }),
        "{error}"
    );
}

/// Bytes that a reader which never reads is sent in messages of `length` before `try_write` skips it.
async fn taken_before_skipped(options: PortOptions, length: usize) -> usize {
    let writer = open("/writer", options).await;
    let _stuck = stuck_text(&writer, "/stuck").await;
    let message = Bottle::of("x".repeat(length));
    let (mut taken, mut skipped) = (0, 0);
    // The task of the connection may still be sending after a message was skipped.
    while skipped < 100 {
        match writer.try_write(&message, None, 2) {
            0 => skipped += 1,
            _ => (taken, skipped) = (taken + length, 0),
        }
        tokio::task::yield_now().await;
    }
    taken
}

/// Regression: the system held megabytes for a reader that took none of them, which for a small
/// stream are minutes, before the port saw that it was behind.
#[tokio::test]
#[cfg(target_os = "linux")]
async fn unsent_bytes_are_limited() {
    let limited = taken_before_skipped(PortOptions::new().max_unsent(10_000), 5_000).await;
    // The buffer of the reader, the limit, and what waits in the queue.
    assert!(limited < 400_000, "{limited}");
    let default = taken_before_skipped(PortOptions::new(), 5_000).await;
    assert!(
        default > 2 * limited,
        "{default} without a limit, {limited} with one"
    );
}
