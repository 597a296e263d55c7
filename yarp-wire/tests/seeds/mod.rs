//! Seeds of the fuzzer: valid input of every kind, and every known kind of invalid input.

use bytes::BytesMut;
use yarp_wire::auth::{Key, KeyHandshake};
use yarp_wire::carrier::{ALL, Carrier};
use yarp_wire::connection::{put_acknowledgement, put_message};
use yarp_wire::message::Command;
use yarp_wire::mjpeg::{RESPONSE, put_part};
use yarp_wire::protocol::header_reply;
use yarp_wire::{Bottle, Value, WireVersion};

use crate::fuzz::{CARRIERS, carrier_at, header};

/// For each target the bytes of its seeds.
pub(crate) fn all() -> Vec<(&'static str, Vec<Vec<u8>>)> {
    vec![
        ("bottle_binary", bottles()),
        (
            "bottle_text",
            TEXTS.iter().map(|text| text.as_bytes().to_vec()).collect(),
        ),
        ("acceptor", acceptor()),
        ("initiator", initiator()),
        ("message_reader", message_reader()),
        ("contact", strings(&CONTACTS)),
        ("carrier_spec", strings(&SPECS)),
        ("admin", strings(&ADMIN)),
        ("name_service_request", strings(&REQUESTS)),
        ("name_service_answer", answers()),
        ("datagram", datagrams()),
        ("http", strings(&HTTP)),
        ("gate", strings(&HEADS)),
        ("typed", typed_messages()),
        ("mjpeg", streams()),
        ("websocket", frames()),
        ("shmem", segments()),
        ("framing", behind_headers()),
        ("reversed", from_readers()),
        ("auth", handshakes()),
        ("settings", configurations()),
    ]
}

const TEXTS: [&str; 6] = [
    r#"1 2.5 hello "a b" [vocb] (nested (list 7)) {1 2 255}"#,
    r#"true false null inf -inf nan 0x1F 010 1e5 -0x1.8 4294967296"#,
    r#""quote \" \\ \n \r \0" a\ b "open (1 2"#,
    "(((((((((())))))))))",
    "a,b (c,d) {300 x [ok]} [toolong]",
    "\u{e9} [\u{e9}] \"\u{e9}\"",
];
const CONTACTS: [&str; 8] = [
    "/x",
    "tcp://10.0.0.1:10002/x",
    "fast_tcp+log.in://x/y",
    "/robot:1",
    "tcp:/x",
    "tcp://10.0.0.1:99999/x",
    "7 1700000000.12346",
    "3 1e-05",
];
const SPECS: [&str; 4] = [
    "fast_tcp+send.portmonitor+file.zlib+type.dll",
    "tcp",
    "/w (send portmonitor) (file zlib) x",
    "007",
];
const ADMIN: [&str; 6] = [
    "[list] [out] \"/r\"",
    "[add] \"tcp://r\" udp",
    "[del] /r",
    "[prop] [set] colour red 1 (2)",
    "[atch] [in] x",
    "help",
];
const REQUESTS: [&str; 9] = [
    "NAME_SERVER register /x tcp 10.0.0.2 10002",
    "query /x",
    "bot list",
    "set /x offers tcp text",
    "get /x ips (format json)",
    "unregister /x",
    "NAME_SERVER subscribe /a /b",
    "type yarp X (REQUEST_URI \"?req=type+yarp+X\") (format html) (req \"type yarp X\")",
    "NAME_SERVER passed /a 10.0.0.2 10002 /b robot -1",
];
/// Requests of browsers; the byte in front is the step in which they are fed.
const HTTP: [&str; 9] = [
    "\x07GET / HTTP/1.1\r\nHost: localhost:1\r\n\r\n",
    "\x01GET /?req=hello&x=1 HTTP/1.1\r\nHost: localhost\r\n\r\n",
    "\x03POST /form HTTP/1.1\r\nContent-Length: 11\r\nContent-Type: application/x-www-form-urlencoded\r\n\r\ndata=a+b%2e",
    "\x05GET /a/b?x=y&z=%4 HTTP/1.1\n\n",
    "\x05POST /form HTTP/1.1\r\nContent-Length: 99999999999\r\n\r\n",
    "\x05GET /?cmd=d%0Aa,b%2Bc HTTP/1.1\r\n\r\n",
    "\x05GET /?data=$a,$b.$&a=1 HTTP/1.1\r\n\r\n",
    "\x05GET /dict/(a+1)?format=json&outer=list&admin=1 HTTP/1.1\r\n\r\n",
    "\x05GET /?req=list+(dict+1+(a+1)+())&outer=dict HTTP/1.1\r\n\r\n",
];
/// Heads of requests, as browsers and programs send them; the byte in front is the step in which they are fed.
const HEADS: [&str; 9] = [
    "\x01GET /?data=x HTTP/1.1\r\nHost: 127.0.0.1:10002\r\nUser-Agent: curl/8.5.0\r\nAccept: */*\r\n\r\n",
    "\x03GET / HTTP/1.1\r\nHost: robot:1\r\nUser-Agent: Mozilla/5.0\r\nAccept: text/html\r\nAccept-Language: en\r\n\r\n",
    "\x05POST /form HTTP/1.1\r\nHost: [::1]:1\r\nOrigin: http://[::1]:1\r\nReferer: http://[::1]:1/\r\nContent-Length: 6\r\n\r\ndata=x",
    "\x07GET /?ws HTTP/1.1\r\nHost: localhost:1\r\nOrigin: http://evil.example\r\nUpgrade: websocket\r\n\r\n",
    "\x07GET /?action=stream HTTP/1.1\r\nHost: 10.0.0.2\r\nSec-Fetch-Site: cross-site\r\nSec-Fetch-Mode: no-cors\r\nSec-Fetch-Dest: image\r\n\r\n",
    "\x07GET / HTTP/1.1\r\nHost: localhost\r\nSec-Fetch-Site: same-site\r\nSec-Fetch-Mode: navigate\r\nSec-Fetch-Dest: document\r\n\r\n",
    "\x02GET / HTTP/1.1\nHost: evil.example\nReferer: http://evil.example/\n\n",
    "\x02GET /?action=stream\n\n HTTP/1.1\nHost: h\r\n\n",
    "\x09POST /form HTTP/1.1\r\nHost: a\r\nHost: localhost\r\nOrigin: null\r\nSec-CH-UA: x\r\n\r\n",
];
const DATAGRAM: &[u8] = b"\x2d\x7c\x9f\xe0\0\0\0\0NAME_SERVER query /root\n";

fn strings(texts: &[&str]) -> Vec<Vec<u8>> {
    texts.iter().map(|text| text.as_bytes().to_vec()).collect()
}

fn bottles() -> Vec<Vec<u8>> {
    let mut seeds = Vec::new();
    for wire_version in [WireVersion::V3, WireVersion::V4] {
        for text in &TEXTS[..2] {
            seeds.push(Bottle::parse(text).unwrap().encode(wire_version).to_vec());
        }
        let kinds = Bottle::from_iter([
            Value::Int8(-1),
            Value::Int16(258),
            Value::Int64(7),
            Value::Float32(1.5),
            Value::Float64(0.1),
            Value::Dictionary(Bottle::parse("(a x) (b 1)").unwrap()),
        ]);
        seeds.push(kinds.encode(wire_version).to_vec());
        seeds.push(
            Bottle::parse("0.5 0.25 0.125")
                .unwrap()
                .encode(wire_version)
                .to_vec(),
        );
    }
    // Lying lengths: a list, a string, a count below zero.
    seeds.push(b"\0\x01\0\0\xff\xff\xff\x7f\x01\0\0\0".to_vec());
    seeds.push(b"\x04\x01\0\0\x01\0\0\0\xff\xff\xff\x7fabc".to_vec());
    seeds.push(b"\0\x01\0\0\xff\xff\xff\xff".to_vec());
    seeds.push(b"\0\x01\0\0\x01\0\0\0".repeat(300));
    seeds
}

/// Recorded conversations; the byte in front is the step in which they are fed.
fn acceptor() -> Vec<Vec<u8>> {
    let mut seeds: Vec<_> = [
        "v3_tcp",
        "v4_tcp",
        "v3_text",
        "v3_text_ack",
        "v3_rpc",
        "v3_admin",
    ]
    .iter()
    .map(|name| [b"\x07".to_vec(), vector(name, "sent")].concat())
    .collect();
    for text in [
        &b"\x01GARBAGE!"[..],
        b"\x05GET /a/b?x=y&z=%41 HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"\x05POST /form HTTP/1.1\r\nContent-Length: 8\r\n\
          Content-Type: application/x-www-form-urlencoded\r\n\r\ndata=a+b",
        b"\x01NAME_SERVER query /x\nNAME_SERVER list\n",
        b"\x03CONNECT foo\r\nd\r\n(a\r\nb)\r\n*\r\n/x\r\n!x\r\n~x\r\nr\r\ni\r\n?\r\nz\r\n",
        b"\x01YA\xe4\x1e\0\0RP\xff\xff\xff\x7fxx",
        b"\x02YA\x64\x1e\0\0RP\x03\0\0\0/w\0YA\x0a\0\0\0RP\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff",
    ] {
        seeds.push(text.to_vec());
    }
    for carrier in ALL {
        seeds.push([b"\x05", &header(carrier)[..], &behind_header(carrier)].concat());
    }
    seeds
}

/// Recorded answers, then made ones for each carrier; in front carrier, wire version, messages sent
/// and step.
fn initiator() -> Vec<Vec<u8>> {
    let with = |head: [u8; 4], name: &str| [head.to_vec(), vector(name, "answered")].concat();
    let mut seeds = vec![
        with([1, 0, 0b10_10_10_10, 5], "v3_tcp"),
        with([1, 0, 0b01_01_01_01, 5], "v3_rpc"),
        with([1, 1, 0b01_01_01_01, 5], "v4_rpc"),
        with([2, 0, 0b01_01_01_01, 5], "v3_rpc"),
        with([3, 0, 0b01_10_11_01, 5], "v3_text"),
        with([4, 0, 0b10_10_10_10, 5], "v3_text_ack"),
        b"\x04\0\x7d\x03Welcome x\r\n(a\r\nb)\r\n<ACK>\r\n<ACK>\r\nline\r\n<ACK>\r\n".to_vec(),
        b"\x01\0\x05\x03YA\x12\x27\0\0RPYA\0\0\0\0RPYA\0\0\0\0RP".to_vec(),
    ];
    for (place, carrier) in on_the_wire() {
        let mut bytes = BytesMut::from(&[place, 0, SENT, 5][..]);
        match carrier.name {
            "tcp" | "fast_tcp" | "udp" | "shmem" => header_reply(10002, &mut bytes),
            "text" | "text_ack" => bytes.extend_from_slice(b"Welcome /fuzz\r\n"),
            _ => {}
        }
        bytes.extend_from_slice(&answers_on(carrier));
        seeds.push(bytes.to_vec());
    }
    seeds
}

fn message_reader() -> Vec<Vec<u8>> {
    let mut seeds = vec![
        b"\x03\0\0\0\0~d\0\x01\x01\x01\0\0\x01\0\0\0\x2a\0\0\0\x02\0\0\0~\0\0\x01q\0".to_vec(),
        b"\x01d 7 1.5\r\n(1 2\r\n3)\r\nD\r\n\"a\\\r\nb\"\r\nq\r\n".to_vec(),
        b"\x02VERquery /x\nNAME_SERVER list\n".to_vec(),
        b"\0YA\x0a\0\0\0RP\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff".to_vec(),
        b"\0YA\x0a\0\0\0RP\x01\0\xff\xff\xff\xff\xff\xff\xff\xff\xfe\xff\xff\xff".to_vec(),
    ];
    let tcp = yarp_wire::carrier::Carrier::by_name("tcp").unwrap();
    let content = Bottle::parse("1 0.5 (a)").unwrap();
    for envelope in [None, Some("7 1.5".into())] {
        let command = Command::Data {
            reply: true,
            envelope,
        };
        let mut out = BytesMut::from(&[0][..]);
        put_message(&mut out, tcp, &command, Some(&content), WireVersion::V3);
        put_message(&mut out, tcp, &Command::Quit, None, WireVersion::V3);
        seeds.push(out.to_vec());
    }
    seeds
}

/// Cut messages; the byte in front is the largest datagram. Then whole datagrams, each with a
/// length and a number in front.
fn datagrams() -> Vec<Vec<u8>> {
    let udp = yarp_wire::carrier::Carrier::by_name("udp").unwrap();
    let content = Bottle::parse("1 0.5 (a)").unwrap();
    let mut message = BytesMut::new();
    let command = Command::data(false);
    put_message(&mut message, udp, &command, Some(&content), WireVersion::V3);
    let mut pieces = vec![b' '];
    for (number, piece) in (0..).zip(message.chunks(30)) {
        pieces.extend_from_slice(&[piece.len() as u8, number]);
        pieces.extend_from_slice(piece);
    }
    vec![
        b"\x20hello".to_vec(),
        b"\x09abcdef".to_vec(),
        DATAGRAM.to_vec(),
        pieces,
    ]
}

fn answers() -> Vec<Vec<u8>> {
    [
        "registration name /x ip 10.0.0.2 port 10002 type tcp\r\n*** end of message\r\n",
        "port /x property ips = 10.0.0.2 10.0.0.3\r\n*** end of message\n",
        "Welcome admin\r\n[ok]\r\n<ACK>\r\n",
        "[fail] \"no\"\r\n",
        "old\0\r\n",
    ]
    .map(|text| [b"\x05", text.as_bytes()].concat())
    .to_vec()
}

/// One half of a recorded conversation.
fn vector(name: &str, half: &str) -> Vec<u8> {
    let path = format!(
        "{}/tests/vectors/{name}.{half}.bin",
        env!("CARGO_MANIFEST_DIR")
    );
    std::fs::read(path).unwrap()
}

fn typed_messages() -> Vec<Vec<u8>> {
    use yarp_wire::message::WireObject;
    use yarp_wire::typed::{Image, Matrix, Pair, PixelCode, Property, Sound, VectorOf};
    let image = Image::new(PixelCode::RGB, 3, 2).unwrap();
    let sound = Sound::new(1, 8000, vec![1, -2, 3]).unwrap();
    let matrix = Matrix::new(1, 2, vec![1.0, 2.0]).unwrap();
    let property = Property::from_bottle(Bottle::parse("(a 1) (b (x y))").unwrap());
    let pair = Pair {
        head: Bottle::parse("[vmo] 0").unwrap(),
        body: VectorOf(vec![10.0]),
    };
    let objects: [&dyn WireObject; 6] = [
        &image,
        &sound,
        &matrix,
        &property,
        &pair,
        &VectorOf(vec![1i32, 2, 3]),
    ];
    let mut seeds = Vec::new();
    for wire_version in [WireVersion::V3, WireVersion::V4] {
        for object in objects {
            let mut bytes = BytesMut::new();
            object.write_binary(&mut bytes, wire_version);
            seeds.push(bytes.to_vec());
        }
    }
    seeds
}

/// Returns responses with parts, one of which has no announced length, and the head of an image.
fn streams() -> Vec<Vec<u8>> {
    let picture = b"\xff\xd8\xff\xe0\0\x04xx\xff\xfe\0\x087 1.5\0\xff\xda\0\x02y\xff\xd9";
    let mut own = BytesMut::from(RESPONSE);
    put_part(&mut own, picture);
    put_part(&mut own, b"");
    let camera =
        b"HTTP/1.1 200 OK\nContent-Type: multipart/mixed; boundary=\"--b\"\n\n\n--b\n\nab\r\n--b\n\
        Content-Length: 3\n\nabc\n--b--\n";
    vec![own.to_vec(), camera.to_vec(), picture.to_vec()]
}

/// Returns a message in pieces with a ping between them; a close frame; a length that lies.
fn frames() -> Vec<Vec<u8>> {
    vec![
        b"\x01\x83\0\0\0\0abc\x89\x82\x01\x02\x03\x04hi\x80\xfe\0\x01\0\0\0\0d".to_vec(),
        b"\x82\x88\0\0\0\0\0\0\0\0~d\0\x01\x88\x82\0\0\0\0\x03\xe8".to_vec(),
        b"\x82\xff\0\0\0\xff\0\0\0\0\0\0\0\0".to_vec(),
    ]
}

/// Handshakes, heads of segments that are and are not possible, and steps.
fn segments() -> Vec<Vec<u8>> {
    let heads: [([i32; 4], u16); 5] = [
        ([4096, 0, 0, 0], 4096),
        ([4096, 10, 4090, 16], 4100),
        ([100, 50, 50, 100], 100),
        ([100, 50, 50, 101], 100),
        ([i32::MAX, -1, 0, i32::MIN], 10),
    ];
    let seed = |(number, (head, room)): (usize, ([i32; 4], u16))| {
        let mut seed = vec![(number % 2) as u8, 0, 0, 0, 0, 16, 0, 0];
        seed.extend(head.iter().flat_map(|number| number.to_le_bytes()));
        seed.extend(room.to_le_bytes());
        seed.extend([3, 2, 255, 254, 101, 0, 1, 201, 200]);
        seed
    };
    heads.into_iter().enumerate().map(seed).collect()
}

/// Returns the carriers of the targets, each with its place.
fn on_the_wire() -> impl Iterator<Item = (u8, &'static Carrier)> {
    (0..CARRIERS.len() as u8).filter_map(|place| Some((place, carrier_at(place)?)))
}

/// Returns, for each carrier of the targets, the bytes of a writer after its header; preceded by
/// its index and the step.
fn behind_headers() -> Vec<Vec<u8>> {
    on_the_wire()
        .map(|(place, carrier)| [&[place, 7][..], &behind_header(carrier)].concat())
        .collect()
}

/// Returns the bytes of a writer after its header.
fn behind_header(carrier: &'static Carrier) -> BytesMut {
    let content = Bottle::parse("1 0.5 (a \"b\")").unwrap();
    let mut bytes = BytesMut::new();
    match carrier.name {
        "http" => bytes.extend_from_slice(b"TP/1.1\r\nHost: localhost\r\n\r\n"),
        "name_ser" => {
            bytes.extend_from_slice(b"query /x\nNAME_SERVER list\n");
        }
        "mjpeg" => bytes.extend_from_slice(b"whatever\r\n"),
        "websocket" => bytes.extend_from_slice(&frames()[0]),
        _ => {
            for command in [Command::data(true), Command::Admin, Command::data(false)] {
                put_message(
                    &mut bytes,
                    carrier,
                    &command,
                    Some(&content),
                    WireVersion::V3,
                );
            }
            put_message(&mut bytes, carrier, &Command::Quit, None, WireVersion::V3);
        }
    }
    bytes
}

/// Returns, for each carrier of the targets, a reader's answers to two requests and two messages;
/// preceded by its index, the sent items and the step.
fn from_readers() -> Vec<Vec<u8>> {
    let seed = |(place, carrier): (u8, &'static Carrier)| {
        let answers = answers_on(carrier);
        let mut bytes = vec![place, SENT, 5];
        if carrier.name == "websocket" {
            // One frame, under a mask that changes nothing.
            bytes.extend_from_slice(&[0x82, 0x80 | answers.len() as u8, 0, 0, 0, 0]);
        }
        bytes.extend_from_slice(&answers);
        bytes
    };
    on_the_wire().map(seed).collect()
}

/// Requests and messages in turn, as the targets read it.
const SENT: u8 = 0b10_01_10_01;

/// Returns a reader's answers to [`SENT`].
fn answers_on(carrier: &'static Carrier) -> BytesMut {
    let content = Bottle::parse("1 0.5 (a \"b\")").unwrap();
    let mut answers = BytesMut::new();
    for replies in [true, false, true, false] {
        if replies {
            let protocol = carrier.protocol;
            protocol.put_object(&content, WireVersion::V3, &mut answers);
            if matches!(carrier.name, "text" | "text_ack") {
                answers.extend_from_slice(b"\r\n");
            }
        }
        put_acknowledgement(&mut answers, carrier);
    }
    answers
}

/// Returns the side and the size of its steps in front; the key and the nonces are those of the target.
fn handshakes() -> Vec<Vec<u8>> {
    let key = Key::new(b"fuzz").unwrap();
    let (mut first, mut second, mut third) = (BytesMut::new(), BytesMut::new(), BytesMut::new());
    let mut acceptor = KeyHandshake::accept(key.clone(), [[1; 8], [3; 8]], &mut first);
    let mut initiator = KeyHandshake::initiate(key, [2; 8]);
    let challenge = first.to_vec();
    initiator.poll(&mut first, &mut second).unwrap();
    let answer = second.to_vec();
    acceptor.poll(&mut second, &mut third).unwrap();
    vec![
        [&[0, 7][..], &answer].concat(),
        [&[0, 40][..], &answer, b"CONNECT /x\r\n"].concat(),
        [&[1, 9][..], &challenge, &third].concat(),
        [&[1, 1][..], &challenge].concat(),
        [
            &[0, 3][..],
            b"CONNECT /a/port/without/a/key/and/a/long/name\r\n",
        ]
        .concat(),
    ]
}

fn configurations() -> Vec<Vec<u8>> {
    let texts = [
        "a 1\n[g]\nb = 2 // x\n[l h]\nc (1 2)\n[include g part.ini]\n[import c f.ini]\nd $HOME ${a}\n",
        "--a::b 1\n--a::b::c 2\n--a\n3\n--l\n(1 2)\n",
        "a (1\n2)\nb \"x\ny\" # z\nc 1\\\n2\n[g\n[]\n= =\n",
    ];
    texts.map(|text| text.as_bytes().to_vec()).into()
}
