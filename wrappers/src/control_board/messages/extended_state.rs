//! The whole state of a board in one message, on `stateExt:o`.
//!
//! ```text
//! int32 256   int32 22   11 x (values  valid)                         3.x
//! int32 256   int32 24   12 x (values  valid)                         4.0
//! values = int32 256 + code of float64   int32 n   n x float64        (9 of them)
//!        | int32 257                     int32 n   n x int32          (control and interaction modes)
//! valid  = int32 9   vocab [ok] or [fail]
//! ```
//!
//! 4.0 sends duty cycles as float32, and temperatures at the end, float32 as well. A reader of the other wire version
//! refuses the message, so each gets that of its own wire version.
//!
//! Stock names it `jointData` (`stateExt.thrift`). Every list has one entry per joint, also if it is not valid: a
//! stock reader refuses an empty one, and then the whole message is lost.

use bytes::{BufMut, Bytes, BytesMut};
use yarp_devices::{Interaction, Mode};
use yarp_wire::bottle::DecodeError;
use yarp_wire::float_vector::put_float64s;
use yarp_wire::message::{ReadObject, WireObject};
use yarp_wire::{Bottle, Limits, Value, Vocab32, WireVersion};

use super::number_parsing;

/// The code of a list whose items carry their own.
const LIST: i32 = 256;
/// The code of a list of int32.
const INT32_LIST: i32 = 257;
/// The code of a vocab, as which a truth value travels.
const VOCAB: i32 = 9;
/// Values and flags in 3.x.
const ITEMS: usize = 22;
/// The same with temperatures, in 4.0.
const ITEMS_WITH_TEMPERATURES: usize = 24;
/// The code of a list of float32 in 4.0.
const FLOAT32_LIST: i32 = 256 + 10;
/// The place of the duty cycles among the numbers.
const DUTY_CYCLES: usize = 7;

/// One quantity of all joints.
#[derive(Clone, Debug, PartialEq)]
pub struct Field<T> {
    /// One entry per joint.
    pub values: Vec<T>,
    /// True if the values are valid.
    pub valid: bool,
}

impl<T: Clone> Field<T> {
    fn invalid(axes: usize, value: T) -> Self {
        Self {
            values: vec![value; axes],
            valid: false,
        }
    }

    /// Returns the values, if they are valid and there is one for each of `axes` joints.
    pub fn of(&self, axes: usize) -> Option<&[T]> {
        (self.valid && self.values.len() == axes).then_some(&self.values)
    }
}

/// The state of every joint of a board.
#[derive(Clone, Debug, PartialEq)]
pub struct JointData {
    /// Degrees or metres.
    pub positions: Field<f64>,
    /// Deg/s or m/s.
    pub velocities: Field<f64>,
    /// Deg/s² or m/s².
    pub accelerations: Field<f64>,
    /// Motor side, the device's own unit.
    pub motor_positions: Field<f64>,
    /// Motor side, the device's own unit.
    pub motor_velocities: Field<f64>,
    /// Motor side, the device's own unit.
    pub motor_accelerations: Field<f64>,
    /// Newton metres.
    pub torques: Field<f64>,
    /// Percent, -100 to 100.
    pub duty_cycles: Field<f64>,
    /// Ampere.
    pub currents: Field<f64>,
    /// Control modes of the joints.
    pub control_modes: Field<Mode>,
    /// Interaction modes of the joints.
    pub interaction_modes: Field<Interaction>,
    /// °C; does not travel in 3.x.
    pub temperatures: Field<f64>,
}

impl JointData {
    /// Zeros for `axes` joints, none of them valid.
    pub fn unknown(axes: usize) -> Self {
        let zeros = || Field::invalid(axes, 0.0);
        Self {
            positions: zeros(),
            velocities: zeros(),
            accelerations: zeros(),
            motor_positions: zeros(),
            motor_velocities: zeros(),
            motor_accelerations: zeros(),
            torques: zeros(),
            duty_cycles: zeros(),
            currents: zeros(),
            control_modes: Field::invalid(axes, Mode::Unknown(0)),
            interaction_modes: Field::invalid(axes, Interaction::Unknown(0)),
            temperatures: zeros(),
        }
    }

    fn floats(&self) -> [&Field<f64>; 9] {
        [
            &self.positions,
            &self.velocities,
            &self.accelerations,
            &self.motor_positions,
            &self.motor_velocities,
            &self.motor_accelerations,
            &self.torques,
            &self.duty_cycles,
            &self.currents,
        ]
    }
}

impl WireObject for JointData {
    fn write_binary(&self, out: &mut BytesMut, wire_version: WireVersion) {
        out.put_i32_le(LIST);
        let items = match wire_version {
            WireVersion::V3 => ITEMS,
            WireVersion::V4 => ITEMS_WITH_TEMPERATURES,
        };
        out.put_i32_le(items as i32);
        for (place, field) in self.floats().into_iter().enumerate() {
            if place == DUTY_CYCLES && wire_version == WireVersion::V4 {
                put_float32s(out, &field.values);
            } else {
                put_float64s(out, &field.values, wire_version);
            }
            put_valid(out, field.valid);
        }
        let modes = &self.control_modes;
        put_words(out, modes.values.iter().map(|&mode| mode.into()));
        put_valid(out, modes.valid);
        let modes = &self.interaction_modes;
        put_words(out, modes.values.iter().map(|&mode| mode.into()));
        put_valid(out, modes.valid);
        if wire_version == WireVersion::V4 {
            put_float32s(out, &self.temperatures.values);
            put_valid(out, self.temperatures.valid);
        }
    }
}

fn put_float32s(out: &mut BytesMut, values: &[f64]) {
    out.put_i32_le(FLOAT32_LIST);
    out.put_i32_le(values.len() as i32);
    values
        .iter()
        .for_each(|value| out.put_f32_le(*value as f32));
}

fn put_words(out: &mut BytesMut, words: impl ExactSizeIterator<Item = u32>) {
    out.put_i32_le(INT32_LIST);
    out.put_i32_le(words.len() as i32);
    words.for_each(|word| out.put_u32_le(word));
}

fn put_valid(out: &mut BytesMut, valid: bool) {
    let word = if valid { Vocab32::OK } else { Vocab32::FAIL };
    out.put_i32_le(VOCAB);
    out.put_u32_le(word.code());
}

impl ReadObject for JointData {
    fn read_binary(bytes: &Bytes, wire_version: WireVersion) -> Result<Self, DecodeError> {
        let message = Bottle::decode(bytes, wire_version, Limits::DEFAULT)?;
        read(&message).ok_or(DecodeError::Shape {
            expected: "the state of a control board, 22 or 24 items",
        })
    }
}

fn read(message: &Bottle) -> Option<JointData> {
    if message.len() != ITEMS && message.len() != ITEMS_WITH_TEMPERATURES {
        return None;
    }
    let mut items = message.iter();
    let mut floats = || read_floats(&mut items);
    let mut data = JointData {
        positions: floats()?,
        velocities: floats()?,
        accelerations: floats()?,
        motor_positions: floats()?,
        motor_velocities: floats()?,
        motor_accelerations: floats()?,
        torques: floats()?,
        duty_cycles: floats()?,
        currents: floats()?,
        control_modes: read_words(&mut items, |word| Mode::from(word.code()))?,
        interaction_modes: read_words(&mut items, |word| Interaction::from(word.code()))?,
        temperatures: Field {
            values: Vec::new(),
            valid: false,
        },
    };
    if message.len() == ITEMS_WITH_TEMPERATURES {
        data.temperatures = read_floats(&mut items)?;
    }
    Some(data)
}

fn read_floats<'a>(items: &mut impl Iterator<Item = &'a Value>) -> Option<Field<f64>> {
    Some(Field {
        values: number_parsing::floats(items.next()?.as_list()?)?,
        valid: read_valid(items.next()?)?,
    })
}

fn read_words<'a, T>(
    items: &mut impl Iterator<Item = &'a Value>,
    make: impl Fn(Vocab32) -> T,
) -> Option<Field<T>> {
    let list = items.next()?.as_list()?;
    let words = list.iter().map(|item| item.as_vocab().map(&make));
    Some(Field {
        values: words.collect::<Option<_>>()?,
        valid: read_valid(items.next()?)?,
    })
}

/// Stock writes `[ok]` or `[fail]`, and reads anything but 0 and `[fail]` as true.
fn read_valid(value: &Value) -> Option<bool> {
    let word = value.as_vocab()?;
    Some(word != Vocab32::FAIL && word.code() != 0)
}

#[cfg(test)]
#[path = "extended_state_tests.rs"]
mod tests;
