//! Queries and commands for joints, in either wire version.

use yarp_devices::{Axes, AxisIndex, DeviceError};
use yarp_wire::{Value, WireVersion};

use super::super::messages::{
    Action, Command, Field, Get, JointData, Outcome, Quantity, Query, Selection, Set, Setting,
    Spelling, Words,
};
use super::RemoteControlBoard;

impl RemoteControlBoard {
    /// Asks about one axis.
    pub(super) fn about<T: Outcome>(
        &self,
        question: Query,
        axis: AxisIndex,
    ) -> Result<T, DeviceError> {
        Axes::One(axis).check(self.axes)?;
        self.ask(Get::About(question, Selection::One(axis)))?
            .read(|values| T::read(values, true))
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
        let get = |selection| Get::Values(quantity, selection);
        self.each(quantity.spelling(), axes, get)
    }

    /// Asks for the number of one joint.
    pub(super) fn value(&self, quantity: Quantity, axis: AxisIndex) -> Result<f64, DeviceError> {
        let values = self.values(quantity, axis.into())?;
        Ok(values.into_iter().next().unwrap_or(f64::NAN))
    }

    /// Asks the same about each of several joints.
    pub(super) fn about_each<T>(
        &self,
        question: Query,
        axes: Axes<'_>,
    ) -> Result<Vec<T>, DeviceError>
    where
        Vec<T>: Outcome,
    {
        let get = |selection| Get::About(question, selection);
        self.each(question.spelling(), axes, get)
    }

    /// Asks by one message where there is one, else by several, and puts the answers together.
    fn each<T>(
        &self,
        spelling: Spelling,
        axes: Axes<'_>,
        get: impl Fn(Selection) -> Get,
    ) -> Result<Vec<T>, DeviceError>
    where
        Vec<T>: Outcome,
    {
        axes.check(self.axes)?;
        let selections =
            spelling.sayable(self.wire_version(), axes, self.axes, "ask about", true)?;
        let mut all = Vec::new();
        for selection in selections {
            let expected = selection.axes().len(self.axes);
            if expected == 0 {
                continue;
            }
            let one = matches!(selection, Selection::One(_));
            let read = |values: &[Value]| {
                <Vec<T>>::read(values, one).filter(|answers| answers.len() == expected)
            };
            all.extend(self.ask(get(selection))?.read(read)?);
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
        axes.check_finite(self.axes, what, values)?;
        if values.is_empty() {
            return Ok(());
        }
        if let Some(words) = self.streaming(setting, axes)
            && let Ok(selections) = words.sayable(axes, self.axes, what, false)
        {
            for selection in selections {
                let wire_version = self.wire_version();
                if let Some(command) = Command::new(setting, &selection, values, wire_version) {
                    return self
                        .link
                        .run(|link| async move { link.stream(&command).await });
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
        self.link.latest.read_known(what, |data, _| {
            let all = field(data).of(self.axes)?;
            let chosen = axes.iter(self.axes).map(|axis| all[axis.index()].clone());
            Some(chosen.collect())
        })
    }
}
