//! A recorded conversation gives the same events for any split into pieces.
//!
//! The vectors are halves of conversations between stock programs; `vectors/README.txt` lists them.

use bytes::BytesMut;
use yarp_wire::carrier::{Carrier, Sender};
use yarp_wire::connection::{Acceptor, Event, Initiator, Progress, put_message};
use yarp_wire::message::{Command, WireObject};
use yarp_wire::{Bottle, Limits, WireVersion};

/// One half of a conversation.
macro_rules! half {
    ($name:literal, $half:literal) => {
        include_bytes!(concat!("vectors/", $name, ".", $half, ".bin")).as_slice()
    };
}

struct Conversation {
    carrier: &'static str,
    sender: &'static str,
    wire_version: WireVersion,
    sent: &'static [u8],
    answered: &'static [u8],
    /// The messages as text.
    says: &'static [&'static str],
    /// The answers as text.
    answers: &'static [&'static str],
}

/// The messages of `yarp write` in every recording.
const FIVE: [&str; 6] = [
    r#"D 1 2.5 hello "a b" [vocb] (nested (list 7)) {1 2 255}"#,
    "D 42",
    r#"D "quoted \\ back""#,
    "D -1 0.100000000000000005551 1.0000000000000000525e+300 true",
    "D ()",
    "q",
];
const RPC: [&str; 5] = [
    "d hello 1 2",
    "d [get] [axes]",
    "d (a (b c)) 3.25",
    "d help",
    "q",
];
const ADMIN_ANSWERS: [&str; 9] = [
    "[ver] 1 2 3",
    "anon_rpc",
    "",
    "",
    r#"-1 "Do not know how to connect to /nobody\r\n""#,
    r#"-1 "Could not find an outgoing connection to /nobody\r\nCould not find an incoming connection from /nobody\r\n""#,
    "[ok]",
    "red",
    r#"[fail] "send [help] for list of valid commands""#,
];

const fn recorded(
    carrier: &'static str,
    wire_version: WireVersion,
    sent: &'static [u8],
    answered: &'static [u8],
) -> Conversation {
    Conversation {
        carrier,
        sender: "/wr",
        wire_version,
        sent,
        answered,
        says: &FIVE,
        answers: &[],
    }
}

const fn call(
    wire_version: WireVersion,
    sent: &'static [u8],
    answered: &'static [u8],
    says: &'static [&'static str],
    answers: &'static [&'static str],
) -> Conversation {
    Conversation {
        carrier: "tcp",
        sender: "anon_rpc",
        wire_version,
        sent,
        answered,
        says,
        answers,
    }
}

const CONVERSATIONS: [Conversation; 10] = [
    recorded(
        "tcp",
        WireVersion::V3,
        half!("v3_tcp", "sent"),
        half!("v3_tcp", "answered"),
    ),
    recorded(
        "tcp",
        WireVersion::V4,
        half!("v4_tcp", "sent"),
        half!("v4_tcp", "answered"),
    ),
    recorded(
        "text",
        WireVersion::V3,
        half!("v3_text", "sent"),
        half!("v3_text", "answered"),
    ),
    recorded(
        "text",
        WireVersion::V4,
        half!("v4_text", "sent"),
        half!("v4_text", "answered"),
    ),
    recorded(
        "text_ack",
        WireVersion::V3,
        half!("v3_text_ack", "sent"),
        half!("v3_text_ack", "answered"),
    ),
    recorded(
        "text_ack",
        WireVersion::V4,
        half!("v4_text_ack", "sent"),
        half!("v4_text_ack", "answered"),
    ),
    call(
        WireVersion::V3,
        half!("v3_rpc", "sent"),
        half!("v3_rpc", "answered"),
        &RPC,
        &RPC_ANSWERS,
    ),
    call(
        WireVersion::V4,
        half!("v4_rpc", "sent"),
        half!("v4_rpc", "answered"),
        &RPC,
        &RPC_ANSWERS,
    ),
    call(
        WireVersion::V3,
        half!("v3_admin", "sent"),
        half!("v3_admin", "answered"),
        &[],
        &ADMIN_ANSWERS,
    ),
    call(
        WireVersion::V4,
        half!("v4_admin", "sent"),
        half!("v4_admin", "answered"),
        &[],
        &ADMIN_ANSWERS,
    ),
];
const RPC_ANSWERS: [&str; 4] = ["hello 1 2", "[get] [axes]", "(a (b c)) 3.25", "help"];

/// Cuts `bytes` at every place into two, and into pieces of every size up to 9.
fn every_split(bytes: &[u8]) -> impl Iterator<Item = Vec<&[u8]>> {
    let halves = (0..=bytes.len()).map(|at| {
        let (front, back) = bytes.split_at(at);
        vec![front, back]
    });
    halves.chain((1..10).map(|size| bytes.chunks(size).collect()))
}

/// Events and answers of an acceptor that is fed `pieces`.
fn accept(pieces: &[&[u8]], wire_version: WireVersion) -> (Vec<Event>, BytesMut) {
    let mut acceptor = Acceptor::new(10004, wire_version, Limits::DEFAULT);
    let (mut input, mut output) = (BytesMut::new(), BytesMut::new());
    let mut events = Vec::new();
    for piece in pieces {
        input.extend_from_slice(piece);
        while let Some(event) = acceptor.poll(&mut input, &mut output).unwrap() {
            if matches!(event, Event::Message(_)) {
                acceptor.acknowledge(&mut output);
            }
            events.push(event);
        }
    }
    assert!(input.is_empty());
    (events, output)
}

/// Returns a message in words: its command and its content.
fn words(event: &Event) -> Option<String> {
    let Event::Message(message) = event else {
        return None;
    };
    let content = || message.payload.to_bottle().unwrap();
    Some(match &message.command {
        Command::Data { reply: true, .. } => format!("d {}", content()),
        Command::Data { .. } => format!("D {}", content()),
        Command::Admin => format!("a {}", content()),
        Command::Quit => "q".to_owned(),
        other => format!("{other:?}"),
    })
}

#[test]
fn acceptors_see_the_same_events_at_every_split() {
    for talk in &CONVERSATIONS {
        let whole = accept(&[talk.sent], talk.wire_version);
        let said: Vec<_> = whole.0.iter().filter_map(words).collect();
        if !talk.says.is_empty() {
            assert_eq!(said, talk.says);
        }
        let Event::Opened {
            carrier, sender, ..
        } = &whole.0[0]
        else {
            panic!("no header");
        };
        assert_eq!(
            (carrier.name, sender.name.as_str()),
            (talk.carrier, talk.sender)
        );
        for pieces in every_split(talk.sent) {
            let split = accept(&pieces, talk.wire_version);
            assert_eq!(
                format!("{split:?}"),
                format!("{whole:?}"),
                "{}",
                talk.carrier
            );
        }
    }
}

#[test]
fn acceptors_answer_as_the_recorded_ones() {
    for talk in CONVERSATIONS.iter().filter(|talk| talk.sender == "/wr") {
        let (_, output) = accept(&[talk.sent], talk.wire_version);
        assert_eq!(output, talk.answered, "{}", talk.carrier);
    }
}

/// Returns an initiator that has sent the recorded messages, and the bytes it wrote.
fn initiate(talk: &Conversation) -> (Initiator, BytesMut) {
    let mut output = BytesMut::new();
    let carrier = Carrier::by_name(talk.carrier).unwrap();
    let sender = Sender::plain(talk.sender);
    let mut initiator = Initiator::new(
        carrier,
        &sender,
        talk.wire_version,
        Limits::DEFAULT,
        &mut output,
    );
    let (events, _) = accept(&[talk.sent], talk.wire_version);
    for event in events {
        if let Event::Message(message) = event {
            let has_payload = message.command.has_payload();
            let content = has_payload.then(|| message.payload.to_bottle().unwrap());
            let content = content.as_ref().map(|content| content as &dyn WireObject);
            let mut bytes = BytesMut::new();
            put_message(
                &mut bytes,
                carrier,
                &message.command,
                content,
                talk.wire_version,
            );
            let mut head = BytesMut::new();
            initiator.send(&message.command, message.payload.bytes().len(), &mut head);
            output.extend_from_slice(&bytes);
        }
    }
    (initiator, output)
}

#[test]
fn initiators_write_the_recorded_bytes() {
    for talk in &CONVERSATIONS {
        let (_, output) = initiate(talk);
        assert_eq!(output, talk.sent, "{}", talk.carrier);
    }
}

/// Returns the events of an initiator fed with `pieces`.
fn progress(talk: &Conversation, pieces: &[&[u8]]) -> Vec<Progress> {
    let (mut initiator, _) = initiate(talk);
    let mut input = BytesMut::new();
    let mut steps = Vec::new();
    for piece in pieces {
        input.extend_from_slice(piece);
        while let Some(step) = initiator.poll(&mut input).unwrap() {
            steps.push(step);
        }
    }
    assert!(input.is_empty());
    assert!(initiator.is_idle(), "{} {:?}", talk.carrier, steps);
    steps
}

#[test]
fn initiators_make_the_same_progress_at_every_split() {
    for talk in &CONVERSATIONS {
        let whole = progress(talk, &[talk.answered]);
        assert_eq!(whole[0], Progress::Ready);
        let replies: Vec<Bottle> = whole
            .iter()
            .filter_map(|step| match step {
                Progress::Reply(payload) => Some(payload.to_bottle().unwrap()),
                _ => None,
            })
            .collect();
        let texts: Vec<String> = replies.iter().map(Bottle::to_string).collect();
        assert!(
            texts.ends_with(
                &talk
                    .answers
                    .iter()
                    .map(|text| (*text).to_owned())
                    .collect::<Vec<_>>()
            ),
            "{texts:?}"
        );
        for pieces in every_split(talk.answered) {
            assert_eq!(progress(talk, &pieces), whole, "{}", talk.carrier);
        }
    }
}
