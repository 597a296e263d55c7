//! Input that lies about its lengths, ends early, goes too deep or makes no sense is refused
//! without a panic, and costs no more memory than was really sent.

mod counting;

use bytes::{Bytes, BytesMut};
use counting::most_held;
use yarp_wire::bottle::{DecodeError, TextError, detect};
use yarp_wire::carrier::{Carrier, Sender};
use yarp_wire::connection::{Acceptor, Initiator, ProtocolError};
use yarp_wire::message::{Command, CommandError, Index, IndexError};
use yarp_wire::{Bottle, Contact, Limits, PortName, Stamp, WireVersion};

const DIALECTS: [WireVersion; 2] = [WireVersion::V3, WireVersion::V4];
/// Bytes that a parser may allocate beyond twice its input.
const SLACK: usize = 64 * 1024;

/// Runs a parser over `sent` bytes and checks its peak allocation.
#[track_caller]
fn frugal<T>(sent: usize, work: impl FnOnce() -> T) -> T {
    let (result, held) = most_held(work);
    let allowed = 2 * sent + SLACK;
    assert!(
        held <= allowed,
        "held {held} bytes for {sent} that were sent"
    );
    result
}

/// 32-bit numbers as they travel.
fn words(numbers: &[i32]) -> Bytes {
    numbers
        .iter()
        .flat_map(|number| number.to_le_bytes())
        .collect()
}

/// Checks that no wire version reads `bytes`, whole or with any tail.
#[track_caller]
fn refused(bytes: &Bytes) -> DecodeError {
    let mut first = None;
    for wire_version in DIALECTS {
        let error = frugal(bytes.len(), || {
            Bottle::decode(bytes, wire_version, Limits::DEFAULT)
        });
        first.get_or_insert(error.expect_err("it reads"));
        frugal(bytes.len(), || {
            Bottle::decode_any(bytes, wire_version, Limits::DEFAULT)
        })
        .unwrap_err();
    }
    assert_eq!(frugal(bytes.len(), || detect(bytes, Limits::DEFAULT)), None);
    first.expect("two wire_versions were tried")
}

#[test]
fn lying_counts_and_lengths_cost_nothing() {
    for lie in [1000, 1 << 20, 1 << 28, i32::MAX] {
        for list in [
            256,
            257,
            256 + 4,
            256 + 9,
            256 + 12,
            256 + 17,
            256 + 32,
            256 + 64,
        ] {
            refused(&words(&[list, lie]));
            refused(&words(&[list, lie, 0]));
        }
        // A string, a blob, a nested list and a dictionary inside a list of one.
        refused(&words(&[256, 1, 4, lie, 0x6161]));
        refused(&words(&[256, 1, 12, lie, 0x6161]));
        refused(&words(&[260, 1, lie]));
        refused(&words(&[268, 1, lie]));
        refused(&words(&[256, 1, 256, lie, 1]));
        refused(&words(&[256, 1, 257, lie, 1]));
        refused(&words(&[256, 1, 768, 256, lie, 1]));
    }
}

#[test]
fn negative_lengths_are_refused_and_negative_counts_are_none() {
    for lie in [-1, -2, i32::MIN] {
        for item in [4, 12] {
            let error = refused(&words(&[256, 1, item, lie]));
            assert_eq!(
                error,
                DecodeError::NegativeLength {
                    length: lie,
                    at: 12
                }
            );
            let error = refused(&words(&[256 + item, 1, lie]));
            assert_eq!(error, DecodeError::NegativeLength { length: lie, at: 8 });
        }
        for list in [256, 257, 260] {
            let bytes = words(&[list, lie]);
            let read = Bottle::decode(&bytes, WireVersion::V3, Limits::DEFAULT);
            assert_eq!(read, Ok(Bottle::new()));
        }
    }
}

#[test]
fn unknown_codes_are_refused() {
    for code in [2, 3, 5, 8, 89, 127, 255, 512, 1024, 0x4159, -1, i32::MIN] {
        let error = refused(&words(&[256, 1, code, 0, 0, 0]));
        assert!(
            matches!(error, DecodeError::UnknownCode { at: 8, .. }),
            "{code}: {error}"
        );
    }
    for list in [256 + 2, 256 + 3, 256 + 89, 0x4159] {
        let error = refused(&words(&[list, 1, 0, 0]));
        assert!(
            matches!(error, DecodeError::UnknownCode { at: 0, .. }),
            "{list}: {error}"
        );
    }
    // Each wire version refuses what only the other has.
    let read = |bytes: &Bytes, wire_version| Bottle::decode(bytes, wire_version, Limits::DEFAULT);
    assert!(read(&words(&[256, 1, 128, 0]), WireVersion::V4).is_err());
    assert!(read(&words(&[256, 1, 20, 0, 0]), WireVersion::V3).is_err());
    assert!(read(&words(&[256, 1, 18, 0, 0]), WireVersion::V3).is_err());
}

/// A bottle with something behind it was read whole before it was refused: 40 times its bytes.
#[test]
fn trailing_bytes_are_refused_before_decoding() {
    let mut bytes = BytesMut::from(&words(&[256 + 32, 1 << 20])[..]);
    bytes.extend_from_slice(&vec![7; (1 << 20) + 1]);
    let error = refused(&bytes.freeze());
    assert_eq!(
        error,
        DecodeError::Trailing {
            length: 8 + (1 << 20),
            extra: 1
        }
    );
}

#[test]
fn a_message_above_the_limit_is_refused_while_it_is_short() {
    let limits = Limits::DEFAULT.with_message(1000);
    for bytes in [
        words(&[257, 249]),
        words(&[256, 1, 4, 1000]),
        words(&[256, 1, 12, i32::MAX]),
    ] {
        let error = Bottle::decode(&bytes, WireVersion::V3, limits);
        assert_eq!(error, Err(DecodeError::TooLong { limit: 1000 }));
    }
}

#[test]
fn a_million_nested_lists_are_refused() {
    for level in [&[256, 1][..], &[256, 1, 768]] {
        let bytes = words(&level.repeat(1_000_000));
        assert_eq!(refused(&bytes), DecodeError::TooDeep { limit: 200 });
    }
    for (open, close) in [("(", ")"), ("({", "})")] {
        let text = open.repeat(1_000_000) + &close.repeat(1_000_000);
        let read = frugal(text.len(), || Bottle::parse(&text));
        assert_eq!(read, Err(TextError::TooDeep { limit: 200 }));
    }
    // Open brackets and quotes are dropped, as in stock.
    for text in [
        "(".repeat(1_000_000),
        ")".repeat(1_000_000),
        "\"(".repeat(500_001),
    ] {
        let read = frugal(text.len(), || Bottle::parse(&text));
        assert_eq!(read, Ok(Bottle::new()));
    }
}

/// Feeds `bytes` to an acceptor; returns the number of events and the first error.
fn accept(bytes: &[u8], limits: Limits) -> (usize, Option<ProtocolError>) {
    let mut input = BytesMut::from(bytes);
    let mut output = BytesMut::new();
    frugal(bytes.len(), || {
        let mut acceptor = Acceptor::new(10002, WireVersion::V3, limits);
        let mut events = 0;
        loop {
            match acceptor.poll(&mut input, &mut output) {
                Ok(Some(_)) => events += 1,
                Ok(None) => return (events, None),
                Err(error) => return (events, Some(error)),
            }
        }
    })
}

#[test]
fn a_header_that_ends_early_is_waited_for() {
    for header in [
        &b"YA\xe4\x1e\0\0RP\x04\0\0\0/wr\0"[..],
        b"CONNECT /wr\r\n",
        b"CONNACK /wr\r\n",
    ] {
        for end in 0..header.len() {
            assert_eq!(accept(&header[..end], Limits::DEFAULT), (0, None));
        }
        assert_eq!(accept(header, Limits::DEFAULT), (1, None));
    }
}

#[test]
fn garbage_magic_is_refused() {
    for magic in [
        *b"GARBAGE!",
        *b"PUT / HT",
        *b"\0\0\0\0\0\0\0\0",
        *b"YA\0\0\0\0RP",
        *b"YA\0\0\0\x80RP",
        *b"YA\xfe\xff\xff\x7fRP",
        *b"YA\xe4\x1e\0\0RX",
        *b"connect ",
        *b"\xff\xff\xff\xff\xff\xff\xff\xff",
    ] {
        for end in 0..8 {
            assert_eq!(accept(&magic[..end], Limits::DEFAULT), (0, None));
        }
        let refused = (0, Some(ProtocolError::UnknownCarrier { magic }));
        assert_eq!(accept(&magic, Limits::DEFAULT), refused);
    }
}

#[test]
fn an_impossible_sender_length_is_refused() {
    for length in [0, -1, i32::MIN, 4097, 1 << 30, i32::MAX] {
        let mut bytes = b"YA\xe4\x1e\0\0RP".to_vec();
        bytes.extend_from_slice(&length.to_le_bytes());
        let (events, error) = accept(&bytes, Limits::DEFAULT);
        assert_eq!(events, 0);
        assert!(
            matches!(error, Some(ProtocolError::SenderLength { length: l, .. }) if l == length),
            "{error:?}"
        );
    }
}

#[test]
fn a_sender_without_its_zero_or_with_zeros_inside_is_taken_to_the_first() {
    for (name, expected) in [(&b"/wr"[..], "/wr"), (b"/w\0r", "/w"), (b"\0\0\0\0", "")] {
        let mut input = BytesMut::from(&b"YA\xe4\x1e\0\0RP"[..]);
        input.extend_from_slice(&(name.len() as i32).to_le_bytes());
        input.extend_from_slice(name);
        let mut acceptor = Acceptor::new(10002, WireVersion::V3, Limits::DEFAULT);
        let event = acceptor.poll(&mut input, &mut BytesMut::new()).unwrap();
        let Some(yarp_wire::connection::Event::Opened { sender, .. }) = event else {
            panic!("no header");
        };
        assert_eq!(sender, Sender::plain(expected));
    }
}

#[test]
fn a_line_without_end_is_refused_at_its_limit() {
    let limits = Limits::DEFAULT.with_line(100_000);
    let endless = "x".repeat(1 << 20);
    for (start, events) in [
        ("CONNECT ", 0),
        ("CONNECT a\r\n", 1),
        ("CONNECT a\r\nd\r\n", 1),
        ("CONNACK a\r\nd\r\n\"", 1),
        ("NAME_SERVER ", 1),
    ] {
        let (count, error) = accept((start.to_owned() + &endless).as_bytes(), limits);
        assert_eq!(count, events, "{start:?}");
        assert!(
            matches!(error, Some(ProtocolError::LineTooLong { .. })),
            "{start:?} {error:?}"
        );
    }
}

#[test]
fn a_text_that_is_never_closed_is_refused_at_its_limit() {
    let limits = Limits::DEFAULT.with_line(100_000);
    for line in ["(\r\n", "\"\r\n\"", "a\\\\\\\r\n", "({\"\r\n", "()(\n"] {
        let text = "CONNECT a\r\nd\r\n(".to_owned() + &line.repeat(100_000);
        let (_, error) = accept(text.as_bytes(), limits);
        assert!(
            matches!(error, Some(ProtocolError::LineTooLong { .. })),
            "{line:?} {error:?}"
        );
    }
}

/// A text that goes on over more lines was held twice over.
#[test]
fn a_text_that_is_not_closed_yet_is_held_once() {
    let open = "CONNECT a\r\nd\r\n(".to_owned() + &"x".repeat(1 << 20) + "\r\n";
    assert_eq!(accept(open.as_bytes(), Limits::DEFAULT), (1, None));
    let lines = "CONNECT a\r\nd\r\n(".to_owned() + &"some more\r\n".repeat(100_000);
    assert_eq!(accept(lines.as_bytes(), Limits::DEFAULT), (1, None));
    for carrier in ["text", "text_ack"] {
        assert_eq!(
            await_reply(carrier, &open.as_bytes()[14..], Limits::DEFAULT),
            Ok(0)
        );
    }
}

#[test]
fn zero_bytes_in_text_are_dropped() {
    let (events, error) = accept(
        b"CONNECT \0a\0\r\n\0d\0\r\0\n\x001 \0\x002\0\r\n\0",
        Limits::DEFAULT,
    );
    assert_eq!((events, error), (2, None));
    let (events, error) = accept(
        &[b"CONNECT ", &[0; 1 << 20][..]].concat(),
        Limits::DEFAULT.with_line(1000),
    );
    assert_eq!(events, 0);
    assert!(error.is_none_or(|error| matches!(error, ProtocolError::LineTooLong { .. })));
}

/// Returns the header of a tcp connection, then `index`.
fn indexed(len: u8, out: u8, lengths: &[i32], rest: &[u8]) -> Vec<u8> {
    let mut bytes = b"YA\xe4\x1e\0\0RP\x04\0\0\0/wr\0YA\x0a\0\0\0RP".to_vec();
    bytes.extend_from_slice(&[len, out, 255, 255, 255, 255, 255, 255, 255, 255]);
    bytes.extend_from_slice(&words(lengths));
    bytes.extend_from_slice(rest);
    bytes
}

const DATA: &[u8] = b"\0\0\0\0~D\0\x01\x01\x01\0\0\x01\0\0\0\x2a\0\0\0";

#[test]
fn an_index_may_have_any_number_of_blocks() {
    let total = DATA.len() as i32;
    for (len, out) in [(1, 0), (1, 1), (0, 1), (255, 0), (0, 255), (255, 255)] {
        let blocks = usize::from(len) + usize::from(out);
        let mut lengths = vec![0; blocks];
        lengths[blocks / 2] = total;
        let bytes = indexed(len, out, &lengths, DATA);
        assert_eq!(accept(&bytes, Limits::DEFAULT), (2, None), "{len} {out}");
        for end in 16..bytes.len() {
            assert_eq!(
                accept(&bytes[..end], Limits::DEFAULT),
                (1, None),
                "{len} {out} {end}"
            );
        }
    }
}

#[test]
fn a_lying_index_is_refused_or_waited_for() {
    let wait = |bytes: Vec<u8>| assert_eq!(accept(&bytes, Limits::DEFAULT), (1, None));
    wait(indexed(2, 1, &[8, 1 << 29, 0], b"\0\0\0\0~D\0\x01"));
    wait(indexed(255, 255, &[1; 509], b""));
    let refused = |bytes: Vec<u8>| accept(&bytes, Limits::DEFAULT).1.expect("an error");
    for lie in [-1, i32::MIN] {
        let error = refused(indexed(2, 1, &[8, lie, 0], b""));
        assert_eq!(error, IndexError::NegativeLength { length: lie }.into());
    }
    for lengths in [
        [i32::MAX, 0, 0],
        [1 << 30, 1, 0],
        [0, 1 << 29, (1 << 29) + 1],
    ] {
        let error = refused(indexed(2, 1, &lengths, b""));
        assert!(
            matches!(error, ProtocolError::Index(IndexError::TooLong { .. })),
            "{error}"
        );
    }
    let all = refused(indexed(255, 255, &[i32::MAX; 510], b""));
    assert!(
        matches!(all, ProtocolError::Index(IndexError::TooLong { .. })),
        "{all}"
    );
    // No bytes at all, or too few for the command block.
    for (lengths, rest) in [
        ([0, 0, 0], &b""[..]),
        ([7, 0, 0], b"\0\0\0\0~D\0"),
        ([8, 0, 0], b"\0\0\0\0!D\0\x01"),
    ] {
        let error = refused(indexed(2, 1, &lengths, rest));
        assert!(
            matches!(error, ProtocolError::Command(CommandError { .. })),
            "{error}"
        );
    }
    for magic in [b"YA\x0b\0\0\0RP", b"YA\xff\xff\xff\xffRP", b"GARBAGE!"] {
        let bytes = [&b"YA\xe4\x1e\0\0RP\x04\0\0\0/wr\0"[..], magic].concat();
        assert_eq!(refused(bytes), IndexError::NoIndex { got: *magic }.into());
    }
    assert_eq!(Index::read(&[], 10), Ok(None));
}

#[test]
fn a_command_block_that_lies_about_its_string_is_taken_to_its_zero() {
    // Stock does not look at the length in front either.
    for length in [0, 1, 2, 1000, -1, i32::MAX] {
        let mut block = length.to_le_bytes().to_vec();
        block.extend_from_slice(b"~\0\0\x01q\0");
        assert_eq!(Command::read(&block.into()), Ok((Command::Quit, 10)));
    }
    assert!(Command::read(&Bytes::from_static(b"\x02\0\0\0~\0\0\x01qqqq")).is_err());
}

/// Returns an initiator that waits for a reply and has read `bytes`.
fn await_reply(carrier: &str, bytes: &[u8], limits: Limits) -> Result<usize, ProtocolError> {
    await_answer(carrier, &Command::data(true), bytes, limits)
}

/// Returns the initiator's result for this answer.
fn await_answer(
    carrier: &str,
    command: &Command,
    bytes: &[u8],
    limits: Limits,
) -> Result<usize, ProtocolError> {
    let carrier = Carrier::by_name(carrier).unwrap();
    let mut initiator = Initiator::established(carrier, WireVersion::V3, limits);
    initiator.send(command, 0, &mut BytesMut::new());
    let mut input = BytesMut::from(bytes);
    frugal(bytes.len(), || {
        let mut steps = 0;
        while initiator.poll(&mut input)?.is_some() {
            steps += 1;
        }
        Ok(steps)
    })
}

#[test]
fn a_lying_reply_is_refused_or_waited_for() {
    let reply = |bytes: &[u8]| await_reply("tcp", bytes, Limits::DEFAULT);
    assert_eq!(reply(&words(&[257, 1 << 20, 1])), Ok(0));
    assert!(reply(&words(&[257, i32::MAX])).is_err());
    assert!(reply(&words(&[256, 1, 4, -1])).is_err());
    assert!(reply(&words(&[256, 1, 89, 0])).is_err());
    assert!(reply(&words(&[256, 1].repeat(1000))).is_err());
    // A whole reply, then no acknowledgement.
    let garbage = [&words(&[257, 1, 42])[..], b"GARBAGE!"].concat();
    assert!(matches!(
        reply(&garbage),
        Err(ProtocolError::Acknowledgement { .. })
    ));
    for discard in [-1, i32::MAX] {
        let mut bytes = words(&[257, 1, 42]).to_vec();
        bytes.extend_from_slice(&yarp_wire::framed_number::encode(discard));
        assert!(matches!(
            reply(&bytes),
            Err(ProtocolError::Acknowledgement { .. })
        ));
    }
    // There was no request.
    let extra = [&words(&[257, 1, 42])[..], &[7; 8]].concat();
    let error = await_reply("fast_tcp", &extra, Limits::DEFAULT);
    assert_eq!(error, Err(ProtocolError::Unexpected { count: 8 }));
}

#[test]
fn an_endless_text_reply_is_refused_at_its_limit() {
    let limits = Limits::DEFAULT.with_line(100_000);
    for piece in ["x", "(\r\n", "\r\n", "a\\\n"] {
        let text = "\"".to_owned() + &piece.repeat(1 << 18);
        for carrier in ["text", "text_ack"] {
            let error = await_reply(carrier, text.as_bytes(), limits);
            assert_eq!(
                error,
                Err(ProtocolError::LineTooLong { limit: 100_000 }),
                "{piece:?}"
            );
        }
    }
}

/// Empty lines were counted as nothing.
#[test]
fn endless_lines_are_refused_at_their_limit() {
    let limits = Limits::DEFAULT.with_line(100_000);
    for line in ["\r\n", "x\r\n", "some more\r\n"] {
        let text = line.repeat(1 << 18);
        // Over `text` nobody waits for lines.
        assert_eq!(
            await_answer("text_ack", &Command::Describe, text.as_bytes(), limits),
            Err(ProtocolError::LineTooLong { limit: 100_000 }),
            "{line:?}"
        );
    }
}

#[test]
fn a_header_reply_that_is_no_number_is_refused() {
    let tcp = Carrier::by_name("tcp").unwrap();
    for got in [*b"GARBAGE!", *b"YA\0\0\0\0RX", *b"Welcome "] {
        let mut output = BytesMut::new();
        let sender = Sender::plain("/x");
        let mut initiator =
            Initiator::new(tcp, &sender, WireVersion::V3, Limits::DEFAULT, &mut output);
        let mut input = BytesMut::from(&got[..7]);
        assert_eq!(initiator.poll(&mut input), Ok(None));
        let mut input = BytesMut::from(&got[..]);
        assert_eq!(
            initiator.poll(&mut input),
            Err(ProtocolError::HeaderReply { got })
        );
    }
}

#[test]
fn long_names_and_numbers_are_taken_or_refused_without_growing() {
    let long = "/".to_owned() + &"x".repeat(1 << 20);
    frugal(long.len(), || long.parse::<PortName>()).unwrap_err();
    frugal(long.len(), || Contact::parse(&long));
    frugal(long.len(), || long.parse::<Stamp>()).unwrap_err();
    let digits = "9".repeat(1 << 20);
    for number in [
        digits.clone(),
        format!("0.{digits}"),
        format!("1e{digits}"),
        format!("-{digits}.5"),
    ] {
        let bottle = frugal(number.len(), || Bottle::parse(&number)).unwrap();
        assert_eq!(bottle.len(), 1);
    }
}
