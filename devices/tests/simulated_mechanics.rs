//! The simulated arm is a machine: it has friction, stops, sinks, gives way, and reads its encoders.

use std::time::Duration;

use nalgebra::Vector3;
use yarp_devices::kinematics::Joints;
use yarp_devices::simulation::{
    Fault, JointCommand, JointControllers, SafetyLimits, SafetyMode, SimulatedArm, Simulator,
    SimulatorOptions, VoltageLimits,
};
use yarp_devices::trajectory::JointLimits;
use yarp_devices::wam::{OPTICAL_COUNTS, WamModel};

type Seven = Joints<7>;

/// Stretched out to the front, elbow a little bent: much for gravity to pull at.
const REACHING: [f64; 7] = [0.0, 1.2, 0.0, 0.6, 0.0, 0.2, 0.0];

fn simulator(model: WamModel<7>, options: SimulatorOptions) -> Simulator<7> {
    let mut arm = Simulator::new(model, options);
    arm.safety_mut().press_activate();
    arm.place(&REACHING.into());
    arm
}

/// No safety limits, so that an arm may fall.
fn reckless() -> SimulatorOptions {
    let never = SafetyLimits {
        velocity_warning: 0.0,
        velocity_fault: 0.0,
        torque_warning: 0.0,
        torque_fault: 0.0,
        voltage: VoltageLimits::default(),
        heartbeat: 0.0,
    };
    SimulatorOptions {
        safety: never,
        ..SimulatorOptions::default()
    }
}

fn seconds(
    arm: &mut Simulator<7>,
    time: f64,
    mut torques: impl FnMut(&Simulator<7>) -> Option<Seven>,
) {
    let end = arm.time() + Duration::from_secs_f64(time);
    while arm.time() < end {
        let torques = torques(arm);
        arm.step(torques.as_ref());
    }
}

/// The torques that hold the arm, from where it truly is.
fn holding(arm: &Simulator<7>) -> Seven {
    arm.model().dynamics().gravity(&arm.angles())
}

#[test]
fn without_friction_a_falling_arm_keeps_its_energy() {
    let options = SimulatorOptions {
        period: Duration::from_micros(200),
        substeps: 4,
        ..reckless()
    };
    let mut arm = simulator(WamModel::<7>::new().without_friction(), options);
    let start = arm.energy();
    let height = arm.tool().translation.z;
    seconds(&mut arm, 0.3, |_| Some(Seven::zeros()));
    assert!(height - arm.tool().translation.z > 0.1, "it fell");
    let moving = arm.velocities().norm();
    assert!(moving > 1.0, "it moves: {moving}");
    // Torque commands are whole units rounded down: 0 stays 0.
    let change = (arm.energy() - start).abs();
    assert!(change < 0.01, "{change} J");
}

#[test]
fn friction_holds_what_is_weaker_and_yields_to_what_is_stronger() {
    let options = SimulatorOptions {
        friction_noise: 0.0,
        ..SimulatorOptions::default()
    };
    let friction = WamModel::<7>::new().friction;
    for (share, moves) in [(0.9, false), (1.1, true)] {
        for joint in [0, 3, 6] {
            let mut arm = simulator(WamModel::<7>::new(), options);
            let start = arm.angles();
            seconds(&mut arm, 0.5, |arm| {
                let mut torques = holding(arm);
                torques[joint] += share * friction[joint].coulomb;
                Some(torques)
            });
            let moved = (arm.angles() - start)[joint];
            assert_eq!(moved > 1e-3, moves, "joint {joint} moved {moved}");
            if !moves {
                // It sticks: not slowly creeping.
                assert!(moved.abs() < 1e-6, "joint {joint} crept {moved}");
            }
        }
    }
}

#[test]
fn a_stop_ends_every_motion_and_can_be_left_again() {
    let mut arm = simulator(WamModel::<7>::new(), reckless());
    let drive = |towards: f64| {
        move |arm: &Simulator<7>| {
            let mut torques = holding(arm);
            torques[3] += towards;
            Some(torques)
        }
    };
    let limits = arm.model().chain.limits()[3];
    seconds(&mut arm, 3.0, |arm| {
        assert!(arm.angles()[3] < limits.max + 0.031);
        drive(20.0)(arm)
    });
    assert!(arm.angles()[3] > limits.max, "a little outside the limit");
    assert!(arm.velocities()[3].abs() < 1e-3);
    seconds(&mut arm, 0.5, drive(-5.0));
    assert!(arm.angles()[3] < limits.max - 0.1);
}

#[test]
fn after_an_emergency_stop_the_arm_sinks_gently() {
    let mut arm = SimulatedArm::new(WamModel::<7>::new(), SimulatorOptions::default());
    arm.place(&REACHING.into());
    arm.run(Duration::from_secs(1));
    let held = arm.simulator().tool().translation.z;
    arm.simulator_mut().safety_mut().press_stop();
    let mut fastest = 0.0_f64;
    for _ in 0..5000 {
        arm.tick();
        fastest = fastest.max(arm.simulator().speed());
    }
    let sunk = held - arm.simulator().tool().translation.z;
    assert!(sunk > 0.3, "it sank {sunk} m in 10 s");
    assert!(fastest < 0.3, "gently: at most {fastest} m/s");
    assert_eq!(arm.simulator().safety().mode(), SafetyMode::EmergencyStop);
    // A move is refused until the pendant allows it; then the arm holds its position.
    let limits = JointLimits::uniform(0.5, 0.5);
    let refused = arm.move_joints(&REACHING.into(), &limits).unwrap_err();
    assert!(
        refused.to_string().contains("not active (EmergencyStop)"),
        "{refused}"
    );
    arm.simulator_mut().safety_mut().press_idle();
    arm.simulator_mut().safety_mut().press_activate();
    // It may rest on a stop, 0.03 rad outside the limit it then holds.
    let here = arm.measured();
    arm.run(Duration::from_secs(1));
    assert!((arm.set_point() - here).amax() < 0.031);
    assert!((arm.measured() - arm.set_point()).amax() < 0.02);
    arm.move_joints(&REACHING.into(), &limits).unwrap();
    arm.finish(Duration::from_secs(1));
    assert!((arm.measured() - Seven::from(REACHING)).amax() < 0.03);
}

#[test]
fn a_floating_arm_stands_and_gives_way_to_a_hand() {
    let mut arm = SimulatedArm::new(WamModel::<7>::new(), SimulatorOptions::default());
    arm.place(&REACHING.into());
    arm.set_floating(true);
    let start = arm.simulator().tool().translation.vector;
    arm.run(Duration::from_secs(2));
    let drifted = (arm.simulator().tool().translation.vector - start).norm();
    assert!(drifted < 1e-3, "it stands: {drifted}");
    arm.simulator_mut().push(Vector3::new(0.0, 8.0, 0.0));
    arm.run(Duration::from_millis(600));
    let led = arm.simulator().tool().translation.vector.y - start.y;
    assert!(led > 0.05, "it was led {led} m");
    // Let go of, it comes to rest and stays.
    arm.simulator_mut().push(Vector3::zeros());
    arm.run(Duration::from_secs(2));
    assert!(arm.simulator().velocities().amax() < 1e-6);
}

#[test]
fn a_holding_arm_comes_back_when_the_hand_is_gone() {
    let mut arm = SimulatedArm::new(WamModel::<7>::new(), SimulatorOptions::default());
    arm.place(&REACHING.into());
    arm.run(Duration::from_secs(1));
    let place = |arm: &SimulatedArm<7>| arm.simulator().tool().translation.vector;
    let start = place(&arm);
    arm.simulator_mut().push(Vector3::new(0.0, 15.0, 0.0));
    arm.run(Duration::from_secs(1));
    let pushed = (place(&arm) - start).norm();
    arm.simulator_mut().push(Vector3::zeros());
    arm.run(Duration::from_secs(1));
    let left = (place(&arm) - start).norm();
    assert!(
        pushed > 0.01 && left < pushed / 3.0,
        "{pushed} m, then {left} m"
    );
}

#[test]
fn the_same_seed_gives_the_same_motion() {
    let end = |seed: u64| {
        let options = SimulatorOptions {
            seed,
            ..SimulatorOptions::default()
        };
        let mut arm = SimulatedArm::new(WamModel::<7>::new(), options);
        let limits = JointLimits::uniform(0.7, 0.7);
        arm.move_joints(&REACHING.into(), &limits).unwrap();
        arm.finish(Duration::from_millis(100));
        (arm.simulator().angles(), arm.simulator().time())
    };
    assert_eq!(end(1), end(1));
    assert_ne!(end(1), end(2));
}

#[test]
fn finer_encoders_see_smaller_motions() {
    let counts_seen = |model: WamModel<7>| {
        let mut arm = simulator(model, SimulatorOptions::default());
        let finest = arm.model().transmission.resolution();
        let controller = JointControllers::new(arm.model().clone(), Duration::from_millis(2));
        for step in 0..200 {
            let mut angles = Seven::from(REACHING);
            angles[0] += f64::from(step) * 1e-5;
            arm.place(&angles);
            let off = controller.measure(&arm.counts()) - arm.angles();
            assert!((0..7).all(|joint| off[joint].abs() <= finest[joint]));
        }
        arm.place(&REACHING.into());
        let start = arm.counts()[0];
        let mut moved = Seven::from(REACHING);
        moved[0] += 0.01;
        arm.place(&moved);
        (arm.counts()[0] - start).abs()
    };
    let coarse = counts_seen(WamModel::<7>::new());
    let fine = counts_seen(WamModel::<7>::new().with_counts_per_turn(OPTICAL_COUNTS));
    // 27380 and 273800 counts per rad.
    assert!((coarse - 274).abs() <= 1, "{coarse}");
    assert!((fine - 2738).abs() <= 1, "{fine}");
}

#[test]
fn too_much_speed_takes_the_arm_out_of_active() {
    let mut arm = SimulatedArm::new(WamModel::<7>::new(), SimulatorOptions::default());
    arm.place(&REACHING.into());
    arm.set_floating(true);
    arm.simulator_mut().push(Vector3::new(0.0, 120.0, 0.0));
    arm.run(Duration::from_secs(1));
    let safety = arm.simulator().safety();
    assert!(
        matches!(safety.fault(), Some(Fault::Velocity { .. })),
        "{:?}",
        safety.fault()
    );
    assert!(safety.mode() < SafetyMode::Active);
}

#[test]
fn too_much_torque_takes_the_arm_out_of_active() {
    let mut arm = simulator(WamModel::<7>::new(), SimulatorOptions::default());
    let mut torques = Seven::zeros();
    // Joint 1 has one motor with a ratio of 42: 100 Nm are 6429 units of it.
    torques[0] = -100.0;
    arm.step(Some(&torques));
    let fault = arm.safety().fault();
    assert!(
        matches!(fault, Some(Fault::Torque { motor: 0, .. })),
        "{fault:?}"
    );
    assert_eq!(
        fault.map(|fault| fault.to_string()).unwrap_or_default(),
        "torque fault: motor 0 asked for 6428 units, allowed 5204"
    );
}

#[test]
fn silence_takes_the_arm_out_of_active() {
    let mut arm = simulator(WamModel::<7>::new(), SimulatorOptions::default());
    let hold = holding(&arm);
    arm.step(Some(&hold));
    // The motors continue with the last torques.
    seconds(&mut arm, 0.4, |_| None);
    assert_eq!(arm.safety().mode(), SafetyMode::Active);
    arm.step(Some(&hold));
    seconds(&mut arm, 0.6, |_| None);
    assert!(matches!(
        arm.safety().fault(),
        Some(Fault::Heartbeat { .. })
    ));
    assert_eq!(arm.safety().mode(), SafetyMode::Idle);
}

#[test]
fn what_is_no_number_does_no_harm() {
    let mut arm = simulator(WamModel::<7>::new(), reckless());
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX] {
        arm.push(Vector3::repeat(bad));
        arm.twist(Seven::repeat(bad));
        arm.place(&Seven::repeat(bad));
        arm.step(Some(&Seven::repeat(bad)));
        assert!(arm.angles().iter().all(|angle| angle.is_finite()), "{bad}");
    }
}

#[test]
fn a_controller_drives_floats_and_holds_joint_by_joint() {
    let arm = simulator(WamModel::<7>::new(), SimulatorOptions::default());
    let mut controller = JointControllers::new(arm.model().clone(), Duration::from_millis(2));
    let counts = arm.counts();
    let measured = controller.measure(&counts);
    let mut orders = [JointCommand::Float; 7];
    let gravity = controller.step(&counts, &orders);
    orders[0] = JointCommand::At(measured[0] + 0.01);
    orders[1] = JointCommand::Drive(1.5);
    let added = controller.step(&counts, &orders) - gravity;
    // 900 Nm/rad, and hardly anything of the integral yet.
    assert!((added[0] - 9.0).abs() < 1e-3, "{}", added[0]);
    assert!((added[1] - 1.5).abs() < 1e-9);
    assert_eq!(added.rows(2, 5).amax(), 0.0);
}
