//! The controller of a tool waits for an arm that lags behind its commands, and sends no arm faster than it may go.

use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};

use nalgebra::Vector3;
use yarp_devices::cartesian::{CartesianController, CartesianOptions};
use yarp_devices::kinematics::{Chain, Joints};
use yarp_devices::wam::WamModel;
use yarp_devices::{
    Axes, AxisIndex, AxisInfo, CartesianControl, ControlLimits, ControlMode, Device, DeviceError,
    EncoderReading, Encoders, JointType, Limits, Mode, PositionDirect, Target, TaskVelocity,
    offers,
};

/// The lead that the documentation of the controller allows, m.
const MAX_LEAD: f64 = 0.015;
/// Motion of a joint from one reading to the next, degrees: at most a few millimetres at the tool.
const STEP: f64 = 0.1;

struct State {
    measured: [f64; 7],
    commanded: [f64; 7],
    /// All commands so far.
    commands: Vec<[f64; 7]>,
    time: f64,
    /// Time of the last command that differed from the one before.
    changed: f64,
    waits: u32,
    /// The largest distance of the tool from its command when the command was changed, m.
    largest_lead: f64,
}

/// An arm that goes to its commands slowly: a step per reading.
struct SlowArm {
    chain: Chain<7>,
    /// Largest motion of a joint from one reading to the next, degrees.
    step: f64,
    /// Distance of the base from where it is commanded, degrees.
    offset: f64,
    /// Velocity limit of each joint, deg/s.
    max_speed: f64,
    state: Mutex<State>,
}

impl SlowArm {
    fn new() -> Self {
        let start = [0.0, 40.0, 0.0, 80.0, 0.0, 20.0, 0.0];
        Self {
            chain: WamModel::<7>::new().chain,
            step: STEP,
            offset: 0.0,
            max_speed: 143.0,
            state: Mutex::new(State {
                measured: start,
                commanded: start,
                commands: vec![start],
                time: 1.0,
                changed: 1.0,
                waits: 0,
                largest_lead: 0.0,
            }),
        }
    }

    /// An arm that is where it is commanded.
    fn prompt() -> Self {
        Self {
            step: f64::INFINITY,
            ..Self::new()
        }
    }

    fn control(self) -> (Arc<Self>, CartesianController<7>) {
        let arm = Arc::new(self);
        let chain = arm.chain.clone();
        let device = Arc::clone(&arm) as Arc<dyn Device>;
        let tool = CartesianController::start(device, chain, CartesianOptions::new());
        (arm, tool.expect("an arm"))
    }

    /// Returns the motions of the tool from each command to the next, m.
    fn steps(&self) -> Vec<Vector3<f64>> {
        let state = self.state();
        let place = |command: &[f64; 7]| Vector3::from(self.tool(command));
        let pairs = state.commands.windows(2);
        pairs
            .map(|pair| place(&pair[1]) - place(&pair[0]))
            .collect()
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().expect("nothing panics with it")
    }

    fn tool(&self, degrees: &[f64; 7]) -> [f64; 3] {
        let joints = Joints::<7>::from(degrees.map(f64::to_radians));
        self.chain.forward(&joints).translation.vector.into()
    }
}

impl Device for SlowArm {
    offers! {
        axis_info: AxisInfo,
        encoders: Encoders,
        control_mode: ControlMode,
        control_limits: ControlLimits,
        position_direct: PositionDirect,
    }
}

impl AxisInfo for SlowArm {
    fn axes(&self) -> usize {
        7
    }

    fn axis_name(&self, axis: AxisIndex) -> Result<String, DeviceError> {
        Ok(format!("joint{axis}"))
    }

    fn joint_type(&self, _axis: AxisIndex) -> Result<JointType, DeviceError> {
        Ok(JointType::Revolute)
    }
}

impl Encoders for SlowArm {
    fn read_encoders(&self, axes: Axes<'_>, out: &mut [EncoderReading]) -> Result<(), DeviceError> {
        let mut state = self.state();
        let commanded = state.commanded;
        for (measured, commanded) in state.measured.iter_mut().zip(commanded) {
            *measured += (commanded - *measured).clamp(-self.step, self.step);
        }
        state.time += 0.01;
        for (slot, axis) in out.iter_mut().zip(axes.iter(7)) {
            let offset = if axis.index() == 0 { self.offset } else { 0.0 };
            *slot = EncoderReading {
                position: state.measured[axis.index()] + offset,
                time: state.time,
                ..EncoderReading::default()
            };
        }
        Ok(())
    }

    fn set_encoders(&self, _axes: Axes<'_>, _positions: &[f64]) -> Result<(), DeviceError> {
        Ok(())
    }
}

impl ControlMode for SlowArm {
    fn available_control_modes(&self, _axis: AxisIndex) -> Result<Vec<Mode>, DeviceError> {
        Ok(vec![Mode::PositionDirect])
    }

    fn read_control_modes(&self, _axes: Axes<'_>, out: &mut [Mode]) -> Result<(), DeviceError> {
        out.fill(Mode::PositionDirect);
        Ok(())
    }

    fn set_control_modes(&self, _axes: Axes<'_>, _modes: &[Mode]) -> Result<(), DeviceError> {
        Ok(())
    }
}

impl ControlLimits for SlowArm {
    fn position_limits(&self, axis: AxisIndex) -> Result<Limits, DeviceError> {
        let limits = self.chain.limits()[axis.index()];
        Ok(Limits::new(
            limits.min.to_degrees(),
            limits.max.to_degrees(),
        ))
    }

    fn set_position_limits(&self, _axis: AxisIndex, _limits: Limits) -> Result<(), DeviceError> {
        Ok(())
    }

    fn velocity_limits(&self, _axis: AxisIndex) -> Result<Limits, DeviceError> {
        Ok(Limits::new(0.0, self.max_speed))
    }

    fn set_velocity_limits(&self, _axis: AxisIndex, _limits: Limits) -> Result<(), DeviceError> {
        Ok(())
    }
}

impl PositionDirect for SlowArm {
    fn set_direct_positions(&self, axes: Axes<'_>, positions: &[f64]) -> Result<(), DeviceError> {
        let mut state = self.state();
        let mut next = state.commanded;
        for (axis, &position) in axes.iter(7).zip(positions) {
            next[axis.index()] = position;
        }
        let (is, was) = (self.tool(&state.measured), self.tool(&state.commanded));
        let lead = (0..3)
            .map(|axis| (is[axis] - was[axis]).powi(2))
            .sum::<f64>()
            .sqrt();
        if next
            .iter()
            .zip(&state.commanded)
            .all(|(new, old)| (new - old).abs() < 1e-9)
        {
            state.waits += 1;
        } else {
            state.largest_lead = state.largest_lead.max(lead);
            state.changed = state.time;
        }
        state.commanded = next;
        state.commands.push(next);
        Ok(())
    }

    fn direct_positions(&self, _axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        Ok(self.state().commanded.to_vec())
    }
}

/// Waits until a motion has ended, in a time that no motion here needs.
fn end(tool: &CartesianController<7>) {
    let deadline = Instant::now() + Duration::from_secs(120);
    while !tool.motion_done().expect("it answers") {
        assert!(Instant::now() < deadline, "the motion never ended");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn no_command_goes_further_while_the_arm_lags() {
    let (arm, tool) = SlowArm::new().control();
    let [x, y, z] = arm.tool(&arm.state().commanded);
    tool.go_to(Target::Position([x - 0.1, y + 0.2, z]), Some(0.1))
        .expect("it is within reach");
    end(&tool);
    let state = arm.state();
    assert!(state.waits > 5, "it waited {} times only", state.waits);
    assert!(
        state.largest_lead <= MAX_LEAD + 1e-6,
        "commanded {} m ahead",
        state.largest_lead
    );
}

/// An arm that does not move at all is waited for 2 s, in periods of 10 ms.
#[test]
fn a_motion_ends_when_the_arm_does_not_follow() {
    let stuck = SlowArm {
        step: 0.0,
        ..SlowArm::new()
    };
    let (arm, tool) = stuck.control();
    let [x, y, z] = arm.tool(&arm.state().commanded);
    tool.go_to(Target::Position([x - 0.1, y + 0.2, z]), Some(0.5))
        .expect("it is within reach");
    end(&tool);
    let waits = arm.state().waits;
    assert!((198..=204).contains(&waits), "{waits} periods");
}

/// An arm that comes to rest 12 mm beside its target, which is more than the tolerance, has ended its motion after 1 s.
#[test]
fn a_motion_ends_when_the_arm_rests_beside_its_target() {
    let mut beside = SlowArm::prompt();
    let [x, y, z] = beside.tool(&beside.state().commanded);
    let goal = [x - 0.1, y + 0.2, z];
    beside.offset = (0.012 / goal[0].hypot(goal[1])).to_degrees();
    let (arm, tool) = beside.control();
    tool.go_to(Target::Position(goal), Some(0.5))
        .expect("it is within reach");
    end(&tool);
    let state = arm.state();
    let rested = state.time - state.changed;
    assert!((1.0..1.1).contains(&rested), "{rested} s");
}

/// Each command is for a period of 10 ms.
#[test]
fn no_joint_is_sent_faster_than_its_limit() {
    let limited = SlowArm {
        max_speed: 10.0,
        ..SlowArm::prompt()
    };
    let (arm, tool) = limited.control();
    let [x, y, z] = arm.tool(&arm.state().commanded);
    tool.go_to(Target::Position([x - 0.1, y + 0.2, z]), Some(0.1))
        .expect("it is within reach");
    end(&tool);
    let state = arm.state();
    let fastest = state.commands.windows(2).flat_map(|pair| {
        let pairs = pair[0].iter().zip(&pair[1]);
        pairs.map(|(before, now)| (now - before).abs() / 0.01)
    });
    let fastest = fastest.fold(0.0, f64::max);
    assert!(fastest > 9.0 && fastest < 10.0 + 1e-6, "{fastest} deg/s");
}

/// 0.5 m/s, at which the safety module warns; told to hurry, the tool still begins and ends gently.
#[test]
fn a_tool_in_haste_goes_no_faster_than_it_may_and_begins_gently() {
    let (arm, tool) = SlowArm::prompt().control();
    let [x, y, z] = arm.tool(&arm.state().commanded);
    tool.go_to(Target::Position([x - 0.1, y + 0.2, z]), Some(0.05))
        .expect("it is within reach");
    end(&tool);
    let speeds: Vec<_> = arm.steps().iter().map(|step| step / 0.01).collect();
    let fastest = speeds.iter().map(Vector3::norm).fold(0.0, f64::max);
    assert!(fastest > 0.4 && fastest < 0.5 + 1e-6, "{fastest} m/s");
    // A minimum-jerk motion of 0.22 m with a peak of 0.5 m/s has at most 1.9 m/s².
    let changes = speeds
        .windows(2)
        .map(|pair| (pair[1] - pair[0]).norm() / 0.01);
    let hardest = changes.fold(speeds[0].norm() / 0.01, f64::max);
    assert!(hardest < 3.0, "{hardest} m/s²");
}

#[test]
fn a_velocity_of_the_tool_is_no_higher_than_it_may_be() {
    let (arm, tool) = SlowArm::prompt().control();
    let velocity = TaskVelocity {
        linear: [0.0, 0.0, -2.0],
        ..TaskVelocity::default()
    };
    tool.set_task_velocity(velocity).expect("it moves");
    let deadline = Instant::now() + Duration::from_secs(60);
    while arm.state().commands.len() < 20 {
        assert!(Instant::now() < deadline, "no commands");
        std::thread::sleep(Duration::from_millis(5));
    }
    tool.stop().expect("it can always stop");
    let steps = arm.steps();
    let fastest = steps.iter().map(|step| step.norm() / 0.01);
    let fastest = fastest.fold(0.0, f64::max);
    assert!(fastest > 0.4 && fastest < 0.51, "{fastest} m/s");
}
