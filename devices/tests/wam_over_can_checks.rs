//! The arm on its bus keeps the contracts of the interfaces as any machine does.

use std::time::Duration;

use yarp_devices::{Axes, AxisIndex, Device, Mode, TorqueControl, checks};

use crate::can;

use can::memory::Memory;
use can::scenarios::{active, elbow, modes};
use can::{Rig, until};

const TEST_TIMEOUT: Duration = Duration::from_secs(60);
const ELBOW: Axes<'static> = Axes::One(AxisIndex::new(3));

/// Behaviours without exact places hold for this arm as for any device.
#[test]
fn keeps_the_contracts_that_need_no_exact_place() {
    for check in checks::WITHOUT_EXACT_PLACES {
        let rig = Memory::new();
        check(&active(&rig), TEST_TIMEOUT);
    }
}

#[test]
fn torques_push_the_arm_at_the_other_end() {
    let rig = Memory::new();
    let arm = active(&rig);
    let control: &dyn Device = &arm;
    let mode = control.control_mode().expect("it has modes");
    mode.set_control_modes(Axes::All, &[Mode::Torque; 7])
        .unwrap();
    let before = elbow(&rig);
    arm.set_reference_torques(ELBOW, &[-2.0]).unwrap();
    until("an elbow that opens", || elbow(&rig) < before - 5.0);
    mode.set_control_modes(Axes::All, &[Mode::Position; 7])
        .unwrap();
    until("an elbow that stands", || {
        rig.pucks().lock().simulator().velocities()[3].abs() < 0.01
    });
    assert_eq!(modes(&arm), [Mode::Position; 7]);
}

/// An idle joint floats, so that a hand can lead it, and gravity does not.
#[test]
fn an_idle_arm_can_be_led_by_hand() {
    let rig = Memory::new();
    let arm = active(&rig);
    let device: &dyn Device = &arm;
    let mode = device.control_mode().expect("it has modes");
    mode.set_control_modes(Axes::All, &[Mode::Idle; 7]).unwrap();
    let before = elbow(&rig);
    let twist = [0.0, 0.0, 0.0, -2.0, 0.0, 0.0, 0.0];
    rig.pucks().lock().simulator_mut().twist(twist.into());
    until("an elbow that was led", || elbow(&rig) < before - 5.0);
    rig.pucks().lock().simulator_mut().twist([0.0; 7].into());
    until("an elbow that stays", || {
        rig.pucks().lock().simulator().velocities()[3].abs() < 0.001
    });
    assert!(elbow(&rig) < before - 5.0);
}
