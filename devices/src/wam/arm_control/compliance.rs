//! Joints that yield: a spring and a damper about the set point, in the place of the position loop.
//!
//! ```text
//! torque = stiffness · (set point − position) + damping · (its speed − speed) + offset
//! ```
//!
//! limited to the output of the position loop; gravity is compensated in addition. There is no torque sensor: what
//! friction of joint and cables takes is not felt, so that a joint stays up to friction over stiffness off its set
//! point.

use super::{ArmControl, Stream};
use crate::simulation::JointCommand;
use crate::{Axes, AxisIndex, DeviceError, Impedance, ImpedanceLimits, Interaction, Limits, Mode};

/// Default softness of a joint, relative to its position loop.
const DEFAULT_SOFTNESS: f64 = 10.0;

/// Compliance of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Compliance {
    yields: bool,
    impedance: Impedance,
    /// Nm.
    offset: f64,
}

impl Compliance {
    /// Returns a stiff joint, whose impedance is a tenth of the maximum.
    pub(super) fn stiff(limits: ImpedanceLimits) -> Self {
        Self {
            yields: false,
            impedance: Impedance {
                stiffness: limits.stiffness.max / DEFAULT_SOFTNESS,
                damping: limits.damping.max,
            },
            offset: 0.0,
        }
    }

    /// Makes it stiff; its impedance stays.
    pub(super) fn stiffen(&mut self) {
        self.yields = false;
    }
}

impl<const N: usize> ArmControl<N> {
    /// Returns the command that drives a joint to a position, degrees, that moves with a speed.
    pub(super) fn towards(&self, joint: usize, place: f64, speed: f64) -> JointCommand {
        let compliance = &self.compliance[joint];
        if !compliance.yields {
            return JointCommand::At(place.to_radians());
        }
        let now = &self.measured[joint];
        let Impedance { stiffness, damping } = compliance.impedance;
        let torque = stiffness * (place - now.position)
            + damping * (speed - now.velocity)
            + compliance.offset;
        JointCommand::Drive(self.range_of_loop(joint).clamp(torque))
    }

    /// Same as [`InteractionMode::interactions`](crate::InteractionMode::interactions).
    pub fn interactions(&self, axes: Axes<'_>) -> Result<Vec<Interaction>, DeviceError> {
        axes.check(N)?;
        let one = |axis: AxisIndex| match self.compliance[axis.index()].yields {
            true => Interaction::Compliant,
            false => Interaction::Stiff,
        };
        Ok(axes.iter(N).map(one).collect())
    }

    /// Same as [`InteractionMode::set_interactions`](crate::InteractionMode::set_interactions).
    ///
    /// It counts where a joint has a set point: in position, position direct and velocity mode. A joint made stiff
    /// holds its displaced position, and does not snap back. While the machine is not ready all joints become stiff.
    pub fn set_interactions(
        &mut self,
        axes: Axes<'_>,
        interactions: &[Interaction],
    ) -> Result<(), DeviceError> {
        axes.check_command(N, "interaction modes", interactions.len())?;
        self.accepts()?;
        for (joint, interaction) in axes.iter(N).zip(interactions) {
            if let Interaction::Unknown(_) = interaction {
                return Err(DeviceError::NotSupported {
                    what: "an interaction mode that is neither stiff nor compliant".to_owned(),
                });
            }
            self.check_ready(joint, "a change of interaction mode")?;
        }
        for (axis, &interaction) in axes.iter(N).zip(interactions) {
            let yields = interaction == Interaction::Compliant;
            let yielded = std::mem::replace(&mut self.compliance[axis.index()].yields, yields);
            if yielded && !yields {
                self.hold_here(axis);
            }
        }
        Ok(())
    }

    /// Holds a joint that has a set point at its position.
    fn hold_here(&mut self, axis: AxisIndex) {
        match (self.mode(axis), &mut self.streams[axis.index()]) {
            (_, stream @ Stream::Position { .. }) => {
                *stream = Stream::at(self.measured[axis.index()].position);
            }
            (mode @ (Mode::Position | Mode::Velocity), Stream::None) => {
                self.rest(axis);
                self.set_mode_of_set_point(axis, mode);
            }
            _ => {}
        }
    }

    /// Same as [`ImpedanceControl::impedance`](crate::ImpedanceControl::impedance).
    pub fn impedance(&self, axis: AxisIndex) -> Result<Impedance, DeviceError> {
        Axes::One(axis).check(N)?;
        Ok(self.compliance[axis.index()].impedance)
    }

    /// Same as [`ImpedanceControl::set_impedance`](crate::ImpedanceControl::set_impedance).
    pub fn set_impedance(&mut self, axis: AxisIndex, asked: Impedance) -> Result<(), DeviceError> {
        let limits = self.impedance_limits(axis)?;
        let Impedance { stiffness, damping } = asked;
        limits
            .stiffness
            .check(axis, "stiffness", stiffness, "Nm/deg")?;
        limits.damping.check(axis, "damping", damping, "Nm s/deg")?;
        self.compliance[axis.index()].impedance = asked;
        Ok(())
    }

    /// Same as [`ImpedanceControl::impedance_offset`](crate::ImpedanceControl::impedance_offset).
    pub fn impedance_offset(&self, axis: AxisIndex) -> Result<f64, DeviceError> {
        Axes::One(axis).check(N)?;
        Ok(self.compliance[axis.index()].offset)
    }

    /// Same as [`ImpedanceControl::set_impedance_offset`](crate::ImpedanceControl::set_impedance_offset), within the
    /// joint's range of torques.
    pub fn set_impedance_offset(
        &mut self,
        axis: AxisIndex,
        offset: f64,
    ) -> Result<(), DeviceError> {
        let range = self.torque_range(axis)?;
        range.check(axis, "impedance offset", offset, "Nm")?;
        self.compliance[axis.index()].offset = offset;
        Ok(())
    }

    /// Same as [`ImpedanceControl::impedance_limits`](crate::ImpedanceControl::impedance_limits): up to the stiffness
    /// and damping that Barrett's position loop has, with which the arm is known to be steady.
    pub fn impedance_limits(&self, axis: AxisIndex) -> Result<ImpedanceLimits, DeviceError> {
        Axes::One(axis).check(N)?;
        Ok(Self::largest_impedance(&self.model, axis.index()))
    }

    pub(super) fn largest_impedance(
        model: &crate::wam::WamModel<N>,
        joint: usize,
    ) -> ImpedanceLimits {
        let gains = crate::wam::wam_units::gains_per_degree(model.gains[joint]);
        ImpedanceLimits {
            stiffness: Limits::new(0.0, gains.proportional),
            damping: Limits::new(0.0, gains.derivative),
        }
    }
}
