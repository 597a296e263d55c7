//! A WAM arm without the arm: the model, run in real time.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use tracing::{debug, info};

use super::parameters;
use crate::clock::wall_clock;
use crate::fake::{AxisParameters, Model};
use crate::{
    Axes, AxisIndex, AxisInfo, ControlLimits, ControlMode, Device, DeviceError, EncoderReading,
    Encoders, JointType, Limits, Mode, MotionControl, PositionControl, VelocityControl,
};

/// The control period of the arm: 500 Hz, as libbarrett runs it.
const PERIOD: Duration = Duration::from_millis(2);
/// The most time one step may make up for. After a longer pause of the machine the arm goes on from where it
/// was, instead of being found far away.
const LONGEST_STEP: Duration = Duration::from_millis(100);

/// A simulated seven-joint WAM arm that moves in real time.
///
/// * It starts at rest in the folded home pose, in position mode, with the limits, speeds and accelerations of
///   [`parameters`]. Encoders are exact, and a move ends exactly at its target.
/// * A thread of its own steps the [`Model`] at 500 Hz; all axes carry the wall-clock time of the newest step.
///   Dropping the arm ends and joins the thread.
/// * Calls wait for nothing longer than one step of the model, some microseconds.
/// * It has all modes but mixed, and refuses others by name. Nothing times out: a velocity or a torque stays in
///   force until the next command. Pushed by torque, current or duty cycle an axis is a mass with friction: there is
///   no gravity and no coupling.
/// * Gains, impedance, limits of amplifiers and motors are kept and told, and change nothing.
///
/// ```
/// use yarp_devices::wam::SimulatedWam;
/// use yarp_devices::{Axes, AxisInfo, Encoders};
///
/// # fn main() -> Result<(), yarp_devices::DeviceError> {
/// let arm = SimulatedWam::start()?;
/// assert_eq!(arm.axis_name(3.into())?, "elbow");
/// let elbow = arm.encoder_readings(Axes::One(3.into()))?[0];
/// assert_eq!(elbow.position, 3.13_f64.to_degrees());
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct SimulatedWam {
    shared: Arc<Shared>,
    control: Option<JoinHandle<()>>,
}

#[derive(Debug)]
struct Shared {
    arm: Mutex<Arm>,
    ending: AtomicBool,
}

#[derive(Debug)]
pub(super) struct Arm {
    pub(super) model: Model,
    /// Of the newest step, in seconds since the start of 1970.
    pub(super) time: f64,
}

impl SimulatedWam {
    /// Starts an arm.
    ///
    /// Errors: [`DeviceError::Start`] when the machine has no thread left.
    pub fn start() -> Result<Self, DeviceError> {
        Self::start_with(parameters())
    }

    /// Starts another machine of simulated axes, which moves as the arm does.
    ///
    /// Errors: as [`start`](Self::start).
    pub fn start_with(axes: impl IntoIterator<Item = AxisParameters>) -> Result<Self, DeviceError> {
        let model = Model::new(axes);
        let axes = model.axes();
        let shared = Arc::new(Shared {
            arm: Mutex::new(Arm {
                model,
                time: wall_clock(),
            }),
            ending: AtomicBool::new(false),
        });
        let theirs = Arc::clone(&shared);
        let control = thread::Builder::new()
            .name("simulated-wam".into())
            .spawn(move || theirs.control())
            .map_err(|source| DeviceError::Start {
                what: "the control thread of the simulated arm",
                source,
            })?;
        info!(axes, "simulated arm started");
        Ok(Self {
            shared,
            control: Some(control),
        })
    }

    pub(super) fn arm(&self) -> MutexGuard<'_, Arm> {
        self.shared.lock()
    }
}

impl Drop for SimulatedWam {
    fn drop(&mut self) {
        self.shared.ending.store(true, Ordering::Release);
        if let Some(control) = self.control.take() {
            control.thread().unpark();
            if control.join().is_err() {
                tracing::error!("the control thread of the simulated arm had panicked");
            }
        }
        debug!("simulated arm ended");
    }
}

impl Shared {
    /// The control loop: step by the time that has passed, then sleep until the next deadline.
    fn control(&self) {
        let mut stepped = Instant::now();
        let mut deadline = stepped;
        while !self.ending.load(Ordering::Acquire) {
            let now = Instant::now();
            if now < deadline {
                // May wake early, then the loop comes back here.
                thread::park_timeout(deadline - now);
                continue;
            }
            {
                let mut arm = self.lock();
                arm.model.step((now - stepped).min(LONGEST_STEP));
                arm.time = wall_clock();
            }
            stepped = now;
            // After a late step the missed ones are left out, not run in a burst.
            deadline = (deadline + PERIOD).max(now);
        }
    }

    fn lock(&self) -> MutexGuard<'_, Arm> {
        // The model is whole between any two calls, so a panic elsewhere does not spoil it.
        self.arm.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Device for SimulatedWam {
    crate::offers! {
        axis_info: AxisInfo,
        position_control: PositionControl,
        velocity_control: VelocityControl,
        encoders: Encoders,
        control_mode: ControlMode,
        control_limits: ControlLimits,
        position_direct: PositionDirect,
        velocity_direct: VelocityDirect,
        torque_control: TorqueControl,
        current_control: CurrentControl,
        pwm_control: PwmControl,
        interaction_mode: InteractionMode,
        impedance_control: ImpedanceControl,
        pid_control: PidControl,
        motor_encoders: MotorEncoders,
        motor: Motor,
        amplifier_control: AmplifierControl,
        control_calibration: ControlCalibration,
        remote_calibrator: RemoteCalibrator,
        remote_variables: RemoteVariables,
        joint_fault: JointFault,
        joint_brake: JointBrake,
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
