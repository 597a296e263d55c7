//! A sensor of several channels on ports.

use std::io;
use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

use yarp_devices::{Device, SensorReading, SensorStatus};
use yarp_ports::{Answer, Network, Port, PortOptions, Received};
use yarp_wire::Stamp;
use yarp_wire::float_vector::Vector;

use super::calibration_requests;
use crate::OpenError;
use crate::device_ports::{ServedPort, ServedPorts};
use crate::open_ports::{port_name, request_port};
use crate::page_request::request_of;
use crate::periodic_thread::{PeriodicThread, check_period};

/// Default interval between messages, as stock.
const DEFAULT_PERIOD: Duration = Duration::from_millis(20);
/// Maximum number of messages in a reader's queue.
const MAX_BACKLOG: usize = 4;

/// Options of a server of one sensor.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct AnalogSensorOptions {
    period: Duration,
    parts: Vec<(String, Range<usize>)>,
}

impl Default for AnalogSensorOptions {
    fn default() -> Self {
        Self {
            period: DEFAULT_PERIOD,
            parts: Vec::new(),
        }
    }
}

impl AnalogSensorOptions {
    /// All channels on one port, every 20 ms.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets the interval between messages, 1 ms to 60 s.
    pub fn period(mut self, period: Duration) -> Self {
        self.period = period;
        self
    }

    /// Adds a port `NAME/part` for a range of channels; then there is no port for all.
    pub fn part(mut self, part: impl Into<String>, channels: Range<usize>) -> Self {
        self.parts.push((part.into(), channels));
        self
    }
}

/// A sensor of several channels, served like `analogServer` of YARP 3.x.
///
/// * `NAME`, or `NAME/PART` for each part, sends the channels as a vector every period; the envelope has the time of the
///   measurement. While the sensor is in another state than [`SensorStatus::Ok`], nothing is sent.
/// * `.../rpc:i` calibrates. Any client that can connect can do that.
///
/// Dropping it closes the ports in the background.
#[derive(Debug)]
pub struct AnalogSensorServer {
    ports: ServedPorts,
}

impl AnalogSensorServer {
    /// Opens two ports, or two for each part, and begins to publish.
    ///
    /// * `name`: the whole name of the port, begins with `/`.
    /// * Errors: [`OpenError::NoInterface`] when the device is no such sensor or lacks channels of a part,
    ///   [`OpenError::Period`], [`OpenError::NameTaken`], [`OpenError::Port`], [`OpenError::Thread`]; then all that was
    ///   opened is closed again.
    pub async fn open(
        network: &Network,
        device: Arc<dyn Device>,
        name: &str,
        options: AnalogSensorOptions,
    ) -> Result<Self, OpenError> {
        check_period(options.period)?;
        let sensor = device.analog_sensor();
        let sensor = sensor.ok_or(OpenError::NoInterface("channels of a sensor"))?;
        let channels = sensor.channels();
        let mut parts = options.parts;
        if parts.iter().any(|(_, range)| range.end > channels) {
            return Err(OpenError::NoInterface("channels that a port is to have"));
        }
        if parts.is_empty() {
            parts.push((String::new(), 0..channels));
        }
        let mut wanted = Vec::new();
        for (part, _) in &parts {
            let rpc = match part.as_str() {
                "" => "rpc:i".to_owned(),
                part => format!("{part}/rpc:i"),
            };
            let calibration = answering(device.clone(), &port_name(name, part));
            wanted.push(ServedPort::output(part, PortOptions::new()));
            wanted.push(ServedPort::input(rpc, calibration));
        }
        let period = options.period;
        let ranges = parts.into_iter().map(|(_, range)| range);
        let start = |outputs: &[Arc<Port>]| {
            let ports = outputs.iter().cloned().zip(ranges).collect();
            start(device.clone(), name, ports, period)
        };
        let ports = ServedPorts::open(network, name, wanted, start).await?;
        tracing::info!(name, channels, ?period, "sensor served");
        Ok(Self { ports })
    }

    /// The name of the port, or the beginning of the names of all.
    pub fn name(&self) -> &str {
        self.ports.name()
    }

    /// Ends publishing, closes the ports and unregisters their names.
    ///
    /// Takes a few seconds at most, even if peers do not answer.
    pub async fn close(self) {
        self.ports.close().await;
    }
}

/// Answers requests for calibration.
fn answering(device: Arc<dyn Device>, name: &str) -> PortOptions {
    let name = name.to_owned();
    request_port()
        .handler(move |received: &mut Received| {
            let Some(sensor) = device.analog_sensor() else {
                return Answer::Nothing;
            };
            let request = request_of(received);
            let (answer, refusal) = calibration_requests::answer(sensor, &request);
            if let Some(error) = refusal {
                tracing::warn!("{name}: {request} from {} refused: {error}", received.from);
            }
            Answer::reply(answer)
        })
        .input_only()
}

/// Starts publishing on each port its range of channels.
fn start(
    device: Arc<dyn Device>,
    name: &str,
    ports: Vec<(Arc<Port>, Range<usize>)>,
    period: Duration,
) -> io::Result<PeriodicThread> {
    let name = name.to_owned();
    let mut reading = SensorReading::default();
    let mut message = Vector::default();
    let mut stamp = Stamp::new(-1, 0.0);
    let mut failing = false;
    PeriodicThread::start("analog-sensor", period, move || {
        let Some(sensor) = device.analog_sensor() else {
            return;
        };
        sensor.read_channels(&mut reading);
        if reading.status != SensorStatus::Ok {
            if !std::mem::replace(&mut failing, true) {
                let status = reading.status;
                tracing::warn!(
                    "{name}: the sensor is in state {status:?}; no values are sent until it works"
                );
            }
            return;
        }
        failing = false;
        stamp = stamp.next(reading.time);
        for (port, range) in &ports {
            let Some(values) = reading.values.get(range.clone()) else {
                continue;
            };
            message.0.clear();
            message.0.extend_from_slice(values);
            port.try_write(&message, Some(stamp.into()), MAX_BACKLOG);
        }
    })
}
