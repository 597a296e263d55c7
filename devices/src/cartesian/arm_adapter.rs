//! The arm under a controller, in rad.

use std::sync::Arc;

use crate::kinematics::Joints;
use crate::{
    Axes, AxisIndex, ControlMode, Device, DeviceError, EncoderReading, Limits, Mode, PositionDirect,
};

/// An arm that follows positions step by step.
#[derive(Clone)]
pub(super) struct ArmAdapter<const N: usize> {
    device: Arc<dyn Device>,
}

/// Measured joint positions and their time: rad, and seconds since the start of 1970.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measured<const N: usize> {
    pub(super) joints: Joints<N>,
    pub(super) time: f64,
}

fn missing<T>(interface: Option<T>, what: &str) -> Result<T, DeviceError> {
    interface.ok_or_else(|| DeviceError::NotSupported {
        what: what.to_owned(),
    })
}

impl<const N: usize> ArmAdapter<N> {
    /// Errors: [`DeviceError::NotSupported`], [`DeviceError::WrongCount`].
    pub(super) fn new(device: Arc<dyn Device>) -> Result<Self, DeviceError> {
        let arm = Self { device };
        missing(arm.device.control_limits(), "telling limits")?;
        arm.direct()?;
        arm.modes()?;
        let axes = missing(arm.device.encoders(), "reading encoders")?.axes();
        if axes != N {
            return Err(DeviceError::WrongCount {
                what: "axes",
                expected: N,
                got: axes,
            });
        }
        Ok(arm)
    }

    fn direct(&self) -> Result<&dyn PositionDirect, DeviceError> {
        missing(self.device.position_direct(), "following positions")
    }

    fn modes(&self) -> Result<&dyn ControlMode, DeviceError> {
        missing(self.device.control_mode(), "control modes")
    }

    /// Returns the range of each joint, rad; the device's limits narrow those of the chain.
    pub(super) fn limits(&self, chain: &[Limits; N]) -> Result<[Limits; N], DeviceError> {
        let mut limits = *chain;
        for (joint, limits) in limits.iter_mut().enumerate() {
            let own = self.own_limits(joint)?;
            let (min, max) = (own.min.to_radians(), own.max.to_radians());
            *limits = Limits::new(limits.min.max(min), limits.max.min(max));
        }
        Ok(limits)
    }

    /// The limits of the device, degrees.
    pub(super) fn own_limits(&self, joint: usize) -> Result<Limits, DeviceError> {
        missing(self.device.control_limits(), "telling limits")?.position_limits(joint.into())
    }

    /// Returns the maximum speed of each joint, rad/s.
    pub(super) fn max_velocities(&self) -> Result<Joints<N>, DeviceError> {
        let limits = missing(self.device.control_limits(), "telling limits")?;
        let mut max_velocities = Joints::zeros();
        for joint in 0..N {
            max_velocities[joint] = limits.velocity_limits(joint.into())?.max.to_radians();
        }
        Ok(max_velocities)
    }

    pub(super) fn measured(&self) -> Result<Measured<N>, DeviceError> {
        let mut readings = [EncoderReading::default(); N];
        missing(self.device.encoders(), "reading encoders")?
            .read_encoders(Axes::All, &mut readings)?;
        Ok(Measured {
            joints: Joints::from_fn(|joint, _| readings[joint].position.to_radians()),
            time: readings.first().map_or(0.0, |reading| reading.time),
        })
    }

    fn used(dof: &[bool; N]) -> Vec<AxisIndex> {
        let used = (0..N).filter(|&joint| dof[joint]);
        used.map(AxisIndex::from).collect()
    }

    /// Has the joints follow positions.
    pub(super) fn engage(&self, dof: &[bool; N]) -> Result<(), DeviceError> {
        let used = Self::used(dof);
        let modes = vec![Mode::PositionDirect; used.len()];
        self.modes()?.set_control_modes(Axes::Group(&used), &modes)
    }

    /// Returns whether all joints follow positions.
    pub(super) fn is_engaged(&self, dof: &[bool; N]) -> Result<bool, DeviceError> {
        let mut modes = [Mode::UNKNOWN; N];
        self.modes()?.read_control_modes(Axes::All, &mut modes)?;
        Ok((0..N).all(|joint| !dof[joint] || modes[joint] == Mode::PositionDirect))
    }

    /// Brings joints to rest, of an arm that can do that beside following positions.
    pub(super) fn stop(&self, dof: &[bool; N]) -> Result<(), DeviceError> {
        match self.device.position_control() {
            Some(control) => control.stop(Axes::Group(&Self::used(dof))),
            None => Ok(()),
        }
    }

    /// Sends the joints there, never beyond the limits of the device by a rounding.
    pub(super) fn send(&self, dof: &[bool; N], joints: &Joints<N>) -> Result<(), DeviceError> {
        let used = Self::used(dof);
        let positions: Result<Vec<f64>, DeviceError> = used
            .iter()
            .map(|axis| {
                Ok(self
                    .own_limits(axis.index())?
                    .clamp(joints[axis.index()].to_degrees()))
            })
            .collect();
        self.direct()?
            .set_direct_positions(Axes::Group(&used), &positions?)
    }
}
