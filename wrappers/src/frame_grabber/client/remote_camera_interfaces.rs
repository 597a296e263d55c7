//! Images, features and parameters.

use yarp_devices::image::{Crop, Frame};
use yarp_devices::{
    Bus, CameraConfiguration, CameraDescription, DeviceError, Feature, FeatureMode,
    FrameGrabberControls, FrameGrabberImage, FrameGrabberImageRaw, Intrinsics, RgbVisualParams,
};
use yarp_wire::{Bottle, WireVersion};

use super::RemoteFrameGrabber;
use crate::frame_grabber::messages::{Ability, Answer, Channel, Request};

/// Asks, and takes an answer apart.
macro_rules! ask {
    ($camera:expr, $request:expr, $answer:pat => $result:expr) => {
        match $camera.ask($request)? {
            $answer => Ok($result),
            _ => Err($camera.link.unreadable(&Bottle::new())),
        }
    };
}

impl RemoteFrameGrabber {
    pub(super) fn ask(&self, request: Request) -> Result<Answer, DeviceError> {
        self.link
            .run(|link| async move { link.exchange(&request).await })
    }

    fn order(&self, request: Request) -> Result<(), DeviceError> {
        self.ask(request).map(drop)
    }

    fn has(&self, ability: Ability, feature: Feature) -> Result<bool, DeviceError> {
        ask!(self, Request::Has(ability, feature.code()), Answer::Flag(has) => has)
    }

    fn side(&self, request: Request) -> Result<usize, DeviceError> {
        ask!(self, request, Answer::Integer(side) => usize::try_from(side).unwrap_or(0))
    }

    fn asked_image(&self, request: Request) -> Result<Frame, DeviceError> {
        ask!(self, request, Answer::Image(image) => self.link.latest.take_asked(image))
    }

    /// Returns whether raw images are available.
    fn has_raw(&self) -> bool {
        self.wire_version() == WireVersion::V3
    }
}

impl FrameGrabberImage for RemoteFrameGrabber {
    fn image_size(&self) -> Result<(usize, usize), DeviceError> {
        if self.link.streams() {
            let image = self.link.latest.frame()?.image;
            return Ok((image.width(), image.height()));
        }
        let width = self.side(Request::Width(Channel::Colour))?;
        Ok((width, self.side(Request::Height(Channel::Colour))?))
    }

    fn image(&self) -> Result<Frame, DeviceError> {
        if !self.link.streams() {
            return self.asked_image(Request::Image(Channel::Colour));
        }
        let frame = self.link.latest.frame()?;
        let image = frame.image.to_rgb()?;
        Ok(Frame { image, ..frame })
    }

    fn image_crop(&self, crop: &Crop) -> Result<Frame, DeviceError> {
        match self.link.streams() {
            true => self.image()?.cropped(crop),
            false => self.asked_image(Request::Crop(Channel::Colour, crop.clone())),
        }
    }
}

impl FrameGrabberImageRaw for RemoteFrameGrabber {
    fn raw_image_size(&self) -> Result<(usize, usize), DeviceError> {
        if !self.has_raw() {
            return self.image_size();
        }
        let width = self.side(Request::Width(Channel::Raw))?;
        Ok((width, self.side(Request::Height(Channel::Raw))?))
    }

    fn raw_image(&self) -> Result<Frame, DeviceError> {
        if !self.has_raw() {
            return self.image()?.to_mono();
        }
        // Not kept: what is kept is in colour.
        let now = yarp_devices::clock::now();
        ask!(self, Request::Image(Channel::Raw), Answer::Image(image) => Frame { image, number: 0, time: now })
    }
}

impl FrameGrabberControls for RemoteFrameGrabber {
    fn camera_description(&self) -> Result<CameraDescription, DeviceError> {
        ask!(self, Request::Description, Answer::Description(bus, description) => CameraDescription {
            bus: Bus::from_code(bus).unwrap_or_default(),
            description,
        })
    }

    fn has_feature(&self, feature: Feature) -> Result<bool, DeviceError> {
        self.has(Ability::Feature, feature)
    }

    fn feature(&self, feature: Feature) -> Result<f64, DeviceError> {
        ask!(self, Request::Value(feature.code()), Answer::Number(value) => value)
    }

    fn set_feature(&self, feature: Feature, value: f64) -> Result<(), DeviceError> {
        self.order(Request::SetValue(feature.code(), value))
    }

    fn feature_pair(&self, feature: Feature) -> Result<(f64, f64), DeviceError> {
        ask!(self, Request::Pair(feature.code()), Answer::Numbers(one, other) => (one, other))
    }

    fn set_feature_pair(&self, feature: Feature, values: (f64, f64)) -> Result<(), DeviceError> {
        self.order(Request::SetPair(feature.code(), values.0, values.1))
    }

    fn has_on_off(&self, feature: Feature) -> Result<bool, DeviceError> {
        self.has(Ability::OnOff, feature)
    }

    fn is_active(&self, feature: Feature) -> Result<bool, DeviceError> {
        ask!(self, Request::Active(feature.code()), Answer::Flag(active) => active)
    }

    fn set_active(&self, feature: Feature, active: bool) -> Result<(), DeviceError> {
        self.order(Request::SetActive(feature.code(), active))
    }

    fn has_auto(&self, feature: Feature) -> Result<bool, DeviceError> {
        self.has(Ability::Auto, feature)
    }

    fn has_manual(&self, feature: Feature) -> Result<bool, DeviceError> {
        self.has(Ability::Manual, feature)
    }

    fn has_one_push(&self, feature: Feature) -> Result<bool, DeviceError> {
        self.has(Ability::OnePush, feature)
    }

    fn mode(&self, feature: Feature) -> Result<FeatureMode, DeviceError> {
        ask!(self, Request::Mode(feature.code()), Answer::Mode(mode) => {
            FeatureMode::from_code(mode).unwrap_or_default()
        })
    }

    fn set_mode(&self, feature: Feature, mode: FeatureMode) -> Result<(), DeviceError> {
        self.order(Request::SetMode(feature.code(), mode.code()))
    }

    fn one_push(&self, feature: Feature) -> Result<(), DeviceError> {
        self.order(Request::OnePush(feature.code()))
    }
}

impl RgbVisualParams for RemoteFrameGrabber {
    fn supported_configurations(&self) -> Result<Vec<CameraConfiguration>, DeviceError> {
        ask!(self, Request::Configurations, Answer::Configurations(all) => all)
    }

    fn resolution(&self) -> Result<(usize, usize), DeviceError> {
        let side = |side| usize::try_from(side).unwrap_or(0);
        ask!(self, Request::Resolution, Answer::Size(width, height) => (side(width), side(height)))
    }

    fn set_resolution(&self, width: usize, height: usize) -> Result<(), DeviceError> {
        let side = |side| i32::try_from(side).unwrap_or(i32::MAX);
        self.order(Request::SetResolution(side(width), side(height)))
    }

    fn field_of_view(&self) -> Result<(f64, f64), DeviceError> {
        ask!(self, Request::FieldOfView, Answer::Numbers(across, down) => (across, down))
    }

    fn set_field_of_view(&self, across: f64, down: f64) -> Result<(), DeviceError> {
        self.order(Request::SetFieldOfView(across, down))
    }

    fn intrinsics(&self) -> Result<Intrinsics, DeviceError> {
        ask!(self, Request::Intrinsics, Answer::Intrinsics(lens) => lens)
    }

    fn mirroring(&self) -> Result<bool, DeviceError> {
        ask!(self, Request::Mirroring, Answer::Flag(mirrored) => mirrored)
    }

    fn set_mirroring(&self, mirrored: bool) -> Result<(), DeviceError> {
        self.order(Request::SetMirroring(mirrored))
    }
}
