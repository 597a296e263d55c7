//! Memory that peers can make a process hold is bounded: properties, incomplete and expanded messages.

mod common;

use std::sync::{LazyLock, Mutex, MutexGuard, PoisonError};

use common::{Raw, ask, at, bottle, connect, next, open, tcp_message, until, within};
use yarp_ports::port_limits::{MAX_PROPERTIES, MAX_PROPERTY_BYTES, ProcessLimits};
use yarp_ports::{PortOptions, Queue};
use yarp_wire::Bottle;
use yarp_wire::typed::{Image, PixelCode};

/// The limits are those of the process: one test at a time.
fn alone() -> MutexGuard<'static, ()> {
    static ALONE: LazyLock<Mutex<()>> = LazyLock::new(Mutex::default);
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

fn property(key: &str, text: &str) -> Bottle {
    let mut request = bottle("[prop] [set]");
    request.extend([key.into(), text.into()]);
    request
}

#[tokio::test]
async fn properties_have_a_size_in_all() {
    let port = open("/p", PortOptions::new()).await;
    let half = "x".repeat(MAX_PROPERTY_BYTES / 2);
    assert_eq!(ask(&port, &property("a", &half)).await, "[ok]");
    let answer = ask(&port, &property("b", &half)).await;
    assert!(answer.contains("too large"), "{answer}");
    // In place of what was there, and small ones beside it.
    assert_eq!(ask(&port, &property("a", &half)).await, "[ok]");
    assert_eq!(ask(&port, &property("b", "1 2")).await, "[ok]");
    assert_eq!(ask(&port, &bottle("[prop] [get] b")).await, "\"1 2\"");
    let large = ask(&port, &property("c", &"x".repeat(10 * half.len()))).await;
    assert!(large.contains("too large"), "{large}");
    within(port.close()).await;
}

#[tokio::test]
async fn properties_are_counted() {
    let port = open("/p", PortOptions::new()).await;
    assert_eq!(MAX_PROPERTIES, 1024, "docs/limits.md");
    for number in 0..MAX_PROPERTIES {
        let answer = ask(&port, &property(&number.to_string(), "")).await;
        assert_eq!(answer, "[ok]", "{number}");
    }
    let answer = ask(&port, &property("one more", "")).await;
    assert!(answer.contains("too many properties"), "{answer}");
    assert_eq!(
        ask(&port, &property("7", "x")).await,
        "[ok]",
        "in its place"
    );
    within(port.close()).await;
}

#[tokio::test]
#[expect(
    clippy::await_holding_lock,
    reason = "each test has a runtime of its own"
)]
async fn incomplete_messages_share_a_budget() {
    let _alone = alone();
    ProcessLimits::default()
        .with_incoming_bytes(8 << 20)
        .apply();
    let reader = open("/r", PortOptions::new().queue(Queue::Wait(10))).await;
    let message = tcp_message(b'd', &Bottle::of("x".repeat(6 << 20)));
    let (beginning, rest) = message.split_at(message.len() - 100);
    let mut first = Raw::tcp(&reader, "/first").await;
    first.send(beginning).await;
    // There is nothing to see of what has arrived, but the others are turned away from then on.
    let mut small = Raw::tcp(&reader, "/small").await;
    let turned_away = async {
        loop {
            let mut second = Raw::tcp(&reader, "/second").await;
            second.try_send(&message[..6 << 20]).await;
            if second.was_reset() {
                return;
            }
        }
    };
    within(turned_away).await;
    small.send(tcp_message(b'd', &bottle("hello"))).await;
    assert_eq!(next(&reader).await, "hello");
    first.send(rest).await;
    assert!(next(&reader).await.starts_with("xxx"));
    // What is complete is no part of it any more.
    let mut third = Raw::tcp(&reader, "/third").await;
    third.send(&message).await;
    assert!(next(&reader).await.starts_with("xxx"));
    ProcessLimits::default().apply();
    within(reader.close()).await;
}

const ZLIB: &str = "tcp+send.portmonitor+recv.portmonitor+type.dll+file.bottle_compression_zlib";

#[tokio::test]
#[expect(
    clippy::await_holding_lock,
    reason = "each test has a runtime of its own"
)]
async fn expanded_messages_share_a_budget_until_they_are_dropped() {
    let _alone = alone();
    ProcessLimits::default()
        .with_expanded_bytes(1 << 20)
        .apply();
    let reader = open("/r", PortOptions::new().queue(Queue::Wait(10))).await;
    let writer = open("/w", PortOptions::new()).await;
    within(writer.connect(&at(&reader, ZLIB))).await.unwrap();
    let large = |letter: &str| Bottle::of(letter.repeat(600 << 10));
    assert_eq!(writer.write(&large("a")).await, 1);
    let kept = within(reader.read()).await.unwrap();
    // Stopped: the first is still there.
    assert_eq!(writer.write(&large("b")).await, 1);
    assert_eq!(writer.write(&bottle("small")).await, 1);
    assert_eq!(next(&reader).await, "small");
    drop(kept);
    assert_eq!(writer.write(&large("c")).await, 1);
    assert!(next(&reader).await.starts_with("ccc"));
    // One message that is too large alone.
    assert_eq!(writer.write(&Bottle::of("d".repeat(2 << 20))).await, 1);
    assert_eq!(writer.write(&bottle("small")).await, 1);
    assert_eq!(next(&reader).await, "small");
    ProcessLimits::default().apply();
    within(writer.close()).await;
    within(reader.close()).await;
}

/// Pictures that a camera sends expand as much.
#[tokio::test]
#[expect(
    clippy::await_holding_lock,
    reason = "each test has a runtime of its own"
)]
async fn images_share_the_budget_while_they_are_decoded() {
    let _alone = alone();
    ProcessLimits::default()
        .with_expanded_bytes(1 << 20)
        .apply();
    let camera = open("/camera", PortOptions::new()).await;
    let reader = open("/r", PortOptions::new().queue(Queue::Wait(10))).await;
    within(reader.connect(&at(&camera, "mjpeg"))).await.unwrap();
    until(|| camera.outputs() == ["null"]).await;
    // 1.4 MB of pixels in some kilobytes, and 0.9 MB.
    for (width, height) in [(800, 600), (640, 480)] {
        let image = Image::new(PixelCode::RGB, width, height).unwrap();
        assert_eq!(within(camera.write(&image)).await, 1);
        within(camera.flush()).await;
    }
    let received: Image = within(reader.read()).await.unwrap().read().unwrap();
    assert_eq!((received.width(), received.height()), (640, 480));
    ProcessLimits::default().apply();
    within(reader.close()).await;
    within(camera.close()).await;
}

#[tokio::test]
async fn a_connection_expands_once() {
    let reader = open("/r", PortOptions::new().queue(Queue::Wait(10))).await;
    let writer = open("/w", PortOptions::new()).await;
    let twice = "tcp+recv.portmonitor+type.dll+file.bottle_compression_zlib\
        +type1.dll+file1.bottle_compression_zlib";
    let refused = within(writer.connect(&at(&reader, twice))).await;
    assert!(refused.is_err());
    until(|| reader.inputs().is_empty()).await;
    connect(&writer, &reader, "tcp").await;
    within(writer.close()).await;
    within(reader.close()).await;
}
