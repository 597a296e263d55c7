//! Orders on `command:i`, which nobody answers.
//!
//! ```text
//! int32 256   int32 2   bottle head   vector values        head = [word] SELECTION
//! ```
//!
//! Source: `StreamingMessagesParser.cpp` of YARP 3.12, and recorded traffic of 3.12.3.

use bytes::{BufMut, Bytes, BytesMut};
use yarp_wire::bottle::DecodeError;
use yarp_wire::message::{ReadObject, WireObject};
use yarp_wire::vector::put_float64s;
use yarp_wire::{Bottle, Dialect, Limits, Value, Vocab32};

use super::number;
use super::quantity::VELOCITY;
use super::request::Malformed;
use super::selection::Selection;
use super::vocabulary as word;

/// The code of a list whose items carry their own.
const LIST: i32 = 256;

/// An order as it travels: what is to be done with which joints, and one value for each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Command {
    /// The word for the order, and the joints.
    pub head: Bottle,
    /// One value per joint.
    pub values: Vec<f64>,
}

/// An order that is understood here.
#[derive(Clone, Debug, Eq, PartialEq)]
pub enum Streamed {
    /// `[vmo]`, `[vmog]`, `[vmos]`: move at these velocities.
    Velocity(Selection),
    /// `[poss]`: all joints go there. Stock clients send it to `rpc:i` instead.
    Positions,
}

impl Command {
    /// Moves joints at `velocities`, deg/s or m/s.
    pub fn velocity(selection: &Selection, velocities: &[f64]) -> Self {
        let word = VELOCITY.word(selection).unwrap_or_default();
        let mut head = Bottle::of(word);
        selection.write(&mut head);
        Self {
            head,
            values: velocities.to_vec(),
        }
    }

    /// What is to be done.
    pub fn parse(&self) -> Result<Streamed, Malformed> {
        let [word, rest @ ..] = self.head.as_slice() else {
            return Err(Malformed::TooShort);
        };
        let word = word.as_vocab().unwrap_or_default();
        let mut rest = rest;
        let order = match VELOCITY.form(word) {
            Some(form) => Selection::read(form, &mut rest).map(Streamed::Velocity),
            None if word == word::POSITIONS => Some(Streamed::Positions),
            None => return Err(unknown(word)),
        };
        order
            .filter(|_| rest.is_empty())
            .ok_or(Malformed::Values(word))
    }
}

fn unknown(word: Vocab32) -> Malformed {
    if word::INTERFACES_NOT_SERVED.contains(&word) {
        Malformed::NotServed(word)
    } else {
        Malformed::UnknownWord(word)
    }
}

impl WireObject for Command {
    fn write_binary(&self, out: &mut BytesMut, dialect: Dialect) {
        out.put_i32_le(LIST);
        out.put_i32_le(2);
        self.head.encode_into(out, dialect);
        put_float64s(out, &self.values, dialect);
    }
}

impl ReadObject for Command {
    fn read_binary(bytes: &Bytes, dialect: Dialect) -> Result<Self, DecodeError> {
        let message = Bottle::decode(bytes, dialect, Limits::DEFAULT)?;
        let shape = DecodeError::Shape {
            expected: "a list of words and a list of numbers",
        };
        match message.as_slice() {
            [Value::List(head), Value::List(values)] => match number::floats(values) {
                Some(values) => Ok(Self {
                    head: head.clone(),
                    values,
                }),
                None => Err(shape),
            },
            _ => Err(shape),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Spaces in the hexadecimal text are for people.
    fn bytes(hex: &str) -> Bytes {
        let digits: Vec<u8> = hex.bytes().filter(u8::is_ascii_hexdigit).collect();
        digits
            .chunks(2)
            .map(|pair| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap())
            .collect()
    }

    #[test]
    fn bytes_are_those_recorded() {
        let check = |hex: &str, dialect: Dialect, selection: Selection, velocities: &[f64]| {
            let command = Command::velocity(&selection, velocities);
            let mut out = BytesMut::new();
            command.write_binary(&mut out, dialect);
            assert_eq!(out, bytes(hex));
            assert_eq!(
                Command::read_binary(&out.freeze(), dialect).as_ref(),
                Ok(&command)
            );
            assert_eq!(command.parse(), Ok(Streamed::Velocity(selection)));
        };
        // ([vmo] 0) (10.0), recorded from a 3.12.3 client.
        check(
            "0001000002000000 0001000002000000 09000000 766d6f00 01000000 00000000
             0a010000 01000000 0000000000002440",
            Dialect::V3,
            Selection::One(0.into()),
            &[10.0],
        );
        check(
            "0001000002000000 0901000001000000 766d6f73
             0a010000 02000000 000000000000f03f 0000000000000040",
            Dialect::V3,
            Selection::All,
            &[1.0, 2.0],
        );
        check(
            "0001000002000000 0001000002000000 09000000 766d6f00 01000000 00000000
             14010000 01000000 0000000000002440",
            Dialect::V4,
            Selection::One(0.into()),
            &[10.0],
        );
    }

    #[test]
    fn other_orders_are_named() {
        let check = |text: &str, why: Malformed| {
            let bytes = Bottle::parse(text).unwrap().encode(Dialect::V3);
            let command = Command::read_binary(&bytes, Dialect::V3).unwrap();
            assert_eq!(command.parse(), Err(why), "{text}");
        };
        check("() (1.0)", Malformed::TooShort);
        check(
            "([dpo] 1) (2.0)",
            Malformed::UnknownWord(Vocab32::new("dpo")),
        );
        check(
            "([ipwm] [ref] 0) (1.0)",
            Malformed::NotServed(word::PWM_INTERFACE),
        );
        check("([vmo]) (1.0)", Malformed::Values(word::VELOCITY));
        check("([vmo] 0 1) (1.0)", Malformed::Values(word::VELOCITY));
        check(
            "([vmog] 3 (0 1)) (1.0 2.0)",
            Malformed::Values(word::VELOCITY_GROUP),
        );
        for text in [
            "[vmo] 0",
            "([vmo] 0) 1.0",
            "([vmo] 0) (fast)",
            "([vmo] 0) (1.0) 2",
        ] {
            let bytes = Bottle::parse(text).unwrap().encode(Dialect::V3);
            assert!(Command::read_binary(&bytes, Dialect::V3).is_err(), "{text}");
        }
    }
}
