//! What questions mean for the device.

use yarp_devices::Limits;
use yarp_wire::{Bottle, Value, Vocab32};

use super::super::messages::{Get, Quantity, Selection, joint_type_to_value, vocabulary as word};
use super::board::{Board, Refusal};

impl Board {
    /// The answer to a question: what stands in the place of the echo, and the values.
    ///
    /// `echo` is item 1 of the question as it came.
    pub(super) fn ask(
        &self,
        get: &Get,
        echo: Option<Value>,
    ) -> Result<(Value, Vec<Value>), Refusal> {
        let echo = echo.unwrap_or(Value::Int32(0));
        let values = match get {
            Get::Axes => vec![Value::Int32(self.axes() as i32)],
            Get::Name(axis) => vec![self.info()?.axis_name(*axis)?.into()],
            Get::Type(axis) => vec![joint_type_to_value(self.info()?.joint_type(*axis)?)],
            Get::Values(quantity, selection) => {
                vec![as_selected(selection, self.quantity(*quantity, selection)?)]
            }
            Get::MotionDone(selection) => {
                let done = self.position()?.motion_done(selection.axes())?;
                vec![Value::Int32(i32::from(done))]
            }
            Get::PositionLimits(axis) => pair(self.limits()?.position_limits(*axis)?),
            Get::VelocityLimits(axis) => pair(self.limits()?.velocity_limits(*axis)?),
            Get::ControlModes(selection) => return self.control_modes(selection),
        };
        Ok((echo, values))
    }

    fn quantity(&self, quantity: Quantity, selection: &Selection) -> Result<Vec<f64>, Refusal> {
        let axes = selection.axes();
        // The length of an answer is bounded only once the axes are known to exist.
        axes.check(self.axes())?;
        Ok(match quantity {
            Quantity::TargetPosition => self.position()?.target_positions(axes)?,
            Quantity::ReferenceSpeed => self.position()?.reference_speeds(axes)?,
            Quantity::ReferenceAcceleration => self.motion()?.reference_accelerations(axes)?,
            Quantity::ReferenceVelocity => self.velocity()?.reference_velocities(axes)?,
            measured => {
                let readings = self.encoders()?.encoder_readings(axes)?;
                let value = readings.iter().map(|reading| match measured {
                    Quantity::Speed => reading.speed,
                    Quantity::Acceleration => reading.acceleration,
                    _ => reading.position,
                });
                value.collect()
            }
        })
    }

    /// The echo is the joint for one, and the word of the question for several.
    fn control_modes(&self, selection: &Selection) -> Result<(Value, Vec<Value>), Refusal> {
        let modes = self.modes()?.control_modes(selection.axes())?;
        let mut words = modes
            .into_iter()
            .map(|mode| Value::from(Vocab32::from_code(mode.into())));
        Ok(match selection {
            Selection::One(axis) => {
                let joint = Value::Int32(axis.index() as i32);
                (joint, words.next().into_iter().collect())
            }
            Selection::Group(_) => (word::CONTROL_MODE_GROUP.into(), list(words)),
            Selection::All => (word::CONTROL_MODES.into(), list(words)),
        })
    }
}

/// One number as it is, several as a list.
fn as_selected(selection: &Selection, values: Vec<f64>) -> Value {
    let mut values = values.into_iter().map(Value::Float64);
    match selection {
        Selection::One(_) => values.next().unwrap_or(Value::Float64(0.0)),
        Selection::Group(_) | Selection::All => Value::List(values.collect()),
    }
}

fn list(values: impl Iterator<Item = Value>) -> Vec<Value> {
    vec![Value::List(values.collect::<Bottle>())]
}

fn pair(limits: Limits) -> Vec<Value> {
    vec![limits.min.into(), limits.max.into()]
}
