//! The interfaces of motors and forces on the arm with masses and friction, bare and behind guards.

use std::sync::Arc;
use std::time::Duration;

use yarp_devices::guard::{Guarded, GuardedOptions, JointLimits, RateLimits, TorqueLimits};
use yarp_devices::simulation::SimulatorOptions;
use yarp_devices::wam::{ArmControl, DynamicArm, DynamicWam, WamModel};
use yarp_devices::{
    Axes, AxisIndex, Device, DeviceError, Impedance, Interaction, Limits, Mode, PidKind, PidValue,
};
use yarp_testing::eventually;

const ELBOW: AxisIndex = AxisIndex::new(3);

fn position(arm: &dyn Device) -> f64 {
    arm.encoders()
        .unwrap()
        .encoder_readings(ELBOW.into())
        .unwrap()[0]
        .position
}

fn mode(arm: &dyn Device) -> Mode {
    arm.control_mode()
        .unwrap()
        .control_modes(ELBOW.into())
        .unwrap()[0]
}

fn set_mode(arm: &dyn Device, mode: Mode) {
    let modes = arm.control_mode().unwrap();
    modes.set_control_modes(ELBOW.into(), &[mode]).unwrap();
}

fn guarded() -> Guarded {
    let options = GuardedOptions {
        joint_limits: JointLimits(vec![Limits::new(-170.0, 180.0); 7]),
        rate_limits: RateLimits {
            speeds: vec![50.0; 7],
            accelerations: vec![],
        },
        torque_limits: TorqueLimits(vec![2.0; 7]),
        effort_watchdog: Some(Duration::from_millis(200)),
        ..GuardedOptions::default()
    };
    let arm = DynamicWam::start().expect("the arm starts");
    Guarded::around(Arc::new(arm), options).expect("the guards start")
}

#[test]
fn loops_tell_their_gains_references_and_errors() {
    let arm = DynamicWam::start().expect("the arm starts");
    let loops = arm.pid_control().unwrap();
    assert_eq!(loops.available_pids(ELBOW).unwrap(), [PidKind::Position]);
    let mut gains = loops.pids(PidKind::Position, ELBOW.into()).unwrap();
    // 500 Nm/rad, at most 15 Nm.
    assert!((gains[0].kp - 500.0_f64.to_radians()).abs() < 1e-9);
    assert_eq!(gains[0].max_output, 15.0);
    let info = loops.pid_info(PidKind::Position, ELBOW.into()).unwrap();
    assert_eq!(
        (&*info[0].units.kp, &*info[0].units.max_output),
        ("Nm/deg", "Nm")
    );
    assert_eq!(info[0].units.kff, "", "it has no feed-forward");
    assert!(loops.pid_info(PidKind::Torque, ELBOW.into()).is_err());
    gains[0].kp *= 2.0;
    loops
        .set_pids(PidKind::Position, ELBOW.into(), &gains)
        .unwrap();
    let told = loops.pids(PidKind::Position, ELBOW.into()).unwrap()[0];
    assert!((told.kp - gains[0].kp).abs() < 1e-9);
    gains[0].kd = f64::NAN;
    assert!(
        loops
            .set_pids(PidKind::Position, ELBOW.into(), &gains)
            .is_err()
    );
    assert!(loops.pids(PidKind::Torque, ELBOW.into()).is_err());
    let value = |value| {
        loops
            .pid_values(PidKind::Position, value, ELBOW.into())
            .unwrap()[0]
    };
    assert!((value(PidValue::Reference) - 3.13_f64.to_degrees()).abs() < 1e-9);
    assert!(value(PidValue::Error).abs() < 5.0);
    assert!(value(PidValue::Output).abs() <= 15.0);
    assert_eq!(
        loops.pids_enabled(PidKind::Position, Axes::All).unwrap(),
        [true; 7]
    );
    loops.reset_pids(PidKind::Position, Axes::All).unwrap();
}

#[test]
fn motors_turn_with_the_joints() {
    let arm = DynamicWam::start().expect("the arm starts");
    let motors = arm.motor_encoders().unwrap();
    assert_eq!(motors.counts_per_revolution(ELBOW).unwrap(), 4096.0);
    let told = motors.motor_readings(ELBOW.into()).unwrap()[0].position;
    // The elbow's motor turns 18 times the other way.
    assert!((told + 18.0 * position(&arm)).abs() < 20.0, "{told}");
}

#[test]
fn a_motor_that_holds_the_arm_up_gets_warm_and_cools_when_it_is_let_go() {
    let mut arm = DynamicArm::new(WamModel::<7>::new(), SimulatorOptions::default());
    let temperatures = |arm: &DynamicArm| arm.simulator().temperatures();
    assert_eq!(temperatures(&arm), [40.0; 7]);
    // Stretched out sideways, where gravity pulls at the shoulder.
    arm.position_move(Axes::All, &[0.0, 90.0, 0.0, 0.0, 0.0, 0.0, 0.0])
        .unwrap();
    let minute = |arm: &mut DynamicArm| (0..30_000).for_each(|_| arm.tick());
    minute(&mut arm);
    let warm = temperatures(&arm);
    assert!(warm[1] > 41.0 && warm[1] < 60.0, "{warm:?}");
    assert!((warm[6] - 40.0).abs() < 0.5, "{warm:?}");
    arm.safety_mut().press_stop();
    minute(&mut arm);
    let cooler = temperatures(&arm);
    assert!(cooler[1] < warm[1] && cooler[1] > 40.0, "{cooler:?}");
}

#[test]
fn temperatures_and_the_supply_are_told() {
    let arm = DynamicWam::start().expect("the arm starts");
    let motors = arm.motor().unwrap();
    let all = motors.temperatures(Axes::All).unwrap();
    assert!(
        all.iter().all(|warm| (40.0..60.0).contains(warm)),
        "{all:?}"
    );
    assert_eq!(motors.temperature_limit(ELBOW).unwrap(), 60.0);
    assert!(motors.set_temperature_limit(ELBOW, 90.0).is_err());
    assert!(motors.temperatures(Axes::One(7.into())).is_err());
    let amplifiers = arm.amplifier_control().unwrap();
    assert_eq!(amplifiers.supply_voltage(ELBOW).unwrap(), 48.0);
}

#[test]
fn a_fault_is_told() {
    let arm = DynamicWam::start().expect("the arm starts");
    let faults = arm.joint_fault().unwrap();
    assert_eq!(faults.last_fault(ELBOW).unwrap().code, 0);
    arm.with(|arm| arm.safety_mut().press_stop());
    let fault = faults.last_fault(ELBOW).unwrap();
    assert_eq!((fault.code, fault.message.as_str()), (1, "emergency stop"));
}

#[test]
fn a_guard_refuses_torques_and_steps_by_name() {
    let arm = guarded();
    set_mode(&arm, Mode::Torque);
    let torques = arm.torque_control().unwrap();
    let refused = torques
        .set_reference_torques(ELBOW.into(), &[2.5])
        .unwrap_err();
    assert_eq!(
        refused.to_string(),
        "the torque limits of the guard forbid it: joint 3 asked for torque 2.5 Nm, allowed -2 to 2 Nm"
    );
    assert_eq!(
        torques.torque_ranges(ELBOW.into()).unwrap(),
        [Limits::new(-2.0, 2.0)]
    );
    set_mode(&arm, Mode::PositionDirect);
    let direct = arm.position_direct().unwrap();
    let here = position(&arm);
    assert!(matches!(
        direct.set_direct_positions(ELBOW.into(), &[here - 10.0]),
        Err(DeviceError::Guarded {
            guard: "rate limits",
            ..
        })
    ));
    direct
        .set_direct_positions(ELBOW.into(), &[here - 1.0])
        .unwrap();
}

#[test]
fn a_stream_of_torques_that_stops_leads_to_hold() {
    let arm = guarded();
    set_mode(&arm, Mode::Torque);
    let torques = arm.torque_control().unwrap();
    torques
        .set_reference_torques(ELBOW.into(), &[-1.6])
        .unwrap();
    eventually("the hold", || mode(&arm) == Mode::Position);
    eventually("rest", || {
        let motion = arm.position_control().unwrap();
        motion.motion_done(ELBOW.into()).unwrap()
    });
}

/// After a pause of the network the next set point is far away: the arm jumped, and its safety module stopped it.
#[test]
fn direct_positions_are_followed_no_faster_than_the_velocity_limit() {
    let limits = Limits::new(0.0, 30.0);
    let mut arm = DynamicArm::new(WamModel::<7>::new(), SimulatorOptions::default());
    arm.set_points_mut()
        .set_velocity_limits(ELBOW, limits)
        .unwrap();
    arm.set_control_modes(ELBOW.into(), &[Mode::PositionDirect])
        .unwrap();
    let here = arm.direct_positions(ELBOW.into()).unwrap()[0];
    let target = here - 30.0;
    arm.set_direct_positions(ELBOW.into(), &[target]).unwrap();
    let mut fastest: f64 = 0.0;
    for _ in 0..1000 {
        arm.tick();
        fastest = fastest.max(arm.state(ELBOW).unwrap().velocity.abs());
    }
    assert!((15.0..50.0).contains(&fastest), "{fastest}");
    let away = arm.state(ELBOW).unwrap().position - target;
    assert!(away.abs() < 2.0, "{away}");
    assert_eq!(arm.direct_positions(ELBOW.into()).unwrap(), [target]);
}

#[test]
fn direct_positions_beyond_the_limits_of_any_joint_are_refused() {
    let mut arm = DynamicArm::new(WamModel::<7>::new(), SimulatorOptions::default());
    arm.set_control_modes(Axes::All, &[Mode::PositionDirect; 7])
        .unwrap();
    for joint in (0..7).map(AxisIndex::from) {
        let limits = arm.set_points().position_limits(joint).unwrap();
        let before = arm.direct_positions(joint.into()).unwrap();
        for beyond in [limits.min - 0.01, limits.max + 0.01, f64::NAN] {
            let refused = arm.set_direct_positions(joint.into(), &[beyond]);
            assert!(refused.is_err(), "joint {joint} to {beyond}");
        }
        assert_eq!(arm.direct_positions(joint.into()).unwrap(), before);
        arm.set_direct_positions(joint.into(), &[limits.max])
            .unwrap();
    }
}

/// 5 Nm at joint 7 are 5.71 A of its motor (ratio 14.93, 17474 units per Nm), which follows 1600 units: 1.5625 A.
#[test]
fn currents_are_told_as_the_motors_follow_them() {
    let palm = AxisIndex::new(6);
    for (torque, current) in [(5.0, -1.5625), (-5.0, 1.5625)] {
        let mut arm = DynamicArm::new(WamModel::<7>::new(), SimulatorOptions::default());
        arm.set_control_modes(palm.into(), &[Mode::Torque]).unwrap();
        arm.set_reference_torques(palm.into(), &[torque]).unwrap();
        arm.tick();
        assert_eq!(arm.currents(palm.into()).unwrap(), [current]);
    }
}

/// A stop in torque and in current mode ends the push.
#[test]
fn a_stop_ends_torques_and_currents() {
    let mut arm = DynamicArm::new(WamModel::<7>::new(), SimulatorOptions::default());
    let base = Axes::One(AxisIndex::new(0));
    arm.set_control_modes(base, &[Mode::Torque]).unwrap();
    arm.set_reference_torques(base, &[3.0]).unwrap();
    arm.stop(base).unwrap();
    assert_eq!(arm.reference_torques(base).unwrap(), [0.0]);
    arm.set_control_modes(base, &[Mode::Current]).unwrap();
    arm.set_reference_currents(base, &[0.2]).unwrap();
    arm.stop(base).unwrap();
    assert_eq!(arm.reference_currents(base).unwrap(), [0.0]);
    arm.tick();
    assert!(arm.loop_output(AxisIndex::new(0)).unwrap().abs() < 1e-9);
}

/// Each motor of the wrist turns both joints 5 and 6: neither follows a current before both are in current mode.
#[test]
fn a_current_needs_current_mode_of_each_joint_that_its_motor_turns() {
    for (joint, other) in [(4, 5), (5, 4), (1, 2), (2, 1)] {
        let mut arm = DynamicArm::new(WamModel::<7>::new(), SimulatorOptions::default());
        let (joint, other) = (AxisIndex::new(joint), AxisIndex::new(other));
        arm.set_control_modes(joint.into(), &[Mode::Current])
            .unwrap();
        let refused = arm.set_reference_currents(joint.into(), &[0.01]);
        assert!(
            matches!(refused, Err(DeviceError::WrongMode { joint, .. }) if joint == other),
            "{refused:?}"
        );
        arm.set_control_modes(other.into(), &[Mode::Current])
            .unwrap();
        arm.set_reference_currents(joint.into(), &[0.01]).unwrap();
    }
}

/// LB's loop of the base: 900 Nm/rad and 10 Nm s/rad, of which a soft joint has a tenth and all; a degree is 0.017453 rad.
#[test]
fn a_joint_is_as_soft_as_a_tenth_of_its_loop_and_no_harder_than_it() {
    let mut arm = DynamicArm::new(WamModel::<7>::new(), SimulatorOptions::default());
    let base = AxisIndex::new(0);
    let own = arm.impedance(base).unwrap();
    assert!((own.stiffness - 90.0 * 0.017_453_292_52).abs() < 1e-6);
    assert!((own.damping - 10.0 * 0.017_453_292_52).abs() < 1e-6);
    let most = Impedance {
        stiffness: 10.0 * own.stiffness,
        damping: own.damping,
    };
    for harder in [
        Impedance {
            stiffness: most.stiffness * 1.001,
            ..most
        },
        Impedance {
            damping: most.damping * 1.001,
            ..most
        },
        Impedance {
            damping: -0.001,
            ..most
        },
    ] {
        let refused = arm.set_impedance(base, harder);
        assert!(
            matches!(refused, Err(DeviceError::OutOfRange { .. })),
            "{refused:?}"
        );
    }
    assert_eq!(arm.impedance(base).unwrap(), own);
    let close = Impedance {
        stiffness: most.stiffness * 0.999,
        damping: most.damping * 0.999,
    };
    arm.set_impedance(base, close).unwrap();
}

/// A compliant joint is damped against the speed of its set point: at rest in front of a moving one it is pushed.
#[test]
fn a_compliant_joint_is_damped_against_the_speed_of_its_set_point() {
    let model = WamModel::<7>::new();
    let counts = model.transmission.counts(&model.home);
    let mut arm = ArmControl::new(model, Duration::from_millis(2), counts);
    arm.hold();
    let base = AxisIndex::new(0);
    arm.set_interactions(base.into(), &[Interaction::Compliant])
        .unwrap();
    let Impedance { stiffness, damping } = arm.impedance(base).unwrap();
    arm.set_control_modes(base.into(), &[Mode::Velocity])
        .unwrap();
    arm.velocity_move(base.into(), &[20.0]).unwrap();
    for _ in 0..100 {
        arm.drive();
        arm.take_counts(counts);
    }
    let set = arm.set_points().state(base).unwrap();
    assert!(set.velocity > 2.0, "{set:?}");
    let away = set.position - arm.state(base).unwrap().position;
    let expected = stiffness * away + damping * set.velocity;
    let output = arm.loop_output(base).unwrap();
    assert!((output - expected).abs() < 1e-9, "{output}, not {expected}");
}
