//! The camera as a device.

use std::sync::Arc;

use super::capture_thread::{CaptureThread, Shared};
use super::linux_driver::LinuxDriver;
use super::mode_selection::{Wanted, choose};
use super::v4l2_options::V4l2Options;
use super::video_driver::VideoDriver;
use crate::camera::hardware::{CaptureHandle, FeatureValue, Lens, check_mirror};
use crate::image::{Frame, PixelFormat};
use crate::{
    CameraConfiguration, CameraDescription, Device, DeviceError, Feature, FeatureMode,
    FrameGrabberControls, FrameGrabberImage, FrameGrabberImageRaw, Intrinsics, RgbVisualParams,
};

/// A camera of the machine, through the kernel's interface for video devices (V4L2).
///
/// * A dedicated thread takes the images as the camera sends them, converts them to red, green and blue, and never waits for
///   readers, who get the newest. The time of an image is the time at which the driver handed it over, which is after
///   exposure and transfer.
/// * An unplugged camera is opened again when it is back, with the features as they were set. Until its next image, images are
///   refused with an error that names the failed step, the device, and what to try.
/// * Features are those that the driver has controls for; the others are refused. Setting a value ends automatic
///   control of the feature. Features cannot be switched off. Mirroring swaps the pixels after they were taken.
/// * No wait is without a timeout, and nothing is allocated by a size that a driver only claims.
///
/// ```no_run
/// use yarp_devices::camera::{V4l2Camera, V4l2Options};
/// use yarp_devices::{Feature, FrameGrabberControls, FrameGrabberImage};
///
/// # fn main() -> Result<(), yarp_devices::DeviceError> {
/// let camera = V4l2Camera::start(V4l2Options::new("/dev/video0").size(640, 480))?;
/// if camera.has_feature(Feature::Brightness)? {
///     camera.set_feature(Feature::Brightness, 0.6)?;
/// }
/// println!("{} pixels wide", camera.image()?.image.width());
/// # Ok(())
/// # }
/// ```
pub struct V4l2Camera {
    shared: Arc<Shared>,
    lens: Lens,
    // Its end is waited for when the camera is dropped.
    _thread: CaptureHandle,
}

impl V4l2Camera {
    /// Opens the camera and waits for its first image.
    ///
    /// Errors: [`DeviceError::Remote`] when the device cannot be opened or sends nothing, [`DeviceError::Unsuitable`] for a
    /// size, rate or encoding, [`DeviceError::NotSupported`] for a camera with no encoding that is known here,
    /// [`DeviceError::Start`] when the machine has no thread left.
    pub fn start(options: V4l2Options) -> Result<Self, DeviceError> {
        let driver = LinuxDriver::new(options.device.clone());
        Self::with_driver(options, Box::new(driver))
    }

    /// Starts a camera with another driver.
    pub(super) fn with_driver(
        options: V4l2Options,
        mut driver: Box<dyn VideoDriver>,
    ) -> Result<Self, DeviceError> {
        options.check()?;
        let opened = driver.open(&options.wanted)?;
        let shared = Arc::new(Shared::new(
            &options.device.display().to_string(),
            options.wanted.clone(),
            options.common.mirrored,
            options.common.frame_timeout,
            &opened,
        ));
        let capture = CaptureThread::new(Arc::clone(&shared), driver);
        let thread = CaptureHandle::start(&shared.capture, move || capture.run(opened))?;
        thread.wait_for_image(options.common.frame_timeout)?;
        let camera = Self {
            shared,
            lens: Lens::new(&options.common),
            _thread: thread,
        };
        let device = &camera.shared.capture.device;
        options.common.set_features(device, |feature, value| {
            let mut controls = camera.shared.controls();
            match value {
                FeatureValue::One(value) => controls.set_value(feature, value),
                FeatureValue::Pair(values) => controls.set_pair(feature, values),
            }
        });
        Ok(camera)
    }

    fn known_feature(&self, feature: Feature) -> Result<(), DeviceError> {
        match self.has_feature(feature)? {
            true => Ok(()),
            false => Err(DeviceError::NotSupported {
                what: format!("the feature {feature:?}"),
            }),
        }
    }
}

impl FrameGrabberImage for V4l2Camera {
    fn image_size(&self) -> Result<(usize, usize), DeviceError> {
        Ok(self.shared.state().size)
    }

    fn image(&self) -> Result<Frame, DeviceError> {
        self.shared.capture.newest()
    }
}

impl FrameGrabberImageRaw for V4l2Camera {
    fn raw_image_size(&self) -> Result<(usize, usize), DeviceError> {
        self.image_size()
    }

    fn raw_image(&self) -> Result<Frame, DeviceError> {
        self.shared.capture.newest_raw()
    }
}

impl FrameGrabberControls for V4l2Camera {
    fn camera_description(&self) -> Result<CameraDescription, DeviceError> {
        Ok(self.shared.state().description.clone())
    }

    fn has_feature(&self, feature: Feature) -> Result<bool, DeviceError> {
        match feature {
            Feature::Mirror => Ok(true),
            _ => self.shared.controls().has_feature(feature),
        }
    }

    fn feature(&self, feature: Feature) -> Result<f64, DeviceError> {
        match feature {
            Feature::Mirror => Ok(f64::from(u8::from(self.shared.state().mirrored))),
            _ => self.shared.controls().value(feature),
        }
    }

    fn set_feature(&self, feature: Feature, value: f64) -> Result<(), DeviceError> {
        match feature {
            Feature::Mirror => self.set_mirroring(check_mirror(value)?),
            _ => self.shared.controls().set_value(feature, value),
        }
    }

    fn feature_pair(&self, feature: Feature) -> Result<(f64, f64), DeviceError> {
        self.shared.controls().pair(feature)
    }

    fn set_feature_pair(&self, feature: Feature, values: (f64, f64)) -> Result<(), DeviceError> {
        self.shared.controls().set_pair(feature, values)
    }

    fn has_on_off(&self, _: Feature) -> Result<bool, DeviceError> {
        Ok(false)
    }

    fn is_active(&self, feature: Feature) -> Result<bool, DeviceError> {
        self.known_feature(feature).map(|()| true)
    }

    fn set_active(&self, feature: Feature, active: bool) -> Result<(), DeviceError> {
        self.known_feature(feature)?;
        if active {
            return Ok(());
        }
        Err(DeviceError::NotSupported {
            what: format!("switching {feature:?} off"),
        })
    }

    fn has_auto(&self, feature: Feature) -> Result<bool, DeviceError> {
        self.shared.controls().has_auto(feature)
    }

    fn has_manual(&self, feature: Feature) -> Result<bool, DeviceError> {
        match feature {
            Feature::Mirror => Ok(true),
            _ => self.shared.controls().has_manual(feature),
        }
    }

    fn has_one_push(&self, feature: Feature) -> Result<bool, DeviceError> {
        self.shared.controls().has_one_push(feature)
    }

    fn mode(&self, feature: Feature) -> Result<FeatureMode, DeviceError> {
        match feature {
            Feature::Mirror => Ok(FeatureMode::Manual),
            _ => self.shared.controls().mode(feature),
        }
    }

    fn set_mode(&self, feature: Feature, mode: FeatureMode) -> Result<(), DeviceError> {
        match (feature, mode) {
            (Feature::Mirror, FeatureMode::Manual) => Ok(()),
            _ => self.shared.controls().set_mode(feature, mode),
        }
    }

    fn one_push(&self, feature: Feature) -> Result<(), DeviceError> {
        self.shared.controls().one_push(feature)
    }
}

impl RgbVisualParams for V4l2Camera {
    fn supported_configurations(&self) -> Result<Vec<CameraConfiguration>, DeviceError> {
        let state = self.shared.state();
        let mut configurations: Vec<CameraConfiguration> = Vec::new();
        for offer in &state.offers {
            let configuration = CameraConfiguration {
                width: offer.size.0,
                height: offer.size.1,
                rate: offer.max_rate.or(state.rate).unwrap_or(0.0),
                format: PixelFormat::Rgb,
            };
            if !configurations.contains(&configuration) {
                configurations.push(configuration);
            }
        }
        Ok(configurations)
    }

    fn resolution(&self) -> Result<(usize, usize), DeviceError> {
        self.image_size()
    }

    fn set_resolution(&self, width: usize, height: usize) -> Result<(), DeviceError> {
        let mut state = self.shared.state();
        let wanted = Wanted {
            size: Some((width, height)),
            ..state.wanted.clone()
        };
        choose(&state.offers, &wanted)?;
        state.wanted = wanted;
        state.size = (width, height);
        Ok(())
    }

    fn field_of_view(&self) -> Result<(f64, f64), DeviceError> {
        self.lens.field_of_view()
    }

    fn set_field_of_view(&self, across: f64, down: f64) -> Result<(), DeviceError> {
        self.lens.set_field_of_view(across, down)
    }

    fn intrinsics(&self) -> Result<Intrinsics, DeviceError> {
        self.lens.intrinsics()
    }

    fn mirroring(&self) -> Result<bool, DeviceError> {
        Ok(self.shared.state().mirrored)
    }

    fn set_mirroring(&self, mirrored: bool) -> Result<(), DeviceError> {
        self.shared.state().mirrored = mirrored;
        Ok(())
    }
}

impl Device for V4l2Camera {
    crate::offers! {
        frame_grabber_image: FrameGrabberImage,
        frame_grabber_image_raw: FrameGrabberImageRaw,
        frame_grabber_controls: FrameGrabberControls,
        rgb_visual_params: RgbVisualParams,
    }
}

#[cfg(test)]
mod tests {
    use std::thread;
    use std::time::{Duration, Instant};

    use super::super::camera_controls::Control;
    use super::super::fake_driver::{Behaviour, FakeDriver};
    use super::*;
    use crate::camera::hardware::CLOSE_TIMEOUT;

    /// Time within which a test expects something to happen.
    const TIMEOUT: Duration = Duration::from_secs(10);

    fn options() -> V4l2Options {
        V4l2Options::new("/dev/video7").frame_timeout(Duration::from_millis(200))
    }

    fn start(driver: &FakeDriver, options: V4l2Options) -> Result<V4l2Camera, DeviceError> {
        V4l2Camera::with_driver(options, Box::new(driver.clone()))
    }

    fn until<T>(what: &str, get: impl FnMut() -> Option<T>) -> T {
        yarp_testing::until_within(TIMEOUT, what, get)
    }

    /// Returns an error and its sources.
    fn words(error: &DeviceError) -> String {
        let source = std::error::Error::source(error).map(ToString::to_string);
        format!("{error}: {}", source.unwrap_or_default())
    }

    #[test]
    fn images_go_on_mirrored_or_not() {
        let driver = FakeDriver::new(Behaviour::Sends);
        let camera = start(&driver, options()).unwrap();
        assert_eq!(camera.image_size().unwrap(), (16, 8));
        let first = camera.image().unwrap();
        assert_eq!(first.image.pixel(0, 0), Some(&[100; 3][..]));
        assert_eq!(first.image.pixel(15, 7), Some(&[0; 3][..]));
        let next = until("a next image", || {
            camera
                .image()
                .ok()
                .filter(|next| next.number > first.number)
        });
        assert!(next.time > first.time);
        assert!(!camera.mirroring().unwrap());
        camera.set_feature(Feature::Mirror, 1.0).unwrap();
        assert!(camera.mirroring().unwrap());
        until("a mirrored image", || {
            let image = camera.image().ok()?.image;
            (image.pixel(0, 0)? == [0; 3] && image.pixel(15, 7)? == [100; 3]).then_some(())
        });
        assert_eq!(
            camera.raw_image().unwrap().image.format(),
            PixelFormat::Mono
        );
        assert!(camera.set_feature(Feature::Mirror, 1.5).is_err());
        assert!(camera.set_active(Feature::Mirror, false).is_err());
        assert!(camera.set_active(Feature::Zoom, true).is_err());
        assert!(camera.field_of_view().is_err() && camera.intrinsics().is_err());
        camera.set_field_of_view(60.0, 40.0).unwrap();
        assert_eq!(camera.field_of_view().unwrap(), (60.0, 40.0));
    }

    #[test]
    fn another_size_begins_with_a_new_stream() {
        let driver = FakeDriver::new(Behaviour::Sends);
        let camera = start(&driver, options().size(8, 4)).unwrap();
        let size_of = |camera: &V4l2Camera| {
            let image = camera.image().ok()?.image;
            Some((image.width(), image.height()))
        };
        assert_eq!(size_of(&camera), Some((8, 4)));
        camera.set_resolution(16, 8).unwrap();
        until("the new size", || {
            size_of(&camera).filter(|size| *size == (16, 8))
        });
        for (width, height) in [(9, 4), (0, 0), (usize::MAX, 1)] {
            assert!(camera.set_resolution(width, height).is_err());
        }
        let sizes = camera.supported_configurations().unwrap();
        assert!(
            sizes
                .iter()
                .any(|one| (one.width, one.height, one.rate) == (8, 4, 30.0))
        );
        assert_eq!(camera.resolution().unwrap(), (16, 8));
        assert!(start(&driver, options().size(9, 4)).is_err());
        let cropped = start(&driver, options().size(6, 3).crop(true)).unwrap();
        assert_eq!(size_of(&cropped), Some((6, 3)));
        let image = cropped.image().unwrap().image;
        // The centre of 8 pixels, of which 4 are grey.
        let line: Vec<u8> = image.pixels()[..18].iter().step_by(3).copied().collect();
        assert_eq!(line, [100, 100, 100, 0, 0, 0]);
    }

    #[test]
    fn an_unplugged_camera_comes_back_as_it_was() {
        let driver = FakeDriver::new(Behaviour::Sends);
        let options = options()
            .feature(Feature::Brightness, 0.25)
            .feature(Feature::Zoom, 0.5);
        let camera = start(&driver, options).unwrap();
        assert_eq!(camera.feature(Feature::Brightness).unwrap(), 0.25);
        let before = camera.image().unwrap();
        driver.set(Behaviour::Unplugged);
        let error = until("the failure", || camera.image().err());
        let words = words(&error);
        for part in [
            "/dev/video7",
            "taking an image",
            "plugging the camera in again",
            "os error 19",
        ] {
            assert!(words.contains(part), "{words}");
        }
        assert!(camera.set_feature(Feature::Brightness, 0.5).is_err());
        until("another try", || {
            (driver.device().opened >= 2).then_some(())
        });
        let error = camera.image().unwrap_err().to_string();
        assert!(error.contains("/dev/video7"), "{error}");
        driver.device().grey = 200;
        driver.set(Behaviour::Sends);
        let after = until("images again", || camera.image().ok());
        assert_eq!(
            after.image.pixel(0, 0),
            Some(&[200; 3][..]),
            "none from before"
        );
        assert!(after.number > before.number);
        let values = driver.device().port.values.lock().unwrap().clone();
        assert_eq!(values.get(&Control::Brightness), Some(&25));
    }

    #[test]
    fn a_camera_without_images_is_opened_again() {
        for (behaviour, reason) in [
            (Behaviour::Silent, "no image within 200ms"),
            (Behaviour::Empty, "no image within 200ms"),
            (Behaviour::Damaged, "marked the image as damaged"),
            (Behaviour::Short, "delivered 192 bytes, expected 384"),
        ] {
            let driver = FakeDriver::new(Behaviour::Sends);
            let camera = start(&driver, options()).unwrap();
            driver.set(behaviour);
            let error = until("the failure", || camera.image().err());
            let words = words(&error);
            assert!(
                words.contains("waiting for an image") && words.contains(reason),
                "{words}"
            );
            until("another try", || {
                (driver.device().opened >= 2).then_some(())
            });
            driver.set(Behaviour::Sends);
            until("images again", || camera.image().ok());
            // A camera that never sends does not start.
            driver.set(behaviour);
            let refused = start(&driver, options()).err().expect("it has no image");
            assert!(
                refused.to_string().contains("waiting for an image"),
                "{refused}"
            );
        }
    }

    #[test]
    fn a_camera_that_is_not_there_does_not_start() {
        let driver = FakeDriver::new(Behaviour::Unplugged);
        let refused = start(&driver, options()).err().expect("it is not there");
        assert!(refused.to_string().contains("/dev/video7"), "{refused}");
        let driver = FakeDriver::new(Behaviour::Sends);
        assert!(start(&driver, options().rate(0.0)).is_err());
        assert_eq!(driver.device().opened, 0, "checked before it is opened");
    }

    #[test]
    fn a_driver_that_blocks_does_not_block_the_start() {
        let driver = FakeDriver::new(Behaviour::Blocks);
        let refused = start(&driver, options()).err().expect("it has no image");
        assert!(
            refused.to_string().contains("a call of its driver blocks"),
            "{refused}"
        );
    }

    #[test]
    fn closing_never_waits_for_a_driver() {
        for behaviour in [Behaviour::Sends, Behaviour::Silent, Behaviour::Unplugged] {
            let driver = FakeDriver::new(Behaviour::Sends);
            let camera = start(&driver, options()).unwrap();
            driver.set(behaviour);
            thread::sleep(Duration::from_millis(50));
            let began = Instant::now();
            drop(camera);
            assert!(began.elapsed() < Duration::from_secs(1), "{behaviour:?}");
        }
        let driver = FakeDriver::new(Behaviour::Sends);
        let camera = start(&driver, options()).unwrap();
        driver.set(Behaviour::Blocks);
        thread::sleep(Duration::from_millis(50));
        let began = Instant::now();
        drop(camera);
        let took = began.elapsed();
        assert!(
            took >= CLOSE_TIMEOUT && took < CLOSE_TIMEOUT + TIMEOUT,
            "{took:?}"
        );
    }
}
