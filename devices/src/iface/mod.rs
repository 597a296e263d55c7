//! The device interfaces, one file each: a trait and its value types.
//!
//! All traits are object safe, take `&self` and are meant to be called from several threads. Calls return at once; a
//! device behind a network may take as long as its own timeout, which it documents. Those of [`Hand`] and [`Grasp`]
//! return when the motion has ended. Values are in the unit of the axis (degrees or metres, and per second; radians
//! in [`CartesianControl`] alone, for the orientation of a tool). The stock overloads for one, several and all joints
//! are one method with an [`Axes`](crate::Axes) selector. A command for several joints is checked completely before
//! anything moves: all of it happens, or none.

mod amplifier_control;
mod audio;
mod audio_grabber;
mod audio_render;
mod axis_info;
mod cartesian_control;
mod control_calibration;
mod control_limits;
mod control_mode;
mod current_control;
mod encoders;
mod firewire_controls;
mod frame_grabber_controls;
mod frame_grabber_image;
mod grasp;
mod hand;
mod impedance_control;
mod interaction_mode;
mod joint_brake;
mod joint_fault;
mod motion_control;
mod motor;
mod motor_encoders;
mod pid_control;
mod position_control;
mod position_direct;
mod pwm_control;
mod remote_calibrator;
mod remote_variables;
mod rgb_visual_params;
mod serial_device;
mod torque_control;
mod velocity_control;
mod velocity_direct;

pub use amplifier_control::{AmplifierControl, AmplifierLimit};
pub use audio::{Audio, AudioBufferSize};
pub use audio_grabber::AudioGrabber;
pub use audio_render::AudioRender;
pub use axis_info::{AxisInfo, JointType};
pub use cartesian_control::{
    CartesianControl, CartesianEvent, CartesianInfo, PoseSolution, Priority, StampedPose, Target,
    TaskPose, TaskVelocity, TweakChange, Tweaks,
};
pub use control_calibration::{CalibrationParameters, ControlCalibration};
pub use control_limits::{ControlLimits, Limits};
pub use control_mode::{ControlMode, Mode};
pub use current_control::CurrentControl;
pub use encoders::{EncoderReading, Encoders};
pub use firewire_controls::{FirewireControls, Window, WindowLimits};
pub use frame_grabber_controls::{
    Bus, CameraDescription, Feature, FeatureMode, FrameGrabberControls,
};
pub use frame_grabber_image::{FrameGrabberImage, FrameGrabberImageRaw};
pub use grasp::{Grasp, GraspKind, UnknownGrasp};
pub use hand::Hand;
pub use impedance_control::{Impedance, ImpedanceControl, ImpedanceLimits};
pub use interaction_mode::{Interaction, InteractionMode};
pub use joint_brake::JointBrake;
pub use joint_fault::{Fault, JointFault};
pub use motion_control::MotionControl;
pub use motor::Motor;
pub use motor_encoders::MotorEncoders;
pub use pid_control::{Pid, PidControl, PidInfo, PidKind, PidUnits, PidValue};
pub use position_control::PositionControl;
pub use position_direct::PositionDirect;
pub use pwm_control::PwmControl;
pub use remote_calibrator::RemoteCalibrator;
pub use remote_variables::{RemoteVariables, VariableValue};
pub use rgb_visual_params::{CameraConfiguration, Intrinsics, RgbVisualParams};
pub use serial_device::SerialDevice;
pub use torque_control::{MotorTorqueParameters, TorqueControl};
pub use velocity_control::VelocityControl;
pub use velocity_direct::VelocityDirect;
