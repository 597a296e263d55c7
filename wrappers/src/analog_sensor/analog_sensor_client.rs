//! A sensor of several channels at the other end.
//!
//! ```text
//! values   LOCAL       <- REMOTE
//! calls    LOCAL/rpc:o -> REMOTE/rpc:i
//! ```

use std::sync::Arc;
use std::time::Duration;

use yarp_devices::clock;
use yarp_devices::{AnalogSensor, Device, DeviceError, SensorReading, SensorStatus};
use yarp_ports::{Network, PortOptions, Received, blocking};

use super::calibration_requests;
use crate::OpenError;
use crate::device_ports::{
    LatestValue, Link, RemoteOptions, RemotePorts, RpcPort, SharedLink, common_setters, stream_port,
};

const RPC: RpcPort = RpcPort::USUAL;

/// Options of a remote sensor.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct RemoteAnalogSensorOptions {
    common: RemoteOptions,
}

impl RemoteAnalogSensorOptions {
    /// The sensor on the port `remote`, by ports named after `local`.
    ///
    /// Values travel over `udp`, as in stock, and are trusted for 100 ms; an answer is waited for 2 s.
    pub fn new(remote: impl Into<String>, local: impl Into<String>) -> Self {
        Self {
            common: RemoteOptions::new(remote, local)
                .carrier("udp")
                .max_state_age(Duration::from_millis(100)),
        }
    }

    common_setters! {
        /// Sets the carrier for values (stock: `carrier`).
        carrier(carrier: impl Into<String>);
        /// Sets the maximum age of values.
        max_state_age(age: Duration);
        /// Sets the timeout of a reply and of each step of opening.
        rpc_timeout(timeout: Duration);
    }
}

/// A sensor in another program, as `analogsensorclient` of YARP 3.x casts it back.
///
/// Values are those of the newest message. Before the first one there are no channels, and the sensor is in
/// [`SensorStatus::WaitingForFirstRead`]; it is in [`SensorStatus::Timeout`] when the newest message is older than
/// [`RemoteAnalogSensorOptions::max_state_age`]. Lost connections are made again when the server is back.
///
/// Dropping it closes its ports and unregisters their names; that takes a few seconds at the most.
#[derive(Debug)]
pub struct RemoteAnalogSensor {
    ports: SharedLink<RemotePorts>,
    latest: Arc<LatestValue<SensorReading>>,
}

impl RemoteAnalogSensor {
    /// Opens two ports of its own and connects them to the server; does not wait for the first values.
    ///
    /// * Ports: `LOCAL` and `LOCAL/rpc:o`.
    /// * Errors: [`OpenError::NoRemote`], [`OpenError::NameTaken`], [`OpenError::Port`], [`OpenError::Connect`]; then
    ///   nothing stays open.
    pub fn open(network: &Network, options: RemoteAnalogSensorOptions) -> Result<Self, OpenError> {
        let options = options.common;
        let network = network.with_timeout(options.rpc_timeout);
        let latest = Arc::new(LatestValue::new("channels", options.max_state_age));
        let newest = latest.clone();
        let opening = async move { connect(&network, &options, newest).await };
        Ok(Self {
            ports: SharedLink::new(blocking::wait(opening)?),
            latest,
        })
    }
}

/// Opens the ports and connects them in the order of stock.
async fn connect(
    network: &Network,
    options: &RemoteOptions,
    latest: Arc<LatestValue<SensorReading>>,
) -> Result<RemotePorts, OpenError> {
    options.check_remote(network, &["", RPC.remote]).await?;
    let stored = latest.clone();
    let wanted = vec![
        ("", stream_port(move |received| take(&stored, received))),
        (RPC.local, PortOptions::new().rpc_client()),
    ];
    let mut ports = RemotePorts::open(network, options, "sensor", RPC, wanted).await?;
    let connected = async {
        let age = options.max_state_age;
        ports.subscribe("", 0, &latest, age).await?;
        ports.connect_rpc().await
    }
    .await;
    ports
        .unless_failed(connected)
        .await
        .map(|(ports, ())| ports)
}

/// Takes in a message of the stream: a bottle of numbers.
fn take(latest: &LatestValue<SensorReading>, received: &Received) {
    let message = received.bottle().unwrap_or_default();
    let values: Option<Vec<f64>> = message.iter().map(yarp_wire::Value::as_f64).collect();
    let Some(values) = values else {
        tracing::warn!(from = %received.from, "not the channels of a sensor");
        return;
    };
    latest.store(SensorReading {
        values,
        time: received.stamp().map_or_else(clock::now, |stamp| stamp.time),
        status: SensorStatus::Ok,
    });
}

impl AnalogSensor for RemoteAnalogSensor {
    fn channels(&self) -> usize {
        let count = |newest: Option<&SensorReading>, _| newest.map_or(0, |read| read.values.len());
        self.latest.inspect(count)
    }

    fn read_channels(&self, reading: &mut SensorReading) {
        self.latest.inspect(|newest, status| {
            match newest {
                Some(newest) => reading.clone_from(newest),
                None => reading.clone_from(&SensorReading::default()),
            }
            reading.status = status;
        });
    }

    fn calibrate(&self, channel: Option<usize>) -> Result<(), DeviceError> {
        let request = calibration_requests::calibration(channel);
        self.ports.run(|ports| async move {
            let answer = ports.call(&request).await?;
            match calibration_requests::is_done(&answer) {
                true => Ok(()),
                false => Err(ports.refused(request, "the log of the server")),
            }
        })
    }
}

impl Device for RemoteAnalogSensor {
    yarp_devices::offers! { analog_sensor: AnalogSensor }
}
