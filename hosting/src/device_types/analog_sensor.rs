//! One sensor of several channels, as YARP 3.x knows it: a server and a client.
//!
//! Parameters are those of stock's `analogServer` and `analogsensorclient`; those for ROS have no effect.
//! Source: `AnalogWrapper.cpp` and `AnalogSensorClient.cpp` of YARP 3.5.

use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

use yarp_devices::sensors::ChannelSensor;
use yarp_devices::{Device, SensorKind};
use yarp_ports::Network;
use yarp_wire::PortName;
use yarp_wire::settings::{Origin, Parameters};
use yarp_wrappers::{
    AnalogSensorOptions, AnalogSensorServer, RemoteAnalogSensor, RemoteAnalogSensorOptions,
};

use super::attached_server::{AttachedServer, check_period};
use super::local_device::LocalDevice;
use super::remote_board::cast;
use super::{OpenResult, Opening};
use crate::{Attached, Future, HostError, Hosted};

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
    let period = Duration::from_millis(parameters.need::<usize>("period")? as u64);
    let period = check_period(parameters, period, "1 to 60000 milliseconds")?;
    let mut options = AnalogSensorOptions::new().period(period);
    for (part, channels) in parts(parameters)? {
        options = options.part(part, channels);
    }
    Ok(Box::new(Server {
        network: opening.network.clone(),
        name: name.to_string(),
        options,
        sensor: parameters.get("sensor")?,
        origin: parameters.origin().clone(),
        device: parameters.device().to_owned(),
        ports: AttachedServer::of(parameters),
    }))
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

struct Server {
    network: Network,
    name: String,
    options: AnalogSensorOptions,
    /// Name of the sensor, of a device with several.
    sensor: Option<String>,
    origin: Origin,
    device: String,
    ports: AttachedServer<AnalogSensorServer>,
}

impl Server {
    /// Returns the sensor of a device: its own channels, or one of its sensors, first of all a force/torque sensor.
    fn sensor_of(&self, other: &Attached) -> Result<Arc<dyn Device>, HostError> {
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
            match ChannelSensor::new(sensors.clone(), kind, self.sensor.as_deref()) {
                Ok(sensor) => return Ok(Arc::new(sensor)),
                Err(error) => drop(first.get_or_insert(error)),
            }
        }
        Err(first.map_or_else(unsuitable, |source| HostError::Device {
            origin: self.origin.clone(),
            device: self.device.clone(),
            source: Box::new(source),
        }))
    }
}

impl Hosted for Server {
    fn attach(&mut self, others: Vec<Attached>) -> Future<'_, Result<(), HostError>> {
        Box::pin(async move {
            self.ports.check_free()?;
            let [other] = &others[..] else {
                return Err(HostError::Several { got: others.len() });
            };
            let sensor = self.sensor_of(other)?;
            let options = self.options.clone();
            let opening = AnalogSensorServer::open(&self.network, sensor, &self.name, options);
            self.ports.open(opening).await
        })
    }

    fn detach(&mut self) -> Future<'_, Result<(), HostError>> {
        Box::pin(async move {
            self.ports.close().await;
            Ok(())
        })
    }

    fn close(mut self: Box<Self>) -> Future<'static, ()> {
        Box::pin(async move { self.ports.close().await })
    }
}
