//! What orders mean for the device.

use super::super::messages::{Command, Set, Setting, Streamed};
use super::board::{Board, Refusal};

impl Board {
    /// Carries out an order. The device checks counts, axes and values before anything moves.
    pub(super) fn order(&self, set: &Set) -> Result<(), Refusal> {
        match set {
            Set::Values(setting, selection, values) => {
                let axes = selection.axes();
                match setting {
                    Setting::Position => self.position()?.position_move(axes, values)?,
                    Setting::Distance => self.position()?.relative_move(axes, values)?,
                    Setting::ReferenceSpeed => {
                        self.position()?.set_reference_speeds(axes, values)?;
                    }
                    Setting::ReferenceAcceleration => {
                        self.motion()?.set_reference_accelerations(axes, values)?;
                    }
                    Setting::Velocity => self.velocity()?.velocity_move(axes, values)?,
                    Setting::Encoder => self.encoders()?.set_encoders(axes, values)?,
                }
            }
            Set::Stop(selection) => self.motion()?.stop(selection.axes())?,
            Set::ResetEncoders(selection) => self.encoders()?.reset_encoders(selection.axes())?,
            Set::PositionLimits(axis, limits) => {
                self.limits()?.set_position_limits(*axis, *limits)?;
            }
            Set::VelocityLimits(axis, limits) => {
                self.limits()?.set_velocity_limits(*axis, *limits)?;
            }
            Set::ControlModes(selection, modes) => {
                self.modes()?.set_control_modes(selection.axes(), modes)?;
            }
        }
        Ok(())
    }

    /// Carries out a streamed command.
    pub(super) fn stream(&self, command: &Command) -> Result<(), Refusal> {
        match command.parse()? {
            Streamed::Velocity(selection) => self
                .velocity()?
                .velocity_move(selection.axes(), &command.values)?,
            Streamed::Positions => self
                .position()?
                .position_move(yarp_devices::Axes::All, &command.values)?,
        }
        Ok(())
    }
}
