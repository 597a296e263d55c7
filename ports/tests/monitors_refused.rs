//! A connection that requests a modifier that one end lacks is refused with its name, at both ends.

use crate::common;

use common::{Raw, ask, at, bottle, next, open, until, within};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpListener;
use yarp_ports::{Port, PortError, PortOptions, Queue};
use yarp_wire::Bottle;

async fn ends() -> (Port, Port) {
    let reader = open("/r", PortOptions::new().queue(Queue::Wait(10))).await;
    (open("/w", PortOptions::new()).await, reader)
}

/// Unknown modifiers, and the text that the error must contain.
const MISSING: [(&str, &str); 8] = [
    ("SIDE.nonesuch", "\"nonesuch\""),
    ("SIDE.tcp", "\"tcp\""),
    ("SIDE", "portmonitor"),
    ("SIDE.portmonitor", "type"),
    ("SIDE.portmonitor+type.lua+file.x", "\"lua\""),
    ("SIDE.portmonitor+type.dll+file.nonesuch", "\"nonesuch\""),
    (
        "SIDE.portmonitor+type.dll+file.statistics+type1.dll+file1.foo",
        "\"foo\"",
    ),
    (
        "SIDE.portmonitor+type.dll+file.throttleDown+period_ms.soon",
        "period_ms",
    ),
];

#[tokio::test]
async fn a_writer_names_the_missing_modifier_and_keeps_its_connection() {
    let (writer, reader) = ends().await;
    common::connect(&writer, &reader, "tcp").await;
    let sends = MISSING.map(|(text, name)| (text.replace("SIDE", "send"), name));
    let others = [
        ("send.bayer".to_owned(), "\"bayer\""),
        ("send.priority".to_owned(), "\"priority\""),
    ];
    for (modifiers, name) in sends.into_iter().chain(others) {
        let to = at(&reader, &format!("tcp+{modifiers}"));
        let error = within(writer.connect(&to)).await.unwrap_err();
        assert!(
            matches!(error, PortError::Modifier(_)),
            "{modifiers}: {error:?}"
        );
        assert!(
            error.error_chain().contains(name),
            "{modifiers}: {}",
            error.error_chain()
        );
        let answer = ask(
            &writer,
            &Bottle::from_iter(["add".into(), to.as_str().into()]),
        )
        .await;
        assert!(
            answer.contains("Cannot connect to") && answer.contains(&name.replace('"', "\\\"")),
            "{answer}"
        );
        assert_eq!(reader.inputs(), ["/w"]);
        assert_eq!(writer.outputs(), ["/r"]);
    }
    within(writer.write(&Bottle::of(1))).await;
    assert_eq!(next(&reader).await, "1");
}

#[tokio::test]
async fn a_reader_refuses_a_header_with_unknown_modifiers_and_says_why() {
    let (writer, reader) = ends().await;
    let receives = MISSING.map(|(text, name)| (text.replace("SIDE", "recv"), name));
    let others = [
        ("recv.bayer+method.foo", "method"),
        ("recv.bayer+order.xx", "order"),
        ("recv.priority+tc.soon", "tc"),
    ]
    .map(|(text, reason)| (text.to_owned(), reason));
    for (modifiers, reason) in receives.into_iter().chain(others) {
        let answering = ["tcp", "fast_tcp", "text_ack", "udp", "shmem"];
        // Over these a writer receives nothing before it writes, unless it asks.
        let silent = ["text", "unix_stream", "unix_stream+ack"];
        for carrier in answering.into_iter().chain(silent) {
            let carrier = format!("{carrier}+{modifiers}");
            let error = within(writer.connect(&at(&reader, &carrier)))
                .await
                .unwrap_err();
            assert!(
                matches!(error, PortError::Declined { .. }),
                "{carrier}: {error:?}"
            );
            let chain = error.error_chain();
            assert!(
                chain.contains(&carrier) && chain.contains(reason),
                "{chain}"
            );
        }
    }
    until(|| reader.inputs().is_empty()).await;
    assert!(writer.outputs().is_empty());
    let mut raw = Raw::to(&reader).await;
    raw.send(common::tcp_header("/w (recv nonesuch)")).await;
    assert_eq!(raw.ended().await, b"");
    // People are told.
    let mut person = Raw::to(&reader).await;
    person.send("CONNECT me (recv nonesuch)\r\n").await;
    let told = String::from_utf8(person.ended().await).unwrap();
    assert!(
        told.contains("no modifier \"nonesuch\"") && told.contains("priority"),
        "{told}"
    );
}

/// The question whether the reader has it is no message.
#[tokio::test]
async fn a_reader_that_has_it_gets_messages_over_every_carrier() {
    let (writer, reader) = ends().await;
    let carriers = [
        "tcp",
        "fast_tcp",
        "text",
        "text_ack",
        "udp",
        "shmem",
        "unix_stream",
        "unix_stream+ack",
        "local",
    ];
    for carrier in carriers {
        let carrier = format!("{carrier}+recv.portmonitor+type.dll+file.statistics");
        let connecting = within(writer.connect(&at(&reader, &carrier))).await;
        assert!(connecting.is_ok(), "{carrier}: {connecting:?}");
        within(writer.write(&bottle("after"))).await;
        assert_eq!(next(&reader).await, "after", "{carrier}");
    }
}

/// Stock answers the header, and ends the connection when it finds that it lacks the monitor.
#[tokio::test]
async fn a_reader_that_gives_up_behind_the_header_is_noticed() {
    let writer = open("/w", PortOptions::new()).await;
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let number = listener.local_addr().unwrap().port();
    let stock = async {
        // The question about its wire version, which it does not answer, comes first.
        loop {
            let (mut stream, _) = listener.accept().await.unwrap();
            let mut magic = [0; 8];
            stream.read_exact(&mut magic).await.unwrap();
            if magic == *b"YA\xe4\x1e\0\0RP" {
                stream
                    .write_all(&yarp_wire::framed_number::encode(number.into()))
                    .await
                    .unwrap();
                return;
            }
        }
    };
    let to = format!("tcp+recv.portmonitor+type.dll+file.own://127.0.0.1:{number}/r");
    let (result, ()) = within(async { tokio::join!(writer.connect(&to), stock) }).await;
    let error = result.unwrap_err();
    assert!(matches!(error, PortError::Declined { .. }), "{error:?}");
    assert!(
        error.error_chain().contains("file.own"),
        "{}",
        error.error_chain()
    );
    assert!(writer.outputs().is_empty());
}

#[tokio::test]
async fn a_modifier_is_no_carrier() {
    let (writer, reader) = ends().await;
    for name in ["portmonitor", "bayer", "priority"] {
        let error = within(writer.connect(&at(&reader, name)))
            .await
            .unwrap_err();
        let hint = format!("tcp+recv.{name}");
        assert!(
            error.error_chain().contains(&hint),
            "{}",
            error.error_chain()
        );
    }
    let error = within(writer.connect(&at(&reader, "nonesuch")))
        .await
        .unwrap_err();
    assert!(matches!(error, PortError::NoCarrier { .. }), "{error:?}");
}

#[tokio::test]
async fn the_number_of_priority_writers_is_limited() {
    let (_writer, reader) = ends().await;
    let mut all = Vec::new();
    for number in 0..64 {
        let mut raw = Raw::to(&reader).await;
        raw.send(common::tcp_header(&format!("/w{number} (recv priority)")))
            .await;
        raw.receive(8).await;
        all.push(raw);
    }
    let mut raw = Raw::to(&reader).await;
    raw.send(common::tcp_header("/last (recv priority)")).await;
    assert_eq!(raw.ended().await, b"");
    let listed = ask(&reader, &bottle("[list] [in] /last")).await;
    assert_eq!(listed, "");
    drop(all);
}
