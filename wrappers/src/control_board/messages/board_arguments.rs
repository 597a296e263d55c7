//! The types of arguments, and their layout in both wire versions.

use yarp_devices::{
    Axes, AxisIndex, CalibrationParameters, Impedance, Interaction, Limits, Mode,
    MotorTorqueParameters, Pid, PidKind, VariableValue,
};
use yarp_wire::{Bottle, Value, Vocab32, WireVersion};

use super::axis_selection::{Form, Selection};
use super::{number_parsing, pid_messages, variable_value};
use crate::thrift::Item;

const V3: WireVersion = WireVersion::V3;
const V4: WireVersion = WireVersion::V4;

/// An argument of a command. Each type is laid out here once, for all commands that take it.
pub(super) trait Argument: Sized {
    /// Reads it from the front of the arguments; `None` if it is missing or of another kind.
    fn read(from: &mut Arguments<'_>) -> Option<Self>;

    /// Appends it to a message of 3.x; `None` if 3.x cannot express it.
    fn write_v3(&self, form: Form, message: &mut Bottle) -> Option<()>;

    /// Appends it to a call of 4.0.
    fn write_v4(&self, layout: CallLayout, items: &mut Vec<Item>);

    /// Returns the axes that it names.
    fn axes(&self) -> Option<Axes<'_>> {
        None
    }
}

/// Layout of the arguments of a call of 4.0.
#[derive(Clone, Copy, Debug)]
pub(super) struct CallLayout {
    /// Form of the function.
    pub(super) form: Form,
    /// True if joints are int16.
    pub(super) short_joints: bool,
}

/// The arguments that have not been read yet.
pub(super) struct Arguments<'a> {
    items: &'a [Value],
    form: Form,
    wire_version: WireVersion,
    /// The kind of control loop, which 3.x has in front of the arguments.
    kind: Option<PidKind>,
}

impl<'a> Arguments<'a> {
    /// The arguments of a message of 3.x, whose word announced `form`.
    pub(super) fn of_message(items: &'a [Value], form: Form, kind: Option<PidKind>) -> Self {
        Self {
            items,
            form,
            wire_version: V3,
            kind,
        }
    }

    /// The arguments of a call of 4.0, whose function announced `form`.
    pub(super) fn of_call(items: &'a [Value], form: Form) -> Self {
        Self {
            items,
            form,
            wire_version: V4,
            kind: None,
        }
    }

    fn next(&mut self) -> Option<&'a Value> {
        let (first, rest) = self.items.split_first()?;
        self.items = rest;
        Some(first)
    }

    fn float(&mut self) -> Option<f64> {
        number_parsing::float(self.next()?)
    }

    fn code(&mut self) -> Option<u32> {
        self.next()?.as_vocab().map(Vocab32::code)
    }

    /// Stock takes an integer or a vocab for a truth value.
    pub(super) fn flag(&mut self) -> Option<bool> {
        let word = self.next()?.as_vocab()?;
        Some(word != Vocab32::FAIL && word.code() != 0)
    }

    pub(super) fn text(&mut self) -> Option<String> {
        self.next()?.as_str().map(str::to_owned)
    }

    fn list(&mut self) -> Option<&'a Bottle> {
        self.next()?.as_list()
    }

    pub(super) fn selection(&mut self) -> Option<Selection> {
        if self.wire_version == V3 {
            return Selection::read(self.form, &mut self.items);
        }
        Some(match self.form {
            Form::One => Selection::One(number_parsing::axis(self.next()?)?),
            Form::Group => {
                let axes = self.list()?.iter().map(number_parsing::axis);
                Selection::Group(axes.collect::<Option<_>>()?)
            }
            Form::All => Selection::All,
        })
    }

    /// One number by itself, several as a list.
    pub(super) fn values(&mut self) -> Option<Vec<f64>> {
        match self.form {
            Form::One => Some(vec![self.float()?]),
            _ => number_parsing::floats(self.list()?),
        }
    }

    /// One word by itself, several as a list.
    fn codes<T: From<u32>>(&mut self) -> Option<Vec<T>> {
        let codes: Vec<u32> = match self.form {
            Form::One => vec![self.code()?],
            _ => {
                let words = self.list()?.iter().map(Value::as_vocab);
                words
                    .map(|word| word.map(Vocab32::code))
                    .collect::<Option<_>>()?
            }
        };
        Some(codes.into_iter().map(T::from).collect())
    }

    /// The kind of control loop, where there is one.
    pub(super) fn kind(&mut self, about_loops: bool) -> Option<PidKind> {
        match self.kind {
            Some(kind) => Some(kind),
            None if !about_loops => Some(PidKind::Position),
            None => {
                let word = Vocab32::from_code(self.code()?);
                Some(pid_messages::kind_of(word, self.wire_version))
            }
        }
    }

    /// Returns the parsed value, if nothing is left.
    pub(super) fn done<T>(&self, read: T) -> Option<T> {
        self.items.is_empty().then_some(read)
    }
}

fn integer(axis: AxisIndex) -> i32 {
    // No device has more axes than this; a larger number names none of them either way.
    i32::try_from(axis.index()).unwrap_or(i32::MAX)
}

impl Argument for AxisIndex {
    fn read(from: &mut Arguments<'_>) -> Option<Self> {
        number_parsing::axis(from.next()?)
    }

    fn write_v3(&self, _: Form, message: &mut Bottle) -> Option<()> {
        message.push(number_parsing::integer(self.index()));
        Some(())
    }

    fn write_v4(&self, layout: CallLayout, items: &mut Vec<Item>) {
        let axis = integer(*self);
        items.push(match i16::try_from(axis) {
            Ok(axis) if layout.short_joints => Item::I16(axis),
            // Stock reads an int32 there as well.
            _ => Item::I32(axis),
        });
    }

    fn axes(&self) -> Option<Axes<'_>> {
        Some(Axes::One(*self))
    }
}

impl Argument for Selection {
    fn read(from: &mut Arguments<'_>) -> Option<Self> {
        from.selection()
    }

    fn write_v3(&self, _: Form, message: &mut Bottle) -> Option<()> {
        self.write(message);
        Some(())
    }

    fn write_v4(&self, layout: CallLayout, items: &mut Vec<Item>) {
        match self {
            Self::One(axis) => axis.write_v4(layout, items),
            Self::Group(group) => {
                items.push(Item::I32s(group.iter().copied().map(integer).collect()));
            }
            Self::All => {}
        }
    }

    fn axes(&self) -> Option<Axes<'_>> {
        Some(Self::axes(self))
    }
}

impl Argument for PidKind {
    fn read(from: &mut Arguments<'_>) -> Option<Self> {
        from.kind(true)
    }

    fn write_v3(&self, _: Form, message: &mut Bottle) -> Option<()> {
        message.push(pid_messages::kind_word(*self, V3));
        Some(())
    }

    fn write_v4(&self, _: CallLayout, items: &mut Vec<Item>) {
        items.push(Item::Enum(pid_messages::kind_word(*self, V4).code()));
    }
}

impl Argument for bool {
    fn read(from: &mut Arguments<'_>) -> Option<Self> {
        from.flag()
    }

    fn write_v3(&self, _: Form, message: &mut Bottle) -> Option<()> {
        message.push(i32::from(*self));
        Some(())
    }

    fn write_v4(&self, _: CallLayout, items: &mut Vec<Item>) {
        items.push(Item::Bool(*self));
    }
}

/// The method of a calibration: a number in 3.x, a word in 4.0.
impl Argument for u32 {
    fn read(from: &mut Arguments<'_>) -> Option<Self> {
        match from.wire_version {
            V3 => u32::try_from(number_parsing::count(from.next()?)?).ok(),
            V4 => from.code(),
        }
    }

    fn write_v3(&self, _: Form, message: &mut Bottle) -> Option<()> {
        message.push(number_parsing::integer(*self as usize));
        Some(())
    }

    fn write_v4(&self, _: CallLayout, items: &mut Vec<Item>) {
        items.push(Item::Enum(*self));
    }
}

impl<const N: usize> Argument for [f64; N] {
    fn read(from: &mut Arguments<'_>) -> Option<Self> {
        let mut all = [0.0; N];
        for number in &mut all {
            *number = from.float()?;
        }
        Some(all)
    }

    fn write_v3(&self, _: Form, message: &mut Bottle) -> Option<()> {
        message.extend(self.map(Value::Float64));
        Some(())
    }

    fn write_v4(&self, _: CallLayout, items: &mut Vec<Item>) {
        items.extend(self.map(Item::F64));
    }
}

impl Argument for Limits {
    fn read(from: &mut Arguments<'_>) -> Option<Self> {
        let [min, max] = Argument::read(from)?;
        Some(Self::new(min, max))
    }

    fn write_v3(&self, form: Form, message: &mut Bottle) -> Option<()> {
        [self.min, self.max].write_v3(form, message)
    }

    fn write_v4(&self, layout: CallLayout, items: &mut Vec<Item>) {
        [self.min, self.max].write_v4(layout, items);
    }
}

/// 3.x has the two numbers in a list.
impl Argument for Impedance {
    fn read(from: &mut Arguments<'_>) -> Option<Self> {
        let [stiffness, damping] = match from.wire_version {
            V3 => number_parsing::floats(from.list()?)?.try_into().ok()?,
            V4 => Argument::read(from)?,
        };
        Some(Self { stiffness, damping })
    }

    fn write_v3(&self, _: Form, message: &mut Bottle) -> Option<()> {
        let numbers = [self.stiffness, self.damping].map(Value::Float64);
        message.push(Bottle::from_iter(numbers));
        Some(())
    }

    fn write_v4(&self, layout: CallLayout, items: &mut Vec<Item>) {
        [self.stiffness, self.damping].write_v4(layout, items);
    }
}

/// Motor parameters of the torque loop, and the number of them that are sent: up to 3.6 the first four.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SentMotorParameters {
    /// The parameters; those that are not sent are 0.
    pub values: MotorTorqueParameters,
    /// The number of parameters that are sent, 4 or 9.
    pub count: usize,
}

impl SentMotorParameters {
    /// All parameters.
    pub fn all(values: MotorTorqueParameters) -> Self {
        Self { values, count: 9 }
    }

    /// Returns `before` with the sent parameters replaced.
    pub(crate) fn over(&self, before: MotorTorqueParameters) -> MotorTorqueParameters {
        let mut all = before.to_array();
        let sent = self.values.to_array().into_iter().take(self.count);
        all.iter_mut().zip(sent).for_each(|(slot, new)| *slot = new);
        MotorTorqueParameters::from_array(all)
    }
}

/// 3.x has the numbers in a list.
impl Argument for SentMotorParameters {
    fn read(from: &mut Arguments<'_>) -> Option<Self> {
        if from.wire_version == V4 {
            let numbers = Argument::read(from)?;
            return Some(Self::all(MotorTorqueParameters::from_array(numbers)));
        }
        let numbers = number_parsing::floats(from.list()?)?;
        Some(Self {
            values: number_parsing::motor_parameters(&numbers)?,
            count: numbers.len(),
        })
    }

    fn write_v3(&self, _: Form, message: &mut Bottle) -> Option<()> {
        let numbers = self.values.to_array().into_iter().take(self.count);
        message.push(numbers.map(Value::Float64).collect::<Bottle>());
        Some(())
    }

    fn write_v4(&self, layout: CallLayout, items: &mut Vec<Item>) {
        self.values.to_array().write_v4(layout, items);
    }
}

/// 3.x has four parameters and no zero.
impl Argument for CalibrationParameters {
    fn read(from: &mut Arguments<'_>) -> Option<Self> {
        let method = Argument::read(from)?;
        if from.wire_version == V4 {
            return Some(Self {
                method,
                parameters: Argument::read(from)?,
                zero: from.float()?,
            });
        }
        let [first, second, third, fourth] = Argument::read(from)?;
        Some(Self {
            method,
            parameters: [first, second, third, fourth, 0.0],
            zero: 0.0,
        })
    }

    fn write_v3(&self, form: Form, message: &mut Bottle) -> Option<()> {
        let [first, second, third, fourth, fifth] = self.parameters;
        if fifth != 0.0 || self.zero != 0.0 {
            return None;
        }
        self.method.write_v3(form, message)?;
        [first, second, third, fourth].write_v3(form, message)
    }

    fn write_v4(&self, layout: CallLayout, items: &mut Vec<Item>) {
        self.method.write_v4(layout, items);
        self.parameters.write_v4(layout, items);
        items.push(Item::F64(self.zero));
    }
}

impl Argument for String {
    fn read(from: &mut Arguments<'_>) -> Option<Self> {
        from.text()
    }

    fn write_v3(&self, _: Form, message: &mut Bottle) -> Option<()> {
        message.push(self.as_str());
        Some(())
    }

    fn write_v4(&self, _: CallLayout, items: &mut Vec<Item>) {
        items.push(Item::Text(self.clone()));
    }
}

/// 3.x has the values one behind the other, 4.0 in a list.
impl Argument for Vec<VariableValue> {
    fn read(from: &mut Arguments<'_>) -> Option<Self> {
        match from.wire_version {
            V3 => variable_value::read(std::mem::take(&mut from.items)),
            V4 => variable_value::read(from.list()?.as_slice()),
        }
    }

    fn write_v3(&self, _: Form, message: &mut Bottle) -> Option<()> {
        message.extend(variable_value::to_values(self));
        Some(())
    }

    fn write_v4(&self, _: CallLayout, items: &mut Vec<Item>) {
        items.push(Item::Bottle(variable_value::to_values(self).collect()));
    }
}

/// Words: one by itself, several as a list.
macro_rules! codes {
    ($($kind:ident),*) => {$(
        impl Argument for Vec<$kind> {
            fn read(from: &mut Arguments<'_>) -> Option<Self> {
                from.codes()
            }

            fn write_v3(&self, form: Form, message: &mut Bottle) -> Option<()> {
                let words = self.iter().map(|&one| Value::from(Vocab32::from_code(one.into())));
                push(message, form, words);
                Some(())
            }

            fn write_v4(&self, layout: CallLayout, items: &mut Vec<Item>) {
                let codes: Vec<u32> = self.iter().map(|&one| one.into()).collect();
                items.push(match (layout.form, &codes[..]) {
                    (Form::One, [code]) => Item::Enum(*code),
                    _ => Item::Enums(codes),
                });
            }
        }
    )*};
}

codes!(Mode, Interaction);

/// Gains of one loop in a list, of several in a list of lists.
impl Argument for Vec<Pid> {
    fn read(from: &mut Arguments<'_>) -> Option<Self> {
        let wire_version = from.wire_version;
        match from.form {
            Form::One => Some(vec![pid_messages::read_gains(from.list()?, wire_version)?]),
            _ => pid_messages::read_all_gains(from.list()?, wire_version),
        }
    }

    fn write_v3(&self, form: Form, message: &mut Bottle) -> Option<()> {
        let lists = self.iter().map(|pid| {
            let gains = pid_messages::gains(pid, V3).map(Value::Float64);
            Value::List(gains.into_iter().collect())
        });
        push(message, form, lists);
        Some(())
    }

    fn write_v4(&self, layout: CallLayout, items: &mut Vec<Item>) {
        let lists = self.iter().map(|pid| {
            let gains = pid_messages::gains(pid, V4);
            Item::List(gains.map(Item::F64).to_vec())
        });
        match layout.form {
            Form::One => items.extend(lists),
            _ => items.push(Item::List(lists.collect())),
        }
    }
}

/// Appends one value by itself, several as a list.
pub(super) fn push(message: &mut Bottle, form: Form, values: impl Iterator<Item = Value>) {
    match form {
        Form::One => message.extend(values),
        Form::Group | Form::All => message.push(values.collect::<Bottle>()),
    }
}
