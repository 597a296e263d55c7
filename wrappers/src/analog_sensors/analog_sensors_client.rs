//! Sensors at the other end.
//!
//! ```text
//! measures   LOCAL/measures:i <- REMOTE/measures:o
//! calls      LOCAL/rpc:i      -> REMOTE/rpc:o
//! ```

use std::sync::Arc;
use std::time::Duration;

use yarp_devices::{
    AnalogSensors, Device, DeviceError, SensorInfo, SensorKind, SensorReading, SensorStatus,
};
use yarp_ports::{Network, PortError, PortOptions, Received, blocking};
use yarp_wire::{Bottle, WireVersion};

use super::measures_message::Measures;
use super::metadata_message::{Metadata, metadata_call};
use crate::OpenError;
use crate::device_ports::{
    LatestValue, Link, RemoteOptions, RemotePorts, RpcPort, SharedLink, common_setters, stream_port,
};

const RPC: RpcPort = RpcPort {
    local: "rpc:i",
    remote: "rpc:o",
};

/// Options of remote sensors.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct RemoteAnalogSensorsOptions {
    common: RemoteOptions,
    external_connection: bool,
}

impl RemoteAnalogSensorsOptions {
    /// The sensors named `remote`, by ports named after `local`: `/wam/sensors` and, for instance, `/me/sensors`.
    ///
    /// Measures travel over `fast_tcp` and are trusted for 100 ms; an answer is waited for 2 s.
    pub fn new(remote: impl Into<String>, local: impl Into<String>) -> Self {
        Self {
            common: RemoteOptions::new(remote, local).max_state_age(Duration::from_millis(100)),
            external_connection: false,
        }
    }

    common_setters! {
        /// Sets the carrier for measures (stock: `carrier`). Calls always use `tcp`.
        carrier(carrier: impl Into<String>);
        /// Sets the maximum age of measures (stock: `timeout`, 10 ms there).
        max_state_age(age: Duration);
        /// Sets the timeout of a reply and of each step of opening.
        rpc_timeout(timeout: Duration);
    }

    /// Connects nothing: measures come over a connection that others make, and sensors have no names (stock:
    /// `externalConnection`).
    pub fn external_connection(mut self) -> Self {
        self.external_connection = true;
        self
    }
}

/// Sensors in another program, as stock's `multipleanalogsensorsclient` casts them back.
///
/// * Readings are those of the newest message; reading waits for nothing. Before the first message a sensor is in
///   [`SensorStatus::WaitingForFirstRead`], and in [`SensorStatus::Timeout`] when the newest message is older than
///   [`RemoteAnalogSensorsOptions::max_state_age`].
/// * The time of a reading is that at which the device measured it.
/// * Messages of ten lists (up to YARP 3.10) and of twelve are read.
/// * Lost connections are made again when the server is back. The names are those of the time of opening.
///
/// Dropping it closes its ports and unregisters their names; that takes a few seconds at the most.
#[derive(Debug)]
pub struct RemoteAnalogSensors {
    /// Closes the ports on drop.
    _ports: SharedLink<RemotePorts>,
    latest: Arc<LatestValue<Measures>>,
    metadata: Option<Metadata>,
}

impl RemoteAnalogSensors {
    /// Opens two ports of its own, connects them to the server and asks for the names of the sensors.
    ///
    /// * Ports: `LOCAL/measures:i` and `LOCAL/rpc:i`.
    /// * Blocks for a few timeouts at the most; does not wait for the first measures.
    /// * Errors: [`OpenError::NoRemote`], [`OpenError::NameTaken`], [`OpenError::Port`], [`OpenError::Connect`],
    ///   [`OpenError::Query`]; then nothing stays open.
    pub fn open(network: &Network, options: RemoteAnalogSensorsOptions) -> Result<Self, OpenError> {
        let RemoteAnalogSensorsOptions {
            common: options,
            external_connection,
        } = options;
        let network = network.with_timeout(options.rpc_timeout);
        let latest = Arc::new(LatestValue::new("measures", options.max_state_age));
        let newest = latest.clone();
        let connects = !external_connection;
        let opening = async move { connect(&network, &options, newest, connects).await };
        let (ports, metadata) = blocking::wait(opening)?;
        let sensors = metadata.as_ref().map(Metadata::count);
        tracing::info!(
            remote = ports.remote(),
            ?sensors,
            "remote sensors connected"
        );
        Ok(Self {
            _ports: SharedLink::new(ports),
            latest,
            metadata,
        })
    }
}

impl AnalogSensors for RemoteAnalogSensors {
    fn sensors(&self, kind: SensorKind) -> Vec<SensorInfo> {
        match &self.metadata {
            Some(metadata) => metadata.0[kind.index()].clone(),
            None => self.latest.inspect(|newest, _| {
                let count = newest.map_or(0, |newest| newest.readings[kind.index()].len());
                vec![SensorInfo::default(); count]
            }),
        }
    }

    fn read_sensors(&self, kind: SensorKind, readings: &mut Vec<SensorReading>) {
        self.latest.inspect(|newest, status| {
            let read = newest.map_or(&[][..], |newest| &newest.readings[kind.index()]);
            let count = match &self.metadata {
                Some(metadata) => metadata.0[kind.index()].len(),
                None => read.len(),
            };
            readings.resize_with(count, SensorReading::default);
            for (index, reading) in readings.iter_mut().enumerate() {
                match (status, read.get(index)) {
                    (SensorStatus::Ok, Some(read)) => reading.clone_from(read),
                    (SensorStatus::Ok, None) => reading.fail(SensorStatus::Error),
                    (status, _) => {
                        let size = kind.size().unwrap_or_default();
                        reading.values.resize(size, f64::NAN);
                        reading.fail(status);
                    }
                }
            }
        });
    }
}

impl Device for RemoteAnalogSensors {
    yarp_devices::offers! { analog_sensors: AnalogSensors }
}

/// Opens the ports; if it `connects`, connects them in the order of stock and asks for the names.
async fn connect(
    network: &Network,
    options: &RemoteOptions,
    latest: Arc<LatestValue<Measures>>,
    connects: bool,
) -> Result<(RemotePorts, Option<Metadata>), OpenError> {
    if connects {
        let needed = [RPC.remote, "measures:o"];
        options.check_remote(network, &needed).await?;
    }
    let stored = latest.clone();
    // A server of both wire versions sends twelve lists once, and not ten behind them.
    let measures =
        stream_port(move |received| take(&stored, received)).wire_version(WireVersion::V4);
    let wanted = vec![
        ("measures:i", measures),
        (RPC.local, PortOptions::new().rpc_client()),
    ];
    let mut ports = RemotePorts::open(network, options, "server", RPC, wanted).await?;
    if !connects {
        return Ok((ports, None));
    }
    let connected = async {
        ports.connect_rpc().await?;
        let age = options.max_state_age;
        ports.subscribe("measures:o", 0, &latest, age).await?;
        let metadata = metadata(&ports).await;
        metadata.map(Some).map_err(|source| OpenError::Query {
            question: "the names of its sensors",
            source,
        })
    }
    .await;
    ports.unless_failed(connected).await
}

async fn metadata(ports: &RemotePorts) -> Result<Metadata, DeviceError> {
    let failed = |advice: &str, source: Option<PortError>| DeviceError::Remote {
        peer: ports.rpc_peer().to_owned(),
        step: "`getMetadata`".to_owned(),
        advice: advice.to_owned(),
        source: source.map(Into::into),
    };
    let answer = ports.send::<Bottle>(&metadata_call()).await;
    let answer = answer.map_err(|error| failed("`yarp ping` of it", Some(error)))?;
    Metadata::read(&answer)
        .ok_or_else(|| failed("whether it is a multipleanalogsensorsserver", None))
}

/// Takes in a message of the stream.
fn take(latest: &LatestValue<Measures>, received: &Received) {
    match received.read::<Measures>() {
        Ok(measures) => latest.store(measures),
        Err(error) => tracing::warn!(from = %received.from, "not measures of sensors: {error}"),
    }
}
