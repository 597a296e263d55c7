//! WebSocket frames: the same stream for any split, answers to pings, and refused frames.

use bytes::{BufMut, BytesMut};
use proptest::prelude::*;
use yarp_wire::carrier::Carrier;
use yarp_wire::connection::{Acceptor, Event, Message, Progress, ProtocolError};
use yarp_wire::message::Command;
use yarp_wire::websocket::{FrameReader, WebSocketError, put_frame_head};
use yarp_wire::{Bottle, Limits, WireVersion};

const REQUEST: &str = "GET /?ws HTTP/1.1\r\nHost: localhost\r\nUpgrade: WebSocket\r\n\
    Connection: Upgrade\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\
    Sec-WebSocket-Version: 13\r\n\r\n";
const RESPONSE: &str = "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\n\
    Connection: Upgrade\r\nSec-WebSocket-Accept: s3pPLMBiTxaQ9kYGzzhZRbK+xOo=\r\n\r\n";
const LIMIT: usize = 1 << 20;

/// Returns a frame as a browser sends it: masked.
fn frame(first: u8, body: &[u8]) -> Vec<u8> {
    let mut out = BytesMut::new();
    put_frame_head(&mut out, body.len());
    out[0] = first;
    out[1] |= 0x80;
    let mask = [0x12, 0x34, 0x56, 0x78];
    out.put_slice(&mask);
    out.extend(body.iter().zip(mask.iter().cycle()).map(|(a, b)| a ^ b));
    out.to_vec()
}

/// Stream and answers of frames that arrive in these pieces.
fn read<'a>(
    pieces: impl IntoIterator<Item = &'a [u8]>,
) -> Result<(Vec<u8>, Vec<u8>, bool), WebSocketError> {
    let mut reader = FrameReader::new(LIMIT);
    let (mut input, mut output) = (BytesMut::new(), BytesMut::new());
    for piece in pieces {
        input.extend_from_slice(piece);
        reader.read(&mut input, &mut output)?;
    }
    let closed = reader.is_closed();
    Ok((reader.stream.to_vec(), output.to_vec(), closed))
}

proptest! {
    #[test]
    fn any_split_gives_the_same_stream(
        bodies in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..300), 1..4),
        ping in prop::collection::vec(any::<u8>(), 0..126),
    ) {
        // One message in pieces, with a ping between them.
        let mut bytes = Vec::new();
        for (index, body) in bodies.iter().enumerate() {
            let kind = if index == 0 { 1 } else { 0 };
            let last = if index + 1 == bodies.len() { 0x80 } else { 0 };
            bytes.extend(frame(kind | last, body));
            bytes.extend(frame(0x89, &ping));
        }
        bytes.extend(frame(0x82, b"end"));
        let expected = [bodies.concat(), b"end".to_vec()].concat();
        let (stream, output, closed) = read([&bytes[..]]).unwrap();
        prop_assert_eq!(&stream, &expected);
        prop_assert!(!closed);
        let pong = [&[0x8a, ping.len() as u8], &ping[..]].concat();
        prop_assert_eq!(&output, &pong.repeat(bodies.len()));
        for cut in 0..bytes.len() {
            let (a, b) = bytes.split_at(cut);
            prop_assert_eq!(read([a, b]).unwrap(), (stream.clone(), output.clone(), false));
        }
        prop_assert_eq!(read(bytes.chunks(1)).unwrap(), (stream, output, false));
    }

    #[test]
    fn any_bytes_are_survived(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let _ = read([&bytes[..]]);
        let mut acceptor = Acceptor::new(1, WireVersion::V3, Limits::DEFAULT);
        let (mut input, mut output) = (BytesMut::from(REQUEST), BytesMut::new());
        input.extend_from_slice(&bytes);
        while let Ok(Some(_)) = acceptor.poll(&mut input, &mut output) {}
        input = BytesMut::from(REQUEST);
        input.extend(frame(0x82, &bytes));
        acceptor = Acceptor::new(1, WireVersion::V3, Limits::DEFAULT);
        while let Ok(Some(_)) = acceptor.poll(&mut input, &mut output) {}
    }
}

#[test]
fn malformed_frames_end_it() {
    use WebSocketError::*;
    let check = |bytes: &[u8], expected: WebSocketError| {
        assert_eq!(read([bytes]), Err(expected), "{bytes:02x?}");
        assert_eq!(read(bytes.chunks(1)), Err(expected));
    };
    check(b"\x82\x02ab", Unmasked);
    check(&frame(0xc2, b""), Extension);
    check(&frame(0x92, b""), Extension);
    check(&frame(0x83, b""), Kind { kind: 3 });
    check(&frame(0x8b, b""), Kind { kind: 0xb });
    check(&frame(0x80, b"a"), Order);
    check(&[frame(0x02, b"a"), frame(0x82, b"b")].concat(), Order);
    check(&[frame(0x82, b"a"), frame(0x80, b"b")].concat(), Order);
    check(&frame(0x09, b"a"), Control);
    check(&frame(0x89, &[0; 126]), Control);
    check(&frame(0x88, &[0; 126]), Control);
    let limit = LIMIT;
    for length in [LIMIT as u64 + 1, 1 << 40, u64::MAX] {
        let bytes = [&b"\x82\xff"[..], &length.to_be_bytes()].concat();
        check(&bytes, TooLarge { length, limit });
    }
}

#[test]
fn a_close_frame_ends_the_stream() {
    let bytes = [
        frame(0x82, b"a"),
        frame(0x88, b"\x03\xe9bye"),
        frame(0x82, b"b"),
    ]
    .concat();
    let expected = (b"a".to_vec(), b"\x88\x02\x03\xe9".to_vec(), true);
    assert_eq!(read([&bytes[..]]), Ok(expected));
    assert_eq!(
        read([&frame(0x88, b"")[..]]),
        Ok((vec![], b"\x88\x00".to_vec(), true))
    );
}

fn block(letter: u8) -> [u8; 8] {
    [0, 0, 0, 0, b'~', letter, 0, 1]
}

/// Command blocks and payloads in sequence are messages, independent of the frames.
#[test]
fn messages_are_read_and_answered() {
    let question = Bottle::parse("how \"much\" 1").unwrap();
    let content = question.encode(WireVersion::V3);
    let stream = [
        &block(b'd')[..],
        &content,
        &block(b'D'),
        &content,
        &block(b'r'),
    ]
    .concat();
    for size in [1, 3, 8, 100] {
        let mut bytes = REQUEST.as_bytes().to_vec();
        for piece in stream.chunks(size) {
            bytes.extend(frame(0x81, piece));
        }
        for step in [1, 7, bytes.len()] {
            let mut acceptor = Acceptor::new(1, WireVersion::V3, Limits::DEFAULT);
            let (mut input, mut output) = (BytesMut::new(), BytesMut::new());
            let mut messages = Vec::new();
            for piece in bytes.chunks(step) {
                input.extend_from_slice(piece);
                while let Some(event) = acceptor.poll(&mut input, &mut output).unwrap() {
                    match event {
                        Event::Opened {
                            carrier, sender, ..
                        } => {
                            assert_eq!((carrier.name, &sender.name[..]), ("websocket", "web"));
                            assert_eq!(output.split(), RESPONSE);
                        }
                        Event::Message(message) => messages.push(message),
                        Event::HttpRequest(request) => panic!("{request:?}"),
                    }
                }
            }
            let commands: Vec<Command> = messages.iter().map(|m| m.command.clone()).collect();
            let expected = [Command::data(true), Command::data(false), Command::Reverse];
            assert_eq!(commands, expected);
            assert_eq!(messages[1].payload.to_bottle().unwrap(), question);
            acceptor.reply(&question, &mut output);
            let head = [0x82, content.len() as u8];
            assert_eq!(output.split(), [&head[..], &content].concat());
            // The page reads from now on: block and payload are a frame each.
            let mut writing = acceptor.into_initiator().unwrap();
            writing.send(&Command::data(false), content.len(), &mut output);
            let expected = [&[0x82, 8][..], &block(b'D'), &head].concat();
            assert_eq!(output.split(), expected);
            let mut input = BytesMut::from(&frame(0x89, b"hi")[..]);
            assert_eq!(writing.poll(&mut input), Ok(None));
            assert_eq!(writing.take_output(), b"\x8a\x02hi".as_slice());
            writing.send(&Command::data(true), content.len(), &mut output);
            input.extend(frame(0x82, &content));
            let reply = writing.poll(&mut input).unwrap();
            assert!(matches!(reply, Some(Progress::Reply(p)) if *p.bytes() == content));
            input.extend(frame(0x88, b""));
            let closed = ProtocolError::WebSocket(WebSocketError::Closed);
            assert_eq!(writing.poll(&mut input), Err(closed));
        }
    }
}

/// The answers of a page that read crossed the goodbye of its port, and were answered in turn.
#[test]
fn nothing_is_sent_after_a_close_frame() {
    let mut acceptor = Acceptor::new(1, WireVersion::V3, Limits::DEFAULT);
    let (mut input, mut output) = (BytesMut::from(REQUEST), BytesMut::new());
    input.extend(frame(0x82, &block(b'r')));
    while acceptor.poll(&mut input, &mut output).unwrap().is_some() {}
    let mut writing = acceptor.into_initiator().unwrap();
    output.clear();
    writing.send(&Command::Quit, 0, &mut output);
    assert!(output.ends_with(b"\x88\x02\x03\xe8"));
    input.extend(frame(0x89, b"hi"));
    assert_eq!(writing.poll(&mut input), Ok(None));
    assert_eq!(writing.take_output(), b"".as_slice());
    input.extend(frame(0x88, b"\x03\xe8"));
    let closed = ProtocolError::WebSocket(WebSocketError::Closed);
    assert_eq!(writing.poll(&mut input), Err(closed));
    assert_eq!(writing.take_output(), b"".as_slice());
}

#[test]
fn a_close_frame_is_the_command_to_quit() {
    let mut acceptor = Acceptor::new(1, WireVersion::V3, Limits::DEFAULT);
    let (mut input, mut output) = (BytesMut::from(REQUEST), BytesMut::new());
    input.extend(frame(0x88, b""));
    acceptor.poll(&mut input, &mut output).unwrap().unwrap();
    output.clear();
    let event = acceptor.poll(&mut input, &mut output).unwrap();
    let Some(Event::Message(Message { command, .. })) = event else {
        panic!("{event:?}");
    };
    assert_eq!(command, Command::Quit);
    assert_eq!(output, b"\x88\x00".as_slice());
}

#[test]
fn a_request_without_a_key_is_refused() {
    for text in [
        REQUEST.replace("Upgrade: WebSocket", "Upgrade: h2c"),
        REQUEST.replace("dGhl", "dG"),
        "GET /?ws HTTP/1.1\r\n\r\n".to_owned(),
    ] {
        let mut acceptor = Acceptor::new(1, WireVersion::V3, Limits::DEFAULT);
        let (mut input, mut output) = (BytesMut::from(&text[..]), BytesMut::new());
        let error = acceptor.poll(&mut input, &mut output).unwrap_err();
        assert_eq!(error, ProtocolError::WebSocket(WebSocketError::Handshake));
        assert!(output.starts_with(b"HTTP/1.1 400 Bad Request\r\n"));
    }
    assert!(Carrier::by_name("websocket").is_some());
}

/// Regression: a message was lost if a malformed frame was in the same packet, and not if it came
/// later.
#[test]
fn a_message_before_a_malformed_frame_is_read() {
    let mut acceptor = Acceptor::new(1, WireVersion::V3, Limits::DEFAULT);
    let (mut input, mut output) = (BytesMut::from(REQUEST), BytesMut::new());
    acceptor.poll(&mut input, &mut output).unwrap().unwrap();
    let content = Bottle::of("good").encode(WireVersion::V3);
    input.extend(frame(0x82, &[&block(b'D')[..], &content].concat()));
    input.extend(frame(0xc2, b""));
    let event = acceptor.poll(&mut input, &mut output).unwrap();
    let Some(Event::Message(message)) = event else {
        panic!("{event:?}");
    };
    assert_eq!(message.payload.to_bottle().unwrap(), Bottle::of("good"));
    let error = acceptor.poll(&mut input, &mut output).unwrap_err();
    assert_eq!(error, ProtocolError::WebSocket(WebSocketError::Extension));
}

/// Its string was searched from the beginning with each frame, and could have 4 MB: 96 kB of empty frames behind
/// it took 50 s.
#[test]
fn a_command_that_does_not_end_is_refused() {
    let mut acceptor = Acceptor::new(1, WireVersion::V3, Limits::DEFAULT);
    let (mut input, mut output) = (BytesMut::from(REQUEST), BytesMut::new());
    acceptor.poll(&mut input, &mut output).unwrap().unwrap();
    input.extend(frame(0x02, b"\0\0\0\0~\0\0\x01"));
    let mut frames = 0;
    let error = loop {
        input.extend(frame(0x00, &[b'D'; 64]));
        match acceptor.poll(&mut input, &mut output) {
            Ok(None) => frames += 1,
            Ok(event) => panic!("{event:?}"),
            Err(error) => break error,
        }
    };
    assert!(matches!(error, ProtocolError::Command(_)), "{error:?}");
    assert_eq!(frames, 4096 / 64);
}

#[test]
fn a_close_frame_is_reported_once() {
    // Regression: it was reported again at each poll.
    let mut acceptor = Acceptor::new(1, WireVersion::V3, Limits::DEFAULT);
    let (mut input, mut output) = (BytesMut::from(REQUEST), BytesMut::new());
    input.extend(frame(0x88, b""));
    let mut events = Vec::new();
    while let Some(event) = acceptor.poll(&mut input, &mut output).unwrap() {
        events.push(event);
        assert!(events.len() <= 2, "{events:?}");
    }
    assert_eq!(events.len(), 2, "{events:?}");
}
