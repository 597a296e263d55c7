//! The asynchronous packet (table 13).

use super::ProtocolError;

/// `sender` of the arm.
pub const ARM: i32 = 1;
/// `sender` of the hand.
pub const HAND: i32 = 2;
/// `type` of the end of a trajectory. Others must be ignored.
pub const TRAJECTORY: i32 = 1;

const MAX_TEXT_BYTES: usize = 100;

/// Five ints and 100 characters, sent by the embedded PC when an action has ended.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct Packet {
    /// [`ARM`] or [`HAND`].
    pub sender: i32,
    /// Number of the `trf` request that it answers, counted from 1 since the connection was opened.
    pub query: i32,
    /// Packets sent on this connection, counted from 1.
    pub reply: i32,
    /// Kind of action that has ended, for instance [`TRAJECTORY`].
    pub kind: i32,
    /// Reached; otherwise interrupted, or ended by a fault.
    pub done: bool,
    /// The reason why it did not reach its end: at most 100 characters of ASCII, empty if it did.
    pub reason: String,
}

impl Packet {
    /// The length of every packet.
    pub const LENGTH: usize = 20 + MAX_TEXT_BYTES;

    /// Encodes the fields in order; a reason that is too long is cut, characters other than ASCII become `?`.
    pub fn to_bytes(&self) -> [u8; Self::LENGTH] {
        let mut out = [0; Self::LENGTH];
        let (head, text) = out.split_at_mut(20);
        let fields = [
            self.sender,
            self.query,
            self.reply,
            self.kind,
            i32::from(self.done),
        ];
        for (slot, field) in head.as_chunks_mut::<4>().0.iter_mut().zip(fields) {
            *slot = field.to_le_bytes();
        }
        for (slot, letter) in text.iter_mut().zip(self.reason.chars()) {
            *slot = match letter {
                ' '..='~' => letter as u8,
                _ => b'?',
            };
        }
        out
    }

    /// Reads the fields.
    ///
    /// Errors: [`ProtocolError::Packet`] when sender or done have values that they cannot have.
    pub fn from_bytes(bytes: &[u8; Self::LENGTH]) -> Result<Self, ProtocolError> {
        let (head, text) = bytes.split_at(20);
        let mut fields = head.as_chunks::<4>().0.iter();
        let mut field = || fields.next().map_or(0, |bytes| i32::from_le_bytes(*bytes));
        let [sender, query, reply, kind, done] = std::array::from_fn(|_| field());
        if ![ARM, HAND].contains(&sender) {
            return Err(ProtocolError::Packet {
                field: "sender",
                value: sender,
                expected: "1 (arm) or 2 (hand)",
            });
        }
        if ![0, 1].contains(&done) {
            return Err(ProtocolError::Packet {
                field: "done",
                value: done,
                expected: "0 or 1",
            });
        }
        let letters = text.iter().take_while(|letter| **letter != 0);
        let printed = letters.map(|letter| match letter {
            b' '..=b'~' => char::from(*letter),
            _ => '?',
        });
        Ok(Self {
            sender,
            query,
            reply,
            kind,
            done: done == 1,
            reason: printed.collect(),
        })
    }
}

/// Cuts a stream into packets, on the driver's side.
#[derive(Clone, Debug, Default)]
pub struct PacketReader {
    bytes: Vec<u8>,
}

impl PacketReader {
    /// A reader at the beginning of a stream.
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes bytes as they came.
    pub fn push(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }

    /// The next whole packet, `None` until more bytes come.
    ///
    /// Errors: as [`Packet::from_bytes`], from then on always.
    pub fn next_packet(&mut self) -> Result<Option<Packet>, ProtocolError> {
        let Some(bytes) = self.bytes.first_chunk() else {
            return Ok(None);
        };
        let packet = Packet::from_bytes(bytes)?;
        self.bytes.drain(..Packet::LENGTH);
        Ok(Some(packet))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn packet(done: bool, reason: &str) -> Packet {
        Packet {
            sender: ARM,
            query: 1,
            reply: 1,
            kind: TRAJECTORY,
            done,
            reason: reason.to_owned(),
        }
    }

    #[test]
    fn the_first_end_of_a_move_is_these_bytes() {
        let mut expected = [0; 120];
        for field in 0..5 {
            expected[4 * field] = 1;
        }
        assert_eq!(packet(true, "").to_bytes(), expected);
    }

    #[test]
    fn a_reason_is_cut_to_its_room_and_to_ascii() {
        let long = packet(false, &"é".repeat(200));
        let read = Packet::from_bytes(&long.to_bytes()).unwrap();
        assert_eq!(read.reason, "?".repeat(100));
    }

    #[test]
    fn impossible_fields_are_named() {
        let mut bytes = packet(true, "").to_bytes();
        bytes[0] = 7;
        let error = Packet::from_bytes(&bytes).unwrap_err().to_string();
        assert!(error.contains("sender 7"), "{error}");
        bytes[0] = 1;
        bytes[16] = 2;
        let error = Packet::from_bytes(&bytes).unwrap_err().to_string();
        assert!(error.contains("done 2"), "{error}");
    }

    proptest! {
        #[test]
        fn any_split_gives_the_same_packets(
            cuts in prop::collection::vec(1_usize..200, 1..10),
            reasons in prop::collection::vec("[ -~]{0,100}", 0..4),
        ) {
            let packets: Vec<_> = reasons.iter().map(|reason| packet(reason.is_empty(), reason)).collect();
            let bytes: Vec<u8> = packets.iter().flat_map(|packet| packet.to_bytes()).collect();
            let (mut reader, mut read, mut rest) = (PacketReader::new(), Vec::new(), bytes.as_slice());
            for cut in cuts.iter().cycle() {
                if rest.is_empty() {
                    break;
                }
                let (piece, after) = rest.split_at((*cut).min(rest.len()));
                reader.push(piece);
                rest = after;
                while let Some(packet) = reader.next_packet().unwrap() {
                    read.push(packet);
                }
            }
            prop_assert_eq!(read, packets);
        }
    }
}
