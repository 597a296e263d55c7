//! Batteries.
//!
//! ```text
//! NAME/rpc:i    [ibat] [btnf]       -> [is] [btnf] "info", or [fail]     3.5
//!               getBatteryInfoRPC   -> (code) "info"                     from 3.12 on
//! NAME/data:o   voltage current charge temperature status                3.5
//!               charge voltage current temperature status                from 3.12 on
//! ```
//!
//! A server answers both requests; [`BatteryLayout`] chooses the order of the numbers, which no message tells.
//!
//! Source: `BatteryWrapper.cpp` and `BatteryClient.cpp` of 3.5.0, `Battery_nws_yarp.cpp`, `Battery_nwc_yarp.cpp` and
//! `BatteryData.thrift` of 3.12.3 and 4.0.0.

use std::sync::Arc;
use std::time::Duration;

use yarp_devices::clock::wall_clock;
use yarp_devices::{Battery, BatteryReading, BatteryStatus, Device, DeviceError};
use yarp_ports::{Answer, Network, Port, PortOptions, Received};
use yarp_wire::{Bottle, Stamp, Value, Vocab32};

use crate::OpenError;
use crate::device_ports::{
    LatestValue, Link, RemoteOptions, RemotePorts, RpcPort, ServedPort, ServedPorts, SharedLink,
    stream_port, wait,
};
use crate::open_ports::request_port;
use crate::periodic_thread::{PeriodicThread, check_period};
use crate::thrift::{GET_VERSION, Item, Message, ReturnCode, ServiceVersion};

const BATTERY: Vocab32 = Vocab32::new("ibat");
const INFO: Vocab32 = Vocab32::new("btnf");
const IS: Vocab32 = Vocab32::new("is");
const GET_INFO: &str = "getBatteryInfoRPC";
const RPC: RpcPort = RpcPort::USUAL;
/// Stock's default.
const DEFAULT_PERIOD: Duration = Duration::from_secs(1);

/// Order of the numbers of a battery on the wire, and the request of a client.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub enum BatteryLayout {
    /// That of `batteryWrapper` and `batteryClient` of 3.5.
    Wrapper,
    /// That of `battery_nws_yarp` and `battery_nwc_yarp`, from 3.12 on.
    #[default]
    Nws,
}

impl BatteryLayout {
    fn message(self, reading: &BatteryReading) -> Bottle {
        let BatteryReading {
            voltage,
            current,
            charge,
            temperature,
            ..
        } = *reading;
        let numbers = match self {
            Self::Wrapper => [voltage, current, charge, temperature],
            Self::Nws => [charge, voltage, current, temperature],
        };
        let status = Value::Int32(reading.status.into());
        numbers
            .map(Value::Float64)
            .into_iter()
            .chain([status])
            .collect()
    }

    fn read(self, message: &Bottle, time: f64) -> Option<BatteryReading> {
        let [first, second, third, fourth, status] = message.as_slice() else {
            return None;
        };
        let numbers = [first.as_f64()?, second.as_f64()?, third.as_f64()?];
        let [voltage, current, charge] = match (self, numbers) {
            (Self::Wrapper, numbers) => numbers,
            (Self::Nws, [charge, voltage, current]) => [voltage, current, charge],
        };
        Some(BatteryReading {
            voltage,
            current,
            charge,
            temperature: fourth.as_f64()?,
            status: BatteryStatus::from(status.as_i32()?),
            time,
        })
    }
}

/// Options of a [`BatteryServer`].
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct BatteryServerOptions {
    period: Duration,
    layout: BatteryLayout,
}

impl Default for BatteryServerOptions {
    fn default() -> Self {
        Self {
            period: DEFAULT_PERIOD,
            layout: BatteryLayout::default(),
        }
    }
}

impl BatteryServerOptions {
    /// A reading every second, in the layout of [`BatteryLayout::Nws`].
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets the interval between readings, 1 ms to 60 s.
    pub fn period(mut self, period: Duration) -> Self {
        self.period = period;
        self
    }

    /// Sets the order of the numbers.
    pub fn layout(mut self, layout: BatteryLayout) -> Self {
        self.layout = layout;
        self
    }
}

/// A battery, served as stock's `batteryWrapper` (3.5) and `battery_nws_yarp` do.
///
/// Dropping it closes the ports in the background.
#[derive(Debug)]
pub struct BatteryServer {
    ports: ServedPorts,
}

impl BatteryServer {
    /// Opens `NAME/data:o` and `NAME/rpc:i` and begins to publish.
    ///
    /// Errors: [`OpenError::NoInterface`], [`OpenError::Period`], [`OpenError::NameTaken`], [`OpenError::Port`],
    /// [`OpenError::Thread`]; then nothing stays open.
    pub async fn open(
        network: &Network,
        device: Arc<dyn Device>,
        name: &str,
        options: BatteryServerOptions,
    ) -> Result<Self, OpenError> {
        let BatteryServerOptions { period, layout } = options;
        check_period(period)?;
        if device.battery().is_none() {
            return Err(OpenError::NoInterface("battery"));
        }
        let wanted = vec![
            ServedPort::output("data:o", PortOptions::new()),
            ServedPort::input("rpc:i", answering(device.clone(), name)),
        ];
        let board = name.to_owned();
        let start =
            |outputs: &[Arc<Port>]| publish(device, board, outputs[0].clone(), layout, period);
        let ports = ServedPorts::open(network, name, wanted, start).await?;
        tracing::info!(name, ?period, ?layout, "battery served");
        Ok(Self {
            ports: ports.inputs_close_first(),
        })
    }

    /// Returns the prefix of the ports' names.
    pub fn name(&self) -> &str {
        self.ports.name()
    }

    /// Closes the ports and unregisters their names; takes a few seconds at most.
    pub async fn close(self) {
        self.ports.close().await;
    }
}

/// Publishes a reading every period; none while the battery cannot be read.
fn publish(
    device: Arc<dyn Device>,
    name: String,
    port: Arc<Port>,
    layout: BatteryLayout,
    period: Duration,
) -> std::io::Result<PeriodicThread> {
    // Stock counts from 0.
    let mut stamp = Stamp::new(-1, 0.0);
    let mut failing = false;
    PeriodicThread::start("battery-server", period, move || {
        match device.battery().map(Battery::battery_reading) {
            Some(Ok(reading)) => {
                stamp = stamp.next(reading.time);
                port.write_if_idle(&layout.message(&reading), Some(stamp.into()));
                failing = false;
            }
            Some(Err(error)) if !failing => {
                tracing::warn!(name, "the battery cannot be read: {error}");
                failing = true;
            }
            _ => {}
        }
    })
}

fn answering(device: Arc<dyn Device>, name: &str) -> PortOptions {
    let name = name.to_owned();
    let answer = move |received: &mut Received| {
        let request = received.bottle().unwrap_or_default();
        let info = || {
            let battery = device.battery();
            let info = battery.map(Battery::battery_info);
            info.and_then(|info| {
                info.inspect_err(|error| tracing::info!(name, "{request}: {error}"))
                    .ok()
            })
        };
        answer(&request, info)
    };
    request_port().handler(answer).input_only()
}

fn answer(request: &Bottle, info: impl FnOnce() -> Option<String>) -> Answer {
    let function = request.get(0).and_then(Value::as_str);
    match (function, request.as_slice()) {
        (Some(GET_VERSION), [_]) => Answer::reply(ServiceVersion::SERVED),
        (Some(GET_INFO), [_]) => Answer::reply(Message(match info() {
            Some(info) => ReturnCode::Ok.with([Item::Text(info)]),
            None => ReturnCode::Failed.with([Item::Text(String::new())]),
        })),
        (_, [first, second, ..])
            if (first.as_vocab(), second.as_vocab()) == (Some(BATTERY), Some(INFO)) =>
        {
            Answer::reply(match info() {
                Some(info) => Bottle::of(IS).with(INFO).with(info.as_str()),
                None => Bottle::of(Vocab32::FAIL),
            })
        }
        _ => Answer::reply(Bottle::of(Vocab32::FAIL)),
    }
}

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
            let time = received.stamp().map_or_else(wall_clock, |stamp| stamp.time);
            let message = received.bottle().ok();
            match message.and_then(|message| layout.read(&message, time)) {
                Some(reading) => stored.store(reading),
                None => tracing::warn!(from = %received.from, "not a message of this device"),
            }
        };
        let (network, newest) = (network.with_timeout(options.rpc_timeout), latest.clone());
        let opening = async move { connect(&network, &options, newest, stream_port(take)).await };
        let ports = SharedLink::new(wait(opening)?);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_numbers_have_the_order_of_stock() {
        let reading = BatteryReading {
            voltage: 24.5,
            current: -2.0,
            charge: 80.0,
            temperature: 30.0,
            status: BatteryStatus::Charging,
            time: 7.0,
        };
        let check = |layout: BatteryLayout, text: &str| {
            let message = layout.message(&reading);
            assert_eq!(message.to_string(), text);
            assert_eq!(layout.read(&message, 7.0), Some(reading));
        };
        check(BatteryLayout::Wrapper, "24.5 -2.0 80.0 30.0 1");
        check(BatteryLayout::Nws, "80.0 24.5 -2.0 30.0 1");
        for text in [
            "",
            "1.0 2.0 3.0 4.0",
            "1.0 2.0 3.0 4.0 5 6",
            "a 2.0 3.0 4.0 5",
        ] {
            let message = Bottle::parse(text).unwrap();
            assert_eq!(BatteryLayout::Nws.read(&message, 0.0), None, "{text}");
        }
    }
}
