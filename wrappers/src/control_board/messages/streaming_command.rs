//! Commands on `command:i`, which are not answered.
//!
//! ```text
//! int32 256   int32 2   bottle head   vector values
//!
//! head = [word] SELECTION                 3.x
//!      | [interface] [word] SELECTION     4.0; in both for currents and duty cycles
//! ```
//!
//! Source: `StreamingMessagesParser.cpp` of YARP 3.12 and 4.0, and recorded traffic of 3.12.3 and 4.0.0.

use bytes::{BufMut, Bytes, BytesMut};
use yarp_devices::PidKind;
use yarp_wire::bottle::DecodeError;
use yarp_wire::float_vector::put_float64s;
use yarp_wire::message::{ReadObject, WireObject};
use yarp_wire::{Bottle, Limits, Value, Vocab32, WireVersion};

use super::axis_selection::{Forms, Selection, Words};
use super::board_request::Malformed;
use super::board_vocabulary as word;
use super::number_parsing;
use super::pid_messages;
use super::request_table::Setting;

/// The code of a list whose items carry their own.
const LIST: i32 = 256;

/// A command: the setting, the joints, and one value for each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Command {
    /// The words of the command, and the joints.
    pub head: Bottle,
    /// One value per joint.
    pub values: Vec<f64>,
}

/// A parsed command.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct StreamingCommand {
    /// The setting.
    pub setting: Setting,
    /// Of which joints.
    pub selection: Selection,
}

/// Encoding of a streamed setting.
struct Head {
    setting: Setting,
    /// In front of the other words in 3.x.
    three: Option<Vocab32>,
    /// In front of the other words in 4.0.
    four: Vocab32,
    words: Words,
    /// True if 3.x knows it.
    old: bool,
}

const fn head(setting: Setting, four: Vocab32, words: Words) -> Head {
    Head {
        setting,
        three: None,
        four,
        words,
        old: true,
    }
}

/// Settings of one interface in both wire versions.
const fn both(setting: Setting, interface: Vocab32, words: Words) -> Head {
    Head {
        three: Some(interface),
        ..head(setting, interface, words)
    }
}

/// Settings that only 4.0 has.
const fn new(setting: Setting, four: Vocab32, words: Words) -> Head {
    Head {
        old: false,
        ..head(setting, four, words)
    }
}

const HEADS: [Head; 9] = [
    head(
        Setting::Velocity,
        word::VELOCITY_INTERFACE,
        Words::three(word::VELOCITY, word::VELOCITY_GROUP, word::VELOCITIES),
    ),
    head(
        Setting::DirectPosition,
        word::POSITION_DIRECT_INTERFACE,
        Words::three(
            word::DIRECT_POSITION,
            word::DIRECT_POSITION_GROUP,
            word::DIRECT_POSITIONS,
        ),
    ),
    new(
        Setting::DirectVelocity,
        word::VELOCITY_DIRECT_INTERFACE,
        Words::three(
            word::STREAMED_DIRECT_VELOCITY,
            word::STREAMED_DIRECT_VELOCITY_GROUP,
            word::STREAMED_DIRECT_VELOCITIES,
        ),
    ),
    head(
        Setting::Torque,
        word::STREAMED_TORQUE_INTERFACE,
        Words::three(
            word::STREAMED_TORQUE,
            word::STREAMED_TORQUE_GROUP,
            word::STREAMED_TORQUES,
        ),
    ),
    both(
        Setting::Current,
        word::CURRENT_INTERFACE,
        Words::three(word::REFERENCE, word::REFERENCE_GROUP, word::REFERENCES),
    ),
    both(
        Setting::DutyCycle,
        word::PWM_INTERFACE,
        Words::two(word::REFERENCE, word::REFERENCES),
    ),
    // Stock clients send these by `rpc:i` instead.
    head(
        Setting::Position,
        word::POSITION_INTERFACE,
        Words::only_all(word::POSITIONS),
    ),
    new(
        Setting::PidOffset(PidKind::Position),
        word::STREAMED_PID_INTERFACE,
        Words::only_one(word::STREAMED_PID_OFFSET),
    ),
    new(
        Setting::PidFeedforward(PidKind::Position),
        word::STREAMED_PID_INTERFACE,
        Words::only_one(word::STREAMED_PID_FEEDFORWARD),
    ),
];

impl Setting {
    /// Returns the words for streaming it to a board of `wire_version`; none if it is not streamed.
    pub(crate) fn streamed(self, wire_version: WireVersion) -> Words {
        let plain = self.of_kind(PidKind::Position);
        let found = HEADS.iter().find(|head| head.setting == plain);
        match found {
            Some(head) if head.old || wire_version == WireVersion::V4 => head.words,
            _ => Forms::NONE,
        }
    }
}

impl Command {
    /// Encodes the command that sets joints, for a board of `wire_version`; `None` where there are no words for it.
    pub fn new(
        setting: Setting,
        selection: &Selection,
        values: &[f64],
        wire_version: WireVersion,
    ) -> Option<Self> {
        let said = setting.streamed(wire_version).of(selection)?;
        let plain = setting.of_kind(PidKind::Position);
        let found = HEADS.iter().find(|head| head.setting == plain)?;
        let mut head = Bottle::new();
        match wire_version {
            WireVersion::V3 => head.extend(found.three.map(Value::from)),
            WireVersion::V4 => head.push(found.four),
        }
        head.push(said);
        if let Some(kind) = setting.kind() {
            head.push(pid_messages::kind_word(kind, wire_version));
        }
        selection.write(&mut head);
        Some(Self {
            head,
            values: values.to_vec(),
        })
    }

    /// Parses the command, in either wire version.
    pub fn parse(&self) -> Result<StreamingCommand, Malformed> {
        let items = self.head.as_slice();
        let vocab = |at: usize| items.get(at).and_then(Value::as_vocab);
        let first = vocab(0).ok_or(Malformed::TooShort)?;
        for head in &HEADS {
            let said = if first == head.four {
                1
            } else if head.three.is_none() && head.old {
                0
            } else {
                continue;
            };
            let Some(word) = vocab(said) else {
                continue;
            };
            let Some(form) = head.words.form(word) else {
                continue;
            };
            let mut rest = &items[said + 1..];
            let mut setting = head.setting;
            if setting.kind().is_some() {
                let [kind, behind @ ..] = rest else {
                    return Err(Malformed::Values(word));
                };
                let kind = kind.as_vocab().ok_or(Malformed::Values(word))?;
                setting = setting.of_kind(pid_messages::kind_of(kind, WireVersion::V4));
                rest = behind;
            }
            let selection = Selection::read(form, &mut rest).filter(|_| rest.is_empty());
            return match selection {
                Some(selection) => Ok(StreamingCommand { setting, selection }),
                None => Err(Malformed::Values(word)),
            };
        }
        Err(Malformed::UnknownWord(first))
    }
}

impl WireObject for Command {
    fn write_binary(&self, out: &mut BytesMut, wire_version: WireVersion) {
        out.put_i32_le(LIST);
        out.put_i32_le(2);
        self.head.encode_into(out, wire_version);
        put_float64s(out, &self.values, wire_version);
    }
}

impl ReadObject for Command {
    fn read_binary(bytes: &Bytes, wire_version: WireVersion) -> Result<Self, DecodeError> {
        let message = Bottle::decode(bytes, wire_version, Limits::DEFAULT)?;
        let shape = DecodeError::Shape {
            expected: "a list of words and a list of numbers",
        };
        match message.as_slice() {
            [Value::List(head), Value::List(values)] => match number_parsing::floats(values) {
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
        let check =
            |hex: &str, wire_version: WireVersion, selection: Selection, velocities: &[f64]| {
                let setting = Setting::Velocity;
                let command = Command::new(setting, &selection, velocities, wire_version).unwrap();
                let mut out = BytesMut::new();
                command.write_binary(&mut out, wire_version);
                assert_eq!(out, bytes(hex));
                assert_eq!(
                    Command::read_binary(&out.freeze(), wire_version).as_ref(),
                    Ok(&command)
                );
                assert_eq!(command.parse(), Ok(StreamingCommand { setting, selection }));
            };
        // ([vmo] 0) (10.0), recorded from a 3.12.3 client.
        check(
            "0001000002000000 0001000002000000 09000000 766d6f00 01000000 00000000
             0a010000 01000000 0000000000002440",
            WireVersion::V3,
            Selection::One(0.into()),
            &[10.0],
        );
        check(
            "0001000002000000 0901000001000000 766d6f73
             0a010000 02000000 000000000000f03f 0000000000000040",
            WireVersion::V3,
            Selection::All,
            &[1.0, 2.0],
        );
        // ([ivel] [vmo] 0) (10.0), recorded from a 4.0.0 client.
        check(
            "0001000002000000 0001000003000000 09000000 6976656c 09000000 766d6f00 01000000 00000000
             14010000 01000000 0000000000002440",
            WireVersion::V4,
            Selection::One(0.into()),
            &[10.0],
        );
    }

    fn read(text: &str) -> Command {
        let bytes = Bottle::parse(text).unwrap().encode(WireVersion::V3);
        Command::read_binary(&bytes, WireVersion::V3).unwrap()
    }

    #[test]
    fn both_generations_are_understood() {
        let one = Selection::One(1.into());
        let check = |text: &str, setting: Setting, selection: &Selection| {
            let streamed = StreamingCommand {
                setting,
                selection: selection.clone(),
            };
            assert_eq!(read(text).parse(), Ok(streamed), "{text}");
        };
        let offset = Setting::PidOffset(PidKind::Torque);
        check("([dpo] 1) (2.0)", Setting::DirectPosition, &one);
        check("([ipod] [dpo] 1) (2.0)", Setting::DirectPosition, &one);
        check("([dtqs]) (2.0)", Setting::Torque, &Selection::All);
        check("([itrq] [dtq] 1) (2.0)", Setting::Torque, &one);
        check("([ived] [vdso] 1) (2.0)", Setting::DirectVelocity, &one);
        check("([icur] [ref] 1) (2.0)", Setting::Current, &one);
        check("([ipwm] [refs]) (2.0)", Setting::DutyCycle, &Selection::All);
        check("([poss]) (2.0)", Setting::Position, &Selection::All);
        check("([ipos] [poss]) (2.0)", Setting::Position, &Selection::All);
        check("([ipid] [poff] [trq1] 1) (2.0)", offset, &one);
    }

    #[test]
    fn what_is_written_is_understood() {
        let selections = [
            Selection::One(1.into()),
            Selection::Group(vec![1.into(), 0.into()]),
            Selection::All,
        ];
        let mut count = 0;
        for wire_version in [WireVersion::V3, WireVersion::V4] {
            for setting in Setting::all() {
                for selection in &selections {
                    let command = Command::new(setting, selection, &[1.0], wire_version);
                    let Some(command) = command else { continue };
                    let streamed = StreamingCommand {
                        setting,
                        selection: selection.clone(),
                    };
                    assert_eq!(command.parse(), Ok(streamed), "{}", command.head);
                    count += 1;
                }
            }
        }
        assert_eq!(count, 15 + 20);
    }

    #[test]
    fn other_orders_are_named() {
        let check = |text: &str, why: Malformed| {
            assert_eq!(read(text).parse(), Err(why), "{text}");
        };
        check("() (1.0)", Malformed::TooShort);
        for unknown in ["foo", "vdso", "ref", "poff"] {
            let why = Malformed::UnknownWord(Vocab32::new(unknown));
            check(&format!("([{unknown}] 1) (2.0)"), why);
        }
        check(
            "([ivel] [dpo] 0) (1.0)",
            Malformed::UnknownWord(word::VELOCITY_INTERFACE),
        );
        check(
            "([ivel]) (1.0)",
            Malformed::UnknownWord(word::VELOCITY_INTERFACE),
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
            let bytes = Bottle::parse(text).unwrap().encode(WireVersion::V3);
            assert!(
                Command::read_binary(&bytes, WireVersion::V3).is_err(),
                "{text}"
            );
        }
    }
}
