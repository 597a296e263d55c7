//! Message counters of a port.
//!
//! Only data counts: no administration, no commands, no replies. Counting needs no clock and no
//! allocation per message. A closed connection still counts in the totals of its port.
//!
//! Programs query them by `[prop] [get] counters`, unless a property of that name has been set. The
//! answer is a bottle of groups:
//!
//! ```text
//! (port (received (messages N) (bytes N) (dropped N)) (sent (messages N) (bytes N) (dropped N))
//!       (waiting N))
//! (in (from PEER) (carrier C) (messages N) (bytes N) (dropped N) [(age SECONDS)])
//! (out (to PEER) (carrier C) (messages N) (bytes N) (dropped N) (queued BYTES) (unanswered N)
//!      [(age SECONDS)])
//! ```
//!
//! with one `in` or `out` for each connection; counts are 64-bit integers.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use yarp_wire::{Bottle, Stamp, Value};

use super::admin_reply::pair;

/// The counters of a port since it was opened.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct PortCounters {
    /// Received messages, over open and closed connections.
    pub received: Traffic,
    /// Sent messages, over open and closed connections.
    pub sent: Traffic,
    /// Messages that arrived and wait to be read.
    pub waiting: usize,
    /// The connections that are up.
    pub connections: Vec<ConnectionCounters>,
}

/// Messages and their payloads.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
#[non_exhaustive]
pub struct Traffic {
    /// Number of messages, including those a reader dropped.
    pub messages: u64,
    /// The bytes of their payloads.
    pub bytes: u64,
    /// Reader: messages dropped because they were not read soon enough, or arrived incomplete.
    /// Writer: messages not sent because the reader was busy, or that the system did not accept.
    pub dropped: u64,
}

/// The counters of one connection.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ConnectionCounters {
    /// The name at the other end.
    pub peer: String,
    /// Carrier with its modifiers.
    pub carrier: String,
    /// `true` if the port is the reader.
    pub incoming: bool,
    /// The messages of the connection.
    pub traffic: Traffic,
    /// Bytes that wait to be sent, heads included.
    pub queued: usize,
    /// Number of messages that the reader has not answered or acknowledged yet, if the carrier
    /// requires it.
    pub unanswered: usize,
    /// The newest envelope, where that is a stamp.
    pub stamp: Option<Stamp>,
    /// Age of the newest stamp in seconds, by the clock of this machine.
    ///
    /// It grows while nothing arrives. Stamps of other clocks make it meaningless.
    pub age: Option<f64>,
}

impl PortCounters {
    /// Returns the counters as a message.
    pub fn to_bottle(&self) -> Bottle {
        let mut port = Bottle::of("port");
        for (key, traffic) in [("received", self.received), ("sent", self.sent)] {
            let mut group = Bottle::of(key);
            group.extend(traffic.pairs());
            port.push(group);
        }
        port.push(pair("waiting", self.waiting as i64));
        let mut answer = Bottle::of(port);
        answer.extend(
            self.connections
                .iter()
                .map(|counted| counted.group().into()),
        );
        answer
    }
}

impl PortCounters {
    /// Parses the output of [`PortCounters::to_bottle`]; `None` if it is something else.
    ///
    /// Stamps are not transmitted. Missing or invalid values are zero.
    pub fn from_bottle(bottle: &Bottle) -> Option<Self> {
        let port = bottle.find_group("port")?;
        let traffic = |key| {
            let group = port.find_group(key);
            group.map(Traffic::of).unwrap_or_default()
        };
        let groups = bottle.iter().filter_map(Value::as_list);
        Some(Self {
            received: traffic("received"),
            sent: traffic("sent"),
            waiting: number(port, "waiting"),
            connections: groups.filter_map(ConnectionCounters::of).collect(),
        })
    }
}

impl Traffic {
    fn of(group: &Bottle) -> Self {
        Self {
            messages: number(group, "messages"),
            bytes: number(group, "bytes"),
            dropped: number(group, "dropped"),
        }
    }

    fn pairs(self) -> [Value; 3] {
        [
            pair("messages", self.messages as i64),
            pair("bytes", self.bytes as i64),
            pair("dropped", self.dropped as i64),
        ]
    }

    pub(crate) fn add(&mut self, other: Self) {
        self.messages += other.messages;
        self.bytes += other.bytes;
        self.dropped += other.dropped;
    }
}

/// Returns the number at `key`.
fn number<N: TryFrom<i64> + Default>(group: &Bottle, key: &str) -> N {
    let found = group.find(key).and_then(Value::as_i64);
    found.and_then(|n| n.try_into().ok()).unwrap_or_default()
}

impl ConnectionCounters {
    fn of(group: &Bottle) -> Option<Self> {
        let (incoming, key) = match group.get(0)?.as_str()? {
            "in" => (true, "from"),
            "out" => (false, "to"),
            _ => return None,
        };
        let text = |key: &str| group.find(key).map(Value::to_plain_string);
        Some(Self {
            peer: text(key)?,
            carrier: text("carrier")?,
            incoming,
            traffic: Traffic::of(group),
            queued: number(group, "queued"),
            unanswered: number(group, "unanswered"),
            stamp: None,
            age: group.find("age").and_then(Value::as_f64),
        })
    }

    fn group(&self) -> Bottle {
        let (kind, key) = match self.incoming {
            true => ("in", "from"),
            false => ("out", "to"),
        };
        let mut group = Bottle::of(kind);
        group.push(pair(key, self.peer.as_str()));
        group.push(pair("carrier", self.carrier.as_str()));
        group.extend(self.traffic.pairs());
        if !self.incoming {
            group.push(pair("queued", self.queued as i64));
            group.push(pair("unanswered", self.unanswered as i64));
        }
        group.extend(self.age.map(|age| pair("age", age)));
        group
    }
}

/// The newest envelope, if it is short enough to be a stamp.
///
/// It is copied, so that the receive buffer is free for the next message, and parsed only on
/// demand.
#[derive(Debug)]
pub(crate) struct LatestEnvelope {
    length: usize,
    text: [u8; Self::MAX_ENVELOPE_LEN],
}

impl Default for LatestEnvelope {
    fn default() -> Self {
        Self {
            length: 0,
            text: [0; Self::MAX_ENVELOPE_LEN],
        }
    }
}

impl LatestEnvelope {
    /// A count of 32 bits, a blank and a time of 15 digits with sign and exponent take 34.
    const MAX_ENVELOPE_LEN: usize = 40;

    pub(crate) fn keep(&mut self, envelope: &[u8]) {
        self.length = match envelope.len() {
            length if length <= Self::MAX_ENVELOPE_LEN => length,
            _ => 0,
        };
        self.text[..self.length].copy_from_slice(&envelope[..self.length]);
    }

    pub(crate) fn stamp(&self) -> Option<Stamp> {
        let text = std::str::from_utf8(&self.text[..self.length]).ok()?;
        text.parse().ok()
    }
}

/// Counts what arrives over one connection.
#[derive(Debug, Default)]
pub(crate) struct Meter {
    messages: AtomicU64,
    bytes: AtomicU64,
    dropped: AtomicU64,
    newest: Mutex<LatestEnvelope>,
}

impl Meter {
    /// A message arrived. To be called by the task of the connection alone: it is the only one
    /// that writes these two, so they need no more than a load and a store.
    pub(crate) fn count(&self, bytes: usize, envelope: Option<&[u8]>) {
        let add = |counter: &AtomicU64, more: u64| {
            let sum = counter.load(Ordering::Relaxed).wrapping_add(more);
            counter.store(sum, Ordering::Relaxed);
        };
        add(&self.messages, 1);
        add(&self.bytes, bytes as u64);
        if let Some(envelope) = envelope {
            let mut newest = self.newest.lock().unwrap_or_else(PoisonError::into_inner);
            newest.keep(envelope);
        }
    }

    /// A message was dropped.
    pub(crate) fn drop_one(&self) {
        self.dropped.fetch_add(1, Ordering::Relaxed);
    }

    pub(crate) fn traffic(&self) -> Traffic {
        Traffic {
            messages: self.messages.load(Ordering::Relaxed),
            bytes: self.bytes.load(Ordering::Relaxed),
            dropped: self.dropped.load(Ordering::Relaxed),
        }
    }

    pub(super) fn stamp(&self) -> Option<Stamp> {
        let newest = self.newest.lock().unwrap_or_else(PoisonError::into_inner);
        newest.stamp()
    }
}

/// The counters of closed connections.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Ended {
    pub(crate) received: Traffic,
    pub(crate) sent: Traffic,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counters_survive_a_round_trip() {
        let told = "(port (received (messages 3) (bytes 36) (dropped 1)) \
            (sent (messages 2) (bytes 24) (dropped 0)) (waiting 1)) \
            (in (from \"/a b\") (carrier tcp) (messages 3) (bytes 36) (dropped 1) (age 0.5)) \
            (out (to /c) (carrier udp) (messages 2) (bytes 24) (dropped 0) (queued 7) (unanswered 1))";
        let told = Bottle::parse(told).unwrap();
        let read = PortCounters::from_bottle(&told).unwrap();
        assert_eq!(read.connections[0].peer, "/a b");
        assert_eq!(
            read.to_bottle(),
            PortCounters::from_bottle(&read.to_bottle())
                .unwrap()
                .to_bottle()
        );
        assert_eq!(read.to_bottle().to_string(), told.to_string());
    }

    #[test]
    fn invalid_counters_of_other_ports_are_tolerated() {
        let read = |text: &str| PortCounters::from_bottle(&Bottle::parse(text).unwrap());
        assert_eq!(read(""), None);
        assert_eq!(read("[fail] \"what?\""), None);
        assert_eq!(read("(port)"), Some(PortCounters::default()));
        let odd = "(port (waiting -1) (sent 5)) (in) (out (to)) (in (from /a)) 7 (x (from /a))";
        assert_eq!(read(odd), Some(PortCounters::default()));
    }

    #[test]
    fn only_stamps_have_an_age() {
        let check = |envelope: &str, expected: Option<Stamp>| {
            let mut newest = LatestEnvelope::default();
            newest.keep(b"1 2.5");
            newest.keep(envelope.as_bytes());
            assert_eq!(newest.stamp(), expected, "{envelope}");
        };
        check("7 1700000000.25", Some(Stamp::new(7, 1_700_000_000.25)));
        check(
            "-2147483648 -1.23456789012345e-100",
            "-2147483648 -1.23456789012345e-100".parse().ok(),
        );
        check("", None);
        check("hello", None);
        check(&format!("1 2.{}", "0".repeat(100)), None);
    }
}
