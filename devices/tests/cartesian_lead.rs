//! The controller of a tool waits for an arm that lags behind its commands.

use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};

use yarp_devices::cartesian::{CartesianController, CartesianOptions};
use yarp_devices::kinematics::{Chain, Joints};
use yarp_devices::wam::WamModel;
use yarp_devices::{
    Axes, AxisIndex, AxisInfo, CartesianControl, ControlLimits, ControlMode, Device, DeviceError,
    EncoderReading, Encoders, JointType, Limits, Mode, PositionDirect, Target, offers,
};

/// The lead that the documentation of the controller allows, m.
const MAX_LEAD: f64 = 0.015;
/// Motion of a joint from one reading to the next, degrees: at most a few millimetres at the tool.
const STEP: f64 = 0.1;

struct State {
    measured: [f64; 7],
    commanded: [f64; 7],
    time: f64,
    waits: u32,
    /// The largest distance of the tool from its command when the command was changed, m.
    largest_lead: f64,
}

/// An arm that goes to its commands slowly: a step per reading.
struct SlowArm {
    chain: Chain<7>,
    state: Mutex<State>,
}

impl SlowArm {
    fn new() -> Self {
        let start = [0.0, 40.0, 0.0, 80.0, 0.0, 20.0, 0.0];
        Self {
            chain: WamModel::<7>::new().chain,
            state: Mutex::new(State {
                measured: start,
                commanded: start,
                time: 1.0,
                waits: 0,
                largest_lead: 0.0,
            }),
        }
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
            *measured += (commanded - *measured).clamp(-STEP, STEP);
        }
        state.time += 0.01;
        for (slot, axis) in out.iter_mut().zip(axes.iter(7)) {
            *slot = EncoderReading {
                position: state.measured[axis.index()],
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
        Ok(Limits::new(0.0, 143.0))
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
        }
        state.commanded = next;
        Ok(())
    }

    fn direct_positions(&self, _axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        Ok(self.state().commanded.to_vec())
    }
}

#[test]
fn no_command_goes_further_while_the_arm_lags() {
    let arm = Arc::new(SlowArm::new());
    let chain = arm.chain.clone();
    let device = Arc::clone(&arm) as Arc<dyn Device>;
    let tool = CartesianController::start(device, chain, CartesianOptions::new()).expect("an arm");
    let [x, y, z] = arm.tool(&arm.state().commanded);
    tool.go_to(Target::Position([x - 0.1, y + 0.2, z]), Some(0.1))
        .expect("it is within reach");
    let deadline = Instant::now() + Duration::from_secs(120);
    while !tool.motion_done().expect("it answers") {
        assert!(Instant::now() < deadline, "the motion never ended");
        std::thread::sleep(Duration::from_millis(5));
    }
    let state = arm.state();
    assert!(state.waits > 5, "it waited {} times only", state.waits);
    assert!(
        state.largest_lead <= MAX_LEAD + 1e-6,
        "commanded {} m ahead",
        state.largest_lead
    );
}
