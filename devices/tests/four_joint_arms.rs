//! The arm with four joints works in every driver and simulation.

use std::sync::Arc;
use std::time::Duration;

use nalgebra::Vector3;
use yarp_devices::can::puck::{Address, Node, PuckMessage, PuckProperty, status};
use yarp_devices::cartesian::{CartesianController, CartesianOptions};
use yarp_devices::dynamics::Body;
use yarp_devices::embedded::{
    CartesianPose, DriverOptions, EmbeddedWam, LinkMode, NodeOptions, WamNode,
};
use yarp_devices::kinematics::{Joints, Pose};
use yarp_devices::simulation::{SafetyMode, SimulatedPucks, SimulatorOptions};
use yarp_devices::wam::can::{CanErrorKind, CanOptions, CanWam};
use yarp_devices::wam::{
    DynamicWam, PendantButton, SimulatedCanWam, SimulatedWam, WamModel, parameters_of,
};
use yarp_devices::{
    Axes, AxisInfo, CartesianControl, ControlMode, Device, Encoders, Mode, MotorEncoders,
    PositionControl, TorqueControl, checks,
};
use yarp_testing::eventually;

use crate::can::memory::Memory;
use crate::can::{Rig, Shared, says};

const TEST_TIMEOUT: Duration = Duration::from_secs(60);
/// Degrees.
const TARGET: [f64; 4] = [20.0, -60.0, 15.0, 120.0];

fn ideal() -> SimulatedWam {
    SimulatedWam::with_axes(parameters_of::<4>())
}

fn dynamic() -> DynamicWam<4> {
    let model = WamModel::<4>::new();
    DynamicWam::start_with(model, SimulatorOptions::default()).expect("it starts")
}

fn on_simulated_bus() -> SimulatedCanWam<4> {
    let options = CanOptions {
        home_confirmed: true,
        ..CanOptions::default()
    };
    let model = WamModel::<4>::new();
    SimulatedCanWam::start(model, options, SimulatorOptions::real_arm()).expect("it is there")
}

fn positions(arm: &dyn Device) -> Vec<f64> {
    let readings = arm.encoders().unwrap().encoder_readings(Axes::All).unwrap();
    readings.iter().map(|reading| reading.position).collect()
}

/// Returns the largest distance of a joint from a place, degrees.
fn distance(arm: &dyn Device, place: &[f64]) -> f64 {
    let positions = positions(arm);
    assert_eq!(positions.len(), place.len());
    let off = positions
        .iter()
        .zip(place)
        .map(|(is, should)| (is - should).abs());
    off.fold(0.0, f64::max)
}

#[test]
fn simulations_keep_the_contracts_that_need_no_exact_place() {
    for check in checks::WITHOUT_EXACT_PLACES {
        check(&dynamic(), TEST_TIMEOUT);
        check(&ideal(), TEST_TIMEOUT);
    }
}

#[test]
fn an_arm_with_masses_moves_and_holds_without_a_wrist() {
    let arm = dynamic();
    assert_eq!(arm.axes(), 4);
    arm.position_move(Axes::All, &TARGET).unwrap();
    eventually("the target", || arm.motion_done(Axes::All).unwrap());
    assert!(distance(&arm, &TARGET) < 1.0, "{:?}", positions(&arm));
    assert_eq!(arm.motor_readings(Axes::All).unwrap().len(), 4);
    // Held against gravity by the moments of libbarrett for this arm: what is left is less than the friction.
    arm.set_control_modes(Axes::All, &[Mode::Torque; 4])
        .unwrap();
    let before = positions(&arm);
    std::thread::sleep(Duration::from_secs(1));
    assert!(distance(&arm, &before) < 3.0, "{:?}", positions(&arm));
    assert!(arm.torques(Axes::All).unwrap()[1].abs() > 1.0);
}

#[test]
fn an_arm_on_its_bus_is_brought_up_and_moves() {
    let arm = on_simulated_bus();
    let home = parameters_of::<4>().map(|axis| axis.home);
    assert!(distance(&arm, &home) < 2.0);
    arm.activate().unwrap();
    let target = [10.0, -100.0, 5.0, 165.0];
    eventually("the target", || {
        let active = arm.driver().status().safety == Some(SafetyMode::Active);
        if !active {
            // A machine that is busy for half a second keeps commands from the arm for as long.
            arm.press(PendantButton::Idle);
            arm.press(PendantButton::Activate);
        } else if arm.driver().motion_done(Axes::All).unwrap_or(true) {
            // Refused if the arm has been stopped just now.
            let _ = arm.driver().position_move(Axes::All, &target);
        }
        distance(&arm, &target) < 0.5
    });
    let truth = arm.with_pucks(|pucks| pucks.simulator().angles());
    assert!((truth[3].to_degrees() - 165.0).abs() < 1.5, "{truth:?}");
    eventually("temperatures", || {
        arm.driver()
            .status()
            .temperatures
            .iter()
            .all(Option::is_some)
    });
    assert_eq!(arm.driver().status().temperatures.len(), 4);
    arm.press(PendantButton::Stop);
    eventually("the loss of the position", || {
        arm.driver().status().position_lost.is_some()
    });
}

/// Starts a driver of `N` joints on the bus of an arm with `M`, and returns why it refuses.
fn refusal<const N: usize, const M: usize>(driven: WamModel<N>, built: WamModel<M>) -> String {
    let options = CanOptions {
        home_confirmed: true,
        ..CanOptions::default()
    };
    let started = CanWam::start(driven, options, Memory::of(built).driver_end());
    started.unwrap_err().to_string()
}

/// An arm with a wrist would be driven with the wrong model, and its wrist would hang.
#[test]
fn the_driver_of_four_joints_refuses_an_arm_with_a_wrist() {
    let refused = refusal(WamModel::<4>::new(), WamModel::<7>::new());
    let expected = "puck 5 is on the bus, but the arm is configured to have 4 joints";
    assert!(refused.contains(expected), "{refused}");
    assert!(refused.contains("--joints 7"), "{refused}");
}

#[test]
fn the_driver_of_seven_joints_refuses_an_arm_without_a_wrist() {
    let refused = refusal(WamModel::<7>::new(), WamModel::<4>::new());
    assert!(refused.contains("puck 5 does not answer"), "{refused}");
    assert!(refused.contains("--joints 4"), "{refused}");
}

/// The answers of a slow adapter come after the scan of all nodes.
#[test]
fn a_wrist_that_misses_the_first_query_is_found_by_the_driver_of_four_joints() {
    let rig = Memory::new();
    let wrist = [4, 5, 6].map(Node::of_motor);
    let silence = move |pucks: &Shared<SimulatedPucks>, silent| {
        for node in wrist {
            pucks.lock().set_silent(node, silent);
        }
    };
    silence(rig.pucks(), true);
    let pucks = rig.pucks().clone();
    // The scan ends with the last node.
    *rig.hook().lock() = Some(Box::new(move |frame| {
        let last = Node::new(31).expect("it is one");
        if says(
            frame,
            Address::from_host(last),
            PuckMessage::Get(PuckProperty::STAT),
        ) {
            silence(&pucks, false);
        }
        false
    }));
    let options = CanOptions {
        home_confirmed: true,
        ..CanOptions::default()
    };
    let refused = CanWam::start(WamModel::<4>::new(), options, rig.driver_end()).unwrap_err();
    assert!(refused.to_string().contains("have 4 joints"), "{refused}");
}

#[test]
fn a_wrist_that_appears_later_ends_the_control_of_four_joints() {
    let rig = Memory::new();
    let silence = |silent| {
        for motor in [4, 5, 6] {
            rig.pucks().lock().set_silent(Node::of_motor(motor), silent);
        }
    };
    // Another program has woken it; then its plug was pulled.
    for motor in [4, 5, 6] {
        let (property, value) = (PuckProperty::STAT, status::READY);
        let wake = PuckMessage::Value { property, value };
        let wake = wake.frame(Address::from_host(Node::of_motor(motor)));
        rig.pucks().lock().receive(&wake, &mut Vec::new());
    }
    rig.pucks().lock().advance_start(Duration::from_secs(2));
    silence(true);
    let options = CanOptions {
        home_confirmed: true,
        ..CanOptions::default()
    };
    let arm = CanWam::start(WamModel::<4>::new(), options, rig.driver_end()).unwrap();
    assert!(arm.status().connected);
    silence(false);
    eventually("the loss of the arm", || {
        let loss = arm.status().loss;
        loss.is_some_and(|loss| {
            matches!(loss.kind, CanErrorKind::UnexpectedMotor { joints: 4, .. })
        })
    });
}

/// Loads and tools are described in the frame of the tool plate, not in that of the last link, which begins at the elbow.
#[test]
fn loads_and_tools_are_at_the_tool_plate() {
    let bare = WamModel::<4>::new();
    let loaded = bare.clone().with_load(Body::point(2.0, Vector3::zeros()));
    let joints = Joints::<4>::from([0.2, 0.7, -0.3, 1.1]);
    let (end, jacobian) = bare.chain.forward_and_jacobian(&joints);
    let weight = Vector3::new(0.0, 0.0, 2.0 * bare.gravity);
    let expected = jacobian.fixed_rows::<3>(0).transpose() * weight;
    let in_dynamics = loaded.dynamics().gravity(&joints) - bare.dynamics().gravity(&joints);
    assert!(
        (in_dynamics - expected).norm() < 1e-9,
        "{in_dynamics} {expected}"
    );
    let compensated = |model: &WamModel<4>| model.calibration.torques(&model.chain, &joints);
    let compensated = compensated(&loaded) - compensated(&bare);
    assert!(
        (compensated - expected).norm() < 1e-9,
        "{compensated} {expected}"
    );

    let tool = Pose::translation(0.0, 0.0, 0.12);
    let with_tool = bare.clone().with_tool(tool).chain.forward(&joints);
    assert!((with_tool.translation.vector - (end * tool).translation.vector).norm() < 1e-12);
}

#[test]
fn the_driver_of_four_joints_drives_four() {
    let rig = Memory::of(WamModel::<4>::new());
    let options = CanOptions {
        home_confirmed: true,
        ..CanOptions::default()
    };
    let arm = CanWam::start(WamModel::<4>::new(), options, rig.driver_end()).unwrap();
    assert!(arm.status().connected);
    assert_eq!(arm.axes(), 4);
}

#[test]
fn an_arm_behind_its_pc_moves_joints_and_tool() {
    let arm = Arc::new(ideal());
    let options = DriverOptions {
        joints: parameters_of::<4>().to_vec(),
        ..DriverOptions::new(LinkMode::listen_on_loopback())
    };
    let driver = EmbeddedWam::start(options).unwrap();
    let node = NodeOptions::new(LinkMode::Connect(driver.addresses()));
    let _node = WamNode::start(Arc::clone(&arm) as _, node).unwrap();
    eventually("the arm", || driver.encoder_readings(Axes::All).is_ok());
    assert_eq!(driver.axes(), 4);
    // Readings may come before the connection for commands is known.
    eventually("the connection", || {
        let modes = [Mode::Position; 4];
        driver.set_control_modes(Axes::All, &modes).is_ok()
    });
    driver.position_move(Axes::All, &TARGET).unwrap();
    eventually("the target", || distance(arm.as_ref(), &TARGET) < 1e-6);
    eventually("rest", || driver.motion_done(Axes::All).unwrap());

    // Its orientation cannot be chosen, and is not.
    let chain = WamModel::<4>::new().chain;
    let tool = || {
        let joints = positions(arm.as_ref());
        let joints = Joints::<4>::from_fn(|joint, _| joints[joint].to_radians());
        chain.forward(&joints).translation.vector
    };
    let target = tool() + nalgebra::Vector3::new(0.03, -0.04, 0.05);
    let pose = CartesianPose {
        place: target.into(),
        turn: [170.0, 0.0, 0.0],
    };
    driver.move_to(pose).unwrap();
    eventually("the place", || (tool() - target).norm() < 1e-4);
}

#[test]
fn a_driver_of_other_joints_than_its_arm_has_says_what_to_set() {
    let with_wrist: Arc<dyn Device> = Arc::new(SimulatedWam::new());
    let arms = [
        (with_wrist, parameters_of::<4>().to_vec(), "for 4 joints"),
        (
            Arc::new(ideal()) as _,
            parameters_of::<7>().to_vec(),
            "for 7 joints",
        ),
    ];
    for (arm, joints, expected) in arms {
        let options = DriverOptions {
            joints,
            timeout: Duration::from_millis(300),
            ..DriverOptions::new(LinkMode::listen_on_loopback())
        };
        let driver = EmbeddedWam::start(options).unwrap();
        let node = NodeOptions::new(LinkMode::Connect(driver.addresses()));
        let _node = WamNode::start(arm, node).unwrap();
        let advice = format!("{expected} (if the arm has another number of them, set `joints`)");
        eventually(expected, || {
            let failure = driver.link().last_failure;
            failure.is_some_and(|failure| failure.contains(&advice))
        });
    }
}

#[test]
fn other_numbers_of_joints_are_refused_by_the_pc() {
    let five = SimulatedWam::with_axes(yarp_devices::wam::parameters().into_iter().take(5));
    let node = NodeOptions::new(LinkMode::listen_on_loopback());
    let refused = WamNode::start(Arc::new(five), node)
        .unwrap_err()
        .to_string();
    assert!(
        refused.contains("four or seven joints (this has 5)"),
        "{refused}"
    );
}

#[test]
fn the_tool_of_an_arm_with_masses_is_brought_to_a_place() {
    let chain = WamModel::<4>::new().chain;
    let arm = dynamic();
    arm.position_move(Axes::All, &[0.0, 20.0, 0.0, 90.0])
        .unwrap();
    eventually("the start", || arm.motion_done(Axes::All).unwrap());
    let tool = CartesianController::start(Arc::new(arm), chain, CartesianOptions::new());
    let tool = tool.expect("it is an arm");
    let start = tool.pose().expect("it is known").pose.position;
    let place = [start[0] - 0.05, start[1] + 0.05, start[2]];
    let target = yarp_devices::Target::Position(place);
    tool.go_to(target, Some(1.0)).expect("it goes");
    tool.wait_motion_done(Duration::from_millis(5), TEST_TIMEOUT)
        .expect("it answers");
    let end = tool.pose().expect("it is known").pose.position;
    let off: f64 = end
        .iter()
        .zip(place)
        .map(|(is, should)| (is - should).powi(2))
        .sum();
    assert!(off.sqrt() < 0.01, "{end:?} {place:?}");
}
