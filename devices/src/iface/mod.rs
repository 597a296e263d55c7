//! The device interfaces, one file each: a trait and its value types.
//!
//! All traits are object safe, take `&self` and are meant to be called from several threads. Calls return at once; a
//! device behind a network may take as long as its own timeout, which it documents. Those of [`Hand`] and [`Grasp`]
//! return when the motion has ended. Values are in the unit of the axis (degrees or metres, and per second; radians
//! in [`CartesianControl`] and [`GazeControl`] alone, for orientations in space). The stock overloads for one, several and all joints
//! are one method with an [`Axes`](crate::Axes) selector. A command for several joints is checked completely before
//! anything moves: all of it happens, or none.
//!
//! # Descriptions of requests
//!
//! Below the trait of each interface of control boards stands its description (`describe_...`): a row for each request
//! that clients send about it. Parsing and printing in both wire versions, the lookup of words and functions, the calls
//! of the device, the replies, and the methods of the client are generated from these rows. `describe_board`
//! lists the descriptions, `wholly_described` those that nothing is added to by hand. The header of a description has the method of [`Device`](crate::Device), the trait, the name
//! in YARP 4.0 (empty if it has none), and the name in errors. A row is
//!
//! ```text
//! /// Documentation.
//! Name -> Result: "prefix" ["one" "group" "all"] ["oneFunction" "groupFunction" "allFunction"] => (call);
//! ```
//!
//! | column | content |
//! | --- | --- |
//! | `Name` | name of the request in Rust; `{ kind: PidKind }` behind it if it is about one of several control loops |
//! | `-> Result` | type of the result (queries); `(name: Type, ..)` types of the arguments (commands) |
//! | prefix | 3.x: word before the others; `""` for none, `"*"` for a word at the start of the message |
//! | words | 3.x: words for one axis, a group, all axes; `""` for a missing one |
//! | functions | 4.0: the same, without `RPC` at the end |
//! | call | see below |
//!
//! | section | request | calls |
//! | --- | --- | --- |
//! | `numbers` | reads one number per axis | `each METHOD` (`Axes` to a `Vec`), `axis METHOD` (one axis) |
//! | `settings` | sets one number per axis | the same, followed by the name of the values in errors |
//! | `actions` | acts on axes, without values | `axes METHOD "verb"`, `board METHOD` |
//! | `queries` | reads anything else | `axis`, `each`, `axes` (one answer for all), `board` |
//! | `commands` | sets anything else | `axis METHOD` (an axis, then the other arguments) |
//!
//! `by |interface, axes| expression` and `of_axis |interface, axis| expression` call the device in any other way; then
//! the client's method is written by hand.

/// Hands the list of all interfaces of devices to the macro `$then`: the method of [`Device`](crate::Device) that
/// returns it, and the trait.
macro_rules! device_interfaces {
    ($then:ident) => {
        $then! {
            /// Number, names and kinds of the axes (`IAxisInfo`).
            axis_info: AxisInfo;
            /// Point-to-point moves (`IPositionControl`).
            position_control: PositionControl;
            /// Moves at a given velocity (`IVelocityControl`).
            velocity_control: VelocityControl;
            /// Returns the joint encoders (`IEncodersTimed`).
            encoders: Encoders;
            /// Returns the control modes of the joints (`IControlMode`).
            control_mode: ControlMode;
            /// Returns the position and velocity limits (`IControlLimits`).
            control_limits: ControlLimits;
            /// Positions given step by step (`IPositionDirect`).
            position_direct: PositionDirect;
            /// Velocities given step by step (`IVelocityDirect`).
            velocity_direct: VelocityDirect;
            /// Torques at the joints (`ITorqueControl`).
            torque_control: TorqueControl;
            /// Currents of the motors (`ICurrentControl`).
            current_control: CurrentControl;
            /// Duty cycles of the motors (`IPWMControl`).
            pwm_control: PwmControl;
            /// Returns the interaction modes (`IInteractionMode`).
            interaction_mode: InteractionMode;
            /// Returns the impedance of compliant joints (`IImpedanceControl`).
            impedance_control: ImpedanceControl;
            /// The control loops (`IPidControl`).
            pid_control: PidControl;
            /// Returns the motor encoders (`IMotorEncoders`).
            motor_encoders: MotorEncoders;
            /// The motors themselves (`IMotor`).
            motor: Motor;
            /// The amplifiers (`IAmplifierControl`).
            amplifier_control: AmplifierControl;
            /// Calibration by the board (`IControlCalibration`).
            control_calibration: ControlCalibration;
            /// Calibration by a calibrator (`IRemoteCalibrator`).
            remote_calibrator: RemoteCalibrator;
            /// Variables of its own (`IRemoteVariables`).
            remote_variables: RemoteVariables;
            /// Settings that a board keeps while it is off (`IControlDebug`).
            control_debug: ControlDebug;
            /// Faults of the joints (`IJointFault`).
            joint_fault: JointFault;
            /// A stop of all joints by software; not in stock.
            software_stop: SoftwareStop;
            /// Brakes of the whole machine; not in stock.
            machine_brake: MachineBrake;
            /// Brakes (`IJointBrake`).
            joint_brake: JointBrake;
            /// Returns the Cartesian controller (`ICartesianControl`).
            cartesian_control: CartesianControl;
            /// Returns the gaze controller of a head (`IGazeControl`).
            gaze_control: GazeControl;
            /// A hand as a whole; no stock interface is like it.
            hand: Hand;
            /// Grasps by name; no stock interface is like it.
            grasp: Grasp;
            /// Images in colour (`IFrameGrabberImage`).
            frame_grabber_image: FrameGrabberImage;
            /// Images in one channel (`IFrameGrabberImageRaw`).
            frame_grabber_image_raw: FrameGrabberImageRaw;
            /// Returns the features of a camera (`IFrameGrabberControls`).
            frame_grabber_controls: FrameGrabberControls;
            /// Returns the controls of cameras on IEEE 1394 (`IFrameGrabberControlsDC1394`).
            firewire_controls: FirewireControls;
            /// Returns the optical parameters of a camera (`IRgbVisualParams`).
            rgb_visual_params: RgbVisualParams;
            /// Images with sound (`IAudioVisualGrabber`).
            audio_visual_grabber: AudioVisualGrabber;
            /// Content of a stream of images and sound (`IAudioVisualStream`).
            audio_visual_stream: AudioVisualStream;
            /// Receives images (`IFrameWriterImage`).
            frame_writer_image: FrameWriterImage;
            /// Receives images with sound (`IFrameWriterAudioVisual`).
            frame_writer_audio_visual: FrameWriterAudioVisual;
            /// Sound from a microphone (`IAudioGrabberSound`).
            audio_grabber: AudioGrabber;
            /// Sound to a loudspeaker (`IAudioRender`).
            audio_render: AudioRender;
            /// Returns the battery of a robot (`IBattery`).
            battery: Battery;
            /// Sensors of several kinds (stock: multiple analog sensors).
            analog_sensors: AnalogSensors;
            /// One sensor of several channels (`IAnalogSensor` of 3.x).
            analog_sensor: AnalogSensor;
            /// One sensor of several channels, such as an inertial one (`IGenericSensor`).
            generic_sensor: GenericSensor;
            /// Torques that are measured outside (`IVirtualAnalogSensor`).
            virtual_sensor: VirtualSensor;
            /// Bytes over a line (`ISerialDevice`).
            serial_device: SerialDevice;
            /// Programs on images (`IGPUDevice`).
            gpu_device: GpuDevice;
            /// Work that the host of the device starts and stops (`IService`).
            service: Service;
        }
    };
}
pub(crate) use device_interfaces;

/// Hands the descriptions of all interfaces of control boards to the macro `$then`, as one sequence.
#[doc(hidden)]
#[macro_export]
macro_rules! describe_board {
    (@next $then:ident, [] $($described:tt)*) => {
        $then! { $($described)* }
    };
    (@next $then:ident, [$first:ident $($rest:ident)*] $($described:tt)*) => {
        $crate::$first! { $then, [$($rest)*] $($described)* }
    };
    ($then:ident) => {
        $crate::wholly_described! { @for board $then [
            describe_axis_info
            describe_motion_control
            describe_position_control
            describe_velocity_control
            describe_encoders
            describe_control_mode
            describe_control_limits
            describe_position_direct
            describe_velocity_direct
            describe_torque_control
            describe_current_control
            describe_pwm_control
            describe_interaction_mode
            describe_pid_control
            describe_motor_encoders
            describe_amplifier_control
            describe_control_calibration
            describe_remote_calibrator
            describe_remote_variables
        ] }
    };
}

/// Lists the descriptions from which the methods of the remapper and of the client are made without any written by hand, and
/// hands each to the macro `$then`, as `describe_NAME {}`.
#[doc(hidden)]
#[macro_export]
macro_rules! wholly_described {
    ($then:ident) => {
        $crate::wholly_described! { @for each $then }
    };
    (@for $($what:tt)*) => {
        $crate::wholly_described! { @of [
            describe_impedance_control
            describe_motor
            describe_joint_fault
            describe_joint_brake
        ] $($what)* }
    };
    (@of [$($whole:ident)*] each $then:ident) => {
        $( $then! { $whole {} } )*
    };
    (@of [$($whole:ident)*] board $then:ident [$($partly:ident)*]) => {
        $crate::describe_board! { @next $then, [$($partly)* $($whole)*] }
    };
}

mod amplifier_control;
mod analog_sensor;
mod analog_sensors;
mod audio;
mod audio_grabber;
mod audio_render;
mod audio_visual_grabber;
mod audio_visual_stream;
mod axis_info;
mod battery;
mod cartesian_control;
mod control_calibration;
mod control_debug;
mod control_limits;
mod control_mode;
mod current_control;
mod encoders;
mod firewire_controls;
mod frame_grabber_controls;
mod frame_grabber_image;
mod frame_writer_audio_visual;
mod frame_writer_image;
mod gaze_control;
mod generic_sensor;
mod gpu_device;
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
mod service;
mod software_stop;
mod torque_control;
mod velocity_control;
mod velocity_direct;
mod virtual_sensor;

pub use amplifier_control::{AmplifierControl, AmplifierLimit};
pub use analog_sensor::AnalogSensor;
pub use analog_sensors::{AnalogSensors, SensorInfo, SensorKind, SensorReading, SensorStatus};
pub use audio::{Audio, AudioBufferSize};
pub use audio_grabber::AudioGrabber;
pub use audio_render::AudioRender;
pub use audio_visual_grabber::AudioVisualGrabber;
pub use audio_visual_stream::AudioVisualStream;
pub use axis_info::{AxisInfo, JointType};
pub use battery::{Battery, BatteryReading, BatteryStatus};
pub use cartesian_control::{
    CartesianControl, CartesianEvent, CartesianInfo, PoseSolution, Priority, StampedPose, Target,
    TaskPose, TaskVelocity, TweakChange, Tweaks,
};
pub use control_calibration::{CalibrationParameters, ControlCalibration};
pub use control_debug::ControlDebug;
pub use control_limits::{ControlLimits, Limits};
pub use control_mode::{ControlMode, Mode};
pub use current_control::CurrentControl;
pub use encoders::{EncoderReading, Encoders};
pub use firewire_controls::{FirewireControls, Window, WindowLimits};
pub use frame_grabber_controls::{
    Bus, CameraDescription, Feature, FeatureMode, FrameGrabberControls,
};
pub use frame_grabber_image::{FrameGrabberImage, FrameGrabberImageRaw};
pub use frame_writer_audio_visual::FrameWriterAudioVisual;
pub use frame_writer_image::FrameWriterImage;
pub use gaze_control::{
    Eye, FixationPoint, GazeAngles, GazeControl, GazeEvent, GazeEventKind, GazeFrame, GazeInfo,
    GazeOptions, GazeReference, GazeTarget, NeckJoint, StampedGazeAngles,
};
pub use generic_sensor::GenericSensor;
pub use gpu_device::{GpuArgument, GpuDevice, GpuProgram};
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
pub use service::{Service, ServiceStart, ServiceUpdate};
pub use software_stop::{MachineBrake, SoftwareStop, StopState};
pub use torque_control::{MotorTorqueParameters, TorqueControl};
pub use velocity_control::VelocityControl;
pub use velocity_direct::VelocityDirect;
pub use virtual_sensor::VirtualSensor;
