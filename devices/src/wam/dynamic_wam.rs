//! The arm with masses and friction, run in the time of the process.

use std::time::Duration;

use tracing::warn;

use super::arm_device::{ArmDevice, Shared};
use super::{AXES, DynamicArm, WamModel};
use crate::DeviceError;
use crate::clock::TimeSource;
use crate::kinematics::Joints;
use crate::periodic_timer::{MissedCycles, PeriodicTimer};
use crate::simulation::SimulatorOptions;

/// A simulated WAM arm with `N` joints that behaves like the machine: see [`DynamicArm`].
///
/// * A thread of its own runs the control loop; the n-th period ends n periods after the start, so that it does not
///   drift. Dropping the arm ends and joins the thread. The periods are those of the process's [`TimeSource`]; of a single
///   step of a clock on the network at most 10 s are made up for.
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
pub type DynamicWam<const N: usize = AXES> = ArmDevice<DynamicArm<N>, N>;

impl DynamicWam {
    /// Starts Barrett's arm at the control rate of libbarrett.
    ///
    /// Errors: [`DeviceError::Start`] when the machine has no thread left.
    pub fn start() -> Result<Self, DeviceError> {
        Self::start_with(WamModel::<AXES>::new(), SimulatorOptions::default())
    }
}

impl<const N: usize> DynamicWam<N> {
    /// Starts an arm that is built and run like this.
    ///
    /// Errors: [`DeviceError::Start`] when the machine has no thread left.
    pub fn start_with(model: WamModel<N>, options: SimulatorOptions) -> Result<Self, DeviceError> {
        Self::start_among(model, options, options.period, |_| None)
    }

    /// Starts an arm that moves in the time of `source`; its readings carry the time of the process.
    ///
    /// Errors: [`DeviceError::Start`] when the machine has no thread left.
    pub fn start_on(
        source: TimeSource,
        model: WamModel<N>,
        options: SimulatorOptions,
    ) -> Result<Self, DeviceError> {
        Self::spawn_on(source, model, options, options.period, |_| None)
    }

    /// Starts an arm among other bodies.
    ///
    /// * `period`: real time between two control periods; another one than that of `options` makes time pass faster or
    ///   slower.
    /// * `surroundings`: called after each control period with the true joint angles, rad, while nobody is kept from the
    ///   arm; returns the torques that contact puts on the joints during the next, Nm, or `None` to leave them.
    ///
    /// Errors: [`DeviceError::Start`] when the machine has no thread left.
    pub fn start_among(
        model: WamModel<N>,
        options: SimulatorOptions,
        period: Duration,
        surroundings: impl FnMut(&Joints<N>) -> Option<Joints<N>> + Send + 'static,
    ) -> Result<Self, DeviceError> {
        Self::spawn_on(TimeSource::current(), model, options, period, surroundings)
    }

    fn spawn_on(
        source: TimeSource,
        model: WamModel<N>,
        options: SimulatorOptions,
        period: Duration,
        surroundings: impl FnMut(&Joints<N>) -> Option<Joints<N>> + Send + 'static,
    ) -> Result<Self, DeviceError> {
        let arm = DynamicArm::new(model, options);
        let timer = PeriodicTimer::on(source, period, MissedCycles::CatchUp);
        Self::spawn(arm, "dynamic-wam", move |shared| {
            run(shared, timer, surroundings);
        })
    }
}

fn run<const N: usize>(
    shared: &Shared<DynamicArm<N>>,
    mut timer: PeriodicTimer,
    mut surroundings: impl FnMut(&Joints<N>) -> Option<Joints<N>>,
) {
    let mut fault = None;
    while timer.wait(|| shared.is_ending()) {
        let mut timed = shared.lock();
        timed.arm.tick();
        timed.stamp();
        let found = timed.arm.simulator().safety().fault();
        let angles = timed.arm.simulator().angles();
        drop(timed);
        if let Some(torques) = surroundings(&angles) {
            let mut timed = shared.lock();
            timed.arm.simulator_mut().set_contact_torques(torques);
        }
        if found != fault {
            if let Some(why) = found {
                warn!(error = %why, "the safety module stopped the simulated arm");
            }
            fault = found;
        }
    }
}
