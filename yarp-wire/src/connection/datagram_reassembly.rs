//! Reassembly of messages from datagrams.

use bytes::BytesMut;

use crate::datagram;
use crate::message_limits::Limits;
use crate::protocol::{IndexedMessageDecoder, Message, ProtocolError};
use crate::ready::Ready;
use crate::wire_version::WireVersion;

/// Reassembles messages from datagrams that may be lost, duplicated, reordered or damaged.
///
/// A message whose datagrams do not arrive in order is dropped whole; the next one starts afresh.
#[derive(Debug)]
pub struct DatagramReassembler {
    wire_version: WireVersion,
    limits: Limits,
    messages: IndexedMessageDecoder,
    bytes: BytesMut,
    /// The number of the next datagram of the current message; 0 if there is none.
    next: i32,
    /// Datagrams from this number on belong to a message that has been given up already.
    skipping: i32,
    dropped: u64,
}

impl DatagramReassembler {
    /// Creates a reader that waits for the first datagram of a message.
    pub fn new(wire_version: WireVersion, limits: Limits) -> Self {
        Self {
            wire_version,
            limits,
            messages: IndexedMessageDecoder::new(wire_version, limits),
            bytes: BytesMut::new(),
            next: 0,
            skipping: i32::MAX,
            dropped: 0,
        }
    }

    /// Takes a datagram; returns the message that it completes.
    ///
    /// Only a message that contradicts itself is an error; the reader can continue after it.
    pub fn receive(&mut self, bytes: &[u8]) -> Ready<Message, ProtocolError> {
        let datagram = match datagram::decode(bytes) {
            Ok(datagram) if datagram.number == datagram::WAKE_UP => return Ok(None),
            Ok(datagram) => datagram,
            Err(_) => {
                self.give_up(1);
                return Ok(None);
            }
        };
        let number = datagram.number;
        if number == 0 {
            if self.next != 0 {
                self.dropped += 1;
            }
            self.restart();
        } else if number != self.next {
            if self.next == 0 && number >= self.skipping {
                self.skipping = number.wrapping_add(1);
            } else {
                self.give_up(number.wrapping_add(1));
            }
            return Ok(None);
        }
        self.bytes.extend_from_slice(datagram.data);
        self.next = number.wrapping_add(1);
        match self.messages.take(&mut self.bytes) {
            Ok(None) => Ok(None),
            Ok(Some(message)) => {
                self.restart();
                Ok(Some(message))
            }
            Err(error) => {
                self.give_up(self.next);
                Err(error)
            }
        }
    }

    /// Returns the number of messages dropped because some of their datagrams were lost or damaged.
    /// A message of which no datagram arrived is not counted.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    /// The message in progress cannot be completed; its datagrams from `skipping` on are of no use.
    fn give_up(&mut self, skipping: i32) {
        self.dropped += 1;
        self.restart();
        self.skipping = skipping;
    }

    /// Forgets the message in progress and waits for the start of another.
    fn restart(&mut self) {
        self.bytes.clear();
        self.next = 0;
        self.skipping = i32::MAX;
        self.messages = IndexedMessageDecoder::new(self.wire_version, self.limits);
    }
}

#[cfg(test)]
mod tests {
    use bytes::Bytes;

    use super::*;
    use crate::Bottle;
    use crate::carrier::Carrier;
    use crate::connection::put_message;
    use crate::message::Command;

    fn message(bottle: &Bottle) -> Bytes {
        let mut out = BytesMut::new();
        let carrier = Carrier::by_name("udp").unwrap();
        let command = Command::data(false);
        put_message(&mut out, carrier, &command, Some(bottle), WireVersion::V3);
        out.freeze()
    }

    #[test]
    fn messages_survive_what_happens_to_others() {
        let long = Bottle::of("x".repeat(100));
        let short = Bottle::parse("1 2").unwrap();
        let cut: Vec<Vec<u8>> = datagram::split(&message(&long), 50).collect();
        let whole = datagram::encode(0, &message(&short));
        let mut reader = DatagramReassembler::new(WireVersion::V3, Limits::DEFAULT);
        let mut read = |datagrams: &[&Vec<u8>]| -> Vec<Bottle> {
            datagrams
                .iter()
                .filter_map(|bytes| reader.receive(bytes).unwrap())
                .map(|message| message.payload.to_bottle().unwrap())
                .collect()
        };
        let all: Vec<&Vec<u8>> = cut.iter().collect();
        assert_eq!(read(&all), std::slice::from_ref(&long));
        assert_eq!(
            read(&[&cut[0], &cut[2], &whole]),
            std::slice::from_ref(&short),
            "one lost"
        );
        assert_eq!(read(&[&cut[0], &cut[0], &cut[1]]), [], "one doubled");
        assert_eq!(
            read(&[&cut[1], &cut[0], &whole]),
            std::slice::from_ref(&short),
            "out of order"
        );
        let mut damaged = cut[1].clone();
        damaged[20] ^= 1;
        assert_eq!(
            read(&[&cut[0], &damaged, &cut[2], &whole]),
            [short],
            "one damaged"
        );
        assert_eq!(read(&all), [long]);
    }

    /// Every datagram behind a lost one counted.
    #[test]
    fn each_message_that_is_given_up_counts_once() {
        let long = Bottle::of("x".repeat(200));
        let cut: Vec<Vec<u8>> = datagram::split(&message(&long), 50).collect();
        let (first, last) = (&cut[0], cut.len() - 1);
        let mut damaged = cut[2].clone();
        damaged[20] ^= 1;
        let check = |datagrams: &[&[Vec<u8>]], dropped| {
            let mut reader = DatagramReassembler::new(WireVersion::V3, Limits::DEFAULT);
            for bytes in datagrams.concat() {
                reader.receive(&bytes).unwrap();
            }
            assert_eq!(reader.dropped(), dropped);
        };
        check(&[&cut, &cut], 0);
        check(&[&cut[1..]], 1);
        check(&[&cut[1..], &cut[1..], &cut], 2);
        check(&[&cut[..2], &cut[3..], &cut], 1);
        check(&[&cut[..last], &cut], 1);
        check(&[&cut[..2], &[damaged], &cut[3..], &cut], 1);
        check(&[std::slice::from_ref(first), &cut], 1);
    }
}
