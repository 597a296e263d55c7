//! The fuzz targets: each passes its bytes to a parser, and checks its invariants.
//!
//! The same functions are replayed over the committed corpora by `tests/fuzz_corpus.rs`.

use bytes::{Bytes, BytesMut};
use yarp_wire::admin::AdminRequest;
use yarp_wire::auth::{Key, KeyHandshake};
use yarp_wire::bottle::{BracketBalance, Scan, Scanner, detect};
use yarp_wire::carrier::{Carrier, CarrierSpec, Sender, Transport, put_group};
use yarp_wire::connection::{Acceptor, DatagramReassembler, Event, Initiator, Progress};
use yarp_wire::float_vector::Vector;
use yarp_wire::http::html_page::Page;
use yarp_wire::http::{
    Action, Admission, Gate, Head, HeadSearch, RequestReader, Service, bottle_json,
};
use yarp_wire::message::{Command, Form, Index, Payload, ReadObject, WireObject};
use yarp_wire::mjpeg::{PartReader, comment, with_comment};
use yarp_wire::name_service::{AnswerEnd, AnswerReader, Registration, Request, Style};
use yarp_wire::protocol::Incoming;
use yarp_wire::settings::{NoSource, Origin, Parameters, Settings};
use yarp_wire::shmem::{Ring, answers_mark, initiator_mark};
use yarp_wire::websocket::FrameReader;
use yarp_wire::{Bottle, Contact, Limits, PortName, Stamp, Value, WireVersion, datagram, typed};

/// One fuzz target: its name, which is also that of its corpus, and its function.
pub type Target = (&'static str, fn(&[u8]));

/// All targets.
pub const TARGETS: [Target; 21] = [
    ("bottle_binary", bottle_binary),
    ("bottle_text", bottle_text),
    ("acceptor", acceptor),
    ("initiator", initiator),
    ("message_reader", message_reader),
    ("contact", contact),
    ("carrier_spec", carrier_spec),
    ("admin", admin),
    ("name_service_request", name_service_request),
    ("name_service_answer", name_service_answer),
    ("datagram", datagram),
    ("http", http),
    ("gate", gate),
    ("typed", typed),
    ("mjpeg", mjpeg),
    ("websocket", websocket),
    ("framing", framing),
    ("reversed", reversed),
    ("auth", auth),
    ("shmem", shmem),
    ("settings", settings),
];

const DIALECTS: [WireVersion; 2] = [WireVersion::V3, WireVersion::V4];

/// The carriers that transport bytes; in corpora the index here stands for a carrier.
///
/// New ones are appended and none is ever removed, so that corpora keep their meaning.
pub const CARRIERS: [&str; 14] = [
    "name_ser",
    "tcp",
    "fast_tcp",
    "text",
    "text_ack",
    "udp",
    "mcast",
    "unix_stream",
    "unix_stream+ack",
    "shmem",
    "http",
    "mjpeg",
    "websocket",
    "tls",
];

/// Small bounds, so that they are reached.
const LIMITS: Limits = Limits::DEFAULT.with_message(1 << 16).with_line(1 << 12);

/// Binary bottles: decoded input encodes, and decodes to the same again.
pub fn bottle_binary(data: &[u8]) {
    let bytes = Bytes::copy_from_slice(data);
    for wire_version in DIALECTS {
        let whole = Scanner::new(wire_version, LIMITS).scan(data);
        let mut scanner = Scanner::new(wire_version, LIMITS);
        let mut stepped = scanner.scan(&[]);
        for end in 1..=data.len() {
            if let Ok(Scan::Needs { at_least }) = stepped {
                assert!(at_least >= end, "it asks for bytes that it has");
                stepped = scanner.scan(&data[..end]);
            }
        }
        assert_eq!(stepped, whole, "a bottle that arrives in pieces");
        let bottle = Bottle::decode(&bytes, wire_version, LIMITS);
        let fills = whole == Ok(Scan::Complete { length: data.len() });
        assert_eq!(bottle.is_ok(), fills);
        if let Ok(bottle) = bottle {
            let encoded = bottle.encode(wire_version);
            let again =
                Bottle::decode(&encoded, wire_version, Limits::DEFAULT).expect("our own bytes");
            assert_eq!(again.encode(wire_version), encoded);
            let payload = Payload::new(bytes.clone(), Form::Binary(wire_version));
            assert!(size_of_values(&bottle) <= payload.max_bottle_size());
            let any = Bottle::decode_any(&bytes, wire_version, LIMITS)
                .expect("it reads")
                .0;
            assert_eq!(any.encode(wire_version), encoded);
            // Text of a deep bottle may be refused.
            let _ = Bottle::parse_bytes(&bottle.to_text());
        }
        let payload = Payload::new(bytes.clone(), Form::Binary(wire_version));
        let _ = Vector::read(&payload);
        let _ = (payload.wire_version(), payload.to_bottle());
    }
    let _ = detect(data, LIMITS);
}

/// Returns the bytes that the values of a bottle have on the heap.
fn size_of_values(bottle: &Bottle) -> usize {
    let inner = bottle.iter().filter_map(Value::as_list);
    size_of_val(bottle.as_slice()) + inner.map(size_of_values).sum::<usize>()
}

/// Texts of bottles: printed bottles parse, and print the same again.
pub fn bottle_text(data: &[u8]) {
    let Ok(bottle) = Bottle::parse_bytes(data) else {
        return;
    };
    assert!(size_of_values(&bottle) <= Bottle::max_parsed_size(data));
    let text = bottle.to_text();
    let again = Bottle::parse_bytes(&text).expect("no deeper than before");
    // Words in brackets may hold anything, and these strings print without quotes.
    let loses = [&b"["[..], b"null", b"inf", b"nan"];
    let holds = |part: &[u8]| text.windows(part.len()).any(|window| window == part);
    if !loses.into_iter().any(holds) {
        assert_eq!(again.to_text(), text);
        let mut balance = BracketBalance::default();
        balance.extend(&text);
        assert!(balance.is_balanced());
    }
    for wire_version in DIALECTS {
        let encoded = bottle.encode(wire_version);
        let read = Bottle::decode(&encoded, wire_version, Limits::DEFAULT).expect("our own bytes");
        assert_eq!(read.encode(wire_version), encoded);
    }
    let _ = Bottle::parse(&String::from_utf8_lossy(data));
}

/// Connections as the listening side sees them: any split gives the same events and answers.
pub fn acceptor(data: &[u8]) {
    let Some((&step, data)) = data.split_first() else {
        return;
    };
    let whole = accept(data, data.len().max(1));
    assert_eq!(accept(data, usize::from(step).max(1)), whole);
}

/// Returns the events of an acceptor as text, and its output, if it is fed `step` bytes at a time.
fn accept(data: &[u8], step: usize) -> (Vec<String>, BytesMut) {
    let mut acceptor = Acceptor::new(10002, WireVersion::V3, LIMITS);
    let (mut input, mut output) = (BytesMut::new(), BytesMut::new());
    let mut events = Vec::new();
    for piece in data.chunks(step) {
        input.extend_from_slice(piece);
        loop {
            match acceptor.poll(&mut input, &mut output) {
                Ok(Some(event)) => {
                    events.push(format!("{event:?}"));
                    if let Event::Message(message) = event {
                        if message.command == Command::Quit {
                            // Later bytes are not read.
                            return (events, output);
                        }
                        if matches!(message.command, Command::Data { reply: true, .. }) {
                            acceptor.reply(&Bottle::of("ok"), &mut output);
                        }
                        acceptor.answer_lines("ok\r\n", &mut output);
                        acceptor.acknowledge(&mut output);
                    }
                }
                Ok(None) => break,
                Err(error) => {
                    events.push(error.to_string());
                    return (events, output);
                }
            }
        }
        assert!(acceptor.missing(&input) <= 1 << 16);
    }
    (events, output)
}

/// Connections as the connecting side sees them: any split gives the same progress.
pub fn initiator(data: &[u8]) {
    let [carrier, wire_version, sends, step, data @ ..] = data else {
        return;
    };
    let Some(carrier) = carrier_at(*carrier) else {
        return;
    };
    let wire_version = DIALECTS[usize::from(*wire_version) % 2];
    let whole = initiate(carrier, wire_version, *sends, data, data.len().max(1));
    let stepped = initiate(
        carrier,
        wire_version,
        *sends,
        data,
        usize::from(*step).max(1),
    );
    assert_eq!(stepped, whole);
}

/// Progress of an initiator in words; each two bits of `sends` are a message that it sends.
fn initiate(
    carrier: &'static Carrier,
    wire_version: WireVersion,
    sends: u8,
    data: &[u8],
    step: usize,
) -> Vec<String> {
    let mut output = BytesMut::new();
    let sender = Sender::plain("/fuzz");
    let mut initiator = Initiator::new(carrier, &sender, wire_version, LIMITS, &mut output);
    take_progress(&mut initiator, sends, data, step)
}

/// Lets an initiator send, and take `step` bytes at a time; its progress in words.
fn take_progress(initiator: &mut Initiator, sends: u8, data: &[u8], step: usize) -> Vec<String> {
    let mut output = BytesMut::new();
    for shift in [0, 2, 4, 6] {
        let command = match sends >> shift & 3 {
            0 => continue,
            1 => Command::data(true),
            2 => Command::data(false),
            _ => Command::Describe,
        };
        initiator.send(&command, 0, &mut output);
    }
    let mut input = BytesMut::new();
    let mut events = Vec::new();
    for piece in data.chunks(step) {
        input.extend_from_slice(piece);
        loop {
            match initiator.poll(&mut input) {
                Ok(Some(progress)) => {
                    if let Progress::Reply(payload) = &progress {
                        let _ = payload.to_bottle();
                    }
                    events.push(format!("{progress:?}"));
                }
                Ok(None) => break,
                Err(_) => {
                    // Some errors depend on the number of bytes received by then.
                    events.push("error".to_owned());
                    return events;
                }
            }
        }
    }
    events
}

/// Messages of each protocol, without a header.
pub fn message_reader(data: &[u8]) {
    let Some((&kind, data)) = data.split_first() else {
        return;
    };
    let carrier = ["tcp", "text", "name_ser", "unix_stream"][usize::from(kind % 4)];
    let protocol = Carrier::by_name(carrier)
        .expect("it is in the table")
        .protocol;
    let mut messages = protocol.message_decoder(WireVersion::V3, LIMITS);
    let (mut input, mut output) = (BytesMut::from(data), BytesMut::new());
    while let Ok(Some(Incoming::Message(message))) = messages.read(&mut input, &mut output) {
        let mut out = BytesMut::new();
        message.command.put_block(&mut out);
        assert_eq!(out.len(), message.command.block_len());
        message.command.put_line(&mut out);
        let _ = message.payload.to_bottle();
        let _ = message.payload.to_binary(WireVersion::V4);
    }
    let _ = Index::read(data, 1 << 16);
    let bytes = Bytes::copy_from_slice(data);
    if let Ok((_, length)) = Command::read(&bytes) {
        assert!(length <= data.len());
    }
    let _ = Command::parse(&bytes);
}

/// Contacts, port names and stamps.
pub fn contact(data: &[u8]) {
    let text = String::from_utf8_lossy(data);
    let contact = Contact::parse(&text);
    let printed = contact.to_string();
    if contact.name.starts_with('/') || contact.address.is_some() {
        assert_eq!(Contact::parse(&printed).to_string(), printed);
    }
    if let Ok(name) = text.parse::<PortName>() {
        assert_eq!(name.as_str(), text);
    }
    if let Ok(stamp) = text.parse::<Stamp>() {
        let again: Stamp = stamp.to_string().parse().expect("our own text");
        assert_eq!(again.count, stamp.count);
        let _ = stamp.next(0.0).to_bottle();
    }
}

/// Carrier strings and senders.
pub fn carrier_spec(data: &[u8]) {
    let text = String::from_utf8_lossy(data);
    if let Ok(spec) = text.parse::<CarrierSpec>() {
        assert_eq!(spec.to_string(), text);
        let _ = spec.modifier("log");
    }
    let sender = Sender::parse(data);
    let _ = Sender::parse(sender.to_string().as_bytes());
}

/// Admin requests.
pub fn admin(data: &[u8]) {
    if let Ok(bottle) = Bottle::parse_bytes(data) {
        let _ = AdminRequest::parse(&bottle);
    }
    let bytes = Bytes::copy_from_slice(data);
    if let Ok((bottle, _)) = Bottle::decode_any(&bytes, WireVersion::V3, LIMITS) {
        let _ = AdminRequest::parse(&bottle);
    }
}

/// Requests to the name server: a request written in any style parses to the same request.
pub fn name_service_request(data: &[u8]) {
    let text = String::from_utf8_lossy(data);
    let Ok(request) = Request::parse(&text) else {
        return;
    };
    let _ = request.command.rules();
    let _ = request.to_bottle();
    for style in [Style::Line, Style::NameSer, Style::TextAck] {
        let _ = request.to_bytes(style);
    }
}

/// Answers of the name server: any split gives the same lines.
pub fn name_service_answer(data: &[u8]) {
    let Some((&step, data)) = data.split_first() else {
        return;
    };
    for until in [AnswerEnd::FirstLine, AnswerEnd::End, AnswerEnd::Ack] {
        let read = |step: usize| {
            let mut reader = AnswerReader::new(until).with_limit(1 << 12);
            let mut taken = 0;
            for piece in data.chunks(step) {
                match reader.feed(piece) {
                    Ok(count) => taken += count,
                    Err(_) => return None,
                }
            }
            let done = reader.close();
            Some((taken, done, reader.answer()))
        };
        let whole = read(data.len().max(1));
        let stepped = read(usize::from(step).max(1));
        assert_eq!(stepped, whole);
        if let Some((_, _, answer)) = whole {
            let _ = (answer.registrations(), answer.property(), answer.bottle());
            let _ = (answer.is_ok(), answer.refusal());
        }
    }
    let _ = String::from_utf8_lossy(data).parse::<Registration>();
}

/// Datagrams: split messages decode to the same pieces, and anything else is refused.
pub fn datagram(data: &[u8]) {
    let _ = datagram::decode(data);
    let Some((&largest, message)) = data.split_first() else {
        return;
    };
    let mut joined = Vec::new();
    for (number, bytes) in (0..).zip(datagram::split(message, usize::from(largest))) {
        let piece = datagram::decode(&bytes).expect("our own datagram");
        assert_eq!(piece.number, number);
        joined.extend_from_slice(piece.data);
    }
    assert_eq!(joined, message);
    // Each piece is a length, a number and as many bytes: whole datagrams in any order.
    let mut reader = DatagramReassembler::new(WireVersion::V3, LIMITS);
    let mut rest = message;
    while let [length, number, after @ ..] = rest {
        let (piece, after) = after.split_at(usize::from(*length).min(after.len()));
        let number = i32::from(*number as i8);
        if let Ok(Some(message)) = reader.receive(&datagram::encode(number, piece)) {
            let _ = message.payload.to_bottle();
        }
        rest = after;
    }
}

/// Requests of browsers: any split reads the same, and every answer can be made.
pub fn http(data: &[u8]) {
    let Some((&step, data)) = data.split_first() else {
        return;
    };
    let read = |step: usize| {
        let mut reader = RequestReader::default();
        let mut input = BytesMut::new();
        for piece in data.chunks(step.max(1)) {
            input.extend_from_slice(piece);
            match reader.read(&mut input, LIMITS) {
                Ok(None) => {}
                other => return other.map_err(|error| error.to_string()),
            }
        }
        Ok(None)
    };
    let whole = read(data.len());
    let stepped = read(usize::from(step));
    if whole.is_ok() {
        assert_eq!(stepped, whole, "a request that arrives in pieces");
    }
    let Ok(Some(mut request)) = whole else {
        return;
    };
    request.decode_form();
    let shown = match Action::of(&request) {
        Action::Ask { message, json, .. } => bottle_json::of(&message, json.unwrap_or_default()),
        Action::Type { lines, data } => lines + &data,
        _ => String::new(),
    };
    let page = Page {
        port: "/port",
        name_server: None,
        data: &shown,
        text: &shown,
    };
    let mut response = BytesMut::new();
    page.put(&Admission::default(), &mut response);
    assert!(response.starts_with(b"HTTP/1.1 200 OK"));
}

/// The gate in front of browsers: the end of a head is found whatever the pieces, no sign of a browser gets more than a
/// look by GET, and what a page of another origin asks for is not answered.
pub fn gate(data: &[u8]) {
    let Some((&step, data)) = data.split_first() else {
        return;
    };
    let find = |step: usize| {
        let mut search = HeadSearch::default();
        let sizes = (0..data.len()).step_by(step.max(1)).chain([data.len()]);
        let mut ends = sizes.map(|size| search.end(&data[..size]));
        ends.find_map(|end| end.ok().flatten())
    };
    let end = find(data.len());
    assert_eq!(
        find(usize::from(step)),
        end,
        "a head that arrives in pieces"
    );
    let Some(end) = end else {
        return;
    };
    let head = Head::parse(&data[..end]);
    let gate = Gate::new().host("robot");
    for service in [Service::Pages, Service::Pictures, Service::Frames] {
        let Ok(admission) = gate.admit(service, &head) else {
            continue;
        };
        assert_eq!(admission.origin(), None, "none is allowed");
        if !head.is_of_browser() {
            continue;
        }
        let host = head.host.as_deref().expect("a browser says it");
        if let Some(origin) = head.origin.as_deref() {
            let origin = origin.to_ascii_lowercase();
            assert!(origin.contains(&format!("://{}", host.to_ascii_lowercase())));
        }
        let sends = head.posts || service == Service::Frames;
        assert_eq!(admission.may_only_view(), !sends);
    }
}

/// Typed messages: decoded input encodes, and decodes to the same again.
pub fn typed(data: &[u8]) {
    fn check<T: ReadObject + WireObject>(bytes: &Bytes, wire_version: WireVersion) {
        if let Ok(value) = T::read_binary(bytes, wire_version) {
            let mut first = BytesMut::new();
            value.write_binary(&mut first, wire_version);
            if let Ok(again) = T::read_binary(&first.clone().freeze(), wire_version) {
                let mut second = BytesMut::new();
                again.write_binary(&mut second, wire_version);
                assert_eq!(first, second);
            }
        }
    }
    let bytes = Bytes::copy_from_slice(data);
    for wire_version in DIALECTS {
        check::<Vector>(&bytes, wire_version);
        check::<typed::VectorOf<f32>>(&bytes, wire_version);
        check::<typed::VectorOf<i32>>(&bytes, wire_version);
        check::<typed::VectorOf<u8>>(&bytes, wire_version);
        check::<typed::Matrix>(&bytes, wire_version);
        check::<typed::Image>(&bytes, wire_version);
        check::<typed::Sound>(&bytes, wire_version);
        check::<typed::Property>(&bytes, wire_version);
        check::<typed::Pair<Bottle, typed::VectorOf<f64>>>(&bytes, wire_version);
    }
}

/// MJPEG streams: the same parts in one piece and byte by byte.
pub fn mjpeg(data: &[u8]) {
    let run = |size: usize| {
        let mut reader = PartReader::new(LIMITS);
        let mut input = BytesMut::new();
        let mut parts = Vec::new();
        for piece in data.chunks(size) {
            input.extend_from_slice(piece);
            loop {
                match reader.read(&mut input) {
                    Ok(Some(part)) => parts.push(part),
                    Ok(None) => break,
                    Err(_) => return parts,
                }
            }
        }
        parts
    };
    assert_eq!(run(data.len().max(1)), run(1));
    let bytes = Bytes::copy_from_slice(data);
    let _ = comment(&bytes);
    let commented = with_comment(data, b"7 1.5");
    if commented != bytes {
        assert!(comment(&commented).is_some());
    }
}

/// Frames of a page: the same stream and answers in one piece and byte by byte.
pub fn websocket(data: &[u8]) {
    let run = |size: usize| {
        let mut reader = FrameReader::new(LIMITS.message);
        let (mut input, mut output) = (BytesMut::new(), BytesMut::new());
        for piece in data.chunks(size) {
            input.extend_from_slice(piece);
            if let Err(error) = reader.read(&mut input, &mut output) {
                return (reader.stream.split(), output, Some(error));
            }
        }
        (reader.stream.split(), output, None)
    };
    assert_eq!(run(data.len().max(1)), run(1));
}

/// The head of a shared segment, and steps of a reader and a writer: a packet of the handshake, the
/// four numbers, the room behind them, and a byte per step.
pub fn shmem(data: &[u8]) {
    let Some((packet, rest)) = data.split_first_chunk::<8>() else {
        return;
    };
    let _ = initiator_mark(packet);
    let _ = answers_mark(packet, 7);
    let Some((head, steps)) = rest.split_first_chunk::<18>() else {
        return;
    };
    let number =
        |at: usize| i32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]);
    let room = usize::from(u16::from_le_bytes([head[16], head[17]]));
    let numbers = [number(0), number(4), number(8), number(12)];
    let Ok(mut ring) = Ring::checked(numbers, room) else {
        return;
    };
    assert_eq!(ring.numbers(), numbers);
    for step in steps {
        let most = usize::from(step >> 1) * 37;
        let before = ring.available();
        let ranges = if step & 1 == 0 {
            ring.take(most)
        } else {
            ring.put(most)
        };
        let moved: usize = ranges.iter().map(ExactSizeIterator::len).sum();
        assert!(moved <= most && ranges.iter().all(|range| range.end <= room));
        assert_eq!(before.abs_diff(ring.available()), moved);
        assert_eq!(Ring::checked(ring.numbers(), room), Ok(ring));
    }
}

/// Bytes after a valid header, on every carrier: any split gives the same events and answers.
pub fn framing(data: &[u8]) {
    let [carrier, step, data @ ..] = data else {
        return;
    };
    let Some(carrier) = carrier_at(*carrier) else {
        return;
    };
    let conversation = [&header(carrier)[..], data].concat();
    let whole = accept(&conversation, conversation.len());
    assert_eq!(accept(&conversation, usize::from(*step).max(1)), whole);
}

/// Bytes of readers to a port that writes over a connection that they made, on every carrier: any
/// split gives the same progress and the same answers.
pub fn reversed(data: &[u8]) {
    let [carrier, sends, step, data @ ..] = data else {
        return;
    };
    let Some(carrier) = carrier_at(*carrier) else {
        return;
    };
    let whole = reverse(carrier, *sends, data, data.len().max(1));
    let stepped = reverse(carrier, *sends, data, usize::from(*step).max(1));
    assert_eq!(stepped, whole);
}

/// Returns the carrier at an index of [`CARRIERS`], if it is in range.
pub fn carrier_at(place: u8) -> Option<&'static Carrier> {
    let spec: CarrierSpec = CARRIERS.get(usize::from(place))?.parse().expect("a spec");
    Some(Carrier::of(&spec).expect("a carrier of the table"))
}

/// Returns a header that an acceptor takes.
pub fn header(carrier: &'static Carrier) -> BytesMut {
    let mut bytes = BytesMut::new();
    match carrier.name {
        // The input is the rest of the request.
        "http" => bytes.extend_from_slice(&carrier.magic),
        "name_ser" => bytes.extend_from_slice(b"NAME_SERVER "),
        "mjpeg" => {
            bytes.extend_from_slice(b"GET /?action=stream HTTP/1.1\r\nHost: localhost\r\n\r\n");
        }
        "websocket" => bytes.extend_from_slice(
            b"GET /?ws HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\n\
              Connection: Upgrade\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\
              Sec-WebSocket-Version: 13\r\n\r\n",
        ),
        _ => {
            let sender = Sender::plain("/fuzz");
            Initiator::new(carrier, &sender, WireVersion::V3, LIMITS, &mut bytes);
            if carrier.transport == Transport::Group {
                put_group("224.2.1.1:11000".parse().expect("a group"), &mut bytes);
            }
        }
    }
    bytes
}

/// Runs like [`initiate`], for the writing end of a connection that the other side made; also
/// returns its automatic answers.
fn reverse(
    carrier: &'static Carrier,
    sends: u8,
    data: &[u8],
    step: usize,
) -> (Vec<String>, BytesMut) {
    let mut acceptor = Acceptor::new(10002, WireVersion::V3, LIMITS);
    let (mut input, mut output) = (header(carrier), BytesMut::new());
    if carrier.name == "http" {
        input.extend_from_slice(b"TP/1.1\r\n\r\n");
    }
    let opened = acceptor.poll(&mut input, &mut output);
    assert!(matches!(opened, Ok(Some(Event::Opened { .. }))));
    let mut initiator = acceptor.into_initiator().expect("its header is complete");
    let progress = take_progress(&mut initiator, sends, data, step);
    (progress, initiator.take_output())
}

/// The handshake of keys, either side: the same in one piece and in steps, and never more is taken
/// than belongs to it.
pub fn auth(data: &[u8]) {
    let [side, step, data @ ..] = data else {
        return;
    };
    let run = |size: usize| {
        let key = Key::new(b"fuzz").expect("it is not empty");
        let mut output = BytesMut::new();
        let mut handshake = match side & 1 {
            0 => KeyHandshake::accept(key, [[1; 8], [3; 8]], &mut output),
            _ => KeyHandshake::initiate(key, [2; 8]),
        };
        let mut input = BytesMut::new();
        let mut taken = 0;
        let mut through = Ok(false);
        for piece in data.chunks(size) {
            input.extend_from_slice(piece);
            let held = input.len();
            through = handshake.poll(&mut input, &mut output);
            taken += held - input.len();
            if through != Ok(false) {
                break;
            }
            assert!((1..=40).contains(&handshake.missing(&input)));
        }
        (through, taken, output)
    };
    let whole = run(data.len().max(1));
    assert_eq!(run(usize::from(*step).max(1)), whole);
    assert!(whole.1 <= 80);
}

/// Configuration files and command lines: parsed settings can be printed, parsed again and queried.
pub fn settings(data: &[u8]) {
    let text = String::from_utf8_lossy(data);
    let mut settings = Settings::new();
    settings.read_text("fuzz", &text, &NoSource);
    settings.add_command_line(text.split('\n'));
    // Lists may be one deeper now than those that may be read.
    let _ = Settings::new().add_lists(&settings.to_string(), &Origin::Program);
    let parameters = Parameters::new("fuzz", settings, Origin::Program);
    for name in ["a", "a::b"] {
        let _ = (parameters.get::<f64>(name), parameters.list::<String>(name));
    }
    parameters.unused().for_each(drop);
}
