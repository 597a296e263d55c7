//! The camera as a device.

use std::sync::Arc;
use std::sync::mpsc::sync_channel;

use super::IidcOptions;
use super::iidc_session::Session;
use super::iidc_state::Shared;
use super::iidc_thread::{CALL_TIMEOUT, CaptureThread, TaskSender, task_queue};
use crate::camera::hardware::{CaptureHandle, Lens, check_mirror};
use crate::image::Frame;
use crate::{
    CameraConfiguration, CameraDescription, Device, DeviceError, Feature, FeatureMode,
    FrameGrabberControls, FrameGrabberImage, FrameGrabberImageRaw, Intrinsics, RgbVisualParams,
};

/// An IIDC camera on IEEE 1394 or USB, through libdc1394, which is loaded when the first camera is started.
///
/// * A dedicated thread owns the camera. It takes the images as they come, converts them to red, green and blue, and never waits for
///   readers, who get the newest. The time of an image is the time at which the library handed it over.
/// * Of several frames that wait, only the newest becomes an image.
/// * Calls for features and settings are executed by that thread one after the other, and fail after 10 s; a call that has failed so before its
///   turn is not executed later.
/// * On USB, a frame of which a part was lost is no image. On IEEE 1394 libdc1394 does not tell lost packets: an image there may contain lines of
///   an older one.
/// * An unplugged camera is opened again when it is back, by its GUID, with mode, rate, window and features as they were set. Until its next image,
///   images are refused with an error that names the failed step, the camera, and what to try. On USB, file descriptors, buffers and a thread of the
///   library stay behind in the process each time; after 16 times no camera is opened any more.
/// * Features are those of the camera; mirroring swaps the pixels after they were taken.
/// * Raw images are the values of the sensor, if the camera sends them (grey and RAW codings); else grey.
///
/// ```no_run
/// use yarp_devices::camera::{IidcCamera, IidcFormat, IidcOptions};
/// use yarp_devices::{FirewireControls, FrameGrabberImage};
///
/// # fn main() -> Result<(), yarp_devices::DeviceError> {
/// let camera = IidcCamera::start(IidcOptions::new().format(IidcFormat::Fixed(4)).rate(15.0))?;
/// println!("{} pixels wide, rate {}", camera.image()?.image.width(), camera.rate()?);
/// # Ok(())
/// # }
/// ```
pub struct IidcCamera {
    shared: Arc<Shared>,
    tasks: TaskSender,
    lens: Lens,
    // Its end is waited for when the camera is dropped.
    _thread: CaptureHandle,
}

impl IidcCamera {
    /// Opens the camera and waits for its first image.
    ///
    /// Errors: [`DeviceError::Remote`] when the library is missing, or the camera cannot be opened or sends nothing,
    /// [`DeviceError::Unsuitable`] for a rate or video mode, [`DeviceError::Start`] when the machine has no thread left.
    pub fn start(options: IidcOptions) -> Result<Self, DeviceError> {
        options.check()?;
        let device = options.choice.to_string();
        let common = options.common.clone();
        let shared = Shared::new(&device, common.mirrored, common.frame_timeout);
        let shared = Arc::new(shared);
        let (tasks, queue) = task_queue(&device, CALL_TIMEOUT)?;
        let session_shared = Arc::clone(&shared);
        let (opened, outcome) = sync_channel(1);
        let thread = CaptureHandle::start(&shared.capture, move || {
            // The library's camera stays in the thread that opened it.
            let session = Session::new(options, Arc::clone(&session_shared));
            CaptureThread::new(session_shared, session, queue).run(&opened);
        })?;
        let blocked = |_| DeviceError::Remote {
            peer: device.clone(),
            step: "opening the camera".to_owned(),
            advice: "plugging the camera in again: a call of its library blocks".to_owned(),
            source: None,
        };
        outcome.recv_timeout(CALL_TIMEOUT).map_err(blocked)??;
        thread.wait_for_image(common.frame_timeout)?;
        Ok(Self {
            shared,
            tasks,
            lens: Lens::new(&common),
            _thread: thread,
        })
    }

    /// Executes a task on the camera's thread.
    pub(super) fn run<T: Send + 'static>(
        &self,
        task: impl FnOnce(&mut Session) -> Result<T, DeviceError> + Send + 'static,
    ) -> Result<T, DeviceError> {
        self.tasks.run(task)
    }
}

impl FrameGrabberImage for IidcCamera {
    fn image_size(&self) -> Result<(usize, usize), DeviceError> {
        Ok(self.shared.state().size)
    }

    fn image(&self) -> Result<Frame, DeviceError> {
        self.shared.capture.newest()
    }
}

impl FrameGrabberImageRaw for IidcCamera {
    fn raw_image_size(&self) -> Result<(usize, usize), DeviceError> {
        self.image_size()
    }

    fn raw_image(&self) -> Result<Frame, DeviceError> {
        self.shared.capture.newest_raw()
    }
}

impl FrameGrabberControls for IidcCamera {
    fn camera_description(&self) -> Result<CameraDescription, DeviceError> {
        Ok(self.shared.state().description.clone())
    }

    fn has_feature(&self, feature: Feature) -> Result<bool, DeviceError> {
        match feature {
            Feature::Mirror => Ok(true),
            _ => self.run(move |session| session.has_feature(feature)),
        }
    }

    fn feature(&self, feature: Feature) -> Result<f64, DeviceError> {
        match feature {
            Feature::Mirror => Ok(f64::from(u8::from(self.shared.state().mirrored))),
            _ => self.run(move |session| session.value(feature)),
        }
    }

    fn set_feature(&self, feature: Feature, value: f64) -> Result<(), DeviceError> {
        match feature {
            Feature::Mirror => self.set_mirroring(check_mirror(value)?),
            _ => self.run(move |session| session.set_value(feature, value)),
        }
    }

    fn feature_pair(&self, feature: Feature) -> Result<(f64, f64), DeviceError> {
        self.run(move |session| session.pair(feature))
    }

    fn set_feature_pair(&self, feature: Feature, values: (f64, f64)) -> Result<(), DeviceError> {
        self.run(move |session| session.set_pair(feature, values))
    }

    fn has_on_off(&self, feature: Feature) -> Result<bool, DeviceError> {
        self.run(move |session| session.has_on_off(feature))
    }

    fn is_active(&self, feature: Feature) -> Result<bool, DeviceError> {
        match feature {
            Feature::Mirror => Ok(true),
            _ => self.run(move |session| session.is_active(feature)),
        }
    }

    fn set_active(&self, feature: Feature, active: bool) -> Result<(), DeviceError> {
        match (feature, active) {
            (Feature::Mirror, true) => Ok(()),
            _ => self.run(move |session| session.set_active(feature, active)),
        }
    }

    fn has_auto(&self, feature: Feature) -> Result<bool, DeviceError> {
        self.run(move |session| session.has_auto(feature))
    }

    fn has_manual(&self, feature: Feature) -> Result<bool, DeviceError> {
        match feature {
            Feature::Mirror => Ok(true),
            _ => self.run(move |session| session.has_manual(feature)),
        }
    }

    fn has_one_push(&self, feature: Feature) -> Result<bool, DeviceError> {
        self.run(move |session| session.has_one_push(feature))
    }

    fn mode(&self, feature: Feature) -> Result<FeatureMode, DeviceError> {
        match feature {
            Feature::Mirror => Ok(FeatureMode::Manual),
            _ => self.run(move |session| session.feature_mode(feature)),
        }
    }

    fn set_mode(&self, feature: Feature, mode: FeatureMode) -> Result<(), DeviceError> {
        match (feature, mode) {
            (Feature::Mirror, FeatureMode::Manual) => Ok(()),
            _ => self.run(move |session| session.set_feature_mode(feature, mode)),
        }
    }

    fn one_push(&self, feature: Feature) -> Result<(), DeviceError> {
        self.run(move |session| session.one_push(feature))
    }
}

impl RgbVisualParams for IidcCamera {
    fn supported_configurations(&self) -> Result<Vec<CameraConfiguration>, DeviceError> {
        self.run(|session| session.sizes())
    }

    fn resolution(&self) -> Result<(usize, usize), DeviceError> {
        self.image_size()
    }

    fn set_resolution(&self, width: usize, height: usize) -> Result<(), DeviceError> {
        self.run(move |session| session.set_size((width, height)))
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

impl Device for IidcCamera {
    crate::offers! {
        frame_grabber_image: FrameGrabberImage,
        frame_grabber_image_raw: FrameGrabberImageRaw,
        frame_grabber_controls: FrameGrabberControls,
        rgb_visual_params: RgbVisualParams,
        firewire_controls: FirewireControls,
    }
}
