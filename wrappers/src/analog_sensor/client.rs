//! A sensor of several channels at the other end.
//!
//! ```text
//! values   LOCAL       <- REMOTE
//! calls    LOCAL/rpc:o -> REMOTE/rpc:i
//! ```

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tokio::task::JoinSet;
use yarp_devices::clock::wall_clock;
use yarp_devices::{AnalogSensor, Device, DeviceError, SensorReading, SensorStatus};
use yarp_ports::{Answer, Network, Port, PortOptions, Received, ReconnectingConnection, blocking};
use yarp_wire::Bottle;

use super::requests;
use crate::OpenError;
use crate::open_ports::{close_all, open};
use crate::reconnect::{
    PORT_CLOSE_TIMEOUT, RPC_CARRIER, WATCH_INTERVAL, check_exists, connect_supervised, subscribe,
};

/// Options of a remote sensor.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct RemoteAnalogSensorOptions {
    remote: String,
    local: String,
    carrier: String,
    max_state_age: Duration,
    rpc_timeout: Duration,
}

impl RemoteAnalogSensorOptions {
    /// The sensor on the port `remote`, by ports named after `local`.
    ///
    /// Values travel over `udp`, as in stock, and are trusted for 100 ms; an answer is waited for 2 s.
    pub fn new(remote: impl Into<String>, local: impl Into<String>) -> Self {
        Self {
            remote: remote.into(),
            local: local.into(),
            carrier: "udp".to_owned(),
            max_state_age: Duration::from_millis(100),
            rpc_timeout: Duration::from_secs(2),
        }
    }

    /// Sets the carrier for values (stock: `carrier`).
    pub fn carrier(mut self, carrier: impl Into<String>) -> Self {
        self.carrier = carrier.into();
        self
    }

    /// Sets the maximum age of values.
    pub fn max_state_age(mut self, age: Duration) -> Self {
        self.max_state_age = age;
        self
    }

    /// Sets the timeout of a reply and of each step of opening.
    pub fn rpc_timeout(mut self, timeout: Duration) -> Self {
        self.rpc_timeout = timeout;
        self
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
    /// Taken only on drop.
    link: Option<Arc<Link>>,
    newest: Arc<Newest>,
}

impl RemoteAnalogSensor {
    /// Opens two ports of its own and connects them to the server; does not wait for the first values.
    ///
    /// * Ports: `LOCAL` and `LOCAL/rpc:o`.
    /// * Errors: [`OpenError::NoRemote`], [`OpenError::NameTaken`], [`OpenError::Port`], [`OpenError::Connect`]; then
    ///   nothing stays open.
    pub fn open(network: &Network, options: RemoteAnalogSensorOptions) -> Result<Self, OpenError> {
        let network = network.with_timeout(options.rpc_timeout);
        let newest = Arc::new(Newest {
            state: Mutex::default(),
            max_age: options.max_state_age,
            begun: Instant::now(),
        });
        let theirs = newest.clone();
        let link = blocking::wait(async move { Link::open(&network, options, theirs).await })?;
        Ok(Self {
            link: Some(Arc::new(link)),
            newest,
        })
    }
}

impl Drop for RemoteAnalogSensor {
    fn drop(&mut self) {
        if let Some(link) = self.link.take().and_then(Arc::into_inner) {
            blocking::wait(link.close());
        }
    }
}

impl AnalogSensor for RemoteAnalogSensor {
    fn channels(&self) -> usize {
        self.newest.lock().0.values.len()
    }

    fn read_channels(&self, reading: &mut SensorReading) {
        let newest = self.newest.lock();
        reading.clone_from(&newest.0);
        reading.status = match newest.1 {
            None => SensorStatus::WaitingForFirstRead,
            Some(arrived) if arrived.elapsed() > self.newest.max_age => SensorStatus::Timeout,
            Some(_) => SensorStatus::Ok,
        };
    }

    fn calibrate(&self, channel: Option<usize>) -> Result<(), DeviceError> {
        let link = self.link.as_ref().expect("taken only on drop").clone();
        blocking::wait(async move {
            let calibrated = link.calibrate(channel).await;
            // Before anybody learns of it, so that dropping the sensor finds itself alone.
            drop(link);
            calibrated
        })
    }
}

impl Device for RemoteAnalogSensor {
    yarp_devices::offers! { analog_sensor: AnalogSensor }
}

/// The newest message, and when it arrived.
#[derive(Debug)]
struct Newest {
    state: Mutex<(SensorReading, Option<Instant>)>,
    max_age: Duration,
    begun: Instant,
}

impl Newest {
    fn lock(&self) -> MutexGuard<'_, (SensorReading, Option<Instant>)> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes in a message of the stream: a bottle of numbers.
    fn take(&self, received: &Received) {
        let message = received.bottle().unwrap_or_default();
        let values: Option<Vec<f64>> = message.iter().map(yarp_wire::Value::as_f64).collect();
        let Some(values) = values else {
            tracing::warn!(from = %received.from, "not the channels of a sensor");
            return;
        };
        let time = received.stamp().map_or_else(wall_clock, |stamp| stamp.time);
        let mut state = self.lock();
        state.0.set(&values, time);
        state.1 = Some(Instant::now());
    }
}

#[derive(Debug)]
struct Link {
    stream: Port,
    rpc: Port,
    rpc_peer: String,
    rpc_timeout: Duration,
    /// The connection for calls, made again whenever it is lost.
    kept: Option<ReconnectingConnection>,
    /// Asks the server for its values again; ends with the link.
    asking: JoinSet<()>,
}

impl Link {
    async fn open(
        network: &Network,
        options: RemoteAnalogSensorOptions,
        newest: Arc<Newest>,
    ) -> Result<Self, OpenError> {
        let RemoteAnalogSensorOptions { remote, local, .. } = &options;
        let rpc_peer = format!("{remote}/rpc:i");
        check_exists(network, remote.clone()).await?;
        check_exists(network, rpc_peer.clone()).await?;
        let theirs = newest.clone();
        let take = move |received: &mut Received| {
            theirs.take(received);
            Answer::Nothing
        };
        let reading = PortOptions::new().handler(take).input_only();
        let stream = open(network, local.clone(), reading).await?;
        let calling = PortOptions::new().rpc_client();
        let rpc = match open(network, format!("{local}/rpc:o"), calling).await {
            Ok(rpc) => rpc,
            Err(error) => {
                close_all([stream]).await;
                return Err(error);
            }
        };
        let mut link = Self {
            stream,
            rpc,
            rpc_peer,
            rpc_timeout: options.rpc_timeout,
            kept: None,
            asking: JoinSet::new(),
        };
        match link.connect(network, &options, newest).await {
            Ok(()) => Ok(link),
            Err(error) => {
                link.close().await;
                Err(error)
            }
        }
    }

    /// Connects the ports in the order of stock.
    async fn connect(
        &mut self,
        network: &Network,
        options: &RemoteAnalogSensorOptions,
        newest: Arc<Newest>,
    ) -> Result<(), OpenError> {
        let silence = options.max_state_age.max(2 * WATCH_INTERVAL);
        let are_missing = move || {
            let arrived = newest.lock().1.unwrap_or(newest.begun);
            arrived.elapsed() > silence
        };
        let ends = (options.remote.as_str(), self.stream.name());
        subscribe(
            network,
            ends,
            &options.carrier,
            &mut self.asking,
            are_missing,
        )
        .await?;
        let kept = connect_supervised(&self.rpc, &self.rpc_peer, RPC_CARRIER, self.rpc_timeout);
        self.kept = Some(kept.await?);
        Ok(())
    }

    async fn calibrate(&self, channel: Option<usize>) -> Result<(), DeviceError> {
        let request = requests::calibration(channel);
        let asked = self.rpc.call_within::<Bottle>(&request, self.rpc_timeout);
        let peer = self.rpc_peer.clone();
        match asked.await {
            Ok(answer) if requests::is_done(&answer) => Ok(()),
            Ok(_) => Err(DeviceError::Refused {
                peer,
                step: format!("`{request}`"),
                advice: "the log of the server".to_owned(),
            }),
            Err(error) => Err(DeviceError::Remote {
                advice: format!(
                    "`yarp ping {peer}`; when the sensor is back, it is connected again"
                ),
                peer,
                step: format!("`{request}`"),
                source: Some(Box::new(error)),
            }),
        }
    }

    /// Closes the ports; takes a few seconds at the most.
    async fn close(mut self) {
        self.asking.shutdown().await;
        drop(self.kept.take());
        let closing = close_all([self.stream, self.rpc]);
        if tokio::time::timeout(PORT_CLOSE_TIMEOUT, closing)
            .await
            .is_err()
        {
            tracing::warn!(remote = %self.rpc_peer, "closing took too long; names may be left behind");
        }
    }
}
