//! The simulated camera as one on IEEE 1394.
//!
//! Video mode, window and rate change the images; without transmission, power or capture there are none. The speed of
//! the bus, the kind of the bus and the bytes in a packet are stored and reported, and change nothing. A broadcast
//! reaches no other camera. Programs receive RGB for any coding on the bus, as with stock's drivers.

use super::SimulatedCamera;
use super::simulated_camera::State;
use crate::image::{Crop, Image};
use crate::{DeviceError, FirewireControls, Window, WindowLimits};

/// Video modes with a size of their own: number, size, and the coding on the bus.
const FIXED_SIZE_MODES: [(u32, (usize, usize), u32); 3] = [
    (0, (160, 120), YUV_444),
    (1, (320, 240), YUV_422),
    (4, (640, 480), RGB),
];
/// The one video mode of any size.
const FORMAT_7: u32 = 24;
const YUV_422: u32 = 2;
const YUV_444: u32 = 3;
const RGB: u32 = 4;
/// Number of rates.
const RATE_COUNT: u32 = 8;
/// The slowest rate, images a second.
const MIN_RATE: f64 = 1.875;
/// The fastest speed of the bus: 3200 Mbit/s.
const MAX_BUS_SPEED: u32 = 5;
/// The largest packet of the fastest bus, bytes.
const MAX_PACKET_BYTES: u32 = 32768;
/// The sensor is at least as large as this.
pub(super) const SENSOR: (usize, usize) = (640, 480);

/// FeatureSettings of the bus.
#[derive(Clone, Debug)]
pub(super) struct BusState {
    in_format_7: bool,
    /// Relative to the whole sensor, scaled to the size of the images.
    window: Option<Window>,
    iso_speed: u32,
    is_1394b: bool,
    transmitting: bool,
    powered: bool,
    capturing: bool,
    bytes_per_packet: u32,
}

impl Default for BusState {
    fn default() -> Self {
        Self {
            in_format_7: false,
            window: None,
            iso_speed: 2,
            is_1394b: false,
            transmitting: true,
            powered: true,
            capturing: true,
            bytes_per_packet: 4096,
        }
    }
}

impl BusState {
    /// Returns whether images are sent.
    pub(super) fn is_sending(&self) -> bool {
        self.transmitting && self.powered && self.capturing
    }

    /// The size of the images was set from elsewhere.
    pub(super) fn leave_format_7(&mut self) {
        self.in_format_7 = false;
        self.window = None;
    }

    /// The part of the sensor to take; `None` for all of it, in the size of the images.
    pub(super) fn window(&self) -> Option<Window> {
        self.window
    }
}

/// Returns the part of an image of the whole sensor.
pub(super) fn part(sensor: &Image, window: Window) -> Result<Image, DeviceError> {
    let place = |place: u32| i32::try_from(place).unwrap_or(i32::MAX);
    let last = |first: u32, count: u32| place(first.saturating_add(count)).saturating_sub(1);
    let corner = (last(window.x, window.width), last(window.y, window.height));
    Crop::Rectangle((place(window.x), place(window.y)), corner).of(sensor)
}

impl State {
    fn video_mode(&self) -> u32 {
        let size = (self.width, self.height);
        let fixed = FIXED_SIZE_MODES
            .iter()
            .find(|(_, of_mode, _)| *of_mode == size);
        match fixed {
            Some((mode, ..)) if !self.bus.in_format_7 => *mode,
            _ => FORMAT_7,
        }
    }
}

/// The coding of a video mode on the bus; each has one.
fn coding(video_mode: u32) -> Result<u32, DeviceError> {
    if video_mode == FORMAT_7 {
        return Ok(RGB);
    }
    let fixed = FIXED_SIZE_MODES
        .iter()
        .find(|(mode, ..)| *mode == video_mode);
    let (_, _, coding) = fixed.ok_or_else(|| no_video_mode(video_mode))?;
    Ok(*coding)
}

fn no_video_mode(asked: u32) -> DeviceError {
    unsuitable("video mode", asked, "0, 1, 4 or 24")
}

fn unsuitable(what: &'static str, asked: u32, expected: impl Into<String>) -> DeviceError {
    DeviceError::Unsuitable {
        what,
        asked: asked.to_string(),
        expected: expected.into(),
    }
}

impl SimulatedCamera {
    fn on_bus<T>(&self, what: impl FnOnce(&mut BusState) -> T) -> Result<T, DeviceError> {
        Ok(what(&mut self.state().bus))
    }
}

impl FirewireControls for SimulatedCamera {
    /// Pictures with a size of their own are in format 7 only.
    fn video_modes(&self) -> Result<u32, DeviceError> {
        let fixed = match self.has_own_size() {
            true => 0,
            false => FIXED_SIZE_MODES.iter().map(|(mode, ..)| 1 << mode).sum(),
        };
        Ok(fixed | 1 << FORMAT_7)
    }

    fn video_mode(&self) -> Result<u32, DeviceError> {
        if self.has_own_size() {
            return Ok(FORMAT_7);
        }
        Ok(self.state().video_mode())
    }

    /// To format 7 the images keep their size.
    fn set_video_mode(&self, mode: u32) -> Result<(), DeviceError> {
        if mode == FORMAT_7 {
            return self.on_bus(|bus| bus.in_format_7 = true);
        }
        self.check_sizable()?;
        let fixed = FIXED_SIZE_MODES.iter().find(|(known, ..)| *known == mode);
        let (_, size, _) = fixed.ok_or_else(|| no_video_mode(mode))?;
        let mut state = self.state();
        (state.width, state.height) = *size;
        state.bus.leave_format_7();
        Ok(())
    }

    fn rates(&self) -> Result<u32, DeviceError> {
        Ok((1 << RATE_COUNT) - 1)
    }

    /// The fastest that is no faster than the camera is.
    fn rate(&self) -> Result<u32, DeviceError> {
        let now = self.state().rate;
        let slower = (0..RATE_COUNT).rev().find(|rate| hertz(*rate) <= now);
        Ok(slower.unwrap_or(0))
    }

    fn set_rate(&self, rate: u32) -> Result<(), DeviceError> {
        if rate >= RATE_COUNT {
            return Err(unsuitable("rate", rate, "0 to 7"));
        }
        self.state().rate = hertz(rate);
        Ok(())
    }

    fn iso_speed(&self) -> Result<u32, DeviceError> {
        self.on_bus(|bus| bus.iso_speed)
    }

    fn set_iso_speed(&self, speed: u32) -> Result<(), DeviceError> {
        if speed > MAX_BUS_SPEED {
            return Err(unsuitable("speed of the bus", speed, "0 to 5"));
        }
        self.on_bus(|bus| bus.iso_speed = speed)
    }

    fn color_codings(&self, video_mode: u32) -> Result<u32, DeviceError> {
        Ok(1 << coding(video_mode)?)
    }

    fn color_coding(&self) -> Result<u32, DeviceError> {
        coding(self.video_mode()?)
    }

    /// Each video mode has one.
    fn set_color_coding(&self, asked: u32) -> Result<(), DeviceError> {
        let only = self.color_coding()?;
        if asked != only {
            return Err(unsuitable("colour coding", asked, only.to_string()));
        }
        Ok(())
    }

    fn window_limits(&self) -> Result<WindowLimits, DeviceError> {
        let (width, height) = self.sensor();
        let side = |side: usize| u32::try_from(side).unwrap_or(u32::MAX);
        Ok(WindowLimits {
            width: side(width),
            height: side(height),
            width_step: 1,
            height_step: 1,
            x_step: 1,
            y_step: 1,
        })
    }

    fn window(&self) -> Result<Window, DeviceError> {
        let side = |side: usize| u32::try_from(side).unwrap_or(u32::MAX);
        if let Some(window) = self.state().bus.window {
            return Ok(window);
        }
        let (width, height) = crate::RgbVisualParams::resolution(self)?;
        Ok(Window {
            width: side(width),
            height: side(height),
            x: 0,
            y: 0,
        })
    }

    fn set_window(&self, window: Window) -> Result<(), DeviceError> {
        self.check_sizable()?;
        let (width, height) = self.sensor();
        let fits = |first: u32, count: u32, all: usize| {
            let end = u64::from(first) + u64::from(count);
            count > 0 && usize::try_from(end).is_ok_and(|end| end <= all)
        };
        if !fits(window.x, window.width, width) || !fits(window.y, window.height, height) {
            return Err(DeviceError::Unsuitable {
                what: "window",
                asked: format!(
                    "{} x {} from {} {}",
                    window.width, window.height, window.x, window.y
                ),
                expected: format!("a part of {width} x {height}"),
            });
        }
        let mut state = self.state();
        if !state.bus.in_format_7 {
            return Err(DeviceError::NotSupported {
                what: "a window in another video mode than format 7 (24)".to_owned(),
            });
        }
        (state.width, state.height) = (window.width as usize, window.height as usize);
        state.bus.window = Some(window);
        Ok(())
    }

    fn is_1394b(&self) -> Result<bool, DeviceError> {
        self.on_bus(|bus| bus.is_1394b)
    }

    fn set_1394b(&self, is_1394b: bool) -> Result<(), DeviceError> {
        self.on_bus(|bus| bus.is_1394b = is_1394b)
    }

    fn is_transmitting(&self) -> Result<bool, DeviceError> {
        self.on_bus(|bus| bus.transmitting)
    }

    fn set_transmission(&self, on: bool) -> Result<(), DeviceError> {
        self.on_bus(|bus| bus.transmitting = on)
    }

    /// There is no other camera on its bus.
    fn set_broadcast(&self, _: bool) -> Result<(), DeviceError> {
        Ok(())
    }

    /// Except the features.
    fn set_defaults(&self) -> Result<(), DeviceError> {
        let (size, rate) = self.as_started();
        let mut state = self.state();
        (state.width, state.height) = size;
        state.rate = rate;
        state.bus = BusState::default();
        Ok(())
    }

    /// Resets the camera to its defaults.
    fn reset(&self) -> Result<(), DeviceError> {
        self.set_defaults()
    }

    fn set_power(&self, on: bool) -> Result<(), DeviceError> {
        self.on_bus(|bus| bus.powered = on)
    }

    fn set_capture(&self, on: bool) -> Result<(), DeviceError> {
        self.on_bus(|bus| bus.capturing = on)
    }

    fn bytes_per_packet(&self) -> Result<u32, DeviceError> {
        self.on_bus(|bus| bus.bytes_per_packet)
    }

    fn set_bytes_per_packet(&self, bytes: u32) -> Result<(), DeviceError> {
        if !(1..=MAX_PACKET_BYTES).contains(&bytes) {
            let expected = format!("1 to {MAX_PACKET_BYTES}");
            return Err(unsuitable("bytes in a packet", bytes, expected));
        }
        self.on_bus(|bus| bus.bytes_per_packet = bytes)
    }
}

/// Images a second at a rate.
fn hertz(rate: u32) -> f64 {
    MIN_RATE * f64::from(1_u32 << rate)
}
