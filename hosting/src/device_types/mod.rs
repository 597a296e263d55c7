//! The table of device types.
//!
//! A device type is one line in [`DEVICE_TYPES`]: its name, the names that stock has for it, a
//! description, the wrapper with which `yarp dev` serves it, and the function that opens it.

mod analog_sensor_devices;
mod arms;
mod attached_server;
mod barrett_hand;
mod battery_devices;
mod board_remapper;
mod board_server;
mod calibrator;
mod camera_devices;
#[cfg(all(any(feature = "dc1394", feature = "v4l2"), target_os = "linux"))]
mod camera_parameters;
mod cartesian_devices;
#[cfg(all(feature = "dc1394", target_os = "linux"))]
mod dragonfly2;
mod fake_media;
mod fake_motion_control;
mod fake_sensors;
mod gaze_devices;
mod group_device;
mod inertial;
mod local_device;
mod multiple_analog_sensors_devices;
mod pipe_device;
mod remote_board;
mod robot_description;
#[cfg(all(feature = "v4l2", target_os = "linux"))]
mod usb_camera;
mod virtual_analog_server;

use yarp_ports::Network;
use yarp_wire::settings::{Origin, Parameters};
use yarp_wrappers::BatteryLayout;

use crate::{Attached, Future, HostError, Hosted, Parts};

/// Maximum depth of devices in devices, such as groups of pipes.
const MAX_DEPTH: usize = 8;

/// Arguments for opening a device.
#[derive(Clone, Copy)]
pub struct Opening<'a> {
    /// Network for its ports.
    pub network: &'a Network,
    /// Its parameters; unused ones are reported.
    pub parameters: &'a Parameters,
    /// Devices that are open already and can be named in the place of a type.
    opened: &'a [Attached],
    /// Number of devices that it is in.
    depth: usize,
}

impl<'a> Opening<'a> {
    /// Opens a device that is in no other.
    pub(crate) fn new(network: &'a Network, parameters: &'a Parameters) -> Self {
        Self {
            network,
            parameters,
            opened: &[],
            depth: 0,
        }
    }

    /// Opens a device in this one, with other parameters.
    fn inside<'b>(&self, parameters: &'b Parameters, opened: &'b [Attached]) -> Opening<'b>
    where
        'a: 'b,
    {
        Opening {
            network: self.network,
            parameters,
            opened,
            depth: self.depth + 1,
        }
    }

    /// Refuses devices in devices without end.
    pub(crate) fn check_depth(&self) -> Result<(), HostError> {
        if self.depth <= MAX_DEPTH {
            return Ok(());
        }
        Err(HostError::Nested {
            origin: self.parameters.origin().clone(),
            device: self.parameters.device().to_owned(),
            depth: self.depth,
            most: MAX_DEPTH,
        })
    }

    /// Returns an open device by its name; closing what is returned does not close it.
    pub(crate) fn link(&self, name: &str) -> Option<Box<dyn Hosted>> {
        let known = self.opened.iter().find(|known| known.device == name)?;
        Some(Box::new(Link(known.parts.clone())))
    }
}

/// Another name of a device that is open.
struct Link(Parts);

impl Hosted for Link {
    fn parts(&self) -> Parts {
        self.0.clone()
    }

    fn close(self: Box<Self>) -> Future<'static, ()> {
        Box::pin(async {})
    }
}

pub(crate) type OpenResult = Result<Box<dyn Hosted>, HostError>;
type Open = for<'a> fn(Opening<'a>) -> Future<'a, OpenResult>;

/// A device type.
pub struct DeviceType {
    /// Name.
    pub name: &'static str,
    /// Other names.
    pub aliases: &'static [&'static str],
    /// Description, on one line.
    pub about: &'static str,
    /// Default wrapper, which serves the device on the network.
    pub wrapper: Option<&'static str>,
    open: Open,
}

const SERVER: &str = "controlBoard_nws_yarp";
const CAMERA_SERVER: &str = "frameGrabber_nws_yarp";
const SENSOR_SERVER: &str = "multipleanalogsensorsserver";

/// The device type that tells which devices a robot has.
pub const ROBOT_DESCRIPTION: &str = "robotDescription_nws_yarp";

/// The device type that opens two devices; see [`open`](crate::open).
pub const BUNDLER: &str = "deviceBundler";

/// All device types.
#[rustfmt::skip]
pub const DEVICE_TYPES: &[DeviceType] = &[
    device_type("controlBoard_nws_yarp", &[], "serves joints on ports; name, period in seconds", None, |opening| Box::pin(board_server::open(opening))),
    device_type("controlboardwrapper2", &[], "the same with stock's old parameters; name, period in milliseconds, networks and joints for several devices", None, |opening| Box::pin(board_server::open_old(opening))),
    device_type("analogServer", &[], "serves a sensor of several channels as YARP 3.x; name, period in milliseconds, ports, sensor", None, |opening| Box::pin(analog_sensor_devices::server(opening))),
    device_type("analogsensorclient", &[], "a sensor of several channels served by another program, as YARP 3.x; remote, local, carrier", None, |opening| Box::pin(analog_sensor_devices::remote(opening))),
    device_type("barrettHand", &[], "a BarrettHand on a serial port as axes: three fingers and the spread; serial, baud", Some(SERVER), |opening| Box::pin(barrett_hand::open(opening))),
    device_type("batteryClient", &[], "a battery served by another program as in YARP 3.5; remote, local", None, |opening| Box::pin(battery_devices::remote(opening, BatteryLayout::Wrapper))),
    device_type("batteryWrapper", &[], "serves a battery on ports as in YARP 3.5; name, period in seconds", None, |opening| Box::pin(battery_devices::server(opening, BatteryLayout::Wrapper))),
    device_type("battery_nwc_yarp", &[], "a battery served by another program; remote, local, carrier", None, |opening| Box::pin(battery_devices::remote(opening, BatteryLayout::Nws))),
    device_type("battery_nws_yarp", &[], "serves a battery on ports; name, period in seconds", None, |opening| Box::pin(battery_devices::server(opening, BatteryLayout::Nws))),
    device_type("boardCalibrator", &[], "calibrates and parks boards, in actions of a robot", None, |opening| Box::pin(calibrator::open(opening))),
    device_type("canWam", &[], "a WAM arm on a CAN bus of this machine that is up; interface, homeConfirmed, zeroCalibration, payload, noGuard and others", Some(SERVER), |opening| Box::pin(arms::on_can_bus(opening))),
    device_type("cartesiancontrollerclient", &[], "a tool controlled by another program; remote, local, carrier, timeout", None, |opening| Box::pin(cartesian_devices::remote(opening))),
    device_type("cartesiancontrollerserver", &[], "serves the tool of a WAM on ports; GENERAL::ControllerName, GENERAL::ControllerPeriod in milliseconds", None, |opening| Box::pin(cartesian_devices::server(opening))),
    device_type("controlboardremapper", &["controlBoardRemapper"], "several devices as one board, or a part of one; axesNames, or joints, networks and a row of four numbers for each", Some(SERVER), |opening| Box::pin(board_remapper::open(opening))),
    #[cfg(all(feature = "dc1394", target_os = "linux"))]
    device_type("dragonfly2", &[], "an IIDC camera on IEEE 1394 or USB (libdc1394); guid or d, video_type or video_mode and coding, width, height, xoff, yoff, framerate, features", Some(CAMERA_SERVER), |opening| Box::pin(dragonfly2::open(opening))),
    device_type("dynamicWam", &[], "a simulated WAM arm with masses, friction and control; effects and others", Some(SERVER), |opening| Box::pin(arms::dynamic(opening))),
    device_type("embeddedWam", &[], "a WAM arm behind its embedded PC, which runs yarp wam-node; listen or connect, ports", Some(SERVER), |opening| Box::pin(arms::embedded(opening))),
    device_type("fakeAudioVisualGrabber", &[], "a simulated camera with a microphone that hears a tone; the parameters of fakeFrameGrabber", Some("grabber"), |opening| Box::pin(fake_media::camera_with_microphone(opening))),
    device_type("fakeBattery", &[], "a simulated battery; capacity in Ah, current in A", Some("battery_nws_yarp"), |opening| Box::pin(battery_devices::simulated(opening))),
    device_type("fakeFrameGrabber", &[], "a simulated camera: a test pattern, an image or a video; mode, src, width, height, freq or period, mirror", Some(CAMERA_SERVER), |opening| Box::pin(camera_devices::simulated(opening))),
    device_type("fakeIMU", &[], "an inertial sensor whose values count up; period in milliseconds, constantValue, sensorName, frameName", Some("inertial"), |opening| Box::pin(fake_sensors::imu(opening))),
    device_type("fakeMicrophone", &[], "a microphone that hears a tone, for pipe; signal_frequency in Hz, signal_amplitude", None, |opening| Box::pin(fake_media::microphone(opening))),
    device_type("fakeMotionControl", &[], "simulated joints of any number; GENERAL::Joints, GENERAL::AxisName, GENERAL::AxisType, GENERAL::Variables that are stored, LIMITS::Min, LIMITS::Max", Some(SERVER), |opening| Box::pin(fake_motion_control::open(opening))),
    device_type("fakeSensors", &[], "sensors at rest in the place of boards that are not there; ThreeAxisGyroscopesNames and so on, channels", Some(SENSOR_SERVER), |opening| Box::pin(fake_sensors::open(opening))),
    device_type("fakeSpeaker", &[], "a loudspeaker without output, for pipe; channels, rate", None, |opening| Box::pin(fake_media::speaker(opening))),
    device_type("remote_controlboard", &["controlBoard_nwc_yarp"], "joints served by another program; remote, local, carrier, timeout", None, |opening| Box::pin(remote_board::open(opening))),
    device_type("frameGrabber_nwc_yarp", &[], "a camera served by another program; remote, local, stream, no_stream", None, |opening| Box::pin(camera_devices::remote(opening))),
    device_type("frameGrabber_nws_yarp", &[], "serves a camera on ports; name, period in seconds, capabilities", None, |opening| Box::pin(camera_devices::server(opening))),
    device_type("gazecontrollerclient", &[], "the gaze of a head controlled by iCub's iKinGazeCtrl; remote, local, carrier, timeout", None, |opening| Box::pin(gaze_devices::remote(opening))),
    device_type("grabber", &[], "the same with the old name, and sound if there is any; name, name2 or shared-ports, period in milliseconds or framerate", None, |opening| Box::pin(camera_devices::server_with_sound(opening))),
    device_type("grabberDual", &[], "the same with the old name, without sound; name, period in milliseconds", None, |opening| Box::pin(camera_devices::old_server(opening))),
    device_type("group", &[], "several devices; part, the names of groups of parameters, one for each device", None, |opening| Box::pin(group_device::open(opening))),
    device_type("imageFolderWriter", &[], "writes images and sound to files, for pipe; folder, max_images, max_sound_bytes, max_bytes", None, |opening| Box::pin(fake_media::image_folder_writer(opening))),
    device_type("inertial", &[], "serves an inertial sensor as YARP 3.x, as twelve numbers on one port; name, period in seconds, sensor", None, |opening| Box::pin(inertial::open(opening))),
    device_type("multipleanalogsensorsclient", &[], "sensors served by another program; remote, local, carrier, timeout", None, |opening| Box::pin(multiple_analog_sensors_devices::remote(opening))),
    device_type("multipleanalogsensorsremapper", &[], "sensors of several devices as one; ThreeAxisGyroscopesNames and so on, a list of names for each kind", None, |opening| Box::pin(multiple_analog_sensors_devices::remapper(opening))),
    device_type("multipleanalogsensorsserver", &[], "serves sensors on ports; name, period in milliseconds, measure_lists 10 or 12", None, |opening| Box::pin(multiple_analog_sensors_devices::server(opening))),
    device_type("pipe", &[], "passes images and sound of one device on to another; source, sink, each a type or a group of parameters", None, |opening| Box::pin(pipe_device::open(opening))),
    device_type("remotecontrolboardremapper", &["remoteControlBoardRemapper"], "boards served by other programs as one; axesNames, remoteControlBoards, localPortPrefix, REMOTE_CONTROLBOARD_OPTIONS", Some(SERVER), |opening| Box::pin(board_remapper::open_remote(opening))),
    device_type(ROBOT_DESCRIPTION, &[], "tells which devices a robot has, once attached to yriDescriptionStorage; local", None, |opening| Box::pin(robot_description::open(opening))),
    device_type("simulatedCanWam", &[], "a simulated WAM arm with the effects of a real one, behind the driver of its CAN bus; homeConfirmed, effects and others", Some(SERVER), |opening| Box::pin(arms::on_simulated_bus(opening))),
    device_type("simulatedSensors", &[], "an IMU and a force/torque sensor on the arm it attaches to, or on one of its own; imu, ft, frame, mass, centre, copies", Some(SENSOR_SERVER), |opening| Box::pin(multiple_analog_sensors_devices::simulated(opening))),
    device_type("skinWrapper", &[], "serves a skin as iCub, on /ROBOT/skin/PART; robotName, period in milliseconds, ports", None, |opening| Box::pin(analog_sensor_devices::skin(opening))),
    #[cfg(all(feature = "v4l2", target_os = "linux"))]
    device_type("usbCamera", &[], "a camera of this machine (V4L2); d /dev/videoN, width, height, framerate, format, flip, crop, features", Some(CAMERA_SERVER), |opening| Box::pin(usb_camera::open(opening))),
    device_type("virtualAnalogServer", &[], "takes the torques of joints from another program; name, networks and a row of four numbers for each", None, |opening| Box::pin(virtual_analog_server::open(opening))),
    device_type("simulatedWam", &[], "a simulated WAM arm that moves exactly as commanded", Some(SERVER), |opening| Box::pin(arms::ideal(opening))),
];

const fn device_type(
    name: &'static str,
    aliases: &'static [&'static str],
    about: &'static str,
    wrapper: Option<&'static str>,
    open: Open,
) -> DeviceType {
    DeviceType {
        name,
        aliases,
        about,
        wrapper,
        open,
    }
}

impl DeviceType {
    /// Opens a device of this type.
    pub fn open<'a>(&self, opening: Opening<'a>) -> Future<'a, OpenResult> {
        (self.open)(opening)
    }

    fn names(&self) -> impl Iterator<Item = &'static str> {
        std::iter::once(self.name).chain(self.aliases.iter().copied())
    }
}

/// Returns true if a device of type `name` can be opened, as [`open`](crate::open) does.
pub fn is_known(name: &str) -> bool {
    name == BUNDLER
        || DEVICE_TYPES
            .iter()
            .any(|kind| kind.names().any(|known| known == name))
}

/// Returns the type named `name`, the value of the parameter `asked`.
pub fn find<'a>(
    name: &str,
    parameters: &Parameters,
    asked: &str,
) -> Result<&'a DeviceType, HostError> {
    let called = |kind: &&DeviceType| kind.names().any(|known| known == name);
    DEVICE_TYPES.iter().find(called).ok_or_else(|| {
        let same = |known: &&str| known.eq_ignore_ascii_case(name);
        let close = DEVICE_TYPES.iter().flat_map(DeviceType::names).find(same);
        let origin = parameters.settings().origin(asked);
        let origin = origin.filter(|origin| **origin != Origin::Program);
        HostError::UnknownDeviceType {
            origin: origin.unwrap_or(parameters.origin()).clone(),
            device: parameters.device().to_owned(),
            kind: name.to_owned(),
            hint: close.map_or(String::new(), |close| format!(", but there is {close}")),
        }
    })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn names_of_device_types_are_unique() {
        let names: Vec<_> = DEVICE_TYPES.iter().flat_map(DeviceType::names).collect();
        let distinct: BTreeSet<_> = names.iter().collect();
        assert_eq!(distinct.len(), names.len());
        assert!(!names.contains(&BUNDLER));
        for wrapper in DEVICE_TYPES.iter().filter_map(|kind| kind.wrapper) {
            assert!(names.contains(&wrapper));
        }
    }
}
