//! A port that is asked to connect over `+log.in` forwards copies of received messages.
//!
//! Source: 3.5.0, whose `yarp rpcserver` and `yarp read` forward the same.

use crate::common;

use common::{Raw, at, bottle, connect, next, open, until, within};
use yarp_ports::{Answer, Port, PortError, PortOptions, Queue};
use yarp_wire::Bottle;

async fn logger() -> Port {
    open("/logger", PortOptions::new().queue(Queue::Wait(100))).await
}

async fn look_on(port: &Port, logger: &Port, carrier: &str) {
    within(port.connect(&at(logger, carrier))).await.unwrap();
    until(|| logger.inputs() == [port.name()]).await;
}

#[tokio::test]
async fn messages_are_forwarded_with_their_envelope() {
    for carrier in ["tcp+log.in", "fast_tcp+log.in", "text+log.in", "udp+log.in"] {
        let reader = open("/rd", PortOptions::new().queue(Queue::Latest)).await;
        let writer = open("/wr", PortOptions::new()).await;
        let logger = logger().await;
        look_on(&reader, &logger, carrier).await;
        for over in ["tcp", "text_ack"] {
            connect(&writer, &reader, over).await;
            let message = bottle("hello 5 1.5 (a b)");
            within(writer.write_with(&message, Some("7 1.5".into()))).await;
            let copy = within(logger.read()).await.unwrap();
            assert_eq!(copy.bottle().unwrap(), message);
            assert_eq!(&*copy.from, "/rd");
            if carrier != "text+log.in" && over == "tcp" {
                assert_eq!(copy.stamp().unwrap().count, 7);
            }
        }
    }
}

#[tokio::test]
async fn requests_are_forwarded_with_their_reply() {
    let handler = |received: &mut yarp_ports::Received| match received.bottle() {
        Ok(request)
            if request
                .get(0)
                .is_some_and(|word| word.as_str() == Some("quiet")) =>
        {
            Answer::Nothing
        }
        _ => Answer::reply(Bottle::parse("ok 2").unwrap()),
    };
    let server = open("/srv", PortOptions::new().handler(handler).input_only()).await;
    let client = open("/cl", PortOptions::new().rpc_client()).await;
    let logger = logger().await;
    connect(&client, &server, "tcp").await;
    look_on(&server, &logger, "tcp+log.in").await;
    let _: Bottle = within(client.call(&bottle("hello (a b)"))).await.unwrap();
    assert_eq!(next(&logger).await, "[rpc] (hello (a b)) (ok 2)");
    // There was no reply, or none was requested: only the message is copied.
    let _: Bottle = within(client.call(&bottle("quiet 1"))).await.unwrap();
    assert_eq!(next(&logger).await, "quiet 1");
    within(client.write(&bottle("one way"))).await;
    assert_eq!(next(&logger).await, "one way");
}

#[tokio::test]
async fn messages_of_the_owner_go_to_other_readers() {
    let port = open("/p", PortOptions::new()).await;
    let reader = open("/rd", PortOptions::new().queue(Queue::Wait(10))).await;
    let logger = logger().await;
    look_on(&port, &logger, "tcp+log.in").await;
    assert_eq!(within(port.write(&Bottle::of(1))).await, 0);
    within(port.connect(&at(&reader, "tcp"))).await.unwrap();
    assert_eq!(within(port.write(&Bottle::of(2))).await, 1);
    assert_eq!(next(&reader).await, "2");
    let mut person = Raw::text(&port, "me").await;
    person.send("d\r\n3\r\n").await;
    assert_eq!(next(&logger).await, "3");
    assert!(logger.try_read().is_none());
}

#[tokio::test]
async fn a_port_that_calls_may_be_looked_at_as_well() {
    let server = open(
        "/srv",
        PortOptions::new().handler(|_| Answer::reply(Bottle::of(1))),
    )
    .await;
    let client = open("/cl", PortOptions::new().rpc_client()).await;
    let logger = logger().await;
    look_on(&client, &logger, "tcp+log.in").await;
    within(client.connect(&at(&server, "tcp"))).await.unwrap();
    let reply: Bottle = within(client.call(&Bottle::of(5))).await.unwrap();
    assert_eq!(reply.to_string(), "1");
}

/// Otherwise two ports that log each other would loop.
#[tokio::test]
async fn copies_are_not_copied_again() {
    let first = open("/first", PortOptions::new().queue(Queue::Wait(10))).await;
    let second = open("/second", PortOptions::new().queue(Queue::Wait(10))).await;
    within(first.connect(&at(&second, "tcp+log.in")))
        .await
        .unwrap();
    within(second.connect(&at(&first, "tcp+log.in")))
        .await
        .unwrap();
    let writer = open("/wr", PortOptions::new()).await;
    connect(&writer, &first, "tcp").await;
    for i in 1..=2 {
        within(writer.write(&Bottle::of(i))).await;
        assert_eq!(next(&second).await, i.to_string());
        assert_eq!(next(&first).await, i.to_string());
    }
    assert!(first.try_read().is_none());
}

#[tokio::test]
async fn a_logger_that_does_not_read_delays_no_other() {
    let reader = open("/rd", PortOptions::new().queue(Queue::Latest)).await;
    let writer = open("/wr", PortOptions::new()).await;
    let logger = open("/logger", PortOptions::new().queue(Queue::Wait(1))).await;
    look_on(&reader, &logger, "tcp+log.in").await;
    connect(&writer, &reader, "tcp").await;
    let large = Bottle::of("x".repeat(1 << 20));
    let dropped = || {
        let counters = reader.counters();
        let mut connections = counters.connections.iter();
        let logs = connections.find(|counted| !counted.incoming).unwrap();
        logs.traffic.dropped
    };
    while dropped() == 0 {
        assert_eq!(within(writer.write(&large)).await, 1);
    }
}

#[tokio::test]
async fn the_port_says_what_it_will_do() {
    let port = open("/p", PortOptions::new().input_only()).await;
    let logger = logger().await;
    let mut admin = Raw::text(&port, "admin").await;
    let target = at(&logger, "tcp+log.in");
    let added = format!(
        "0 \"Added connection from /p to {target}; \
         /p will forward messages and replies (if any) to /logger\\r\\n\""
    );
    let listed = "(from \"/p\") (to \"/logger\") (carrier \"tcp+log.in\")";
    let refused = |mode: &str| {
        format!("-1 \"Logger configured as log.{mode}, but only log.in is supported\\r\\n\"")
    };
    for (request, answer) in [
        (format!("[add] \"{target}\""), added),
        ("[list] [out] /logger".to_owned(), listed.to_owned()),
        (
            format!("[add] \"{}\"", at(&logger, "tcp+log.out")),
            refused("out"),
        ),
        (
            format!("[add] \"{}\"", at(&logger, "tcp+log.both")),
            refused("both"),
        ),
    ] {
        admin.send(format!("a\r\n{request}\r\n")).await;
        admin.expect(format!("{answer}\r\n")).await;
    }
    let refused = within(port.connect(&at(&logger, "tcp+log.out"))).await;
    assert!(matches!(refused, Err(PortError::LogNotSupported { .. })));
}
