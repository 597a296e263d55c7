//! The numbers of the arm and the hand against their public sources, written out here: libbarrett's `wam7w.conf` (LB),
//! btclient (BT), owd (OWD) and Barrett's manuals.

use std::time::Duration;

use yarp_devices::hand::gcl::{
    Control, Feedback, FirmwareVersion, Header, Layout, Motor, MotorControl, MotorFeedback,
    MotorLayout, Parameter, Scope,
};
use yarp_devices::kinematics::Joints;
use yarp_devices::simulation::{ArmEffects, SafetyLimits, Simulator, SimulatorOptions, WakeUp};
use yarp_devices::wam::{ArmControl, DynamicArm, WamModel, parameters};
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

/// Runs an arm for 50 periods from a posture, its motors off and a joint pushed by `torque`, Nm. The joints in `stiff` do not
/// move.
///
/// Returns the speed of that joint, rad/s, and that which the safety module judges, m/s.
fn pushed_from(posture: [f64; 7], joint: usize, torque: f64, stiff: &[usize]) -> (f64, f64) {
    let mut arm = Simulator::new(WamModel::<7>::new(), SimulatorOptions::default());
    let mut friction = WamModel::<7>::new().friction;
    for joint in stiff {
        friction[*joint].coulomb = 1e6;
    }
    arm.set_friction(friction);
    arm.place(&posture.into());
    let mut torques = Joints::<7>::zeros();
    torques[joint] = torque;
    arm.twist(torques);
    for _ in 0..50 {
        arm.step(None);
    }
    (arm.velocities()[joint].abs(), arm.speed())
}

/// Barrett's wiki: velocity is judged at the elbow and at the end of the forearm, 0.35 m beyond it.
#[test]
fn the_speed_of_the_forearm_counts() {
    let (turning, speed) = pushed_from([0.0, 0.0, 0.0, 1.5, 0.0, 0.0, 0.0], 3, 30.0, &[]);
    assert!(turning > 0.2, "{turning} rad/s");
    assert!(speed > 0.25 * turning, "{speed} m/s");
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

/// Ranges and factory's values of the manuals; those of targets, of steps and of times are assumed.
#[test]
fn ranges_and_defaults_of_the_parameters_of_the_hand() {
    let motor = [
        ("P", 0, 20_000, 0, 0),
        ("SG", 0, 255, 128, 255),
        ("BP", 0, 20_000, 0, 0),
        ("MCV", 16, 4080, 100, 60),
        ("MOV", 16, 4080, 100, 60),
        ("HSG", 0, 256, 256, 256),
        ("LSG", 0, 256, 256, 256),
        ("CT", 0, 18_000, 17_800, 3150),
        ("OT", 0, 18_000, 0, 0),
        ("DP", 0, 18_000, 8900, 1575),
        ("DS", -32_768, 32_767, 1780, 315),
        ("MPE", 0, 65_535, 50, 20),
        ("TSTOP", 0, 65_535, 200, 200),
        ("HOLD", 0, 1, 0, 1),
        ("EN", 0, 1, 1, 1),
        ("ACCEL", 0, 65_535, 4, 2),
        ("SAMPLE", 15, 255, 63, 200),
        ("FPG", 0, 255, 5, 5),
        ("LCV", 0, 1, 1, 1),
        ("LFDP", 0, 1, 1, 1),
        ("LCVC", 0, 255, 1, 1),
        ("LFDPC", 0, 255, 1, 1),
        ("LCT", 0, 1, 0, 0),
        ("LFBP", 0, 1, 0, 0),
        ("LFAIN", 0, 1, 0, 0),
    ];
    let hand = [
        ("BAUD", 6, 384, 96, 96),
        ("TEMP", -550, 1250, 350, 350),
        ("PTEMP", 0, 1250, 350, 350),
        ("OTEMP", 0, 1250, 650, 650),
        ("LFT", 0, 1, 0, 0),
        ("LFDPD", 0, 1, 0, 0),
    ];
    let motor = motor.map(|row| (Scope::Motor, row));
    let hand = hand.map(|row| (Scope::Hand, row));
    for (scope, (name, min, max, finger, spread)) in motor.into_iter().chain(hand) {
        let parameter = Parameter::find(scope, name).expect(name);
        assert!(parameter.allows(min) && parameter.allows(max), "{name}");
        assert!(!parameter.allows(min - 1), "{name}");
        assert!(!parameter.allows(max + 1), "{name}");
        let defaults =
            [Motor::F1, Motor::F2, Motor::F3, Motor::Spread].map(|motor| parameter.default(motor));
        assert_eq!(defaults, [finger, finger, finger, spread], "{name}");
    }
    for name in ["P", "S", "SG", "BD", "BP", "OD"] {
        let parameter = Parameter::find(Scope::Motor, name).expect(name);
        assert!(!parameter.is_writable(), "{name}");
    }
}

/// The manual of firmware 4.4: one signed byte of whole degrees.
#[test]
fn the_temperature_of_firmware_4_4_is_one_signed_byte() {
    let layout = Layout {
        temperature: true,
        firmware: FirmwareVersion::V4_4,
        ..Layout::default()
    };
    let read = |byte: u8| {
        let read = layout.read_feedback(Header::Ask, &[b'*', byte]);
        read.expect("it is feedback").expect("all is there")
    };
    assert_eq!(read(0xF6).temperature, Some(-100));
    assert_eq!(read(40).temperature, Some(400));
    let written = |tenths| {
        let feedback = Feedback {
            temperature: Some(tenths),
            ..Feedback::default()
        };
        layout.write_feedback(Header::Ask, &feedback)
    };
    assert_eq!(written(-100), [b'*', 0xF6]);
    assert_eq!(written(1300), [b'*', 127]);
    assert_eq!(written(-1300), [b'*', 0x80]);
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

/// The firmware starts 2 s after power-up by itself (BH8-262 manual, appendix D).
#[test]
fn a_puck_starts_by_itself() {
    let wake_up = WakeUp::default();
    assert_eq!(wake_up.self_start, Some(Duration::from_secs(2)));
}

/// LB: moments in kg m as `gravity_comp` has them.
#[test]
fn moments_of_the_gravity_compensation() {
    let moments = [
        [-0.46198, 0.0, -0.000165],
        [0.09325, -0.14299, 2.38276],
        [0.09103, 0.17740, 0.10942],
        [-0.12639, -0.05702, 0.54153],
        [0.002227, 0.013625, -0.001012],
        [-0.0009, -0.004992, 0.025923],
        [-0.0000396, -0.0000754, 0.0000130],
    ];
    let calibration = WamModel::<7>::new().calibration;
    assert_eq!(calibration.gravity, 9.805);
    for (link, (own, moment)) in calibration.moments.iter().zip(moments).enumerate() {
        assert_eq!(own.as_slice(), moment, "link {link}");
    }
}

/// OWD: 2.5 rad/s, reached in 0.75 s; LB `systems/wam.h`: 0.5 rad/s and 0.5 rad/s². A degree is 0.017453 rad.
#[test]
fn speeds_and_accelerations_of_the_joints() {
    for axis in parameters() {
        close("largest speed", axis.max_speed, 143.239_448_782_7);
        close(
            "largest acceleration",
            axis.max_acceleration,
            190.985_931_710_3,
        );
        close("speed", axis.reference_speed, 28.647_889_756_5);
        close(
            "acceleration",
            axis.reference_acceleration,
            28.647_889_756_5,
        );
    }
}

/// Barrett's wiki, `SafetyFeaturesPrecautions`: `VL1` 2048 and `VL2` 4096 in 1/4096 m/s, `TL1` 4731 and `TL2` 5204 units.
#[test]
fn limits_of_the_safety_module_at_power_up() {
    let limits = SafetyLimits::default();
    assert_eq!(limits.velocity_warning * 4096.0, 2048.0);
    assert_eq!(limits.velocity_fault * 4096.0, 4096.0);
    assert_eq!(
        (limits.torque_warning, limits.torque_fault),
        (4731.0, 5204.0)
    );
    // Not published: half a second, which is assumed.
    assert_eq!(limits.heartbeat, 0.5);
}

/// The table of motors of the University of Waterloo, BT `POLES`, and Barrett's wiki, `CANbusSpecifications`.
#[test]
fn effects_of_a_real_arm() {
    let effects = ArmEffects::real_arm();
    let windings = effects.windings.expect("a real arm has windings");
    let resistances = [3.473, 3.473, 3.473, 3.473, 6.213, 6.213, 5.205];
    let constants = [0.457, 0.457, 0.457, 0.457, 0.236, 0.236, 0.067];
    let poles = [12.0, 12.0, 12.0, 12.0, 8.0, 8.0, 6.0];
    for (motor, winding) in windings.iter().enumerate() {
        assert_eq!(winding.resistance, resistances[motor], "{motor}");
        assert_eq!(winding.back_emf, constants[motor], "{motor}");
        // Three periods for each pole.
        let periods = effects.torque_variation[motor].periods_per_turn;
        assert_eq!(periods, 3.0 * poles[motor], "{motor}");
    }
    // A query, seven positions of 75 us each, two frames of torques of 125 us each.
    let traffic = Duration::from_micros(75 + 7 * 75 + 2 * 125);
    assert_eq!(effects.latency.least, traffic);
    assert_eq!(effects.supply_voltage, 48.0);
}

/// Turned by the elbow alone, the end of the forearm is 0.35 m along it and 0.045 m beside the axis.
#[test]
fn the_end_of_the_forearm_is_where_the_safety_module_judges_it() {
    let others = [0, 1, 2, 4, 5, 6];
    let (turning, speed) = pushed_from([0.0, 0.0, 0.0, 1.5, 0.0, 0.0, 0.0], 3, 30.0, &others);
    assert!(turning > 0.2, "{turning} rad/s");
    let radius = speed / turning;
    assert!((radius - 0.35_f64.hypot(0.045)).abs() < 1e-6, "{radius} m");
}

/// With the arm folded, the shoulder moves the elbow faster than the end of the forearm.
#[test]
fn the_speed_of_the_elbow_counts() {
    let (turning, speed) = pushed_from([0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0], 1, 60.0, &[]);
    assert!(turning > 0.05, "{turning} rad/s");
    assert!(speed > 0.5 * turning, "{speed} m/s");
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
