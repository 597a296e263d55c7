//! The kernel's video devices.
//!
//! The calls of the kernel are those of the crate `linuxvideo`. It panics where a driver says something that it does not know;
//! [`contained`] turns that into an error.

use std::collections::BTreeSet;
use std::fmt::Display;
use std::fs;
use std::io;
use std::os::unix::fs::FileTypeExt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::time::Duration;

use linuxvideo::format::{FrameSizes, PixFormat, PixelFormat};
use linuxvideo::stream::ReadStream;
use linuxvideo::{BufType, BufTypes, Device, Fract, VideoCaptureDevice};
use rustix::event::{PollFd, PollFlags, Timespec, poll};

use super::Encoding;
use super::buffer_conversion::FrameLayout;
use super::kernel_controls::KernelControls;
use super::mode_selection::{Offer, SizeSteps, Wanted, choose, offers_of};
use super::video_driver::{FilledBuffer, FrameStream, OpenedDevice, VideoDriver};
use crate::{Bus, CameraDescription, DeviceError};

/// Maximum number of formats that are looked at.
const MAX_FORMATS: usize = 64;
/// Units of a second in which a rate is asked for.
const RATE_UNITS: u32 = 1000;

/// A device file of the kernel, for instance `/dev/video0`.
pub(super) struct LinuxDriver {
    path: PathBuf,
}

impl LinuxDriver {
    /// Creates the driver of a device file, which is not opened yet.
    pub(super) fn new(path: PathBuf) -> Self {
        Self { path }
    }

    fn failed(&self, step: &str, error: io::Error) -> DeviceError {
        let advice = match error.kind() {
            io::ErrorKind::NotFound => "whether the camera is plugged in (ls /dev/video*)",
            io::ErrorKind::PermissionDenied => "as a member of the group video",
            io::ErrorKind::ResourceBusy => "after closing other programs that use the camera",
            _ => "plugging the camera in again, and `d` with another /dev/video*",
        };
        DeviceError::Remote {
            peer: self.path.display().to_string(),
            step: step.to_owned(),
            advice: advice.to_owned(),
            source: Some(error.into()),
        }
    }

    fn check_device_file(&self) -> Result<(), DeviceError> {
        let kind =
            fs::metadata(&self.path).map_err(|error| self.failed("finding the camera", error))?;
        if kind.file_type().is_char_device() {
            return Ok(());
        }
        Err(DeviceError::Unsuitable {
            what: "the camera",
            asked: self.path.display().to_string(),
            expected: "a device file such as /dev/video0".to_owned(),
        })
    }

    fn open_device(&self, wanted: &Wanted) -> Result<OpenedDevice, DeviceError> {
        self.check_device_file()?;
        let step = "opening the camera";
        let device = Device::open(&self.path).map_err(|error| self.failed(step, error))?;
        let types = device.supported_buf_types();
        if !types.contains(BufTypes::VIDEO_CAPTURE) {
            return Err(DeviceError::Unsuitable {
                what: "the camera",
                asked: self.path.display().to_string(),
                expected: "a device that captures video in one plane; try the other /dev/video*"
                    .to_owned(),
            });
        }
        let description = description(&device);
        let offers = offers(&device, wanted);
        let chosen = choose(&offers, wanted)?;
        let controls = KernelControls::open(&self.path);
        let controls = controls.map_err(|error| self.failed("reading the controls", error))?;
        let (capture, layout) = self.set_format(device, &chosen)?;
        let rate = self.set_rate(&capture, wanted.rate);
        let step = "starting the stream";
        let stream = capture
            .into_stream()
            .map_err(|error| self.failed(step, error))?;
        // A buffer is waited for with a timeout, and never taken by a call that blocks.
        let flags = rustix::fs::fcntl_getfl(&stream).and_then(|flags| {
            rustix::fs::fcntl_setfl(&stream, flags | rustix::fs::OFlags::NONBLOCK)
        });
        flags.map_err(|error| self.failed(step, error.into()))?;
        tracing::info!(
            "{}: {}, {} x {} {}, {} images a second",
            self.path.display(),
            description.description,
            layout.size().0,
            layout.size().1,
            layout.encoding(),
            rate.map_or("an unknown number of".to_owned(), |rate| format!(
                "{rate:.3}"
            )),
        );
        Ok(OpenedDevice {
            stream: Box::new(LinuxStream { stream }),
            controls: Box::new(controls),
            offers,
            description,
            layout,
            rate,
        })
    }

    /// Sets size and encoding, and returns the layout that the driver made of it.
    fn set_format(
        &self,
        device: Device,
        chosen: &Offer,
    ) -> Result<(VideoCaptureDevice, FrameLayout), DeviceError> {
        let step = "setting size and format";
        let refused = |error: &dyn Display| self.failed(step, io::Error::other(error.to_string()));
        let (width, height) = chosen.size;
        // Sides of an offer come from numbers of 32 bits.
        let format = PixFormat::new(width as u32, height as u32, pixel_format(chosen.encoding));
        let capture = device
            .video_capture(format)
            .map_err(|error| self.failed(step, error))?;
        let format = capture.format();
        let size = (format.width() as usize, format.height() as usize);
        if encoding(format.pixel_format()) != Some(chosen.encoding) || size != chosen.size {
            let got = format!("{} x {} {}", size.0, size.1, format.pixel_format());
            let wanted = format!("{width} x {height} {}", chosen.encoding);
            return Err(refused(&format!(
                "the driver chose {got} instead of {wanted}"
            )));
        }
        let (line, buffer) = (
            format.bytes_per_line() as usize,
            format.size_image() as usize,
        );
        let layout = FrameLayout::new(chosen.encoding, size, line, buffer);
        let layout = layout.map_err(|error| refused(&error))?;
        Ok((capture, layout))
    }

    /// Asks for a rate, and returns the one that the driver agreed to.
    fn set_rate(&self, capture: &VideoCaptureDevice, rate: Option<f64>) -> Option<f64> {
        let rate = rate?;
        let units = (rate * f64::from(RATE_UNITS)).round().max(1.0) as u32;
        match capture.set_frame_interval(Fract::new(RATE_UNITS, units)) {
            Ok(interval) => rate_of(&interval),
            Err(error) => {
                tracing::warn!("{}: the rate cannot be set: {error}", self.path.display());
                None
            }
        }
    }
}

impl VideoDriver for LinuxDriver {
    fn open(&mut self, wanted: &Wanted) -> Result<OpenedDevice, DeviceError> {
        let opened = contained(|| self.open_device(wanted));
        opened.unwrap_or_else(|error| Err(self.failed("opening the camera", error)))
    }
}

/// Calls a function of the library, and returns an error if it panics.
fn contained<T>(call: impl FnOnce() -> T) -> io::Result<T> {
    catch_unwind(AssertUnwindSafe(call)).map_err(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str);
        let text = text.or(panic.downcast_ref::<&str>().copied());
        let text = text.unwrap_or("no reason");
        io::Error::other(format!("the driver said something unexpected: {text}"))
    })
}

fn description(device: &Device) -> CameraDescription {
    let Ok(capabilities) = device.capabilities() else {
        return CameraDescription::default();
    };
    CameraDescription {
        bus: match capabilities.bus_info().starts_with("usb") {
            true => Bus::Usb,
            false => Bus::Unknown,
        },
        description: format!("{} ({})", capabilities.card(), capabilities.bus_info()),
    }
}

fn encoding(format: PixelFormat) -> Option<Encoding> {
    Encoding::from_fourcc(std::str::from_utf8(&format.as_fourcc()).ok()?)
}

/// Returns the known encodings among the first formats of a list that a driver may never end.
fn encodings(formats: impl Iterator<Item = io::Result<PixelFormat>>) -> BTreeSet<Encoding> {
    let formats = formats.take(MAX_FORMATS).filter_map(Result::ok);
    formats.filter_map(encoding).collect()
}

fn pixel_format(encoding: Encoding) -> PixelFormat {
    match encoding {
        Encoding::Rgb => PixelFormat::RGB3,
        Encoding::Bgr => PixelFormat::BGR3,
        Encoding::Yuyv => PixelFormat::YUYV,
        Encoding::Mjpg => PixelFormat::MJPG,
    }
}

fn rate_of(interval: &Fract) -> Option<f64> {
    let rate = f64::from(interval.denominator()) / f64::from(interval.numerator());
    Some(rate).filter(|rate| rate.is_finite() && *rate > 0.0)
}

/// Returns the sizes and encodings of a device.
fn offers(device: &Device, wanted: &Wanted) -> Vec<Offer> {
    let formats = device.formats(BufType::VIDEO_CAPTURE);
    let encodings = encodings(formats.map(|format| Ok(format?.pixel_format())));
    let mut offers = Vec::new();
    for encoding in encodings {
        let format = pixel_format(encoding);
        let sizes = match device.frame_sizes(format) {
            Ok(FrameSizes::Discrete(sizes)) => sizes
                .iter()
                .map(|size| (size.width() as usize, size.height() as usize))
                .collect(),
            Ok(FrameSizes::Stepwise(steps) | FrameSizes::Continuous(steps)) => {
                let steps = SizeSteps {
                    min: (steps.min_width(), steps.min_height()),
                    max: (steps.max_width(), steps.max_height()),
                    step: (steps.step_width(), steps.step_height()),
                };
                steps.sizes(wanted.size)
            }
            Err(error) => {
                tracing::debug!("no sizes of {encoding}: {error}");
                // A driver that lists no sizes may still take the wanted one.
                Vec::from_iter(wanted.size)
            }
        };
        offers.extend(offers_of(encoding, sizes, |(width, height)| {
            let intervals = device.frame_intervals(format, width as u32, height as u32);
            rate_of(&intervals.ok()?.min())
        }));
    }
    offers
}

struct LinuxStream {
    stream: ReadStream,
}

impl FrameStream for LinuxStream {
    fn wait(&mut self, timeout: Duration) -> io::Result<bool> {
        let timeout = Timespec::try_from(timeout).map_err(io::Error::other)?;
        let mut files = [PollFd::new(&self.stream, PollFlags::IN)];
        match poll(&mut files, Some(&timeout)) {
            Ok(0) | Err(rustix::io::Errno::INTR) => Ok(false),
            Ok(_) if files[0].revents().contains(PollFlags::IN) => Ok(true),
            // Gone, or in a state of error that only a new stream ends.
            Ok(_) if files[0].revents().contains(PollFlags::HUP) => {
                Err(rustix::io::Errno::NODEV.into())
            }
            Ok(_) => Err(io::Error::other(
                "the driver has stopped the stream (POLLERR)",
            )),
            Err(error) => Err(error.into()),
        }
    }

    fn take(&mut self, use_buffer: &mut dyn FnMut(FilledBuffer<'_>)) -> io::Result<()> {
        contained(|| {
            self.stream.dequeue(|buffer| {
                use_buffer(FilledBuffer {
                    bytes: &buffer,
                    damaged: buffer.is_error(),
                });
                Ok(())
            })
        })?
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(path: &str) -> String {
        let opened = LinuxDriver::new(path.into()).open(&Wanted::default());
        match opened {
            Ok(_) => panic!("{path} is a camera"),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn what_is_no_camera_is_refused() {
        let missing = refusal("/dev/video-that-is-not-there");
        assert!(missing.contains("video-that-is-not-there"), "{missing}");
        assert!(missing.contains("plugged in"), "{missing}");
        let file = tempfile::NamedTempFile::new().unwrap();
        let plain = refusal(file.path().to_str().unwrap());
        assert!(plain.contains("/dev/video0"), "{plain}");
        let other = refusal("/dev/null");
        assert!(
            other.contains("opening the camera with /dev/null"),
            "{other}"
        );
    }

    #[test]
    fn a_panic_of_the_library_is_an_error() {
        let error = contained(|| -> () { panic!("unknown frame size type {}", 7) }).unwrap_err();
        assert!(error.to_string().contains("type 7"), "{error}");
        assert_eq!(contained(|| 3).unwrap(), 3);
    }

    #[test]
    fn a_list_of_formats_without_an_end_is_cut() {
        let mut listed = 0;
        let formats = std::iter::from_fn(|| {
            listed += 1;
            assert!(listed <= MAX_FORMATS, "it goes on");
            Some(match listed {
                1 => Ok(PixelFormat::MJPG),
                2 => Err(io::ErrorKind::InvalidInput.into()),
                3 => Ok(PixelFormat::YUYV),
                _ => Ok(PixelFormat::XRGB32),
            })
        });
        assert_eq!(
            encodings(formats),
            BTreeSet::from([Encoding::Yuyv, Encoding::Mjpg])
        );
        assert_eq!(listed, MAX_FORMATS);
    }

    #[test]
    fn a_rate_is_the_reciprocal_of_an_interval() {
        assert_eq!(rate_of(&Fract::new(1, 30)), Some(30.0));
        assert_eq!(rate_of(&Fract::new(0, 30)), None);
    }
}
