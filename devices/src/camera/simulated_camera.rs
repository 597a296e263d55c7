//! The camera as a device.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use super::camera_images::ImageSource;
use super::camera_options::check_angles;
use super::feature_settings::{FeatureSettings, FeatureState};
use super::simulated_firewire::{self, BusState};
use super::{CameraOptions, LatestValue};
use crate::clock::{self, TimeSource};
use crate::image::{Frame, MAX_IMAGE_SIDE, PixelFormat};
use crate::{
    AudioVisualStream, Bus, CameraConfiguration, CameraDescription, Device, DeviceError, Feature,
    FeatureMode, FirewireControls, FrameGrabberControls, FrameGrabberImage, FrameGrabberImageRaw,
    Intrinsics, RgbVisualParams,
};

/// Range of the rate, images per second.
const RATES: std::ops::RangeInclusive<f64> = 0.1..=1000.0;
/// The largest pattern, in pixels.
const MAX_PIXELS: usize = 1 << 24;
/// Sizes of patterns that it offers.
const SIZES: [(usize, usize); 3] = [(160, 120), (320, 240), (640, 480)];

/// A camera that shows a test pattern, an image, a folder of images or a film.
///
/// * A dedicated thread takes images at the configured rate; the n-th is due n periods after the start. It never
///   waits for readers: see [`LatestValue`]. Dropping the camera ends and joins it.
/// * The first image is there when the camera has started. Pixels are shared with the readers.
/// * Knobs: brightness, exposure, gain, gamma, saturation, white balance (blue and red), mirror; each can be switched off,
///   and none turns by itself. They take effect with the next image.
/// * An image that can no longer be read is skipped; while none can be read, no images are produced.
///
/// ```
/// use yarp_devices::camera::{CameraOptions, Pattern, Scene, SimulatedCamera};
/// use yarp_devices::{Feature, FrameGrabberControls, FrameGrabberImage};
///
/// # fn main() -> Result<(), yarp_devices::DeviceError> {
/// let camera = SimulatedCamera::start(CameraOptions::new().scene(Scene::Pattern(Pattern::Grid)))?;
/// camera.set_feature(Feature::Brightness, 0.8)?;
/// let frame = camera.image()?;
/// println!("image {} is {} pixels wide", frame.number, frame.image.width());
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct SimulatedCamera {
    shared: Arc<Shared>,
    has_own_size: bool,
    has_firewire: bool,
    thread: Option<JoinHandle<()>>,
}

#[derive(Debug)]
struct Shared {
    frames: LatestValue<Frame>,
    state: Mutex<State>,
    ending: AtomicBool,
    /// Size and rate at the start.
    started: ((usize, usize), f64),
    sensor: (usize, usize),
    intrinsics: Intrinsics,
}

/// State that can be set while the camera runs.
#[derive(Clone, Debug)]
pub(super) struct State {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) rate: f64,
    pub(super) bus: BusState,
    field_of_view: (f64, f64),
    settings: FeatureSettings,
}

impl SimulatedCamera {
    /// Starts a camera, which has taken its first image then.
    ///
    /// Errors: [`DeviceError::Unsuitable`] for a size or rate, [`DeviceError::File`], [`DeviceError::Start`] when the
    /// machine has no thread left.
    pub fn start(options: CameraOptions) -> Result<Self, DeviceError> {
        check_size(options.width, options.height)?;
        check_angles(options.field_of_view)?;
        if !RATES.contains(&options.rate) {
            return Err(DeviceError::Unsuitable {
                what: "images a second:",
                asked: options.rate.to_string(),
                expected: "0.1 to 1000".to_owned(),
            });
        }
        let source = ImageSource::open(&options.scene)?;
        let has_own_size = source.has_own_size();
        let shared = Arc::new(Shared {
            frames: LatestValue::new(),
            state: Mutex::new(State {
                width: options.width,
                height: options.height,
                rate: options.rate,
                bus: BusState::default(),
                field_of_view: options.field_of_view,
                settings: FeatureSettings::new(options.mirrored),
            }),
            ending: AtomicBool::new(false),
            started: ((options.width, options.height), options.rate),
            sensor: (
                options.width.max(simulated_firewire::SENSOR.0),
                options.height.max(simulated_firewire::SENSOR.1),
            ),
            intrinsics: options.intrinsics,
        });
        let mut grabber = Grabber {
            shared: Arc::clone(&shared),
            source,
            taken: 0,
            failing: false,
        };
        grabber.take()?;
        let thread = thread::Builder::new()
            .name("camera".into())
            .spawn(move || grabber.run())
            .map_err(|source| DeviceError::Start {
                what: "the thread of the camera",
                source,
            })?;
        tracing::info!(scene = ?options.scene, rate = options.rate, "simulated camera started");
        Ok(Self {
            shared,
            has_own_size,
            has_firewire: options.firewire,
            thread: Some(thread),
        })
    }

    pub(super) fn state(&self) -> MutexGuard<'_, State> {
        self.shared.state()
    }

    pub(super) fn has_own_size(&self) -> bool {
        self.has_own_size
    }

    /// Refuses another size if the images have one of their own.
    pub(super) fn check_sizable(&self) -> Result<(), DeviceError> {
        if self.has_own_size {
            return Err(DeviceError::NotSupported {
                what: "another size than that of the pictures".to_owned(),
            });
        }
        Ok(())
    }

    /// Width and height of the sensor, of which a window is a part.
    pub(super) fn sensor(&self) -> (usize, usize) {
        self.shared.sensor
    }

    /// Size and rate at the start.
    pub(super) fn as_started(&self) -> ((usize, usize), f64) {
        self.shared.started
    }

    /// Applies a function to the state of a feature, if it is supported.
    fn with_feature<T>(
        &self,
        feature: Feature,
        what: impl FnOnce(&mut FeatureState) -> T,
    ) -> Result<T, DeviceError> {
        match self.state().settings.feature_state(feature) {
            Some(state) => Ok(what(state)),
            None => Err(DeviceError::NotSupported {
                what: format!("the feature {feature:?}"),
            }),
        }
    }
}

impl Drop for SimulatedCamera {
    fn drop(&mut self) {
        self.shared.ending.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            if thread.join().is_err() {
                tracing::error!("the thread of the camera had panicked");
            }
        }
    }
}

impl Shared {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn newest(&self) -> Result<Frame, DeviceError> {
        let what = "image";
        self.frames.get().ok_or(DeviceError::NoDataYet { what })
    }
}

/// The thread's part of it.
struct Grabber {
    shared: Arc<Shared>,
    source: ImageSource,
    taken: u64,
    /// True if the last image was not available: the first failure of a run is logged as a warning.
    failing: bool,
}

impl Grabber {
    /// Takes an image.
    fn take(&mut self) -> Result<(), DeviceError> {
        let state = self.shared.state().clone();
        let picture = match state.bus.window() {
            None => self.source.next(state.width, state.height)?,
            Some(window) => {
                let (width, height) = self.shared.sensor;
                simulated_firewire::part(&self.source.next(width, height)?, window)?
            }
        };
        let frame = Frame {
            image: state.settings.applied(picture)?,
            number: self.taken,
            time: clock::now(),
        };
        if self.shared.frames.put(frame) {
            self.taken += 1;
        }
        Ok(())
    }

    /// Takes images until stopped. Images that a pause of the machine made impossible are left out.
    fn run(&mut self) {
        let shared = Arc::clone(&self.shared);
        let source = TimeSource::current();
        let period = || Duration::from_secs_f64(1.0 / shared.state().rate);
        let mut due = source.instant() + period();
        while !self.shared.ending.load(Ordering::Acquire) {
            let now = source.instant();
            if now < due {
                source.park_until(due);
                continue;
            }
            due = (due + period()).max(now);
            if !self.shared.state().bus.is_sending() {
                continue;
            }
            match self.take() {
                Ok(()) => self.failing = false,
                Err(error) if self.failing => tracing::debug!("no image: {error}"),
                Err(error) => {
                    tracing::warn!("no image: {error}");
                    self.failing = true;
                }
            }
        }
    }
}

impl FrameGrabberImage for SimulatedCamera {
    fn image_size(&self) -> Result<(usize, usize), DeviceError> {
        let image = self.shared.newest()?.image;
        Ok((image.width(), image.height()))
    }

    fn image(&self) -> Result<Frame, DeviceError> {
        self.shared.newest()
    }
}

impl FrameGrabberImageRaw for SimulatedCamera {
    fn raw_image_size(&self) -> Result<(usize, usize), DeviceError> {
        self.image_size()
    }

    fn raw_image(&self) -> Result<Frame, DeviceError> {
        self.shared.newest()?.to_mono()
    }
}

impl FrameGrabberControls for SimulatedCamera {
    fn camera_description(&self) -> Result<CameraDescription, DeviceError> {
        Ok(CameraDescription {
            bus: match self.has_firewire {
                true => Bus::Firewire,
                false => Bus::Unknown,
            },
            description: "simulated camera".to_owned(),
        })
    }

    fn has_feature(&self, feature: Feature) -> Result<bool, DeviceError> {
        Ok(self.state().settings.feature_state(feature).is_some())
    }

    fn feature(&self, feature: Feature) -> Result<f64, DeviceError> {
        self.with_feature(feature, |state| state.values.0)
    }

    fn set_feature(&self, feature: Feature, value: f64) -> Result<(), DeviceError> {
        self.set_feature_pair(feature, (value, value))
    }

    fn feature_pair(&self, feature: Feature) -> Result<(f64, f64), DeviceError> {
        self.with_feature(feature, |state| state.values)
    }

    fn set_feature_pair(&self, feature: Feature, values: (f64, f64)) -> Result<(), DeviceError> {
        for value in [values.0, values.1] {
            if !(0.0..=1.0).contains(&value) {
                return Err(DeviceError::Unsuitable {
                    what: "the value of a feature,",
                    asked: value.to_string(),
                    expected: "0 to 1".to_owned(),
                });
            }
        }
        self.with_feature(feature, |state| state.values = values)
    }

    fn has_on_off(&self, feature: Feature) -> Result<bool, DeviceError> {
        self.has_feature(feature)
    }

    fn is_active(&self, feature: Feature) -> Result<bool, DeviceError> {
        self.with_feature(feature, |state| state.active)
    }

    fn set_active(&self, feature: Feature, active: bool) -> Result<(), DeviceError> {
        self.with_feature(feature, |state| state.active = active)
    }

    fn has_auto(&self, _: Feature) -> Result<bool, DeviceError> {
        Ok(false)
    }

    fn has_manual(&self, feature: Feature) -> Result<bool, DeviceError> {
        self.has_feature(feature)
    }

    fn has_one_push(&self, _: Feature) -> Result<bool, DeviceError> {
        Ok(false)
    }

    fn mode(&self, feature: Feature) -> Result<FeatureMode, DeviceError> {
        self.with_feature(feature, |_| FeatureMode::Manual)
    }

    fn set_mode(&self, feature: Feature, mode: FeatureMode) -> Result<(), DeviceError> {
        self.with_feature(feature, |_| ())?;
        if mode == FeatureMode::Manual {
            return Ok(());
        }
        Err(DeviceError::NotSupported {
            what: format!("{feature:?} in mode {mode:?}"),
        })
    }

    fn one_push(&self, feature: Feature) -> Result<(), DeviceError> {
        Err(DeviceError::NotSupported {
            what: format!("{feature:?} set by the camera"),
        })
    }
}

impl RgbVisualParams for SimulatedCamera {
    fn supported_configurations(&self) -> Result<Vec<CameraConfiguration>, DeviceError> {
        let now = self.image_size()?;
        let mut sizes = vec![now];
        if !self.has_own_size {
            sizes.extend(SIZES.into_iter().filter(|size| *size != now));
        }
        let rate = self.state().rate;
        let configuration = |(width, height)| CameraConfiguration {
            width,
            height,
            rate,
            format: PixelFormat::Rgb,
        };
        Ok(sizes.into_iter().map(configuration).collect())
    }

    fn resolution(&self) -> Result<(usize, usize), DeviceError> {
        if self.has_own_size {
            return self.image_size();
        }
        let state = self.state();
        Ok((state.width, state.height))
    }

    fn set_resolution(&self, width: usize, height: usize) -> Result<(), DeviceError> {
        self.check_sizable()?;
        check_size(width, height)?;
        let mut state = self.state();
        (state.width, state.height) = (width, height);
        state.bus.leave_format_7();
        Ok(())
    }

    fn field_of_view(&self) -> Result<(f64, f64), DeviceError> {
        Ok(self.state().field_of_view)
    }

    fn set_field_of_view(&self, across: f64, down: f64) -> Result<(), DeviceError> {
        check_angles((across, down))?;
        self.state().field_of_view = (across, down);
        Ok(())
    }

    fn intrinsics(&self) -> Result<Intrinsics, DeviceError> {
        Ok(self.shared.intrinsics.clone())
    }

    fn mirroring(&self) -> Result<bool, DeviceError> {
        Ok(self.state().settings.is_mirrored())
    }

    fn set_mirroring(&self, mirrored: bool) -> Result<(), DeviceError> {
        let value = f64::from(u8::from(mirrored));
        self.with_feature(Feature::Mirror, |state| {
            *state = FeatureState {
                values: (value, value),
                active: true,
            };
        })
    }
}

impl AudioVisualStream for SimulatedCamera {
    fn has_audio(&self) -> bool {
        false
    }

    fn has_video(&self) -> bool {
        true
    }
}

impl Device for SimulatedCamera {
    crate::offers! {
        audio_visual_stream: AudioVisualStream,
        frame_grabber_image: FrameGrabberImage,
        frame_grabber_image_raw: FrameGrabberImageRaw,
        frame_grabber_controls: FrameGrabberControls,
        rgb_visual_params: RgbVisualParams,
    }

    fn firewire_controls(&self) -> Option<&dyn FirewireControls> {
        self.has_firewire.then_some(self)
    }
}

fn check_size(width: usize, height: usize) -> Result<(), DeviceError> {
    let sides = 1..=MAX_IMAGE_SIDE;
    if sides.contains(&width) && sides.contains(&height) && width * height <= MAX_PIXELS {
        return Ok(());
    }
    Err(DeviceError::Unsuitable {
        what: "resolution",
        asked: format!("{width} x {height}"),
        expected: format!("sides of 1 to {MAX_IMAGE_SIDE}, together at most {MAX_PIXELS} pixels"),
    })
}
