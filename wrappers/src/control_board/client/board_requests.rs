//! Queries and commands for joints, in either wire version.

use yarp_devices::{Axes, AxisIndex, DeviceError};
use yarp_wire::{Value, Vocab32, WireVersion};

use super::super::messages::{
    Action, Command, Field, Get, JointData, Quantity, Query, Selection, Set, Setting, Words, float,
    floats,
};
use super::{Answered, RemoteControlBoard};

/// Two numbers, one behind the other.
pub(super) fn pair(values: &[Value]) -> Option<(f64, f64)> {
    match values {
        [first, second, ..] => float(first).zip(float(second)),
        _ => None,
    }
}

/// A word, or a list of words.
pub(super) fn codes<T>(value: &Value, make: impl Fn(u32) -> T) -> Option<Vec<T>> {
    let code = |value: &Value| value.as_vocab().map(Vocab32::code);
    let codes: Option<Vec<u32>> = match value.as_list() {
        Some(list) => list.iter().map(code).collect(),
        None => Some(vec![code(value)?]),
    };
    Some(codes?.into_iter().map(make).collect())
}

/// One number by itself, several as a list of so many.
pub(super) fn numbers(value: &Value, selection: &Selection, total: usize) -> Option<Vec<f64>> {
    if let Selection::One(_) = selection {
        return Some(vec![float(value)?]);
    }
    let list = value.as_list()?;
    (list.len() == selection.axes().len(total)).then(|| floats(list))?
}

impl RemoteControlBoard {
    /// Asks about one axis.
    pub(super) fn about(
        &self,
        question: Query,
        axis: AxisIndex,
    ) -> Result<Answered<'_>, DeviceError> {
        Axes::One(axis).check(self.axes)?;
        self.ask(Get::About(question, Selection::One(axis)))
    }

    /// Refuses queries that 3.x does not have.
    pub(super) fn asking_4(&self, what: &str) -> Result<(), DeviceError> {
        if self.wire_version() == WireVersion::V4 {
            return Ok(());
        }
        Err(DeviceError::NotSupported {
            what: format!("{what} over a 3.x network"),
        })
    }

    /// Asks for one number per joint.
    pub(super) fn values(
        &self,
        quantity: Quantity,
        axes: Axes<'_>,
    ) -> Result<Vec<f64>, DeviceError> {
        axes.check(self.axes)?;
        let spelling = quantity.spelling();
        let selections =
            spelling.sayable(self.wire_version(), axes, self.axes, "ask about", true)?;
        let mut all = Vec::new();
        for selection in selections {
            if selection.axes().len(self.axes) == 0 {
                continue;
            }
            let asked = Get::Values(quantity, selection.clone());
            let read = |values: &[Value]| numbers(values.first()?, &selection, self.axes);
            all.extend(self.ask(asked)?.read(read)?);
        }
        Ok(all)
    }

    /// Asks the same about each of several joints, by one message where there is one, and puts the answers together.
    pub(super) fn about_each<T>(
        &self,
        question: Query,
        axes: Axes<'_>,
        read: impl Fn(&[Value], &Selection) -> Option<Vec<T>>,
    ) -> Result<Vec<T>, DeviceError> {
        axes.check(self.axes)?;
        let spelling = question.spelling();
        let selections =
            spelling.sayable(self.wire_version(), axes, self.axes, "ask about", true)?;
        let mut all = Vec::new();
        for selection in selections {
            let expected = selection.axes().len(self.axes);
            if expected == 0 {
                continue;
            }
            let asked = Get::About(question, selection.clone());
            let read = |values: &[Value]| {
                read(values, &selection).filter(|answers| answers.len() == expected)
            };
            all.extend(self.ask(asked)?.read(read)?);
        }
        Ok(all)
    }

    /// Orders something without values; `what` it is, for the errors.
    pub(super) fn act(
        &self,
        action: Action,
        what: &str,
        axes: Axes<'_>,
    ) -> Result<(), DeviceError> {
        axes.check(self.axes)?;
        let spelling = action.spelling();
        let selections = spelling.sayable(self.wire_version(), axes, self.axes, what, true)?;
        for selection in selections {
            if selection.axes().len(self.axes) > 0 {
                self.order(Set::Act(action, selection))?;
            }
        }
        Ok(())
    }

    /// Sets one number per joint; `what` they are, for the errors.
    ///
    /// Streams what stock streams, without waiting.
    pub(super) fn set(
        &self,
        setting: Setting,
        what: &'static str,
        axes: Axes<'_>,
        values: &[f64],
    ) -> Result<(), DeviceError> {
        axes.check_command(self.axes, what, values.len())?;
        self.check_finite(axes, what, values)?;
        if values.is_empty() {
            return Ok(());
        }
        if let Some(words) = self.streaming(setting, axes)
            && let Ok(selections) = words.sayable(axes, self.axes, what, false)
        {
            for selection in selections {
                let wire_version = self.wire_version();
                if let Some(command) = Command::new(setting, &selection, values, wire_version) {
                    return self.link().stream(command);
                }
            }
        }
        let spelling = setting.spelling();
        let selections = spelling.sayable(self.wire_version(), axes, self.axes, "set", false)?;
        for selection in selections {
            self.order(Set::Values(setting, selection, values.to_vec()))?;
        }
        Ok(())
    }

    /// The words for streaming, if stock streams this.
    fn streaming(&self, setting: Setting, axes: Axes<'_>) -> Option<Words> {
        let wire_version = self.wire_version();
        let streams = match setting {
            Setting::Velocity
            | Setting::DirectPosition
            | Setting::DirectVelocity
            | Setting::Torque => true,
            // For one joint 4.0 waits for the answer.
            Setting::Current | Setting::DutyCycle => {
                wire_version == WireVersion::V3 || !matches!(axes, Axes::One(_))
            }
            _ => false,
        };
        streams.then(|| setting.streamed(wire_version))
    }

    /// One value per joint from the newest state.
    pub(super) fn newest<T: Clone>(
        &self,
        what: &'static str,
        axes: Axes<'_>,
        field: impl Fn(&JointData) -> &Field<T>,
    ) -> Result<Vec<T>, DeviceError> {
        axes.check(self.axes)?;
        self.link().latest.read(what, |data, _| {
            let all = field(data).of(self.axes)?;
            let chosen = axes.iter(self.axes).map(|axis| all[axis.index()].clone());
            Some(chosen.collect())
        })
    }

    /// Not every board checks this, so nothing else leaves here.
    pub(super) fn check_finite(
        &self,
        axes: Axes<'_>,
        quantity: &'static str,
        values: &[f64],
    ) -> Result<(), DeviceError> {
        axes.check_finite(self.axes, quantity, values)
    }
}
