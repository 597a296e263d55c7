//! The numbers of the arm and the hand against their public sources, written out here: libbarrett's `wam7w.conf` (LB),
//! btclient (BT), owd (OWD) and Barrett's manuals.

use std::time::Duration;

use yarp_devices::hand::gcl::{
    Control, Feedback, FirmwareVersion, Header, Layout, MotorControl, MotorFeedback, MotorLayout,
};
use yarp_devices::kinematics::Joints;
use yarp_devices::simulation::{SafetyLimits, Simulator, SimulatorOptions};
use yarp_devices::wam::{ArmControl, DynamicArm, WamModel};
use yarp_devices::{Axes, AxisIndex, Interaction, Mode};

fn close(what: &str, got: f64, expected: f64) {
    let off = (got - expected).abs();
    assert!(
        off <= 1e-9 * expected.abs().max(1e-6),
        "{what}: {got}, not {expected}"
    );
}

/// LB `j2mp`: both wrist motors turn the same way for joint 5 and opposite ways for joint 6.
#[test]
fn ratios_from_joints_to_motors() {
    let rows = [
        [-42.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 28.25, -16.8155, 0.0, 0.0, 0.0, 0.0],
        [0.0, -28.25, -16.8155, 0.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, -18.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 9.7, -9.7, 0.0],
        [0.0, 0.0, 0.0, 0.0, 9.7, 9.7, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -14.93],
    ];
    let transmission = WamModel::<7>::new().transmission;
    for (motor, row) in rows.iter().enumerate() {
        for (joint, &ratio) in row.iter().enumerate() {
            assert_eq!(transmission.ratio(motor, joint), ratio, "{motor} {joint}");
        }
    }
    // 4096 / 2 pi counts per rad of a motor, rounded down: -0.97 rad and 10.67 rad.
    let wrist = Joints::<7>::from([0.0, 0.0, 0.0, 0.0, 0.5, 0.6, 0.0]);
    let counts = transmission.counts(&wrist);
    assert_eq!((counts[4], counts[5]), (-633, 6955));
}

/// LB: kg, mm, 1e-6 kg m² as xx, yy, zz, xy, xz, yz.
#[test]
fn masses_centres_and_inertias_of_the_links() {
    let links = [
        (
            10.7677,
            [-4.43, 121.89, -0.66],
            [134880.33, 113283.69, 90463.30, -2130.41, -124.85, 685.55],
        ),
        (
            3.8749,
            [-2.37, 31.06, 15.42],
            [21409.58, 13778.75, 15589.06, 271.72, 24.61, -1819.20],
        ),
        (
            1.8023,
            [-38.26, 207.51, 0.03],
            [59110.77, 3245.50, 59270.43, -2496.12, 7.38, -17.67],
        ),
        (
            2.17266212,
            [5.53408, 0.06822, 119.27695],
            [10674.91, 10586.59, 2820.36, 45.03, -1355.57, -110.02],
        ),
        (
            0.35655692,
            [0.05483, 28.86286, 1.48493],
            [371.12, 194.34, 382.09, -0.08, -0.03, -16.13],
        ),
        (
            0.40915886,
            [-0.05923, -16.86123, 24.19052],
            [548.89, 238.46, 451.33, 0.19, -0.10, -44.30],
        ),
        (
            0.0754827,
            [0.14836, 0.07252, -3.35185],
            [39.11, 38.77, 76.14, 0.19, 0.0, 0.0],
        ),
    ];
    let places = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];
    let bodies = WamModel::<7>::new().bodies;
    for (number, (body, (mass, centre, inertia))) in bodies.iter().zip(links).enumerate() {
        let link = number + 1;
        close(&format!("mass of link {link}"), body.mass, mass);
        for (axis, millimetres) in centre.into_iter().enumerate() {
            let what = format!("centre of link {link}, {axis}");
            close(&what, body.centre[axis], millimetres * 1e-3);
        }
        for ((row, column), moment) in places.into_iter().zip(inertia) {
            let what = format!("inertia of link {link}, {row} {column}");
            close(&what, body.inertia[(row, column)], moment * 1e-6);
            close(&what, body.inertia[(column, row)], moment * 1e-6);
        }
    }
}

/// BT `rotorI`, OWD `Dynamics.cc`, LB `IPNM`, BT `MT`.
#[test]
fn rotors_friction_and_motors() {
    let rotors = [
        0.201,
        0.182,
        0.067,
        0.034,
        0.0033224,
        0.0033224,
        0.000466939,
    ];
    let coulomb = [2.7, 2.5, 1.5, 1.1, 0.4, 0.4, 0.1];
    let viscous = [1.5, 0.9, 0.5, 0.25, 0.0, 0.1, 0.0];
    let units = [2700.0, 2700.0, 2700.0, 2700.0, 6500.0, 6500.0, 17474.0];
    let largest = [4860.0, 4860.0, 4860.0, 4320.0, 3900.0, 3900.0, 1600.0];
    let model = WamModel::<7>::new();
    for joint in 0..7 {
        assert_eq!(model.rotors[joint], rotors[joint], "rotor {joint}");
        assert_eq!(model.friction[joint].coulomb, coulomb[joint], "{joint}");
        assert_eq!(model.friction[joint].viscous, viscous[joint], "{joint}");
        let motor = model.motors[joint];
        assert_eq!(motor.units_per_newton_metre, units[joint], "{joint}");
        assert_eq!(motor.limit, largest[joint], "{joint}");
    }
}

/// LB `joint_position_control`, per rad there and per degree here: a degree is 0.017453 rad.
#[test]
fn gains_per_degree() {
    let kp = [900.0, 2500.0, 600.0, 500.0, 50.0, 50.0, 8.0];
    let ki = [2.5, 5.0, 2.0, 0.5, 0.5, 0.5, 0.1];
    let kd = [10.0, 20.0, 5.0, 2.0, 0.5, 0.5, 0.05];
    let most = [25.0, 20.0, 15.0, 15.0, 5.0, 5.0, 5.0];
    let mut arm = DynamicArm::new(WamModel::<7>::new(), SimulatorOptions::default());
    for joint in 0..7 {
        let axis = AxisIndex::new(joint);
        let gains = arm.gains(axis).expect("it exists");
        close("kp", gains.proportional, kp[joint] * 0.017_453_292_519_943);
        close("ki", gains.integral, ki[joint] * 0.017_453_292_519_943);
        close("kd", gains.derivative, kd[joint] * 0.017_453_292_519_943);
        assert_eq!(gains.limit, most[joint]);
        // And back: set as they were read, they are the same.
        arm.set_gains(axis, gains).expect("they are its own");
        let again = arm.gains(axis).expect("it exists");
        close("kd", again.derivative, gains.derivative);
        close("kp", again.proportional, gains.proportional);
    }
}

/// A derivative gain in Nm s/deg brakes with that many Nm per deg/s: 57 times less would let the joint swing.
#[test]
fn a_derivative_gain_acts_per_degree() {
    let mut arm = DynamicArm::new(WamModel::<7>::new(), SimulatorOptions::default());
    let base = AxisIndex::new(0);
    let mut gains = arm.gains(base).expect("it exists");
    (gains.proportional, gains.integral, gains.derivative) = (0.0, 0.0, 0.2);
    arm.set_gains(base, gains).expect("they are allowed");
    let mut control: ArmControl = (*arm).clone();
    control.drive();
    // A degree of joint 1 is 477.87 counts of its motor, negative; 48 counts are 0.10045 deg, in 2 ms 50.2 deg/s.
    let mut counts = control.motor_counts();
    counts[0] -= 48;
    control.take_counts(counts);
    control.drive();
    let output = control.loop_output(base).expect("it exists");
    assert!((output + 0.2 * 50.2).abs() < 0.05, "{output} Nm");
}

/// LB: the difference quotient of positions through a low-pass of 180 rad/s, of which 2 ms take 0.36 / 1.36.
#[test]
fn velocities_are_filtered() {
    let model = WamModel::<7>::new();
    let home = model.transmission.counts(&model.home);
    let mut control = ArmControl::new(model, Duration::from_millis(2), home);
    let mut counts = home;
    counts[0] += 100;
    control.take_counts(counts);
    let velocity = control.state(0.into()).expect("it exists").velocity;
    // 100 counts are 0.209263 deg of joint 1, the other way round: 104.632 deg/s before the filter.
    assert!((velocity + 27.6966).abs() < 0.001, "{velocity} deg/s");
}

fn pushed(units: i16) -> f64 {
    let safety = SafetyLimits {
        torque_fault: 0.0,
        velocity_fault: 0.0,
        ..SafetyLimits::default()
    };
    let options = SimulatorOptions {
        safety,
        friction_noise: 0.0,
        ..SimulatorOptions::default()
    };
    let mut arm = Simulator::new(WamModel::<7>::new(), options);
    arm.place(&Joints::<7>::from([0.0, 0.0, 0.0, 1.5, 0.0, 0.0, 0.0]));
    arm.safety_mut().press_activate();
    let mut commands = [0; 7];
    commands[3] = units;
    for _ in 0..5 {
        arm.step_units(Some(&commands));
    }
    arm.velocities()[3]
}

/// BT `MT`: the puck of joint 4 follows 4320 units at most.
#[test]
fn a_motor_of_the_simulator_follows_its_largest_torque_at_most() {
    assert_eq!(pushed(8191), pushed(4320));
    assert_ne!(pushed(4320), pushed(4200));
}

/// Barrett's wiki: velocity is judged at the elbow and at the end of the forearm, 0.35 m beyond it.
#[test]
fn the_speed_of_the_forearm_counts() {
    let mut arm = Simulator::new(WamModel::<7>::new(), SimulatorOptions::default());
    arm.place(&Joints::<7>::from([0.0, 0.0, 0.0, 1.5, 0.0, 0.0, 0.0]));
    arm.twist([0.0, 0.0, 0.0, 30.0, 0.0, 0.0, 0.0].into());
    for _ in 0..50 {
        arm.step(None);
    }
    let turning = arm.velocities()[3].abs();
    assert!(turning > 0.2, "{turning} rad/s");
    assert!(arm.speed() > 0.25 * turning, "{} m/s", arm.speed());
}

/// A compliant joint pushes no harder than the position loop may: 15 Nm at the elbow (LB).
#[test]
fn a_compliant_joint_is_limited_like_its_loop() {
    let mut arm = DynamicArm::new(WamModel::<7>::new(), SimulatorOptions::default());
    let elbow = AxisIndex::new(3);
    let mut impedance = arm.impedance(elbow).expect("it exists");
    impedance.stiffness = 500.0 * 0.017_453;
    arm.set_impedance(elbow, impedance)
        .expect("as stiff as the loop");
    arm.set_control_modes(Axes::One(elbow), &[Mode::PositionDirect])
        .expect("it is ready");
    arm.set_interactions(Axes::One(elbow), &[Interaction::Compliant])
        .expect("it is ready");
    // 79 degrees away, which are 690 Nm of the spring.
    arm.set_direct_positions(Axes::One(elbow), &[100.0])
        .expect("inside the limits");
    arm.tick();
    let at_once = arm.loop_output(elbow).expect("it exists");
    assert!(at_once > -15.0, "{at_once}: the set point jumped");
    let mut strongest = 0.0_f64;
    for _ in 0..250 {
        arm.tick();
        strongest = strongest.min(arm.loop_output(elbow).expect("it exists"));
    }
    assert_eq!(strongest, -15.0);
}

fn layout(of_each: MotorLayout) -> Layout {
    Layout {
        motors: [Some(of_each), None, None, None],
        ..Layout::default()
    }
}

/// The manual of firmware 4.3x, pages 37 to 43: speed, strain, position with its high byte first, change.
#[test]
fn realtime_feedback_byte_by_byte() {
    let full = layout(MotorLayout {
        measured_speed: Some(1),
        strain: true,
        position: true,
        change: Some(1),
        ..MotorLayout::default()
    });
    let bytes = [b'*', 0xFB, 0x2A, 0x12, 0x34, 0x07];
    let mut feedback = Feedback::default();
    feedback.motors[0] = MotorFeedback {
        speed: Some(-5),
        strain: Some(42),
        position: Some(4660),
        change: Some(7),
        ..MotorFeedback::default()
    };
    let read = full.read_feedback(Header::Control, &bytes);
    assert_eq!(read, Ok(Some(feedback.clone())));
    assert_eq!(full.write_feedback(Header::Control, &feedback), bytes);
}

/// The examples of sources: seven bytes of control for three fingers, and the manual's `124LOOP` with eight bytes of
/// feedback.
#[test]
fn realtime_examples() {
    let finger = MotorLayout {
        speed: Some(1),
        gain: true,
        strain: true,
        position: true,
        ..MotorLayout::default()
    };
    let three = Layout {
        motors: [Some(finger), Some(finger), Some(finger), None],
        ..Layout::default()
    };
    let command = MotorControl {
        speed: 100,
        gain: 90,
        ..MotorControl::default()
    };
    let control: Control = [command, command, command, MotorControl::default()];
    assert_eq!(
        three.write_control(Header::Control, &control),
        [0x43, 0x64, 0x5A, 0x64, 0x5A, 0x64, 0x5A]
    );
    assert_eq!(three.feedback_length(), 9);
    let finger = MotorLayout {
        speed: Some(1),
        strain: true,
        change: Some(1),
        ..MotorLayout::default()
    };
    let spread = MotorLayout {
        change: Some(1),
        ..MotorLayout::default()
    };
    let manual = Layout {
        motors: [Some(finger), Some(finger), None, Some(spread)],
        temperature: true,
        firmware: FirmwareVersion::V4_3,
    };
    assert_eq!(manual.control_length() + 1, 3);
    // `*` s1 d1 s2 d2 d4 and the temperature: 27.4 °C.
    let bytes = [b'*', 10, 0xFF, 20, 2, 0xFD, 0x01, 0x12];
    let read = manual.read_feedback(Header::Control, &bytes);
    let read = read.expect("it is feedback").expect("all is there");
    let changes = read.motors.map(|motor| motor.change);
    assert_eq!(changes, [Some(-1), Some(2), None, Some(-3)]);
    let strains = read.motors.map(|motor| motor.strain);
    assert_eq!(strains, [Some(10), Some(20), None, None]);
    assert_eq!(read.temperature, Some(274));
}

/// D1001 table 6, with 3.13 at the top of the elbow; LB `wam7w.conf` rows and `zerocal.conf`.
#[test]
fn limits_rows_and_home() {
    let limits = [
        (-2.6, 2.6),
        (-2.0, 2.0),
        (-2.8, 2.8),
        (-0.9, 3.13),
        (-4.76, 1.24),
        (-1.6, 1.6),
        (-3.0, 3.0),
    ];
    let model = WamModel::<7>::new();
    for (joint, (own, (min, max))) in model.chain.limits().iter().zip(limits).enumerate() {
        assert_eq!((own.min, own.max), (min, max), "joint {joint}");
    }
    let home = Joints::<7>::from([0.0, -2.0, 0.0, 3.13, 0.0, 0.0, 0.0]);
    assert_eq!(model.home, home);
    let place = model.chain.forward(&home).translation.vector;
    for (got, expected) in place.iter().zip([-0.21164, 0.0, 0.00672]) {
        assert!((got - expected).abs() < 1e-5, "{place}");
    }
}

/// LB `wam4.conf`.
#[test]
fn the_arm_with_four_joints() {
    let model = WamModel::<4>::new();
    close("mass of link 4", model.bodies[3].mass, 1.0651);
    close("centre of link 4", model.bodies[3].centre.z, 0.14054);
    let moments = [
        [0.26679, 0.0, 0.000058],
        [0.00858, 0.02793, 1.37375],
        [-0.04104, 0.12370, 0.04589],
        [-0.01694, -0.00012, 0.17860],
    ];
    for (link, (own, moment)) in model.calibration.moments.iter().zip(moments).enumerate() {
        for (axis, expected) in moment.into_iter().enumerate() {
            close(
                &format!("moment of link {link}, {axis}"),
                own[axis],
                expected,
            );
        }
    }
    let loops = [
        (900.0, 2.5, 10.0),
        (2500.0, 5.0, 20.0),
        (600.0, 2.5, 10.0),
        (500.0, 0.5, 2.5),
    ];
    for (own, (proportional, integral, derivative)) in model.gains.iter().zip(loops) {
        assert_eq!(
            (own.proportional, own.integral, own.derivative),
            (proportional, integral, derivative)
        );
    }
    let up = model.chain.forward(&Joints::<4>::zeros());
    close(
        "height of the tool plate",
        up.translation.vector.z,
        0.55 + 0.36,
    );
}

/// With the arm folded, the shoulder moves the elbow faster than the end of the forearm.
#[test]
fn the_speed_of_the_elbow_counts() {
    let mut arm = Simulator::new(WamModel::<7>::new(), SimulatorOptions::default());
    arm.place(&Joints::<7>::from([0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0]));
    arm.twist([0.0, 60.0, 0.0, 0.0, 0.0, 0.0, 0.0].into());
    for _ in 0..50 {
        arm.step(None);
    }
    let turning = arm.velocities()[1].abs();
    assert!(turning > 0.05, "{turning} rad/s");
    assert!(arm.speed() > 0.5 * turning, "{} m/s", arm.speed());
}

/// An idle joint of an active arm is braked by its shorted windings, whatever is commanded.
#[test]
fn an_idle_joint_follows_no_torque() {
    let speed = |idle: bool| {
        let mut arm = Simulator::new(WamModel::<7>::new(), SimulatorOptions::default());
        arm.place(&Joints::<7>::from([0.0, 0.0, 0.0, 1.5, 0.0, 0.0, 0.0]));
        arm.safety_mut().press_activate();
        arm.set_idle(0, idle);
        for _ in 0..50 {
            arm.step(Some(&[20.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0].into()));
        }
        arm.velocities()[0].abs()
    };
    assert!(speed(false) > 0.1, "{}", speed(false));
    assert!(speed(true) < 1e-6, "{}", speed(true));
}

/// A joint that moves at 10 deg/s has not arrived.
#[test]
fn a_moving_joint_is_not_done() {
    let mut arm = DynamicArm::new(WamModel::<7>::new(), SimulatorOptions::default());
    let base = Axes::One(AxisIndex::new(0));
    arm.position_move(base, &[20.0]).expect("inside the limits");
    for _ in 0..200 {
        arm.tick();
    }
    // A new target at the present set point: its generator is done at once, the joint is not.
    arm.set_control_modes(base, &[Mode::PositionDirect])
        .expect("it is ready");
    arm.set_control_modes(base, &[Mode::Position])
        .expect("it is ready");
    arm.simulator_mut()
        .twist([30.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0].into());
    for _ in 0..15 {
        arm.tick();
    }
    let speed = arm.state(AxisIndex::new(0)).expect("it exists").velocity;
    assert!(speed.abs() > 2.0, "{speed} deg/s");
    assert!(!arm.motion_done(base).expect("it exists"));
}
