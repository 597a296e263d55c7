//! Several simulated axes under one roof.

use std::time::Duration;

use super::boot_memory::BootMemory;
use super::simulated_axis::{Axis, MODES};
use super::{AxisParameters, MotionState};
use crate::{Axes, AxisIndex, DeviceError, JointType, Limits, Mode, VariableValue};

/// A set of axes that takes the commands of the device interfaces and moves when it is stepped.
///
/// The methods are those of the interfaces in [`iface`](crate::iface) and keep their contracts. The model starts in
/// position mode, as the stock `fakeMotionControl` does; its motors are described in `axis_motor`. It is
/// deterministic: the same commands and steps give the same numbers.
///
/// ```
/// use std::time::Duration;
/// use yarp_devices::fake::AxesModel;
/// use yarp_devices::{Axes, wam};
///
/// # fn main() -> Result<(), yarp_devices::DeviceError> {
/// let mut arm = AxesModel::new(wam::parameters());
/// let base = Axes::One(0.into());
/// arm.position_move(base, &[10.0])?;
/// while !arm.motion_done(base)? {
///     arm.step(Duration::from_millis(2));
/// }
/// assert_eq!(arm.state(0.into())?.position, 10.0);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct AxesModel {
    pub(super) axes: Vec<Axis>,
    /// Variables without a meaning here, with their values.
    pub(super) stored: Vec<(String, Vec<VariableValue>)>,
    pub(super) boot_memory: BootMemory,
}

impl AxesModel {
    /// Axes at their home positions, at rest, in position mode.
    pub fn new(parameters: impl IntoIterator<Item = AxisParameters>) -> Self {
        let axes: Vec<_> = parameters
            .into_iter()
            .enumerate()
            .map(|(index, built)| Axis::new(index.into(), built))
            .collect();
        Self {
            boot_memory: BootMemory::of(&axes, &[]),
            axes,
            stored: Vec::new(),
        }
    }

    /// Lets time pass. Steps of any length are exact: two halves give what one whole gives.
    pub fn step(&mut self, time: Duration) {
        let seconds = time.as_secs_f64();
        for axis in &mut self.axes {
            axis.step(seconds);
        }
    }

    /// Returns position and motion of an axis.
    pub fn state(&self, axis: AxisIndex) -> Result<MotionState, DeviceError> {
        Ok(self.axis(axis)?.state())
    }

    /// Puts an axis at rest at the nearest position inside its limits, in any state: as by hand.
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    pub fn place(&mut self, axis: AxisIndex, position: f64) -> Result<(), DeviceError> {
        self.axis_mut(axis)?.place(position);
        Ok(())
    }

    /// Puts an axis at rest at a measured position, which may be outside its limits. From there commands move it
    /// back; it does not jump.
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    #[cfg(feature = "barrett")]
    pub(crate) fn place_measured(
        &mut self,
        axis: AxisIndex,
        position: f64,
    ) -> Result<(), DeviceError> {
        self.axis_mut(axis)?.set_encoder(position);
        Ok(())
    }

    /// Same as [`AxisInfo::axes`](crate::AxisInfo::axes).
    pub fn axes(&self) -> usize {
        self.axes.len()
    }

    /// Same as [`AxisInfo::axis_name`](crate::AxisInfo::axis_name).
    pub fn axis_name(&self, axis: AxisIndex) -> Result<&str, DeviceError> {
        Ok(&self.axis(axis)?.built().name)
    }

    /// Same as [`AxisInfo::joint_type`](crate::AxisInfo::joint_type).
    pub fn joint_type(&self, axis: AxisIndex) -> Result<JointType, DeviceError> {
        Ok(self.axis(axis)?.built().joint_type)
    }

    /// Same as [`MotionControl::stop`](crate::MotionControl::stop).
    pub fn stop(&mut self, axes: Axes<'_>) -> Result<(), DeviceError> {
        let total = self.axes();
        axes.check(total)?;
        for axis in axes.iter(total) {
            self.axes[axis.index()].stop();
        }
        Ok(())
    }

    /// Same as [`MotionControl::set_reference_accelerations`](crate::MotionControl::set_reference_accelerations).
    pub fn set_reference_accelerations(
        &mut self,
        axes: Axes<'_>,
        accelerations: &[f64],
    ) -> Result<(), DeviceError> {
        self.command(
            axes,
            "reference accelerations",
            accelerations,
            Axis::check_reference_acceleration,
            Axis::set_reference_acceleration,
        )
    }

    /// Same as [`MotionControl::reference_accelerations`](crate::MotionControl::reference_accelerations).
    pub fn reference_accelerations(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        Ok(self
            .selected(axes)?
            .map(Axis::reference_acceleration)
            .collect())
    }

    /// Same as [`PositionControl::position_move`](crate::PositionControl::position_move).
    pub fn position_move(&mut self, axes: Axes<'_>, targets: &[f64]) -> Result<(), DeviceError> {
        self.command(
            axes,
            "target positions",
            targets,
            Axis::check_position_move,
            Axis::position_move,
        )
    }

    /// Same as [`PositionControl::relative_move`](crate::PositionControl::relative_move).
    pub fn relative_move(&mut self, axes: Axes<'_>, distances: &[f64]) -> Result<(), DeviceError> {
        self.command(
            axes,
            "distances",
            distances,
            Axis::check_relative_move,
            Axis::relative_move,
        )
    }

    /// Same as [`PositionControl::motion_done`](crate::PositionControl::motion_done).
    pub fn motion_done(&self, axes: Axes<'_>) -> Result<bool, DeviceError> {
        Ok(self.selected(axes)?.all(Axis::is_done))
    }

    /// Same as [`PositionControl::target_positions`](crate::PositionControl::target_positions).
    pub fn target_positions(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        Ok(self.selected(axes)?.map(Axis::target).collect())
    }

    /// Same as [`PositionControl::set_reference_speeds`](crate::PositionControl::set_reference_speeds).
    pub fn set_reference_speeds(
        &mut self,
        axes: Axes<'_>,
        speeds: &[f64],
    ) -> Result<(), DeviceError> {
        self.command(
            axes,
            "reference speeds",
            speeds,
            Axis::check_reference_speed,
            Axis::set_reference_speed,
        )
    }

    /// Same as [`PositionControl::reference_speeds`](crate::PositionControl::reference_speeds).
    pub fn reference_speeds(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        Ok(self.selected(axes)?.map(Axis::reference_speed).collect())
    }

    /// Same as [`VelocityControl::velocity_move`](crate::VelocityControl::velocity_move).
    pub fn velocity_move(&mut self, axes: Axes<'_>, velocities: &[f64]) -> Result<(), DeviceError> {
        self.command(
            axes,
            "velocities",
            velocities,
            Axis::check_velocity_move,
            Axis::velocity_move,
        )
    }

    /// Same as [`VelocityControl::reference_velocities`](crate::VelocityControl::reference_velocities).
    pub fn reference_velocities(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        Ok(self.selected(axes)?.map(Axis::velocity).collect())
    }

    /// Calls `take` with the state of each selected axis; without allocating.
    pub fn read_states(
        &self,
        axes: Axes<'_>,
        take: impl FnMut(MotionState),
    ) -> Result<(), DeviceError> {
        self.selected(axes)?.map(Axis::state).for_each(take);
        Ok(())
    }

    /// Same as [`Encoders::set_encoders`](crate::Encoders::set_encoders).
    pub fn set_encoders(&mut self, axes: Axes<'_>, positions: &[f64]) -> Result<(), DeviceError> {
        self.command(
            axes,
            "encoder positions",
            positions,
            Axis::check_encoder,
            Axis::set_encoder,
        )
    }

    /// Same as [`ControlMode::available_control_modes`](crate::ControlMode::available_control_modes).
    pub fn available_control_modes(&self, axis: AxisIndex) -> Result<Vec<Mode>, DeviceError> {
        self.axis(axis).map(|_| MODES.to_vec())
    }

    /// Same as [`ControlMode::read_control_modes`](crate::ControlMode::read_control_modes).
    pub fn read_control_modes(&self, axes: Axes<'_>, out: &mut [Mode]) -> Result<(), DeviceError> {
        axes.check_count(self.axes(), "slots for modes", out.len())?;
        for (slot, axis) in out.iter_mut().zip(self.selected(axes)?) {
            *slot = axis.mode();
        }
        Ok(())
    }

    /// Same as [`ControlMode::set_control_modes`](crate::ControlMode::set_control_modes).
    pub fn set_control_modes(&mut self, axes: Axes<'_>, modes: &[Mode]) -> Result<(), DeviceError> {
        self.command(
            axes,
            "modes",
            modes,
            Axis::check_mode_change,
            Axis::change_mode,
        )
    }

    /// Same as [`ControlLimits::position_limits`](crate::ControlLimits::position_limits).
    pub fn position_limits(&self, axis: AxisIndex) -> Result<Limits, DeviceError> {
        Ok(self.axis(axis)?.limits())
    }

    /// Same as [`ControlLimits::set_position_limits`](crate::ControlLimits::set_position_limits).
    pub fn set_position_limits(
        &mut self,
        axis: AxisIndex,
        limits: Limits,
    ) -> Result<(), DeviceError> {
        self.axis_mut(axis)?.set_limits(limits)
    }

    /// Same as [`ControlLimits::velocity_limits`](crate::ControlLimits::velocity_limits).
    pub fn velocity_limits(&self, axis: AxisIndex) -> Result<Limits, DeviceError> {
        Ok(self.axis(axis)?.velocity_limits())
    }

    /// Same as [`ControlLimits::set_velocity_limits`](crate::ControlLimits::set_velocity_limits).
    pub fn set_velocity_limits(
        &mut self,
        axis: AxisIndex,
        limits: Limits,
    ) -> Result<(), DeviceError> {
        self.axis_mut(axis)?.set_velocity_limits(limits)
    }

    /// Checks a command for every selected axis, and only then carries it out for each.
    pub(super) fn command<T: Copy>(
        &mut self,
        axes: Axes<'_>,
        what: &'static str,
        values: &[T],
        check: impl Fn(&Axis, T) -> Result<(), DeviceError>,
        act: impl Fn(&mut Axis, T),
    ) -> Result<(), DeviceError> {
        let total = self.axes();
        axes.check_command(total, what, values.len())?;
        for (axis, &value) in axes.iter(total).zip(values) {
            check(&self.axes[axis.index()], value)?;
        }
        for (axis, &value) in axes.iter(total).zip(values) {
            act(&mut self.axes[axis.index()], value);
        }
        Ok(())
    }

    pub(super) fn selected<'a>(
        &'a self,
        axes: Axes<'a>,
    ) -> Result<impl Iterator<Item = &'a Axis> + 'a, DeviceError> {
        axes.check(self.axes())?;
        Ok(axes.iter(self.axes()).map(|axis| &self.axes[axis.index()]))
    }

    pub(super) fn axis(&self, asked: AxisIndex) -> Result<&Axis, DeviceError> {
        let axes = self.axes();
        let missing = DeviceError::NoSuchAxis { asked, axes };
        self.axes.get(asked.index()).ok_or(missing)
    }

    pub(super) fn axis_mut(&mut self, asked: AxisIndex) -> Result<&mut Axis, DeviceError> {
        let axes = self.axes();
        let missing = DeviceError::NoSuchAxis { asked, axes };
        self.axes.get_mut(asked.index()).ok_or(missing)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP: Duration = Duration::from_millis(2);
    const FIRST: Axes<'static> = Axes::All;

    fn lone_axis() -> AxesModel {
        AxesModel::new([AxisParameters {
            name: "turn".into(),
            joint_type: JointType::Revolute,
            limits: Limits::new(-100.0, 50.0),
            max_speed: 100.0,
            max_acceleration: 200.0,
            reference_speed: 20.0,
            reference_acceleration: 40.0,
            home: 0.0,
        }])
    }

    fn now(model: &AxesModel) -> MotionState {
        model.state(0.into()).expect("it has one axis")
    }

    fn run(model: &mut AxesModel, seconds: f64) {
        for _ in 0..(seconds / STEP.as_secs_f64()).round() as usize {
            let before = now(model);
            model.step(STEP);
            let after = now(model);
            let gained = (after.velocity - before.velocity).abs();
            assert!(gained <= 200.0 * STEP.as_secs_f64() + 1e-9);
            assert!((-100.0..=50.0).contains(&after.position));
        }
    }

    /// Joints that followed a stream moved on for a hundred degrees after a stop: they braked as gently as a move
    /// does.
    #[test]
    fn a_stop_of_a_stream_is_as_hard_as_the_stream() {
        for mode in [Mode::PositionDirect, Mode::VelocityDirect] {
            let leaves = |model: &mut AxesModel| model.set_control_modes(FIRST, &[Mode::Position]);
            let stops = |model: &mut AxesModel| model.stop(FIRST);
            for end in [leaves, stops] as [fn(&mut AxesModel) -> Result<(), DeviceError>; 2] {
                let mut model = lone_axis();
                model.set_control_modes(FIRST, &[mode]).unwrap();
                match mode {
                    Mode::PositionDirect => model.set_direct_positions(FIRST, &[50.0]).unwrap(),
                    _ => model.set_direct_velocities(FIRST, &[40.0]).unwrap(),
                }
                run(&mut model, 0.2);
                let before = now(&model);
                assert!((before.velocity - 40.0).abs() < 1e-9);
                end(&mut model).unwrap();
                run(&mut model, 0.2);
                assert_eq!(now(&model).velocity, 0.0);
                // 40 deg/s with 200 deg/s².
                assert!((now(&model).position - before.position - 4.0).abs() < 0.01);
            }
        }
    }

    /// Stock's windows ask for this before a velocity.
    #[test]
    fn a_hundred_thousand_degrees_a_second_squared_is_the_most_the_axis_can() {
        let mut model = lone_axis();
        model.set_reference_accelerations(FIRST, &[1e5]).unwrap();
        assert_eq!(model.reference_accelerations(FIRST).unwrap(), [200.0]);
        for bad in [f64::NAN, f64::INFINITY, -1e5, 0.0] {
            let asked = model.set_reference_accelerations(FIRST, &[bad]);
            assert!(asked.is_err(), "{bad}");
        }
        model.set_control_modes(FIRST, &[Mode::Velocity]).unwrap();
        model.velocity_move(FIRST, &[30.0]).unwrap();
        run(&mut model, 0.1);
        assert!((now(&model).velocity - 20.0).abs() < 1e-9);
        run(&mut model, 0.1);
        assert!((now(&model).velocity - 30.0).abs() < 1e-9);
    }

    #[test]
    fn velocity_is_reached_smoothly_and_ends_at_the_limit() {
        let mut model = lone_axis();
        model.set_control_modes(FIRST, &[Mode::Velocity]).unwrap();
        model.velocity_move(FIRST, &[10.0]).unwrap();
        run(&mut model, 0.1);
        assert!((now(&model).velocity - 4.0).abs() < 1e-9);
        run(&mut model, 1.0);
        assert_eq!(now(&model).velocity, 10.0);
        model.velocity_move(FIRST, &[-10.0]).unwrap();
        run(&mut model, 1.0);
        assert_eq!(now(&model).velocity, -10.0);
        model.velocity_move(FIRST, &[100.0]).unwrap();
        run(&mut model, 10.0);
        assert_eq!(now(&model).position, 50.0);
        assert!(model.motion_done(FIRST).unwrap());
        assert_eq!(model.reference_velocities(FIRST).unwrap(), [100.0]);
        // Against the limit: accepted, nothing moves. Away from it: it moves.
        model.velocity_move(FIRST, &[5.0]).unwrap();
        run(&mut model, 0.5);
        assert_eq!(now(&model).position, 50.0);
        model.velocity_move(FIRST, &[-5.0]).unwrap();
        run(&mut model, 0.5);
        assert!(now(&model).position < 50.0);
    }

    #[test]
    fn a_velocity_repeated_at_every_step_is_the_same_motion() {
        let (mut once, mut streamed) = (lone_axis(), lone_axis());
        for model in [&mut once, &mut streamed] {
            model.set_control_modes(FIRST, &[Mode::Velocity]).unwrap();
            model.velocity_move(FIRST, &[80.0]).unwrap();
        }
        for _ in 0..1500 {
            streamed.velocity_move(FIRST, &[80.0]).unwrap();
            once.step(STEP);
            streamed.step(STEP);
            let (one, other) = (now(&once), now(&streamed));
            assert!((one.position - other.position).abs() < 1e-9);
            assert!((one.velocity - other.velocity).abs() < 1e-4);
        }
        assert_eq!(now(&streamed).position, 50.0);
    }

    #[test]
    fn a_change_of_mode_comes_to_rest_and_holds_there() {
        for mode in [Mode::Idle, Mode::Velocity, Mode::ForceIdle] {
            let mut model = lone_axis();
            model.position_move(FIRST, &[40.0]).unwrap();
            run(&mut model, 1.0);
            assert_eq!(now(&model).velocity, 20.0);
            model.set_control_modes(FIRST, &[mode]).unwrap();
            run(&mut model, 1.0);
            let place = now(&model).position;
            assert!(place < 30.0 && model.motion_done(FIRST).unwrap());
            model.set_control_modes(FIRST, &[Mode::Position]).unwrap();
            run(&mut model, 1.0);
            assert_eq!(now(&model).position, place);
            assert_eq!(model.target_positions(FIRST).unwrap(), [place]);
        }
    }

    /// 20 deg/s with 200 deg/s², not with the 40 deg/s² of a stop.
    #[test]
    fn an_axis_set_idle_brakes_as_hard_as_it_can() {
        for mode in [Mode::Idle, Mode::ForceIdle] {
            let mut model = lone_axis();
            model.position_move(FIRST, &[40.0]).unwrap();
            run(&mut model, 1.0);
            let before = now(&model);
            assert_eq!(before.velocity, 20.0);
            model.set_control_modes(FIRST, &[mode]).unwrap();
            run(&mut model, 1.0);
            assert!((now(&model).position - before.position - 1.0).abs() < 0.01);
        }
    }

    /// Full torque gives 200 deg/s² at first and holds 100 deg/s in the end.
    #[test]
    fn a_duty_cycle_is_a_share_of_full_torque() {
        for percent in [100.0, -100.0, 50.0] {
            let mut model = lone_axis();
            let full = model.torque_ranges(FIRST).unwrap()[0].max;
            model.set_control_modes(FIRST, &[Mode::Pwm]).unwrap();
            model.set_reference_duty_cycles(FIRST, &[percent]).unwrap();
            let share = percent / 100.0;
            assert!((model.torques(FIRST).unwrap()[0] - share * full).abs() < 1e-9);
            assert!((model.duty_cycles(FIRST).unwrap()[0] - percent).abs() < 1e-9);
            run(&mut model, 0.01);
            assert!((now(&model).velocity - 2.0 * share).abs() < 0.05);
        }
        let mut model = lone_axis();
        model.position_move(FIRST, &[40.0]).unwrap();
        run(&mut model, 1.0);
        assert_eq!(now(&model).velocity, 20.0);
        assert!((model.duty_cycles(FIRST).unwrap()[0] - 20.0).abs() < 1e-6);
    }

    #[test]
    fn setting_the_mode_it_is_in_changes_nothing() {
        let mut model = lone_axis();
        model.position_move(FIRST, &[40.0]).unwrap();
        run(&mut model, 1.0);
        model.set_control_modes(FIRST, &[Mode::Position]).unwrap();
        run(&mut model, 5.0);
        assert_eq!(now(&model).position, 40.0);
    }

    #[test]
    fn weaker_braking_never_carries_it_over_the_limit() {
        let mut model = lone_axis();
        model.set_reference_speeds(FIRST, &[100.0]).unwrap();
        model.set_reference_accelerations(FIRST, &[200.0]).unwrap();
        model.position_move(FIRST, &[50.0]).unwrap();
        run(&mut model, 0.6);
        model.set_reference_accelerations(FIRST, &[1.0]).unwrap();
        model.stop(FIRST).unwrap();
        run(&mut model, 5.0);
        assert_eq!(now(&model).position, 50.0);
    }

    /// A lower limit of the elbow was refused by an arm that is folded onto its stop.
    #[test]
    fn an_axis_outside_a_limit_takes_a_new_one_on_the_other_side() {
        let mut model = lone_axis();
        model.place_measured(0.into(), 50.1).unwrap();
        model
            .set_position_limits(0.into(), Limits::new(-10.0, 50.0))
            .unwrap();
        let closer = Limits::new(-10.0, 49.0);
        model.set_position_limits(0.into(), closer).unwrap_err();
        model.place_measured(0.into(), -10.1).unwrap();
        model.set_position_limits(0.into(), closer).unwrap();
        let closer = Limits::new(-9.0, 49.0);
        model.set_position_limits(0.into(), closer).unwrap_err();
    }

    #[test]
    fn limits_can_be_drawn_closer_at_rest_only() {
        let mut model = lone_axis();
        let narrow = Limits::new(-10.0, 10.0);
        let message = |outcome: Result<(), DeviceError>| outcome.unwrap_err().to_string();

        model.position_move(FIRST, &[8.0]).unwrap();
        assert_eq!(
            message(model.set_position_limits(0.into(), narrow)),
            "joint 0 is moving, stop it to change its limits"
        );
        run(&mut model, 5.0);
        model.set_position_limits(0.into(), narrow).unwrap();
        assert_eq!(
            message(model.position_move(FIRST, &[12.0])),
            "joint 0 asked for position 12 deg, allowed -10 to 10 deg"
        );
        assert_eq!(
            message(model.set_position_limits(0.into(), Limits::new(-10.0, 5.0))),
            "joint 0 asked for present position 8 deg, allowed -10 to 5 deg"
        );
        assert_eq!(
            message(model.set_position_limits(0.into(), Limits::new(-101.0, 5.0))),
            "joint 0 asked for lower position limit -101 deg, allowed -100 to 50 deg"
        );
        assert!(
            model
                .set_position_limits(0.into(), Limits::new(20.0, -20.0))
                .is_err()
        );
        assert!(
            model
                .set_position_limits(0.into(), Limits::new(f64::NAN, 0.0))
                .is_err()
        );

        model
            .set_velocity_limits(0.into(), Limits::new(0.0, 10.0))
            .unwrap();
        assert_eq!(model.reference_speeds(FIRST).unwrap(), [10.0]);
        assert!(model.set_reference_speeds(FIRST, &[11.0]).is_err());
    }

    #[test]
    fn an_encoder_is_set_at_rest_only() {
        let mut model = lone_axis();
        model.set_encoders(FIRST, &[30.0]).unwrap();
        assert_eq!(now(&model).position, 30.0);
        model.position_move(FIRST, &[0.0]).unwrap();
        assert!(model.set_encoders(FIRST, &[0.0]).is_err());
    }
}
