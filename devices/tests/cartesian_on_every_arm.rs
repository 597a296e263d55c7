//! The controller of a tool on arms that do not follow at once: with masses and friction, behind an embedded PC, on a bus.

use std::sync::Arc;

use yarp_devices::cartesian::{CartesianController, CartesianOptions};
use yarp_devices::checks::{self, Check};
use yarp_devices::embedded::{EmbeddedWam, LinkMode, WamNode};
use yarp_devices::wam::{DynamicWam, WamModel};
use yarp_devices::{Axes, CartesianControl, ControlMode, Device, DeviceError, Mode, Target};

use crate::can;
use crate::embedded;

use can::Rig;
use can::memory::Memory;
use can::scenarios::{active, modes};
use embedded::{TEST_TIMEOUT, connected, driver, eventually, ideal_arm, node_options};

/// In front of the folded arm.
const PLACE: [f64; 3] = [0.35, 0.1, 0.35];
/// The controller's own tolerance.
const POSITION_TOLERANCE: f64 = 0.011;
/// Duration of a motion that does not end during a check.
const LONG_MOTION_SECONDS: f64 = 60.0;

fn control(arm: Arc<dyn Device>) -> CartesianController<7> {
    let chain = WamModel::<7>::new().chain;
    CartesianController::start(arm, chain, CartesianOptions::new()).expect("it is an arm")
}

fn dynamic() -> Arc<DynamicWam> {
    Arc::new(DynamicWam::start().expect("the machine has threads"))
}

fn place(tool: &dyn CartesianControl) -> [f64; 3] {
    tool.pose().expect("it is here").pose.position
}

fn distance(one: [f64; 3], other: [f64; 3]) -> f64 {
    let squares = (one.iter().zip(other)).map(|(one, other)| (one - other).powi(2));
    squares.sum::<f64>().sqrt()
}

/// Goes to the place and arrives there.
fn arrive(tool: &dyn CartesianControl) {
    tool.go_to(Target::Position(PLACE), None).expect("it goes");
    eventually("the place", || {
        tool.motion_done().expect("it answers") && distance(place(tool), PLACE) < POSITION_TOLERANCE
    });
}

/// The arm breaks during a motion. It ends, is not resumed when the arm is mended, and another one begins then as if
/// nothing had been.
fn a_motion_ends_for_good(tool: &dyn CartesianControl, broken: impl Fn(), mended: impl Fn()) {
    let start = place(tool);
    tool.set_tracking(true).expect("it can");
    tool.go_to(Target::Position(PLACE), Some(LONG_MOTION_SECONDS))
        .expect("it goes");
    eventually("a motion", || distance(place(tool), start) > 0.002);
    broken();
    eventually("the end", || tool.motion_done().expect("it answers"));
    mended();
    eventually("a pose", || tool.pose().is_ok());
    // Long enough for a motion that was resumed to be seen, and never longer than it would last.
    let begin = tool.pose().expect("it is here").time;
    eventually("time", || {
        assert!(tool.motion_done().expect("it answers"));
        tool.pose().is_ok_and(|now| now.time > begin + 0.5)
    });
    assert!(distance(place(tool), PLACE) > 0.05);
    arrive(tool);
}

#[test]
fn with_masses_it_arrives_stops_and_reaches_out() {
    let tool = control(dynamic());
    let checks: [Check; 4] = [
        checks::cartesian_checks::events_tell_of_the_way,
        checks::cartesian_checks::a_stopped_tool_stays,
        // Stretched out, a small step of the tool is a large one of joints: the elbow was so fast on the way back that the
        // safety module took the power off.
        checks::cartesian_checks::what_is_out_of_reach_is_refused,
        checks::cartesian_checks::a_velocity_lasts_until_it_is_nothing,
    ];
    for check in checks {
        check(&tool, TEST_TIMEOUT);
    }
}

/// Told to be there in a moment, the tool went so fast that the safety module took the power off.
#[test]
fn no_haste_of_the_caller_makes_it_too_fast_for_the_safety_module() {
    let arm = dynamic();
    let tool = control(arm.clone());
    tool.set_trajectory_time(0.05).expect("it can");
    arrive(&tool);
    assert_eq!(arm.with(|arm| arm.simulator().safety().fault()), None);
}

#[test]
fn an_emergency_stop_ends_a_motion_for_good() {
    let arm = dynamic();
    let tool = control(arm.clone());
    a_motion_ends_for_good(
        &tool,
        || arm.with(|arm| arm.safety_mut().press_stop()),
        || {
            arm.set_control_modes(Axes::All, &[Mode::ForceIdle; 7])
                .expect("it leads out");
        },
    );
}

#[test]
fn behind_an_embedded_pc_it_arrives_and_stops() {
    for arm in [dynamic() as Arc<dyn Device>, ideal_arm()] {
        let (driver, _node) = connected(arm, embedded::Listens::Driver);
        let tool = control(Arc::new(driver));
        arrive(&tool);
        checks::cartesian_checks::a_stopped_tool_stays(&tool, TEST_TIMEOUT);
    }
}

#[test]
fn a_pc_that_goes_away_ends_a_motion_for_good() {
    let arm = ideal_arm();
    let driver = Arc::new(driver());
    let options = node_options(LinkMode::Connect(driver.addresses()));
    let node = || Some(WamNode::start(arm.clone(), options).expect("it starts"));
    let nodes = std::sync::Mutex::new(None);
    // The arm is not available yet: the controller need not wait for it, and reports it.
    let tool = control(driver.clone());
    assert!(matches!(tool.pose(), Err(DeviceError::NoDataYet { .. })));
    assert!(tool.desired().is_err());
    assert!(tool.go_to(Target::Position(PLACE), None).is_err());
    *nodes.lock().unwrap() = node();
    let up = |driver: &EmbeddedWam| driver.link().is_up();
    eventually("a connection", || up(&driver));
    a_motion_ends_for_good(
        &tool,
        || {
            *nodes.lock().unwrap() = None;
            eventually("the loss", || !up(&driver));
        },
        || {
            *nodes.lock().unwrap() = node();
            eventually("a connection", || up(&driver));
        },
    );
}

#[test]
fn home_takes_the_arm_behind_its_pc_from_the_tool() {
    let (driver, _node) = connected(ideal_arm(), embedded::Listens::Node);
    let driver = Arc::new(driver);
    let tool = control(driver.clone());
    arrive(&tool);
    let go = || tool.go_to(Target::Position([0.4, 0.1, 0.4]), Some(LONG_MOTION_SECONDS));
    go().expect("it goes");
    assert!(!tool.motion_done().expect("it answers"));
    driver.move_home().expect("it takes the command");
    eventually("the end", || tool.motion_done().expect("it answers"));
}

#[test]
fn on_its_bus_it_arrives_and_stops() {
    let rig = Memory::new();
    let tool = control(Arc::new(active(&rig)));
    arrive(&tool);
    checks::cartesian_checks::a_stopped_tool_stays(&tool, TEST_TIMEOUT);
}

#[test]
fn idle_on_the_pendant_ends_a_motion_for_good() {
    let rig = Memory::new();
    let arm = Arc::new(active(&rig));
    let tool = control(arm.clone());
    a_motion_ends_for_good(
        &tool,
        || rig.pucks().lock().press_idle(),
        || {
            rig.pucks().lock().press_activate();
            eventually("position mode", || modes(&arm) == [Mode::Position; 7]);
        },
    );
}
