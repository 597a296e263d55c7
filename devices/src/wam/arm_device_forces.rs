//! The interfaces of an arm under control for torques, currents and compliance.
//!
//! Duty cycles are refused: a puck follows torques, which are currents, and closes the loop about them itself. It has
//! a mode that takes duty cycles (`MODE` 1), but that mode is the safety module's to set: Barrett warns against
//! switching the pucks of an arm individually, and the commands for a puck's duty cycle are not published. The
//! simulated arm is controlled as the real one, so it refuses them as well.

use super::arm_device::{ArmDevice, ControlledArm};
use crate::{
    Axes, AxisIndex, CurrentControl, DeviceError, Impedance, ImpedanceControl, ImpedanceLimits,
    Interaction, InteractionMode, Limits, PwmControl,
};

impl<A: ControlledArm<N>, const N: usize> InteractionMode for ArmDevice<A, N> {
    fn interactions(&self, axes: Axes<'_>) -> Result<Vec<Interaction>, DeviceError> {
        self.control(|arm| arm.interactions(axes))
    }

    fn set_interactions(
        &self,
        axes: Axes<'_>,
        interactions: &[Interaction],
    ) -> Result<(), DeviceError> {
        self.control(|arm| arm.set_interactions(axes, interactions))
    }
}

impl<A: ControlledArm<N>, const N: usize> ImpedanceControl for ArmDevice<A, N> {
    fn impedance(&self, axis: AxisIndex) -> Result<Impedance, DeviceError> {
        self.control(|arm| arm.impedance(axis))
    }

    fn set_impedance(&self, axis: AxisIndex, impedance: Impedance) -> Result<(), DeviceError> {
        self.control(|arm| arm.set_impedance(axis, impedance))
    }

    fn impedance_offset(&self, axis: AxisIndex) -> Result<f64, DeviceError> {
        self.control(|arm| arm.impedance_offset(axis))
    }

    fn set_impedance_offset(&self, axis: AxisIndex, offset: f64) -> Result<(), DeviceError> {
        self.control(|arm| arm.set_impedance_offset(axis, offset))
    }

    fn impedance_limits(&self, axis: AxisIndex) -> Result<ImpedanceLimits, DeviceError> {
        self.control(|arm| arm.impedance_limits(axis))
    }
}

/// Of the motors, without the part for gravity: see [`ArmControl`](super::ArmControl).
impl<A: ControlledArm<N>, const N: usize> CurrentControl for ArmDevice<A, N> {
    fn currents(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.control(|arm| arm.currents(axes))
    }

    fn current_ranges(&self, axes: Axes<'_>) -> Result<Vec<Limits>, DeviceError> {
        axes.check(N)?;
        self.control(|arm| axes.iter(N).map(|axis| arm.current_range(axis)).collect())
    }

    fn set_reference_currents(&self, axes: Axes<'_>, currents: &[f64]) -> Result<(), DeviceError> {
        self.control(|arm| arm.set_reference_currents(axes, currents))
    }

    fn reference_currents(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.control(|arm| arm.reference_currents(axes))
    }
}

fn no_duty_cycles<T>() -> Result<T, DeviceError> {
    Err(DeviceError::NotSupported {
        what: "a duty cycle (the pucks of the arm take currents, and their mode for duty cycles is the safety module's to set; \
               try current mode)"
            .to_owned(),
    })
}

/// Refused, in words.
impl<A: ControlledArm<N>, const N: usize> PwmControl for ArmDevice<A, N> {
    fn duty_cycles(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        axes.check(N)?;
        no_duty_cycles()
    }

    fn set_reference_duty_cycles(
        &self,
        axes: Axes<'_>,
        duty_cycles: &[f64],
    ) -> Result<(), DeviceError> {
        axes.check_command(N, "duty cycles", duty_cycles.len())?;
        no_duty_cycles()
    }

    fn reference_duty_cycles(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        axes.check(N)?;
        no_duty_cycles()
    }
}
