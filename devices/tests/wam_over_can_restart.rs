//! A driver that starts again believes pucks that have kept their positions, if a record of an earlier driver agrees, and
//! corrects the folded pose by the angles of the rotors as libbarrett does.

use std::path::PathBuf;

use yarp_devices::can::CanFrame;
use yarp_devices::can::puck::{Address, Node, PuckMessage, PuckProperty};
use yarp_devices::kinematics::Joints;
use yarp_devices::wam::WamModel;
use yarp_devices::wam::can::{CanErrorKind, CanOptions, CanWam};
use yarp_devices::{Axes, Encoders, RemoteVariables, VariableValue};

use crate::can;

use can::memory::Memory;
use can::scenarios::{activate, move_elbow, options};
use can::{Rig, until};

/// Returns options with a record in a file of this name, and nobody who confirms.
fn with_record(name: &str) -> CanOptions {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_file(&path);
    CanOptions {
        home_confirmed: false,
        home_marks: None,
        position_file: Some(path),
        ..options()
    }
}

fn start(rig: &Memory, options: CanOptions) -> CanWam {
    CanWam::start(WamModel::<7>::new(), options, rig.open()).expect("the pucks answer")
}

/// Leaves an arm with its elbow at 150 degrees, and no driver; returns options for the next one.
fn left_elsewhere(rig: &Memory, name: &str) -> CanOptions {
    left_at(rig, name, 150.0)
}

fn left_at(rig: &Memory, name: &str, elbow: f64) -> CanOptions {
    let options = with_record(name);
    let arm = start(rig, options.clone());
    arm.confirm_home().expect("it is folded");
    activate(rig, &arm);
    move_elbow(rig, &arm, elbow);
    drop(arm);
    options
}

fn lost(arm: &CanWam) -> CanErrorKind {
    assert!(!arm.status().connected);
    assert!(arm.encoder_readings(Axes::All).is_err());
    arm.status().position_lost.expect("it is lost").kind
}

#[test]
fn kept_positions_are_believed_without_a_confirmation() {
    let rig = Memory::new();
    let options = left_elsewhere(&rig, "kept");
    let arm = start(&rig, options.clone());
    until("a position", || arm.encoder_readings(Axes::All).is_ok());
    let truth = rig.pucks().lock().simulator().angles()[3].to_degrees();
    let believed = arm.encoder_readings(Axes::One(3.into())).unwrap()[0].position;
    assert!((believed - truth).abs() < 1.0, "{believed}, not {truth}");
    drop(arm);
    // Without the record nobody knows that the pucks were told right.
    std::fs::remove_file(options.position_file.as_ref().unwrap()).expect("it was written");
    let arm = start(&rig, options);
    assert_eq!(lost(&arm), CanErrorKind::HomeUnconfirmed);
}

/// The puck is awake again, and counts from inside its first turn.
#[test]
fn a_puck_that_restarted_meanwhile_is_noticed() {
    for motor in [3, 6] {
        let rig = Memory::new();
        let options = left_elsewhere(&rig, &format!("restarted{motor}"));
        // Joint 7 near zero: its count hardly changes by a restart, but its origin does.
        let mut pose = rig.pucks().lock().simulator().angles();
        pose[6] = 0.01;
        rig.pucks().lock().simulator_mut().place(&pose);
        let path = options.position_file.clone().unwrap();
        let record = std::fs::read_to_string(&path).expect("it was written");
        rig.pucks().lock().restart_motor(motor);
        rig.pucks()
            .lock()
            .advance_start(std::time::Duration::from_secs(3));
        let arm = start(&rig, options);
        assert!(
            matches!(
                lost(&arm),
                CanErrorKind::CountsChanged { .. } | CanErrorKind::OriginChanged { .. }
            ),
            "motor {motor}: {:?}, {record}",
            arm.status().position_lost
        );
    }
}

/// The pucks were told other positions by another program, within the plausible motion.
#[test]
fn a_puck_that_another_program_told_its_position_is_noticed() {
    let rig = Memory::new();
    let options = left_elsewhere(&rig, "told");
    let base = Node::of_motor(0);
    let told = PuckMessage::Value {
        property: PuckProperty::P,
        value: 1500,
    };
    let frame = told.frame(Address::from_host(base));
    rig.pucks().lock().receive(&frame, &mut Vec::new());
    let arm = start(&rig, options);
    assert_eq!(lost(&arm), CanErrorKind::OriginChanged { node: base });
}

#[test]
fn a_confirmation_that_the_pucks_contradict_is_refused() {
    let rig = Memory::new();
    let options = CanOptions {
        home_confirmed: true,
        position_file: None,
        ..left_elsewhere(&rig, "contradicted")
    };
    let arm = start(&rig, options);
    let why = lost(&arm);
    assert!(
        matches!(why, CanErrorKind::HomeContradicted { joint: 3, .. }),
        "{why:?}"
    );
    // Later, beside the arm, somebody folds it and says so.
    let home = WamModel::<7>::new().home;
    rig.pucks().lock().simulator_mut().place(&home);
    arm.confirm_home().expect("it connects");
}

/// A tenth of a radian is how a person folds an arm; more than 0.2 rad is not home.
#[test]
fn how_far_from_home_a_confirmed_arm_may_be() {
    for (elbow, is_home) in [(172.0, true), (165.0, false)] {
        let rig = Memory::new();
        let options = CanOptions {
            home_confirmed: true,
            position_file: None,
            ..left_at(&rig, &format!("near{elbow}"), elbow)
        };
        let arm = start(&rig, options);
        assert_eq!(arm.status().position_lost.is_none(), is_home, "{elbow}");
    }
}

/// The angle and the position of a rotor are read one after the other, so that up to a sixteenth of a turn, 256 counts, is
/// no other origin.
#[test]
fn how_far_the_origin_of_a_puck_may_change() {
    for (by, is_same) in [(200, true), (-200, true), (300, false), (-300, false)] {
        let rig = Memory::new();
        let options = left_elsewhere(&rig, &format!("origin{by}"));
        let base = Node::of_motor(0);
        let address = Address::from_host(base);
        let mut answers = Vec::new();
        let question = PuckMessage::Get(PuckProperty::P).frame(address);
        rig.pucks().lock().receive(&question, &mut answers);
        let Ok((_, PuckMessage::Position { motor, .. })) = PuckMessage::read(&answers[0]) else {
            panic!("{answers:?}");
        };
        let told = PuckMessage::Value {
            property: PuckProperty::P,
            value: motor + by,
        };
        rig.pucks()
            .lock()
            .receive(&told.frame(address), &mut answers);
        let arm = start(&rig, options);
        let lost = arm.status().position_lost.map(|error| error.kind);
        let expected = (!is_same).then_some(CanErrorKind::OriginChanged { node: base });
        assert_eq!(lost, expected, "{by}");
    }
}

#[test]
fn a_lost_position_is_not_kept_for_the_next_driver() {
    let rig = Memory::new();
    let options = with_record("lost");
    let path = options.position_file.clone().unwrap();
    let arm = start(&rig, options);
    arm.confirm_home().expect("it is folded");
    until("a record", || path.exists());
    rig.pucks().lock().press_stop();
    until("the loss", || arm.status().position_lost.is_some());
    drop(arm);
    assert!(!path.exists());
}

/// Starts an arm 2.3 degrees off home at the base and 4 at the wrist, with these zero angles; returns how far the believed
/// joints are off the truth, degrees.
fn off_by(rig: &Memory, zero_angles: [f64; 7]) -> [f64; 7] {
    let mut pose = WamModel::<7>::new().home;
    pose[0] += 0.04;
    pose[4] += 0.07;
    rig.pucks().lock().simulator_mut().place(&pose);
    let options = CanOptions {
        home_marks: None,
        home_confirmed: false,
        ..options()
    };
    let arm = start(rig, options);
    let angles = zero_angles.map(VariableValue::Number);
    arm.set_variable("zero_angles", &angles).expect("seven");
    assert_eq!(arm.variable("zero_angles").unwrap(), angles);
    arm.set_variable("confirm_home", &[VariableValue::Integer(1)])
        .expect("it connects");
    let truth: Joints<7> = rig.pucks().lock().simulator().angles();
    let believed = arm.encoder_readings(Axes::All).expect("it is connected");
    std::array::from_fn(|joint| believed[joint].position - truth[joint].to_degrees())
}

/// The simulated rotors read 0 with the joints at zero, and those of motors 2 to 4 not at home.
#[test]
fn zero_angles_correct_the_folded_pose() {
    let off = off_by(&Memory::new(), [0.0; 7]);
    assert!(off.iter().all(|off| off.abs() < 0.5), "{off:?}");
}

#[test]
fn motors_without_a_zero_angle_are_assumed_at_home() {
    let mut angles = [0.0; 7];
    angles[0] = 6.3;
    let off = off_by(&Memory::new(), angles);
    assert!((off[0] + 2.3).abs() < 0.3, "{off:?}");
    assert!(off[4].abs() < 0.5, "{off:?}");
}

/// Returns a bus on which the puck of motor 1 answers otherwise.
fn answering(property: PuckProperty, value: i32) -> Memory {
    let rig = Memory::new();
    let replace = move |frame: CanFrame| match PuckMessage::read(&frame) {
        Ok((address, PuckMessage::Value { property: of, .. }))
            if of == property && address.from == Node::of_motor(0) =>
        {
            PuckMessage::Value { property, value }.frame(address)
        }
        _ => frame,
    };
    rig.wire().lock().noise = Some(Box::new(move |answers| {
        answers.into_iter().map(replace).collect()
    }));
    rig
}

/// libbarrett: firmware 118 tells the absolute angle of its rotor.
#[test]
fn motors_with_firmware_118_are_corrected() {
    let off = off_by(&answering(PuckProperty::VERS, 118), [0.0; 7]);
    assert!(off.iter().all(|off| off.abs() < 0.5), "{off:?}");
}

/// Firmware before 118, and pucks whose role has no absolute encoder.
#[test]
fn motors_without_an_absolute_encoder_are_assumed_at_home() {
    for (property, value) in [(PuckProperty::VERS, 117), (PuckProperty::ROLE, 0x0400)] {
        let rig = answering(property, value);
        let off = off_by(&rig, [0.0; 7]);
        assert!((off[0] + 2.3).abs() < 0.3, "{property}: {off:?}");
        assert!(off[4].abs() < 0.5, "{property}: {off:?}");
    }
}
