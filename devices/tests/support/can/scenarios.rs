//! Behaviours of an arm on any bus.

use std::sync::Arc;
use std::time::Duration;

use yarp_devices::can::puck::{Address, Group, Node, PuckMessage, PuckProperty, status};
use yarp_devices::guard::{Guarded, GuardedOptions};
use yarp_devices::simulation::{Fault, SafetyLimits, SafetyMode};
use yarp_devices::wam::WamModel;
use yarp_devices::wam::can::{CanOptions, CanWam};
use yarp_devices::{
    Axes, AxisIndex, ControlMode, DeviceError, Encoders, JointFault, Mode, PositionControl,
    RemoteVariables, SoftwareStop, StopState, VariableValue,
};

use super::{Plug, Rig, Scenario, says, until};

const ELBOW: Axes<'static> = Axes::One(AxisIndex::new(3));
/// Position of the elbow at home, degrees.
const FOLDED: f64 = 179.3;

/// The name of each, and what it does.
pub const ALL: [Scenario; 14] = [
    ("an_arm_is_found_and_moves", an_arm_is_found_and_moves),
    (
        "a_puck_that_falls_silent_is_named_in_every_phase",
        a_puck_that_falls_silent_is_named_in_every_phase,
    ),
    (
        "a_plug_pulled_in_any_phase_names_the_step",
        a_plug_pulled_in_any_phase_names_the_step,
    ),
    (
        "a_plug_pulled_in_a_move_leaves_the_arm_held_until_it_is_found_again",
        a_plug_pulled_in_a_move_leaves_the_arm_held_until_it_is_found_again,
    ),
    (
        "bus_off_is_told_and_the_arm_is_found_again",
        bus_off_is_told_and_the_arm_is_found_again,
    ),
    (
        "a_silent_puck_has_the_arm_braked",
        a_silent_puck_has_the_arm_braked,
    ),
    (
        "a_puck_that_restarts_has_lost_its_position",
        a_puck_that_restarts_has_lost_its_position,
    ),
    (
        "the_safety_module_stops_a_push_and_says_why",
        the_safety_module_stops_a_push_and_says_why,
    ),
    (
        "a_wrong_supply_voltage_stops_the_arm_until_a_person_presses_the_pendant",
        a_wrong_supply_voltage_stops_the_arm_until_a_person_presses_the_pendant,
    ),
    (
        "limits_reach_the_safety_module",
        limits_reach_the_safety_module,
    ),
    ("pucks_answer_callers", pucks_answer_callers),
    (
        "the_software_brake_leaves_the_way_out_to_the_pendant",
        the_software_brake_leaves_the_way_out_to_the_pendant,
    ),
    (
        "a_hot_puck_stops_the_arm_until_it_has_cooled",
        a_hot_puck_stops_the_arm_until_it_has_cooled,
    ),
    (
        "a_puck_in_its_error_state_has_the_arm_braked",
        a_puck_in_its_error_state_has_the_arm_braked,
    ),
];

/// Tries again soon, and knows the rotors' angles at home: the simulated arm sinks onto its stops while it is idle.
pub fn options() -> CanOptions {
    let model = WamModel::<7>::new();
    CanOptions {
        home_confirmed: true,
        home_marks: Some(model.transmission.counts(&model.home)),
        retry_interval: Duration::from_millis(20),
        ..CanOptions::default()
    }
}

pub fn start(rig: &dyn Rig) -> CanWam {
    CanWam::start(WamModel::<7>::new(), options(), rig.open()).expect("the arm is found")
}

/// An arm whose pendant was pressed.
pub fn active(rig: &dyn Rig) -> CanWam {
    let arm = start(rig);
    activate(rig, &arm);
    arm
}

/// Presses the buttons once the arm is connected and at rest, as a careful operator.
pub fn activate(rig: &dyn Rig, arm: &CanWam) {
    until("an arm that stands", || {
        arm.status().connected && rig.pucks().lock().simulator().speed() < 0.05
    });
    rig.pucks().lock().press_idle();
    rig.pucks().lock().press_activate();
    until("position mode once the pendant is pressed", || {
        modes(arm) == [Mode::Position; 7]
    });
}

pub fn modes(arm: &CanWam) -> [Mode; 7] {
    let mut modes = [Mode::UNKNOWN; 7];
    arm.read_control_modes(Axes::All, &mut modes)
        .expect("seven slots");
    modes
}

/// Returns the true position of the elbow, degrees.
pub fn elbow(rig: &dyn Rig) -> f64 {
    rig.pucks().lock().simulator().angles()[3].to_degrees()
}

pub fn move_elbow(rig: &dyn Rig, arm: &CanWam, degrees: f64) {
    arm.set_reference_speeds(ELBOW, &[40.0]).expect("a speed");
    arm.position_move(ELBOW, &[degrees]).expect("it may move");
    until("the end of a move", || arm.motion_done(ELBOW).unwrap());
    let (there, off) = (elbow(rig), (elbow(rig) - degrees).abs());
    assert!(off < 2.0, "it is at {there}, asked for {degrees}");
}

pub fn an_arm_is_found_and_moves(rig: &dyn Rig) {
    let arm = start(rig);
    until("an answer of the safety module", || {
        arm.status().safety.is_some()
    });
    assert_eq!(arm.status().safety, Some(SafetyMode::Idle));
    assert_eq!(modes(&arm), [Mode::HardwareFault; 7]);
    let refused = arm.position_move(ELBOW, &[150.0]);
    assert!(matches!(refused, Err(DeviceError::WrongMode { .. })));
    let why = arm.last_fault(3.into()).unwrap().message;
    assert!(why.contains("Shift and Activate"), "{why}");
    let folded = arm.encoder_readings(ELBOW).unwrap()[0].position;
    assert!((folded - FOLDED).abs() < 2.0, "{folded}");
    activate(rig, &arm);
    assert_eq!(arm.last_fault(3.into()).unwrap().code, 0);
    move_elbow(rig, &arm, 165.0);
    let measured = arm.encoder_readings(ELBOW).unwrap()[0].position;
    assert!(
        (measured - elbow(rig)).abs() < 0.2,
        "{measured}, truly {}",
        elbow(rig)
    );
    drop(arm);
    until("the arm braked as its driver ends", || {
        safety(rig) == SafetyMode::Idle
    });
}

fn safety(rig: &dyn Rig) -> SafetyMode {
    rig.pucks().lock().simulator().safety().mode()
}

/// The first frame of each phase of the start-up, and what the driver calls the phase.
fn phases(node: Node) -> Vec<(&'static str, PuckMessage)> {
    let get = PuckMessage::Get;
    let mut phases = vec![
        ("looking for pucks", get(PuckProperty::STAT)),
        (
            "waking pucks",
            PuckMessage::Value {
                property: PuckProperty::STAT,
                value: status::READY,
            },
        ),
        ("identifying pucks", get(PuckProperty::VERS)),
    ];
    if node == Node::SAFETY {
        phases.push((
            "setting the limits of the safety module",
            get(PuckProperty::VL1),
        ));
        phases.push(("telling the pucks where they are", get(PuckProperty::ZERO)));
    } else {
        phases.push(("reading the units of pucks", get(PuckProperty::CTS)));
        phases.push(("telling the pucks where they are", get(PuckProperty::P)));
    }
    phases
}

/// Runs a function when this message is sent to a node, before it is received.
fn when(rig: &dyn Rig, node: Node, message: PuckMessage, what: impl Fn() + Send + 'static) {
    let address = Address::from_host(node);
    *rig.hook().lock() = Some(Box::new(move |frame| {
        let now = says(frame, address, message);
        if now {
            what();
        }
        now
    }));
}

fn refusal(rig: &dyn Rig) -> String {
    CanWam::start(WamModel::<7>::new(), options(), rig.open())
        .map(|_| ())
        .expect_err("somebody is missing")
        .to_string()
}

pub fn a_puck_that_falls_silent_is_named_in_every_phase(rig: &dyn Rig) {
    for node in [Node::of_motor(4), Node::SAFETY] {
        for (step, message) in phases(node) {
            let pucks = rig.pucks().clone();
            when(rig, node, message, move || {
                pucks.lock().set_silent(node, true);
            });
            let told = refusal(rig);
            assert!(told.contains(step), "{step}: {told}");
            let silent = format!("{node} does not answer");
            assert!(told.contains(&silent), "{step}: {told}");
            rig.pucks().lock().set_silent(node, false);
            switch_off_and_on(rig);
        }
    }
}

/// All pucks restart, so that the next start-up has every phase; safety module included, as far as positions go.
fn switch_off_and_on(rig: &dyn Rig) {
    let mut pucks = rig.pucks().lock();
    for motor in 0..7 {
        pucks.restart_motor(motor);
    }
    pucks.restart_safety();
}

pub fn a_plug_pulled_in_any_phase_names_the_step(rig: &dyn Rig) {
    let node = Node::of_motor(2);
    for (step, message) in phases(node) {
        let switch = rig.switch();
        when(rig, node, message, move || switch(Plug::Pull));
        let told = refusal(rig);
        assert!(told.contains(step), "{step}: {told}");
        (rig.switch())(Plug::PutBack);
        switch_off_and_on(rig);
    }
    let arm = active(rig);
    move_elbow(rig, &arm, 172.0);
}

pub fn a_plug_pulled_in_a_move_leaves_the_arm_held_until_it_is_found_again(rig: &dyn Rig) {
    let arm = active(rig);
    arm.position_move(ELBOW, &[100.0]).unwrap();
    until("the move on its way", || elbow(rig) < 174.0);
    (rig.switch())(Plug::Pull);
    until("the loss noticed", || !arm.status().connected);
    let refused = arm.position_move(ELBOW, &[90.0]).unwrap_err().to_string();
    assert!(refused.contains("the arm on the CAN bus"), "{refused}");
    assert!(refused.contains("down"), "{refused}");
    assert!(arm.encoder_readings(ELBOW).is_err());
    assert_eq!(arm.last_fault(3.into()).unwrap().code, 1);
    until("braked by the missing heartbeat", || {
        safety(rig) == SafetyMode::Idle
    });
    let held = elbow(rig);
    (rig.switch())(Plug::PutBack);
    until("the arm found again", || {
        let status = arm.status();
        status.connected && status.connections == 2
    });
    // Nothing resumes by itself: the pendant decides, and then it holds.
    until("hardware fault", || modes(&arm) == [Mode::HardwareFault; 7]);
    activate(rig, &arm);
    let now = elbow(rig);
    assert!(
        (now - held).abs() < 5.0,
        "it was held at {held}, is at {now}"
    );
    let target = arm.target_positions(ELBOW).unwrap()[0];
    assert!((target - now).abs() < 5.0, "{target} and {now}");
    move_elbow(rig, &arm, now - 4.0);
}

pub fn bus_off_is_told_and_the_arm_is_found_again(rig: &dyn Rig) {
    let arm = active(rig);
    (rig.switch())(Plug::BusOff);
    until("bus-off told", || {
        let error = arm.status().last_error;
        error.is_some_and(|error| error.to_string().contains("bus-off"))
    });
    (rig.switch())(Plug::PutBack);
    until("the arm found again", || {
        let status = arm.status();
        status.connected && status.connections >= 2
    });
    activate(rig, &arm);
    move_elbow(rig, &arm, 172.0);
}

pub fn a_silent_puck_has_the_arm_braked(rig: &dyn Rig) {
    let arm = active(rig);
    for node in [Node::of_motor(4), Node::SAFETY] {
        let found = arm.status().connections;
        rig.pucks().lock().set_silent(node, true);
        until("the loss noticed", || !arm.status().connected);
        let refused = arm.position_move(ELBOW, &[90.0]).unwrap_err().to_string();
        assert!(
            refused.contains(&format!("{node} does not answer")),
            "{refused}"
        );
        if node != Node::SAFETY {
            until("braked", || safety(rig) == SafetyMode::Idle);
        }
        rig.pucks().lock().set_silent(node, false);
        until("the arm found again", || {
            arm.status().connected && arm.status().connections > found
        });
        activate(rig, &arm);
    }
}

pub fn a_puck_that_restarts_has_lost_its_position(rig: &dyn Rig) {
    let arm = active(rig);
    rig.pucks().lock().restart_motor(1);
    until("the lost position told", || {
        let error = arm.status().last_error;
        error.is_some_and(|error| error.to_string().contains("lost its position"))
    });
    rig.pucks().lock().press_activate();
    let refused = arm.position_move(ELBOW, &[90.0]).unwrap_err().to_string();
    assert!(refused.contains("home pose"), "{refused}");
    // Awake again, the puck still does not know where it is.
    rig.pucks().lock().advance_start(Duration::from_secs(3));
    std::thread::sleep(options().retry_interval * 4);
    assert!(!arm.status().connected);
    arm.confirm_home().expect("the arm is found");
    assert!(arm.status().connected && arm.status().position_lost.is_none());
}

pub fn the_safety_module_stops_a_push_and_says_why(rig: &dyn Rig) {
    let arm = active(rig);
    move_elbow(rig, &arm, 160.0);
    rig.pucks()
        .lock()
        .simulator_mut()
        .push([900.0, 900.0, 0.0].into());
    until("a velocity fault", || {
        arm.last_fault(0.into())
            .unwrap()
            .message
            .contains("velocity")
    });
    rig.pucks().lock().simulator_mut().push([0.0; 3].into());
    assert_eq!(modes(&arm), [Mode::HardwareFault; 7]);
    activate(rig, &arm);
    rig.pucks().lock().press_stop();
    until("the red button told", || {
        arm.last_fault(0.into())
            .unwrap()
            .message
            .contains("emergency stop")
    });
    until("the pucks without power", || {
        arm.status().position_lost.is_some()
    });
    rig.pucks().lock().press_idle();
    let refused = arm.position_move(ELBOW, &[90.0]).unwrap_err().to_string();
    assert!(refused.contains("confirm_home"), "{refused}");
}

/// D1001 AH.00, 4.5.2: the module warns below 36 V and above 54 V, and there is a fault below 30 V and above 57 V.
pub fn a_wrong_supply_voltage_stops_the_arm_until_a_person_presses_the_pendant(rig: &dyn Rig) {
    let arm = active(rig);
    let supply = |volts: i32| {
        let mut pucks = rig.pucks().lock();
        pucks.simulator_mut().set_supply_voltage(volts.into());
        drop(pucks);
        until("the voltage on the bus", || {
            let told = arm.variable("safety.VBUS");
            told.is_ok_and(|told| told == [VariableValue::Integer(volts.into())])
        });
    };
    let module = || rig.pucks().lock().simulator().safety().clone();
    let fault = || arm.last_fault(0.into()).unwrap().message;
    for (name, volts) in [
        ("safety.VOLTL1", 36),
        ("safety.VOLTL2", 30),
        ("safety.VOLTH1", 54),
        ("safety.VOLTH2", 57),
    ] {
        let told = arm.variable(name).expect("it answers");
        assert_eq!(told, [VariableValue::Integer(volts)], "{name}");
    }
    for (warning, wrong, elbow) in [(31, 29, 160.0), (56, 58, 150.0)] {
        supply(warning);
        assert_eq!(module().mode(), SafetyMode::Active, "{warning} V");
        assert!(module().warnings().voltage, "{warning} V");
        supply(wrong);
        until("a voltage fault", || fault().contains("idle (voltage)"));
        let told = fault();
        assert!(told.contains("power supply"), "{told}");
        assert!(told.contains("Shift and Activate"), "{told}");
        assert_eq!(modes(&arm), [Mode::HardwareFault; 7]);
        arm.position_move(ELBOW, &[90.0]).unwrap_err();
        // Pressed before the supply is repaired, the module trips again.
        rig.pucks().lock().press_idle();
        rig.pucks().lock().press_activate();
        until("the next fault", || {
            module().mode() == SafetyMode::Idle
                && matches!(module().fault(), Some(Fault::Voltage { .. }))
        });
        // Repaired, the arm stays idle until the pendant is pressed.
        supply(48);
        let periods = arm.status().periods;
        until("some periods", || arm.status().periods > periods + 50);
        assert_eq!(module().mode(), SafetyMode::Idle);
        assert_eq!(modes(&arm), [Mode::HardwareFault; 7]);
        assert!(fault().contains("idle (voltage)"), "{}", fault());
        activate(rig, &arm);
        move_elbow(rig, &arm, elbow);
    }
    assert!(arm.status().position_lost.is_none() && arm.status().loss.is_none());
}

pub fn limits_reach_the_safety_module(rig: &dyn Rig) {
    let limits = SafetyLimits {
        velocity_warning: 0.25,
        velocity_fault: 0.75,
        torque_warning: 500.0,
        torque_fault: 1000.0,
        ..SafetyLimits::default()
    };
    let options = CanOptions {
        limits,
        ..options()
    };
    let arm = CanWam::start(WamModel::<7>::new(), options, rig.open()).expect("the arm is found");
    assert_eq!(rig.pucks().lock().simulator().safety().limits(), limits);
    activate(rig, &arm);
    // The elbow's motor cannot have as much as this takes.
    let mut gains = arm.control(|arm| arm.gains(3.into())).unwrap();
    gains.proportional *= 100.0;
    arm.control(|arm| arm.set_gains(3.into(), gains)).unwrap();
    arm.position_move(ELBOW, &[120.0]).unwrap();
    until("a torque fault", || {
        arm.last_fault(0.into()).unwrap().message.contains("torque")
    });
}

/// Queries of callers are sent over the bus beside control, with the arm idle and active.
pub fn pucks_answer_callers(rig: &dyn Rig) {
    let arm = start(rig);
    let turns = vec![VariableValue::Integer(4096); 7];
    assert_eq!(arm.variable("puck.CTS").expect("they answer"), turns);
    activate(rig, &arm);
    assert_eq!(arm.variable("puck.CTS").expect("they answer"), turns);
    let closer = [VariableValue::Integer(2048)];
    arm.set_variable("safety.VL2", &closer)
        .expect("it is taken");
    let limits = rig.pucks().lock().simulator().safety().limits();
    assert_eq!(limits.velocity_fault, 0.5);
    assert_eq!(arm.status().connections, 1);
}

/// A brake idles the safety module once; a release does not undo it, and the pendant does.
pub fn the_software_brake_leaves_the_way_out_to_the_pendant(rig: &dyn Rig) {
    let arm = Arc::new(active(rig));
    let guarded = Guarded::around(Arc::clone(&arm) as _, GuardedOptions::default()).unwrap();
    arm.position_move(ELBOW, &[100.0]).unwrap();
    until("the move on its way", || elbow(rig) < 174.0);
    guarded.brake().unwrap();
    assert_eq!(guarded.stop_state(), StopState::Braked);
    until("the arm braked", || safety(rig) == SafetyMode::Idle);
    until("hardware fault", || modes(&arm) == [Mode::HardwareFault; 7]);
    guarded.release();
    assert!(arm.position_move(ELBOW, &[100.0]).is_err());
    assert_eq!(safety(rig), SafetyMode::Idle);
    activate(rig, &arm);
    let now = elbow(rig);
    move_elbow(rig, &arm, now - 4.0);
    assert_eq!(arm.status().connections, 1);
    // An arm that is out of reach is told nothing.
    (rig.switch())(Plug::Pull);
    until("the loss noticed", || !arm.status().connected);
    let refused = guarded.brake().unwrap_err().to_string();
    assert!(refused.contains("the arm on the CAN bus"), "{refused}");
}

/// Returns whether a frame has torques in it.
pub fn is_torque(frame: &yarp_devices::can::CanFrame) -> bool {
    [Group::LOWER_TORQUES, Group::UPPER_TORQUES]
        .iter()
        .any(|&group| frame.id() == Address::from_host(group).id())
}

/// The limit of a simulated puck is 60 degrees, as btclient and owd set it.
pub fn a_hot_puck_stops_the_arm_until_it_has_cooled(rig: &dyn Rig) {
    const HOT: usize = 2;
    let arm = active(rig);
    let heat = |degrees: i32| {
        rig.pucks().lock().set_temperature(HOT, Some(degrees));
        until("the temperature", || {
            arm.status().temperatures[HOT] == Some(degrees)
        });
    };
    let elbow_moves = |degrees: f64| arm.position_move(ELBOW, &[degrees]);
    heat(59);
    elbow_moves(100.0).expect("it is warm, no more");
    until("motion", || elbow(rig) < FOLDED - 3.0);
    heat(60);
    until("rest", || rig.pucks().lock().simulator().speed() < 0.01);
    assert!(elbow(rig) > 101.0, "it went on to {}", elbow(rig));
    assert_eq!(modes(&arm), [Mode::Position; 7]);
    for held in [60, 55, 51] {
        heat(held);
        let refused = elbow_moves(90.0).expect_err("it is too hot").to_string();
        assert!(
            refused.contains("puck 3") && refused.contains("60 °C"),
            "{refused}"
        );
        assert!(refused.contains("cool to 50 °C"), "{refused}");
        let torque = arm.set_control_modes(ELBOW, &[Mode::Torque]);
        assert!(torque.is_err());
        assert!(arm.status().to_string().contains("puck 3"));
        let fault = arm.last_fault(0.into()).expect("joint 1");
        assert!(
            fault.code == 1 && fault.message.contains("puck 3"),
            "{fault:?}"
        );
    }
    // It is to be switched off all the same.
    arm.set_control_modes(ELBOW, &[Mode::Idle]).expect("idle");
    arm.set_control_modes(ELBOW, &[Mode::Position])
        .expect_err("it would hold");
    heat(50);
    arm.set_control_modes(ELBOW, &[Mode::Position])
        .expect("it has cooled");
    elbow_moves(95.0).expect("it has cooled");
    // At 70 degrees the arm is braked, and again if somebody activates it.
    heat(70);
    let mode = || rig.pucks().lock().simulator().safety().mode();
    until("the brake", || mode() == SafetyMode::Idle);
    rig.pucks().lock().press_activate();
    until("the brake again", || mode() == SafetyMode::Idle);
    assert!(arm.status().connected);
}

pub fn a_puck_in_its_error_state_has_the_arm_braked(rig: &dyn Rig) {
    let arm = active(rig);
    rig.pucks().lock().set_error(4, Some(9));
    until("the loss", || !arm.status().connected);
    until("the brake", || {
        rig.pucks().lock().simulator().safety().mode() == SafetyMode::Idle
    });
    let refused = arm.position_move(ELBOW, &[100.0]).expect_err("it is lost");
    let refused = refused.to_string();
    assert!(
        refused.contains("puck 5") && refused.contains("error state"),
        "{refused}"
    );
    // The next attempt names it again, with the value of ERROR.
    until("the value", || {
        let error = arm.status().last_error;
        error.is_some_and(|error| error.to_string().contains("with 9 as ERROR"))
    });
    assert!(arm.status().position_lost.is_none());
    rig.pucks().lock().set_error(4, None);
    until("the arm", || arm.status().connected);
    activate(rig, &arm);
    move_elbow(rig, &arm, 150.0);
}
