//! An inertial sensor on one port, as the device `inertial` of YARP 3.x; 4.0 has none.
//!
//! ```text
//! NAME   the channels as a bottle of floats, every period; the envelope has the time of the measurement
//! ```
//!
//! The device is a [`GenericSensor`](yarp_devices::GenericSensor), as in stock, or an [`AnalogSensor`](yarp_devices::AnalogSensor). With an inertial measurement unit the twelve floats are those of `ImuChannels` of `yarp-devices`.
//! What the port receives is passed over. Source: `ServerInertial.cpp` of YARP 3.5.

use std::sync::Arc;
use std::time::Duration;

use yarp_devices::{Device, SensorReading, SensorStatus};
use yarp_ports::{Network, Port, PortOptions};
use yarp_wire::Stamp;
use yarp_wire::float_vector::Vector;

use crate::OpenError;
use crate::device_ports::{ServedPort, ServedPorts};
use crate::periodic_thread::{PeriodicThread, check_period};

/// Default interval between messages, as stock.
const DEFAULT_PERIOD: Duration = Duration::from_millis(5);

/// Options of a server of an inertial sensor.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct InertialOptions {
    period: Duration,
}

impl Default for InertialOptions {
    fn default() -> Self {
        Self {
            period: DEFAULT_PERIOD,
        }
    }
}

impl InertialOptions {
    /// A message every 5 ms.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets the interval between messages, 1 ms to 60 s.
    pub fn period(mut self, period: Duration) -> Self {
        self.period = period;
        self
    }
}

/// A sensor of several channels, served like `inertial` of YARP 3.x.
///
/// While the sensor is in another state than [`SensorStatus::Ok`], nothing is sent; a reader that is busy misses messages.
///
/// Dropping it closes the port in the background.
#[derive(Debug)]
pub struct InertialServer {
    ports: ServedPorts,
}

impl InertialServer {
    /// Opens the port `name` and begins to publish.
    ///
    /// * Errors: [`OpenError::NoInterface`] when the device is no sensor of several channels, [`OpenError::Period`],
    ///   [`OpenError::NameTaken`], [`OpenError::Port`], [`OpenError::Thread`]; then nothing stays open.
    pub async fn open(
        network: &Network,
        device: Arc<dyn Device>,
        name: &str,
        options: InertialOptions,
    ) -> Result<Self, OpenError> {
        let period = options.period;
        check_period(period)?;
        if device.generic_sensor().is_none() && device.analog_sensor().is_none() {
            return Err(OpenError::NoInterface("channels of a sensor"));
        }
        let wanted = vec![ServedPort::output("", PortOptions::new())];
        let board = name.to_owned();
        let start = |outputs: &[Arc<Port>]| publish(device, board, outputs[0].clone(), period);
        let ports = ServedPorts::open(network, name, wanted, start).await?;
        tracing::info!(name, ?period, "inertial sensor served");
        Ok(Self { ports })
    }

    /// Returns the name of the port.
    pub fn name(&self) -> &str {
        self.ports.name()
    }

    /// Ends publishing, closes the port and unregisters its name; takes a few seconds at most.
    pub async fn close(self) {
        self.ports.close().await;
    }
}

/// Publishes the channels every period.
fn publish(
    device: Arc<dyn Device>,
    name: String,
    port: Arc<Port>,
    period: Duration,
) -> std::io::Result<PeriodicThread> {
    let mut reading = SensorReading::default();
    let mut message = Vector::default();
    let mut stamp = Stamp::new(-1, 0.0);
    let mut failing = false;
    PeriodicThread::start("inertial", period, move || {
        match (device.generic_sensor(), device.analog_sensor()) {
            (Some(sensor), _) => sensor.read_generic(&mut reading),
            (None, Some(sensor)) => sensor.read_channels(&mut reading),
            (None, None) => reading.fail(SensorStatus::Error),
        }
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
        message.0.clear();
        message.0.extend_from_slice(&reading.values);
        port.write_if_idle(&message, Some(stamp.into()));
    })
}
