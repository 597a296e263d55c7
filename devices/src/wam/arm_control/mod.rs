//! Arm control behind the calls of the device interfaces; stepped by its owner.

mod compliance;
mod motor_currents;
mod stall;

use std::time::Duration;

use self::compliance::Compliance;
pub(crate) use self::motor_currents::UNITS_PER_AMPERE;
use self::stall::StallDetection;
use super::axis_parameters::parameters_of;
use super::wam_units::{degrees, gains_per_degree, gains_per_radian};
use super::{AXES, WamModel};
use crate::dynamics::Body;
use crate::fake::{AxesModel, MotionState};
use crate::kinematics::Joints;
use crate::simulation::{Gains, JointCommand, JointControllers};
use crate::{Axes, AxisIndex, DeviceError, Limits, Mode};

/// Modes of a joint.
const MODES: [Mode; 6] = [
    Mode::Idle,
    Mode::Position,
    Mode::PositionDirect,
    Mode::Velocity,
    Mode::Torque,
    Mode::Current,
];
/// The low-pass filter of the difference quotient of positions, rad/s (libbarrett, `wam7w.conf`).
const SPEED_FILTER: f64 = 180.0;
/// Speed below which a joint is at rest, deg/s: less than that of one encoder count.
const STANDSTILL_SPEED: f64 = 1.0;

/// Moves, streams, loops and modes of an arm with `N` joints, from encoder counts to torques, in **degrees**.
///
/// The methods are those of the interfaces in [`iface`](crate::iface) and keep their contracts, with what a machine
/// adds: a move ends near its target, as near as gains and friction allow; encoders count; while the machine is
/// not [ready](Self::set_ready) all joints are in [`Mode::HardwareFault`]. Set points come from the same
/// [`AxesModel`] as those of [`SimulatedWam`](super::SimulatedWam).
///
/// The conversion of torques into motion is not in here: [`DynamicArm`](super::DynamicArm) has a simulator for it,
/// [`CanWam`](super::can::CanWam) an arm on its bus.
#[derive(Clone, Debug)]
pub struct ArmControl<const N: usize = AXES> {
    model: WamModel<N>,
    set_points: AxesModel,
    controller: JointControllers<N>,
    period: Duration,
    counts: [i32; N],
    /// Torques of the joints in the last period, Nm.
    driven: Joints<N>,
    measured: [MotionState; N],
    streams: [Stream; N],
    /// Currents of motors in current mode, A.
    asked: [f64; N],
    compliance: [Compliance; N],
    load: Body,
    ready: bool,
    error: Option<ArmError>,
    /// Commands are refused with it, and every joint holds.
    refusal: Option<ArmError>,
    stall: StallDetection<N>,
}

/// The error of an unreachable machine, for callers that command it.
#[derive(Clone, Debug, PartialEq)]
pub struct ArmError {
    /// The peer that should answer, for instance `the arm on can0`.
    pub peer: String,
    /// The step, and what happened.
    pub step: String,
    /// Advice on what to try next.
    pub advice: String,
}

impl From<&ArmError> for DeviceError {
    fn from(error: &ArmError) -> Self {
        Self::Remote {
            peer: error.peer.clone(),
            step: error.step.clone(),
            advice: error.advice.clone(),
            source: None,
        }
    }
}

/// Commands that the set points of moves know nothing of.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stream {
    /// None: the joint follows its set point, or is idle.
    None,
    /// The position that was sent, and the one that the joint is sent to now on its way there, deg.
    Position { sent: f64, now: f64 },
    /// Nm.
    Torque(f64),
    /// A current of its motors.
    Current,
}

impl Stream {
    /// Holds a joint at a position, deg.
    const fn at(place: f64) -> Self {
        Self::Position {
            sent: place,
            now: place,
        }
    }
}

impl<const N: usize> ArmControl<N> {
    /// Control of an arm at rest at these counts, ready, in position mode.
    pub fn new(model: WamModel<N>, period: Duration, counts: [i32; N]) -> Self {
        let controller = JointControllers::new(model.clone(), period);
        let compliance =
            std::array::from_fn(|joint| Compliance::stiff(Self::largest_impedance(&model, joint)));
        let mut control = Self {
            model,
            set_points: AxesModel::new(parameters_of::<N>()),
            controller,
            period,
            counts,
            driven: Joints::zeros(),
            measured: [MotionState::default(); N],
            streams: [Stream::None; N],
            asked: [0.0; N],
            compliance,
            load: Body::default(),
            ready: true,
            error: None,
            refusal: None,
            stall: StallDetection::default(),
        };
        control.forget_motion(counts);
        control
    }

    /// The torques that follow the commands for the next period, Nm at the joints.
    pub fn drive(&mut self) -> Joints<N> {
        self.set_points.step(self.period);
        self.step_direct_positions();
        let by_current = self.asked_by_current();
        let orders = std::array::from_fn(|joint| {
            let axis = AxisIndex::from(joint);
            if !self.ready {
                self.rest(axis);
            }
            match self.streams[joint] {
                Stream::Position { now, .. } => self.towards(joint, now, 0.0),
                Stream::Torque(torque) => JointCommand::Drive(torque),
                Stream::Current => JointCommand::Drive(by_current[joint]),
                Stream::None if self.mode(axis) == Mode::Idle => {
                    self.put_set_point(axis, self.measured[joint].position);
                    JointCommand::Float
                }
                Stream::None => {
                    let set_point = self.set_point(axis);
                    self.towards(joint, set_point.position, set_point.velocity)
                }
            }
        });
        self.driven = self.controller.step(&self.counts, &orders);
        self.detect_stalls(&orders);
        self.driven
    }

    /// Moves the set points of joints in position direct mode towards what was sent, each no faster than its velocity limit: after a
    /// pause of the network, what is sent next may be far away.
    fn step_direct_positions(&mut self) {
        for joint in 0..N {
            let Stream::Position { sent, now } = &mut self.streams[joint] else {
                continue;
            };
            let limits = self.set_points.velocity_limits(joint.into());
            let largest = limits.map_or(0.0, |limits| limits.max) * self.period.as_secs_f64();
            *now += (*sent - *now).clamp(-largest, largest);
        }
    }

    /// Processes the encoder counts at the end of a period.
    pub fn take_counts(&mut self, counts: [i32; N]) {
        self.counts = counts;
        self.measure(self.period.as_secs_f64());
    }

    /// Starts from the arm at these counts, without history: as after a time without control.
    pub fn forget_motion(&mut self, counts: [i32; N]) {
        self.counts = counts;
        let positions = degrees(self.controller.measure(&counts).into());
        self.measured = positions.map(|position| MotionState {
            position,
            ..MotionState::default()
        });
        self.controller.reset();
    }

    /// Holds all joints at their positions, in position mode; any motion is dropped.
    pub fn hold(&mut self) {
        for joint in 0..N {
            let axis = AxisIndex::from(joint);
            self.drop_streams(joint);
            self.rest(axis);
            self.set_mode_of_set_point(axis, Mode::Position);
        }
        self.controller.reset();
    }

    /// Says whether the motors follow torques. While they do not, all joints are in [`Mode::HardwareFault`], commands
    /// are refused, what was commanded is dropped, and compliant joints become stiff.
    pub fn set_ready(&mut self, ready: bool) {
        self.ready = ready;
        if ready {
            return;
        }
        for joint in 0..N {
            self.drop_streams(joint);
            self.compliance[joint].stiffen();
            self.rest(joint.into());
        }
    }

    /// Returns whether the motors follow torques.
    pub fn is_ready(&self) -> bool {
        self.ready
    }

    /// Says why the machine cannot be reached, or that it can: commands and readings are refused with it.
    pub fn set_error(&mut self, error: Option<ArmError>) {
        self.error = error;
    }

    /// Refuses commands that move joints, and has each joint come to rest and hold, while there is a reason; idle joints stay
    /// idle. Readings go on.
    pub fn set_refusal(&mut self, refusal: Option<ArmError>) {
        let begins = self.refusal.is_none() && refusal.is_some();
        self.refusal = refusal;
        if begins {
            for joint in 0..N {
                self.come_to_rest(joint.into());
            }
        }
    }

    /// Has a joint ramp down and hold in position mode; an idle one stays idle.
    fn come_to_rest(&mut self, axis: AxisIndex) {
        match self.mode(axis) {
            Mode::Idle | Mode::HardwareFault => {}
            mode => {
                if matches!(mode, Mode::Position | Mode::Velocity) {
                    let stopped = self.set_points.stop(axis.into());
                    debug_assert!(stopped.is_ok(), "the axis was checked");
                }
                if mode == Mode::PositionDirect {
                    let place = self.measured[axis.index()].position;
                    self.streams[axis.index()] = Stream::at(place);
                }
                self.change_mode(axis, Mode::Position);
            }
        }
    }

    /// Returns whether commands that move joints are accepted.
    fn accepts(&self) -> Result<(), DeviceError> {
        self.reachable()?;
        self.refusal.as_ref().map_or(Ok(()), |why| Err(why.into()))
    }

    /// Returns the model of the arm.
    pub fn model(&self) -> &WamModel<N> {
        &self.model
    }

    /// Returns the load that gravity compensation assumes at the tool plate, beside the arm that it was calibrated
    /// with.
    pub fn compensated_load(&self) -> &Body {
        &self.load
    }

    /// Has gravity compensated for something else at the tool plate, in the frame of which it is described: from the next
    /// period on, at once.
    pub fn set_compensated_load(&mut self, load: Body) {
        self.load = load;
        let loaded = self.model.clone().with_load(load);
        self.controller.set_calibration(loaded.calibration);
    }

    pub(super) fn reachable(&self) -> Result<(), DeviceError> {
        self.error.as_ref().map_or(Ok(()), |why| Err(why.into()))
    }

    /// Position, filtered velocity, and how that changes.
    fn measure(&mut self, seconds: f64) {
        let positions = degrees(self.controller.measure(&self.counts).into());
        let share = SPEED_FILTER * seconds / (1.0 + SPEED_FILTER * seconds);
        for (now, position) in self.measured.iter_mut().zip(positions) {
            let quotient = (position - now.position) / seconds;
            let velocity = now.velocity + share * (quotient - now.velocity);
            *now = MotionState {
                position,
                velocity,
                acceleration: (velocity - now.velocity) / seconds,
            };
        }
    }

    /// Returns the state of an axis by the encoders, degrees and per second.
    ///
    /// Errors: [`DeviceError::NoSuchAxis`], [`DeviceError::Remote`] while the machine cannot be reached.
    pub fn state(&self, axis: AxisIndex) -> Result<MotionState, DeviceError> {
        Axes::One(axis).check(N)?;
        self.reachable()?;
        Ok(self.measured[axis.index()])
    }

    /// Returns the set point generator of position and velocity mode, for names, limits and references.
    pub fn set_points(&self) -> &AxesModel {
        &self.set_points
    }

    /// The same, to set limits and references.
    pub fn set_points_mut(&mut self) -> &mut AxesModel {
        &mut self.set_points
    }

    /// Same as [`PositionControl::position_move`](crate::PositionControl::position_move).
    pub fn position_move(&mut self, axes: Axes<'_>, targets: &[f64]) -> Result<(), DeviceError> {
        self.check_mode(axes, "position move", Mode::Position)?;
        self.set_points.position_move(axes, targets)?;
        self.forget_stalls(axes);
        Ok(())
    }

    /// Same as [`PositionControl::relative_move`](crate::PositionControl::relative_move), from the present set point.
    pub fn relative_move(&mut self, axes: Axes<'_>, distances: &[f64]) -> Result<(), DeviceError> {
        self.check_mode(axes, "position move", Mode::Position)?;
        self.set_points.relative_move(axes, distances)?;
        self.forget_stalls(axes);
        Ok(())
    }

    /// Same as [`VelocityControl::velocity_move`](crate::VelocityControl::velocity_move).
    pub fn velocity_move(&mut self, axes: Axes<'_>, velocities: &[f64]) -> Result<(), DeviceError> {
        self.check_mode(axes, "velocity move", Mode::Velocity)?;
        self.set_points.velocity_move(axes, velocities)
    }

    /// Same as [`MotionControl::stop`](crate::MotionControl::stop); a joint under torques or direct positions holds
    /// its position.
    pub fn stop(&mut self, axes: Axes<'_>) -> Result<(), DeviceError> {
        self.reachable()?;
        self.set_points.stop(axes)?;
        for axis in axes.iter(N) {
            let joint = axis.index();
            match self.streams[joint] {
                Stream::None => {}
                Stream::Position { .. } => {
                    self.streams[joint] = Stream::at(self.measured[joint].position);
                }
                Stream::Torque(_) => self.streams[joint] = Stream::Torque(0.0),
                Stream::Current => self.forget_currents(joint),
            }
        }
        Ok(())
    }

    /// Returns whether the set points have arrived and the joints are at rest.
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    pub fn motion_done(&self, axes: Axes<'_>) -> Result<bool, DeviceError> {
        let arrived = self.set_points.motion_done(axes)?;
        self.reachable()?;
        let still = |axis: AxisIndex| self.measured[axis.index()].velocity.abs() < STANDSTILL_SPEED;
        Ok(arrived && axes.iter(N).all(still))
    }

    /// Sends joints in position direct mode to places, degrees, at once, but no faster than their velocity limits: the caller makes the
    /// path.
    ///
    /// Errors: [`DeviceError::OutOfRange`], [`DeviceError::NotFinite`], [`DeviceError::WrongMode`], or an error of
    /// the selection; then no joint moves.
    pub fn set_direct_positions(
        &mut self,
        axes: Axes<'_>,
        positions: &[f64],
    ) -> Result<(), DeviceError> {
        axes.check_command(N, "positions", positions.len())?;
        self.check_mode(axes, "direct position", Mode::PositionDirect)?;
        for (axis, &asked) in axes.iter(N).zip(positions) {
            let limits = self.set_points.position_limits(axis)?;
            limits.check(axis, "position", asked, "deg")?;
        }
        for (axis, &asked) in axes.iter(N).zip(positions) {
            if let Stream::Position { sent, .. } = &mut self.streams[axis.index()] {
                *sent = asked;
            }
        }
        Ok(())
    }

    /// The places last sent, degrees; where a joint is if none was.
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    pub fn direct_positions(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        axes.check(N)?;
        let place = |axis: AxisIndex| match self.streams[axis.index()] {
            Stream::Position { sent, .. } => sent,
            _ => self.set_point(axis).position,
        };
        Ok(axes.iter(N).map(place).collect())
    }

    /// Commands torques of joints in torque mode, Nm, until the next command; gravity stays compensated.
    ///
    /// Errors: [`DeviceError::OutOfRange`], [`DeviceError::NotFinite`], [`DeviceError::WrongMode`], or an error of
    /// the selection; then every joint continues as before.
    pub fn set_reference_torques(
        &mut self,
        axes: Axes<'_>,
        torques: &[f64],
    ) -> Result<(), DeviceError> {
        axes.check_command(N, "torques", torques.len())?;
        self.check_mode(axes, "torque", Mode::Torque)?;
        for (axis, &asked) in axes.iter(N).zip(torques) {
            self.torque_range(axis)?
                .check(axis, "torque", asked, "Nm")?;
        }
        for (axis, &asked) in axes.iter(N).zip(torques) {
            self.streams[axis.index()] = Stream::Torque(asked);
        }
        Ok(())
    }

    /// Returns the last commanded torques, Nm; 0 outside torque mode.
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    pub fn reference_torques(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        axes.check(N)?;
        let asked = |axis: AxisIndex| match self.streams[axis.index()] {
            Stream::Torque(torque) => torque,
            _ => 0.0,
        };
        Ok(axes.iter(N).map(asked).collect())
    }

    /// The torques that the motors were driven with in the last period, Nm at the joints, gravity compensation included.
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    pub fn torques(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        axes.check(N)?;
        Ok(axes.iter(N).map(|axis| self.driven[axis.index()]).collect())
    }

    /// Returns the range of torques of a joint, Nm: that of its control loop.
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    pub fn torque_range(&self, axis: AxisIndex) -> Result<Limits, DeviceError> {
        Axes::One(axis).check(N)?;
        Ok(self.range_of_loop(axis.index()))
    }

    fn range_of_loop(&self, joint: usize) -> Limits {
        let most = self.controller.gains()[joint].limit;
        Limits::new(-most, most)
    }

    /// The gains of a joint's position loop, in Nm per degree.
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    pub fn gains(&self, axis: AxisIndex) -> Result<Gains, DeviceError> {
        Axes::One(axis).check(N)?;
        Ok(gains_per_degree(self.controller.gains()[axis.index()]))
    }

    /// Sets the gains of a joint's position loop, in Nm per degree.
    ///
    /// Errors: [`DeviceError::NoSuchAxis`], [`DeviceError::NotFinite`], [`DeviceError::OutOfRange`] for a negative one,
    /// or for a torque limit above the torque of the joint's motors.
    pub fn set_gains(&mut self, axis: AxisIndex, gains: Gains) -> Result<(), DeviceError> {
        self.check_gains(axis, gains)?;
        self.controller
            .set_gains(axis.index(), gains_per_radian(gains));
        Ok(())
    }

    /// Checks gains before they are set, with the errors of [`set_gains`](Self::set_gains).
    pub(super) fn check_gains(&self, axis: AxisIndex, gains: Gains) -> Result<(), DeviceError> {
        Axes::One(axis).check(N)?;
        let possible = Limits::new(0.0, self.model.largest_torque(axis.index()));
        possible.check(axis, "torque limit", gains.limit, "Nm")?;
        let positive = Limits::new(0.0, f64::MAX);
        for (quantity, asked) in [
            ("proportional gain", gains.proportional),
            ("integral gain", gains.integral),
            ("derivative gain", gains.derivative),
        ] {
            positive.check(axis, quantity, asked, "Nm/deg")?;
        }
        Ok(())
    }

    /// Returns the last output of a joint's position loop or driving command, Nm without gravity.
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    pub fn loop_output(&self, axis: AxisIndex) -> Result<f64, DeviceError> {
        Axes::One(axis).check(N)?;
        Ok(self.controller.outputs()[axis.index()])
    }

    /// Forgets the integrals of position loops.
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    pub fn reset_loops(&mut self, axes: Axes<'_>) -> Result<(), DeviceError> {
        axes.check(N)?;
        for axis in axes.iter(N) {
            self.controller.reset_joint(axis.index());
        }
        Ok(())
    }

    /// Returns the counts of the motors' encoders.
    pub fn motor_counts(&self) -> [i32; N] {
        self.counts
    }

    /// The modes a joint can be set to.
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    pub fn available_control_modes(&self, axis: AxisIndex) -> Result<Vec<Mode>, DeviceError> {
        Axes::One(axis).check(N)?;
        Ok(MODES.to_vec())
    }

    /// Same as [`ControlMode::read_control_modes`](crate::ControlMode::read_control_modes).
    pub fn read_control_modes(&self, axes: Axes<'_>, out: &mut [Mode]) -> Result<(), DeviceError> {
        axes.check_count(N, "slots for modes", out.len())?;
        axes.check(N)?;
        for (slot, axis) in out.iter_mut().zip(axes.iter(N)) {
            *slot = self.mode(axis);
        }
        Ok(())
    }

    /// Same as [`ControlMode::set_control_modes`](crate::ControlMode::set_control_modes).
    ///
    /// While the machine is not ready only [`Mode::ForceIdle`] is taken.
    pub fn set_control_modes(&mut self, axes: Axes<'_>, modes: &[Mode]) -> Result<(), DeviceError> {
        axes.check_command(N, "modes", modes.len())?;
        self.reachable()?;
        for (joint, &mode) in axes.iter(N).zip(modes) {
            if mode == Mode::ForceIdle {
                continue;
            }
            if !MODES.contains(&mode) {
                return Err(DeviceError::NoSuchMode { joint, mode });
            }
            self.check_ready(joint, "a change of mode")?;
            if mode != Mode::Idle && mode != self.mode(joint) {
                self.accepts()?;
            }
        }
        for (axis, &mode) in axes.iter(N).zip(modes) {
            self.change_mode(axis, mode);
        }
        Ok(())
    }

    pub(super) fn check_ready(
        &self,
        joint: AxisIndex,
        command: &'static str,
    ) -> Result<(), DeviceError> {
        if self.ready {
            return Ok(());
        }
        Err(DeviceError::WrongMode {
            joint,
            command,
            mode: Mode::HardwareFault,
            needed: Mode::ForceIdle,
        })
    }

    /// Ends any stream that drives a joint.
    fn drop_streams(&mut self, joint: usize) {
        self.forget_currents(joint);
        self.streams[joint] = Stream::None;
    }

    fn change_mode(&mut self, axis: AxisIndex, mode: Mode) {
        let before = self.mode(axis);
        if before == mode {
            return;
        }
        self.forget_stalls(axis.into());
        let joint = axis.index();
        let here = match before {
            // The joint continues from its set point: no jump.
            Mode::Position | Mode::Velocity => self.set_point(axis).position,
            _ => match self.streams[joint] {
                Stream::Position { now, .. } => now,
                _ => self.measured[joint].position,
            },
        };
        self.forget_currents(joint);
        let stream = match mode {
            Mode::PositionDirect => Some(Stream::at(here)),
            Mode::Torque => Some(Stream::Torque(0.0)),
            Mode::Current => Some(Stream::Current),
            _ => None,
        };
        match stream {
            Some(stream) => {
                self.rest(axis);
                self.put_set_point(axis, here);
                self.streams[joint] = stream;
            }
            None => {
                self.streams[joint] = Stream::None;
                if !matches!(before, Mode::Position | Mode::Velocity) {
                    self.put_set_point(axis, here);
                }
                self.set_mode_of_set_point(axis, mode);
            }
        }
    }

    pub(super) fn mode(&self, axis: AxisIndex) -> Mode {
        if !self.ready {
            return Mode::HardwareFault;
        }
        match self.streams[axis.index()] {
            Stream::Position { .. } => Mode::PositionDirect,
            Stream::Torque(_) => Mode::Torque,
            Stream::Current => Mode::Current,
            Stream::None => {
                let mut mode = [Mode::UNKNOWN];
                let read = self.set_points.read_control_modes(axis.into(), &mut mode);
                debug_assert!(read.is_ok(), "the axis was checked");
                mode[0]
            }
        }
    }

    fn check_mode(
        &self,
        axes: Axes<'_>,
        command: &'static str,
        needed: Mode,
    ) -> Result<(), DeviceError> {
        axes.check(N)?;
        self.accepts()?;
        match axes.iter(N).find(|axis| self.mode(*axis) != needed) {
            Some(joint) => Err(DeviceError::WrongMode {
                joint,
                command,
                mode: self.mode(joint),
                needed,
            }),
            None => Ok(()),
        }
    }

    /// Stops the set point of an axis.
    fn rest(&mut self, axis: AxisIndex) {
        self.set_mode_of_set_point(axis, Mode::Idle);
        self.put_set_point(axis, self.measured[axis.index()].position);
    }

    fn set_mode_of_set_point(&mut self, axis: AxisIndex, mode: Mode) {
        let set = self.set_points.set_control_modes(axis.into(), &[mode]);
        debug_assert!(set.is_ok(), "axis and mode were checked");
    }

    fn put_set_point(&mut self, axis: AxisIndex, position: f64) {
        let placed = self.set_points.place_measured(axis, position);
        debug_assert!(placed.is_ok(), "the axis was checked");
    }

    fn set_point(&self, axis: AxisIndex) -> MotionState {
        self.set_points
            .state(axis)
            .unwrap_or(self.measured[axis.index()])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A count of the base is 360 / (4096 * 42) degrees (libbarrett), the smallest of all joints; one in a period of 2 ms is motion.
    #[test]
    fn a_joint_that_turns_by_a_count_per_period_is_not_at_rest() {
        let model = WamModel::<7>::new();
        let counts = model.transmission.counts(&model.home);
        let mut control = ArmControl::new(model, Duration::from_millis(2), counts);
        let count = 360.0 / (4096.0 * 42.0) / 0.002;
        for (velocity, done) in [(0.92 * count, true), (count, false), (-count, false)] {
            control.measured[0].velocity = velocity;
            let told = control.motion_done(Axes::All).unwrap();
            assert_eq!(told, done, "{velocity} deg/s");
        }
    }
}
