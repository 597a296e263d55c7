//! Memory that peers can make a process hold is bounded: properties, incomplete and expanded messages.

mod common;

use std::sync::atomic::AtomicUsize;
use std::sync::atomic::Ordering::SeqCst;
use std::sync::{Arc, LazyLock, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use common::{DEADLINE, Raw, ask, at, bottle, connect, next, open, tcp_message, until, within};
use yarp_ports::port_limits::{MAX_PROPERTIES, MAX_PROPERTY_BYTES, ProcessLimits};
use yarp_ports::{Answer, PortOptions, Queue};
use yarp_wire::bottle::DecodeError;
use yarp_wire::typed::{Image, PixelCode, Property};
use yarp_wire::{Bottle, Value};

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

/// Values of two bytes each take twenty times as much in memory.
#[tokio::test(flavor = "multi_thread")]
#[expect(
    clippy::await_holding_lock,
    reason = "each test has a runtime of its own"
)]
async fn values_of_large_messages_share_a_budget_until_the_messages_are_dropped() {
    let _alone = alone();
    ProcessLimits::default().with_parsed_bytes(6 << 20).apply();
    let reader = open("/r", PortOptions::new().queue(Queue::Wait(10))).await;
    let writer = open("/w", PortOptions::new()).await;
    let numbers = |count: i32| Bottle::from_iter((0..count).map(|number| Value::from(number % 9)));
    // 100 000 values take 4 MB: one such message is read at a time, of text, of binary, and as any object.
    for carrier in ["tcp", "text"] {
        let connected = within(writer.connect(&at(&reader, carrier))).await;
        connected.unwrap();
        for _ in 0..4 {
            assert_eq!(writer.write(&numbers(100_000)).await, 1);
        }
        let first = within(reader.read()).await.unwrap();
        assert_eq!(first.bottle().map(|values| values.len()), Ok(100_000));
        let second = within(reader.read()).await.unwrap();
        let refused = |bytes: usize| (4_000_000..4_001_000).contains(&bytes);
        let error = second.bottle().unwrap_err();
        assert!(
            matches!(error, DecodeError::NoMemory { bytes } if refused(bytes)),
            "{error}"
        );
        let error = second.read::<Property>().unwrap_err();
        assert!(
            matches!(error, DecodeError::NoMemory { bytes } if refused(bytes)),
            "{error}"
        );
        // Small ones do not count, nor do blobs.
        let third = within(reader.read()).await.unwrap();
        drop(first);
        assert_eq!(third.bottle().map(|values| values.len()), Ok(100_000));
        drop((second, third));
        let fourth = within(reader.read()).await.unwrap();
        assert_eq!(
            fourth.read::<Bottle>().map(|values| values.len()),
            Ok(100_000)
        );
        assert_eq!(writer.write(&bottle("small")).await, 1);
        assert_eq!(next(&reader).await, "small");
        assert_eq!(writer.write(&Bottle::of("x".repeat(7 << 19))).await, 1);
        assert!(next(&reader).await.starts_with("xxx"));
        drop(fourth);
        // More than all.
        assert_eq!(writer.write(&numbers(160_000)).await, 1);
        let large = within(reader.read()).await.unwrap();
        assert!(matches!(large.bottle(), Err(DecodeError::NoMemory { .. })));
        within(writer.disconnect(&at(&reader, carrier))).await;
    }
    ProcessLimits::default().apply();
    within(writer.close()).await;
    within(reader.close()).await;
}

/// A hundred who sent large messages at a time made a hundred threads work, and others wait.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn large_messages_are_handled_in_turn_and_small_ones_meanwhile() {
    let half = std::thread::available_parallelism().map_or(1, |all| (all.get() / 2).max(1));
    let counts: Arc<[AtomicUsize; 4]> = Arc::default();
    let shared = counts.clone();
    let options = PortOptions::new().handler(move |message| {
        let [running, most, large, small] = &*shared;
        if message.payload.len() < 1000 {
            small.fetch_add(1, SeqCst);
            return Answer::Nothing;
        }
        most.fetch_max(running.fetch_add(1, SeqCst) + 1, SeqCst);
        // Until a small one was handled, which others do.
        let begun = Instant::now();
        while small.load(SeqCst) <= large.load(SeqCst) && begun.elapsed() < DEADLINE {
            std::thread::sleep(Duration::from_millis(1));
        }
        running.fetch_sub(1, SeqCst);
        large.fetch_add(1, SeqCst);
        Answer::Nothing
    });
    let port = open("/r", options).await;
    let writers = half + 3;
    let mut open_connections = Vec::new();
    for number in 0..writers {
        // As text, and as values of a byte each.
        if number % 2 == 0 {
            let mut raw = Raw::text(&port, &format!("/text{number}")).await;
            raw.send(format!("d\r\n{}\r\n", "a ".repeat(50_000))).await;
            open_connections.push(raw);
        } else {
            let mut raw = Raw::tcp(&port, &format!("/tcp{number}")).await;
            let values = (0..70_000).map(|_| Value::from(1_i8)).collect();
            raw.send(tcp_message(b'd', &values)).await;
            open_connections.push(raw);
        }
    }
    let mut small = Raw::text(&port, "/small").await;
    let [_, most, large, _] = &*counts;
    let sending = async {
        while large.load(SeqCst) < writers {
            small.send("d\r\nhello\r\n").await;
            tokio::time::sleep(Duration::from_millis(2)).await;
        }
    };
    within(sending).await;
    let most = most.load(SeqCst);
    assert!(
        (1..=half).contains(&most),
        "{most} at a time, {half} allowed"
    );
    within(port.close()).await;
}

/// Forms of many values were parsed whatever they took.
#[tokio::test(flavor = "multi_thread")]
#[expect(
    clippy::await_holding_lock,
    reason = "each test has a runtime of its own"
)]
async fn a_form_of_too_many_values_is_refused() {
    let _alone = alone();
    let options = PortOptions::new().handler(|message| {
        let values = message.bottle().map_or(0, |bottle| bottle.len());
        Answer::reply(Bottle::of(i32::try_from(values).unwrap()))
    });
    let port = open("/r", options).await;
    let post = async |values: usize| {
        let form = format!("req={}", "a+".repeat(values));
        let head = "POST /form HTTP/1.1\r\nContent-Type: application/x-www-form-urlencoded\r\n";
        let request = format!("{head}Content-Length: {}\r\n\r\n{form}", form.len());
        let mut raw = Raw::to(&port).await;
        raw.send(request).await;
        String::from_utf8(raw.ended().await).unwrap()
    };
    // With the fields that stock appends.
    assert!(post(100_000).await.contains("100003"));
    let large = post(1_000_000).await;
    assert!(large.starts_with("HTTP/1.1 413 "), "{large}");
    ProcessLimits::default().with_parsed_bytes(1 << 20).apply();
    let busy = post(100_000).await;
    assert!(busy.starts_with("HTTP/1.1 503 "), "{busy}");
    assert!(post(10_000).await.contains("10003"));
    ProcessLimits::default().apply();
    within(port.close()).await;
}

/// Requests to the port itself are parsed, too.
#[tokio::test]
#[expect(
    clippy::await_holding_lock,
    reason = "each test has a runtime of its own"
)]
async fn administrative_requests_count_against_the_budget() {
    let _alone = alone();
    let port = open("/p", PortOptions::new()).await;
    let values = |count: usize| {
        let mut request = bottle("[prop] [set] k");
        request.push((0..count).map(|_| Value::from(1)).collect::<Bottle>());
        request
    };
    let large = ask(&port, &values(40_000)).await;
    assert!(large.contains("too large"), "{large}");
    ProcessLimits::default().with_parsed_bytes(1 << 20).apply();
    let refused = ask(&port, &values(40_000)).await;
    assert!(
        !refused.contains("too large") && !refused.contains("[ok]"),
        "{refused}"
    );
    assert_eq!(ask(&port, &values(100)).await, "[ok]");
    ProcessLimits::default().apply();
    within(port.close()).await;
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

/// Each of many connections had a whole reply, as large as it may be, in memory until it was read.
#[tokio::test(flavor = "multi_thread")]
#[expect(
    clippy::await_holding_lock,
    reason = "each test has a runtime of its own"
)]
async fn replies_that_are_not_read_share_a_budget() {
    const REPLY: usize = 24 << 20;
    let _alone = alone();
    ProcessLimits::default().with_unsent_bytes(1 << 20).apply();
    let options = PortOptions::new().handler(|_| Answer::reply(Bottle::of("x".repeat(REPLY))));
    let port = open("/port", options).await;
    // More than the budget, and nothing else is unsent.
    let mut first = Raw::text(&port, "first").await;
    first.send("d\r\n1\r\n").await;
    first.expect("x").await;
    // There is no room beside it.
    let mut second = Raw::text(&port, "second").await;
    second.send("d\r\n1\r\n").await;
    let got = second.ended().await.len();
    assert!(got < REPLY, "{got}");
    let rest = [&b"x".repeat(REPLY - 1)[..], b"\r\n"].concat();
    first.expect(&rest).await;
    // Then there is again.
    let mut third = Raw::text(&port, "third").await;
    third.send("d\r\n1\r\n").await;
    third.expect("x").await;
    third.expect(&rest).await;
    ProcessLimits::default().apply();
    within(port.close()).await;
}
