//! Axes, motion, encoders, modes and limits.

use super::Remapper;
use super::fan_out::{Interface, OnRefusal};
use super::range_checks::{Quantity, are_rest};
use crate::{
    Axes, AxisIndex, AxisInfo, ControlLimits, ControlMode, Device, DeviceError, EncoderReading,
    Encoders, JointType, Limits, Mode, MotionControl, PositionControl, PositionDirect,
    VelocityControl, VelocityDirect,
};

type Outcome<T> = Result<T, DeviceError>;

const INFO: Interface = Interface {
    words: "information about axes",
    has: |device| device.axis_info().is_some(),
};
const MOTION: Interface = Interface {
    words: "motion control",
    has: |device| motion(device).is_some(),
};

/// Returns either of the two interfaces that have it.
fn motion(device: &dyn Device) -> Option<&dyn MotionControl> {
    let position = device.position_control().map(|control| control as _);
    position.or_else(|| device.velocity_control().map(|control| control as _))
}

impl AxisInfo for Remapper {
    fn axes(&self) -> usize {
        self.axes.len()
    }

    fn axis_name(&self, axis: AxisIndex) -> Outcome<String> {
        Axes::One(axis).check(self.axes.len())?;
        Ok(self.names[axis.index()].clone())
    }

    fn joint_type(&self, axis: AxisIndex) -> Outcome<JointType> {
        self.one(INFO, axis, |device, axis| {
            Some(device.axis_info()?.joint_type(axis))
        })
    }
}

impl MotionControl for Remapper {
    fn stop(&self, axes: Axes<'_>) -> Outcome<()> {
        self.order(MOTION, axes, OnRefusal::TellOthers, |device, axes| {
            Some(motion(device)?.stop(axes))
        })
    }

    fn set_reference_accelerations(&self, axes: Axes<'_>, accelerations: &[f64]) -> Outcome<()> {
        self.tell(
            MOTION,
            axes,
            ("accelerations", accelerations),
            OnRefusal::StopThere,
            |share, values| self.beyond(Quantity::Positive, share, values),
            |device, axes, values| Some(motion(device)?.set_reference_accelerations(axes, values)),
        )
    }

    fn reference_accelerations(&self, axes: Axes<'_>) -> Outcome<Vec<f64>> {
        self.ask(MOTION, axes, |device, axes| {
            Some(motion(device)?.reference_accelerations(axes))
        })
    }
}

impl PositionControl for Remapper {
    fn position_move(&self, axes: Axes<'_>, targets: &[f64]) -> Outcome<()> {
        self.tell(
            Interface::position_control(),
            axes,
            ("targets", targets),
            OnRefusal::StopThere,
            |share, values| {
                self.beyond(Quantity::Position, share, values)
                    || self.in_other_mode(share, Mode::Position)
            },
            |device, axes, values| Some(device.position_control()?.position_move(axes, values)),
        )
    }

    fn relative_move(&self, axes: Axes<'_>, distances: &[f64]) -> Outcome<()> {
        self.tell(
            Interface::position_control(),
            axes,
            ("distances", distances),
            OnRefusal::StopThere,
            |share, values| {
                self.beyond(Quantity::Finite, share, values)
                    || self.beyond(Quantity::Position, share, &self.arrivals(share, values))
                    || self.in_other_mode(share, Mode::Position)
            },
            |device, axes, values| Some(device.position_control()?.relative_move(axes, values)),
        )
    }

    fn motion_done(&self, axes: Axes<'_>) -> Outcome<bool> {
        for share in self.shares(axes)? {
            let done = self.group(Interface::position_control(), &share, |device, axes| {
                Some(device.position_control()?.motion_done(axes))
            })?;
            if !done {
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn target_positions(&self, axes: Axes<'_>) -> Outcome<Vec<f64>> {
        self.ask(Interface::position_control(), axes, |device, axes| {
            Some(device.position_control()?.target_positions(axes))
        })
    }

    fn set_reference_speeds(&self, axes: Axes<'_>, speeds: &[f64]) -> Outcome<()> {
        self.tell(
            Interface::position_control(),
            axes,
            ("speeds", speeds),
            OnRefusal::StopThere,
            |share, values| {
                self.beyond(Quantity::Positive, share, values)
                    || self.beyond(Quantity::Velocity, share, values)
            },
            |device, axes, values| {
                Some(
                    device
                        .position_control()?
                        .set_reference_speeds(axes, values),
                )
            },
        )
    }

    fn reference_speeds(&self, axes: Axes<'_>) -> Outcome<Vec<f64>> {
        self.ask(Interface::position_control(), axes, |device, axes| {
            Some(device.position_control()?.reference_speeds(axes))
        })
    }
}

impl VelocityControl for Remapper {
    fn velocity_move(&self, axes: Axes<'_>, velocities: &[f64]) -> Outcome<()> {
        self.tell(
            Interface::velocity_control(),
            axes,
            ("velocities", velocities),
            OnRefusal::StopThere,
            |share, values| {
                self.beyond(Quantity::Velocity, share, values)
                    || self.in_other_mode(share, Mode::Velocity)
            },
            |device, axes, values| Some(device.velocity_control()?.velocity_move(axes, values)),
        )
    }

    fn reference_velocities(&self, axes: Axes<'_>) -> Outcome<Vec<f64>> {
        self.ask(Interface::velocity_control(), axes, |device, axes| {
            Some(device.velocity_control()?.reference_velocities(axes))
        })
    }
}

impl PositionDirect for Remapper {
    fn set_direct_positions(&self, axes: Axes<'_>, positions: &[f64]) -> Outcome<()> {
        self.tell(
            Interface::position_direct(),
            axes,
            ("positions", positions),
            OnRefusal::StopThere,
            |share, values| {
                self.beyond(Quantity::Position, share, values)
                    || self.in_other_mode(share, Mode::PositionDirect)
            },
            |device, axes, values| {
                Some(device.position_direct()?.set_direct_positions(axes, values))
            },
        )
    }

    fn direct_positions(&self, axes: Axes<'_>) -> Outcome<Vec<f64>> {
        self.ask(Interface::position_direct(), axes, |device, axes| {
            Some(device.position_direct()?.direct_positions(axes))
        })
    }
}

impl VelocityDirect for Remapper {
    fn set_direct_velocities(&self, axes: Axes<'_>, velocities: &[f64]) -> Outcome<()> {
        self.tell(
            Interface::velocity_direct(),
            axes,
            ("velocities", velocities),
            OnRefusal::StopThere,
            |share, values| {
                self.beyond(Quantity::Velocity, share, values)
                    || self.in_other_mode(share, Mode::VelocityDirect)
            },
            |device, axes, values| {
                Some(
                    device
                        .velocity_direct()?
                        .set_direct_velocities(axes, values),
                )
            },
        )
    }

    fn direct_velocities(&self, axes: Axes<'_>) -> Outcome<Vec<f64>> {
        self.ask(Interface::velocity_direct(), axes, |device, axes| {
            Some(device.velocity_direct()?.direct_velocities(axes))
        })
    }
}

impl Encoders for Remapper {
    fn read_encoders(&self, axes: Axes<'_>, out: &mut [EncoderReading]) -> Outcome<()> {
        self.fill(Interface::encoders(), axes, out, |device, axes, out| {
            Some(device.encoders()?.read_encoders(axes, out))
        })
    }

    fn set_encoders(&self, axes: Axes<'_>, positions: &[f64]) -> Outcome<()> {
        self.tell(
            Interface::encoders(),
            axes,
            ("positions", positions),
            OnRefusal::StopThere,
            |share, values| self.beyond(Quantity::Position, share, values),
            |device, axes, values| Some(device.encoders()?.set_encoders(axes, values)),
        )
    }

    fn reset_encoders(&self, axes: Axes<'_>) -> Outcome<()> {
        self.order(
            Interface::encoders(),
            axes,
            OnRefusal::StopThere,
            |device, axes| Some(device.encoders()?.reset_encoders(axes)),
        )
    }
}

impl ControlMode for Remapper {
    fn available_control_modes(&self, axis: AxisIndex) -> Outcome<Vec<Mode>> {
        self.one(Interface::control_mode(), axis, |device, axis| {
            Some(device.control_mode()?.available_control_modes(axis))
        })
    }

    fn read_control_modes(&self, axes: Axes<'_>, out: &mut [Mode]) -> Outcome<()> {
        self.fill(Interface::control_mode(), axes, out, |device, axes, out| {
            Some(device.control_mode()?.read_control_modes(axes, out))
        })
    }

    fn set_control_modes(&self, axes: Axes<'_>, modes: &[Mode]) -> Outcome<()> {
        let others = match are_rest(modes) {
            true => OnRefusal::TellOthers,
            false => OnRefusal::StopThere,
        };
        self.tell(
            Interface::control_mode(),
            axes,
            ("modes", modes),
            others,
            |share, modes| self.lacks_modes(share, modes),
            |device, axes, modes| Some(device.control_mode()?.set_control_modes(axes, modes)),
        )
    }
}

impl ControlLimits for Remapper {
    fn position_limits(&self, axis: AxisIndex) -> Outcome<Limits> {
        self.one(Interface::control_limits(), axis, |device, axis| {
            Some(device.control_limits()?.position_limits(axis))
        })
    }

    fn set_position_limits(&self, axis: AxisIndex, limits: Limits) -> Outcome<()> {
        let set = self.one(Interface::control_limits(), axis, |device, axis| {
            Some(device.control_limits()?.set_position_limits(axis, limits))
        });
        self.known.forget();
        set
    }

    fn velocity_limits(&self, axis: AxisIndex) -> Outcome<Limits> {
        self.one(Interface::control_limits(), axis, |device, axis| {
            Some(device.control_limits()?.velocity_limits(axis))
        })
    }

    fn set_velocity_limits(&self, axis: AxisIndex, limits: Limits) -> Outcome<()> {
        let set = self.one(Interface::control_limits(), axis, |device, axis| {
            Some(device.control_limits()?.set_velocity_limits(axis, limits))
        });
        self.known.forget();
        set
    }
}
