//! `gra`, `hom`, `shu` and `trf` act on an arm with masses and friction as documented.

use crate::embedded;

use std::sync::Arc;

use embedded::{at_rest, driver_options, eventually, node_options, place};
use yarp_devices::embedded::{EmbeddedWam, LinkMode, LinkState, WamNode};
use yarp_devices::wam::DynamicWam;
use yarp_devices::{Axes, ControlMode, DeviceError, Mode, PositionControl};

/// Stretched out sideways, where gravity pulls.
const OUT: [f64; 7] = [0.0, 60.0, 0.0, 40.0, 0.0, 0.0, 0.0];

/// The arm stretched out at rest.
fn stretched() -> Arc<DynamicWam> {
    let arm = DynamicWam::start().expect("the machine has threads");
    arm.set_reference_speeds(Axes::All, &[60.0; 7]).unwrap();
    arm.position_move(Axes::All, &OUT).unwrap();
    eventually("a stretched arm", || arm.motion_done(Axes::All).unwrap());
    Arc::new(arm)
}

/// Lets the arm's own time pass, s.
fn pass(arm: &DynamicWam, seconds: f64) {
    let now = || arm.with(|arm| arm.simulator().time().as_secs_f64());
    let end = now() + seconds;
    eventually("some time", || now() > end);
}

fn height(arm: &DynamicWam) -> f64 {
    arm.with(|arm| arm.simulator().tool().translation.z)
}

fn connect(arm: &Arc<DynamicWam>, gravity: bool) -> (EmbeddedWam, WamNode) {
    let mut options = driver_options(LinkMode::listen_on_loopback());
    options.gravity = gravity;
    let driver = EmbeddedWam::start(options).expect("there are ports");
    let node = WamNode::start(
        Arc::clone(arm) as _,
        node_options(LinkMode::Connect(driver.addresses())),
    )
    .expect("it starts");
    eventually("a connection", || driver.link().is_up());
    (driver, node)
}

#[test]
fn without_gra_the_arm_sinks_and_takes_no_moves_and_with_it_it_holds() {
    let arm = stretched();
    let begin = height(&arm);
    let (driver, _node) = connect(&arm, false);
    eventually("a sinking arm", || height(&arm) < begin - 0.02);
    assert_eq!(driver.link().state, LinkState::Idle);
    assert_eq!(
        driver.control_modes(Axes::One(0.into())).unwrap(),
        [Mode::Idle]
    );
    assert!(matches!(
        driver.position_move(Axes::One(0.into()), &[5.0]),
        Err(DeviceError::WrongMode { .. })
    ));
    assert!(driver.move_home().is_err());
    // Position mode is what switches gravity compensation on.
    driver
        .set_control_modes(Axes::All, &[Mode::Position; 7])
        .unwrap();
    assert_eq!(driver.link().state, LinkState::Up);
    pass(&arm, 0.5);
    let held = height(&arm);
    pass(&arm, 1.0);
    let sunk = held - height(&arm);
    assert!(sunk.abs() < 0.005, "it sank {sunk} m in a second");
}

#[test]
fn hom_brings_it_home_and_trf_tells_when() {
    let arm = stretched();
    let (driver, _node) = connect(&arm, true);
    at_rest(&driver);
    driver.move_home().unwrap();
    at_rest(&driver);
    assert_eq!(driver.link().last_interruption, None);
    for (joint, home) in [(1, -2.0_f64), (3, 3.13)] {
        let off = (place(arm.as_ref(), joint) - home.to_degrees()).abs();
        assert!(off < 1.0, "joint {joint} is {off} degrees off");
    }
    assert!(arm.motion_done(Axes::All).unwrap());
}

#[test]
fn after_shu_in_the_middle_of_a_move_it_holds() {
    let arm = stretched();
    let (driver, node) = connect(&arm, true);
    at_rest(&driver);
    // So slow that the move does not end by itself.
    arm.set_reference_speeds(Axes::All, &[1.0; 7]).unwrap();
    driver.position_move(Axes::One(0.into()), &[100.0]).unwrap();
    eventually("a move under way", || place(arm.as_ref(), 0) > 0.5);
    drop(driver);
    eventually("a goodbye", || {
        node.status().last_end.as_deref() == Some("closed as agreed (shu)")
    });
    eventually("an arm that stands", || arm.motion_done(Axes::All).unwrap());
    pass(&arm, 0.5);
    let (held, height_held) = (place(arm.as_ref(), 0), height(&arm));
    assert!(held < 90.0);
    pass(&arm, 1.0);
    assert!((place(arm.as_ref(), 0) - held).abs() < 0.5);
    assert!((height(&arm) - height_held).abs() < 0.005);
    assert_eq!(arm.control_modes(Axes::All).unwrap(), [Mode::Position; 7]);
}

#[test]
fn a_fault_ends_a_move_and_is_told() {
    let arm = stretched();
    let (driver, _node) = connect(&arm, true);
    at_rest(&driver);
    arm.set_reference_speeds(Axes::All, &[1.0; 7]).unwrap();
    driver.position_move(Axes::One(0.into()), &[100.0]).unwrap();
    arm.with(|arm| arm.safety_mut().press_stop());
    at_rest(&driver);
    let told = driver.link().last_interruption.expect("it says why");
    assert!(told.contains("fault at joint 0"), "{told}");
    let base = Axes::One(0.into());
    assert_eq!(driver.control_modes(base).unwrap(), [Mode::Idle]);
    assert!(driver.position_move(base, &[5.0]).is_err());
    // Only the pendant leads out of it, and then `gra`.
    let refused = driver.set_control_modes(base, &[Mode::Position]);
    assert!(matches!(refused, Err(DeviceError::Refused { .. })));
    arm.with(|arm| {
        arm.safety_mut().press_idle();
        arm.safety_mut().press_activate();
    });
    driver.set_control_modes(base, &[Mode::Position]).unwrap();
    driver.position_move(base, &[5.0]).unwrap();
}
