//! An arm under control, run by a dedicated thread, as a device.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};

use tracing::{debug, info};

use super::{AXES, ArmControl};
use crate::can::puck::PuckProperty;
use crate::clock;
use crate::inheriting_mutex::{InheritingGuard, InheritingMutex};
use crate::{
    Axes, AxisIndex, AxisInfo, ControlLimits, ControlMode, Device, DeviceError, EncoderReading,
    Encoders, JointType, Limits, MachineBrake, Mode, MotionControl, PositionControl, VariableValue,
    VelocityControl,
};

/// An [`ArmControl`] and the machine under it.
pub trait ControlledArm<const N: usize = AXES>: Send + 'static {
    /// Description of the arm, in words.
    fn description() -> String;

    /// The control of the arm.
    fn control(&self) -> &ArmControl<N>;

    /// The control of the arm, to command it.
    fn control_mut(&mut self) -> &mut ArmControl<N>;

    /// Same as [`ControlMode::set_control_modes`].
    fn set_control_modes(&mut self, axes: Axes<'_>, modes: &[Mode]) -> Result<(), DeviceError> {
        self.control_mut().set_control_modes(axes, modes)
    }

    /// Returns why the motors do not follow, in words; `None` if they do.
    fn fault(&self) -> Option<String>;

    /// Has the machine brake: only the pendant releases it.
    fn brake(&mut self) -> Result<(), DeviceError>;

    /// Returns the temperatures of the motors' pucks, °C.
    fn temperatures(&self) -> Result<[f64; N], DeviceError>;

    /// Reads a property of a motor's puck.
    fn puck_property(
        device: &ArmDevice<Self, N>,
        motor: AxisIndex,
        property: PuckProperty,
    ) -> Result<i32, DeviceError>
    where
        Self: Sized;

    /// Returns the variables that only this kind of arm has, in a fixed order.
    fn variables() -> Vec<String>;

    /// Same as [`RemoteVariables::variable`](crate::RemoteVariables::variable), of those.
    fn variable(device: &ArmDevice<Self, N>, name: &str) -> Result<Vec<VariableValue>, DeviceError>
    where
        Self: Sized;

    /// Same as [`RemoteVariables::set_variable`](crate::RemoteVariables::set_variable), of those.
    fn set_variable(
        device: &ArmDevice<Self, N>,
        name: &str,
        value: &[VariableValue],
    ) -> Result<(), DeviceError>
    where
        Self: Sized;
}

/// Returns the number of joints of an arm as a word.
pub fn count_word(joints: usize) -> String {
    match joints {
        4 => "four".to_owned(),
        7 => "seven".to_owned(),
        other => other.to_string(),
    }
}

/// An arm with `N` joints as a device: its control, shared with the thread that runs it.
///
/// Encoders cannot be set: they are absolute. Dropping the device ends and joins the thread.
#[derive(Debug)]
pub struct ArmDevice<A, const N: usize = AXES> {
    shared: Arc<Shared<A>>,
    thread: Option<JoinHandle<()>>,
}

/// State shared by the device and its thread.
#[derive(Debug)]
pub(super) struct Shared<A> {
    arm: InheritingMutex<Timed<A>>,
    ending: AtomicBool,
}

#[derive(Debug)]
pub(super) struct Timed<A> {
    pub(super) arm: A,
    /// Of the newest state, in seconds since the start of 1970.
    time: f64,
}

impl<A> Timed<A> {
    /// Says that the state is of now.
    pub(super) fn stamp(&mut self) {
        self.time = clock::now();
    }
}

impl<A> Shared<A> {
    pub(super) fn lock(&self) -> InheritingGuard<'_, Timed<A>> {
        // The arm is whole between any two calls, so a panic elsewhere does not spoil it.
        self.arm.lock()
    }

    /// Returns whether the thread has to end.
    pub(super) fn is_ending(&self) -> bool {
        self.ending.load(Ordering::Acquire)
    }
}

impl<A: ControlledArm<N>, const N: usize> ArmDevice<A, N> {
    /// Runs an arm by a thread of this name, which calls `control` until it is stopped.
    pub(super) fn spawn(
        arm: A,
        name: &'static str,
        control: impl FnOnce(&Shared<A>) + Send + 'static,
    ) -> Result<Self, DeviceError> {
        let shared = Arc::new(Shared {
            arm: InheritingMutex::new(Timed {
                arm,
                time: clock::now(),
            }),
            ending: AtomicBool::new(false),
        });
        let theirs = Arc::clone(&shared);
        let thread = thread::Builder::new()
            .name(name.into())
            .spawn(move || control(&theirs))
            .map_err(|source| DeviceError::Start {
                what: "the control thread of the arm",
                source,
            })?;
        info!(axes = N, name, "control of the arm started");
        Ok(Self {
            shared,
            thread: Some(thread),
        })
    }

    /// Does something with the arm between two control periods.
    ///
    /// The control loop waits meanwhile, so it should not take long; the caller runs at the loop's priority then.
    pub fn with<T>(&self, what: impl FnOnce(&mut A) -> T) -> T {
        what(&mut self.shared.lock().arm)
    }

    /// Does something with the control of the arm between two periods: torques, direct positions, gains.
    pub fn control<T>(&self, what: impl FnOnce(&mut ArmControl<N>) -> T) -> T {
        self.with(|arm| what(arm.control_mut()))
    }
}

impl<A, const N: usize> Drop for ArmDevice<A, N> {
    fn drop(&mut self) {
        self.shared.ending.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            if thread.join().is_err() {
                tracing::error!("the control thread of the arm had panicked");
            }
        }
        debug!("control of the arm ended");
    }
}

impl<A: ControlledArm<N>, const N: usize> Device for ArmDevice<A, N> {
    crate::offers! {
        axis_info: AxisInfo,
        position_control: PositionControl,
        velocity_control: VelocityControl,
        encoders: Encoders,
        control_mode: ControlMode,
        control_limits: ControlLimits,
        position_direct: PositionDirect,
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
        joint_fault: JointFault,
        remote_variables: RemoteVariables,
        machine_brake: MachineBrake,
    }
}

impl<A: ControlledArm<N>, const N: usize> MachineBrake for ArmDevice<A, N> {
    fn brake_machine(&self) -> Result<(), DeviceError> {
        self.with(ControlledArm::brake)
    }
}

impl<A: ControlledArm<N>, const N: usize> AxisInfo for ArmDevice<A, N> {
    fn axes(&self) -> usize {
        N
    }

    fn axis_name(&self, axis: AxisIndex) -> Result<String, DeviceError> {
        self.control(|arm| arm.set_points().axis_name(axis).map(str::to_owned))
    }

    fn joint_type(&self, axis: AxisIndex) -> Result<JointType, DeviceError> {
        self.control(|arm| arm.set_points().joint_type(axis))
    }
}

impl<A: ControlledArm<N>, const N: usize> MotionControl for ArmDevice<A, N> {
    fn stop(&self, axes: Axes<'_>) -> Result<(), DeviceError> {
        self.control(|arm| arm.stop(axes))
    }

    fn set_reference_accelerations(
        &self,
        axes: Axes<'_>,
        accelerations: &[f64],
    ) -> Result<(), DeviceError> {
        self.control(|arm| {
            arm.set_points_mut()
                .set_reference_accelerations(axes, accelerations)
        })
    }

    fn reference_accelerations(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.control(|arm| arm.set_points().reference_accelerations(axes))
    }
}

impl<A: ControlledArm<N>, const N: usize> PositionControl for ArmDevice<A, N> {
    fn position_move(&self, axes: Axes<'_>, targets: &[f64]) -> Result<(), DeviceError> {
        self.control(|arm| arm.position_move(axes, targets))
    }

    fn relative_move(&self, axes: Axes<'_>, distances: &[f64]) -> Result<(), DeviceError> {
        self.control(|arm| arm.relative_move(axes, distances))
    }

    fn motion_done(&self, axes: Axes<'_>) -> Result<bool, DeviceError> {
        self.control(|arm| arm.motion_done(axes))
    }

    fn target_positions(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.control(|arm| arm.set_points().target_positions(axes))
    }

    fn set_reference_speeds(&self, axes: Axes<'_>, speeds: &[f64]) -> Result<(), DeviceError> {
        self.control(|arm| arm.set_points_mut().set_reference_speeds(axes, speeds))
    }

    fn reference_speeds(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.control(|arm| arm.set_points().reference_speeds(axes))
    }
}

impl<A: ControlledArm<N>, const N: usize> VelocityControl for ArmDevice<A, N> {
    fn velocity_move(&self, axes: Axes<'_>, velocities: &[f64]) -> Result<(), DeviceError> {
        self.control(|arm| arm.velocity_move(axes, velocities))
    }

    fn reference_velocities(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.control(|arm| arm.set_points().reference_velocities(axes))
    }
}

impl<A: ControlledArm<N>, const N: usize> Encoders for ArmDevice<A, N> {
    fn read_encoders(&self, axes: Axes<'_>, out: &mut [EncoderReading]) -> Result<(), DeviceError> {
        axes.check(N)?;
        axes.check_count(N, "slots for readings", out.len())?;
        let timed = self.shared.lock();
        for (slot, axis) in out.iter_mut().zip(axes.iter(N)) {
            let state = timed.arm.control().state(axis)?;
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
        axes.check_command(N, "encoder positions", positions.len())?;
        Err(DeviceError::NotSupported {
            what: "setting absolute encoders".to_owned(),
        })
    }
}

impl<A: ControlledArm<N>, const N: usize> ControlMode for ArmDevice<A, N> {
    fn available_control_modes(&self, axis: AxisIndex) -> Result<Vec<Mode>, DeviceError> {
        self.control(|arm| arm.available_control_modes(axis))
    }

    fn read_control_modes(&self, axes: Axes<'_>, out: &mut [Mode]) -> Result<(), DeviceError> {
        self.control(|arm| arm.read_control_modes(axes, out))
    }

    fn set_control_modes(&self, axes: Axes<'_>, modes: &[Mode]) -> Result<(), DeviceError> {
        self.with(|arm| arm.set_control_modes(axes, modes))
    }
}

impl<A: ControlledArm<N>, const N: usize> ControlLimits for ArmDevice<A, N> {
    fn position_limits(&self, axis: AxisIndex) -> Result<Limits, DeviceError> {
        self.control(|arm| arm.set_points().position_limits(axis))
    }

    fn set_position_limits(&self, axis: AxisIndex, limits: Limits) -> Result<(), DeviceError> {
        self.control(|arm| arm.set_points_mut().set_position_limits(axis, limits))
    }

    fn velocity_limits(&self, axis: AxisIndex) -> Result<Limits, DeviceError> {
        self.control(|arm| arm.set_points().velocity_limits(axis))
    }

    fn set_velocity_limits(&self, axis: AxisIndex, limits: Limits) -> Result<(), DeviceError> {
        self.control(|arm| arm.set_points_mut().set_velocity_limits(axis, limits))
    }
}
