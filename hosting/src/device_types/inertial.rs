//! A server of an inertial sensor, with the parameters of stock's `inertial` of 3.x; those for ROS have no effect.
//!
//! Source: `ServerInertial.cpp` of YARP 3.5.

use std::sync::Arc;
use std::time::Duration;

use yarp_devices::sensors::ImuChannels;
use yarp_wire::PortName;
use yarp_wrappers::{InertialOptions, InertialServer};

use super::attached_server::{AttachedServer, check_period, single};
use super::{OpenResult, Opening};
use crate::{Attached, HostError};

/// Stock's defaults.
const DEFAULT_NAME: &str = "/inertial";
const DEFAULT_PERIOD: f64 = 0.005;

/// Opens a server, whose port is open while it is attached to sensors of several kinds, or of several channels.
pub(super) async fn open(opening: Opening<'_>) -> OpenResult {
    let parameters = opening.parameters;
    let name: Option<PortName> = parameters.get("name")?;
    let name = name.map_or_else(|| DEFAULT_NAME.to_owned(), |name| name.to_string());
    let period = parameters.get_or("period", DEFAULT_PERIOD)?;
    let period = Duration::try_from_secs_f64(period)
        .map_err(|_| parameters.refuse("period", "0.001 to 60 seconds"))?;
    let period = check_period(parameters, period, "0.001 to 60 seconds")?;
    let sensor: Option<String> = parameters.get("sensor")?;
    // Stock's choice between waiting for slow readers and not.
    parameters.has("strict");
    let (origin, device) = (parameters.origin().clone(), parameters.device().to_owned());
    let choice = move |others: &[Attached]| {
        let other = single(others)?;
        if let Some(sensors) = other.parts.sensors.clone() {
            match ImuChannels::new(sensors, sensor.as_deref()) {
                Ok(channels) => return Ok(Arc::new(channels) as Arc<_>),
                // It may have channels of its own.
                Err(_) if sensor.is_none() && other.parts.channels.is_some() => {}
                Err(source) => {
                    return Err(HostError::Device {
                        origin: origin.clone(),
                        device: device.clone(),
                        source: Box::new(source),
                    });
                }
            }
        }
        let channels = other.parts.channels.clone();
        channels.ok_or_else(|| HostError::Unsuitable {
            device: other.device.clone(),
            expected: "an inertial sensor",
        })
    };
    let options = InertialOptions::new().period(period);
    let server = AttachedServer::<InertialServer, _>::boxed;
    Ok(server(opening, name, options, choice))
}
