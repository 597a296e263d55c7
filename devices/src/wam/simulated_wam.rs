//! A WAM arm without hardware: a model that is advanced by the elapsed time at each call.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use tracing::info;

use super::parameters;
use crate::clock::TimeSource;
use crate::fake::{AxesModel, AxisParameters};
use crate::{
    Axes, AxisIndex, AxisInfo, ControlLimits, ControlMode, DeviceError, EncoderReading, Encoders,
    JointType, Limits, Mode, MotionControl, PositionControl, VelocityControl,
};

/// A simulated seven-joint WAM arm that moves in the time of the process, or of another [`TimeSource`].
///
/// * It starts at rest in the folded home pose, in position mode, with the limits, speeds and accelerations of
///   [`parameters`]. Encoders are exact, and a move ends exactly at its target.
/// * Each call first advances the [`AxesModel`] by the elapsed time, which is exact for any duration: so an idle arm
///   takes no processor time. All axes carry the time of the call.
/// * Calls wait for nothing longer than another call, some microseconds.
/// * It has all modes but mixed, and refuses others by name. Nothing times out: a velocity or a torque stays in
///   force until the next command. Pushed by torque, current or duty cycle an axis is a mass with friction: there is
///   no gravity and no coupling.
/// * Gains, impedance, limits of amplifiers and motors are stored and reported, and change nothing.
///
/// ```
/// use yarp_devices::wam::SimulatedWam;
/// use yarp_devices::{Axes, AxisInfo, Encoders};
///
/// # fn main() -> Result<(), yarp_devices::DeviceError> {
/// let arm = SimulatedWam::new();
/// assert_eq!(arm.axis_name(3.into())?, "elbow");
/// let elbow = arm.encoder_readings(Axes::One(3.into()))?[0];
/// assert_eq!(elbow.position, 3.13_f64.to_degrees());
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct SimulatedWam {
    source: TimeSource,
    arm: Mutex<Arm>,
}

#[derive(Debug)]
pub(super) struct Arm {
    pub(super) model: AxesModel,
    /// Until when the model has had its time.
    stepped: Instant,
    /// The same moment, in seconds of the time source.
    pub(super) time: f64,
}

impl SimulatedWam {
    /// An arm at rest.
    pub fn new() -> Self {
        Self::with_axes(parameters())
    }

    /// Another machine of simulated axes, which moves as the arm does.
    pub fn with_axes(axes: impl IntoIterator<Item = AxisParameters>) -> Self {
        Self::with_axes_on(TimeSource::current(), axes)
    }

    /// Creates a machine of simulated axes that moves in the time of `source`.
    pub fn with_axes_on(
        source: TimeSource,
        axes: impl IntoIterator<Item = AxisParameters>,
    ) -> Self {
        let model = AxesModel::new(axes);
        info!(axes = model.axes(), "simulated arm started");
        Self {
            arm: Mutex::new(Arm {
                model,
                stepped: source.instant(),
                time: source.now(),
            }),
            source,
        }
    }

    /// Adds variables that can be read and set, empty at first. They do not change how the axes move.
    pub fn store_variables(&self, names: impl IntoIterator<Item = String>) {
        self.arm().model.store_variables(names);
    }

    /// Returns the present arm.
    pub(super) fn arm(&self) -> MutexGuard<'_, Arm> {
        // The model is whole between any two calls, so a panic elsewhere does not spoil it.
        let mut arm = self.arm.lock().unwrap_or_else(PoisonError::into_inner);
        let now = self.source.instant();
        let passed = now.saturating_duration_since(arm.stepped);
        arm.model.step(passed);
        arm.stepped = now;
        arm.time = self.source.now();
        arm
    }
}

impl Default for SimulatedWam {
    fn default() -> Self {
        Self::new()
    }
}

impl AxisInfo for SimulatedWam {
    fn axes(&self) -> usize {
        self.arm().model.axes()
    }

    fn axis_name(&self, axis: AxisIndex) -> Result<String, DeviceError> {
        self.arm().model.axis_name(axis).map(str::to_owned)
    }

    fn joint_type(&self, axis: AxisIndex) -> Result<JointType, DeviceError> {
        self.arm().model.joint_type(axis)
    }
}

impl MotionControl for SimulatedWam {
    fn stop(&self, axes: Axes<'_>) -> Result<(), DeviceError> {
        self.arm().model.stop(axes)
    }

    fn set_reference_accelerations(
        &self,
        axes: Axes<'_>,
        accelerations: &[f64],
    ) -> Result<(), DeviceError> {
        self.arm()
            .model
            .set_reference_accelerations(axes, accelerations)
    }

    fn reference_accelerations(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.arm().model.reference_accelerations(axes)
    }
}

impl PositionControl for SimulatedWam {
    fn position_move(&self, axes: Axes<'_>, targets: &[f64]) -> Result<(), DeviceError> {
        self.arm().model.position_move(axes, targets)
    }

    fn relative_move(&self, axes: Axes<'_>, distances: &[f64]) -> Result<(), DeviceError> {
        self.arm().model.relative_move(axes, distances)
    }

    fn motion_done(&self, axes: Axes<'_>) -> Result<bool, DeviceError> {
        self.arm().model.motion_done(axes)
    }

    fn target_positions(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.arm().model.target_positions(axes)
    }

    fn set_reference_speeds(&self, axes: Axes<'_>, speeds: &[f64]) -> Result<(), DeviceError> {
        self.arm().model.set_reference_speeds(axes, speeds)
    }

    fn reference_speeds(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.arm().model.reference_speeds(axes)
    }
}

impl VelocityControl for SimulatedWam {
    fn velocity_move(&self, axes: Axes<'_>, velocities: &[f64]) -> Result<(), DeviceError> {
        self.arm().model.velocity_move(axes, velocities)
    }

    fn reference_velocities(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.arm().model.reference_velocities(axes)
    }
}

impl Encoders for SimulatedWam {
    fn read_encoders(&self, axes: Axes<'_>, out: &mut [EncoderReading]) -> Result<(), DeviceError> {
        let arm = self.arm();
        axes.check_count(arm.model.axes(), "slots for readings", out.len())?;
        let mut slots = out.iter_mut();
        arm.model.read_states(axes, |state| {
            if let Some(slot) = slots.next() {
                *slot = EncoderReading {
                    position: state.position,
                    speed: state.velocity,
                    acceleration: state.acceleration,
                    time: arm.time,
                };
            }
        })
    }

    fn set_encoders(&self, axes: Axes<'_>, positions: &[f64]) -> Result<(), DeviceError> {
        self.arm().model.set_encoders(axes, positions)
    }
}

impl ControlMode for SimulatedWam {
    fn available_control_modes(&self, axis: AxisIndex) -> Result<Vec<Mode>, DeviceError> {
        self.arm().model.available_control_modes(axis)
    }

    fn read_control_modes(&self, axes: Axes<'_>, out: &mut [Mode]) -> Result<(), DeviceError> {
        self.arm().model.read_control_modes(axes, out)
    }

    fn set_control_modes(&self, axes: Axes<'_>, modes: &[Mode]) -> Result<(), DeviceError> {
        self.arm().model.set_control_modes(axes, modes)
    }
}

impl ControlLimits for SimulatedWam {
    fn position_limits(&self, axis: AxisIndex) -> Result<Limits, DeviceError> {
        self.arm().model.position_limits(axis)
    }

    fn set_position_limits(&self, axis: AxisIndex, limits: Limits) -> Result<(), DeviceError> {
        self.arm().model.set_position_limits(axis, limits)
    }

    fn velocity_limits(&self, axis: AxisIndex) -> Result<Limits, DeviceError> {
        self.arm().model.velocity_limits(axis)
    }

    fn set_velocity_limits(&self, axis: AxisIndex, limits: Limits) -> Result<(), DeviceError> {
        self.arm().model.set_velocity_limits(axis, limits)
    }
}
