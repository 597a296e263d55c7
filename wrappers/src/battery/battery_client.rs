//! The battery at the other end.

use std::sync::Arc;
use std::time::Duration;

use yarp_devices::clock;
use yarp_devices::{Battery, BatteryReading, Device, DeviceError};
use yarp_ports::{Network, PortOptions, Received, blocking};
use yarp_wire::{Bottle, Vocab32};

use super::{BATTERY, BatteryLayout, GET_INFO, INFO, IS};
use crate::OpenError;
use crate::device_ports::{
    LatestValue, Link, RemoteOptions, RemotePorts, RpcPort, SharedLink, stream_port,
};
use crate::thrift::{Message, ReturnCode};

const RPC: RpcPort = RpcPort::USUAL;

/// A battery that another program serves, as stock's `batteryClient` (3.5) and `battery_nwc_yarp` cast it back.
///
/// Readings are those that the server streams; asking for one waits for nothing. Dropping it closes its ports; that
/// takes a few seconds at most.
#[derive(Debug)]
pub struct RemoteBattery {
    ports: SharedLink<RemotePorts>,
    layout: BatteryLayout,
    latest: Arc<LatestValue<BatteryReading>>,
}

impl RemoteBattery {
    /// Opens `LOCAL/data:i` and `LOCAL/rpc:o` and connects them to the server. Does not wait for the first reading.
    ///
    /// Blocks for a few deadlines at the most. Errors: [`OpenError::NoRemote`], [`OpenError::NameTaken`],
    /// [`OpenError::Port`], [`OpenError::Connect`]; then nothing stays open.
    pub fn open(
        network: &Network,
        options: RemoteOptions,
        layout: BatteryLayout,
    ) -> Result<Self, OpenError> {
        let latest = Arc::new(LatestValue::new(
            "reading of the battery",
            options.max_state_age,
        ));
        let stored = latest.clone();
        let take = move |received: &Received| {
            let time = received.stamp().map_or_else(clock::now, |stamp| stamp.time);
            let message = received.bottle().ok();
            match message.and_then(|message| layout.read(&message, time)) {
                Some(reading) => stored.store(reading),
                None => tracing::warn!(from = %received.from, "not a message of this device"),
            }
        };
        let (network, newest) = (network.with_timeout(options.rpc_timeout), latest.clone());
        let opening = async move { connect(&network, &options, newest, stream_port(take)).await };
        let ports = SharedLink::new(blocking::wait(opening)?);
        tracing::info!(remote = ports.remote(), "remote battery connected");
        Ok(Self {
            ports,
            layout,
            latest,
        })
    }

    /// Returns the name of the server, as it was given.
    pub fn remote(&self) -> &str {
        self.ports.remote()
    }
}

/// Opens `LOCAL/data:i` and `LOCAL/rpc:o` and connects them.
async fn connect(
    network: &Network,
    options: &RemoteOptions,
    latest: Arc<LatestValue<BatteryReading>>,
    stream: PortOptions,
) -> Result<RemotePorts, OpenError> {
    options.check_remote(network, &["data:o", "rpc:i"]).await?;
    let wanted = vec![
        ("data:i", stream),
        ("rpc:o", PortOptions::new().rpc_client()),
    ];
    let mut ports = RemotePorts::open(network, options, "server", RPC, wanted).await?;
    let connected = async {
        ports.connect_rpc().await?;
        ports.subscribe("data:o", 0, &latest, Duration::ZERO).await
    }
    .await;
    ports
        .unless_failed(connected)
        .await
        .map(|(ports, ())| ports)
}

impl Battery for RemoteBattery {
    fn battery_reading(&self) -> Result<BatteryReading, DeviceError> {
        self.latest.read(|reading| *reading)
    }

    fn battery_info(&self) -> Result<String, DeviceError> {
        let info = match self.layout {
            BatteryLayout::Wrapper => {
                let request = Bottle::of(BATTERY).with(INFO);
                self.ports.call(request, |reply| match reply.as_slice() {
                    [is, info, text, ..]
                        if (is.as_vocab(), info.as_vocab()) == (Some(IS), Some(INFO)) =>
                    {
                        Some(Some(text.to_plain_string()))
                    }
                    [fail, ..] if fail.as_vocab() == Some(Vocab32::FAIL) => Some(None),
                    _ => None,
                })?
            }
            BatteryLayout::Nws => {
                let request = Message::call(GET_INFO, []);
                self.ports
                    .call(request, |reply| match ReturnCode::read(reply)? {
                        (ReturnCode::Ok, values) => Some(Some(values.first()?.to_plain_string())),
                        _ => Some(None),
                    })?
            }
        };
        info.ok_or_else(|| DeviceError::Refused {
            peer: format!("{}/rpc:i", self.remote()),
            step: "asking for the description of the battery".to_owned(),
            advice: "the log of the server".to_owned(),
        })
    }
}

impl Device for RemoteBattery {
    yarp_devices::offers! { battery: Battery }
}
