//! The simulated arm behind the driver of its bus is brought up, stopped and switched off like a real one.

use std::time::Duration;

use nalgebra::{Matrix3, Vector3};
use yarp_devices::dynamics::Body;
use yarp_devices::simulation::{SafetyMode, SimulatorOptions};
use yarp_devices::wam::can::CanOptions;
use yarp_devices::wam::{PendantButton, SimulatedCanWam, WamModel};
use yarp_devices::{
    Axes, ControlMode, Device, DeviceError, Encoders, Mode, PositionControl, VariableValue,
};
use yarp_testing::eventually;

const ELBOW: Axes<'static> = Axes::One(yarp_devices::AxisIndex::new(3));

fn switched_on(home_confirmed: bool) -> SimulatedCanWam {
    let options = CanOptions {
        home_confirmed,
        ..CanOptions::default()
    };
    SimulatedCanWam::start(WamModel::<7>::new(), options, SimulatorOptions::real_arm())
        .expect("the arm is there")
}

fn elbow(arm: &SimulatedCanWam) -> Result<f64, DeviceError> {
    Ok(arm.driver().encoder_readings(ELBOW)?[0].position)
}

fn set(arm: &SimulatedCanWam, name: &str, value: VariableValue) -> Result<(), DeviceError> {
    let variables = arm.remote_variables().expect("it has variables");
    variables.set_variable(name, &[value])
}

fn press(arm: &SimulatedCanWam, word: &str) {
    set(arm, "pendant", VariableValue::Text(word.to_owned())).unwrap();
}

fn is_active(arm: &SimulatedCanWam) -> bool {
    arm.driver().status().safety == Some(SafetyMode::Active)
}

/// Moves the elbow, and returns the place of the link that a bystander sees, degrees.
///
/// A machine that is busy for half a second keeps commands from the arm for as long, which its safety module stops like
/// any other: then the pendant is pressed again.
fn move_elbow(arm: &SimulatedCanWam, target: f64) -> f64 {
    eventually("the elbow is there", || {
        let there = elbow(arm).is_ok_and(|now| (now - target).abs() < 0.5);
        if is_active(arm) && !there && arm.driver().motion_done(ELBOW).unwrap_or(true) {
            // Refused if the arm has been stopped just now.
            let _ = arm.driver().position_move(ELBOW, &[target]);
        } else if !is_active(arm) {
            arm.press(PendantButton::Idle);
            arm.press(PendantButton::Activate);
        }
        there
    });
    arm.with_pucks(|pucks| pucks.simulator().angles()[3].to_degrees())
}

/// Folds the arm by hand, and says so.
fn confirm_home(arm: &SimulatedCanWam) {
    let home = WamModel::<7>::new().home;
    arm.with_pucks(|pucks| pucks.simulator_mut().place(&home));
    set(arm, "confirm_home", VariableValue::Integer(1)).unwrap();
}

#[test]
fn nothing_moves_before_somebody_has_confirmed_home_and_activated_the_arm() {
    let arm = switched_on(false);
    let refused = elbow(&arm).unwrap_err().to_string();
    assert!(refused.contains("home"), "{refused}");
    set(&arm, "confirm_home", VariableValue::Integer(1)).unwrap();
    // It is where it was folded, and the motors do not follow yet.
    assert!((elbow(&arm).unwrap() - 3.13_f64.to_degrees()).abs() < 2.0);
    let mut modes = [Mode::Position];
    arm.driver().read_control_modes(ELBOW, &mut modes).unwrap();
    assert_eq!(modes, [Mode::HardwareFault]);
    arm.driver().position_move(ELBOW, &[170.0]).unwrap_err();

    press(&arm, "activate");
    eventually("the arm is active", || is_active(&arm));
    let end = move_elbow(&arm, 165.0);
    assert!((end - 165.0).abs() < 1.5, "{end}");
    assert!((elbow(&arm).unwrap() - end).abs() < 0.5);

    let variables = arm.remote_variables().unwrap();
    assert!(
        variables
            .variables()
            .unwrap()
            .contains(&"pendant".to_owned())
    );
    let mode = variables.variable("pendant").unwrap();
    assert_eq!(mode, [VariableValue::Text("active".to_owned())]);
    let error = set(&arm, "pendant", VariableValue::Text("party".to_owned())).unwrap_err();
    assert!(error.to_string().contains("activate"), "{error}");
}

/// 48 V, of which pucks and safety module report whole volts.
#[test]
fn the_power_supply_is_a_variable_that_pucks_and_safety_module_measure() {
    let arm = switched_on(true);
    let variables = arm.remote_variables().unwrap();
    let names = variables.variables().unwrap();
    assert!(names.contains(&"supply_voltage".to_owned()), "{names:?}");
    let told = |name: &str| variables.variable(name).unwrap();
    assert_eq!(told("supply_voltage"), [VariableValue::Number(48.0)]);
    set(&arm, "supply_voltage", VariableValue::Number(52.5)).unwrap();
    assert_eq!(told("supply_voltage"), [VariableValue::Number(52.5)]);
    // A busy machine may not answer in time.
    let is = |name: &str, expected: &[VariableValue]| {
        variables.variable(name).is_ok_and(|told| told == expected)
    };
    let volts = [(); 7].map(|()| VariableValue::Integer(52));
    eventually("the voltage on the bus", || {
        is("safety.VBUS", &volts[..1]) && is("puck.VBUS", &volts)
    });
    for wrong in [0.0, 101.0, f64::NAN] {
        set(&arm, "supply_voltage", VariableValue::Number(wrong)).unwrap_err();
    }
    assert_eq!(told("supply_voltage"), [VariableValue::Number(52.5)]);
}

#[test]
fn after_an_emergency_stop_the_position_is_lost_until_somebody_confirms_it() {
    let arm = switched_on(true);
    arm.press(PendantButton::Activate);
    eventually("the arm is active", || is_active(&arm));
    move_elbow(&arm, 170.0);
    arm.press(PendantButton::Stop);
    eventually("the position is lost", || {
        arm.driver().status().position_lost.is_some()
    });
    elbow(&arm).unwrap_err();
    arm.press(PendantButton::Idle);
    std::thread::sleep(Duration::from_millis(600));
    elbow(&arm).unwrap_err();
    confirm_home(&arm);
    arm.press(PendantButton::Activate);
    eventually("the arm is active", || is_active(&arm));
    let end = move_elbow(&arm, 170.0);
    assert!((end - 170.0).abs() < 1.5, "{end}");
}

/// Nobody has confirmed home, so that the driver is not connected and sees no active arm.
#[test]
fn an_arm_that_does_not_become_active_is_an_error() {
    let arm = switched_on(false);
    let error = arm.activate().expect_err("it is not active");
    assert!(matches!(error, DeviceError::Start { .. }), "{error}");
}

#[test]
fn an_arm_that_is_switched_off_answers_nothing_and_starts_anew() {
    let arm = switched_on(true);
    arm.press(PendantButton::Activate);
    eventually("the arm is active", || is_active(&arm));
    arm.press(PendantButton::PowerOff);
    eventually("no puck answers", || !arm.driver().status().connected);
    // Without power the buttons do nothing.
    arm.press(PendantButton::Activate);
    let mode = arm.with_pucks(|pucks| pucks.simulator().safety().mode());
    assert_eq!(mode, SafetyMode::Idle);
    arm.press(PendantButton::PowerOn);
    eventually("the position is lost", || {
        arm.driver().status().position_lost.is_some()
    });
    confirm_home(&arm);
    assert!((elbow(&arm).unwrap() - 3.13_f64.to_degrees()).abs() < 2.0);
}

/// It sank by 32 degrees while the pucks woke, and the driver believed that it was at home.
#[test]
fn a_wrist_with_a_hand_is_held_at_home_until_the_driver_knows_where_it_is() {
    let hand = Body {
        mass: 1.2,
        centre: Vector3::new(0.0, 0.0, 0.06),
        inertia: Matrix3::identity() * 0.002,
    };
    let options = CanOptions {
        home_confirmed: true,
        ..CanOptions::default()
    };
    let model = WamModel::<7>::new().with_load(hand);
    let arm = SimulatedCanWam::start(model, options, SimulatorOptions::real_arm()).unwrap();
    arm.activate().unwrap();
    let believed = arm.driver().encoder_readings(Axes::All).unwrap();
    let truth = arm.with_pucks(|pucks| pucks.simulator().angles());
    for (joint, reading) in believed.iter().enumerate() {
        let off = reading.position.to_radians() - truth[joint];
        assert!(off.abs() < 0.05, "joint {joint}: {off} rad");
    }
}
