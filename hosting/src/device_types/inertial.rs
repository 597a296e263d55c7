//! A server of an inertial sensor, with the parameters of stock's `inertial` of 3.x; those for ROS have no effect.
//!
//! Source: `ServerInertial.cpp` of YARP 3.5.

use std::sync::Arc;
use std::time::Duration;

use yarp_devices::Device;
use yarp_devices::sensors::ImuChannels;
use yarp_wire::PortName;
use yarp_wrappers::{InertialOptions, InertialServer};

use super::attached_server::{AttachedServer, check_period, single};
use super::{OpenResult, Opening};
use crate::{Attached, HostError};

/// Stock's defaults.
const DEFAULT_NAME: &str = "/inertial";
const DEFAULT_PERIOD: f64 = 0.005;

/// Opens a server, whose port is open while it is attached to sensors of several kinds, to a generic sensor, or to one of several channels.
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
                Err(_) if sensor.is_none() && channels_of(other).is_some() => {}
                Err(source) => {
                    return Err(HostError::Device {
                        origin: origin.clone(),
                        device: device.clone(),
                        source: Box::new(source),
                    });
                }
            }
        }
        channels_of(other).ok_or_else(|| HostError::Unsuitable {
            device: other.device.clone(),
            expected: "an inertial sensor",
        })
    };
    let options = InertialOptions::new().period(period);
    let server = AttachedServer::<InertialServer, _>::boxed;
    Ok(server(opening, name, options, choice))
}

/// Returns the part that is one sensor of several channels: a generic one, as in stock, or another.
fn channels_of(other: &Attached) -> Option<Arc<dyn Device>> {
    let parts = &other.parts;
    let mut devices = parts.devices();
    let generic = devices.find(|device| device.generic_sensor().is_some());
    generic.or(parts.channels.as_ref()).cloned()
}

#[cfg(test)]
mod tests {
    use yarp_devices::fake::{ConstantSensors, FakeImu, SimulatedBattery};
    use yarp_devices::{GenericSensor, SensorReading};

    use super::*;
    use crate::Parts;

    /// A device that is a generic sensor and nothing else.
    struct Generic(FakeImu);

    impl GenericSensor for Generic {
        fn generic_channels(&self) -> usize {
            self.0.generic_channels()
        }
        fn read_generic(&self, reading: &mut SensorReading) {
            self.0.read_generic(reading);
        }
    }

    impl Device for Generic {
        yarp_devices::offers! { generic_sensor: GenericSensor }
    }

    fn attached(set: impl FnOnce(&mut Parts)) -> Attached {
        let mut parts = Parts::default();
        set(&mut parts);
        Attached {
            device: "it".to_owned(),
            network: "it".to_owned(),
            parts,
        }
    }

    #[test]
    fn a_generic_sensor_is_chosen_before_other_channels() {
        let generic: Arc<dyn Device> = Arc::new(Generic(FakeImu::constant()));
        let channels: Arc<dyn Device> = Arc::new(ConstantSensors::new(2));
        let both = attached(|parts| {
            parts.other = Some(generic.clone());
            parts.channels = Some(channels.clone());
        });
        assert!(Arc::ptr_eq(&channels_of(&both).unwrap(), &generic));
        let one = attached(|parts| parts.channels = Some(channels.clone()));
        assert!(Arc::ptr_eq(&channels_of(&one).unwrap(), &channels));
        let battery: Arc<dyn Device> = Arc::new(SimulatedBattery::new(1.0, 1.0));
        assert!(channels_of(&attached(|parts| parts.other = Some(battery))).is_none());
    }
}
