//! The types of results of queries, and their layout in 4.0; `reply_layout` makes that of 3.x from it.

use yarp_devices::{
    EncoderReading, Fault, Impedance, ImpedanceLimits, Interaction, JointType, Limits, Mode,
    MotorTorqueParameters, Pid, PidInfo, PidKind,
};
use yarp_wire::{Bottle, Value, Vocab32, WireVersion};

use super::board_reply::{joint_type_from_value, joint_type_to_value};
use super::board_vocabulary as word;
use super::number_parsing::{float, floats};
use super::{pid_messages, variable_value};
use crate::thrift::Item;

/// A result of a query. Each type is laid out here once, for all queries that it answers.
///
/// `one`: for a query of one axis; vectors have their item by itself then.
pub(crate) trait Outcome: Sized {
    /// Returns the results as they travel.
    fn into_items(self, one: bool) -> Vec<Item>;

    /// Returns the results that accompany an error in 4.0.
    fn nothing(one: bool) -> Vec<Item>;

    /// Reads the results, also in the form of 3.x; `None` if they are of another kind.
    fn read(values: &[Value], one: bool) -> Option<Self>;
}

/// Everything that an axis can be set to; a list also for one axis.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Choices<T>(pub(crate) Vec<T>);

/// Returns the gains of a loop as a result.
pub(super) fn gains(pid: &Pid) -> Item {
    Item::List(
        pid_messages::gains(pid, WireVersion::V4)
            .map(Item::F64)
            .to_vec(),
    )
}

/// Returns the gains of a loop from a result.
pub(super) fn read_gains(value: &Value) -> Option<Pid> {
    pid_messages::read_gains(value.as_list()?, WireVersion::V4)
}

/// Reads a truth value in a result: 3.x has 0 and 1, 4.0 `[fail]` and `[ok]`.
pub(crate) fn read_flag(value: &Value) -> Option<bool> {
    let word = value.as_vocab()?;
    Some(word != Vocab32::FAIL && word.code() != 0)
}

impl Outcome for usize {
    fn into_items(self, _: bool) -> Vec<Item> {
        vec![Item::I32(i32::try_from(self).unwrap_or(i32::MAX))]
    }

    fn nothing(_: bool) -> Vec<Item> {
        vec![Item::I32(0)]
    }

    fn read(values: &[Value], _: bool) -> Option<Self> {
        super::number_parsing::count(values.first()?)
    }
}

impl Outcome for bool {
    fn into_items(self, _: bool) -> Vec<Item> {
        vec![Item::Bool(self)]
    }

    fn nothing(_: bool) -> Vec<Item> {
        vec![Item::Bool(false)]
    }

    fn read(values: &[Value], _: bool) -> Option<Self> {
        read_flag(values.first()?)
    }
}

impl Outcome for String {
    fn into_items(self, _: bool) -> Vec<Item> {
        vec![Item::Text(self)]
    }

    fn nothing(_: bool) -> Vec<Item> {
        vec![Item::Text(String::new())]
    }

    fn read(values: &[Value], _: bool) -> Option<Self> {
        values.first().map(Value::to_plain_string)
    }
}

impl Outcome for JointType {
    fn into_items(self, _: bool) -> Vec<Item> {
        vec![joint_type_to_value(self)]
    }

    fn nothing(one: bool) -> Vec<Item> {
        Self::Unknown.into_items(one)
    }

    fn read(values: &[Value], _: bool) -> Option<Self> {
        joint_type_from_value(values.first()?)
    }
}

impl Outcome for Limits {
    fn into_items(self, _: bool) -> Vec<Item> {
        vec![Item::F64(self.min), Item::F64(self.max)]
    }

    fn nothing(_: bool) -> Vec<Item> {
        vec![Item::F64(0.0); 2]
    }

    fn read(values: &[Value], _: bool) -> Option<Self> {
        match values {
            [min, max, ..] => Some(Self::new(float(min)?, float(max)?)),
            _ => None,
        }
    }
}

/// Smallest and largest values apart.
impl Outcome for Vec<Limits> {
    fn into_items(self, one: bool) -> Vec<Item> {
        let smallest = self.iter().map(|limits| limits.min).collect();
        let largest = self.iter().map(|limits| limits.max).collect();
        vec![numbers(smallest, one), numbers(largest, one)]
    }

    fn nothing(one: bool) -> Vec<Item> {
        match one {
            true => Limits::nothing(one),
            false => vec![Item::F64s(Vec::new()); 2],
        }
    }

    fn read(values: &[Value], one: bool) -> Option<Self> {
        let [smallest, largest, ..] = values else {
            return None;
        };
        let pairs = read_numbers(smallest, one)?
            .into_iter()
            .zip(read_numbers(largest, one)?);
        Some(pairs.map(|(min, max)| Limits::new(min, max)).collect())
    }
}

/// Positions and times apart. The reader has no speeds and accelerations.
impl Outcome for Vec<EncoderReading> {
    fn into_items(self, one: bool) -> Vec<Item> {
        let positions = self.iter().map(|reading| reading.position).collect();
        let times = self.iter().map(|reading| reading.time).collect();
        vec![numbers(positions, one), numbers(times, one)]
    }

    fn nothing(one: bool) -> Vec<Item> {
        <Vec<Limits>>::nothing(one)
    }

    fn read(values: &[Value], one: bool) -> Option<Self> {
        let [positions, times, ..] = values else {
            return None;
        };
        let pairs = read_numbers(positions, one)?
            .into_iter()
            .zip(read_numbers(times, one)?);
        let readings = pairs.map(|(position, time)| EncoderReading {
            position,
            speed: f64::NAN,
            acceleration: f64::NAN,
            time,
        });
        Some(readings.collect())
    }
}

impl Outcome for Vec<i32> {
    fn into_items(self, one: bool) -> Vec<Item> {
        vec![match (one, &self[..]) {
            (true, [number]) => Item::I32(*number),
            _ => Item::I32s(self),
        }]
    }

    fn nothing(one: bool) -> Vec<Item> {
        match one {
            true => vec![Item::I32(0)],
            false => vec![Item::I32s(Vec::new())],
        }
    }

    fn read(values: &[Value], one: bool) -> Option<Self> {
        let numbers = read_numbers(values.first()?, one)?;
        Some(numbers.into_iter().map(|number| number as i32).collect())
    }
}

impl Outcome for Impedance {
    fn into_items(self, _: bool) -> Vec<Item> {
        vec![Item::F64(self.stiffness), Item::F64(self.damping)]
    }

    fn nothing(_: bool) -> Vec<Item> {
        vec![Item::F64(0.0); 2]
    }

    fn read(values: &[Value], one: bool) -> Option<Self> {
        let pair = Limits::read(values, one)?;
        Some(Self {
            stiffness: pair.min,
            damping: pair.max,
        })
    }
}

impl Outcome for ImpedanceLimits {
    fn into_items(self, one: bool) -> Vec<Item> {
        let mut items = self.stiffness.into_items(one);
        items.extend(self.damping.into_items(one));
        items
    }

    fn nothing(_: bool) -> Vec<Item> {
        vec![Item::F64(0.0); 4]
    }

    fn read(values: &[Value], one: bool) -> Option<Self> {
        Some(Self {
            stiffness: Limits::read(values, one)?,
            damping: Limits::read(values.get(2..)?, one)?,
        })
    }
}

/// Up to 3.6 there are four, later nine.
impl Outcome for MotorTorqueParameters {
    fn into_items(self, _: bool) -> Vec<Item> {
        self.to_array().map(Item::F64).to_vec()
    }

    fn nothing(_: bool) -> Vec<Item> {
        vec![Item::F64(0.0); 9]
    }

    fn read(values: &[Value], _: bool) -> Option<Self> {
        let numbers: Option<Vec<f64>> = values.iter().map(float).collect();
        super::number_parsing::motor_parameters(&numbers?)
    }
}

/// Words: one by itself, several as a list.
macro_rules! codes {
    ($($kind:ident),*) => {$(
        impl Outcome for Vec<$kind> {
            fn into_items(self, one: bool) -> Vec<Item> {
                let codes: Vec<u32> = self.into_iter().map(u32::from).collect();
                vec![match (one, &codes[..]) {
                    (true, [code]) => Item::Enum(*code),
                    _ => Item::Enums(codes),
                }]
            }

            fn nothing(one: bool) -> Vec<Item> {
                match one {
                    true => vec![Item::Enum(word::UNKNOWN_TYPE.code())],
                    false => vec![Item::Enums(Vec::new())],
                }
            }

            fn read(values: &[Value], _: bool) -> Option<Self> {
                Some(codes(values.first()?)?.into_iter().map($kind::from).collect())
            }
        }
    )*};
}

codes!(Mode, Interaction);

impl Outcome for Choices<Mode> {
    fn into_items(self, _: bool) -> Vec<Item> {
        vec![Item::Enums(self.0.into_iter().map(u32::from).collect())]
    }

    fn nothing(_: bool) -> Vec<Item> {
        vec![Item::Enums(Vec::new())]
    }

    fn read(values: &[Value], one: bool) -> Option<Self> {
        Outcome::read(values, one).map(Self)
    }
}

impl Outcome for Choices<PidKind> {
    fn into_items(self, _: bool) -> Vec<Item> {
        let kinds = self.0.into_iter();
        let words = kinds.map(|kind| pid_messages::kind_word(kind, WireVersion::V4).code());
        vec![Item::Enums(words.collect())]
    }

    fn nothing(_: bool) -> Vec<Item> {
        vec![Item::Enums(Vec::new())]
    }

    fn read(values: &[Value], _: bool) -> Option<Self> {
        let kind = |code| pid_messages::kind_of(Vocab32::from_code(code), WireVersion::V4);
        Some(Self(
            codes(values.first()?)?.into_iter().map(kind).collect(),
        ))
    }
}

impl Outcome for Vec<Pid> {
    fn into_items(self, one: bool) -> Vec<Item> {
        lists(self.iter().map(gains).collect(), one)
    }

    fn nothing(one: bool) -> Vec<Item> {
        match one {
            true => vec![gains(&Pid::default())],
            false => vec![Item::List(Vec::new())],
        }
    }

    fn read(values: &[Value], one: bool) -> Option<Self> {
        read_each(values.first()?, one, read_gains)
    }
}

impl Outcome for Vec<PidInfo> {
    fn into_items(self, one: bool) -> Vec<Item> {
        lists(self.into_iter().map(pid_messages::info).collect(), one)
    }

    fn nothing(one: bool) -> Vec<Item> {
        match one {
            true => vec![pid_messages::info(PidInfo::default())],
            false => vec![Item::List(Vec::new())],
        }
    }

    fn read(values: &[Value], one: bool) -> Option<Self> {
        read_each(values.first()?, one, pid_messages::read_info)
    }
}

/// 4.0 has a list of bottles, of which one is used.
impl Outcome for Vec<String> {
    fn into_items(self, _: bool) -> Vec<Item> {
        let names: Bottle = self.into_iter().map(Into::into).collect();
        vec![Item::List(vec![Item::Bottle(names)])]
    }

    fn nothing(one: bool) -> Vec<Item> {
        Self::new().into_items(one)
    }

    fn read(values: &[Value], _: bool) -> Option<Self> {
        let mut list = values.first()?.as_list()?;
        if let Some(inner) = list.get(0).and_then(Value::as_list) {
            list = inner;
        }
        Some(list.iter().map(Value::to_plain_string).collect())
    }
}

impl Outcome for Fault {
    fn into_items(self, _: bool) -> Vec<Item> {
        vec![Item::I32(self.code), Item::Text(self.message)]
    }

    fn nothing(_: bool) -> Vec<Item> {
        vec![Item::I32(0), Item::Text(String::new())]
    }

    fn read(values: &[Value], _: bool) -> Option<Self> {
        let [code, message, ..] = values else {
            return None;
        };
        Some(Self {
            code: code.as_i32()?,
            message: message.to_plain_string(),
        })
    }
}

/// The value of a variable.
impl Outcome for Vec<yarp_devices::VariableValue> {
    fn into_items(self, _: bool) -> Vec<Item> {
        vec![Item::Bottle(variable_value::to_values(&self).collect())]
    }

    fn nothing(_: bool) -> Vec<Item> {
        vec![Item::Bottle(Bottle::new())]
    }

    fn read(values: &[Value], _: bool) -> Option<Self> {
        variable_value::read(values.first()?.as_list()?.as_slice())
    }
}

/// One number by itself, several as a list.
impl Outcome for Vec<f64> {
    fn into_items(self, one: bool) -> Vec<Item> {
        vec![numbers(self, one)]
    }

    fn nothing(one: bool) -> Vec<Item> {
        match one {
            true => vec![Item::F64(0.0)],
            false => vec![Item::F64s(Vec::new())],
        }
    }

    fn read(values: &[Value], one: bool) -> Option<Self> {
        read_numbers(values.first()?, one)
    }
}

fn numbers(values: Vec<f64>, one: bool) -> Item {
    match (one, &values[..]) {
        (true, [number]) => Item::F64(*number),
        _ => Item::F64s(values),
    }
}

fn read_numbers(value: &Value, one: bool) -> Option<Vec<f64>> {
    match one {
        true => Some(vec![float(value)?]),
        false => floats(value.as_list()?),
    }
}

/// One struct by itself, several as a list.
fn lists(all: Vec<Item>, one: bool) -> Vec<Item> {
    match one {
        true => all,
        false => vec![Item::List(all)],
    }
}

fn read_each<T>(value: &Value, one: bool, read: impl Fn(&Value) -> Option<T>) -> Option<Vec<T>> {
    match one {
        true => Some(vec![read(value)?]),
        false => value.as_list()?.iter().map(read).collect(),
    }
}

/// A word, or a list of words.
fn codes(value: &Value) -> Option<Vec<u32>> {
    let code = |value: &Value| value.as_vocab().map(Vocab32::code);
    match value.as_list() {
        Some(list) => list.iter().map(code).collect(),
        None => Some(vec![code(value)?]),
    }
}
