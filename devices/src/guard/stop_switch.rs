//! The software stop of a guarded device.

use std::sync::atomic::{AtomicU8, Ordering};

use tracing::warn;

use super::Guarded;
use crate::{
    Axes, AxisIndex, Device, DeviceError, Mode, RemoteCalibrator, SoftwareStop, StopState,
    VariableValue,
};

/// Name of the variable that tells the state.
pub(super) const VARIABLE: &str = "software_stop";

/// The state, shared by callers and the watchdog.
#[derive(Debug, Default)]
pub(super) struct StopSwitch(AtomicU8);

impl StopSwitch {
    pub(super) fn state(&self) -> StopState {
        match self.0.load(Ordering::SeqCst) {
            0 => StopState::Released,
            1 => StopState::Stopped,
            _ => StopState::Braked,
        }
    }

    fn set(&self, state: StopState) {
        self.0.store(state as u8, Ordering::SeqCst);
    }

    pub(super) fn is_engaged(&self) -> bool {
        self.state() != StopState::Released
    }
}

/// Brings every joint that moves, or may be moved, to rest in position mode.
///
/// Goes through all joints even if one cannot be stopped, and returns the first error.
pub(super) fn stop_joints(device: &dyn Device) -> Result<(), DeviceError> {
    let total = device.axis_info().map_or(0, |info| info.axes());
    let mut outcome = Ok(());
    for joint in (0..total).map(AxisIndex::from) {
        let stopped = stop_joint(device, joint);
        if outcome.is_ok() {
            outcome = stopped;
        }
    }
    outcome
}

fn stop_joint(device: &dyn Device, joint: AxisIndex) -> Result<(), DeviceError> {
    let axes = Axes::One(joint);
    let mode = match device.control_mode() {
        Some(modes) => {
            let mut mode = [Mode::UNKNOWN];
            modes.read_control_modes(axes, &mut mode)?;
            mode[0]
        }
        None => Mode::Position,
    };
    match (mode, device.control_mode()) {
        (Mode::Idle | Mode::HardwareFault, _) => Ok(()),
        (Mode::Position, _) | (_, None) => match device.position_control() {
            Some(control) if !control.motion_done(axes)? => control.stop(axes),
            Some(_) => Ok(()),
            None => device
                .motion_control()
                .map_or(Ok(()), |control| control.stop(axes)),
        },
        (_, Some(modes)) => {
            // What a stream has commanded last does not count any more.
            let stopped = match device.motion_control() {
                Some(control) => control.stop(axes),
                None => Ok(()),
            };
            let held = modes.set_control_modes(axes, &[Mode::Position]);
            held.or_else(|_| modes.set_control_modes(axes, &[Mode::Idle]))
                .and(stopped)
        }
    }
}

impl Guarded {
    /// Refuses a command while the software stop is engaged.
    pub(super) fn admit(&self) -> Result<(), DeviceError> {
        if self.watch.stop.is_engaged() {
            return Err(DeviceError::Held {
                joint: AxisIndex::from(0),
                by: "the software stop, as all joints are",
                remedy: "release it with `yarp wam release`",
            });
        }
        Ok(())
    }
}

impl SoftwareStop for Guarded {
    fn stop_motion(&self) -> Result<(), DeviceError> {
        // A brake stays one.
        if !self.watch.stop.is_engaged() {
            self.watch.stop.set(StopState::Stopped);
        }
        self.watch.wake();
        let stopped = self.watch.stop_all();
        self.watch.end_streams(Axes::All, self.total());
        warn!("the software stop is engaged");
        stopped
    }

    fn brake(&self) -> Result<(), DeviceError> {
        let stopped = self.stop_motion();
        let Some(brake) = self.device().machine_brake() else {
            return Err(DeviceError::NotSupported {
                what: "a brake (the joints were stopped and hold)".to_owned(),
            });
        };
        brake.brake_machine()?;
        self.watch.stop.set(StopState::Braked);
        warn!("the machine was told to brake");
        stopped
    }

    fn release(&self) {
        self.watch.stop.set(StopState::Released);
        warn!("the software stop is released");
    }

    fn stop_state(&self) -> StopState {
        self.watch.stop.state()
    }
}

/// The variables of the device, and the state of the software stop.
impl crate::RemoteVariables for Guarded {
    fn variables(&self) -> Result<Vec<String>, DeviceError> {
        let mut names = self.named()?.variables()?;
        names.push(VARIABLE.to_owned());
        Ok(names)
    }

    fn variable(&self, name: &str) -> Result<Vec<VariableValue>, DeviceError> {
        if name == VARIABLE {
            return Ok(vec![VariableValue::Text(self.stop_state().to_string())]);
        }
        self.named()?.variable(name)
    }

    /// Sets a variable; one of them may move the arm, so that none is set while the device is stopped.
    fn set_variable(&self, name: &str, value: &[VariableValue]) -> Result<(), DeviceError> {
        self.admit()?;
        self.named()?.set_variable(name, value)
    }
}

impl RemoteCalibrator for Guarded {
    fn calibrator_present(&self) -> Result<bool, DeviceError> {
        self.calibrator()?.calibrator_present()
    }

    fn calibrate(&self, axes: Axes<'_>) -> Result<(), DeviceError> {
        self.admit()?;
        self.calibrator()?.calibrate(axes)
    }

    fn home(&self, axes: Axes<'_>) -> Result<(), DeviceError> {
        self.admit()?;
        self.calibrator()?.home(axes)
    }

    fn park(&self, axes: Axes<'_>) -> Result<(), DeviceError> {
        self.admit()?;
        self.calibrator()?.park(axes)
    }

    fn quit_calibration(&self) -> Result<(), DeviceError> {
        self.calibrator()?.quit_calibration()
    }

    fn quit_park(&self) -> Result<(), DeviceError> {
        self.calibrator()?.quit_park()
    }
}

impl crate::InteractionMode for Guarded {
    fn interactions(&self, axes: Axes<'_>) -> Result<Vec<crate::Interaction>, DeviceError> {
        self.interaction()?.interactions(axes)
    }

    /// Makes joints stiff or compliant; a stopped joint stays as it is.
    fn set_interactions(
        &self,
        axes: Axes<'_>,
        interactions: &[crate::Interaction],
    ) -> Result<(), DeviceError> {
        self.admit()?;
        self.interaction()?.set_interactions(axes, interactions)
    }
}

impl crate::ControlCalibration for Guarded {
    fn calibrate_axis(
        &self,
        axis: AxisIndex,
        method: u32,
        parameters: [f64; 3],
    ) -> Result<(), DeviceError> {
        self.admit()?;
        self.calibration()?.calibrate_axis(axis, method, parameters)
    }

    fn set_calibration_parameters(
        &self,
        axis: AxisIndex,
        parameters: crate::CalibrationParameters,
    ) -> Result<(), DeviceError> {
        self.calibration()?
            .set_calibration_parameters(axis, parameters)
    }

    fn calibration_done(&self, axis: AxisIndex) -> Result<bool, DeviceError> {
        self.calibration()?.calibration_done(axis)
    }

    fn calibrate_robot(&self) -> Result<(), DeviceError> {
        self.admit()?;
        self.calibration()?.calibrate_robot()
    }

    fn park_robot(&self, wait: bool) -> Result<(), DeviceError> {
        self.admit()?;
        self.calibration()?.park_robot(wait)
    }

    fn abort_calibration(&self) -> Result<(), DeviceError> {
        self.calibration()?.abort_calibration()
    }

    fn abort_park(&self) -> Result<(), DeviceError> {
        self.calibration()?.abort_park()
    }
}
