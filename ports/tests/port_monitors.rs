//! Messages pass the monitors that their connection requests, at the requested end.
//!
//! Source of the grammar and of the answers: 3.5.0 with the plugins of 4.0.0.

use crate::common;

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use common::{ask, at, bottle, connect, next, open, until, within};
use yarp_ports::{
    Answer, Monitor, MonitorSide, Passing, Port, PortError, PortOptions, Queue, Received,
};
use yarp_wire::typed::{Image, PixelCode};
use yarp_wire::{Bottle, Value};

const MESSAGE: &str = "1 2.5 hello (a b)";
const STREAMS: [&str; 6] = [
    "tcp",
    "fast_tcp",
    "text",
    "text_ack",
    "unix_stream",
    "unix_stream+ack",
];

async fn reader() -> Port {
    open("/r", PortOptions::new().queue(Queue::Wait(100))).await
}

async fn writer() -> Port {
    open("/w", PortOptions::new()).await
}

fn dll(side: &str, name: &str) -> String {
    format!("+{side}.portmonitor+type.dll+file.{name}")
}

#[tokio::test]
async fn messages_are_compressed_and_decompressed() {
    let zlib = "+send.portmonitor+recv.portmonitor+type.dll+file.bottle_compression_zlib";
    let large = Bottle::of("x".repeat(300_000));
    for carrier in STREAMS.into_iter().chain(["local"]) {
        let (writer, reader) = (writer().await, reader().await);
        connect(&writer, &reader, &format!("{carrier}{zlib}")).await;
        for message in [&bottle(MESSAGE), &large, &Bottle::new()] {
            assert_eq!(within(writer.write(message)).await, 1, "{carrier}");
            let read = within(reader.read()).await.unwrap();
            assert_eq!(&read.bottle().unwrap(), message, "{carrier}");
        }
        let counted = reader.counters().connections[0].traffic.bytes;
        assert!(counted < 20_000, "{carrier}: {counted}");
    }
}

/// One `type` for both ends, as in 3.12, though each end has a `file` of its own.
#[tokio::test]
async fn both_ends_share_one_type() {
    let file = "portmonitor+file.bottle_compression_zlib";
    for zlib in [
        format!("+send.{file}+recv.{file}+type.dll"),
        format!("+send.{file}+type.dll+recv.{file}"),
        format!("+type.dll+recv.{file}+send.{file}"),
    ] {
        let (writer, reader) = (writer().await, reader().await);
        connect(&writer, &reader, &format!("fast_tcp{zlib}")).await;
        let large = Bottle::of("x".repeat(300_000));
        assert_eq!(within(writer.write(&large)).await, 1, "{zlib}");
        let read = within(reader.read()).await.unwrap();
        assert_eq!(read.bottle().unwrap(), large, "{zlib}");
        let counted = reader.counters().connections[0].traffic.bytes;
        assert!(counted < 20_000, "{zlib}: {counted}");
    }
}

/// The form of 4.0's plugin: the size before, and a blob in zlib's form.
#[tokio::test]
async fn a_reader_without_the_monitor_gets_the_compressed_form() {
    for carrier in STREAMS.into_iter().chain(["udp"]) {
        let (writer, reader) = (writer().await, reader().await);
        let zlib = dll("send", "bottle_compression_zlib");
        connect(&writer, &reader, &format!("{carrier}{zlib}")).await;
        within(writer.write_with(&bottle(MESSAGE), Some("3 4.5".into()))).await;
        let read = within(reader.read()).await.unwrap();
        let compressed = read.bottle().unwrap();
        assert_eq!(compressed.get(0), Some(&Value::Int32(59)), "{carrier}");
        let blob = compressed.get(1).and_then(Value::as_blob).unwrap();
        assert_eq!(blob[..2], [120, 156], "{carrier}");
        if !carrier.starts_with("text") {
            assert_eq!(read.stamp().unwrap().count, 3, "{carrier}");
        }
    }
}

#[tokio::test]
async fn each_end_may_have_a_monitor_of_its_own_and_several() {
    let (writer, reader) = (writer().await, reader().await);
    let stages = "+type1.dll+file1.statistics+type2.dll+file2.simulated_network_delay+delay_ms.1";
    let carrier = format!(
        "tcp{}{}{stages}",
        dll("send", "statistics"),
        dll("recv", "bottle_compression_zlib"),
    );
    connect(&writer, &reader, &carrier).await;
    within(writer.write(&bottle(
        "12 {120 156 99 100 100 96 0 34 6 38 32 6 0 0 51 0 6}",
    )))
    .await;
    assert_eq!(next(&reader).await, "2");
    let counted = ask(&reader, &bottle("[get] [in] /w")).await;
    assert!(counted.contains("(delay_ms 1.0) (messages 1)"), "{counted}");
    let sent = ask(&writer, &bottle("[get] [out] /r")).await;
    assert!(
        sent.contains("(messages 1)") && !sent.contains("delay_ms"),
        "{sent}"
    );
}

#[tokio::test]
async fn a_throttle_is_set_while_it_works() {
    for side in ["send", "recv"] {
        let (writer, reader) = (writer().await, reader().await);
        let carrier = format!("tcp{}+period_ms.100000000", dll(side, "throttleDown"));
        connect(&writer, &reader, &carrier).await;
        // A message that is stopped is done with.
        assert_eq!(within(writer.write(&Bottle::of(1))).await, 1);
        let (port, place, way) = match side {
            "send" => (&writer, "[out] /r", "to /r"),
            _ => (&reader, "[in] /w", "from /w"),
        };
        let set = ask(port, &bottle(&format!("[set] {place} (period_ms 0)"))).await;
        assert_eq!(set, format!("0 \"Configured connection {way}\\r\\n\""));
        let get = ask(port, &bottle(&format!("[get] {place}"))).await;
        assert_eq!(get, "((period_ms 0.0))");
        within(writer.write(&Bottle::of(2))).await;
        assert_eq!(next(&reader).await, "2");
        assert!(reader.try_read().is_none());
    }
}

#[tokio::test]
async fn a_delayed_message_delays_no_other_connection() {
    let (writer, slow) = (writer().await, reader().await);
    let quick = open("/quick", PortOptions::new().queue(Queue::Wait(10))).await;
    let delay = dll("send", "simulated_network_delay") + "+delay_ms.100000000";
    connect(&writer, &slow, &format!("tcp{delay}")).await;
    let to = at(&quick, "tcp");
    within(writer.connect(&to)).await.unwrap();
    for number in 0..3 {
        within(writer.write_strict(&Bottle::of(number), None)).await;
        assert_eq!(next(&quick).await, number.to_string());
    }
    assert!(slow.try_read().is_none());
    // The connection is busy as long as something is held back: only the other gets this.
    until(|| writer.write_if_idle(&Bottle::of(3), None) == 1).await;
    within(writer.close()).await;
}

#[tokio::test]
async fn calls_pass_monitors_and_replies_are_counted() {
    let answering = |received: &mut Received| Answer::reply(received.bottle().unwrap());
    let server = open("/srv", PortOptions::new().handler(answering).input_only()).await;
    let client = open("/cl", PortOptions::new().rpc_client()).await;
    let carrier = format!(
        "tcp{}+type1.dll+file1.bottle_compression_zlib{}",
        dll("send", "stats_monitor"),
        dll("recv", "bottle_compression_zlib"),
    );
    connect(&client, &server, &carrier).await;
    let reply: Bottle = within(client.call(&bottle(MESSAGE))).await.unwrap();
    assert_eq!(reply.to_string(), MESSAGE);
    let counted = ask(&client, &bottle("[get] [out] /srv")).await;
    assert!(counted.contains("(messages 1) (replies 1)"), "{counted}");
    // A message that a monitor stops gets no reply, at either end.
    let never = "+period_ms.100000000";
    let stopped = format!("tcp{}{never}", dll("send", "throttleDown"));
    connect(&client, &server, &stopped).await;
    let reply = within(client.call::<Bottle>(&bottle(MESSAGE))).await;
    assert!(matches!(reply, Err(PortError::Lost { .. })), "{reply:?}");
    let unheard = format!("tcp{}{never}", dll("recv", "throttleDown"));
    connect(&client, &server, &unheard).await;
    let reply: Bottle = within(client.call(&bottle(MESSAGE))).await.unwrap();
    assert_eq!(reply, Bottle::new());
}

fn picture(code: PixelCode, depth: usize) -> Image {
    Image::from_packed(code, 40, 30, vec![200; 40 * 30 * depth]).unwrap()
}

#[tokio::test]
async fn images_are_compressed_and_made_grey() {
    let (writer, reader) = (writer().await, reader().await);
    let jpeg = "tcp+send.portmonitor+recv.portmonitor+type.dll+file.image_compression_jpeg";
    connect(&writer, &reader, jpeg).await;
    within(writer.write(&picture(PixelCode::BGR, 3))).await;
    let read: Image = within(reader.read()).await.unwrap().read().unwrap();
    assert_eq!(
        (read.code(), read.width(), read.height()),
        (PixelCode::BGR, 40, 30)
    );
    assert!(read.packed().iter().all(|byte| byte.abs_diff(200) < 5));
    assert!(reader.counters().connections[0].traffic.bytes < 2000);
    // Messages that are not images pass.
    within(writer.write(&bottle(MESSAGE))).await;
    assert_eq!(next(&reader).await, MESSAGE);
    connect(
        &writer,
        &reader,
        &format!("tcp{}", dll("send", "image_to_mono")),
    )
    .await;
    within(writer.write(&picture(PixelCode::RGBA, 4))).await;
    let read: Image = within(reader.read()).await.unwrap().read().unwrap();
    assert_eq!(read, picture(PixelCode::MONO, 1));
}

#[tokio::test]
async fn pulled_images_pass_the_readers_monitors() {
    let (camera, reader) = (writer().await, reader().await);
    let carrier = format!("mjpeg{}", dll("recv", "image_to_mono"));
    within(reader.connect(&at(&camera, &carrier)))
        .await
        .unwrap();
    until(|| camera.outputs() == ["null"]).await;
    within(camera.write(&picture(PixelCode::RGB, 3))).await;
    let read: Image = within(reader.read()).await.unwrap().read().unwrap();
    assert_eq!(read.code(), PixelCode::MONO);
}

#[tokio::test]
async fn depths_are_compressed_and_shown() {
    let (writer, reader) = (writer().await, reader().await);
    let metres = [0.5_f32, 1.0, 2.0].map(f32::to_le_bytes).concat();
    let depths = Image::from_packed(PixelCode::MONO_FLOAT, 3, 1, metres).unwrap();
    let zlib = "+send.portmonitor+recv.portmonitor+type.dll+file.depthimage_compression_zlib";
    let grey = dll("recv", "depthimage_to_mono");
    let colour = dll("recv", "depthimage_to_rgb");
    for (carrier, code) in [
        (zlib, PixelCode::MONO_FLOAT),
        (&grey, PixelCode::MONO),
        (&colour, PixelCode::RGB),
    ] {
        connect(&writer, &reader, &format!("tcp{carrier}")).await;
        // As in stock, messages that are not depth images are stopped.
        within(writer.write(&bottle(MESSAGE))).await;
        within(writer.write(&depths)).await;
        let read: Image = within(reader.read()).await.unwrap().read().unwrap();
        assert_eq!((read.code(), read.width(), read.height()), (code, 3, 1));
        if code == PixelCode::MONO_FLOAT {
            assert_eq!(read, depths);
        }
    }
}

#[tokio::test]
async fn raw_images_arrive_in_colour() {
    let (writer, reader) = (writer().await, reader().await);
    let raw = Image::from_packed(PixelCode::MONO, 8, 4, (0..32).collect::<Vec<u8>>()).unwrap();
    for (options, size) in [
        ("", (8, 4)),
        ("+size.half+order.bggr", (4, 2)),
        ("+method.hqlinear", (8, 4)),
    ] {
        connect(&writer, &reader, &format!("tcp+recv.bayer{options}")).await;
        within(writer.write(&raw)).await;
        let read: Image = within(reader.read()).await.unwrap().read().unwrap();
        assert_eq!((read.width(), read.height()), size, "{options}");
        assert_eq!(read.code(), PixelCode::RGB);
    }
}

#[tokio::test]
async fn the_writer_with_priority_is_accepted() {
    let reader = reader().await;
    let low = open("/low", PortOptions::new()).await;
    let high = open("/high", PortOptions::new()).await;
    let to = at(&reader, "tcp+recv.priority+bs.5+tc.100000");
    within(low.connect(&to)).await.unwrap();
    let to = at(&reader, "tcp+recv.priority+bs.20+tc.100000");
    within(high.connect(&to)).await.unwrap();
    within(low.write(&Bottle::of(1))).await;
    assert_eq!(next(&reader).await, "1");
    within(high.write(&Bottle::of(2))).await;
    assert_eq!(next(&reader).await, "2");
    within(low.write(&Bottle::of(3))).await;
    within(high.write(&Bottle::of(4))).await;
    assert_eq!(next(&reader).await, "4");
    // A closed connection has no priority.
    within(high.close()).await;
    until(|| reader.inputs() == ["/low"]).await;
    within(low.write(&Bottle::of(5))).await;
    assert_eq!(next(&reader).await, "5");
}

/// Answers of 3.5.0, word for word.
#[tokio::test]
async fn parameters_are_told_and_set_in_stocks_words() {
    let (writer, reader) = (writer().await, reader().await);
    let carrier = "tcp+recv.priority+tc.3+(ex (/a -10) (/b 20))";
    connect(&writer, &reader, carrier).await;
    let told =
        r#"((bs 1.0) (ex "ex (\"/a\" -10) (\"/b\" 20)") (st 1.0) (tc 3.0) (tr 0.0) (virtual 0))"#;
    assert_eq!(ask(&reader, &bottle("[get] [in] /w")).await, told);
    assert_eq!(
        ask(
            &reader,
            &bottle("[set] [in] /w (tc 7) (st 3) (virtual 1) (ex (/c 1))")
        )
        .await,
        "0 \"Configured connection from /w\\r\\n\""
    );
    let told = r#"((bs 1.0) (ex "ex (\"/c\" 1)") (st 3.0) (tc 7.0) (tr 0.0) (virtual 1))"#;
    assert_eq!(ask(&reader, &bottle("[get] [in] /w")).await, told);
    let listed = ask(&writer, &bottle("[list] [out] /r")).await;
    assert!(
        listed.ends_with(r#"(carrier "tcp+recv.priority+tc.3+(ex (/a -10) (/b 20))")"#),
        "{listed}"
    );
    let listed = ask(&reader, &bottle("[list] [in] /w")).await;
    let stock = r#"(carrier "tcp+recv.priority+tc.3+ex (\"/a\" -10) (\"/b\" 20).")"#;
    assert!(listed.ends_with(stock), "{listed}");
    assert_eq!(ask(&writer, &bottle("[get] [out] /r")).await, "()");
}

/// Answers of 3.5.0, word for word; the reason for a refusal follows them.
#[tokio::test]
async fn monitors_are_attached_to_a_port_and_detached() {
    let (writer, reader) = (writer().await, reader().await);
    connect(&writer, &reader, "tcp").await;
    let failed = "[fail] \"Failed to configure the portmonitor plug-in\"";
    for (port, place, missing) in [(&writer, "out", "output"), (&reader, "in", "input")] {
        let own = port.name();
        let ask = async |request: &str| {
            let request = request.replace("HERE", &format!("[{place}]"));
            ask(port, &bottle(&request)).await
        };
        for request in [
            "[atch] HERE",
            "[atch] HERE foo",
            "[atch] HERE \"(type dll) (file nonesuch)\"",
            "[atch] HERE \"(type lua) (file throttleDown)\"",
            "[atch] HERE (type dll) (file throttleDown)",
        ] {
            let answer = ask(request).await;
            assert!(answer.starts_with(failed), "{request}: {answer}");
        }
        let answer = ask("[atch] HERE \"(type dll) (file nonesuch)\"").await;
        assert!(
            answer.contains("nonesuch") && answer.contains("throttleDown"),
            "{answer}"
        );
        let none = format!("[fail] \"No port modifier is attached to the {missing}\"");
        assert_eq!(ask(&format!("[get] HERE {own}")).await, none);
        let never = "[atch] HERE \"(type dll) (file throttleDown) (period_ms 100000000)\"";
        assert_eq!(ask(never).await, "[ok]");
        within(writer.write(&Bottle::of("unheard"))).await;
        within(writer.write_strict(&Bottle::of("unheard"), None)).await;
        writer.write_if_idle(&Bottle::of("unheard"), None);
        within(writer.flush()).await;
        assert_eq!(
            ask(&format!("[set] HERE {own} (period_ms 0)")).await,
            "[ok]"
        );
        assert_eq!(ask(&format!("[get] HERE {own}")).await, "((period_ms 0.0))");
        within(writer.write(&Bottle::of("heard"))).await;
        assert_eq!(next(&reader).await, "heard");
        assert_eq!(ask(never).await, "[ok]");
        assert_eq!(ask("[dtch] HERE").await, "[ok]");
        assert_eq!(ask("[dtch] HERE").await, "[ok]");
        assert_eq!(ask(&format!("[set] HERE {own} (period_ms 0)")).await, none);
        within(writer.write(&Bottle::of("again"))).await;
        assert_eq!(next(&reader).await, "again");
    }
    for (request, answer) in [
        (
            "[atch]",
            "[fail] \"attach command must be followed by [out] or [in]\"",
        ),
        (
            "[atch] foo",
            "[fail] \"attach command must be followed by [out] or [in]\"",
        ),
        (
            "[dtch]",
            "[fail] \"detach command must be followed by [out] or [in]\"",
        ),
    ] {
        assert_eq!(ask(&reader, &bottle(request)).await, answer);
    }
}

#[tokio::test]
async fn an_attached_monitor_changes_sent_messages() {
    let (writer, reader) = (writer().await, reader().await);
    let attach = bottle("[atch] [in] \"(type dll) (file bottle_compression_zlib)\"");
    for carrier in ["tcp", "text"] {
        connect(&writer, &reader, carrier).await;
        let attach_out = bottle("[atch] [out] \"(type dll) (file bottle_compression_zlib)\"");
        assert_eq!(ask(&writer, &attach_out).await, "[ok]");
        within(writer.write(&bottle(MESSAGE))).await;
        assert!(next(&reader).await.starts_with("59 {120 156"));
        assert_eq!(ask(&reader, &attach).await, "[ok]");
        within(writer.write(&bottle(MESSAGE))).await;
        assert_eq!(next(&reader).await, MESSAGE);
        assert_eq!(ask(&reader, &bottle("[dtch] [in]")).await, "[ok]");
    }
}

/// Adds one to the first item, at the reader's end only.
struct Increment(Arc<AtomicUsize>);

impl Monitor for Increment {
    fn update(&self, message: Passing) -> Option<Passing> {
        self.0.fetch_add(1, Ordering::Relaxed);
        let number = message.payload.to_bottle().ok()?.get(0)?.as_i64()?;
        let bytes = Bottle::of(number + 1).encode(yarp_wire::WireVersion::V3);
        let form = yarp_wire::message::Form::Binary(yarp_wire::WireVersion::V3);
        Some(message.with(yarp_wire::message::Payload::new(bytes, form)))
    }
}

#[tokio::test]
async fn an_owner_offers_a_monitor_of_its_own() {
    let count = Arc::new(AtomicUsize::new(0));
    let counter = count.clone();
    let options = PortOptions::new().queue(Queue::Wait(10));
    let options = options.monitor("increment", move |setup| {
        if setup.side != MonitorSide::Receive
            || setup.from != "/w"
            || setup.option("step").is_none()
        {
            return Err("it needs a step".to_owned());
        }
        Ok(Arc::new(Increment(counter.clone())))
    });
    let (writer, reader) = (writer().await, open("/r", options).await);
    let carrier = format!("tcp{}", dll("recv", "increment"));
    let refused = within(writer.connect(&at(&reader, &carrier))).await;
    assert!(
        matches!(refused, Err(PortError::Declined { .. })),
        "{refused:?}"
    );
    connect(&writer, &reader, &format!("{carrier}+step.1")).await;
    within(writer.write(&Bottle::of(41))).await;
    assert_eq!(next(&reader).await, "42");
    assert_eq!(count.load(Ordering::Relaxed), 1);
}
