//! The device behind the ports, and what requests mean for it.

use std::sync::Arc;

use yarp_devices::{
    Device, DeviceError, Feature, FeatureMode, FirewireControls, FrameGrabberControls,
    FrameGrabberImage, FrameGrabberImageRaw, RgbVisualParams,
};
use yarp_ports::Answer as PortAnswer;
use yarp_wire::{Bottle, WireVersion};

use super::served_firewire;
use crate::frame_grabber::messages::{
    self, Ability, Answer, As, Channel, Malformed, Request, refusal,
};
use crate::thrift::{ReturnCode, ServiceVersion};
use yarp_devices::image::Crop;

/// A camera and its name.
pub(super) struct RequestHandler {
    device: Arc<dyn Device>,
    name: String,
}

/// Reasons why a request was not executed.
#[derive(Debug, thiserror::Error)]
enum Refusal {
    #[error(transparent)]
    Malformed(#[from] Malformed),
    #[error(transparent)]
    Device(#[from] DeviceError),
    #[error("Selected camera device has no {0} interface")]
    NoInterface(&'static str),
    #[error("{0} is no feature of a camera")]
    NoFeature(i32),
    #[error("{0} is no mode of a feature")]
    NoMode(i32),
    #[error("the image does not fit into a message")]
    Unsendable,
}

impl Refusal {
    /// Returns the code of 4.0.
    fn code(&self) -> ReturnCode {
        match self {
            Self::NoInterface(_) => ReturnCode::NotReady,
            Self::NoFeature(_) | Self::Device(DeviceError::NotSupported { .. }) => {
                ReturnCode::NotImplemented
            }
            Self::NoMode(_) | Self::Device(DeviceError::Unsuitable { .. }) => {
                ReturnCode::OutOfBounds
            }
            Self::Device(_) | Self::Malformed(_) | Self::Unsendable => ReturnCode::Failed,
        }
    }
}

impl RequestHandler {
    pub(super) fn new(device: Arc<dyn Device>, name: &str) -> Self {
        Self {
            device,
            name: name.to_owned(),
        }
    }

    /// Executes a message and returns the reply.
    pub(super) fn answer(&self, message: &Bottle, from: &str) -> PortAnswer {
        match Request::is_call(message) {
            true => self.answer_call(message, from),
            false => PortAnswer::reply(self.answer_words(message, from)),
        }
    }

    fn answer_words(&self, message: &Bottle, from: &str) -> Bottle {
        let done = Request::parse(message)
            .map_err(Refusal::from)
            .and_then(|request| {
                let answer = self.perform(&request)?;
                request.reply(&answer).ok_or(Refusal::Unsendable)
            });
        done.unwrap_or_else(|error| {
            self.report(message, from, &error);
            refusal(message, &error.to_string())
        })
    }

    fn answer_call(&self, message: &Bottle, from: &str) -> PortAnswer {
        let request = match Request::parse(message) {
            Ok(Request::Help) => return PortAnswer::reply(messages::help()),
            Ok(Request::ProtocolVersion) => return PortAnswer::reply(ServiceVersion::SERVED),
            Ok(request) => request,
            Err(error) => {
                self.report(message, from, &error.into());
                return PortAnswer::reply(Bottle::of(yarp_wire::Vocab32::FAIL));
            }
        };
        let done = self.perform(&request).and_then(|answer| {
            let reply = request.reply_to_call(&answer);
            reply.ok_or(Refusal::Unsendable)
        });
        let reply = done.unwrap_or_else(|error| {
            self.report(message, from, &error);
            request.refuse_call(error.code())
        });
        PortAnswer::reply(As(WireVersion::V4, reply))
    }

    fn report(&self, message: &Bottle, from: &str, error: &Refusal) {
        tracing::debug!("{}: {message} from {from} refused: {error}", self.name);
    }

    /// Executes a query or a command on the device.
    fn perform(&self, request: &Request) -> Result<Answer, Refusal> {
        use Request as R;
        let side = |side: usize| Answer::Integer(i32::try_from(side).unwrap_or(i32::MAX));
        Ok(match request {
            R::Width(channel) => side(self.size(*channel)?.0),
            R::Height(channel) => side(self.size(*channel)?.1),
            R::Image(channel) => Answer::Image(self.image(*channel, None)?),
            R::Crop(channel, crop) => Answer::Image(self.image(*channel, Some(crop))?),
            R::RgbWidth => side(self.parameters()?.resolution()?.0),
            R::RgbHeight => side(self.parameters()?.resolution()?.1),
            R::Configurations => {
                Answer::Configurations(self.parameters()?.supported_configurations()?)
            }
            R::Resolution => {
                let (width, height) = self.parameters()?.resolution()?;
                let int = |side| i32::try_from(side).unwrap_or(i32::MAX);
                Answer::Size(int(width), int(height))
            }
            R::FieldOfView => {
                let (across, down) = self.parameters()?.field_of_view()?;
                Answer::Numbers(across, down)
            }
            R::Intrinsics => Answer::Intrinsics(self.parameters()?.intrinsics()?),
            R::Mirroring => Answer::Flag(self.parameters()?.mirroring()?),
            R::SetResolution(width, height) => {
                // What is below 0 is no size either.
                let side = |side: &i32| usize::try_from(*side).unwrap_or(0);
                self.parameters()?
                    .set_resolution(side(width), side(height))?;
                Answer::Done
            }
            R::SetFieldOfView(across, down) => {
                self.parameters()?.set_field_of_view(*across, *down)?;
                Answer::Done
            }
            R::SetMirroring(mirrored) => {
                self.parameters()?.set_mirroring(*mirrored)?;
                Answer::Done
            }
            R::Description => {
                let about = self.controls()?.camera_description()?;
                Answer::Description(about.bus.code(), about.description)
            }
            R::Has(ability, code) => Answer::Flag(self.has(*ability, *code)?),
            R::Value(code) => Answer::Number(self.controls()?.feature(feature(*code)?)?),
            R::Pair(code) => {
                let (one, other) = self.controls()?.feature_pair(feature(*code)?)?;
                Answer::Numbers(one, other)
            }
            R::Active(code) => Answer::Flag(self.controls()?.is_active(feature(*code)?)?),
            R::Mode(code) => Answer::Mode(self.controls()?.mode(feature(*code)?)?.code()),
            R::SetValue(code, value) => {
                self.controls()?.set_feature(feature(*code)?, *value)?;
                Answer::Done
            }
            R::SetPair(code, one, other) => {
                let controls = self.controls()?;
                controls.set_feature_pair(feature(*code)?, (*one, *other))?;
                Answer::Done
            }
            R::SetActive(code, active) => {
                self.controls()?.set_active(feature(*code)?, *active)?;
                Answer::Done
            }
            R::SetMode(code, mode) => {
                let known =
                    FeatureMode::from_code(*mode).filter(|mode| *mode != FeatureMode::Unknown);
                let mode = known.ok_or(Refusal::NoMode(*mode))?;
                self.controls()?.set_mode(feature(*code)?, mode)?;
                Answer::Done
            }
            R::OnePush(code) => {
                self.controls()?.one_push(feature(*code)?)?;
                Answer::Done
            }
            R::Firewire(what, values) => served_firewire::perform(self.firewire()?, *what, values)?,
            R::Help | R::ProtocolVersion => return Err(Malformed::Interface.into()),
        })
    }

    fn has(&self, ability: Ability, code: i32) -> Result<bool, Refusal> {
        let controls = self.controls()?;
        let Some(feature) = Feature::from_code(code) else {
            return Ok(false);
        };
        Ok(match ability {
            Ability::Feature => controls.has_feature(feature)?,
            Ability::OnOff => controls.has_on_off(feature)?,
            Ability::Auto => controls.has_auto(feature)?,
            Ability::Manual => controls.has_manual(feature)?,
            Ability::OnePush => controls.has_one_push(feature)?,
        })
    }

    fn size(&self, channel: Channel) -> Result<(usize, usize), Refusal> {
        Ok(match channel {
            Channel::Colour => self.colour()?.image_size()?,
            Channel::Raw => self.raw()?.raw_image_size()?,
        })
    }

    /// The newest image, or a part of it.
    fn image(
        &self,
        channel: Channel,
        crop: Option<&Crop>,
    ) -> Result<yarp_devices::image::Image, Refusal> {
        let frame = match (channel, crop) {
            (Channel::Colour, None) => self.colour()?.image()?,
            (Channel::Colour, Some(crop)) => self.colour()?.image_crop(crop)?,
            (Channel::Raw, None) => self.raw()?.raw_image()?,
            (Channel::Raw, Some(crop)) => self.raw()?.raw_image_crop(crop)?,
        };
        Ok(frame.image)
    }

    fn colour(&self) -> Result<&dyn FrameGrabberImage, Refusal> {
        let images = self.device.frame_grabber_image();
        images.ok_or(Refusal::NoInterface("IFrameGrabberImage"))
    }

    fn raw(&self) -> Result<&dyn FrameGrabberImageRaw, Refusal> {
        let images = self.device.frame_grabber_image_raw();
        images.ok_or(Refusal::NoInterface("IFrameGrabberImageRaw"))
    }

    fn controls(&self) -> Result<&dyn FrameGrabberControls, Refusal> {
        let controls = self.device.frame_grabber_controls();
        controls.ok_or(Refusal::NoInterface("IFrameGrabberControls"))
    }

    fn firewire(&self) -> Result<&dyn FirewireControls, Refusal> {
        let controls = self.device.firewire_controls();
        controls.ok_or(Refusal::NoInterface("IFrameGrabberControlsDC1394"))
    }

    fn parameters(&self) -> Result<&dyn RgbVisualParams, Refusal> {
        let parameters = self.device.rgb_visual_params();
        parameters.ok_or(Refusal::NoInterface("IRgbVisualParams"))
    }
}

fn feature(code: i32) -> Result<Feature, Refusal> {
    Feature::from_code(code).ok_or(Refusal::NoFeature(code))
}
