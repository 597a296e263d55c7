//! Messages and replies travel over every carrier, in order and whole.

use crate::common;

use common::{at, bottle, connect, next, open, within};
use yarp_ports::{Answer, PortOptions, Queue};
use yarp_wire::{Bottle, Stamp, Value};

const STREAMS: [&str; 8] = [
    "tcp",
    "fast_tcp",
    "text",
    "text_ack",
    "local",
    "unix_stream",
    "unix_stream+ack",
    "shmem",
];

/// Every kind of value, and what is hard to carry in text.
fn hard() -> Bottle {
    let mut hard =
        bottle(r#"1 -2.5 "a b" [vocb] (nested (list 7) ()) {1 2 255} true "" 4294967296"#);
    hard.push("line\r\nend \\ \" ( \0");
    hard.push("x".repeat(100_000));
    hard
}

#[tokio::test]
async fn messages_arrive_in_order() {
    for carrier in STREAMS {
        let reader = open("/reader", PortOptions::new().queue(Queue::Wait(10))).await;
        let writer = open("/writer", PortOptions::new()).await;
        connect(&writer, &reader, carrier).await;
        let writing = async {
            for number in 0..500 {
                assert_eq!(writer.write(&Bottle::of(number)).await, 1);
            }
            writer.write(&hard()).await
        };
        let reading = async {
            for number in 0..500 {
                assert_eq!(next(&reader).await, number.to_string(), "{carrier}");
            }
            reader.read().await.unwrap()
        };
        let (taken, last) = within(async { tokio::join!(writing, reading) }).await;
        assert_eq!((taken, &*last.from), (1, "/writer"), "{carrier}");
        assert!(!last.wants_reply);
        assert_eq!(last.bottle().unwrap(), hard(), "{carrier}");
        within(writer.close()).await;
        within(reader.close()).await;
    }
}

#[tokio::test]
async fn envelopes_travel_with_their_message() {
    for carrier in STREAMS {
        let reader = open("/reader", PortOptions::new().queue(Queue::Wait(10))).await;
        let writer = open("/writer", PortOptions::new()).await;
        connect(&writer, &reader, carrier).await;
        let stamp = Stamp::new(7, 1_700_000_000.123_46);
        for envelope in [Some(stamp), None, Some(stamp.next(2.5))] {
            let message = bottle("x");
            let writing = writer.write_with(&message, envelope.map(Into::into));
            let (_, read) = within(async { tokio::join!(writing, reader.read()) }).await;
            assert_eq!(read.unwrap().stamp(), envelope, "{carrier}");
        }
    }
}

#[tokio::test]
async fn requests_are_answered() {
    for carrier in STREAMS {
        let server = PortOptions::new().handler(|request| {
            let mut answer = bottle("re");
            answer.extend(request.bottle().unwrap());
            match request.wants_reply {
                true => Answer::reply(answer),
                false => Answer::Nothing,
            }
        });
        let server = open("/server", server).await;
        let client = open("/client", PortOptions::new().rpc_client()).await;
        connect(&client, &server, carrier).await;
        for number in 0..100 {
            let answer: Bottle = within(client.call(&Bottle::of(number))).await.unwrap();
            assert_eq!(answer.to_string(), format!("re {number}"), "{carrier}");
        }
        let answer: Bottle = within(client.call(&hard())).await.unwrap();
        let expected: Bottle = [Value::from("re")].into_iter().chain(hard()).collect();
        assert_eq!(answer, expected, "{carrier}");
    }
}

#[tokio::test]
async fn requests_are_answered_from_a_queue() {
    for carrier in STREAMS {
        let server = open("/server", PortOptions::new().rpc_server()).await;
        let client = open("/client", PortOptions::new().rpc_client()).await;
        connect(&client, &server, carrier).await;
        let serving = async {
            for _ in 0..50 {
                let mut request = server.read().await.unwrap();
                assert!(request.wants_reply);
                let answer = request.bottle().unwrap().with("ok");
                request.reply(answer);
            }
        };
        let calling = async {
            for number in 0..50 {
                let answer: Bottle = client.call(&Bottle::of(number)).await.unwrap();
                assert_eq!(answer.to_string(), format!("{number} ok"), "{carrier}");
            }
        };
        within(async { tokio::join!(serving, calling) }).await;
    }
}

/// Lines for the name server have no sender name and no envelope, and may all be answered.
#[tokio::test]
async fn lines_of_the_name_server_are_messages_too() {
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(10))).await;
    let writer = open("/writer", PortOptions::new()).await;
    connect(&writer, &reader, "name_ser").await;
    for number in 0..100 {
        assert_eq!(writer.write(&Bottle::of(number)).await, 1);
        assert_eq!(next(&reader).await, number.to_string());
    }
    assert_eq!(writer.write(&hard()).await, 1);
    let last = within(reader.read()).await.unwrap();
    assert_eq!((&*last.from, last.bottle().unwrap()), ("anon", hard()));

    let server = PortOptions::new()
        .handler(|request| Answer::reply(bottle("re").with(request.bottle().unwrap().to_string())));
    let server = open("/server", server).await;
    let client = open("/client", PortOptions::new().rpc_client()).await;
    connect(&client, &server, "name_ser").await;
    for number in 0..100 {
        let answer: Bottle = within(client.call(&Bottle::of(number))).await.unwrap();
        assert_eq!(answer, bottle("re").with(number.to_string()));
    }
}

/// A request that the owner does not answer must not block the caller forever.
#[tokio::test]
async fn an_owner_that_does_not_answer_gives_an_empty_reply() {
    for carrier in ["tcp", "fast_tcp", "text_ack"] {
        let reader = open("/reader", PortOptions::new().queue(Queue::Latest)).await;
        let client = open("/client", PortOptions::new().rpc_client()).await;
        connect(&client, &reader, carrier).await;
        let answer: Bottle = within(client.call(&bottle("hello"))).await.unwrap();
        assert_eq!(answer, Bottle::new(), "{carrier}");
        assert_eq!(next(&reader).await, "hello", "{carrier}");
    }
}

#[tokio::test]
async fn one_message_reaches_readers_of_every_carrier() {
    let writer = open("/writer", PortOptions::new()).await;
    let mut readers = Vec::new();
    for carrier in STREAMS {
        let options = PortOptions::new().queue(Queue::Wait(10));
        let reader = open(&format!("/reader/{carrier}"), options).await;
        within(writer.connect(&at(&reader, carrier))).await.unwrap();
        readers.push(reader);
    }
    assert_eq!(within(writer.write(&hard())).await, STREAMS.len());
    for reader in &readers {
        assert_eq!(
            within(reader.read()).await.unwrap().bottle().unwrap(),
            hard()
        );
    }
    assert!(within(writer.disconnect("/reader/text")).await);
    assert!(!within(writer.disconnect("/reader/text")).await);
    assert_eq!(within(writer.write(&bottle("x"))).await, STREAMS.len() - 1);
}
