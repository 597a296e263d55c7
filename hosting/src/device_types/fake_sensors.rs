//! Sensors with constant values, in the place of boards that are not there.

use std::sync::Arc;
use std::time::Duration;

use yarp_devices::fake::{ConstantSensors, FakeImu};
use yarp_devices::{Device, SensorInfo, SensorKind};

use super::local_device::LocalDevice;
use super::{OpenResult, Opening};
use crate::shared_parameters::flag;
use crate::{Attached, Future, HostError, Hosted, Parts};

/// Maximum number of channels; a large skin has some thousands.
const MAX_CHANNELS: usize = 10_000;

/// Default period of an inertial sensor, milliseconds, as stock.
const DEFAULT_IMU_PERIOD: usize = 10;
/// Maximum period of an inertial sensor, milliseconds.
const MAX_IMU_PERIOD: usize = 60_000;

/// Opens an inertial sensor with the parameters of stock's `fakeIMU`.
///
/// Source: `fakeIMU.cpp` of 3.5, `FakeIMU_params.md` of 4.0.
pub(super) async fn imu(opening: Opening<'_>) -> OpenResult {
    let parameters = opening.parameters;
    let period = parameters.get_or("period", DEFAULT_IMU_PERIOD)?;
    if !(1..=MAX_IMU_PERIOD).contains(&period) {
        let expected = format!("1 to {MAX_IMU_PERIOD} milliseconds");
        return Err(parameters.refuse("period", expected).into());
    }
    let imu = match flag(parameters, "constantValue")? {
        true => FakeImu::constant(),
        false => FakeImu::new(Duration::from_millis(period as u64)),
    };
    let imu = imu.named(SensorInfo {
        name: parameters.get_or("sensorName", "sensorName".to_owned())?,
        frame: parameters.get_or("frameName", "frameName".to_owned())?,
    });
    let imu = LocalDevice::sensors(Arc::new(imu)).also(|parts| &mut parts.other);
    Ok(Box::new(imu))
}

/// Opens sensors with the names that stock's `multipleanalogsensorsremapper` selects, and `channels` channels.
pub(super) async fn open(opening: Opening<'_>) -> OpenResult {
    let parameters = opening.parameters;
    let channels = parameters.get_or("channels", 6)?;
    if !(1..=MAX_CHANNELS).contains(&channels) {
        let expected = format!("1 to {MAX_CHANNELS} channels");
        return Err(parameters.refuse("channels", expected).into());
    }
    let mut sensors = ConstantSensors::new(channels);
    for kind in SensorKind::ALL {
        let names = parameters.list::<String>(&format!("{}Names", kind.stock_name()))?;
        sensors = sensors.sensors_of(kind, names.unwrap_or_default());
    }
    Ok(Box::new(FakeSensors(Arc::new(sensors))))
}

struct FakeSensors(Arc<dyn Device>);

impl Hosted for FakeSensors {
    fn parts(&self) -> Parts {
        Parts {
            sensors: Some(self.0.clone()),
            channels: Some(self.0.clone()),
            ..Parts::default()
        }
    }

    /// Has no effect: a device that these sensors replace may attach to others, as a filter does.
    fn attach(&mut self, others: Vec<Attached>) -> Future<'_, Result<(), HostError>> {
        drop(others);
        Box::pin(async { Ok(()) })
    }

    fn detach(&mut self) -> Future<'_, Result<(), HostError>> {
        Box::pin(async { Ok(()) })
    }

    fn close(self: Box<Self>) -> Future<'static, ()> {
        Box::pin(async {})
    }
}
