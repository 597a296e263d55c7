//! `image_to_mono`.

use std::sync::Arc;

use yarp_wire::typed::PixelCode;

use super::depth_image::{image, of_image};
use super::{Made, Monitor, MonitorSetup, Passing};

/// Images in grey; other messages, and pixels without a grey value, pass unchanged.
#[derive(Debug)]
pub(super) struct ToMono;

impl ToMono {
    pub(super) fn make(_: &MonitorSetup) -> Made {
        Ok(Arc::new(Self))
    }
}

impl Monitor for ToMono {
    fn update(&self, message: Passing) -> Option<Passing> {
        let image = image(&message.payload);
        let grey = image.and_then(|image| image.converted(PixelCode::MONO).ok());
        Some(match grey {
            Some(grey) => message.with(of_image(&grey)),
            None => message,
        })
    }
}
