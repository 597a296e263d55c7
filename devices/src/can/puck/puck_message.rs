//! The content of a frame.

use super::{
    Address, Group, Node, PuckProperty, Target, pack_position, pack_torques, unpack_position,
    unpack_torques,
};
use crate::can::CanFrame;

/// The bit beside a property's number that marks a following value.
const SET: u8 = 0x80;

/// A frame as a value.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum PuckMessage {
    /// A query for a property.
    Get(PuckProperty),
    /// A property and its value: a command if it goes to a puck, a reply if it goes to [`Group::REPLIES`].
    Value {
        /// The property.
        property: PuckProperty,
        /// Its value; those of 16 bits are sign-extended.
        value: i32,
    },
    /// Position of a motor, and of the joint behind it if that has an encoder; to [`Group::POSITIONS`].
    Position {
        /// Counts of the motor, 22 bits with sign.
        motor: i32,
        /// Counts of the joint, 22 bits with sign.
        joint: Option<i32>,
    },
    /// Torques of four motors, 14 bits with sign each; to a group.
    Torques([i16; 4]),
}

/// Reasons why a frame is invalid.
#[derive(Clone, Copy, Debug, Eq, PartialEq, thiserror::Error)]
pub enum InvalidFrame {
    /// There is no message of this length to this receiver.
    #[error("{bytes} bytes, expected {expected}")]
    Length {
        /// Its length.
        bytes: usize,
        /// Lengths that are valid.
        expected: &'static str,
    },
    /// The bit that distinguishes a value from a query does not fit the length.
    #[error("{bytes} bytes that begin with {first:02X}: neither a query nor a value")]
    Kind {
        /// Its first byte.
        first: u8,
        /// Its length.
        bytes: usize,
    },
    /// The byte behind the property's number is not 0.
    #[error("a value with {padding:02X} behind its property, expected 00")]
    Padding {
        /// The byte.
        padding: u8,
    },
}

impl PuckMessage {
    /// Reads any frame.
    pub fn read(frame: &CanFrame) -> Result<(Address, Self), InvalidFrame> {
        let address = Address::of_id(frame.id());
        let bytes = frame.bytes();
        if address.to == Target::Group(Group::POSITIONS) {
            return Ok((address, Self::read_position(bytes)?));
        }
        let message = match *bytes {
            [first] if first & SET == 0 => Self::Get(PuckProperty::new(first)),
            [first, 0, low, high] if first & SET != 0 => Self::Value {
                property: PuckProperty::new(first),
                value: i32::from(i16::from_le_bytes([low, high])),
            },
            [first, 0, a, b, c, d] if first & SET != 0 => Self::Value {
                property: PuckProperty::new(first),
                value: i32::from_le_bytes([a, b, c, d]),
            },
            [first, a, b, c, d, e, f, g]
                if first == SET | PuckProperty::T.number()
                    && matches!(address.to, Target::Group(_)) =>
            {
                Self::Torques(unpack_torques([a, b, c, d, e, f, g]))
            }
            [first, padding, _, _] | [first, padding, _, _, _, _] if first & SET != 0 => {
                return Err(InvalidFrame::Padding { padding });
            }
            [first, ..] if matches!(bytes.len(), 1 | 4 | 6 | 8) => {
                let bytes = bytes.len();
                return Err(InvalidFrame::Kind { first, bytes });
            }
            _ => {
                return Err(InvalidFrame::Length {
                    bytes: bytes.len(),
                    expected: "1, 4, 6 or 8",
                });
            }
        };
        Ok((address, message))
    }

    fn read_position(bytes: &[u8]) -> Result<Self, InvalidFrame> {
        match *bytes {
            [a, b, c] => Ok(Self::Position {
                motor: unpack_position([a, b, c]),
                joint: None,
            }),
            [a, b, c, d, e, f] => Ok(Self::Position {
                motor: unpack_position([a, b, c]),
                joint: Some(unpack_position([d, e, f])),
            }),
            _ => Err(InvalidFrame::Length {
                bytes: bytes.len(),
                expected: "3 or 6",
            }),
        }
    }

    /// Encodes the message as a frame. Values of properties of 32 bits, and others that do not fit into 16, take 6
    /// bytes.
    pub fn frame(self, address: Address) -> CanFrame {
        let mut bytes = [0; 8];
        let length = match self {
            Self::Get(property) => {
                bytes[0] = property.number();
                1
            }
            Self::Value { property, value } => {
                bytes[0] = SET | property.number();
                bytes[2..6].copy_from_slice(&value.to_le_bytes());
                match i16::try_from(value) {
                    // The same numbers are 16 bits wide at the safety module.
                    Ok(_) if !property.is_wide() || address.concerns(Node::SAFETY) => 4,
                    _ => 6,
                }
            }
            Self::Position { motor, joint } => {
                bytes[..3].copy_from_slice(&pack_position(motor));
                match joint {
                    None => 3,
                    Some(joint) => {
                        bytes[3..6].copy_from_slice(&pack_position(joint));
                        6
                    }
                }
            }
            Self::Torques(torques) => {
                bytes[0] = SET | PuckProperty::T.number();
                bytes[1..].copy_from_slice(&pack_torques(torques));
                8
            }
        };
        CanFrame::new(address.id(), &bytes[..length]).expect("addresses have 11 bits")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn puck(number: u8) -> Node {
        Node::new(number).expect("a node")
    }

    fn answer(from: u8) -> Address {
        Address {
            from: puck(from),
            to: Group::REPLIES.into(),
        }
    }

    fn set(property: PuckProperty, value: i32) -> PuckMessage {
        PuckMessage::Value { property, value }
    }

    /// Frames of libbarrett's and the wiki's examples.
    #[test]
    fn frames_are_those_of_the_documents() {
        let check = |message: PuckMessage, address: Address, frame: &str| {
            let written = message.frame(address);
            assert_eq!(written.to_string(), frame);
            assert_eq!(PuckMessage::read(&written), Ok((address, message)));
        };
        let to = |number: u8| Address::from_host(puck(number));
        let safety = Address::from_host(Node::SAFETY);
        check(PuckMessage::Get(PuckProperty::STAT), to(1), "001: 05");
        check(set(PuckProperty::STAT, 2), answer(1), "426: 85 00 02 00");
        check(
            set(PuckProperty::CTS, 4096),
            answer(1),
            "426: C4 00 00 10 00 00",
        );
        check(set(PuckProperty::VL2, 4096), safety, "00A: AE 00 00 10");
        check(set(PuckProperty::TL2, 5204), safety, "00A: B0 00 54 14");
        check(
            set(PuckProperty::PEN, 0x0D3F_1249),
            answer(10),
            "546: AB 00 49 12 3F 0D",
        );
        check(
            set(PuckProperty::P, -36833),
            to(2),
            "002: B0 00 1F 70 FF FF",
        );
        check(
            PuckMessage::Torques([1000, -1000, 500, -1]),
            Address::from_host(Group::LOWER_TORQUES),
            "401: AA 0F A3 C1 80 7D 3F FF",
        );
        let positions = Address {
            from: puck(7),
            to: Group::POSITIONS.into(),
        };
        let motor = -100_000;
        check(
            PuckMessage::Position { motor, joint: None },
            positions,
            "4E3: 3E 79 60",
        );
    }

    #[test]
    fn both_lengths_of_a_value_are_read() {
        for bytes in [
            &[0xAE, 0, 0xFE, 0xFF][..],
            &[0xAE, 0, 0xFE, 0xFF, 0xFF, 0xFF],
        ] {
            let frame = CanFrame::new(0x546, bytes).expect("a frame");
            assert_eq!(
                PuckMessage::read(&frame),
                Ok((answer(10), set(PuckProperty::VL2, -2)))
            );
        }
    }

    #[test]
    fn what_says_nothing_says_why() {
        let check = |id: u16, bytes: &[u8], why: &str| {
            let frame = CanFrame::new(id, bytes).expect("a frame");
            assert_eq!(PuckMessage::read(&frame).unwrap_err().to_string(), why);
        };
        check(0x423, &[1, 2], "2 bytes, expected 3 or 6");
        check(0x426, &[], "0 bytes, expected 1, 4, 6 or 8");
        check(
            0x426,
            &[0x85],
            "1 bytes that begin with 85: neither a query nor a value",
        );
        check(
            0x426,
            &[0x85, 7, 0, 0],
            "a value with 07 behind its property, expected 00",
        );
        check(
            0x001,
            &[0xAA, 0, 0, 0, 0, 0, 0, 0],
            "8 bytes that begin with AA: neither a query nor a value",
        );
    }
}
