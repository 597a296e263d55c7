//! `moc` moves the tool on a straight line, and is refused where the line would need another posture.

use crate::embedded;

use std::sync::{Arc, Mutex};
use std::thread;

use embedded::{at_rest, driver_options, eventually, ideal_arm, node_options, place};
use yarp_devices::embedded::{CartesianPose, EmbeddedWam, LinkMode, WamNode};
use yarp_devices::kinematics::{EulerXyz, Joints, Pose};
use yarp_devices::wam::{SimulatedWam, WamModel};
use yarp_devices::{
    Axes, AxisIndex, AxisInfo, ControlLimits, ControlMode, Device, DeviceError, EncoderReading,
    Encoders, JointType, Mode, PositionControl, PositionDirect,
};

/// rad
const START: [f64; 7] = [0.2, 0.8, 0.0, 1.6, 0.0, 0.3, 0.0];

fn connected(arm: &Arc<SimulatedWam>, allow_posture_changes: bool) -> (EmbeddedWam, WamNode) {
    let driver = EmbeddedWam::start(driver_options(LinkMode::listen_on_loopback())).unwrap();
    let mut options = node_options(LinkMode::Connect(driver.addresses()));
    options.moves.allow_posture_changes = allow_posture_changes;
    let node = WamNode::start(Arc::clone(arm) as _, options).unwrap();
    at_rest(&driver);
    (driver, node)
}

fn start_at(arm: &SimulatedWam, joints: [f64; 7]) {
    let degrees = joints.map(f64::to_degrees);
    arm.set_control_modes(Axes::All, &[Mode::PositionDirect; 7])
        .unwrap();
    arm.set_direct_positions(Axes::All, &degrees).unwrap();
    eventually("the start", || {
        (0..)
            .zip(degrees)
            .all(|(joint, there)| (place(arm, joint) - there).abs() < 1e-6)
    });
    arm.set_control_modes(Axes::All, &[Mode::Position; 7])
        .unwrap();
}

fn joints(arm: &SimulatedWam) -> Joints<7> {
    let readings = arm.encoder_readings(Axes::All).unwrap();
    Joints::from_fn(|joint, _| readings[joint].position.to_radians())
}

fn wire(pose: &Pose) -> CartesianPose {
    let turn = EulerXyz::from_rotation(&pose.rotation);
    CartesianPose {
        place: pose.translation.vector.into(),
        turn: [turn.roll, turn.pitch, turn.yaw].map(f64::to_degrees),
    }
}

#[test]
fn the_tool_goes_straight_and_the_arm_holds_in_position_mode_at_the_end() {
    let arm = ideal_arm();
    start_at(&arm, START);
    let (driver, _node) = connected(&arm, false);
    let chain = WamModel::<7>::new().chain;
    let from = chain.forward(&joints(&arm));
    let mut target = from;
    target.translation.vector += nalgebra::Vector3::new(0.03, -0.08, 0.05);
    let way = target.translation.vector - from.translation.vector;
    driver.move_to(wire(&target)).unwrap();
    let mut places = 0;
    eventually("the target", || {
        let now = chain.forward(&joints(&arm)).translation.vector - from.translation.vector;
        let along = now.dot(&way) / way.norm_squared();
        let off = (now - way * along).norm();
        assert!(off < 1e-3, "{off} m beside the line");
        if (0.1..0.9).contains(&along) {
            places += 1;
        }
        driver.motion_done(Axes::All).unwrap()
    });
    assert!(places > 5, "it was seen on its way");
    let end = chain.forward(&joints(&arm));
    assert!((end.translation.vector - target.translation.vector).norm() < 1e-4);
    assert!(end.rotation.angle_to(&target.rotation) < 1e-4);
    assert_eq!(arm.control_modes(Axes::All).unwrap(), [Mode::Position; 7]);
    assert_eq!(driver.link().last_interruption, None);
}

/// An arm on its way along a line.
fn on_a_line() -> (Arc<SimulatedWam>, EmbeddedWam, WamNode) {
    let arm = ideal_arm();
    start_at(&arm, START);
    let (driver, node) = connected(&arm, false);
    let mut target = WamModel::<7>::new().chain.forward(&joints(&arm));
    target.translation.y -= 0.3;
    driver.move_to(wire(&target)).unwrap();
    eventually("the line", || {
        arm.control_modes(Axes::All).unwrap() == [Mode::PositionDirect; 7]
    });
    (arm, driver, node)
}

#[test]
fn a_newer_joint_move_takes_the_arm_off_its_line() {
    let (arm, driver, _node) = on_a_line();
    driver.position_move(Axes::One(6.into()), &[20.0]).unwrap();
    at_rest(&driver);
    assert!((place(arm.as_ref(), 6) - 20.0).abs() < 1e-6);
    assert_eq!(arm.control_modes(Axes::All).unwrap(), [Mode::Position; 7]);
}

#[test]
fn a_line_ends_when_a_joint_is_taken_and_the_client_is_told() {
    let (arm, driver, _node) = on_a_line();
    arm.set_control_modes(Axes::One(3.into()), &[Mode::Velocity])
        .unwrap();
    eventually("the end", || driver.link().last_interruption.is_some());
    let told = driver.link().last_interruption.unwrap();
    assert!(told.contains("joint 3"), "{told}");
}

#[test]
fn lines_that_return_to_a_pose_return_to_their_posture() {
    let arm = ideal_arm();
    start_at(&arm, START);
    let (driver, _node) = connected(&arm, false);
    let home = WamModel::<7>::new().chain.forward(&joints(&arm));
    let round = || {
        for corner in [
            [0.1, 0.0, 0.1],
            [0.1, -0.15, 0.2],
            [0.0, -0.15, 0.1],
            [0.0; 3],
        ] {
            let mut target = home;
            target.translation.vector += nalgebra::Vector3::from(corner);
            driver.move_to(wire(&target)).unwrap();
            at_rest(&driver);
        }
        joints(&arm)
    };
    let off = round() - Joints::from(START);
    assert!(off.amax() < 2e-3, "{off}");
    // Whatever else moves the joints changes the posture that the next lines keep.
    let back_and_forth = || {
        let here = joints(&arm);
        let mut target = WamModel::<7>::new().chain.forward(&here);
        for by in [0.05, -0.05] {
            target.translation.x += by;
            driver.move_to(wire(&target)).unwrap();
            at_rest(&driver);
        }
        (joints(&arm) - here).amax()
    };
    let other = [10.0, 60.0, 5.0, 85.0, -10.0, 15.0, 0.0];
    driver.position_move(Axes::All, &other).unwrap();
    at_rest(&driver);
    let off = back_and_forth();
    assert!(off < 2e-3, "after a joint move: {off}");
    // An idle arm may be led elsewhere by hand.
    start_at(&arm, [0.2, 1.0, -0.1, 1.5, 0.2, 0.3, 0.2]);
    driver.switch_gravity_on().unwrap();
    let off = back_and_forth();
    assert!(off < 2e-3, "after gravity compensation: {off}");
}

#[test]
fn another_posture_needs_permission() {
    // The elbow stretches and bends again: a line through the shoulder's axis.
    let far = Joints::<7>::from([2.4, 0.8, 0.0, 1.6, 0.0, 0.3, 0.0]);
    let target = wire(&WamModel::<7>::new().chain.forward(&far));
    let refused = {
        let arm = ideal_arm();
        start_at(&arm, [-2.4, 0.8, 0.0, 1.6, 0.0, 0.3, 0.0]);
        let before = joints(&arm);
        let (driver, node) = connected(&arm, false);
        let refused = driver.move_to(target).unwrap_err();
        // The way to the start ends within a millionth of a degree.
        assert!((joints(&arm) - before).amax() < 1e-6);
        assert_eq!(node.status().refused, 1);
        refused
    };
    assert!(matches!(refused, DeviceError::Refused { .. }), "{refused}");
    let arm = ideal_arm();
    start_at(&arm, [-2.4, 0.8, 0.0, 1.6, 0.0, 0.3, 0.0]);
    let (driver, _node) = connected(&arm, true);
    driver.move_to(target).unwrap();
    at_rest(&driver);
    let end = WamModel::<7>::new().chain.forward(&joints(&arm));
    let missed = end.translation.vector - nalgebra::Vector3::from(target.place);
    assert!(missed.norm() < 1e-4, "{missed}");
}

/// An arm that accepts direct positions and stays where it is; counts what the thread of straight lines does.
struct Stuck {
    arm: Arc<SimulatedWam>,
    seen: Mutex<Seen>,
}

#[derive(Default)]
struct Seen {
    /// The last position that was sent, degrees.
    last: Vec<f64>,
    /// Periods of the line since then.
    waited: usize,
}

impl AxisInfo for Stuck {
    fn axes(&self) -> usize {
        7
    }

    fn axis_name(&self, axis: AxisIndex) -> Result<String, DeviceError> {
        self.arm.axis_name(axis)
    }

    fn joint_type(&self, axis: AxisIndex) -> Result<JointType, DeviceError> {
        self.arm.joint_type(axis)
    }
}

impl Encoders for Stuck {
    fn read_encoders(&self, axes: Axes<'_>, out: &mut [EncoderReading]) -> Result<(), DeviceError> {
        if thread::current().name() == Some("wam-node-line") {
            self.seen.lock().unwrap().waited += 1;
        }
        self.arm.read_encoders(axes, out)
    }

    fn set_encoders(&self, axes: Axes<'_>, values: &[f64]) -> Result<(), DeviceError> {
        Encoders::set_encoders(self.arm.as_ref(), axes, values)
    }
}

impl PositionDirect for Stuck {
    fn set_direct_positions(&self, _: Axes<'_>, positions: &[f64]) -> Result<(), DeviceError> {
        *self.seen.lock().unwrap() = Seen {
            last: positions.to_vec(),
            waited: 0,
        };
        Ok(())
    }

    fn direct_positions(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.arm.direct_positions(axes)
    }
}

impl Device for Stuck {
    fn axis_info(&self) -> Option<&dyn AxisInfo> {
        Some(self)
    }

    fn encoders(&self) -> Option<&dyn Encoders> {
        Some(self)
    }

    fn position_direct(&self) -> Option<&dyn PositionDirect> {
        Some(self)
    }

    fn position_control(&self) -> Option<&dyn PositionControl> {
        self.arm.position_control()
    }

    fn control_mode(&self) -> Option<&dyn ControlMode> {
        self.arm.control_mode()
    }

    fn control_limits(&self) -> Option<&dyn ControlLimits> {
        self.arm.control_limits()
    }
}

/// The line waits 15 mm ahead of an arm that does not follow, for 2 s in periods of 10 ms, and ends.
#[test]
fn a_line_waits_for_its_arm_and_ends_when_the_arm_does_not_follow() {
    let arm = ideal_arm();
    start_at(&arm, START);
    let stuck = Arc::new(Stuck {
        arm: Arc::clone(&arm),
        seen: Mutex::default(),
    });
    let driver = EmbeddedWam::start(driver_options(LinkMode::listen_on_loopback())).unwrap();
    let options = node_options(LinkMode::Connect(driver.addresses()));
    let _node = WamNode::start(Arc::clone(&stuck) as _, options).unwrap();
    at_rest(&driver);
    let chain = WamModel::<7>::new().chain;
    let from = chain.forward(&joints(&arm));
    let mut target = from;
    target.translation.y -= 0.3;
    driver.move_to(wire(&target)).unwrap();
    eventually("the end of the line", || {
        driver.link().last_interruption.is_some()
    });
    let told = driver.link().last_interruption.unwrap();
    assert!(told.contains("expected an arm that follows"), "{told}");
    let seen = stuck.seen.lock().unwrap();
    let last = Joints::<7>::from_fn(|joint, _| seen.last[joint].to_radians());
    let ahead = (chain.forward(&last).translation.vector - from.translation.vector).norm();
    // At the most a period of 0.1 m/s beyond the limit.
    assert!((0.015..0.0165).contains(&ahead), "{ahead} m ahead");
    // The period in which it gives up counts too.
    assert_eq!(seen.waited, 201);
    assert_eq!(arm.control_modes(Axes::All).unwrap(), [Mode::Position; 7]);
}
