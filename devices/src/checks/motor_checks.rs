//! Behaviours of motors and forces, and of further interfaces.

use std::time::Duration;

use super::board_under_test::{Board, POSITION_TOLERANCE};
use crate::{
    AmplifierLimit, Axes, AxisIndex, CalibrationParameters, Device, Impedance, Interaction, Limits,
    Mode, MotorTorqueParameters, Pid, PidKind, PidValue, VariableValue,
};

const FIRST: AxisIndex = AxisIndex::new(0);
/// The share of the largest force that pushes joints about.
const TEST_FORCE_SHARE: f64 = 0.1;

fn one(values: Vec<f64>) -> f64 {
    assert_eq!(values.len(), 1);
    values[0]
}

fn close(left: f64, right: f64) -> bool {
    (left - right).abs() < POSITION_TOLERANCE
}

/// A joint in position direct mode goes to each position it is sent.
pub fn direct_positions_are_followed(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let direct = device.position_direct().expect("it has direct positions");
    board.set_mode(Mode::PositionDirect);
    let start = board.at(FIRST);
    let step = (board.inward(FIRST) - start) / 3.0;
    for place in 1..=3 {
        let target = start + step * f64::from(place);
        direct
            .set_direct_positions(FIRST.into(), &[target])
            .expect("it is allowed");
        board.eventually("the position sent", || close(board.at(FIRST), target));
        let reported = direct.direct_positions(FIRST.into()).expect("it answers");
        assert!(close(one(reported), target));
    }
    let all: Vec<f64> = board.readings().iter().map(|now| now.position).collect();
    direct
        .set_direct_positions(Axes::All, &all)
        .expect("they are allowed");
    // Not asserted to be an error: a device behind a network may not get the refusal.
    let _ = direct.set_direct_positions(FIRST.into(), &[board.far_end(FIRST) * 10.0 + 1e4]);
    board.time_passes();
    assert!(close(board.at(FIRST), all[0]));
    board.set_mode(Mode::Position);
}

/// A kind of force, with its commands and measurements.
struct Force<'a> {
    mode: Mode,
    largest: f64,
    set: &'a dyn Fn(Axes<'_>, &[f64]) -> bool,
    asked: &'a dyn Fn(Axes<'_>) -> Option<Vec<f64>>,
    measured: &'a dyn Fn(Axes<'_>) -> Option<Vec<f64>>,
}

/// A push moves the joint that way until it is taken back; one beyond the range is not taken.
fn pushes(board: &Board<'_>, force: &Force<'_>) {
    let towards = (board.far_end(FIRST) - board.at(FIRST)).signum();
    let push = TEST_FORCE_SHARE * force.largest * towards;
    // Not asserted to be an error: a device behind a network may not get the refusal.
    let _ = (force.set)(FIRST.into(), &[push]);
    board.time_passes();
    let start = board.at(FIRST);
    board.set_mode(force.mode);
    assert!((force.set)(FIRST.into(), &[push]), "it is allowed");
    board.eventually("motion", || (board.at(FIRST) - start) * towards > 0.5);
    board.eventually("the push given back", || {
        (force.asked)(FIRST.into()).is_some_and(|all| close(one(all), push))
    });
    board.eventually("the push measured", || {
        (force.measured)(FIRST.into()).is_some_and(|all| close(one(all), push))
    });
    let _ = (force.set)(FIRST.into(), &[2.0 * force.largest]);
    board.time_passes();
    let asked = (force.asked)(Axes::All).expect("it answers");
    assert_eq!(asked.len(), board.total);
    assert!(close(asked[0], push), "too much is not taken");
    let nothing = vec![0.0; board.total];
    assert!((force.set)(Axes::All, &nothing), "it is allowed");
    board.rests();
    let measured = (force.measured)(Axes::All).expect("it answers");
    assert_eq!(measured.len(), board.total);
    board.set_mode(Mode::Position);
}

/// Torques push joints, are reported and measured, and stay within their range.
pub fn torques_push_joints(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let torque = device.torque_control().expect("it has torques");
    let ranges = torque.torque_ranges(Axes::All).expect("it answers");
    assert_eq!(ranges.len(), board.total);
    assert_eq!(torque.torque_ranges(FIRST.into()).unwrap(), ranges[..1]);
    let force = Force {
        mode: Mode::Torque,
        largest: ranges[0].max,
        set: &|axes, values| torque.set_reference_torques(axes, values).is_ok(),
        asked: &|axes| torque.reference_torques(axes).ok(),
        measured: &|axes| torque.torques(axes).ok(),
    };
    pushes(&board, &force);
}

/// The torque loop's parameters of a motor are returned as set, if they are four numbers.
pub fn motor_torque_parameters_are_kept(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let torque = device.torque_control().expect("it has torques");
    let before = torque.motor_torque_parameters(FIRST).expect("it answers");
    let changed = MotorTorqueParameters {
        bemf: 0.25,
        ktau: before.ktau * 2.0,
        ..before
    };
    for parameters in [changed, before] {
        torque
            .set_motor_torque_parameters(FIRST, parameters)
            .expect("it is allowed");
        let reported = torque.motor_torque_parameters(FIRST).expect("it answers");
        assert_eq!(reported, parameters);
    }
    assert!(torque.motor_torque_parameters(board.total.into()).is_err());
}

/// Currents push joints, are reported and measured, and stay within their range.
pub fn currents_push_joints(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let current = device.current_control().expect("it has currents");
    let ranges = current.current_ranges(Axes::All).expect("it answers");
    assert_eq!(ranges.len(), board.total);
    assert_eq!(current.current_ranges(FIRST.into()).unwrap(), ranges[..1]);
    let force = Force {
        mode: Mode::Current,
        largest: ranges[0].max,
        set: &|axes, values| current.set_reference_currents(axes, values).is_ok(),
        asked: &|axes| current.reference_currents(axes).ok(),
        measured: &|axes| current.currents(axes).ok(),
    };
    pushes(&board, &force);
}

/// Duty cycles push joints, are reported and measured, and stay within 100 percent.
pub fn duty_cycles_push_joints(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let pwm = device.pwm_control().expect("it has duty cycles");
    // A state that travels in single precision is not that close.
    let force = Force {
        mode: Mode::Pwm,
        largest: 100.0,
        set: &|axes, values| pwm.set_reference_duty_cycles(axes, values).is_ok(),
        asked: &|axes| pwm.reference_duty_cycles(axes).ok(),
        measured: &|axes| {
            let measured = pwm.duty_cycles(axes).ok()?;
            Some(
                measured
                    .iter()
                    .map(|value| (value * 1e4).round() / 1e4)
                    .collect(),
            )
        },
    };
    pushes(&board, &force);
}

/// Joints are stiff or compliant as commanded; other modes are refused.
pub fn interactions_are_kept(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let interaction = device.interaction_mode().expect("it has interaction modes");
    let group = [AxisIndex::from(1), FIRST];
    let wanted = [Interaction::Compliant, Interaction::Stiff];
    interaction
        .set_interactions(Axes::Group(&group), &wanted)
        .expect("it is allowed");
    board.eventually("the interaction modes set", || {
        interaction
            .interactions(Axes::Group(&group))
            .is_ok_and(|now| now == wanted)
    });
    let odd = Interaction::from(u32::from_le_bytes(*b"limp"));
    assert!(interaction.set_interactions(FIRST.into(), &[odd]).is_err());
    let stiff = vec![Interaction::Stiff; board.total];
    interaction
        .set_interactions(Axes::All, &stiff)
        .expect("it is allowed");
    board.eventually("all of them stiff", || {
        interaction
            .interactions(Axes::All)
            .is_ok_and(|now| now == stiff)
    });
}

/// Stiffness, damping and offset come back as set, within their limits.
pub fn impedance_is_kept(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let control = device.impedance_control().expect("it has impedance");
    let limits = control.impedance_limits(FIRST).expect("it answers");
    let before = control.impedance(FIRST).expect("it answers");
    let wanted = Impedance {
        stiffness: limits.stiffness.max / 2.0,
        damping: limits.damping.max / 4.0,
    };
    control.set_impedance(FIRST, wanted).expect("it is allowed");
    assert_eq!(control.impedance(FIRST).expect("it answers"), wanted);
    let stiffness = limits.stiffness.max + 1.0;
    let beyond = Impedance {
        stiffness,
        ..wanted
    };
    assert!(control.set_impedance(FIRST, beyond).is_err());
    assert_eq!(control.impedance(FIRST).expect("it answers"), wanted);
    control.set_impedance(FIRST, before).expect("it is allowed");
    control
        .set_impedance_offset(FIRST, 0.5)
        .expect("it is allowed");
    assert_eq!(control.impedance_offset(FIRST).expect("it answers"), 0.5);
    control
        .set_impedance_offset(FIRST, 0.0)
        .expect("it is allowed");
    assert!(control.impedance(board.total.into()).is_err());
}

/// Gains, references and error limits of the loops come back as set, loop by loop.
pub fn control_loops_keep_what_they_are_told(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let control = device.pid_control().expect("it has control loops");
    let kinds = [
        PidKind::Position,
        PidKind::Velocity,
        PidKind::Torque,
        PidKind::Current,
    ];
    for (number, kind) in kinds.into_iter().enumerate() {
        let before = control.pids(kind, Axes::All).expect("it has this loop");
        assert_eq!(before.len(), board.total);
        // Every gain differs, so that none can take the place of another.
        let pid = Pid {
            kp: 1.0 + number as f64,
            kd: 2.0,
            ki: 3.0,
            max_integral: 4.0,
            scale: 5.0,
            max_output: 6.0,
            offset: 7.0,
            stiction_up: 8.0,
            stiction_down: 9.0,
            kff: 10.0,
        };
        control
            .set_pids(kind, FIRST.into(), &[pid])
            .expect("it is allowed");
        assert_eq!(control.pids(kind, FIRST.into()).expect("known"), [pid]);
        let now = control.pids(kind, Axes::All).expect("known");
        assert_eq!((now[0], &now[1..]), (pid, &before[1..]));
        control
            .set_pids(kind, Axes::All, &before)
            .expect("it is allowed");
        assert_eq!(control.pids(kind, Axes::All).expect("known"), before);

        for value in [PidValue::Reference, PidValue::ErrorLimit] {
            control
                .set_pid_values(kind, value, FIRST.into(), &[12.5])
                .expect("it is allowed");
            let reported = control.pid_values(kind, value, FIRST.into());
            assert_eq!(one(reported.expect("known")), 12.5);
            let all = vec![1.5; board.total];
            control
                .set_pid_values(kind, value, Axes::All, &all)
                .expect("it is allowed");
            assert_eq!(control.pid_values(kind, value, Axes::All).unwrap(), all);
        }
        for value in [PidValue::Error, PidValue::Output] {
            let reported = control.pid_values(kind, value, Axes::All).expect("known");
            assert_eq!(reported.len(), board.total);
            control
                .pid_values(kind, value, FIRST.into())
                .expect("known");
        }
        control
            .set_pid_values(kind, PidValue::Offset, FIRST.into(), &[0.0])
            .expect("it is allowed");
        for enabled in [false, true] {
            control
                .enable_pids(kind, FIRST.into(), enabled)
                .expect("it is allowed");
            let reported = control.pids_enabled(kind, FIRST.into()).expect("known");
            assert_eq!(reported, [enabled]);
        }
        control
            .reset_pids(kind, FIRST.into())
            .expect("it is allowed");
    }
    let odd = PidKind::Other(u32::from_le_bytes(*b"pos3"));
    assert!(control.pids(odd, FIRST.into()).is_err());
    assert!(
        control
            .pids(PidKind::Position, Axes::One(board.total.into()))
            .is_err()
    );
}

/// Motor encoders can be set without any motion, and follow the joints.
pub fn motor_encoders_follow_the_joints(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let motors = device.motor_encoders().expect("it has motor encoders");
    let turned = |axis: AxisIndex| {
        motors
            .motor_readings(axis.into())
            .map(|all| all[0].position)
    };
    let here = board.at(FIRST);
    motors
        .set_motor_encoders(FIRST.into(), &[100.0])
        .expect("it is allowed");
    board.eventually("the number set", || {
        turned(FIRST).is_ok_and(|now| close(now, 100.0))
    });
    assert!(close(board.at(FIRST), here), "nothing moves");
    let target = board.inward(FIRST);
    board
        .position
        .position_move(FIRST.into(), &[target])
        .expect("it is allowed");
    board.arrives(FIRST, target);
    board.eventually("motion of the motor", || {
        turned(FIRST).is_ok_and(|now| (now - 100.0).abs() > 1.0)
    });
    motors
        .reset_motor_encoders(Axes::All)
        .expect("it is allowed");
    board.eventually("zeros", || {
        motors
            .motor_readings(Axes::All)
            .is_ok_and(|all| all.iter().all(|now| close(now.position, 0.0)))
    });
    let counts = motors.counts_per_revolution(FIRST).expect("it answers");
    for wanted in [counts * 2.0, counts] {
        motors
            .set_counts_per_revolution(FIRST, wanted)
            .expect("it is allowed");
        assert_eq!(motors.counts_per_revolution(FIRST).expect("known"), wanted);
    }
    assert!(motors.counts_per_revolution(board.total.into()).is_err());
}

/// MotorSet report their temperatures; limits and gear ratios are kept as set.
pub fn motors_tell_what_they_are(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let motor = device.motor().expect("it has motors");
    let all = motor.temperatures(Axes::All).expect("it answers");
    assert_eq!(all.len(), board.total);
    assert!(all.iter().all(|temperature| temperature.is_finite()));
    one(motor.temperatures(FIRST.into()).expect("it answers"));
    let limit = motor.temperature_limit(FIRST).expect("it answers");
    for wanted in [limit + 1.0, limit] {
        motor
            .set_temperature_limit(FIRST, wanted)
            .expect("it is allowed");
        assert_eq!(motor.temperature_limit(FIRST).expect("known"), wanted);
    }
    let ratio = motor.gearbox_ratio(FIRST).expect("it answers");
    for wanted in [ratio * 2.0, ratio] {
        motor
            .set_gearbox_ratio(FIRST, wanted)
            .expect("it is allowed");
        assert_eq!(motor.gearbox_ratio(FIRST).expect("known"), wanted);
    }
    assert!(motor.temperature_limit(board.total.into()).is_err());
}

/// A joint whose amplifier is off is idle and stays so; limits are reported as set.
pub fn amplifiers_switch_joints_off(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let amplifiers = device.amplifier_control().expect("it has amplifiers");
    let status = amplifiers.amplifier_status(Axes::All).expect("it answers");
    assert_eq!(status.len(), board.total);
    assert_ne!(status[0], 0);
    amplifiers
        .enable_amplifiers(FIRST.into(), false)
        .expect("it is allowed");
    assert_eq!(amplifiers.amplifier_status(FIRST.into()).unwrap(), [0]);
    board.eventually("idle mode", || {
        board
            .modes
            .control_modes(FIRST.into())
            .is_ok_and(|modes| modes == [Mode::Idle])
    });
    let refused = board
        .modes
        .set_control_modes(FIRST.into(), &[Mode::Position]);
    assert!(refused.is_err());
    amplifiers
        .enable_amplifiers(FIRST.into(), true)
        .expect("it is allowed");
    board.set_mode(Mode::Position);
    for limit in [
        AmplifierLimit::MaxCurrent,
        AmplifierLimit::NominalCurrent,
        AmplifierLimit::PeakCurrent,
        AmplifierLimit::DutyCycle,
    ] {
        let before = amplifiers.amplifier_limit(limit, FIRST).expect("known");
        for wanted in [before / 2.0, before] {
            amplifiers
                .set_amplifier_limit(limit, FIRST, wanted)
                .expect("it is allowed");
            let reported = amplifiers.amplifier_limit(limit, FIRST).expect("known");
            assert_eq!(reported, wanted, "{limit:?}");
        }
    }
    assert!(amplifiers.supply_voltage(FIRST).expect("it answers") > 0.0);
    let duty_cycle = amplifiers.amplifier_duty_cycle(FIRST).expect("it answers");
    assert!(Limits::new(-100.0, 100.0).contains(duty_cycle));
    assert!(amplifiers.supply_voltage(board.total.into()).is_err());
}

/// A joint is calibrated at rest, and then reports it.
pub fn calibration_is_done(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let calibration = device.control_calibration().expect("it has calibration");
    let parameters = CalibrationParameters {
        method: 3,
        parameters: [1.0, 2.0, 3.0, 0.0, 0.0],
        zero: 0.0,
    };
    calibration
        .set_calibration_parameters(FIRST, parameters)
        .expect("it is allowed");
    calibration
        .calibrate_axis(FIRST, 3, [1.0, 2.0, 3.0])
        .expect("it is allowed");
    board.eventually("the end of the calibration", || {
        calibration.calibration_done(FIRST).expect("it answers")
    });
    let missing = AxisIndex::from(board.total);
    assert!(calibration.calibrate_axis(missing, 3, [0.0; 3]).is_err());
    calibration.calibrate_robot().expect("it is at rest");
    calibration.abort_calibration().expect("it answers");
}

/// Homing moves joints to one place from anywhere; parking can be aborted on the way.
pub fn homing_brings_joints_home(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let calibrator = device.remote_calibrator().expect("it has a calibrator");
    assert!(calibrator.calibrator_present().expect("it answers"));
    calibrator.home(Axes::All).expect("it is allowed");
    let done = || board.position.motion_done(Axes::All).expect("it answers");
    board.eventually("the way home", done);
    let home = board
        .position
        .target_positions(FIRST.into())
        .expect("known")[0];
    board.arrives(FIRST, home);
    let away = board.inward(FIRST);
    board
        .position
        .position_move(FIRST.into(), &[away])
        .expect("it is allowed");
    board.arrives(FIRST, away);
    calibrator.home(FIRST.into()).expect("it is allowed");
    board.arrives(FIRST, home);
    calibrator.calibrate(FIRST.into()).expect("it is at rest");
    calibrator.calibrate(Axes::All).expect("it is at rest");
    calibrator.quit_calibration().expect("it answers");

    let far = board.far_end(FIRST);
    let half = home + (far - home) / 2.0;
    board
        .position
        .position_move(FIRST.into(), &[half])
        .expect("it is allowed");
    board.arrives(FIRST, half);
    calibrator.park(Axes::All).expect("it is allowed");
    board.eventually("a way back under way", || {
        (board.at(FIRST) - half).abs() > POSITION_TOLERANCE
    });
    calibrator.quit_park().expect("it answers");
    board.rests();
    assert!(
        (board.at(FIRST) - home).abs() > POSITION_TOLERANCE,
        "it did not go on"
    );
    calibrator.park(FIRST.into()).expect("it is allowed");
    board.arrives(FIRST, home);
}

/// Variables are listed, read and set by name.
pub fn variables_are_kept(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let remote = device.remote_variables().expect("it has variables");
    let names = remote.variables().expect("it answers");
    assert!(!names.is_empty());
    for name in &names {
        remote.variable(name).expect("each in the list has a value");
    }
    assert!(remote.variable("no such variable").is_err());
    let number = |value: f64| VariableValue::Number(value);
    assert!(
        remote
            .set_variable("no such variable", &[number(1.0)])
            .is_err()
    );
    let frictions = remote.variable("friction").expect("simulated axes have it");
    assert_eq!(frictions.len(), board.total);
    let doubled: Vec<VariableValue> = frictions
        .iter()
        .map(|value| number(2.0 * value.as_number().expect("a number")))
        .collect();
    for wanted in [doubled, frictions] {
        remote
            .set_variable("friction", &wanted)
            .expect("it is allowed");
        assert_eq!(remote.variable("friction").expect("known"), wanted);
    }
}

/// A working joint reports no fault.
pub fn a_joint_that_works_has_no_fault(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let faults = device.joint_fault().expect("it tells faults");
    for axis in board.indices() {
        let fault = faults.last_fault(axis).expect("it answers");
        assert_eq!(fault.code, 0);
        assert!(!fault.message.is_empty());
    }
    assert!(faults.last_fault(board.total.into()).is_err());
}

/// A joint in velocity direct mode takes each velocity it is sent.
pub fn direct_velocities_are_followed(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let direct = device.velocity_direct().expect("it has direct velocities");
    let speed = 4.0_f64.copysign(board.far_end(FIRST) - board.at(FIRST));
    board.set_mode(Mode::VelocityDirect);
    for velocity in [speed, speed / 2.0] {
        direct
            .set_direct_velocities(FIRST.into(), &[velocity])
            .expect("it is allowed");
        board.eventually("the velocity sent", || {
            close(board.reading(FIRST).speed, velocity)
        });
        let reported = direct.direct_velocities(FIRST.into()).expect("it answers");
        assert!(close(one(reported), velocity));
    }
    direct
        .set_direct_velocities(Axes::All, &vec![0.0; board.total])
        .expect("it is allowed");
    board.rests();
    board.set_mode(Mode::Position);
}

/// A braked joint refuses to move; an automatic brake holds an idle joint.
pub fn brakes_hold(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let brakes = device.joint_brake().expect("it has brakes");
    assert!(!brakes.is_braked(FIRST).expect("it answers"));
    brakes.set_manual_brake(FIRST, true).expect("it is allowed");
    assert!(brakes.is_braked(FIRST).expect("it answers"));
    let target = board.inward(FIRST);
    let moved = board.position.position_move(FIRST.into(), &[target]);
    assert!(moved.is_err(), "it is held");
    brakes
        .set_manual_brake(FIRST, false)
        .expect("it is allowed");
    board
        .position
        .position_move(FIRST.into(), &[target])
        .expect("it is free");
    board.arrives(FIRST, target);

    brakes.set_auto_brake(FIRST, true).expect("it is allowed");
    assert!(brakes.auto_brake(FIRST).expect("it answers"));
    assert!(!brakes.is_braked(FIRST).expect("it answers"));
    board.set_mode_of(FIRST, Mode::Idle);
    assert!(brakes.is_braked(FIRST).expect("it answers"));
    brakes.set_auto_brake(FIRST, false).expect("it is allowed");
    assert!(!brakes.is_braked(FIRST).expect("it answers"));
    board.set_mode(Mode::Position);
    assert!(brakes.is_braked(board.total.into()).is_err());
}

/// Each loop that a joint lists describes its gains, joint by joint; a loop that it does not have describes nothing.
pub fn gains_have_units(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let control = device.pid_control().expect("it has control loops");
    let kinds = control.available_pids(FIRST).expect("it answers");
    let mut reported = Vec::new();
    for kind in kinds {
        let all = control.pid_info(kind, Axes::All).expect("it answers");
        assert_eq!(all.len(), board.total);
        let one = control.pid_info(kind, FIRST.into()).expect("it answers");
        assert_eq!(one, all[..1]);
        let info = &one[0];
        for text in [&info.description, &info.input, &info.output] {
            assert!(!text.is_empty(), "{info:?}");
        }
        for unit in [&info.units.kp, &info.units.kd, &info.units.ki] {
            assert!(!unit.is_empty(), "{info:?}");
        }
        assert_eq!(info.units.scale, "", "it is a factor");
        assert_ne!(info.units.kp, info.units.max_output);
        assert!(
            !reported.contains(info),
            "no two loops are the same: {info:?}"
        );
        reported.extend(one);
    }
    let missing = Axes::One(board.total.into());
    assert!(control.pid_info(PidKind::Position, missing).is_err());
    let odd = PidKind::Other(u32::from_le_bytes(*b"pos3"));
    assert!(control.pid_info(odd, FIRST.into()).is_err());
}

/// The listed modes and loops of a joint are those it has, and offsets and feed-forwards are reported as set.
pub fn modes_and_loops_are_listed(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let modes = board
        .modes
        .available_control_modes(FIRST)
        .expect("it answers");
    for mode in &modes {
        board.set_mode_of(FIRST, *mode);
    }
    assert!(modes.contains(&Mode::Position));
    board.set_mode(Mode::Position);
    let control = device.pid_control().expect("it has control loops");
    let kinds = control.available_pids(FIRST).expect("it answers");
    assert!(kinds.contains(&PidKind::Position));
    for kind in kinds {
        for value in [PidValue::Offset, PidValue::Feedforward] {
            for wanted in [0.5, 0.0] {
                control
                    .set_pid_values(kind, value, FIRST.into(), &[wanted])
                    .expect("it is allowed");
                let reported = control.pid_values(kind, value, FIRST.into());
                assert_eq!(one(reported.expect("known")), wanted);
            }
        }
    }
}
