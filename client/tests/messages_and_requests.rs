//! Publishers, subscribers, RPC clients and servers, blocking and asynchronous.

mod support;

use std::sync::mpsc;
use std::time::Duration;

use support::{TIMEOUT, eventually, name_server, registered};
use yarp_client::asynchronous;
use yarp_client::prelude::*;

/// A message with fields of several types.
#[derive(Clone, Debug, Message, PartialEq)]
struct Detection {
    class: String,
    position: Vec<f64>,
    certain: bool,
}

fn detection() -> Detection {
    Detection {
        class: "glass".into(),
        position: vec![0.5, -0.25, 0.0],
        certain: true,
    }
}

#[test]
fn a_subscriber_receives_what_is_published() {
    let (names, network) = name_server();
    let talker = Publisher::<Bottle>::open_on(&network, "/talker").unwrap();
    let listener = Subscriber::<Bottle>::open_on(&network, "/listener", Queue::Strict).unwrap();
    assert_eq!(talker.publish(&bottle!["lost"]), 0);
    listener.connect("/talker").unwrap();
    eventually("the reader is connected", || {
        talker.readers() == ["/listener"]
    });
    let stamp = Stamp::new(7, 12.5);
    assert_eq!(
        talker.publish_stamped(&bottle!["hello", [1, 2.5]], stamp),
        1
    );
    let received = listener
        .receive_timeout(TIMEOUT)
        .unwrap()
        .expect("it arrives");
    assert_eq!(received.value.to_string(), "hello (1 2.5)");
    assert_eq!(received.stamp, Some(stamp));
    assert_eq!(&*received.from, "/talker");
    assert_eq!(talker.publish_reliably(bottle!["second"], TIMEOUT), 1);
    let second = listener.iter().next().expect("the port is open").unwrap();
    assert_eq!(second.to_string(), "second");
    let none = listener.receive_timeout(Duration::from_millis(1)).unwrap();
    assert_eq!(none, None);
    assert!(listener.try_receive().is_none());
    drop((talker, listener));
    assert_eq!(registered(&names), Vec::<String>::new());
}

#[test]
fn interrupt_ends_an_iterator_in_another_thread() {
    let (_names, network) = name_server();
    let listener = Subscriber::<Bottle>::open_on(&network, "/listener", Queue::Latest).unwrap();
    std::thread::scope(|scope| {
        let reading = scope.spawn(|| listener.iter().count());
        listener.interrupt();
        assert_eq!(reading.join().unwrap(), 0);
    });
}

#[test]
fn a_callback_gets_typed_messages_and_skips_others() {
    let (_names, network) = name_server();
    let (sender, receiver) = mpsc::channel();
    let sender = std::sync::Mutex::new(sender);
    let listener = CallbackSubscriber::open_on(&network, "/listener", move |message| {
        let message: Received<Detection> = message;
        sender.lock().unwrap().send(message.into_value()).unwrap();
    })
    .unwrap();
    let wrong = Publisher::<Bottle>::open_on(&network, "/wrong").unwrap();
    let right = Publisher::<Detection>::open_on(&network, "/right").unwrap();
    listener.connect("/wrong").unwrap();
    listener.connect("/right").unwrap();
    eventually("both are connected", || listener.writers().len() == 2);
    assert_eq!(wrong.publish_reliably(bottle!["glass", 3], TIMEOUT), 1);
    assert_eq!(right.publish_reliably(detection(), TIMEOUT), 1);
    assert_eq!(receiver.recv_timeout(TIMEOUT).unwrap(), detection());
    assert!(receiver.try_recv().is_err(), "the other is not passed on");
}

#[test]
fn a_message_of_another_layout_is_an_error_that_names_the_sender() {
    let (_names, network) = name_server();
    let talker = Publisher::<Bottle>::open_on(&network, "/talker").unwrap();
    let listener = Subscriber::<Detection>::open_on(&network, "/listener", Queue::Strict).unwrap();
    listener.connect("/talker").unwrap();
    eventually("the reader is connected", || !talker.readers().is_empty());
    talker.publish(&bottle!["glass"]);
    let refused = listener
        .receive_timeout(TIMEOUT)
        .expect_err("it is no detection");
    let text = format!("{refused:?}");
    assert!(
        text.contains("/talker") && text.contains("class: String"),
        "{text}"
    );
    talker.publish(&bottle!["glass", [0.5, -0.25, 0.0], 1]);
    let next = listener
        .receive_timeout(TIMEOUT)
        .unwrap()
        .expect("it arrives");
    assert_eq!(next.value, detection());
}

#[test]
fn requests_are_answered() {
    let (names, network) = name_server();
    let server = RpcServer::open_on(&network, "/adder", |request: Bottle| {
        let sum: f64 = request.iter().filter_map(Value::as_f64).sum();
        assert!(sum >= 0.0, "a handler that panics");
        bottle![sum]
    })
    .unwrap();
    assert_eq!(server.name(), "/adder");
    let client = RpcClient::connect_on(&network, "/client", "/adder").unwrap();
    let sum: Bottle = client.call(bottle![1, 2.5, 3]).unwrap();
    assert_eq!(sum, bottle![6.5]);
    let failed: Bottle = client.call(bottle![-1]).unwrap();
    assert_eq!(failed.to_string(), "[fail] \"the handler failed\"");
    let again: Bottle = client.call(bottle![1]).unwrap();
    assert_eq!(again, bottle![1.0]);
    let nobody = RpcClient::connect_on(&network, "/other", "/nobody");
    assert!(matches!(nobody, Err(Error::Network(_))));
    drop((client, server));
    assert_eq!(registered(&names), Vec::<String>::new());
}

#[test]
fn a_call_without_a_reply_ends_at_its_timeout() {
    let (_names, network) = name_server();
    let (release, blocked) = mpsc::channel::<()>();
    let blocked = std::sync::Mutex::new(blocked);
    let server = RpcServer::open_on(&network, "/slow", move |request: Bottle| {
        let _ = blocked.lock().unwrap().recv();
        request
    })
    .unwrap();
    let client = RpcClient::connect_on(&network, "/client", "/slow").unwrap();
    let client = client.with_timeout(Duration::from_millis(50));
    let late = client.call::<Bottle>(bottle!["hello"]);
    assert!(matches!(late, Err(Error::Network(_))), "{late:?}");
    drop(release);
    drop((client, server));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn everything_works_without_blocking() {
    let (_names, network) = tokio::task::spawn_blocking(name_server).await.unwrap();
    let talker = asynchronous::Publisher::open_on(&network, "/talker")
        .await
        .unwrap();
    let mut listener =
        asynchronous::Subscriber::<Detection>::open_on(&network, "/listener", Queue::Strict)
            .await
            .unwrap();
    listener.connect("/talker").await.unwrap();
    while talker.readers().is_empty() {
        tokio::time::sleep(Duration::from_millis(1)).await;
    }
    assert_eq!(talker.publish_reliably(&detection()).await, 1);
    assert_eq!(talker.publish(&detection()), 1);
    assert_eq!(listener.receive().await.unwrap().value, detection());
    let stream = std::pin::Pin::new(&mut listener);
    let next = next(stream).await.expect("the port is open").unwrap();
    assert_eq!(next.value, detection());
    listener.interrupt();
    assert!(next_of(&mut listener).await.is_none());

    let server = asynchronous::RpcServer::open_on(
        &network,
        "/echo",
        |request: Bottle| async move { request },
    )
    .await
    .unwrap();
    let client = asynchronous::RpcClient::connect_on(&network, "/client", "/echo")
        .await
        .unwrap();
    let reply: Bottle = client.call(&bottle!["hello"]).await.unwrap();
    assert_eq!(reply, bottle!["hello"]);
    client.close().await;
    server.close().await;
    listener.close().await;
    talker.close().await;
}

async fn next<S: futures_core::Stream>(mut stream: std::pin::Pin<&mut S>) -> Option<S::Item> {
    std::future::poll_fn(|context| stream.as_mut().poll_next(context)).await
}

async fn next_of<S: futures_core::Stream + Unpin>(stream: &mut S) -> Option<S::Item> {
    next(std::pin::Pin::new(stream)).await
}
