//! The interfaces of a guarded device: check, then pass on.

use super::{Guarded, pairs, unit};
use crate::{
    Axes, AxisIndex, AxisInfo, ControlCalibration, ControlLimits, ControlMode, Device, DeviceError,
    EncoderReading, Encoders, InteractionMode, JointType, Limits, Mode, MotionControl,
    PositionControl, RemoteCalibrator, RemoteVariables, VelocityControl,
};

/// Makes the methods of [`Device`] by the list of all interfaces. A guarded device has the interfaces of its device, each guarded
/// here: an interface that is neither guarded nor named in `guarded_interface!` does not compile.
macro_rules! guarded_device {
    ($($(#[$about:meta])* $method:ident: $interface:ident;)*) => {
        impl Device for Guarded {
            $(guarded_interface! { $method $interface })*
        }
    };
}

macro_rules! guarded_interface {
    // It only reports.
    (motor $interface:ident) => {
        guarded_interface! { @unguarded motor $interface }
    };
    (joint_fault $interface:ident) => {
        guarded_interface! { @unguarded joint_fault $interface }
    };
    // A brake makes no motion.
    (machine_brake $interface:ident) => {
        guarded_interface! { @unguarded machine_brake $interface }
    };
    (@unguarded $method:ident $interface:ident) => {
        fn $method(&self) -> Option<&dyn crate::$interface> {
            self.device().$method()
        }
    };
    // Measures make no motion.
    (virtual_sensor $interface:ident) => {
        guarded_interface! { @unguarded virtual_sensor $interface }
    };
    // The guard itself has it.
    (software_stop $interface:ident) => {
        crate::offers! { software_stop: $interface }
    };
    // A controller of the tool commands a guarded arm instead.
    (cartesian_control $interface:ident) => {};
    // Not of arms and hands.
    (frame_grabber_image $interface:ident) => {};
    (frame_grabber_image_raw $interface:ident) => {};
    (frame_grabber_controls $interface:ident) => {};
    (firewire_controls $interface:ident) => {};
    (rgb_visual_params $interface:ident) => {};
    (audio_visual_grabber $interface:ident) => {};
    (audio_visual_stream $interface:ident) => {};
    (frame_writer_image $interface:ident) => {};
    (frame_writer_audio_visual $interface:ident) => {};
    (audio_grabber $interface:ident) => {};
    (audio_render $interface:ident) => {};
    (gaze_control $interface:ident) => {};
    (battery $interface:ident) => {};
    (analog_sensors $interface:ident) => {};
    (analog_sensor $interface:ident) => {};
    (generic_sensor $interface:ident) => {};
    (serial_device $interface:ident) => {};
    (gpu_device $interface:ident) => {};
    (service $interface:ident) => {};
    ($method:ident $interface:ident) => {
        fn $method(&self) -> Option<&dyn crate::$interface> {
            self.device().$method().map(|_| self as _)
        }
    };
}

crate::device_interfaces!(guarded_device);

impl Guarded {
    fn position(&self) -> Result<&dyn PositionControl, DeviceError> {
        has(self.device().position_control(), "moving to positions")
    }

    fn velocity(&self) -> Result<&dyn VelocityControl, DeviceError> {
        has(self.device().velocity_control(), "moving at velocities")
    }

    fn measured(&self) -> Result<&dyn Encoders, DeviceError> {
        has(self.device().encoders(), "reading encoders")
    }

    fn modes(&self) -> Result<&dyn ControlMode, DeviceError> {
        has(self.device().control_mode(), "control modes")
    }

    fn limits(&self) -> Result<&dyn ControlLimits, DeviceError> {
        has(self.device().control_limits(), "limits")
    }

    pub(super) fn named(&self) -> Result<&dyn RemoteVariables, DeviceError> {
        has(self.device().remote_variables(), "variables")
    }

    pub(super) fn calibrator(&self) -> Result<&dyn RemoteCalibrator, DeviceError> {
        has(self.device().remote_calibrator(), "a calibrator")
    }

    pub(super) fn interaction(&self) -> Result<&dyn InteractionMode, DeviceError> {
        has(self.device().interaction_mode(), "interaction modes")
    }

    pub(super) fn calibration(&self) -> Result<&dyn ControlCalibration, DeviceError> {
        has(self.device().control_calibration(), "calibration")
    }

    fn info(&self) -> Result<&dyn AxisInfo, DeviceError> {
        has(self.device().axis_info(), "information about axes")
    }

    /// The unit of a joint's position, or of its first or second derivative.
    pub(super) fn unit(&self, joint: AxisIndex, order: u8) -> &'static str {
        let kind = self.info().and_then(|info| info.joint_type(joint));
        unit(kind.unwrap_or(JointType::Unknown), order)
    }

    /// Returns the position of a joint that has limits here: a driver without encoders can be guarded without.
    fn where_limited(&self, joint: AxisIndex) -> Result<Option<f64>, DeviceError> {
        if self.joint_limits.of(joint).is_none() {
            return Ok(None);
        }
        self.place(joint).map(Some)
    }

    /// Returns the position of a joint.
    pub(super) fn place(&self, joint: AxisIndex) -> Result<f64, DeviceError> {
        let mut now = [EncoderReading::default()];
        self.measured()?.read_encoders(joint.into(), &mut now)?;
        Ok(now[0].position)
    }

    /// Checks a velocity of a joint, signed.
    pub(super) fn check_velocity(&self, joint: AxisIndex, asked: f64) -> Result<(), DeviceError> {
        let unit = self.unit(joint, 1);
        self.rate_limits.check_velocity(joint, asked, unit)?;
        if let Some(here) = self.where_limited(joint)? {
            self.joint_limits.check_velocity(joint, asked, here, unit)?;
        }
        Ok(())
    }

    /// Returns either of the two, for their common methods.
    fn motion<T>(
        &self,
        by_position: impl FnOnce(&dyn PositionControl) -> Result<T, DeviceError>,
        by_velocity: impl FnOnce(&dyn VelocityControl) -> Result<T, DeviceError>,
    ) -> Result<T, DeviceError> {
        match self.device().position_control() {
            Some(control) => by_position(control),
            None => by_velocity(self.velocity()?),
        }
    }
}

pub(super) fn has<'a, T: ?Sized>(
    interface: Option<&'a T>,
    what: &str,
) -> Result<&'a T, DeviceError> {
    interface.ok_or_else(|| DeviceError::NotSupported {
        what: what.to_owned(),
    })
}

impl AxisInfo for Guarded {
    fn axes(&self) -> usize {
        self.total()
    }

    fn axis_name(&self, axis: AxisIndex) -> Result<String, DeviceError> {
        self.info()?.axis_name(axis)
    }

    fn joint_type(&self, axis: AxisIndex) -> Result<JointType, DeviceError> {
        self.info()?.joint_type(axis)
    }
}

impl MotionControl for Guarded {
    fn stop(&self, axes: Axes<'_>) -> Result<(), DeviceError> {
        self.motion(|control| control.stop(axes), |control| control.stop(axes))?;
        self.watch.end_streams(axes, self.total());
        Ok(())
    }

    fn set_reference_accelerations(
        &self,
        axes: Axes<'_>,
        accelerations: &[f64],
    ) -> Result<(), DeviceError> {
        axes.check_command(self.total(), "reference accelerations", accelerations.len())?;
        let bounded: Vec<f64> = pairs(axes, self.total(), accelerations)
            .map(|(joint, asked)| self.rate_limits.bound_acceleration(joint, asked))
            .collect();
        self.motion(
            |control| control.set_reference_accelerations(axes, &bounded),
            |control| control.set_reference_accelerations(axes, &bounded),
        )
    }

    fn reference_accelerations(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.motion(
            |control| control.reference_accelerations(axes),
            |control| control.reference_accelerations(axes),
        )
    }
}

impl PositionControl for Guarded {
    fn position_move(&self, axes: Axes<'_>, targets: &[f64]) -> Result<(), DeviceError> {
        self.admit()?;
        for (joint, asked) in pairs(axes, self.total(), targets) {
            let unit = self.unit(joint, 0);
            self.joint_limits.check_position(joint, asked, unit)?;
        }
        self.position()?.position_move(axes, targets)
    }

    fn relative_move(&self, axes: Axes<'_>, distances: &[f64]) -> Result<(), DeviceError> {
        self.admit()?;
        axes.check_command(self.total(), "distances", distances.len())?;
        for (joint, distance) in pairs(axes, self.total(), distances) {
            if let Some(here) = self.where_limited(joint)? {
                let unit = self.unit(joint, 0);
                self.joint_limits
                    .check_position(joint, here + distance, unit)?;
            }
        }
        self.position()?.relative_move(axes, distances)
    }

    fn motion_done(&self, axes: Axes<'_>) -> Result<bool, DeviceError> {
        self.position()?.motion_done(axes)
    }

    fn target_positions(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.position()?.target_positions(axes)
    }

    fn set_reference_speeds(&self, axes: Axes<'_>, speeds: &[f64]) -> Result<(), DeviceError> {
        for (joint, asked) in pairs(axes, self.total(), speeds) {
            let unit = self.unit(joint, 1);
            self.rate_limits.check_speed(joint, asked, unit)?;
        }
        self.position()?.set_reference_speeds(axes, speeds)
    }

    fn reference_speeds(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.position()?.reference_speeds(axes)
    }
}

impl VelocityControl for Guarded {
    fn velocity_move(&self, axes: Axes<'_>, velocities: &[f64]) -> Result<(), DeviceError> {
        self.admit()?;
        let total = self.total();
        axes.check_command(total, "velocities", velocities.len())?;
        for (joint, asked) in pairs(axes, total, velocities) {
            self.check_velocity(joint, asked)?;
        }
        let control = self.velocity()?;
        let accelerations = control.reference_accelerations(axes)?;
        control.velocity_move(axes, velocities)?;
        for ((joint, velocity), acceleration) in pairs(axes, total, velocities).zip(accelerations) {
            self.watch.record_velocity(joint, velocity, acceleration);
        }
        Ok(())
    }

    fn reference_velocities(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.velocity()?.reference_velocities(axes)
    }
}

impl Encoders for Guarded {
    fn read_encoders(&self, axes: Axes<'_>, out: &mut [EncoderReading]) -> Result<(), DeviceError> {
        self.measured()?.read_encoders(axes, out)
    }

    fn set_encoders(&self, axes: Axes<'_>, positions: &[f64]) -> Result<(), DeviceError> {
        self.admit()?;
        self.measured()?.set_encoders(axes, positions)
    }
}

impl ControlMode for Guarded {
    fn available_control_modes(&self, axis: AxisIndex) -> Result<Vec<Mode>, DeviceError> {
        // No commands pass through here in the other modes.
        let commanded = [
            Mode::Idle,
            Mode::Position,
            Mode::PositionDirect,
            Mode::Velocity,
            Mode::VelocityDirect,
            Mode::Torque,
            Mode::Current,
            Mode::Pwm,
        ];
        let mut modes = self.modes()?.available_control_modes(axis)?;
        modes.retain(|mode| self.is_unlimited || commanded.contains(mode));
        Ok(modes)
    }

    fn read_control_modes(&self, axes: Axes<'_>, out: &mut [Mode]) -> Result<(), DeviceError> {
        self.modes()?.read_control_modes(axes, out)
    }

    fn set_control_modes(&self, axes: Axes<'_>, modes: &[Mode]) -> Result<(), DeviceError> {
        self.admit()?;
        let total = self.total();
        axes.check_command(total, "modes", modes.len())?;
        for (joint, &mode) in axes.iter(total).zip(modes) {
            if mode != Mode::ForceIdle && !self.available_control_modes(joint)?.contains(&mode) {
                return Err(DeviceError::NoSuchMode { joint, mode });
            }
        }
        self.modes()?.set_control_modes(axes, modes)?;
        // A joint that is already in velocity mode continues, and stays monitored.
        for (joint, mode) in axes.iter(total).zip(modes) {
            let streams = [
                Mode::Velocity,
                Mode::VelocityDirect,
                Mode::Torque,
                Mode::Current,
                Mode::Pwm,
            ];
            if !streams.contains(mode) {
                self.watch.end_streams(joint.into(), total);
            }
        }
        Ok(())
    }
}

impl ControlLimits for Guarded {
    fn position_limits(&self, axis: AxisIndex) -> Result<Limits, DeviceError> {
        let theirs = self.limits()?.position_limits(axis)?;
        Ok(self.joint_limits.of(axis).map_or(theirs, |ours| {
            Limits::new(ours.min.max(theirs.min), ours.max.min(theirs.max))
        }))
    }

    fn set_position_limits(&self, axis: AxisIndex, limits: Limits) -> Result<(), DeviceError> {
        let unit = self.unit(axis, 0);
        self.joint_limits.check_limits(axis, limits, unit)?;
        self.limits()?.set_position_limits(axis, limits)
    }

    fn velocity_limits(&self, axis: AxisIndex) -> Result<Limits, DeviceError> {
        let theirs = self.limits()?.velocity_limits(axis)?;
        Ok(self
            .rate_limits
            .speed(axis)
            .map_or(theirs, |most| Limits::new(theirs.min, theirs.max.min(most))))
    }

    fn set_velocity_limits(&self, axis: AxisIndex, limits: Limits) -> Result<(), DeviceError> {
        let unit = self.unit(axis, 1);
        self.rate_limits.check_speed(axis, limits.max, unit)?;
        self.limits()?.set_velocity_limits(axis, limits)
    }
}
