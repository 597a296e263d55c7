//! Currents of the motors.
//!
//! A puck follows torques in units of which 1024 are 1 A in its motor's windings, so that a torque command to a puck
//! *is* a current, and `1024 / IPNM` Nm/A is the motor's constant. No current is measured: the reported value is the
//! command that was sent.
//!
//! Currents count by motors, as motor encoders do. Two motors turn two joints together in the shoulder (1 and 2 from
//! 0) and in the wrist (4 and 5): either follows a current only while both of its joints are in current mode. Gravity
//! stays compensated, as always, so that the arm does not fall when it is put into current mode: the current in a
//! motor is the commanded one plus that for gravity.

use super::ArmControl;
use crate::kinematics::Joints;
use crate::wam::Motor;
use crate::{Axes, AxisIndex, DeviceError, Limits, Mode};

/// Units of a puck's torque in an ampere (libbarrett; Barrett's properties of pucks).
pub(crate) const UNITS_PER_AMPERE: f64 = 1024.0;

impl<const N: usize> ArmControl<N> {
    /// Replaces the model's motors by the pucks' own description.
    pub fn set_motors(&mut self, motors: [Motor; N]) {
        self.model.motors = motors;
    }

    /// Nm of the motor per A.
    fn torque_constant(&self, motor: usize) -> f64 {
        UNITS_PER_AMPERE / self.model.motors[motor].units_per_newton_metre
    }

    /// Returns the joint torques of the commanded currents, Nm.
    pub(super) fn asked_by_current(&self) -> Joints<N> {
        let motors = Joints::from_fn(|motor, _| self.asked[motor] * self.torque_constant(motor));
        self.model.transmission.joint_torques(&motors)
    }

    /// Forgets the currents of all motors that turn a joint.
    pub(super) fn forget_currents(&mut self, joint: usize) {
        for motor in 0..N {
            if self.model.transmission.turns(motor, joint) {
                self.asked[motor] = 0.0;
            }
        }
    }

    /// Returns the currents that were sent to the motors in the last period, A, including those for gravity.
    ///
    /// Errors: [`DeviceError::NoSuchAxis`], [`DeviceError::Remote`] while the machine cannot be reached.
    pub fn currents(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        axes.check(N)?;
        self.reachable()?;
        let torques = self.model.transmission.motor_torques(&self.driven);
        let one = |axis: AxisIndex| {
            let motor = axis.index();
            let most = self.model.motors[motor].limit / UNITS_PER_AMPERE;
            Limits::new(-most, most).clamp(torques[motor] / self.torque_constant(motor))
        };
        Ok(axes.iter(N).map(one).collect())
    }

    /// Returns the range of a motor's current, A: as far as its puck follows, and no more than what takes the joints
    /// that it turns to the end of their range of torques, all their motors together.
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    pub fn current_range(&self, axis: AxisIndex) -> Result<Limits, DeviceError> {
        Axes::One(axis).check(N)?;
        let motor = axis.index();
        let transmission = &self.model.transmission;
        let most = (0..N)
            .filter(|&joint| transmission.turns(motor, joint))
            .map(|joint| {
                let all: f64 = (0..N)
                    .map(|motor| {
                        transmission.ratio(motor, joint).abs() * self.torque_constant(motor)
                    })
                    .sum();
                self.range_of_loop(joint).max / all
            })
            .fold(self.model.motors[motor].limit / UNITS_PER_AMPERE, f64::min);
        Ok(Limits::new(-most, most))
    }

    /// Same as [`CurrentControl::set_reference_currents`](crate::CurrentControl::set_reference_currents).
    pub fn set_reference_currents(
        &mut self,
        axes: Axes<'_>,
        currents: &[f64],
    ) -> Result<(), DeviceError> {
        axes.check_command(N, "currents", currents.len())?;
        self.check_mode(axes, "current", Mode::Current)?;
        for (axis, &asked) in axes.iter(N).zip(currents) {
            for joint in (0..N).filter(|&joint| self.model.transmission.turns(axis.index(), joint))
            {
                self.check_mode(
                    Axes::One(joint.into()),
                    "the current of a motor that turns it",
                    Mode::Current,
                )?;
            }
            self.current_range(axis)?
                .check(axis, "current", asked, "A")?;
        }
        for (axis, &asked) in axes.iter(N).zip(currents) {
            self.asked[axis.index()] = asked;
        }
        Ok(())
    }

    /// Same as [`CurrentControl::reference_currents`](crate::CurrentControl::reference_currents).
    pub fn reference_currents(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        axes.check(N)?;
        Ok(axes.iter(N).map(|axis| self.asked[axis.index()]).collect())
    }
}
