//! Interfaces of a device, queried at run time.

use crate::{
    AmplifierControl, AudioGrabber, AudioRender, AxisInfo, CartesianControl, ControlCalibration,
    ControlLimits, ControlMode, CurrentControl, Encoders, FirewireControls, FrameGrabberControls,
    FrameGrabberImage, FrameGrabberImageRaw, Grasp, Hand, ImpedanceControl, InteractionMode,
    JointBrake, JointFault, Motor, MotorEncoders, PidControl, PositionControl, PositionDirect,
    PwmControl, RemoteCalibrator, RemoteVariables, RgbVisualParams, SerialDevice, TorqueControl,
    VelocityControl, VelocityDirect,
};

/// In an `impl Device`: the interfaces that the type itself implements.
///
/// ```
/// # use yarp_devices::{AxisIndex, AxisInfo, Device, DeviceError, JointType, offers};
/// # struct Ruler;
/// # impl AxisInfo for Ruler {
/// #     fn axes(&self) -> usize { 1 }
/// #     fn axis_name(&self, _: AxisIndex) -> Result<String, DeviceError> { Ok("slide".into()) }
/// #     fn joint_type(&self, _: AxisIndex) -> Result<JointType, DeviceError> { Ok(JointType::Prismatic) }
/// # }
/// impl Device for Ruler {
///     offers! { axis_info: AxisInfo }
/// }
/// assert!(Ruler.axis_info().is_some());
/// ```
#[macro_export]
macro_rules! offers {
    ($($method:ident: $interface:ident),* $(,)?) => {
        $(fn $method(&self) -> Option<&dyn $crate::$interface> {
            Some(self)
        })*
    };
}

/// A device, seen as the set of interfaces it has.
///
/// This is what `view()` of the stock `PolyDriver` is: one query per interface, answered with the interface or with
/// `None`. A network wrapper takes an `Arc<dyn Device>`, serves its interfaces and refuses the others. A device is
/// released by dropping it.
///
/// ```
/// use yarp_devices::{AxisInfo, Device, DeviceError, AxisIndex, JointType};
///
/// struct Ruler;
///
/// impl AxisInfo for Ruler {
///     fn axes(&self) -> usize { 1 }
///     fn axis_name(&self, _: AxisIndex) -> Result<String, DeviceError> { Ok("slide".into()) }
///     fn joint_type(&self, _: AxisIndex) -> Result<JointType, DeviceError> { Ok(JointType::Prismatic) }
/// }
///
/// impl Device for Ruler {
///     fn axis_info(&self) -> Option<&dyn AxisInfo> { Some(self) }
/// }
///
/// assert_eq!(Ruler.axis_info().map(|info| info.axes()), Some(1));
/// assert!(Ruler.position_control().is_none());
/// ```
pub trait Device: Send + Sync {
    /// Number, names and kinds of the axes (`IAxisInfo`).
    fn axis_info(&self) -> Option<&dyn AxisInfo> {
        None
    }

    /// Point-to-point moves (`IPositionControl`).
    fn position_control(&self) -> Option<&dyn PositionControl> {
        None
    }

    /// Moves at a given velocity (`IVelocityControl`).
    fn velocity_control(&self) -> Option<&dyn VelocityControl> {
        None
    }

    /// Returns the joint encoders (`IEncodersTimed`).
    fn encoders(&self) -> Option<&dyn Encoders> {
        None
    }

    /// Returns the control modes of the joints (`IControlMode`).
    fn control_mode(&self) -> Option<&dyn ControlMode> {
        None
    }

    /// Returns the position and velocity limits (`IControlLimits`).
    fn control_limits(&self) -> Option<&dyn ControlLimits> {
        None
    }

    /// Positions given step by step (`IPositionDirect`).
    fn position_direct(&self) -> Option<&dyn PositionDirect> {
        None
    }

    /// Velocities given step by step (`IVelocityDirect`).
    fn velocity_direct(&self) -> Option<&dyn VelocityDirect> {
        None
    }

    /// Torques at the joints (`ITorqueControl`).
    fn torque_control(&self) -> Option<&dyn TorqueControl> {
        None
    }

    /// Currents of the motors (`ICurrentControl`).
    fn current_control(&self) -> Option<&dyn CurrentControl> {
        None
    }

    /// Duty cycles of the motors (`IPWMControl`).
    fn pwm_control(&self) -> Option<&dyn PwmControl> {
        None
    }

    /// Returns the interaction modes (`IInteractionMode`).
    fn interaction_mode(&self) -> Option<&dyn InteractionMode> {
        None
    }

    /// Returns the impedance of compliant joints (`IImpedanceControl`).
    fn impedance_control(&self) -> Option<&dyn ImpedanceControl> {
        None
    }

    /// The control loops (`IPidControl`).
    fn pid_control(&self) -> Option<&dyn PidControl> {
        None
    }

    /// Returns the motor encoders (`IMotorEncoders`).
    fn motor_encoders(&self) -> Option<&dyn MotorEncoders> {
        None
    }

    /// The motors themselves (`IMotor`).
    fn motor(&self) -> Option<&dyn Motor> {
        None
    }

    /// The amplifiers (`IAmplifierControl`).
    fn amplifier_control(&self) -> Option<&dyn AmplifierControl> {
        None
    }

    /// Calibration by the board (`IControlCalibration`).
    fn control_calibration(&self) -> Option<&dyn ControlCalibration> {
        None
    }

    /// Calibration by a calibrator (`IRemoteCalibrator`).
    fn remote_calibrator(&self) -> Option<&dyn RemoteCalibrator> {
        None
    }

    /// Variables of its own (`IRemoteVariables`).
    fn remote_variables(&self) -> Option<&dyn RemoteVariables> {
        None
    }

    /// Faults of the joints (`IJointFault`).
    fn joint_fault(&self) -> Option<&dyn JointFault> {
        None
    }

    /// Brakes (`IJointBrake`).
    fn joint_brake(&self) -> Option<&dyn JointBrake> {
        None
    }

    /// Returns the Cartesian controller (`ICartesianControl`).
    fn cartesian_control(&self) -> Option<&dyn CartesianControl> {
        None
    }

    /// A hand as a whole; no stock interface is like it.
    fn hand(&self) -> Option<&dyn Hand> {
        None
    }

    /// Grasps by name; no stock interface is like it.
    fn grasp(&self) -> Option<&dyn Grasp> {
        None
    }

    /// Images in colour (`IFrameGrabberImage`).
    fn frame_grabber_image(&self) -> Option<&dyn FrameGrabberImage> {
        None
    }

    /// Images in one channel (`IFrameGrabberImageRaw`).
    fn frame_grabber_image_raw(&self) -> Option<&dyn FrameGrabberImageRaw> {
        None
    }

    /// Returns the features of a camera (`IFrameGrabberControls`).
    fn frame_grabber_controls(&self) -> Option<&dyn FrameGrabberControls> {
        None
    }

    /// Returns the controls of cameras on IEEE 1394 (`IFrameGrabberControlsDC1394`).
    fn firewire_controls(&self) -> Option<&dyn FirewireControls> {
        None
    }

    /// Returns the optical parameters of a camera (`IRgbVisualParams`).
    fn rgb_visual_params(&self) -> Option<&dyn RgbVisualParams> {
        None
    }

    /// Sound from a microphone (`IAudioGrabberSound`).
    fn audio_grabber(&self) -> Option<&dyn AudioGrabber> {
        None
    }

    /// Sound to a loudspeaker (`IAudioRender`).
    fn audio_render(&self) -> Option<&dyn AudioRender> {
        None
    }

    /// Sensors of several kinds (stock: multiple analog sensors).
    fn analog_sensors(&self) -> Option<&dyn crate::AnalogSensors> {
        None
    }

    /// One sensor of several channels (`IAnalogSensor` of 3.x).
    fn analog_sensor(&self) -> Option<&dyn crate::AnalogSensor> {
        None
    }

    /// Bytes over a line (`ISerialDevice`).
    fn serial_device(&self) -> Option<&dyn SerialDevice> {
        None
    }
}
