//! The software stop ends motion in every control mode, keeps commands away until it is released, and does not wait for
//! clients that flood the device.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use yarp_devices::guard::{Guarded, GuardedOptions};
use yarp_devices::wam::{DynamicWam, SimulatedWam};
use yarp_devices::{
    Axes, AxisIndex, Device, DeviceError, Mode, SoftwareStop, StopState, VariableValue,
};
use yarp_testing::eventually;

const ELBOW: Axes<'static> = Axes::One(AxisIndex::new(3));

/// No guard but the stop.
fn unlimited(device: Arc<dyn Device>) -> Guarded {
    Guarded::around(device, GuardedOptions::default()).unwrap()
}

fn mode(arm: &dyn Device) -> Mode {
    arm.control_mode().unwrap().control_modes(ELBOW).unwrap()[0]
}

fn speed(arm: &dyn Device) -> f64 {
    arm.encoders().unwrap().encoder_readings(ELBOW).unwrap()[0].speed
}

fn place(arm: &dyn Device) -> f64 {
    arm.encoders().unwrap().encoder_readings(ELBOW).unwrap()[0].position
}

/// Commands the elbow in a mode so that it moves.
fn command(arm: &dyn Device, mode: Mode) -> Result<(), DeviceError> {
    match mode {
        Mode::Position => arm
            .position_control()
            .unwrap()
            .position_move(ELBOW, &[20.0]),
        Mode::Velocity => arm
            .velocity_control()
            .unwrap()
            .velocity_move(ELBOW, &[-15.0]),
        Mode::PositionDirect => {
            let next = place(arm) - 0.5;
            arm.position_direct()
                .unwrap()
                .set_direct_positions(ELBOW, &[next])
        }
        Mode::Torque => arm
            .torque_control()
            .unwrap()
            .set_reference_torques(ELBOW, &[-3.0]),
        Mode::Current => arm
            .current_control()
            .unwrap()
            .set_reference_currents(ELBOW, &[0.5]),
        other => panic!("{other}"),
    }
}

fn is_held(outcome: Result<(), DeviceError>) -> bool {
    match outcome {
        Err(error @ DeviceError::Held { .. }) => error.to_string().contains("yarp wam release"),
        _ => false,
    }
}

#[test]
fn motion_ends_in_every_control_mode_and_commands_are_refused_until_release() {
    for commanded in [
        Mode::Position,
        Mode::Velocity,
        Mode::PositionDirect,
        Mode::Torque,
        Mode::Current,
    ] {
        let arm = unlimited(Arc::new(DynamicWam::start().unwrap()));
        let control = arm.position_control().unwrap();
        control.set_reference_speeds(ELBOW, &[100.0]).unwrap();
        control.position_move(ELBOW, &[130.0]).unwrap();
        eventually("arrival", || control.motion_done(ELBOW).unwrap());
        control.set_reference_speeds(ELBOW, &[20.0]).unwrap();
        let modes = arm.control_mode().unwrap();
        modes.set_control_modes(ELBOW, &[commanded]).unwrap();
        command(&arm, commanded).unwrap();
        eventually("motion", || {
            if commanded == Mode::PositionDirect {
                command(&arm, commanded).unwrap();
            }
            speed(&arm).abs() > 4.0
        });
        arm.stop_motion().unwrap();
        assert_eq!(arm.stop_state(), StopState::Stopped);
        eventually("rest", || {
            speed(&arm).abs() < 1.0 && mode(&arm) == Mode::Position
        });
        assert!(is_held(command(&arm, commanded)), "{commanded}");
        assert!(is_held(modes.set_control_modes(ELBOW, &[commanded])));
        assert!(is_held(modes.set_control_modes(ELBOW, &[Mode::ForceIdle])));
        let load = vec![VariableValue::Number(0.0); 4];
        let variables = arm.remote_variables().unwrap();
        assert!(is_held(variables.set_variable("compensated_load", &load)));
        let told = variables.variable("software_stop").unwrap();
        assert_eq!(told, [VariableValue::Text("stopped".into())]);
        let here = place(&arm);
        arm.release();
        assert_eq!(arm.stop_state(), StopState::Released);
        assert!((place(&arm) - here).abs() < 1.0, "nothing moves by itself");
        arm.position_control()
            .unwrap()
            .position_move(ELBOW, &[100.0])
            .unwrap();
    }
}

#[test]
fn a_client_that_floods_the_device_does_not_keep_the_stop_away() {
    let arm = Arc::new(unlimited(Arc::new(SimulatedWam::new())));
    let modes = arm.control_mode().unwrap();
    modes.set_control_modes(ELBOW, &[Mode::Velocity]).unwrap();
    let ending = Arc::new(AtomicBool::new(false));
    let clients: Vec<_> = (0..4)
        .map(|_| {
            let (arm, ending) = (arm.clone(), ending.clone());
            thread::spawn(move || {
                let mut refused = 0_u64;
                while !ending.load(Ordering::Relaxed) {
                    let modes = arm.control_mode().unwrap();
                    let asked = modes.set_control_modes(ELBOW, &[Mode::Velocity]);
                    let moved = arm
                        .velocity_control()
                        .unwrap()
                        .velocity_move(ELBOW, &[-5.0]);
                    refused += u64::from(is_held(asked)) + u64::from(is_held(moved));
                }
                refused
            })
        })
        .collect();
    eventually("motion", || speed(arm.as_ref()) < -1.0);
    arm.stop_motion().unwrap();
    eventually("rest", || {
        speed(arm.as_ref()) == 0.0 && mode(arm.as_ref()) == Mode::Position
    });
    let here = place(arm.as_ref());
    ending.store(true, Ordering::Relaxed);
    for client in clients {
        assert!(client.join().unwrap() > 0);
    }
    assert_eq!(place(arm.as_ref()), here);
}

/// A command that was admitted before the stop, and reaches the device after it.
#[test]
fn a_command_that_overtakes_the_stop_is_stopped_too() {
    let device = Arc::new(SimulatedWam::new());
    let arm = unlimited(device.clone());
    arm.stop_motion().unwrap();
    let modes = device.control_mode().unwrap();
    modes.set_control_modes(ELBOW, &[Mode::Velocity]).unwrap();
    // The watchdog may have been faster already.
    let _ = device
        .velocity_control()
        .unwrap()
        .velocity_move(ELBOW, &[20.0]);
    eventually("rest", || {
        speed(device.as_ref()) == 0.0 && mode(device.as_ref()) == Mode::Position
    });
}

#[test]
fn the_brake_leaves_the_way_out_to_the_pendant() {
    let device = Arc::new(DynamicWam::start().unwrap());
    let arm = unlimited(device.clone());
    arm.brake().unwrap();
    assert_eq!(arm.stop_state(), StopState::Braked);
    eventually("the fault", || mode(&arm) == Mode::HardwareFault);
    // A stop on top of it is no way out.
    arm.stop_motion().unwrap();
    assert_eq!(arm.stop_state(), StopState::Braked);
    arm.release();
    assert_eq!(mode(&arm), Mode::HardwareFault);
    assert!(command(&arm, Mode::Position).is_err());
    device.with(|arm| arm.safety_mut().press_activate());
    eventually("an active arm", || mode(&arm) != Mode::HardwareFault);
}

#[test]
fn the_brake_does_not_lead_out_of_an_emergency_stop() {
    let device = Arc::new(DynamicWam::start().unwrap());
    let arm = unlimited(device.clone());
    device.with(|arm| arm.safety_mut().press_stop());
    arm.brake().unwrap();
    device.with(|arm| arm.safety_mut().press_activate());
    thread::sleep(Duration::from_millis(20));
    assert_eq!(mode(&arm), Mode::HardwareFault);
}

#[test]
fn a_machine_without_a_brake_is_stopped_and_says_so() {
    let arm = unlimited(Arc::new(SimulatedWam::new()));
    let refused = arm.brake().unwrap_err().to_string();
    assert!(refused.contains("stopped and hold"), "{refused}");
    assert_eq!(arm.stop_state(), StopState::Stopped);
    assert!(is_held(command(&arm, Mode::Position)));
}
