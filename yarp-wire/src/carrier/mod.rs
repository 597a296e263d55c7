//! The carriers: the ways bytes travel between two ports.
//!
//! Each carrier has a file for its peculiarities; [`ALL`] is the only table that lists them. To add
//! one: write its file and add its line to the table.

mod fast_tcp;
mod http;
mod local;
mod mcast;
mod mjpeg;
mod name_ser;
mod shmem;
mod specifier;
mod tcp;
mod text;
mod text_ack;
mod tls;
mod udp;
mod unix_stream;
mod websocket;

use std::fmt;

use crate::protocol::Protocol;

pub use mcast::put_group;
pub use specifier::{CarrierSpec, CarrierSpecError, Sender, options};

/// Bytes by which an acceptor knows the carrier.
pub const MAGIC: usize = 8;

/// The transport of messages after the header.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[non_exhaustive]
pub enum Transport {
    /// The connection of the header itself.
    Stream,
    /// The connection of the header itself, which is encrypted from its first byte on; the driver does that.
    Encrypted,
    /// Datagrams, to the port that the header reply names; the connection of the header ends.
    Datagrams,
    /// A socket of the file system, named after the TCP ports of the two ends of the header's
    /// connection, which ends.
    UnixSocket,
    /// Memory that both processes map ([`shmem`](crate::shmem)). A connection to the port that the
    /// header reply names detects the end of the other process; the connection of the header
    /// closes.
    SharedMemory,
    /// None: writer and reader are in one process.
    Local,
    /// Datagrams to a multicast group that the initiator names behind its header.
    Group,
}

impl Transport {
    /// Returns whether messages stay inside a connection that is encrypted.
    pub fn is_encryptable(self) -> bool {
        matches!(self, Self::Stream | Self::Encrypted)
    }
}

/// The description of a carrier.
#[derive(Debug)]
#[non_exhaustive]
pub struct Carrier {
    /// Its name in carrier strings.
    pub name: &'static str,
    /// The first bytes that an initiator sends.
    pub magic: [u8; MAGIC],
    /// Returns `true` if an acceptor takes these first bytes for this carrier.
    pub recognises: fn(&[u8; MAGIC]) -> bool,
    /// The protocol of the two ends.
    pub protocol: &'static dyn Protocol,
    /// The transport of the protocol's bytes.
    pub transport: Transport,
    /// `true` if the acceptor acknowledges each message.
    pub acknowledges: bool,
    /// `true` if stock lists the connections with `(connectionless 1)` and closes them out of band:
    /// only the datagram carriers (recorded traffic of 3.12.3 and 4.0.0).
    pub connectionless: bool,
    /// `true` if the writer connects to the reader; otherwise the reader connects and pulls.
    pub push: bool,
    /// `true` if ports initiate such connections; otherwise only browsers do.
    pub initiates: bool,
}

/// Every carrier, in the order in which an acceptor tries them.
pub static ALL: [&Carrier; 15] = [
    &http::HTTP,
    &name_ser::NAME_SER,
    &local::LOCAL,
    &tcp::TCP,
    &fast_tcp::FAST_TCP,
    &mcast::MCAST,
    &udp::UDP,
    &text::TEXT,
    &text_ack::TEXT_ACK,
    &unix_stream::UNIX_STREAM,
    &unix_stream::UNIX_STREAM_ACK,
    &shmem::SHMEM,
    &mjpeg::MJPEG,
    &websocket::WEBSOCKET,
    &tls::TLS,
];

impl Carrier {
    /// Returns the carrier that these first bytes of a connection select.
    pub fn detect(magic: &[u8; MAGIC]) -> Option<&'static Self> {
        ALL.into_iter().find(|carrier| (carrier.recognises)(magic))
    }

    /// Returns whether connections begin with an HTTP request, as those of browsers do.
    pub fn begins_with_http(&self) -> bool {
        self.magic.starts_with(b"GET ")
    }

    /// Returns the carrier of this name, without modifiers.
    pub fn by_name(name: &str) -> Option<&'static Self> {
        ALL.into_iter().find(|carrier| carrier.name == name)
    }

    /// Returns the carrier that a carrier string names: `unix_stream+ack` is another than `unix_stream`.
    pub fn of(spec: &CarrierSpec) -> Option<&'static Self> {
        let acknowledges = spec.modifier("ack").is_some();
        let mut named = ALL.into_iter().filter(|carrier| carrier.name == spec.base);
        let first = named.next()?;
        let chosen = named.find(|carrier| carrier.acknowledges == acknowledges);
        Some(chosen.filter(|_| acknowledges).unwrap_or(first))
    }
}

impl PartialEq for Carrier {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Eq for Carrier {}

impl fmt::Display for Carrier {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

/// Returns the magic of a binary carrier: the number 7777 plus its specifier.
const fn magic(specifier: i32) -> [u8; MAGIC] {
    crate::framed_number::encode(7777 + specifier)
}

/// Returns the specifier in a magic; its low four bits choose the carrier.
const fn specifier(magic: &[u8; MAGIC]) -> Option<i32> {
    match crate::framed_number::decode(magic) {
        Some(number) => number.checked_sub(7777),
        None => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_bytes_select_the_carrier() {
        let check = |magic: &[u8; MAGIC], name: Option<&str>| {
            assert_eq!(Carrier::detect(magic).map(|carrier| carrier.name), name);
        };
        check(b"YA\xe4\x1e\0\0RP", Some("tcp"));
        check(b"YA\x64\x1e\0\0RP", Some("fast_tcp"));
        check(b"YA\x61\x1e\0\0RP", Some("udp"));
        check(b"YA\xe1\x1e\0\0RP", Some("udp"));
        check(b"YA\x62\x1e\0\0RP", Some("mcast"));
        check(b"YA\x6f\x1e\0\0RP", Some("shmem"));
        check(b"CONNECT ", Some("text"));
        check(b"CONNACK ", Some("text_ack"));
        check(b"NAME_SER", Some("name_ser"));
        check(b"GET / HT", Some("http"));
        check(b"GET /dat", Some("http"));
        check(b"POST /fo", Some("http"));
        check(b"GET /?ac", Some("mjpeg"));
        check(b"GET /?ws", Some("websocket"));
        check(b"GET /?wt", Some("http"));
        check(b"LOCALITY", Some("local"));
        check(b"YARP_TLS", Some("tls"));
        check(b"GARBAGE!", None);
        check(b"YA\0\0\0\x80RP", None);
        for carrier in ALL {
            check(&carrier.magic, Some(carrier.name));
        }
        let http = ALL.into_iter().filter(|carrier| carrier.begins_with_http());
        let http: Vec<_> = http.map(|carrier| carrier.name).collect();
        assert_eq!(http, ["http", "mjpeg", "websocket"]);
        let of = |spec: &str| Carrier::of(&spec.parse().unwrap()).unwrap().acknowledges;
        assert!(!of("unix_stream") && of("unix_stream+ack") && of("tcp") && !of("fast_tcp+ack"));
    }
}
