//! A camera with its settings, which are made again after it was unplugged.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::bindings::{
    FIRST_CODING, FIRST_MODE, FIRST_RATE, ISO_SPEED_400, OPERATION_MODE_LEGACY, RECOMMENDED, index,
};
use super::frame_conversion::{Coding, FrameError, check_buffer, checked_size};
use super::iidc_options::FORMAT_7;
use super::iidc_state::Shared;
use super::opened_camera::OpenedCamera;
use super::video_modes::{
    check_window, contains, fixed_mode, hertz, image_bytes, listed, nearest_rate, numbers,
    packet_bytes, packet_rate, rate_not_above, usual_window,
};
use super::{IidcChoice, IidcFormat, IidcOptions};
use crate::camera::hardware::FeatureValue;
use crate::image::PixelFormat;
use crate::{Bus, CameraConfiguration, DeviceError, Window, WindowLimits};

const ON: i32 = 1;
/// Factory settings (IIDC: memory channel 0).
const FACTORY_CHANNEL: u32 = 0;

/// Video mode of a camera as it is set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct VideoSetting {
    pub(super) mode: u32,
    pub(super) size: (usize, usize),
    /// Number of the rate, except in format 7.
    rate: Option<u32>,
    /// Coding, window and bytes in a packet, in format 7.
    region: Option<Region>,
}

/// Settings of format 7.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Region {
    coding: u32,
    window: Window,
    packet_bytes: u32,
}

/// Settings of the bus that callers have made.
#[derive(Clone, Copy, Debug, Default)]
struct BusSetting {
    is_1394b: Option<bool>,
    iso_speed: Option<u32>,
}

/// Settings of a feature that callers have made.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct ChosenFeature {
    pub(super) active: Option<bool>,
    pub(super) automatic: Option<bool>,
    pub(super) value: Option<u32>,
    pub(super) pair: Option<(u32, u32)>,
}

/// A camera that may be unplugged and come back.
pub(super) struct Session {
    options: IidcOptions,
    shared: Arc<Shared>,
    camera: Option<OpenedCamera>,
    /// GUID of the camera that was opened first. Another camera is never opened instead of it.
    guid: Option<u64>,
    video: Option<VideoSetting>,
    bus: BusSetting,
    pub(super) features: BTreeMap<u32, ChosenFeature>,
    /// Number of times that the camera was found.
    openings: u32,
    /// Number of starts of the capture.
    pub(super) starts: u64,
    transmitting: bool,
    powered: bool,
    capturing: bool,
    /// Bytes in a packet of the last frame.
    pub(super) last_packet_bytes: Option<u32>,
}

impl Session {
    /// Creates the session of a camera that is not open yet.
    pub(super) fn new(options: IidcOptions, shared: Arc<Shared>) -> Self {
        Self {
            options,
            shared,
            camera: None,
            guid: None,
            video: None,
            bus: BusSetting::default(),
            features: BTreeMap::new(),
            openings: 0,
            starts: 0,
            transmitting: true,
            powered: true,
            capturing: true,
            last_packet_bytes: None,
        }
    }

    /// Opens the camera, makes its settings, and starts it.
    pub(super) fn open(&mut self) -> Result<(), DeviceError> {
        let choice = self.guid.map_or(self.options.choice, IidcChoice::Guid);
        let camera = OpenedCamera::open(choice)?;
        let guid = camera.guid();
        self.camera = Some(camera);
        self.openings = self.openings.saturating_add(1);
        let outcome = self.set_up();
        match outcome {
            Ok(()) => self.guid = Some(guid),
            Err(_) => self.close(),
        }
        outcome
    }

    fn set_up(&mut self) -> Result<(), DeviceError> {
        self.switch_on()?;
        // A program that ended without closing it may have left it sending.
        self.camera_mut()?.stop_capture()?;
        let camera = self.camera()?;
        let description = camera.description();
        let device = &self.shared.capture.device;
        match self.is_repeated() {
            false => tracing::info!("{device}: {}", description.description),
            true => tracing::debug!("{device}: {}", description.description),
        }
        self.shared.state().description = description;
        if let Some(is_1394b) = self.bus.is_1394b {
            self.set_1394b(is_1394b)?;
        }
        self.set_starting_speed()?;
        match self.video {
            Some(video) => self.apply_video(&video)?,
            None => {
                self.choose_video()?;
                self.set_starting_features();
            }
        }
        self.apply_features();
        if !self.powered {
            self.set_power(false)?;
        }
        self.start()
    }

    /// Sets the speed of the bus that a caller has chosen, or else the usual one.
    fn set_starting_speed(&self) -> Result<(), DeviceError> {
        if let Some(speed) = self.bus.iso_speed {
            return self.write_iso_speed(i32::try_from(speed).unwrap_or(i32::MAX));
        }
        let Some(speed) = usual_speed(self.camera()?.description().bus) else {
            return Ok(());
        };
        if let Err(error) = self.write_iso_speed(speed) {
            let device = &self.shared.capture.device;
            match self.is_repeated() {
                false => tracing::info!("{device}: {error}"),
                true => tracing::debug!("{device}: {error}"),
            }
        }
        Ok(())
    }

    fn write_iso_speed(&self, speed: i32) -> Result<(), DeviceError> {
        let camera = self.camera()?;
        let set = camera.api().video_set_iso_speed;
        camera.set("setting the speed of the bus", speed, set)
    }

    /// Returns true from the second reopening on, of which messages were logged before.
    fn is_repeated(&self) -> bool {
        self.openings > 2
    }

    /// Switches a camera on that can be off, unless a caller has switched it off.
    fn switch_on(&self) -> Result<(), DeviceError> {
        let camera = self.camera()?;
        if !self.powered || !camera.has_power_switch() {
            return Ok(());
        }
        let set = camera.api().camera_set_power;
        camera.set("switching the camera on", ON, set)
    }

    /// Closes the camera, which ends its transmission.
    pub(super) fn close(&mut self) {
        self.camera = None;
    }

    /// Returns the camera, if it is plugged in.
    pub(super) fn camera(&self) -> Result<&OpenedCamera, DeviceError> {
        self.camera.as_ref().ok_or_else(|| not_open(&self.shared))
    }

    /// Returns the camera for taking frames.
    pub(super) fn camera_mut(&mut self) -> Result<&mut OpenedCamera, DeviceError> {
        self.camera.as_mut().ok_or_else(|| not_open(&self.shared))
    }

    /// Returns whether images are expected.
    pub(super) fn is_sending(&self) -> bool {
        self.transmitting && self.powered && self.capturing
    }

    /// Starts capture and transmission, as far as callers have not switched them off.
    fn start(&mut self) -> Result<(), DeviceError> {
        let video = self.read_video()?;
        self.check_frame_bytes(&video)?;
        let (capturing, transmitting) = (self.capturing, self.transmitting);
        let camera = self.camera_mut()?;
        if capturing {
            camera.start_capture()?;
        }
        // Frames that nobody takes only load the bus.
        let transmitting = capturing && transmitting;
        let set = camera.api().video_set_transmission;
        camera.set("starting the transmission", i32::from(transmitting), set)?;
        self.starts += 1;
        self.shared.state().size = video.size;
        self.video = Some(video);
        Ok(())
    }

    /// Refuses frames for which the library would allocate too much.
    fn check_frame_bytes(&self, video: &VideoSetting) -> Result<(), DeviceError> {
        let Some(region) = video.region else {
            return Ok(());
        };
        let packets = self.packets(video.mode)?;
        check_buffer(packets, region.packet_bytes).map_err(|error| self.refused(&error))
    }

    fn refused(&self, error: &FrameError) -> DeviceError {
        DeviceError::Remote {
            peer: self.shared.capture.device.clone(),
            step: "setting the video mode".to_owned(),
            advice: "another video mode".to_owned(),
            source: Some(error.to_string().into()),
        }
    }

    /// Changes something that may not be changed during a capture. What fails leaves the video mode as it was.
    fn change_video(
        &mut self,
        change: impl FnOnce(&Self) -> Result<(), DeviceError>,
    ) -> Result<(), DeviceError> {
        let before = self.video;
        self.camera_mut()?.stop_capture()?;
        let outcome = change(self).and_then(|()| self.start());
        if outcome.is_err() {
            self.camera_mut()?.stop_capture()?;
            if let Some(before) = before {
                self.apply_video(&before)?;
            }
            self.start()?;
        }
        outcome
    }

    fn choose_video(&self) -> Result<(), DeviceError> {
        let mask = self.modes()?;
        let mut chosen = None;
        for format in &self.options.formats {
            let has = match *format {
                IidcFormat::Fixed(mode) => contains(mask, mode),
                IidcFormat::Scalable { mode, coding, .. } => {
                    contains(mask, mode) && contains(self.codings(mode)?, coding)
                }
            };
            if has {
                chosen = Some(*format);
                break;
            }
        }
        if chosen.is_none() && !self.options.formats.is_empty() {
            let asked = self.options.formats.iter().map(|one| match one {
                IidcFormat::Fixed(mode) => mode.to_string(),
                IidcFormat::Scalable { mode, coding, .. } => format!("{mode} with coding {coding}"),
            });
            let asked: Vec<_> = asked.collect();
            let mut scalable = String::new();
            for mode in numbers(mask).filter(|mode| *mode >= FORMAT_7) {
                scalable = format!(
                    "{scalable}; {mode} with coding {}",
                    listed(self.codings(mode)?)
                );
            }
            return Err(DeviceError::Unsuitable {
                what: "video mode",
                asked: asked.join(" or "),
                expected: format!("one of {}{scalable}", listed(mask)),
            });
        }
        match chosen {
            Some(IidcFormat::Scalable {
                mode,
                coding,
                window,
            }) => {
                self.set_mode_number(mode)?;
                let limits = self.limits_of(mode)?;
                let window = usual_window(window, &limits);
                self.set_region(mode, coding, window, RECOMMENDED)?;
            }
            Some(IidcFormat::Fixed(mode)) => self.set_mode_number(mode)?,
            None => {}
        }
        match self.options.rate {
            Some(rate) => self.apply_rate(rate),
            None => Ok(()),
        }
    }

    /// Sets the rate that is nearest to the images a second.
    fn apply_rate(&self, wanted: f64) -> Result<(), DeviceError> {
        let mode = self.mode()?;
        if mode >= FORMAT_7 {
            return self.set_region_rate(mode, wanted);
        }
        let rate = nearest_rate(self.rates_of(mode)?, wanted);
        match rate {
            Some(rate) => self.set_rate_number(rate),
            None => Ok(()),
        }
    }

    fn set_region_rate(&self, mode: u32, wanted: f64) -> Result<(), DeviceError> {
        let region = self.region(mode)?;
        let bytes = self.region_bytes(&region)?;
        let (unit, max) = self.packet_limits(mode)?;
        let packet = packet_bytes(bytes, wanted, unit, max);
        let packet = i32::try_from(packet).unwrap_or(RECOMMENDED);
        self.set_region(mode, region.coding, region.window, packet)
    }

    fn region_bytes(&self, region: &Region) -> Result<u64, DeviceError> {
        let coding = Coding::of_number(region.coding)
            .ok_or_else(|| self.refused(&FrameError::Coding(region.coding)))?;
        Ok(image_bytes(
            region.window.width,
            region.window.height,
            coding,
        ))
    }

    fn packet_limits(&self, mode: u32) -> Result<(u32, u32), DeviceError> {
        let camera = self.camera()?;
        let get = camera.api().format7_get_packet_parameters;
        camera.get_pair("reading the limits of packets", raw_mode(mode), get)
    }

    fn packets(&self, mode: u32) -> Result<u32, DeviceError> {
        let camera = self.camera()?;
        let get = camera.api().format7_get_packets_per_frame;
        camera.get_of("reading the packets of a frame", raw_mode(mode), get)
    }

    fn set_mode_number(&self, mode: u32) -> Result<(), DeviceError> {
        let camera = self.camera()?;
        let set = camera.api().video_set_mode;
        camera.set("setting the video mode", raw_mode(mode), set)
    }

    fn set_rate_number(&self, rate: u32) -> Result<(), DeviceError> {
        let camera = self.camera()?;
        let set = camera.api().video_set_framerate;
        camera.set("setting the rate", FIRST_RATE + rate as i32, set)
    }

    fn set_region(
        &self,
        mode: u32,
        coding: u32,
        window: Window,
        packet: i32,
    ) -> Result<(), DeviceError> {
        check_window(window, &self.limits_of(mode)?)?;
        // The limits are numbers of 16 bits.
        let corner = [window.x, window.y, window.width, window.height].map(|side| side as i32);
        let coding = FIRST_CODING + coding as i32;
        self.camera()?
            .set_region(raw_mode(mode), coding, packet, corner)
    }

    fn region(&self, mode: u32) -> Result<Region, DeviceError> {
        let camera = self.camera()?;
        let (api, item) = (camera.api(), raw_mode(mode));
        let step = "reading the window";
        let (width, height) = camera.get_pair(step, item, api.format7_get_image_size)?;
        let (x, y) = camera.get_pair(step, item, api.format7_get_image_position)?;
        let coding = camera.get_of("reading the coding", item, api.format7_get_color_coding)?;
        let step = "reading the bytes in a packet";
        Ok(Region {
            coding: index(coding, FIRST_CODING),
            window: Window {
                width,
                height,
                x,
                y,
            },
            packet_bytes: camera.get_of(step, item, api.format7_get_packet_size)?,
        })
    }

    /// Reads the video mode as it is.
    fn read_video(&self) -> Result<VideoSetting, DeviceError> {
        let mode = self.mode()?;
        if mode >= FORMAT_7 {
            let region = self.region(mode)?;
            let (width, height) = (region.window.width, region.window.height);
            return Ok(VideoSetting {
                mode,
                size: checked_size(width, height).map_err(|error| self.refused(&error))?,
                rate: None,
                region: Some(region),
            });
        }
        let (width, height, _) = fixed_mode(mode).ok_or_else(|| DeviceError::NotSupported {
            what: format!("video mode {mode}"),
        })?;
        let camera = self.camera()?;
        let rate = camera.get("reading the rate", camera.api().video_get_framerate)?;
        Ok(VideoSetting {
            mode,
            size: (width as usize, height as usize),
            rate: Some(index(rate, FIRST_RATE)),
            region: None,
        })
    }

    fn apply_video(&self, video: &VideoSetting) -> Result<(), DeviceError> {
        self.set_mode_number(video.mode)?;
        if let Some(rate) = video.rate {
            self.set_rate_number(rate)?;
        }
        if let Some(region) = video.region {
            let packet = i32::try_from(region.packet_bytes).unwrap_or(RECOMMENDED);
            self.set_region(video.mode, region.coding, region.window, packet)?;
        }
        Ok(())
    }

    /// Returns the video modes, a mask.
    pub(super) fn modes(&self) -> Result<u32, DeviceError> {
        let camera = self.camera()?;
        let get = camera.api().video_get_supported_modes;
        Ok(camera.get("reading the video modes", get)?.mask(FIRST_MODE))
    }

    /// Returns the video mode.
    pub(super) fn mode(&self) -> Result<u32, DeviceError> {
        let camera = self.camera()?;
        let mode = camera.get("reading the video mode", camera.api().video_get_mode)?;
        Ok(index(mode, FIRST_MODE))
    }

    /// Sets the video mode; in format 7 with the window that the camera has there.
    pub(super) fn set_mode(&mut self, mode: u32) -> Result<(), DeviceError> {
        let mask = self.modes()?;
        if !contains(mask, mode) {
            return Err(DeviceError::Unsuitable {
                what: "video mode",
                asked: mode.to_string(),
                expected: format!("one of {}", listed(mask)),
            });
        }
        self.change_video(|session| {
            session.set_mode_number(mode)?;
            session.settle_mode(mode)
        })
    }

    /// Makes the settings of a new mode valid: a rate that it has, a window that is not empty.
    fn settle_mode(&self, mode: u32) -> Result<(), DeviceError> {
        if mode >= FORMAT_7 {
            let region = self.region(mode)?;
            let window = usual_window(region.window, &self.limits_of(mode)?);
            return self.set_region(mode, region.coding, window, RECOMMENDED);
        }
        let camera = self.camera()?;
        let rate = camera.get("reading the rate", camera.api().video_get_framerate)?;
        // A rate that IIDC does not list says nothing; the fastest is taken.
        let rate = hertz(index(rate, FIRST_RATE));
        self.apply_rate(rate.unwrap_or(f64::MAX))
    }

    fn rates_of(&self, mode: u32) -> Result<u32, DeviceError> {
        let camera = self.camera()?;
        let get = camera.api().video_get_supported_framerates;
        let rates = camera.get_of("reading the rates", raw_mode(mode), get)?;
        Ok(rates.mask(FIRST_RATE))
    }

    /// Returns the rates, a mask; in format 7 those up to the one of the largest packets.
    pub(super) fn rates(&self) -> Result<u32, DeviceError> {
        let mode = self.mode()?;
        if mode < FORMAT_7 {
            return self.rates_of(mode);
        }
        let (_, max) = self.packet_limits(mode)?;
        let bytes = self.region_bytes(&self.region(mode)?)?;
        let packets = bytes.div_ceil(u64::from(max.max(1)));
        let fastest = packet_rate(u32::try_from(packets).unwrap_or(u32::MAX));
        Ok((1 << (rate_not_above(fastest) + 1)) - 1)
    }

    /// Returns the rate; in format 7 the next slower one of those that there are.
    pub(super) fn rate(&self) -> Result<u32, DeviceError> {
        let mode = self.mode()?;
        if mode >= FORMAT_7 {
            return Ok(rate_not_above(packet_rate(self.packets(mode)?)));
        }
        let camera = self.camera()?;
        let rate = camera.get("reading the rate", camera.api().video_get_framerate)?;
        Ok(index(rate, FIRST_RATE))
    }

    /// Sets the rate; in format 7 by the bytes in a packet.
    pub(super) fn set_rate(&mut self, rate: u32) -> Result<(), DeviceError> {
        let mask = self.rates()?;
        if !contains(mask, rate) {
            return Err(DeviceError::Unsuitable {
                what: "rate",
                asked: rate.to_string(),
                expected: format!("one of {}", listed(mask)),
            });
        }
        let mode = self.mode()?;
        self.change_video(|session| match mode >= FORMAT_7 {
            true => session.set_region_rate(mode, known_hertz(rate)?),
            false => session.set_rate_number(rate),
        })
    }

    /// Returns the images a second.
    pub(super) fn hertz(&self) -> Result<f64, DeviceError> {
        let mode = self.mode()?;
        match mode >= FORMAT_7 {
            true => Ok(packet_rate(self.packets(mode)?)),
            false => known_hertz(self.rate()?),
        }
    }

    /// Returns size and highest rate of each video mode.
    pub(super) fn sizes(&self) -> Result<Vec<CameraConfiguration>, DeviceError> {
        let configuration = |(width, height), rate| CameraConfiguration {
            width,
            height,
            rate,
            format: PixelFormat::Rgb,
        };
        let mask = self.modes()?;
        let mut sizes = Vec::new();
        for mode in numbers(mask) {
            if mode >= FORMAT_7 {
                let limits = self.limits_of(mode)?;
                if let Ok(size) = checked_size(limits.width, limits.height) {
                    sizes.push(configuration(size, self.hertz()?));
                }
            } else if let Some((width, height, _)) = fixed_mode(mode) {
                let rates = self.rates_of(mode)?;
                let fastest = rates.checked_ilog2().and_then(hertz).unwrap_or(0.0);
                sizes.push(configuration((width as usize, height as usize), fastest));
            }
        }
        let mut distinct = Vec::new();
        for one in sizes {
            if !distinct.contains(&one) {
                distinct.push(one);
            }
        }
        Ok(distinct)
    }

    /// Returns the codings of a video mode, a mask.
    pub(super) fn codings(&self, mode: u32) -> Result<u32, DeviceError> {
        if let Some((_, _, coding)) = fixed_mode(mode) {
            return Ok(1 << coding as u32);
        }
        if !(FORMAT_7..32).contains(&mode) {
            return Err(DeviceError::NotSupported {
                what: format!("video mode {mode}"),
            });
        }
        let camera = self.camera()?;
        let get = camera.api().format7_get_color_codings;
        let codings = camera.get_of("reading the codings", raw_mode(mode), get)?;
        Ok(codings.mask(FIRST_CODING))
    }

    /// Returns the coding.
    pub(super) fn coding(&self) -> Result<u32, DeviceError> {
        let mode = self.mode()?;
        match fixed_mode(mode) {
            Some((_, _, coding)) => Ok(coding as u32),
            None => Ok(self.region(mode)?.coding),
        }
    }

    /// Sets the coding; in format 7 only, since the other modes have one each.
    pub(super) fn set_coding(&mut self, coding: u32) -> Result<(), DeviceError> {
        let mode = self.mode()?;
        let mask = self.codings(mode)?;
        if !contains(mask, coding) {
            return Err(DeviceError::Unsuitable {
                what: "colour coding",
                asked: coding.to_string(),
                expected: format!("one of {}", listed(mask)),
            });
        }
        if mode < FORMAT_7 {
            return Ok(());
        }
        let window = self.region(mode)?.window;
        self.change_video(|session| session.set_region(mode, coding, window, RECOMMENDED))
    }

    fn limits_of(&self, mode: u32) -> Result<WindowLimits, DeviceError> {
        let camera = self.camera()?;
        let (api, item) = (camera.api(), raw_mode(mode));
        let step = "reading the limits of windows";
        let (width, height) = camera.get_pair(step, item, api.format7_get_max_image_size)?;
        let (width_step, height_step) = camera.get_pair(step, item, api.format7_get_unit_size)?;
        let (x_step, y_step) = camera.get_pair(step, item, api.format7_get_unit_position)?;
        Ok(WindowLimits {
            width,
            height,
            width_step,
            height_step,
            x_step,
            y_step,
        })
    }

    /// Returns the limits of windows, in the first mode of format 7 if the camera is in none.
    pub(super) fn window_limits(&self) -> Result<WindowLimits, DeviceError> {
        let (mode, mask) = (self.mode()?, self.modes()?);
        let scalable = numbers(mask).find(|one| *one >= FORMAT_7);
        let mode = Some(mode).filter(|mode| *mode >= FORMAT_7).or(scalable);
        let mode = mode.ok_or_else(|| DeviceError::NotSupported {
            what: "a window".to_owned(),
        })?;
        self.limits_of(mode)
    }

    /// Returns the window.
    pub(super) fn window(&self) -> Result<Window, DeviceError> {
        let video = self.read_video()?;
        Ok(match video.region {
            Some(region) => region.window,
            None => Window {
                width: video.size.0 as u32,
                height: video.size.1 as u32,
                x: 0,
                y: 0,
            },
        })
    }

    /// Sets the window, at the rate that there is.
    pub(super) fn set_window(&mut self, window: Window) -> Result<(), DeviceError> {
        let mode = self.mode()?;
        if mode < FORMAT_7 {
            return Err(DeviceError::NotSupported {
                what: "a window in another video mode than format 7 (24 to 31)".to_owned(),
            });
        }
        let rate = self.hertz()?;
        let coding = self.region(mode)?.coding;
        check_window(window, &self.limits_of(mode)?)?;
        self.change_video(|session| {
            session.set_region(mode, coding, window, RECOMMENDED)?;
            session.set_region_rate(mode, rate)
        })
    }

    /// Sets the size of the images: as a window in format 7, else by another video mode, of the same coding if there is one.
    pub(super) fn set_size(&mut self, (width, height): (usize, usize)) -> Result<(), DeviceError> {
        let (mode, mask, coding) = (self.mode()?, self.modes()?, self.coding()?);
        if mode >= FORMAT_7 {
            let side = |side: usize| u32::try_from(side).unwrap_or(u32::MAX);
            let (width, height) = (side(width), side(height));
            let (x, y) = (0, 0);
            return self.set_window(Window {
                width,
                height,
                x,
                y,
            });
        }
        let of_size = |mode: &u32| {
            fixed_mode(*mode).is_some_and(|(w, h, _)| (w as usize, h as usize) == (width, height))
        };
        let modes = numbers(mask).filter(|mode| *mode < FORMAT_7);
        let same = |mode: &u32| fixed_mode(*mode).is_some_and(|(_, _, one)| one as u32 == coding);
        let fitting: Vec<u32> = modes.filter(of_size).collect();
        let chosen = fitting
            .iter()
            .copied()
            .find(same)
            .or(fitting.first().copied());
        match chosen {
            Some(mode) => self.set_mode(mode),
            None => Err(DeviceError::Unsuitable {
                what: "resolution",
                asked: format!("{width} x {height}"),
                expected: format!("the size of one of the video modes {}", listed(mask)),
            }),
        }
    }

    /// Returns the bytes in a packet.
    pub(super) fn packet_bytes(&self) -> Result<u32, DeviceError> {
        let mode = self.mode()?;
        match mode >= FORMAT_7 {
            true => Ok(self.region(mode)?.packet_bytes),
            false => self.last_packet_bytes.ok_or(DeviceError::NoDataYet {
                what: "image since the start",
            }),
        }
    }

    /// Sets the bytes in a packet, in format 7 only.
    pub(super) fn set_packet_bytes(&mut self, bytes: u32) -> Result<(), DeviceError> {
        let mode = self.mode()?;
        if mode < FORMAT_7 {
            return Err(DeviceError::NotSupported {
                what: "a packet size in another video mode than format 7 (24 to 31)".to_owned(),
            });
        }
        let (unit, max) = self.packet_limits(mode)?;
        if bytes == 0 || bytes > max || !bytes.is_multiple_of(unit.max(1)) {
            return Err(DeviceError::Unsuitable {
                what: "bytes in a packet",
                asked: bytes.to_string(),
                expected: format!("a multiple of {unit} up to {max}"),
            });
        }
        let region = self.region(mode)?;
        // At most `max`, a number of 16 bits.
        self.change_video(|session| {
            session.set_region(mode, region.coding, region.window, bytes as i32)
        })
    }

    /// Returns the speed of the bus.
    pub(super) fn iso_speed(&self) -> Result<u32, DeviceError> {
        let camera = self.camera()?;
        let speed = camera.get(
            "reading the speed of the bus",
            camera.api().video_get_iso_speed,
        )?;
        Ok(index(speed, 0))
    }

    /// Sets the speed of the bus.
    pub(super) fn set_iso_speed(&mut self, speed: u32) -> Result<(), DeviceError> {
        self.write_iso_speed(i32::try_from(speed).unwrap_or(i32::MAX))?;
        self.bus.iso_speed = Some(speed);
        Ok(())
    }

    /// Returns whether the bus runs in IEEE 1394b mode.
    pub(super) fn is_1394b(&self) -> Result<bool, DeviceError> {
        let camera = self.camera()?;
        let get = camera.api().video_get_operation_mode;
        let mode = camera.get("reading the mode of the bus", get)?;
        Ok(mode != OPERATION_MODE_LEGACY)
    }

    /// Sets whether the bus runs in IEEE 1394b mode.
    pub(super) fn set_1394b(&mut self, is_1394b: bool) -> Result<(), DeviceError> {
        let camera = self.camera()?;
        let mode = OPERATION_MODE_LEGACY + i32::from(is_1394b);
        let set = camera.api().video_set_operation_mode;
        camera.set("IEEE 1394b", mode, set)?;
        self.bus.is_1394b = Some(is_1394b);
        Ok(())
    }

    /// Returns whether the camera sends.
    pub(super) fn is_transmitting(&self) -> Result<bool, DeviceError> {
        let camera = self.camera()?;
        let get = camera.api().video_get_transmission;
        Ok(camera.get("reading the transmission", get)? == ON)
    }

    /// Starts or stops sending; while no images are taken, only for the time after that.
    pub(super) fn set_transmission(&mut self, on: bool) -> Result<(), DeviceError> {
        let camera = self.camera()?;
        let set = camera.api().video_set_transmission;
        let on_bus = i32::from(on && self.capturing);
        camera.set("switching the transmission", on_bus, set)?;
        self.transmitting = on;
        Ok(())
    }

    /// Sets whether commands go to all cameras.
    pub(super) fn set_broadcast(&mut self, on: bool) -> Result<(), DeviceError> {
        let camera = self.camera()?;
        camera.set(
            "a broadcast on this bus",
            i32::from(on),
            camera.api().camera_set_broadcast,
        )
    }

    /// Switches the camera on or off.
    pub(super) fn set_power(&mut self, on: bool) -> Result<(), DeviceError> {
        let camera = self.camera()?;
        if !camera.has_power_switch() {
            return Err(DeviceError::NotSupported {
                what: "switching the camera off".to_owned(),
            });
        }
        camera.set(
            "switching the camera",
            i32::from(on),
            camera.api().camera_set_power,
        )?;
        self.powered = on;
        Ok(())
    }

    /// Starts or stops taking images, and with it the transmission.
    pub(super) fn set_capture(&mut self, on: bool) -> Result<(), DeviceError> {
        self.camera()?;
        self.capturing = on;
        self.change_video(|_| Ok(()))
    }

    /// Loads the factory settings, and makes the settings of the start.
    pub(super) fn set_defaults(&mut self) -> Result<(), DeviceError> {
        self.restore(|camera| camera.load_memory(FACTORY_CHANNEL))
    }

    /// Resets the camera, and makes the settings of the start.
    pub(super) fn reset(&mut self) -> Result<(), DeviceError> {
        self.restore(OpenedCamera::reset)
    }

    /// Changes all settings of the camera, and makes those of the start.
    fn restore(
        &mut self,
        change: impl FnOnce(&OpenedCamera) -> Result<(), DeviceError>,
    ) -> Result<(), DeviceError> {
        self.camera()?;
        (self.transmitting, self.powered, self.capturing) = (true, true, true);
        self.bus = BusSetting::default();
        self.features.clear();
        self.change_video(|session| {
            change(session.camera()?)?;
            session.switch_on()?;
            session.set_starting_speed()?;
            session.choose_video()
        })?;
        self.set_starting_features();
        Ok(())
    }

    fn set_starting_features(&mut self) {
        let common = self.options.common.clone();
        let shared = Arc::clone(&self.shared);
        common.set_features(&shared.capture.device, |feature, value| match value {
            FeatureValue::One(value) => self.set_value(feature, value),
            FeatureValue::Pair(values) => self.set_pair(feature, values),
        });
    }

    fn apply_features(&self) {
        for (number, chosen) in &self.features {
            if let Err(error) = self.apply_feature(*number, chosen) {
                let device = &self.shared.capture.device;
                match self.is_repeated() {
                    false => {
                        tracing::warn!("{device}: feature {number} could not be set again: {error}")
                    }
                    true => tracing::debug!(
                        "{device}: feature {number} could not be set again: {error}"
                    ),
                }
            }
        }
    }
}

/// Returns the speed of a bus that cameras do not choose by themselves. Some cameras on IEEE 1394 begin with 100 Mbit/s.
fn usual_speed(bus: Bus) -> Option<i32> {
    (bus == Bus::Firewire).then_some(ISO_SPEED_400)
}

/// Returns the images a second of a rate, or an error for one that IIDC does not list.
fn known_hertz(rate: u32) -> Result<f64, DeviceError> {
    hertz(rate).ok_or_else(|| DeviceError::NotSupported {
        what: format!("the unknown rate {rate}"),
    })
}

/// Returns the library's number of a video mode.
fn raw_mode(mode: u32) -> i32 {
    FIRST_MODE + mode as i32
}

fn not_open(shared: &Shared) -> DeviceError {
    DeviceError::Remote {
        peer: shared.capture.device.clone(),
        step: "using the camera".to_owned(),
        advice: "whether the camera is plugged in, and again".to_owned(),
        source: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_speed_of_firewire_is_set() {
        assert_eq!(usual_speed(Bus::Firewire), Some(2));
        assert_eq!(usual_speed(Bus::Usb), None);
    }

    #[test]
    fn a_rate_outside_the_list_is_unknown() {
        assert_eq!(known_hertz(4).unwrap(), 30.0);
        let words = known_hertz(index(0, FIRST_RATE)).unwrap_err().to_string();
        assert!(words.contains("unknown rate"), "{words}");
    }
}
