//! The hand's parsers: answers and commands of its language, blocks of RealTime, requests and answers of its server.

use yarp_devices::hand::gcl::{Command, Header, Layout, MotorLayout, MotorSet, Reply, ReplyReader};
use yarp_devices::hand::node::{NodeReplyReader, Request, RequestReader};
use yarp_devices::hand::simulated::Firmware;

/// One fuzz target: its name, which is also that of its corpus, and what it does.
pub type Target = (&'static str, fn(&[u8]));

/// The targets about the hand.
pub const TARGETS: [Target; 4] = [
    ("hand_reply", reply),
    ("hand_command", command),
    ("hand_block", block),
    ("hand_server", server),
];

/// Answers of the hand: any split gives the same, and nothing is kept that an answer cannot have.
pub fn reply(data: &[u8]) {
    for sent in ["", "GC", "FGET P"] {
        let whole = ReplyReader::new(sent).push(data);
        let mut reader = ReplyReader::new(sent);
        let pieces = data.iter().find_map(|byte| reader.push(&[*byte]));
        assert_eq!(whole, pieces);
        if let Some(Ok(reply)) = whole {
            read(&reply);
        }
    }
    read(&Reply {
        text: String::from_utf8_lossy(data).into_owned(),
    });
}

fn read(reply: &Reply) {
    let _ = (reply.status().to_string(), reply.numbers(4));
}

/// Commands: what is understood is printed, and understood again; and the simulated hand bears anything.
pub fn command(data: &[u8]) {
    if let Ok(text) = std::str::from_utf8(data)
        && let Ok(command) = Command::parse(text)
    {
        assert_eq!(Command::parse(&command.to_string()), Ok(command));
    }
    let mut hand = Firmware::new();
    hand.advance(1.0);
    hand.receive(b"HI\r");
    hand.advance(1.0);
    for piece in data.chunks(16) {
        hand.receive(piece);
        hand.advance(0.005);
    }
    assert!(
        hand.positions()
            .iter()
            .all(|position| (0.0..=17800.0).contains(position))
    );
}

/// Blocks of RealTime; the first two bytes choose the layout.
pub fn block(data: &[u8]) {
    let [first, second, data @ ..] = data else {
        return;
    };
    let bit = |place: u8| first & (1 << place) != 0;
    let motor = MotorLayout {
        speed: bit(0).then_some(1),
        gain: bit(1),
        measured_speed: bit(2).then_some(1),
        strain: bit(3),
        position: bit(4),
        change: bit(5).then_some(1),
        ..MotorLayout::default()
    };
    let motors = if bit(6) {
        MotorSet::ALL
    } else {
        MotorSet::FINGERS
    };
    let layout = Layout {
        temperature: bit(7),
        ..Layout::same(motors, motor)
    };
    let header = Header::from_byte(*second).unwrap_or(Header::Control);
    if let Ok(Some(feedback)) = layout.read_feedback(header, data) {
        let written = layout.write_feedback(header, &feedback);
        assert_eq!(written, data[..written.len()]);
    }
    if let Some(control) = layout.read_control(data) {
        assert_eq!(layout.write_control(Header::Control, &control)[1..], *data);
    }
}

/// Requests to the hand server and its answers: any split gives the same.
pub fn server(data: &[u8]) {
    let requests = |piece: usize| {
        let mut reader = RequestReader::new();
        let mut requests = Vec::new();
        for piece in data.chunks(piece) {
            reader.push(piece);
            loop {
                match reader.next_request() {
                    Ok(Some(request)) => requests.push(request),
                    Ok(None) => break,
                    Err(_) => return (requests, true),
                }
            }
        }
        (requests, false)
    };
    let whole = requests(data.len().max(1));
    assert_eq!(whole, requests(1));
    let written: Vec<u8> = whole.0.iter().flat_map(Request::to_bytes).collect();
    assert_eq!(written, data[..written.len()]);
    for request in [Request::Open, Request::Command("FGET P".into())] {
        let mut reader = NodeReplyReader::new(&request);
        for &byte in data {
            match reader.push(byte) {
                Ok(Some(reply)) => {
                    read(&reply.into_reply());
                    break;
                }
                Ok(None) => {}
                Err(_) => break,
            }
        }
    }
}
