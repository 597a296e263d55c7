//! The arm with masses and friction, run in real time.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use tracing::{debug, info, warn};

use super::{AXES, DynamicArm, WamModel};
use crate::simulation::SimulatorOptions;
use crate::{
    Axes, AxisIndex, AxisInfo, ControlLimits, ControlMode, Device, DeviceError, EncoderReading,
    Encoders, JointFault, JointType, Limits, Mode, MotionControl, MotorEncoders, PidControl,
    PositionControl, PositionDirect, TorqueControl, VelocityControl,
};

/// The most time that is made up for. After a longer pause of the machine the arm goes on from where it was.
const LONGEST_PAUSE: Duration = Duration::from_millis(100);

/// A simulated seven-joint WAM arm that behaves like the machine: see [`DynamicArm`].
///
/// * A thread of its own runs the control loop; the n-th period ends n periods after the start, so that it does not
///   drift. Dropping the arm ends and joins the thread.
/// * Moves end near their targets, not on them: tenths of a degree off, as gains and friction leave it. Where tests or
///   demonstrations need exact ends, [`SimulatedWam`](super::SimulatedWam) is the one.
/// * Encoders cannot be set: they are absolute.
///
/// ```
/// use yarp_devices::wam::DynamicWam;
/// use yarp_devices::{Axes, AxisInfo, Mode, ControlMode};
///
/// # fn main() -> Result<(), yarp_devices::DeviceError> {
/// let arm = DynamicWam::start()?;
/// assert_eq!(arm.axis_name(3.into())?, "elbow");
/// arm.set_control_modes(Axes::One(3.into()), &[Mode::Torque])?;
/// arm.with(|arm| arm.set_reference_torques(Axes::One(3.into()), &[-2.0]))?;
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct DynamicWam {
    shared: Arc<Shared>,
    control: Option<JoinHandle<()>>,
}

#[derive(Debug)]
struct Shared {
    arm: Mutex<Timed>,
    ending: AtomicBool,
}

#[derive(Debug)]
struct Timed {
    arm: DynamicArm,
    /// Of the newest step, in seconds since the start of 1970.
    time: f64,
}

impl DynamicWam {
    /// Starts Barrett's arm at the control rate of libbarrett.
    ///
    /// Errors: [`DeviceError::Start`] when the machine has no thread left.
    pub fn start() -> Result<Self, DeviceError> {
        Self::start_with(WamModel::<AXES>::new(), SimulatorOptions::default())
    }

    /// Starts an arm that is built and run like this.
    ///
    /// Errors: [`DeviceError::Start`] when the machine has no thread left.
    pub fn start_with(
        model: WamModel<AXES>,
        options: SimulatorOptions,
    ) -> Result<Self, DeviceError> {
        let shared = Arc::new(Shared {
            arm: Mutex::new(Timed {
                arm: DynamicArm::new(model, options),
                time: wall_clock(),
            }),
            ending: AtomicBool::new(false),
        });
        let theirs = Arc::clone(&shared);
        let control = thread::Builder::new()
            .name("dynamic-wam".into())
            .spawn(move || theirs.control(options.period))
            .map_err(|source| DeviceError::Start {
                what: "the control thread of the simulated arm",
                source,
            })?;
        info!(axes = AXES, "simulated arm with dynamics started");
        Ok(Self {
            shared,
            control: Some(control),
        })
    }

    /// Does something with the arm between two control periods: torques, direct positions, gains, the
    /// safety module, a push.
    ///
    /// The control loop waits meanwhile, so it should not take long.
    pub fn with<T>(&self, what: impl FnOnce(&mut DynamicArm) -> T) -> T {
        what(&mut self.shared.lock().arm)
    }
}

impl Drop for DynamicWam {
    fn drop(&mut self) {
        self.shared.ending.store(true, Ordering::Release);
        if let Some(control) = self.control.take() {
            control.thread().unpark();
            if control.join().is_err() {
                tracing::error!("the control thread of the simulated arm had panicked");
            }
        }
        debug!("simulated arm with dynamics ended");
    }
}

impl Shared {
    fn control(&self, period: Duration) {
        // A period of 0 would never end.
        let period = period.max(Duration::from_micros(100));
        let mut deadline = Instant::now() + period;
        let mut fault = None;
        while !self.ending.load(Ordering::Acquire) {
            let now = Instant::now();
            if now < deadline {
                // May wake early, then the loop comes back here.
                thread::park_timeout(deadline - now);
                continue;
            }
            if now - deadline > LONGEST_PAUSE {
                deadline = now;
            }
            deadline += period;
            let mut timed = self.lock();
            timed.arm.tick();
            timed.time = wall_clock();
            let found = timed.arm.simulator().safety().fault();
            drop(timed);
            if found != fault {
                if let Some(why) = found {
                    warn!(%why, "the safety module stopped the simulated arm");
                }
                fault = found;
            }
        }
    }

    fn lock(&self) -> MutexGuard<'_, Timed> {
        // The arm is whole between any two calls, so a panic elsewhere does not spoil it.
        self.arm.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn wall_clock() -> f64 {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default()
        .as_secs_f64()
}

impl Device for DynamicWam {
    fn axis_info(&self) -> Option<&dyn AxisInfo> {
        Some(self)
    }

    fn position_control(&self) -> Option<&dyn PositionControl> {
        Some(self)
    }

    fn velocity_control(&self) -> Option<&dyn VelocityControl> {
        Some(self)
    }

    fn encoders(&self) -> Option<&dyn Encoders> {
        Some(self)
    }

    fn control_mode(&self) -> Option<&dyn ControlMode> {
        Some(self)
    }

    fn control_limits(&self) -> Option<&dyn ControlLimits> {
        Some(self)
    }

    fn position_direct(&self) -> Option<&dyn PositionDirect> {
        Some(self)
    }

    fn torque_control(&self) -> Option<&dyn TorqueControl> {
        Some(self)
    }

    fn pid_control(&self) -> Option<&dyn PidControl> {
        Some(self)
    }

    fn motor_encoders(&self) -> Option<&dyn MotorEncoders> {
        Some(self)
    }

    fn joint_fault(&self) -> Option<&dyn JointFault> {
        Some(self)
    }
}

impl AxisInfo for DynamicWam {
    fn axes(&self) -> usize {
        AXES
    }

    fn axis_name(&self, axis: AxisIndex) -> Result<String, DeviceError> {
        self.with(|arm| arm.set_points().axis_name(axis).map(str::to_owned))
    }

    fn joint_type(&self, axis: AxisIndex) -> Result<JointType, DeviceError> {
        self.with(|arm| arm.set_points().joint_type(axis))
    }
}

impl MotionControl for DynamicWam {
    fn stop(&self, axes: Axes<'_>) -> Result<(), DeviceError> {
        self.with(|arm| arm.stop(axes))
    }

    fn set_reference_accelerations(
        &self,
        axes: Axes<'_>,
        accelerations: &[f64],
    ) -> Result<(), DeviceError> {
        self.with(|arm| {
            arm.set_points_mut()
                .set_reference_accelerations(axes, accelerations)
        })
    }

    fn reference_accelerations(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.with(|arm| arm.set_points().reference_accelerations(axes))
    }
}

impl PositionControl for DynamicWam {
    fn position_move(&self, axes: Axes<'_>, targets: &[f64]) -> Result<(), DeviceError> {
        self.with(|arm| arm.position_move(axes, targets))
    }

    fn relative_move(&self, axes: Axes<'_>, distances: &[f64]) -> Result<(), DeviceError> {
        self.with(|arm| arm.relative_move(axes, distances))
    }

    fn motion_done(&self, axes: Axes<'_>) -> Result<bool, DeviceError> {
        self.with(|arm| arm.motion_done(axes))
    }

    fn target_positions(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.with(|arm| arm.set_points().target_positions(axes))
    }

    fn set_reference_speeds(&self, axes: Axes<'_>, speeds: &[f64]) -> Result<(), DeviceError> {
        self.with(|arm| arm.set_points_mut().set_reference_speeds(axes, speeds))
    }

    fn reference_speeds(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.with(|arm| arm.set_points().reference_speeds(axes))
    }
}

impl VelocityControl for DynamicWam {
    fn velocity_move(&self, axes: Axes<'_>, velocities: &[f64]) -> Result<(), DeviceError> {
        self.with(|arm| arm.velocity_move(axes, velocities))
    }

    fn reference_velocities(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.with(|arm| arm.set_points().reference_velocities(axes))
    }
}

impl Encoders for DynamicWam {
    fn read_encoders(&self, axes: Axes<'_>, out: &mut [EncoderReading]) -> Result<(), DeviceError> {
        axes.check(AXES)?;
        axes.check_count(AXES, "slots for readings", out.len())?;
        let timed = self.shared.lock();
        for (slot, axis) in out.iter_mut().zip(axes.iter(AXES)) {
            let state = timed.arm.state(axis)?;
            *slot = EncoderReading {
                position: state.position,
                speed: state.velocity,
                acceleration: state.acceleration,
                time: timed.time,
            };
        }
        Ok(())
    }

    fn set_encoders(&self, axes: Axes<'_>, positions: &[f64]) -> Result<(), DeviceError> {
        axes.check_command(AXES, "encoder positions", positions.len())?;
        Err(DeviceError::NotSupported {
            what: "setting absolute encoders".to_owned(),
        })
    }
}

impl ControlMode for DynamicWam {
    fn available_control_modes(&self, axis: AxisIndex) -> Result<Vec<Mode>, DeviceError> {
        self.with(|arm| arm.available_control_modes(axis))
    }

    fn read_control_modes(&self, axes: Axes<'_>, out: &mut [Mode]) -> Result<(), DeviceError> {
        self.with(|arm| arm.read_control_modes(axes, out))
    }

    fn set_control_modes(&self, axes: Axes<'_>, modes: &[Mode]) -> Result<(), DeviceError> {
        self.with(|arm| arm.set_control_modes(axes, modes))
    }
}

impl ControlLimits for DynamicWam {
    fn position_limits(&self, axis: AxisIndex) -> Result<Limits, DeviceError> {
        self.with(|arm| arm.set_points().position_limits(axis))
    }

    fn set_position_limits(&self, axis: AxisIndex, limits: Limits) -> Result<(), DeviceError> {
        self.with(|arm| arm.set_points_mut().set_position_limits(axis, limits))
    }

    fn velocity_limits(&self, axis: AxisIndex) -> Result<Limits, DeviceError> {
        self.with(|arm| arm.set_points().velocity_limits(axis))
    }

    fn set_velocity_limits(&self, axis: AxisIndex, limits: Limits) -> Result<(), DeviceError> {
        self.with(|arm| arm.set_points_mut().set_velocity_limits(axis, limits))
    }
}
