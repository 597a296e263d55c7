//! A peer that dies at any byte of any phase takes its own connection with it and nothing else:
//! the port serves others, and neither a place in its list nor a task nor a descriptor is left.
//!
//! One test per phase. Each breaks off every conversation that has the phase, on every carrier, at
//! every byte of it, once by closing the connection and once by resetting it.

mod common;
mod conversation;
mod leaks;

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use common::{DEADLINE, bottle, connect, until, within};
use conversation::{Conversation, Death, NAME, Side};
use leaks::{Rest, leaving_nothing};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use yarp_ports::{AdminClient, Answer, AuthFailure, Network, Port, PortError, PortOptions, Queue};
use yarp_wire::Bottle;
use yarp_wire::carrier::Carrier;
use yarp_wire::message::Command;
use yarp_wire::typed::{Image, PixelCode};

#[test]
fn in_the_key_handshake() {
    check("key");
}

#[test]
fn in_the_magic_or_before_the_first_byte() {
    check("magic");
}

#[test]
fn in_the_length_of_the_name() {
    check("length of the name");
}

#[test]
fn in_the_name() {
    check("name");
}

#[test]
fn in_the_group_behind_the_name() {
    check("group");
}

#[test]
fn in_the_request_of_a_browser_or_camera() {
    check("request");
}

#[test]
fn in_the_header_reply_or_before_it() {
    check("header reply");
}

#[test]
fn before_the_socket_of_the_file_system() {
    check("other socket");
}

#[test]
fn in_the_handshake_of_shared_memory() {
    check("memory");
}

#[test]
fn in_the_reversal_of_a_reader() {
    check("turn");
}

#[test]
fn in_the_index() {
    check("index");
}

#[test]
fn in_the_command() {
    check("command");
}

#[test]
fn in_the_payload() {
    check("payload");
}

#[test]
fn in_the_reply_or_before_it() {
    check("reply");
}

#[test]
fn in_the_acknowledgement_or_before_it() {
    check("acknowledgement");
}

#[test]
fn in_a_question_to_the_port_itself_or_its_answer() {
    check("administration");
}

/// Before its acknowledgement, too.
#[test]
fn in_the_close_message() {
    check("goodbye");
}

/// Far more than the buffers of the system hold.
#[test]
fn in_a_large_message_that_is_being_written() {
    leaving_nothing(async {
        let (writer, keeps) = writer_and_reader(&network("payload")).await;
        let rest = Rest::now();
        let large = Bottle::of("x".repeat(8 << 20));
        let mut count = 0;
        for conversation in conversation::readers("/writer", &large) {
            let cuts = conversation.cuts("payload");
            let cuts = [cuts.first(), cuts.get(100_000), cuts.last()];
            for cut in cuts.into_iter().flatten() {
                for death in [Death::Closes, Death::Resets] {
                    write_to_dying(&writer, &large, &conversation, *cut, death).await;
                    count += 1;
                    still_reaches(&writer, &keeps, count).await;
                }
            }
        }
        assert!(count > 0);
        rest.comes_back().await;
        within(writer.close()).await;
        within(keeps.close()).await;
    });
}

#[test]
fn between_messages() {
    check("rest");
}

fn check(phase: &str) {
    leaving_nothing(async {
        let mut deaths = 0;
        deaths += a_port_that_reads(phase).await;
        deaths += a_port_that_answers(phase).await;
        deaths += a_port_that_is_read_from(phase).await;
        deaths += a_port_that_writes(phase).await;
        deaths += a_port_that_calls(phase).await;
        deaths += a_port_that_pulls(phase).await;
        assert!(deaths > 0, "no conversation has this phase");
        println!("{deaths} deaths");
    });
}

/// Every place and way to die in `phase`.
fn deaths(conversation: &Conversation, phase: &str) -> impl Iterator<Item = (usize, Death)> {
    let cuts = conversation.cuts(phase).into_iter();
    cuts.flat_map(|cut| [(cut, Death::Closes), (cut, Death::Resets)])
}

/// Returns a network with a key if `phase` is part of the key handshake, otherwise without.
fn network(phase: &str) -> Network {
    let network = Network::none().with_timeout(DEADLINE);
    match phase {
        "key" => network.with_key(Some(conversation::key())),
        _ => network,
    }
}

async fn open(network: &Network, name: &str, options: PortOptions) -> Port {
    let opening = Port::open(network, name, options.unregistered());
    within(opening).await.unwrap()
}

/// Returns the conversations as they are in `phase`; before keys are shown one is as good as another.
fn in_phase(phase: &str, side: Side, mut all: Vec<Conversation>) -> Vec<Conversation> {
    if phase == "key" {
        all.retain(|conversation| ["text", "mjpeg"].contains(&conversation.spelled));
        all.truncate(1);
    }
    all.into_iter()
        .map(|conversation| match phase {
            "key" => conversation.behind_a_key(side),
            _ => conversation,
        })
        .collect()
}

/// Connects to `port`, follows the script until `cut`, and ends.
async fn die(port: &Port, conversation: &Conversation, cut: usize, death: Death) {
    let stream = within(TcpStream::connect(("127.0.0.1", port.tcp_port()))).await;
    conversation.hold(stream.unwrap(), cut).await.die(death);
}

async fn a_port_that_reads(phase: &str) -> usize {
    let network = network(phase);
    let reading = PortOptions::new().queue(Queue::Wait(10));
    let reader = open(&network, "/reader", reading).await;
    let good = open(&network, "/good", PortOptions::new()).await;
    connect(&good, &reader, "tcp").await;
    until(|| reader.inputs() == ["/good"]).await;
    let rest = Rest::now();
    let content = bottle("whole 1 2");
    let mut count = 0;
    for conversation in in_phase(phase, Side::Connects, conversation::writers(&content)) {
        for (cut, death) in deaths(&conversation, phase) {
            die(&reader, &conversation, cut, death).await;
            count += 1;
            let message = Bottle::of(count as i32);
            assert_eq!(within(good.write(&message)).await, 1);
            loop {
                let read = within(reader.read()).await.unwrap();
                let bottle = read.bottle().unwrap();
                if *read.from == *"/good" {
                    assert_eq!(bottle, message, "{conversation:?} {cut} {death:?}");
                    break;
                }
                assert_eq!(bottle, content, "{conversation:?} {cut} {death:?}");
            }
        }
        if conversation.carrier.connectionless {
            // A datagram writer is gone when it closes, or when it reconnects.
            forget(&reader).await;
        }
        until(|| reader.inputs() == ["/good"]).await;
        while reader.try_read().is_some() {}
    }
    rest.comes_back().await;
    within(good.close()).await;
    within(reader.close()).await;
    count
}

/// Tells a port that a writer is gone.
async fn forget(reader: &Port) {
    let address = ("127.0.0.1", reader.tcp_port());
    let carrier = Carrier::by_name("text_ack").unwrap();
    let opening = AdminClient::open(reader.name(), address, carrier, "admin", reader.network());
    let mut client = within(opening).await.unwrap();
    let request = Command::RemoveInput(NAME.to_owned());
    // A connection that is being taken note of may come a moment later.
    let forgetting = async {
        loop {
            client.command(&request).await.unwrap();
            if !reader.inputs().iter().any(|name| name == NAME) {
                break;
            }
            tokio::task::yield_now().await;
        }
    };
    within(forgetting).await;
}

async fn a_port_that_answers(phase: &str) -> usize {
    let (question, answer) = (bottle("how much"), bottle("just 42"));
    let given = answer.clone();
    let options = PortOptions::new().handler(move |_| {
        let given = given.clone();
        Answer::Later(Box::pin(async {
            tokio::task::yield_now().await;
            Answer::reply(given)
        }))
    });
    let network = network(phase);
    let server = open(&network, "/server", options).await;
    let good = open(&network, "/good", PortOptions::new().rpc_client()).await;
    connect(&good, &server, "tcp").await;
    until(|| server.inputs() == ["/good"]).await;
    let rest = Rest::now();
    let mut count = 0;
    let callers = conversation::callers(&question, &answer);
    for conversation in in_phase(phase, Side::Connects, callers) {
        for (cut, death) in deaths(&conversation, phase) {
            die(&server, &conversation, cut, death).await;
            count += 1;
            let got: Bottle = within(good.call(&question)).await.unwrap();
            assert_eq!(got, answer, "{conversation:?} {cut} {death:?}");
        }
        until(|| server.inputs() == ["/good"]).await;
    }
    rest.comes_back().await;
    within(good.close()).await;
    within(server.close()).await;
    count
}

/// Returns the peer connects and asks to read.
async fn a_port_that_is_read_from(phase: &str) -> usize {
    let (writer, keeps) = writer_and_reader(&network(phase)).await;
    let rest = Rest::now();
    let content = bottle("whole 1 2");
    let picture = Image::new(PixelCode::RGB, 16, 16).unwrap();
    let mut count = 0;
    for conversation in in_phase(phase, Side::Connects, conversation::viewers(&content)) {
        for (cut, death) in deaths(&conversation, phase) {
            let dying = die(&writer, &conversation, cut, death);
            let writing = async {
                until(|| writer.outputs().len() > 1).await;
                match conversation.carrier.name {
                    "mjpeg" => writer.write_strict(&picture, None).await,
                    _ => writer.write_strict(&content, None).await,
                };
                std::future::pending().await
            };
            tokio::select! {
                () = dying => {}
                () = writing => {}
            }
            count += 1;
            still_reaches(&writer, &keeps, count).await;
        }
        until(|| writer.outputs() == ["/keeps"] && writer.inputs().is_empty()).await;
    }
    rest.comes_back().await;
    within(writer.close()).await;
    within(keeps.close()).await;
    count
}

async fn writer_and_reader(network: &Network) -> (Port, Port) {
    let writer = open(network, "/writer", PortOptions::new()).await;
    let reading = PortOptions::new().queue(Queue::Wait(100));
    let keeps = open(network, "/keeps", reading).await;
    connect(&writer, &keeps, "tcp").await;
    until(|| keeps.inputs() == ["/writer"]).await;
    (writer, keeps)
}

async fn still_reaches(writer: &Port, reader: &Port, number: usize) {
    let message = Bottle::of(number as i32);
    assert!(within(writer.write(&message)).await >= 1);
    while within(reader.read()).await.unwrap().bottle().ok().as_ref() != Some(&message) {}
}

/// Returns a listener and its address; the listener follows the script until `cut` with the first
/// peer that is not a probe, and ends.
async fn dying_listener(
    conversation: &Conversation,
    cut: usize,
    death: Death,
) -> (String, impl Future<Output = ()>) {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let number = listener.local_addr().unwrap().port();
    let contact = format!("{}://127.0.0.1:{number}{NAME}", conversation.spelled);
    let dying = async move {
        loop {
            let (stream, _) = within(listener.accept()).await.unwrap();
            let mut first = [0];
            let probed = conversation.carrier.protocol.payload_kind().are_binary()
                && within(stream.peek(&mut first)).await.is_ok()
                && first == *b"C";
            // The probe of the wire version gets no answer.
            if !probed {
                let holding = conversation.hold_at(Some(&listener), stream, cut);
                holding.await.die(death);
                return;
            }
        }
    };
    (contact, dying)
}

/// Connects to a reader that dies at `cut`, and writes to it.
async fn write_to_dying(
    writer: &Port,
    content: &Bottle,
    conversation: &Conversation,
    cut: usize,
    death: Death,
) {
    let (contact, dying) = dying_listener(conversation, cut, death).await;
    let writing = async {
        match within(writer.connect(&contact)).await {
            Ok(()) => {
                within(writer.write(content)).await;
                if conversation.says_goodbye() {
                    within(writer.disconnect(NAME)).await;
                }
            }
            Err(error) => lost(&error, conversation, cut),
        }
    };
    tokio::join!(dying, writing);
    if conversation.carrier.connectionless {
        within(writer.disconnect(NAME)).await;
    }
    until(|| writer.outputs() == ["/keeps"]).await;
}

/// Runs a name server that assigns all ports the same group, and counts its holders.
async fn name_server(listener: TcpListener, given_away: Arc<AtomicUsize>) {
    // A number that nobody has now, so that nothing arrives anywhere.
    let free = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
    let number = free.local_addr().unwrap().port();
    let given = format!("registration name /group ip 239.255.77.1 port {number} type mcast\r\n");
    let answer = given + "*** end of message\r\n";
    loop {
        let (mut stream, _) = listener.accept().await.unwrap();
        let mut request = Vec::new();
        while let Ok(byte) = stream.read_u8().await
            && byte != b'\n'
        {
            request.push(byte);
        }
        let request = String::from_utf8_lossy(&request);
        if request.contains(" unregister ") {
            given_away.fetch_sub(1, Ordering::Relaxed);
        } else if request.contains(" register ") {
            given_away.fetch_add(1, Ordering::Relaxed);
        }
        let _ = stream.write_all(answer.as_bytes()).await;
    }
}

/// Returns the port connects to the peer.
async fn a_port_that_writes(phase: &str) -> usize {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let number = listener.local_addr().unwrap().port();
    let groups = Arc::default();
    let serving = tokio::spawn(name_server(listener, Arc::clone(&groups)));
    let network = network(phase).with_server("127.0.0.1", number);
    let (writer, keeps) = writer_and_reader(&network).await;
    let rest = Rest::now();
    let content = bottle("whole 1 2");
    let mut count = 0;
    let readers = conversation::readers("/writer", &content);
    for conversation in in_phase(phase, Side::Listens, readers) {
        for (cut, death) in deaths(&conversation, phase) {
            write_to_dying(&writer, &content, &conversation, cut, death).await;
            count += 1;
            still_reaches(&writer, &keeps, count).await;
        }
    }
    rest.comes_back().await;
    assert_eq!(groups.load(Ordering::Relaxed), 0, "kept groups");
    serving.abort();
    within(writer.close()).await;
    within(keeps.close()).await;
    count
}

/// A peer that is gone is told at once, not when patience ends.
#[track_caller]
fn lost(error: &PortError, conversation: &Conversation, cut: usize) {
    let expected = matches!(
        error,
        PortError::Lost { .. }
            | PortError::Connect { .. }
            | PortError::Protocol { .. }
            | PortError::Authentication {
                source: AuthFailure::Ended,
                ..
            }
    );
    assert!(expected, "{error:?} {conversation:?} {cut}");
}

async fn a_port_that_calls(phase: &str) -> usize {
    let (question, answer) = (bottle("how much"), bottle("just 42"));
    let client = open(&network(phase), "/client", PortOptions::new().rpc_client()).await;
    let rest = Rest::now();
    let mut count = 0;
    let servers = conversation::servers("/client", &question, &answer);
    for conversation in in_phase(phase, Side::Listens, servers) {
        for (cut, death) in deaths(&conversation, phase) {
            let (contact, dying) = dying_listener(&conversation, cut, death).await;
            let calling = async {
                within(client.connect(&contact)).await?;
                within(client.call::<Bottle>(&question)).await
            };
            match tokio::join!(dying, calling).1 {
                Ok(got) => assert_eq!(got, answer, "{conversation:?} {cut}"),
                Err(PortError::NotConnected { .. }) => {}
                Err(error) => lost(&error, &conversation, cut),
            }
            count += 1;
            until(|| client.outputs().is_empty()).await;
        }
    }
    rest.comes_back().await;
    within(client.close()).await;
    count
}

/// Returns the port connects to a camera.
async fn a_port_that_pulls(phase: &str) -> usize {
    let network = network(phase);
    let reading = PortOptions::new().queue(Queue::Wait(10));
    let reader = open(&network, "/reader", reading).await;
    let good = open(&network, "/good", PortOptions::new()).await;
    connect(&good, &reader, "tcp").await;
    until(|| reader.inputs() == ["/good"]).await;
    let rest = Rest::now();
    let mut picture = Vec::new();
    let encoder = jpeg_encoder::Encoder::new(&mut picture, 50);
    let colour = jpeg_encoder::ColorType::Luma;
    encoder.encode(&[100; 64], 8, 8, colour).unwrap();
    let mut count = 0;
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let number = listener.local_addr().unwrap().port();
    let cameras = vec![conversation::camera(number, &picture)];
    let camera = in_phase(phase, Side::Listens, cameras).remove(0);
    for (cut, death) in deaths(&camera, phase) {
        let dying = async {
            let (stream, _) = within(listener.accept()).await.unwrap();
            camera.hold(stream, cut).await.die(death);
        };
        let contact = format!("mjpeg://127.0.0.1:{number}{NAME}");
        match tokio::join!(dying, within(reader.connect(&contact))).1 {
            Ok(()) => {}
            Err(error) => lost(&error, &camera, cut),
        }
        count += 1;
        until(|| reader.inputs() == ["/good"]).await;
        let message = Bottle::of(count as i32);
        assert_eq!(within(good.write(&message)).await, 1);
        loop {
            let read = within(reader.read()).await.unwrap();
            if *read.from == *"/good" {
                assert_eq!(read.bottle().unwrap(), message);
                break;
            }
            assert_eq!(read.read::<Image>().unwrap().width(), 8);
        }
    }
    drop(listener);
    rest.comes_back().await;
    within(good.close()).await;
    within(reader.close()).await;
    count
}
