//! Queue policies: messages kept, dropped or delayed when they arrive faster than they are read.

use crate::common;

use std::sync::mpsc;
use std::thread;

use common::{DEADLINE, bottle, connect, next, open, until, within};
use tokio::runtime::Builder;
use tokio::sync::oneshot;
use yarp_ports::{Answer, Port, PortOptions, Queue};
use yarp_wire::Bottle;

async fn pair(queue: Queue, carrier: &str) -> (Port, Port) {
    let reader = open("/reader", PortOptions::new().queue(queue)).await;
    let writer = open("/writer", PortOptions::new()).await;
    connect(&writer, &reader, carrier).await;
    (reader, writer)
}

async fn write_ten(writer: &Port) {
    for number in 0..10 {
        assert_eq!(within(writer.write(&Bottle::of(number))).await, 1);
    }
}

#[tokio::test]
async fn latest_keeps_the_newest() {
    for carrier in ["tcp", "text_ack"] {
        let (reader, writer) = pair(Queue::Latest, carrier).await;
        write_ten(&writer).await;
        assert_eq!(next(&reader).await, "9", "{carrier}");
        assert!(reader.try_read().is_none());
        assert_eq!(reader.dropped(), 9, "{carrier}");
    }
}

#[tokio::test]
async fn latest_without_acknowledgements_keeps_the_newest() {
    for carrier in ["fast_tcp", "text"] {
        let (reader, writer) = pair(Queue::Latest, carrier).await;
        write_ten(&writer).await;
        until(|| reader.dropped() == 9).await;
        assert_eq!(next(&reader).await, "9", "{carrier}");
    }
}

#[tokio::test]
async fn drop_oldest_keeps_the_last() {
    let (reader, writer) = pair(Queue::DropOldest(3), "tcp").await;
    write_ten(&writer).await;
    for expected in ["7", "8", "9"] {
        assert_eq!(next(&reader).await, expected);
    }
    assert_eq!(reader.dropped(), 7);
}

#[tokio::test]
async fn drop_newest_keeps_the_first() {
    let (reader, writer) = pair(Queue::DropNewest(3), "tcp").await;
    write_ten(&writer).await;
    for expected in ["0", "1", "2"] {
        assert_eq!(next(&reader).await, expected);
    }
    assert_eq!(reader.dropped(), 7);
}

#[tokio::test]
async fn strict_keeps_all_without_blocking() {
    for carrier in ["tcp", "fast_tcp", "text_ack"] {
        let (reader, writer) = pair(Queue::Strict, carrier).await;
        for number in 0..3000 {
            assert_eq!(within(writer.write(&Bottle::of(number))).await, 1);
        }
        for number in 0..3000 {
            assert_eq!(next(&reader).await, number.to_string(), "{carrier}");
        }
        assert_eq!(reader.dropped(), 0);
    }
}

#[tokio::test]
async fn strict_blocks_its_writer_at_the_byte_limit() {
    let (reader, writer) = pair(Queue::Strict, "tcp").await;
    let message = Bottle::of("x".repeat(8 << 20));
    for _ in 0..7 {
        assert_eq!(within(writer.write(&message)).await, 1);
    }
    let eighth = writer.write(&message);
    tokio::pin!(eighth);
    // The whole of it arrives; without room it is not taken, nor dropped, however the two are scheduled.
    tokio::select! {
        biased;
        _ = &mut eighth => panic!("taken without room"),
        () = until(|| reader.counters().received.messages == 8) => {}
    }
    assert_eq!((reader.counters().waiting, reader.dropped()), (7, 0));
    assert_eq!(
        within(reader.read()).await.unwrap().payload.len(),
        message.encode(yarp_wire::WireVersion::V3).len()
    );
    assert_eq!(within(eighth).await, 1);
    for _ in 0..7 {
        within(reader.read()).await.unwrap();
    }
    // One that is larger than all that may wait comes alone.
    let large = Bottle::of("x".repeat(65 << 20));
    assert_eq!(within(writer.write(&large)).await, 1);
    assert_eq!(
        within(reader.read()).await.unwrap().bottle().unwrap(),
        large
    );
    assert_eq!(reader.dropped(), 0);
}

#[tokio::test]
async fn a_full_queue_blocks_its_writer() {
    for carrier in ["tcp", "text_ack"] {
        let (reader, writer) = pair(Queue::Wait(2), carrier).await;
        for number in 0..2 {
            assert_eq!(within(writer.write(&Bottle::of(number))).await, 1);
        }
        let third = Bottle::of(2);
        let third = writer.write(&third);
        tokio::pin!(third);
        // Not taken before there is room, however the two are scheduled.
        tokio::select! {
            biased;
            _ = &mut third => panic!("{carrier}: taken without room"),
            first = next(&reader) => assert_eq!(first, "0"),
        }
        assert_eq!(within(third).await, 1);
        assert_eq!(next(&reader).await, "1");
        assert_eq!(next(&reader).await, "2");
        assert_eq!(reader.dropped(), 0);
    }
}

#[tokio::test]
async fn a_full_queue_loses_nothing_of_a_writer_that_does_not_wait() {
    for carrier in ["tcp", "fast_tcp", "text", "text_ack"] {
        let (reader, writer) = pair(Queue::Wait(1), carrier).await;
        for number in 0..200 {
            let message = bottle("data").with(number).with("x".repeat(500));
            assert_eq!(within(writer.write_strict(&message, None)).await, 1);
        }
        for number in 0..200 {
            let text = next(&reader).await;
            assert!(
                text.starts_with(&format!("data {number} ")),
                "{carrier} {text:.20}"
            );
        }
        within(writer.flush()).await;
        assert!(reader.try_read().is_none());
    }
}

#[tokio::test]
async fn a_reader_that_is_a_little_behind_misses_nothing() {
    let (reader, writer) = pair(Queue::Wait(1), "tcp").await;
    assert_eq!(within(writer.write(&bottle("0"))).await, 1);
    // The reader has room for none of these yet.
    for text in ["1", "2", "3"] {
        assert_eq!(writer.try_write(&bottle(text), None, 2), 1);
    }
    assert_eq!(writer.try_write(&bottle("4"), None, 2), 0);
    for text in ["0", "1", "2", "3"] {
        assert_eq!(next(&reader).await, text);
    }
    within(writer.flush()).await;
    assert_eq!(writer.try_write(&bottle("5"), None, 2), 1);
    assert_eq!(next(&reader).await, "5");
}

#[tokio::test]
async fn periodic_messages_are_sent_by_the_calling_thread() {
    let (told, taken) = mpsc::channel();
    let (close, closed) = oneshot::channel::<()>();
    let elsewhere = thread::spawn(move || {
        let runtime = Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(async {
            let messages = told.clone();
            let note = PortOptions::new().handler(move |message| {
                let text = message.bottle().unwrap().to_string();
                messages.send(text).unwrap();
                Answer::Nothing
            });
            let reader = open("/reader", note).await;
            told.send(reader.tcp_port().to_string()).unwrap();
            within(closed).await.unwrap();
        });
    });
    let number = taken.recv_timeout(DEADLINE).unwrap();
    for carrier in ["tcp", "fast_tcp", "text", "unix_stream", "shmem"] {
        let writer = open("/writer", PortOptions::new()).await;
        let reader = format!("{carrier}://127.0.0.1:{number}/reader");
        within(writer.connect(&reader)).await.unwrap();
        assert_eq!(within(writer.write(&bottle("first"))).await, 1);
        within(writer.flush()).await;
        assert_eq!(taken.recv_timeout(DEADLINE).unwrap(), "first");
        assert_eq!(writer.write_if_idle(&bottle(carrier), None), 1);
        // No task of the writer can run: this is the thread of them all.
        let text = taken.recv_timeout(DEADLINE);
        assert_eq!(text.as_deref(), Ok(carrier));
    }
    close.send(()).unwrap();
    elsewhere.join().unwrap();
}

#[tokio::test]
async fn a_busy_reader_is_skipped_on_request() {
    let (reader, writer) = pair(Queue::Wait(1), "tcp").await;
    assert_eq!(within(writer.write(&bottle("0"))).await, 1);
    assert_eq!(writer.write_if_idle(&bottle("1"), None), 1);
    // The reader has no room for it yet.
    assert_eq!(writer.write_if_idle(&bottle("2"), None), 0);
    assert_eq!(next(&reader).await, "0");
    assert_eq!(next(&reader).await, "1");
    within(writer.flush()).await;
    assert_eq!(writer.write_if_idle(&bottle("3"), None), 1);
    assert_eq!(next(&reader).await, "3");
}

#[tokio::test]
async fn writers_share_a_queue_and_keep_their_own_order() {
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(4))).await;
    let mut writing = tokio::task::JoinSet::new();
    for writer in 0..4 {
        let port = open(&format!("/writer/{writer}"), PortOptions::new()).await;
        connect(
            &port,
            &reader,
            ["tcp", "fast_tcp", "text", "text_ack"][writer as usize],
        )
        .await;
        writing.spawn(async move {
            for number in 0..100 {
                port.write(&Bottle::from_iter([writer.into(), number.into()]))
                    .await;
            }
            port.flush().await;
            port.close().await;
        });
    }
    let mut expected = [0; 4];
    for _ in 0..400 {
        let message = within(reader.read()).await.unwrap().bottle().unwrap();
        let field = |index| {
            message
                .get(index)
                .and_then(|value: &yarp_wire::Value| value.as_i32())
        };
        let (writer, number) = (field(0).unwrap() as usize, field(1).unwrap());
        assert_eq!(number, expected[writer], "writer {writer}");
        expected[writer] += 1;
    }
    within(writing.join_all()).await;
}
