//! Controls of a device of the kernel, one call for each.
//!
//! The crate `linuxvideo` lists controls from the second on, and brightness is the first; hence these three calls. Structures and
//! numbers are those of `linux/videodev2.h` and `linux/v4l2-controls.h`.

#![allow(
    unsafe_code,
    reason = "the kernel's calls for controls have no safe interface"
)]

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io;
use std::os::fd::AsFd;
use std::path::Path;

use rustix::io::Errno;
use rustix::ioctl::{Opcode, Updater, ioctl, opcode};

use super::camera_controls::{Control, ControlPort};
use crate::camera::hardware::ControlRange;

/// First number of the controls of any video device (`V4L2_CID_BASE`).
const USER: u32 = 0x0098_0900;
/// First number of the controls of cameras (`V4L2_CID_CAMERA_CLASS_BASE`).
const CAMERA: u32 = 0x009a_0900;

/// Controls and their numbers.
const CONTROLS: [(Control, u32); 24] = [
    (Control::AutoBrightness, USER + 32),
    (Control::AutoExposure, CAMERA + 1),
    (Control::AutoWhiteBalance, USER + 12),
    (Control::AutoHue, USER + 25),
    (Control::AutoGain, USER + 18),
    (Control::AutoFocus, CAMERA + 12),
    (Control::DoWhiteBalance, USER + 13),
    (Control::StartFocus, CAMERA + 28),
    (Control::Brightness, USER),
    (Control::ExposureAbsolute, CAMERA + 2),
    (Control::Exposure, USER + 17),
    (Control::Sharpness, USER + 27),
    (Control::BlueBalance, USER + 15),
    (Control::RedBalance, USER + 14),
    (Control::WhiteBalanceTemperature, USER + 26),
    (Control::Hue, USER + 3),
    (Control::Saturation, USER + 2),
    (Control::Gamma, USER + 16),
    (Control::Gain, USER + 19),
    (Control::Iris, CAMERA + 17),
    (Control::Focus, CAMERA + 10),
    (Control::Zoom, CAMERA + 13),
    (Control::Pan, CAMERA + 8),
    (Control::Tilt, CAMERA + 9),
];

/// Flag of a control that a driver has switched off.
const DISABLED: u32 = 0x0001;
/// Flag of a control that can only be read.
const READ_ONLY: u32 = 0x0004;
/// Flag of a control whose value is not a number.
const HAS_PAYLOAD: u32 = 0x0100;

/// `struct v4l2_queryctrl`.
#[repr(C)]
#[derive(Default)]
struct QueryControl {
    id: u32,
    kind: u32,
    name: [u8; 32],
    minimum: i32,
    maximum: i32,
    step: i32,
    default_value: i32,
    flags: u32,
    reserved: [u32; 2],
}

/// `struct v4l2_control`.
#[repr(C)]
struct ControlValue {
    id: u32,
    value: i32,
}

const QUERY: Opcode = opcode::read_write::<QueryControl>(b'V', 36);
const GET: Opcode = opcode::read_write::<ControlValue>(b'V', 27);
const SET: Opcode = opcode::read_write::<ControlValue>(b'V', 28);

fn query(device: &File, argument: &mut QueryControl) -> rustix::io::Result<()> {
    // SAFETY: VIDIOC_QUERYCTRL reads and writes one `v4l2_queryctrl`, and keeps no pointer to it.
    unsafe {
        ioctl(
            device.as_fd(),
            Updater::<QUERY, QueryControl>::new(argument),
        )
    }
}

fn get(device: &File, argument: &mut ControlValue) -> rustix::io::Result<()> {
    // SAFETY: VIDIOC_G_CTRL reads and writes one `v4l2_control`, and keeps no pointer to it.
    unsafe { ioctl(device.as_fd(), Updater::<GET, ControlValue>::new(argument)) }
}

fn set(device: &File, argument: &mut ControlValue) -> rustix::io::Result<()> {
    // SAFETY: VIDIOC_S_CTRL reads and writes one `v4l2_control`, and keeps no pointer to it.
    unsafe { ioctl(device.as_fd(), Updater::<SET, ControlValue>::new(argument)) }
}

/// The controls of a device, which is opened for them alone.
pub(super) struct KernelControls {
    device: File,
    ranges: BTreeMap<Control, ControlRange>,
}

impl KernelControls {
    /// Opens a device, and asks for the ranges of its controls.
    pub(super) fn open(path: &Path) -> io::Result<Self> {
        let device = OpenOptions::new().read(true).write(true).open(path)?;
        let mut ranges = BTreeMap::new();
        for (control, id) in CONTROLS {
            let mut answer = QueryControl {
                id,
                ..QueryControl::default()
            };
            match query(&device, &mut answer) {
                Ok(()) => ranges.extend(range(&answer).map(|range| (control, range))),
                // Unknown to the driver, which may know no control at all.
                Err(Errno::INVAL | Errno::NOTTY) => {}
                Err(error) => return Err(error.into()),
            }
        }
        Ok(Self { device, ranges })
    }
}

/// Returns the range of a control that can be set to a number.
fn range(answer: &QueryControl) -> Option<ControlRange> {
    let is_usable = answer.flags & (DISABLED | READ_ONLY | HAS_PAYLOAD) == 0;
    is_usable.then_some(ControlRange {
        min: answer.minimum,
        max: answer.maximum,
        step: answer.step,
    })
}

impl ControlPort for KernelControls {
    fn ranges(&self) -> &BTreeMap<Control, ControlRange> {
        &self.ranges
    }

    fn read(&self, control: Control) -> io::Result<i32> {
        let mut argument = ControlValue {
            id: id_of(control)?,
            value: 0,
        };
        get(&self.device, &mut argument)?;
        Ok(argument.value)
    }

    fn write(&mut self, control: Control, value: i32) -> io::Result<()> {
        let id = id_of(control)?;
        Ok(set(&self.device, &mut ControlValue { id, value })?)
    }
}

fn id_of(control: Control) -> io::Result<u32> {
    let mut known = CONTROLS.iter();
    let known = known.find(|(known, _)| *known == control);
    known
        .map(|(_, id)| *id)
        .ok_or(io::ErrorKind::Unsupported.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Calls and numbers as strace(1) and v4l2-ctl(1) print them.
    #[test]
    fn calls_and_numbers_are_those_of_the_kernel() {
        assert_eq!([QUERY, GET, SET], [0xc044_5624, 0xc008_561b, 0xc008_561c]);
        for (control, id) in [
            (Control::Brightness, 0x0098_0900),
            (Control::Saturation, 0x0098_0902),
            (Control::Gain, 0x0098_0913),
            (Control::WhiteBalanceTemperature, 0x0098_091a),
            (Control::AutoExposure, 0x009a_0901),
            (Control::ExposureAbsolute, 0x009a_0902),
            (Control::Focus, 0x009a_090a),
        ] {
            assert_eq!(id_of(control).unwrap(), id, "{control:?}");
        }
        for (control, id) in CONTROLS {
            let same = CONTROLS
                .iter()
                .filter(|other| other.0 == control || other.1 == id);
            assert_eq!(same.count(), 1, "{control:?}");
        }
    }

    #[test]
    fn controls_that_cannot_be_set_to_a_number_are_left_out() {
        let with = |flags| {
            range(&QueryControl {
                minimum: -3,
                maximum: 4,
                step: 2,
                flags,
                ..QueryControl::default()
            })
        };
        let expected = ControlRange {
            min: -3,
            max: 4,
            step: 2,
        };
        // Grabbed, volatile, slider and inactive ones can be set, now or later.
        assert_eq!(with(0x0002 | 0x0010 | 0x0020 | 0x0080), Some(expected));
        for flag in [DISABLED, READ_ONLY, HAS_PAYLOAD] {
            assert_eq!(with(flag), None);
        }
        assert!(
            KernelControls::open(Path::new("/dev/null")).is_ok_and(|one| one.ranges.is_empty())
        );
    }
}
