//! The arm with masses and friction keeps the contracts of the interfaces as a machine can.

use std::time::Duration;

use yarp_devices::simulation::{SafetyMode, SimulatorOptions};
use yarp_devices::wam::{DynamicArm, DynamicWam, WamModel};
use yarp_devices::{Axes, AxisIndex, Device, DeviceError, Interaction, Mode, checks};

const TEST_TIMEOUT: Duration = Duration::from_secs(60);
const ELBOW: Axes<'static> = Axes::One(AxisIndex::new(3));

fn arm() -> DynamicArm {
    DynamicArm::new(WamModel::<7>::new(), SimulatorOptions::default())
}

fn run(arm: &mut DynamicArm, seconds: f64) {
    for _ in 0..(seconds / 0.002) as usize {
        arm.tick();
    }
}

fn finish(arm: &mut DynamicArm) {
    let mut periods = 0;
    while !arm.motion_done(Axes::All).unwrap() {
        arm.tick();
        periods += 1;
        assert!(periods < 30_000, "a move ends within a minute");
    }
}

fn at(arm: &DynamicArm, axis: usize) -> f64 {
    arm.state(axis.into()).unwrap().position
}

fn set_mode(arm: &mut DynamicArm, mode: Mode) {
    arm.set_control_modes(Axes::All, &[mode; 7]).unwrap();
}

fn modes(arm: &DynamicArm) -> [Mode; 7] {
    let mut modes = [Mode::UNKNOWN; 7];
    arm.read_control_modes(Axes::All, &mut modes).unwrap();
    modes
}

/// Behaviours without exact places hold for this arm as for any device, in real time.
#[test]
fn keeps_the_contracts_that_need_no_exact_place() {
    for check in checks::WITHOUT_EXACT_PLACES {
        let arm = DynamicWam::start().expect("the arm starts");
        check(&arm, TEST_TIMEOUT);
    }
}

#[test]
fn rests_where_it_starts_and_drops_in_the_middle_of_a_move() {
    let device = DynamicWam::start().expect("the arm starts");
    let position = device.position_control().expect("it moves");
    position.position_move(ELBOW, &[90.0]).unwrap();
    let arm: &dyn Device = &device;
    let limit = arm.encoders().unwrap().set_encoders(ELBOW, &[0.0]);
    assert!(matches!(limit, Err(DeviceError::NotSupported { .. })));
    drop(device);
}

#[test]
fn moves_end_near_their_targets() {
    let mut arm = arm();
    let targets = [20.0, -60.0, 15.0, 120.0, -30.0, 20.0, 40.0];
    arm.position_move(Axes::All, &targets).unwrap();
    assert!(!arm.motion_done(Axes::All).unwrap());
    finish(&mut arm);
    run(&mut arm, 0.5);
    for (axis, target) in targets.into_iter().enumerate() {
        let off = (at(&arm, axis) - target).abs();
        // Coulomb friction over proportional gain: at most 0.0125 rad, at the palm.
        assert!(off < 1.0, "joint {axis} is {off} degrees off");
    }
    assert!(arm.state(3.into()).unwrap().velocity.abs() < 0.1);
}

#[test]
fn stiffer_loops_end_nearer() {
    let off_with = |factor: f64| {
        let mut arm = arm();
        for axis in 0..7 {
            let mut gains = arm.gains(axis.into()).unwrap();
            gains.integral *= factor;
            arm.set_gains(axis.into(), gains).unwrap();
        }
        arm.position_move(Axes::All, &[20.0, -60.0, 15.0, 120.0, -30.0, 20.0, 40.0])
            .unwrap();
        finish(&mut arm);
        run(&mut arm, 4.0);
        (at(&arm, 0) - 20.0).abs() + (at(&arm, 3) - 120.0).abs()
    };
    let (soft, stiff) = (off_with(1.0), off_with(400.0));
    assert!(stiff < soft / 2.0, "{soft} and {stiff} degrees");
    let mut arm = arm();
    let mut gains = arm.gains(0.into()).unwrap();
    gains.proportional = -1.0;
    assert!(arm.set_gains(0.into(), gains).is_err());
}

#[test]
fn velocities_are_followed() {
    let mut arm = arm();
    set_mode(&mut arm, Mode::Velocity);
    arm.velocity_move(ELBOW, &[-20.0]).unwrap();
    run(&mut arm, 2.0);
    let speed = arm.state(3.into()).unwrap().velocity;
    assert!((speed + 20.0).abs() < 4.0, "{speed}");
    arm.stop(ELBOW).unwrap();
    run(&mut arm, 2.0);
    assert!(arm.motion_done(ELBOW).unwrap());
}

#[test]
fn torques_push_and_are_kept_inside_their_range() {
    let mut arm = arm();
    let refused = arm.set_reference_torques(ELBOW, &[-5.0]).unwrap_err();
    assert_eq!(
        refused.to_string(),
        "joint 3 is in position mode, torque needs torque mode"
    );
    set_mode(&mut arm, Mode::Torque);
    let start = at(&arm, 3);
    arm.set_reference_torques(ELBOW, &[-2.0]).unwrap();
    assert_eq!(arm.reference_torques(ELBOW).unwrap(), [-2.0]);
    run(&mut arm, 0.5);
    assert!(at(&arm, 3) < start - 5.0, "it opens: {}", at(&arm, 3));
    let refused = arm.set_reference_torques(ELBOW, &[16.0]).unwrap_err();
    assert_eq!(
        refused.to_string(),
        "joint 3 asked for torque 16 Nm, allowed -15 to 15 Nm"
    );
    arm.stop(ELBOW).unwrap();
    assert_eq!(arm.reference_torques(ELBOW).unwrap(), [0.0]);
    // Back in position mode it holds where it is.
    set_mode(&mut arm, Mode::Position);
    run(&mut arm, 1.0);
    let held = at(&arm, 3);
    run(&mut arm, 1.0);
    assert!((at(&arm, 3) - held).abs() < 0.1);
}

#[test]
fn direct_positions_are_followed() {
    let mut arm = arm();
    assert!(arm.set_direct_positions(ELBOW, &[170.0]).is_err());
    set_mode(&mut arm, Mode::PositionDirect);
    let start = arm.direct_positions(ELBOW).unwrap()[0];
    for step in 0..1000 {
        let place = start - 0.02 * f64::from(step);
        arm.set_direct_positions(ELBOW, &[place]).unwrap();
        arm.tick();
    }
    run(&mut arm, 0.5);
    assert!((at(&arm, 3) - (start - 20.0)).abs() < 1.0);
    assert!(arm.set_direct_positions(ELBOW, &[f64::NAN]).is_err());
    assert!(arm.set_direct_positions(ELBOW, &[300.0]).is_err());
}

#[test]
fn a_joint_changes_its_mode_without_a_jump() {
    let mut arm = arm();
    arm.position_move(Axes::All, &[20.0, -60.0, 15.0, 120.0, -30.0, 20.0, 40.0])
        .unwrap();
    finish(&mut arm);
    for mode in [
        Mode::PositionDirect,
        Mode::Position,
        Mode::Torque,
        Mode::Velocity,
        Mode::Torque,
        Mode::PositionDirect,
        Mode::Velocity,
        Mode::Position,
    ] {
        let before: Vec<f64> = (0..7).map(|axis| at(&arm, axis)).collect();
        set_mode(&mut arm, mode);
        assert_eq!(modes(&arm), [mode; 7]);
        run(&mut arm, 0.3);
        for (axis, before) in before.into_iter().enumerate() {
            let moved = (at(&arm, axis) - before).abs();
            assert!(moved < 1.0, "joint {axis} moved {moved} into {mode}");
        }
    }
}

#[test]
fn an_idle_arm_sinks_gently_and_can_be_caught() {
    let mut arm = arm();
    arm.position_move(Axes::All, &[0.0, 60.0, 0.0, 40.0, 0.0, 0.0, 0.0])
        .unwrap();
    finish(&mut arm);
    let height = arm.simulator().tool().translation.z;
    set_mode(&mut arm, Mode::Idle);
    run(&mut arm, 2.0);
    let sunk = height - arm.simulator().tool().translation.z;
    assert!((0.02..0.6).contains(&sunk), "it sank {sunk} m in 2 s");
    set_mode(&mut arm, Mode::Position);
    run(&mut arm, 1.0);
    let caught = at(&arm, 1);
    run(&mut arm, 1.0);
    assert!((at(&arm, 1) - caught).abs() < 0.2);
    assert_eq!(arm.simulator().safety().fault(), None);
}

#[test]
fn a_fault_is_reported_and_only_force_idle_leads_out() {
    let mut arm = arm();
    arm.safety_mut().press_stop();
    arm.tick();
    assert_eq!(modes(&arm), [Mode::HardwareFault; 7]);
    assert!(matches!(
        arm.position_move(ELBOW, &[150.0]),
        Err(DeviceError::WrongMode {
            mode: Mode::HardwareFault,
            ..
        })
    ));
    assert!(arm.set_control_modes(ELBOW, &[Mode::Position]).is_err());
    assert_eq!(arm.simulator().safety().mode(), SafetyMode::EmergencyStop);
    set_mode(&mut arm, Mode::ForceIdle);
    assert_eq!(modes(&arm), [Mode::Idle; 7]);
    set_mode(&mut arm, Mode::Position);
    arm.position_move(ELBOW, &[150.0]).unwrap();
    finish(&mut arm);
    assert!((at(&arm, 3) - 150.0).abs() < 1.0);
}

/// Commands of other joints continued when one of them was led out of a fault before the next period.
#[test]
fn a_fault_drops_all_commands_even_if_the_way_out_comes_at_once() {
    let mut arm = arm();
    set_mode(&mut arm, Mode::Torque);
    arm.set_reference_torques(Axes::One(0.into()), &[10.0])
        .unwrap();
    arm.set_interactions(Axes::One(6.into()), &[Interaction::Compliant])
        .unwrap();
    arm.safety_mut().press_stop();
    arm.set_control_modes(ELBOW, &[Mode::ForceIdle]).unwrap();
    assert_eq!(modes(&arm), [Mode::Idle; 7]);
    assert_eq!(arm.reference_torques(Axes::All).unwrap(), [0.0; 7]);
    assert_eq!(
        arm.interactions(Axes::All).unwrap(),
        [Interaction::Stiff; 7]
    );
    run(&mut arm, 0.5);
    assert!(at(&arm, 0).abs() < 0.1, "{}", at(&arm, 0));
}
