//! MJPEG streams: written parts are read for any split, and false claims are refused.

use bytes::{Bytes, BytesMut};
use proptest::prelude::*;
use yarp_wire::carrier::Carrier;
use yarp_wire::connection::{Acceptor, Event, Initiator};
use yarp_wire::mjpeg::{MjpegError, Part, PartReader, RESPONSE, comment, put_part, request};
use yarp_wire::{Limits, WireVersion};

fn stream(bodies: &[Vec<u8>]) -> Vec<u8> {
    let mut out = BytesMut::from(RESPONSE);
    for body in bodies {
        put_part(&mut out, body);
    }
    out.to_vec()
}

/// All parts of a stream that arrives in these pieces.
fn parts<'a>(pieces: impl IntoIterator<Item = &'a [u8]>) -> Result<Vec<Part>, MjpegError> {
    let mut reader = PartReader::new(Limits::DEFAULT.with_message(1 << 16));
    let mut input = BytesMut::new();
    let mut parts = Vec::new();
    for piece in pieces {
        input.extend_from_slice(piece);
        while let Some(part) = reader.read(&mut input)? {
            parts.push(part);
        }
    }
    Ok(parts)
}

fn picture(body: &[u8]) -> Part {
    Part {
        kind: "image/jpeg".to_owned(),
        body: Bytes::copy_from_slice(body),
    }
}

proptest! {
    #[test]
    fn written_parts_are_read(
        bodies in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..200), 0..4),
    ) {
        let bytes = stream(&bodies);
        let expected: Vec<Part> = bodies.iter().map(|body| picture(body)).collect();
        prop_assert_eq!(parts([&bytes[..]]).unwrap(), expected.clone());
        for cut in 0..bytes.len() {
            let (a, b) = bytes.split_at(cut);
            prop_assert_eq!(parts([a, b]).unwrap(), expected.clone());
        }
        prop_assert_eq!(parts(bytes.chunks(1)).unwrap(), expected);
    }

    #[test]
    fn any_bytes_are_survived(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let _ = parts([&bytes[..]]);
        let _ = parts([RESPONSE.as_bytes(), &bytes]);
        let _ = comment(&bytes.clone().into());
        let _ = comment(&[b"\xff\xd8", &bytes[..]].concat().into());
    }
}

/// The ways of cameras: lengths left out, boundaries with hyphens and quotes, other kinds of parts.
#[test]
fn cameras_differ() {
    let check = |kind: &str, rest: &str, expected: &[(&str, &str)]| {
        let text = format!("HTTP/1.1 200 OK\nX: y\ncontent-TYPE: {kind}\n\n{rest}");
        let expected: Vec<Part> = expected
            .iter()
            .map(|(kind, body)| Part {
                kind: (*kind).to_owned(),
                body: Bytes::copy_from_slice(body.as_bytes()),
            })
            .collect();
        assert_eq!(parts([text.as_bytes()]).unwrap(), expected, "{text}");
        assert_eq!(parts(text.as_bytes().chunks(1)).unwrap(), expected);
    };
    check(
        "multipart/x-mixed-replace; boundary=\"b\"",
        "\n--b\nContent-Length: 2\n\nxy\n--bother\n--b\n\nab\r\n--\r\n--c\r\n--b\r\n",
        &[("", "xy"), ("", "ab\r\n--\r\n--c")],
    );
    check(
        "Multipart/X-Mixed-Replace;x=1;boundary=--b",
        "--b\r\nContent-Type: text/plain\r\nContent-Length:0\r\n\r\n\r\n--b\r\n",
        &[("text/plain", "")],
    );
}

#[test]
fn false_claims_are_refused() {
    let check = |text: &str, expected: MjpegError| {
        assert_eq!(
            parts([text.as_bytes()]),
            Err(expected.clone()),
            "{text:.80}"
        );
        assert_eq!(parts(text.as_bytes().chunks(7)), Err(expected));
    };
    let status = |got: &str| MjpegError::Status {
        got: got.to_owned(),
    };
    check("SSH-2.0\r\n", status("SSH-2.0"));
    check(
        "HTTP/1.0 404 Not Found\r\n",
        status("HTTP/1.0 404 Not Found"),
    );
    let html = "HTTP/1.0 200 OK\r\nContent-Type: text/html\r\n\r\n";
    let got = "text/html".to_owned();
    check(html, MjpegError::Kind { got });
    let part = |rest: &str| format!("{RESPONSE}{rest}");
    let limit = 1 << 16;
    for length in ["65537", "99999999999", "18446744073709551615"] {
        let text = part(&format!("Content-Length: {length}\r\n"));
        check(&text, MjpegError::TooLarge { limit });
    }
    for length in ["-1", "x", "", "18446744073709551616"] {
        let got = length.to_owned();
        let text = part(&format!("Content-Length: {length}\r\n"));
        check(&text, MjpegError::Length { got });
    }
    check(
        &part(&format!("\r\n{}", "x".repeat(70_000))),
        MjpegError::TooLarge { limit },
    );
    let limit = 64 * 1024;
    check(
        &part(&"X: y\r\n".repeat(20_000)),
        MjpegError::Head { limit },
    );
    check(&part(&"x".repeat(70_000)), MjpegError::Head { limit });
    check(&"x".repeat(70_000), MjpegError::Head { limit });
    check(
        &part("Content-Length: 1\r\n\r\nx\r\n--boundarydonotcross--\r\n"),
        MjpegError::Ended,
    );
}

/// The request of stock 3.5.0 has its empty line in the middle; the rest is ignored.
#[test]
fn requests_open_the_connection() {
    let stock = "GET /?action=stream\n\n HTTP/1.1\nHost: h\r\n\n";
    for text in [stock, &request(None, "10.0.0.2")] {
        for cut in 0..text.len() {
            let mut acceptor = Acceptor::new(1, WireVersion::V3, Limits::DEFAULT);
            let (mut input, mut output) = (BytesMut::new(), BytesMut::new());
            let mut opened = None;
            for piece in [&text[..cut], &text[cut..]] {
                input.extend_from_slice(piece.as_bytes());
                if opened.is_none() {
                    opened = acceptor.poll(&mut input, &mut output).unwrap();
                }
            }
            let Some(Event::Opened {
                carrier, sender, ..
            }) = opened
            else {
                panic!("{opened:?}");
            };
            assert_eq!((carrier.name, sender.name.as_str()), ("mjpeg", "null"));
            assert_eq!(output, RESPONSE);
            let mut writing = Initiator::established(carrier, WireVersion::V3, Limits::DEFAULT);
            assert_eq!(writing.poll(&mut input), Ok(None));
        }
    }
    assert!(!Carrier::by_name("mjpeg").unwrap().push);
    assert_eq!(
        request(Some("a b\r\nc"), "h\n:1"),
        "GET /abc HTTP/1.0\r\nHost: h:1\r\n\r\n"
    );
}
