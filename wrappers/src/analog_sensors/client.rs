//! Sensors at the other end.
//!
//! ```text
//! measures   LOCAL/measures:i <- REMOTE/measures:o
//! calls      LOCAL/rpc:i      -> REMOTE/rpc:o
//! ```

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tokio::task::JoinSet;
use yarp_devices::{
    AnalogSensors, Device, DeviceError, SensorInfo, SensorKind, SensorReading, SensorStatus,
};
use yarp_ports::{
    Answer, Network, Port, PortError, PortOptions, Received, ReconnectingConnection, blocking,
};
use yarp_wire::{Bottle, WireVersion};

use super::measures_message::Measures;
use super::metadata_message::{Metadata, metadata_call};
use crate::OpenError;
use crate::open_ports::{close_all, open_all};
use crate::reconnect::{
    PORT_CLOSE_TIMEOUT, RPC_CARRIER, WATCH_INTERVAL, check_exists, connect_supervised, subscribe,
};

/// Options of remote sensors.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct RemoteAnalogSensorsOptions {
    remote: String,
    local: String,
    carrier: String,
    max_state_age: Duration,
    rpc_timeout: Duration,
    external_connection: bool,
}

impl RemoteAnalogSensorsOptions {
    /// The sensors named `remote`, by ports named after `local`: `/wam/sensors` and, for instance, `/me/sensors`.
    ///
    /// Measures travel over `fast_tcp` and are trusted for 100 ms; an answer is waited for 2 s.
    pub fn new(remote: impl Into<String>, local: impl Into<String>) -> Self {
        Self {
            remote: remote.into(),
            local: local.into(),
            carrier: "fast_tcp".to_owned(),
            max_state_age: Duration::from_millis(100),
            rpc_timeout: Duration::from_secs(2),
            external_connection: false,
        }
    }

    /// Sets the carrier for measures (stock: `carrier`). Calls always use `tcp`.
    pub fn carrier(mut self, carrier: impl Into<String>) -> Self {
        self.carrier = carrier.into();
        self
    }

    /// Sets the maximum age of measures (stock: `timeout`, 10 ms there).
    pub fn max_state_age(mut self, age: Duration) -> Self {
        self.max_state_age = age;
        self
    }

    /// Sets the timeout of a reply and of each step of opening.
    pub fn rpc_timeout(mut self, timeout: Duration) -> Self {
        self.rpc_timeout = timeout;
        self
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
    /// Taken only on drop.
    link: Option<Link>,
    newest: Arc<Newest>,
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
        let network = network.with_timeout(options.rpc_timeout);
        let newest = Arc::new(Newest::new(options.max_state_age));
        let theirs = newest.clone();
        let opening = async move {
            let mut link = Link::open(&network, &options, theirs.clone()).await?;
            match link.greet(&network, &options, theirs).await {
                Ok(metadata) => Ok((link, metadata, options.remote)),
                Err(error) => {
                    link.close().await;
                    Err(error)
                }
            }
        };
        let (link, metadata, remote) = blocking::wait(opening)?;
        let sensors = metadata.as_ref().map(Metadata::count);
        tracing::info!(remote, ?sensors, "remote sensors connected");
        Ok(Self {
            link: Some(link),
            newest,
            metadata,
        })
    }
}

impl Drop for RemoteAnalogSensors {
    fn drop(&mut self) {
        if let Some(link) = self.link.take() {
            blocking::wait(link.close());
        }
    }
}

impl AnalogSensors for RemoteAnalogSensors {
    fn sensors(&self, kind: SensorKind) -> Vec<SensorInfo> {
        match &self.metadata {
            Some(metadata) => metadata.0[kind.index()].clone(),
            None => {
                let newest = self.newest.lock();
                let count = newest.measures.readings[kind.index()].len();
                vec![SensorInfo::default(); count]
            }
        }
    }

    fn read_sensors(&self, kind: SensorKind, readings: &mut Vec<SensorReading>) {
        let newest = self.newest.lock();
        let read = &newest.measures.readings[kind.index()];
        let count = match &self.metadata {
            Some(metadata) => metadata.0[kind.index()].len(),
            None => read.len(),
        };
        readings.resize_with(count, SensorReading::default);
        let status = newest.status(self.newest.max_age);
        for (index, reading) in readings.iter_mut().enumerate() {
            match (status, read.get(index)) {
                (SensorStatus::Ok, Some(read)) => reading.clone_from(read),
                (SensorStatus::Ok, None) => reading.fail(SensorStatus::Error),
                (status, _) => {
                    reading
                        .values
                        .resize(kind.size().unwrap_or_default(), f64::NAN);
                    reading.fail(status);
                }
            }
        }
    }
}

impl Device for RemoteAnalogSensors {
    yarp_devices::offers! { analog_sensors: AnalogSensors }
}

/// The newest message of the stream.
#[derive(Debug)]
struct Newest {
    state: Mutex<NewestState>,
    max_age: Duration,
    begun: Instant,
}

#[derive(Debug, Default)]
struct NewestState {
    measures: Measures,
    arrived: Option<Instant>,
}

impl NewestState {
    fn status(&self, max_age: Duration) -> SensorStatus {
        match self.arrived {
            None => SensorStatus::WaitingForFirstRead,
            Some(arrived) if arrived.elapsed() > max_age => SensorStatus::Timeout,
            Some(_) => SensorStatus::Ok,
        }
    }
}

impl Newest {
    fn new(max_age: Duration) -> Self {
        Self {
            state: Mutex::default(),
            max_age,
            begun: Instant::now(),
        }
    }

    fn lock(&self) -> MutexGuard<'_, NewestState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes in a message of the stream.
    fn take(&self, received: &Received) {
        match received.read::<Measures>() {
            Ok(measures) => {
                let mut state = self.lock();
                state.measures = measures;
                state.arrived = Some(Instant::now());
            }
            Err(error) => {
                tracing::warn!(from = %received.from, "not measures of sensors: {error}");
            }
        }
    }

    /// Returns whether no message has been received for so long.
    fn is_older_than(&self, age: Duration) -> bool {
        self.lock().arrived.unwrap_or(self.begun).elapsed() > age
    }
}

/// The two ports.
#[derive(Debug)]
struct Link {
    ports: [Port; 2],
    rpc_peer: String,
    rpc_timeout: Duration,
    /// The connection for calls, made again whenever it is lost.
    kept: Option<ReconnectingConnection>,
    /// Asks the server for its measures again; ends with the link.
    asking: JoinSet<()>,
}

impl Link {
    async fn open(
        network: &Network,
        options: &RemoteAnalogSensorsOptions,
        newest: Arc<Newest>,
    ) -> Result<Self, OpenError> {
        let rpc_peer = format!("{}/rpc:o", options.remote);
        if !options.external_connection {
            // Before anything of our own is opened: usually the server is just not running.
            check_exists(network, rpc_peer.clone()).await?;
            check_exists(network, format!("{}/measures:o", options.remote)).await?;
        }
        let take = move |received: &mut Received| {
            newest.take(received);
            Answer::Nothing
        };
        // A server of both wire versions sends twelve lists once, and not ten behind them.
        let measures = PortOptions::new()
            .handler(take)
            .input_only()
            .wire_version(WireVersion::V4);
        let wanted = [
            ("measures:i", measures),
            ("rpc:i", PortOptions::new().rpc_client()),
        ];
        Ok(Self {
            ports: open_all(network, &options.local, wanted).await?,
            rpc_peer,
            rpc_timeout: options.rpc_timeout,
            kept: None,
            asking: JoinSet::new(),
        })
    }

    /// Connects the ports in the order of stock, and asks for the names.
    async fn greet(
        &mut self,
        network: &Network,
        options: &RemoteAnalogSensorsOptions,
        newest: Arc<Newest>,
    ) -> Result<Option<Metadata>, OpenError> {
        if options.external_connection {
            return Ok(None);
        }
        let [measures, rpc] = &self.ports;
        let kept = connect_supervised(rpc, &self.rpc_peer, RPC_CARRIER, self.rpc_timeout);
        self.kept = Some(kept.await?);
        let silence = options.max_state_age.max(2 * WATCH_INTERVAL);
        let are_missing = move || newest.is_older_than(silence);
        let from = format!("{}/measures:o", options.remote);
        subscribe(
            network,
            (&from, measures.name()),
            &options.carrier,
            &mut self.asking,
            are_missing,
        )
        .await?;
        let metadata = self.metadata().await;
        metadata.map(Some).map_err(|source| OpenError::Query {
            question: "the names of its sensors",
            source,
        })
    }

    async fn metadata(&self) -> Result<Metadata, DeviceError> {
        let [_, rpc] = &self.ports;
        let call = metadata_call();
        let calling = rpc.call_within::<Bottle>(&call, self.rpc_timeout);
        let failed = |advice: &str, source: Option<PortError>| DeviceError::Remote {
            peer: self.rpc_peer.clone(),
            step: "`getMetadata`".to_owned(),
            advice: advice.to_owned(),
            source: source.map(Into::into),
        };
        let answer = calling
            .await
            .map_err(|error| failed("`yarp ping` of it", Some(error)))?;
        Metadata::read(&answer)
            .ok_or_else(|| failed("whether it is a multipleanalogsensorsserver", None))
    }

    /// Closes the ports; takes a few seconds at the most.
    async fn close(mut self) {
        self.asking.shutdown().await;
        drop(self.kept.take());
        let closing = close_all(self.ports);
        if tokio::time::timeout(PORT_CLOSE_TIMEOUT, closing)
            .await
            .is_err()
        {
            tracing::warn!(remote = %self.rpc_peer, "closing took too long; names may be left behind");
        }
    }
}
