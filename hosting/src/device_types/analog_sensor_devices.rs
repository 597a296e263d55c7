//! One sensor of several channels, as YARP 3.x knows it: a server and a client.
//!
//! Parameters are those of stock's `analogServer` and `analogsensorclient`, and of `skinWrapper` of iCub; those for ROS
//! have no effect. Source: `AnalogWrapper.cpp` and `AnalogSensorClient.cpp` of YARP 3.5, `skinWrapper.cpp` of icub-main.

use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

use yarp_devices::sensors::ChannelSensor;
use yarp_devices::{Device, DeviceError, SensorKind};
use yarp_wire::PortName;
use yarp_wire::settings::Parameters;
use yarp_wrappers::{
    AnalogSensorOptions, AnalogSensorServer, RemoteAnalogSensor, RemoteAnalogSensorOptions,
};

use super::attached_server::{AttachedServer, check_period, single};
use super::local_device::LocalDevice;
use super::remote_board::cast;
use super::{OpenResult, Opening};
use crate::{Attached, HostError};

/// Default interval of iCub's `skinWrapper`, ms.
const DEFAULT_SKIN_PERIOD_MS: usize = 20;

/// Opens a client of a sensor that another program serves.
pub(super) async fn remote(opening: Opening<'_>) -> OpenResult {
    let parameters = opening.parameters;
    let remote: PortName = parameters.need("remote")?;
    let local: PortName = parameters.need("local")?;
    let mut options = RemoteAnalogSensorOptions::new(remote.to_string(), local.to_string());
    if let Some(carrier) = parameters.get::<String>("carrier")? {
        options = options.carrier(carrier);
    }
    let network = opening.network.clone();
    let sensor = cast(parameters, move || {
        RemoteAnalogSensor::open(&network, options)
    })
    .await?;
    Ok(Box::new(LocalDevice::channels(sensor)))
}

/// Opens a server, whose ports are open while it is attached.
pub(super) async fn server(opening: Opening<'_>) -> OpenResult {
    let parameters = opening.parameters;
    let name: PortName = parameters.need("name")?;
    let period = parameters.need::<usize>("period")?;
    serve(opening, name, period)
}

/// Opens a server of a skin, with the ports `/ROBOT/skin/PART` as iCub's `skinWrapper`.
pub(super) async fn skin(opening: Opening<'_>) -> OpenResult {
    let parameters = opening.parameters;
    let robot: String = parameters.need("robotName")?;
    let expected = "a name that begins the name of a port";
    let name = format!("/{}/skin", robot.trim_start_matches('/')).parse::<PortName>();
    let name = name.map_err(|_| parameters.refuse("robotName", expected))?;
    let period = parameters.get_or("period", DEFAULT_SKIN_PERIOD_MS)?;
    // Stock's total number of channels, which the sensor tells.
    parameters.has("total_taxels");
    serve(opening, name, period)
}

/// Opens a server with a period in milliseconds.
fn serve(opening: Opening<'_>, name: PortName, period: usize) -> OpenResult {
    let parameters = opening.parameters;
    let period = Duration::from_millis(period as u64);
    let period = check_period(parameters, period, "1 to 60000 milliseconds")?;
    let mut options = AnalogSensorOptions::new().period(period);
    for (part, channels) in parts(parameters)? {
        options = options.part(part, channels);
    }
    let sensor: Option<String> = parameters.get("sensor")?;
    let (origin, device) = (parameters.origin().clone(), parameters.device().to_owned());
    let choice = move |others: &[Attached]| {
        let failed = |source| HostError::Device {
            origin: origin.clone(),
            device: device.clone(),
            source,
        };
        sensor_of(single(others)?, sensor.as_deref(), failed)
    };
    let server = AttachedServer::<AnalogSensorServer, _>::boxed;
    Ok(server(opening, name.to_string(), options, choice))
}

/// Reads `ports (a b)` and, for each, `a (first last first last)`: the channels of the sensor, and those of the port,
/// which begin with 0.
fn parts(parameters: &Parameters) -> Result<Vec<(String, Range<usize>)>, HostError> {
    // Stock's total number, which the sensor tells.
    parameters.has("channels");
    let mut parts = Vec::new();
    for part in parameters.list::<String>("ports")?.unwrap_or_default() {
        let expected = "first and last channel of the sensor, then 0 and last channel of the port";
        let row = parameters.list::<usize>(&part)?.unwrap_or_default();
        let [first, last, 0, top] = row[..] else {
            return Err(parameters.refuse(&part, expected).into());
        };
        if last < first || last - first != top {
            return Err(parameters.refuse(&part, expected).into());
        }
        parts.push((part, first..last + 1));
    }
    Ok(parts)
}

/// Returns the sensor of a device: its own channels, or the one of its sensors with this name, first of all a
/// force/torque sensor.
fn sensor_of(
    other: &Attached,
    name: Option<&str>,
    failed: impl FnOnce(Box<DeviceError>) -> HostError,
) -> Result<Arc<dyn Device>, HostError> {
    if let Some(channels) = other.parts.channels.clone() {
        return Ok(channels);
    }
    let unsuitable = || HostError::Unsuitable {
        device: other.device.clone(),
        expected: "a sensor",
    };
    let sensors = other.parts.sensors.clone().ok_or_else(unsuitable)?;
    let kinds = std::iter::once(SensorKind::ForceTorque).chain(SensorKind::ALL);
    let mut first = None;
    for kind in kinds {
        match ChannelSensor::new(sensors.clone(), kind, name) {
            Ok(sensor) => return Ok(Arc::new(sensor)),
            Err(error) => drop(first.get_or_insert(error)),
        }
    }
    Err(first.map_or_else(unsuitable, |source| failed(Box::new(source))))
}
