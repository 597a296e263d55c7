//! The interfaces of an arm under control that concern its motors as machines, their amplifiers, and calibration.
//!
//! The safety module switches the amplifiers of all motors at once, so that switching off one is what can be done
//! without it: its joint goes idle. The limits of the pucks are fixed: readable, not settable. A WAM is calibrated by
//! hand, folded in its home pose when it is switched on; an arm that does not know its position cannot be reached at
//! all.

use std::thread;
use std::time::{Duration, Instant};

use super::UNITS_PER_AMPERE;
use super::arm_device::{ArmDevice, ControlledArm};
use crate::can::puck::PuckProperty;
use crate::{
    AmplifierControl, AmplifierLimit, Axes, AxisIndex, CalibrationParameters, ControlCalibration,
    ControlMode, DeviceError, Mode, MotionControl, Motor, PositionControl,
};

/// Longer than any way home takes.
const HOMING_TIMEOUT: Duration = Duration::from_secs(120);
const POLL_INTERVAL: Duration = Duration::from_millis(5);

fn not_supported<T>(what: &str) -> Result<T, DeviceError> {
    Err(DeviceError::NotSupported {
        what: what.to_owned(),
    })
}

/// Temperatures are those of the pucks.
impl<A: ControlledArm<N>, const N: usize> Motor for ArmDevice<A, N> {
    fn temperatures(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        axes.check(N)?;
        let all = self.with(|arm| arm.temperatures())?;
        Ok(axes.iter(N).map(|axis| all[axis.index()]).collect())
    }

    fn temperature_limit(&self, axis: AxisIndex) -> Result<f64, DeviceError> {
        Axes::One(axis).check(N)?;
        A::puck_property(self, axis, PuckProperty::OTEMP).map(f64::from)
    }

    fn set_temperature_limit(&self, axis: AxisIndex, _: f64) -> Result<(), DeviceError> {
        Axes::One(axis).check(N)?;
        not_supported("setting how hot a puck may become")
    }

    /// Negative where the motor turns the other way. Where two motors turn two joints, of the motor of this number and the
    /// joint of this number.
    fn gearbox_ratio(&self, axis: AxisIndex) -> Result<f64, DeviceError> {
        Axes::One(axis).check(N)?;
        let motor = axis.index();
        Ok(self.control(|arm| arm.model().transmission.ratio(motor, motor)))
    }

    fn set_gearbox_ratio(&self, axis: AxisIndex, _: f64) -> Result<(), DeviceError> {
        Axes::One(axis).check(N)?;
        not_supported("another gear")
    }
}

impl<A: ControlledArm<N>, const N: usize> AmplifierControl for ArmDevice<A, N> {
    fn enable_amplifiers(&self, axes: Axes<'_>, enabled: bool) -> Result<(), DeviceError> {
        axes.check(N)?;
        if enabled {
            let check =
                |joint| self.control(|arm| arm.check_ready(joint, "switching its amplifier on"));
            return axes.iter(N).try_for_each(check);
        }
        self.set_control_modes(axes, &vec![Mode::Idle; axes.len(N)])
    }

    /// 0 for a joint that is idle, or that the safety module does not allow to follow torques; 1 for others.
    fn amplifier_status(&self, axes: Axes<'_>) -> Result<Vec<i32>, DeviceError> {
        let modes = self.control_modes(axes)?;
        let is_on = |mode: &Mode| !matches!(mode, Mode::Idle | Mode::HardwareFault);
        Ok(modes.iter().map(|mode| i32::from(is_on(mode))).collect())
    }

    /// The largest current that a puck follows (`MT`), which is also its peak.
    fn amplifier_limit(&self, limit: AmplifierLimit, axis: AxisIndex) -> Result<f64, DeviceError> {
        Axes::One(axis).check(N)?;
        match limit {
            AmplifierLimit::MaxCurrent | AmplifierLimit::PeakCurrent => {
                Ok(self.control(|arm| arm.model().motors[axis.index()].limit / UNITS_PER_AMPERE))
            }
            AmplifierLimit::NominalCurrent => {
                not_supported("a current for ever, which is not published,")
            }
            AmplifierLimit::DutyCycle => not_supported("a largest duty cycle"),
        }
    }

    fn set_amplifier_limit(
        &self,
        _: AmplifierLimit,
        axis: AxisIndex,
        _: f64,
    ) -> Result<(), DeviceError> {
        Axes::One(axis).check(N)?;
        not_supported("setting the limits of a puck")
    }

    fn amplifier_duty_cycle(&self, axis: AxisIndex) -> Result<f64, DeviceError> {
        Axes::One(axis).check(N)?;
        not_supported("telling a duty cycle")
    }

    fn supply_voltage(&self, axis: AxisIndex) -> Result<f64, DeviceError> {
        Axes::One(axis).check(N)?;
        A::puck_property(self, axis, PuckProperty::VBUS).map(f64::from)
    }
}

fn by_hand<T>() -> Result<T, DeviceError> {
    not_supported("calibrating but by folding the arm into its home pose before it is switched on")
}

impl<A: ControlledArm<N>, const N: usize> ControlCalibration for ArmDevice<A, N> {
    fn calibrate_axis(&self, axis: AxisIndex, _: u32, _: [f64; 3]) -> Result<(), DeviceError> {
        Axes::One(axis).check(N)?;
        by_hand()
    }

    fn set_calibration_parameters(
        &self,
        axis: AxisIndex,
        _: CalibrationParameters,
    ) -> Result<(), DeviceError> {
        Axes::One(axis).check(N)?;
        by_hand()
    }

    fn calibration_done(&self, axis: AxisIndex) -> Result<bool, DeviceError> {
        self.control(|arm| arm.state(axis)).map(|_| true)
    }

    fn calibrate_robot(&self) -> Result<(), DeviceError> {
        by_hand()
    }

    /// Home is also the parking position.
    fn park_robot(&self, wait: bool) -> Result<(), DeviceError> {
        let home = self.control(|arm| arm.model().home).map(f64::to_degrees);
        self.position_move(Axes::All, home.as_slice())?;
        let deadline = Instant::now() + HOMING_TIMEOUT;
        while wait && !self.motion_done(Axes::All)? && Instant::now() < deadline {
            thread::sleep(POLL_INTERVAL);
        }
        Ok(())
    }

    /// There is none to end.
    fn abort_calibration(&self) -> Result<(), DeviceError> {
        Ok(())
    }

    fn abort_park(&self) -> Result<(), DeviceError> {
        self.stop(Axes::All)
    }
}
