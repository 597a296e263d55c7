//! The protocol of the arm's embedded PC: requests, answers, asynchronous packets.

use yarp_devices::embedded::protocol::{
    Kind, Packet, PacketReader, ReplyReader, Request, RequestReader,
};

/// One fuzz target: its name, which is also that of its corpus, and what it does.
pub type Target = (&'static str, fn(&[u8]));

/// The targets about the embedded PC.
pub const TARGETS: [Target; 3] = [
    ("embedded_request", request),
    ("embedded_reply", reply),
    ("embedded_packet", packet),
];

/// The first byte is the length of the pieces in which the rest arrives.
fn pieces(data: &[u8]) -> (&[u8], usize) {
    match data.split_first() {
        Some((&first, rest)) => (rest, usize::from(first).max(1)),
        None => (data, 1),
    }
}

/// Requests: any split gives the same, what is read is written as it came, and little is kept.
pub fn request(data: &[u8]) {
    let (data, length) = pieces(data);
    for joints in [4, 7] {
        let mut whole = RequestReader::new(joints);
        whole.push(data);
        let mut read = Vec::new();
        let end = loop {
            match whole.next_request() {
                Ok(Some(request)) => read.extend(request.to_bytes()),
                Ok(None) => break None,
                Err(error) => break Some(error),
            }
        };
        assert_eq!(read, data[..read.len()]);
        if end.is_none() {
            assert!(whole.unfinished() < 3 + 8 * joints.max(6));
            assert_eq!(read.len() + whole.unfinished(), data.len());
        }
        let mut split = RequestReader::new(joints);
        let mut again = Vec::new();
        let mut ended = None;
        for piece in data.chunks(length) {
            split.push(piece);
            while let Some(request) = split.next_request().unwrap_or_else(|error| {
                ended = Some(error);
                None
            }) {
                again.extend(Request::to_bytes(&request));
            }
        }
        assert_eq!((again, ended), (read, end));
    }
}

/// Answers, to a kind of request that the first byte selects: what is understood is written as it came.
pub fn reply(data: &[u8]) {
    let (data, which) = pieces(data);
    let kind = Kind::ALL[which % Kind::ALL.len()];
    let whole = ReplyReader::new(kind, 7).push(data);
    if let Ok(Some(reply)) = &whole {
        let written = reply.to_bytes();
        assert_eq!(written, data[..written.len()]);
    }
    let mut split = ReplyReader::new(kind, 7);
    let mut last = Ok(None);
    for byte in data {
        last = split.push(&[*byte]);
        // Nothing is read after a reply.
        if !matches!(last, Ok(None)) {
            break;
        }
    }
    let understood = |outcome: &Result<_, _>| matches!(outcome, Ok(Some(_)));
    if understood(&whole) {
        assert!(understood(&last));
    }
}

/// Asynchronous packets: any split gives the same, and what is read is the same again when written.
pub fn packet(data: &[u8]) {
    let (data, length) = pieces(data);
    let read = |length: usize| {
        let mut reader = PacketReader::new();
        let mut packets = Vec::new();
        for piece in data.chunks(length.max(1)) {
            reader.push(piece);
            loop {
                match reader.next_packet() {
                    Ok(Some(packet)) => packets.push(packet),
                    Ok(None) => break,
                    Err(error) => return (packets, Some(error)),
                }
            }
        }
        (packets, None)
    };
    let whole = read(data.len());
    for packet in &whole.0 {
        assert!(packet.reason.len() <= 100);
        assert_eq!(Packet::from_bytes(&packet.to_bytes()).as_ref(), Ok(packet));
    }
    assert_eq!(read(length), whole);
}
