//! A battery on two ports.

use std::sync::Arc;
use std::time::Duration;

use yarp_devices::{Battery, Device};
use yarp_ports::{Answer, Network, Port, PortOptions, Received};
use yarp_wire::{Bottle, Stamp, Value, Vocab32};

use super::{BATTERY, BatteryLayout, GET_INFO, INFO, IS};
use crate::OpenError;
use crate::device_ports::{ServedPort, ServedPorts};
use crate::open_ports::request_port;
use crate::periodic_thread::{PeriodicThread, check_period};
use crate::thrift::{GET_VERSION, Item, Message, ReturnCode, ServiceVersion};

/// Stock's default.
const DEFAULT_PERIOD: Duration = Duration::from_secs(1);

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
