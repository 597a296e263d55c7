//! Sensors on ports.

use std::io;
use std::sync::Arc;
use std::time::Duration;

use yarp_devices::clock;
use yarp_devices::{AnalogSensors, Device, SensorKind, SensorStatus};
use yarp_ports::{Answer, Network, Port, PortOptions, Reader, Received};
use yarp_wire::{Bottle, Stamp, Value, Vocab32, WireVersion};

use super::measures_message::{MeasureLists, Measures};
use super::metadata_message::{GET_METADATA, Metadata};
use crate::OpenError;
use crate::device_ports::{ServedPort, ServedPorts};
use crate::open_ports::request_port;
use crate::page_request::request_of;
use crate::periodic_thread::{PeriodicThread, check_period};
use crate::thrift::{GET_VERSION, ServiceVersion};

/// Default interval between messages: 50 Hz, as stock.
const DEFAULT_PERIOD: Duration = Duration::from_millis(20);
/// Maximum backlog of a reader that still gets the next measures.
const MAX_BACKLOG: Duration = Duration::from_millis(20);
/// End of the names of the ports with which stock's clients read measures.
const CLIENT_SUFFIX: &str = "/measures:i";
/// Stock's help.
const HELP: [&str; 3] = ["*** Available commands:", "getMetadata", "help"];

/// Layouts of the measures for readers of YARP 3.x, which do not tell which one they read; readers of 4.0 always get
/// twelve lists.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub enum MeasuresLayout {
    /// Twelve lists for every reader, and behind each the same in ten lists for those of 3.x that are named as a stock
    /// client (`.../measures:i`): a client reads the layout of its own version and skips the other.
    #[default]
    Either,
    /// Ten lists, for clients up to 3.10.
    Ten,
    /// Twelve lists, for clients from 3.11 on.
    Twelve,
}

/// Options of a server of sensors.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct AnalogSensorsOptions {
    period: Duration,
    layout: MeasuresLayout,
}

impl Default for AnalogSensorsOptions {
    fn default() -> Self {
        Self {
            period: DEFAULT_PERIOD,
            layout: MeasuresLayout::default(),
        }
    }
}

impl AnalogSensorsOptions {
    /// Measures every 20 ms.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets the interval between messages, 1 ms to 60 s.
    pub fn period(mut self, period: Duration) -> Self {
        self.period = period;
        self
    }

    /// Sets the layout for readers of YARP 3.x.
    pub fn layout(mut self, layout: MeasuresLayout) -> Self {
        self.layout = layout;
        self
    }
}

/// Sensors of several kinds, served like stock's `multipleanalogsensorsserver`, to clients of 3.x and of 4.0 at once.
///
/// * `NAME/measures:o` sends the measures of all sensors every period, to each reader that is not more than 20 ms
///   behind. Each measure has the time at which the device took it; the envelope has the time of sending.
/// * While a sensor is in another state than [`SensorStatus::Ok`] nothing is sent, as in stock; the log names the first
///   such sensor, once.
/// * `NAME/rpc:o` answers `getMetadata` with names and frames.
///
/// ```no_run
/// # async fn example() -> Result<(), Box<dyn std::error::Error>> {
/// use std::sync::Arc;
/// use yarp_devices::sensors::{SimulatedSensors, SimulatedSensorsOptions};
/// use yarp_devices::wam::SimulatedWam;
/// use yarp_ports::Network;
/// use yarp_wrappers::{AnalogSensorsOptions, AnalogSensorsServer};
///
/// let network = Network::from_process()?;
/// let arm = Arc::new(SimulatedWam::new());
/// let sensors = Arc::new(SimulatedSensors::new(arm, SimulatedSensorsOptions::new())?);
/// let server =
///     AnalogSensorsServer::open(&network, sensors, "/wam/sensors", AnalogSensorsOptions::new()).await?;
/// tokio::signal::ctrl_c().await?;
/// server.close().await;
/// # Ok(()) }
/// ```
///
/// Dropping it closes the ports in the background.
///
/// Source: `MultipleAnalogSensorsServer.cpp` of YARP 3.5 and 4.0; live clients and servers of 3.5.0.
#[derive(Debug)]
pub struct AnalogSensorsServer {
    ports: ServedPorts,
}

impl AnalogSensorsServer {
    /// Opens the two ports and begins to publish.
    ///
    /// * `name`: begins with `/`; the ports are `NAME/measures:o` and `NAME/rpc:o`.
    /// * Errors: [`OpenError::NoInterface`] when the device has no sensors, [`OpenError::Period`],
    ///   [`OpenError::NameTaken`], [`OpenError::Port`], [`OpenError::Thread`]; then all that was opened is closed
    ///   again.
    ///
    /// Cancelling closes the ports in the background.
    pub async fn open(
        network: &Network,
        device: Arc<dyn Device>,
        name: &str,
        options: AnalogSensorsOptions,
    ) -> Result<Self, OpenError> {
        check_period(options.period)?;
        let sensors = device.analog_sensors();
        let metadata = Metadata::of(sensors.ok_or(OpenError::NoInterface("sensors"))?);
        let count = metadata.count();
        let wanted = [
            ServedPort::output("measures:o", PortOptions::new()),
            ServedPort::input("rpc:o", answering(Arc::new(metadata))),
        ];
        let wanted = wanted.into();
        let start = |outputs: &[Arc<Port>]| start(device, name, outputs[0].clone(), &options);
        let ports = ServedPorts::open(network, name, wanted, start).await?;
        let period = options.period;
        tracing::info!(name, sensors = count, ?period, "sensors served");
        Ok(Self { ports })
    }

    /// The name that the two ports have in common.
    pub fn name(&self) -> &str {
        self.ports.name()
    }

    /// Ends publishing, closes the two ports and unregisters their names.
    ///
    /// Takes a few seconds at most, even if peers do not answer. The device continues.
    pub async fn close(self) {
        self.ports.close().await;
    }
}

/// Answers calls of the service.
fn answering(metadata: Arc<Metadata>) -> PortOptions {
    request_port()
        .handler(move |received: &mut Received| {
            let call = request_of(received);
            let word = call.get(0).map(Value::to_plain_string).unwrap_or_default();
            match word.as_str() {
                GET_METADATA => Answer::reply(metadata.to_answer()),
                GET_VERSION => Answer::reply(ServiceVersion::SERVED),
                "help" => Answer::reply(help()),
                _ => Answer::reply(Bottle::of(Vocab32::FAIL)),
            }
        })
        .input_only()
}

fn help() -> Bottle {
    let lines: Bottle = HELP.map(Value::from).into_iter().collect();
    Bottle::from_iter([Vocab32::MANY.into(), lines.into()])
}

/// Starts publishing.
fn start(
    device: Arc<dyn Device>,
    name: &str,
    port: Arc<Port>,
    options: &AnalogSensorsOptions,
) -> io::Result<PeriodicThread> {
    let mut cycle = Cycle {
        name: name.to_owned(),
        device,
        port,
        layout: options.layout,
        measures: Measures::default(),
        stamp: Stamp::new(-1, 0.0),
        backlog: backlog(options.period),
        failing: false,
    };
    PeriodicThread::start("analog-sensors", options.period, move || cycle.publish())
}

/// Maximum number of messages in a reader's queue; at least 1.
fn backlog(period: Duration) -> usize {
    let periods = MAX_BACKLOG.as_secs_f64() / period.as_secs_f64();
    (periods as usize).max(1)
}

/// One reading of all sensors after the other, in buffers that stay.
struct Cycle {
    name: String,
    device: Arc<dyn Device>,
    port: Arc<Port>,
    layout: MeasuresLayout,
    measures: Measures,
    stamp: Stamp,
    backlog: usize,
    /// True while a sensor fails.
    failing: bool,
}

impl Cycle {
    fn publish(&mut self) {
        let Some(sensors) = self.device.analog_sensors() else {
            return;
        };
        for (kind, readings) in SensorKind::ALL.into_iter().zip(&mut self.measures.readings) {
            sensors.read_sensors(kind, readings);
        }
        if let Some((kind, index, status)) = self.failed() {
            if !std::mem::replace(&mut self.failing, true) {
                self.warn(sensors, kind, index, status);
            }
            return;
        }
        if std::mem::take(&mut self.failing) {
            tracing::info!("{}: all sensors work again", self.name);
        }
        self.stamp = self.stamp.next(clock::now());
        let layout = self.layout;
        let gets_both = |reader: &Reader<'_>| {
            layout == MeasuresLayout::Either
                && reader.wire_version == WireVersion::V3
                && reader.name.ends_with(CLIENT_SUFFIX)
        };
        let gets_ten = |reader: &Reader<'_>| {
            layout == MeasuresLayout::Ten && reader.wire_version == WireVersion::V3
        };
        let mut write = |lists, skippable, backlog, to: &dyn Fn(&Reader<'_>) -> bool| {
            (self.measures.lists, self.measures.skippable) = (lists, skippable);
            let envelope = Some(self.stamp.into());
            self.port
                .try_write_to(&self.measures, envelope, backlog, to);
        };
        let backlog = self.backlog;
        write(MeasureLists::Twelve, false, backlog, &|reader| {
            !gets_both(reader) && !gets_ten(reader)
        });
        write(MeasureLists::Twelve, true, backlog, &gets_both);
        // The message just sent to the same reader does not count.
        write(MeasureLists::Ten, true, backlog + 1, &gets_both);
        write(MeasureLists::Ten, false, backlog, &gets_ten);
    }

    /// Returns the first sensor whose values are not valid.
    fn failed(&self) -> Option<(SensorKind, usize, SensorStatus)> {
        let mut kinds = SensorKind::ALL.into_iter().zip(&self.measures.readings);
        kinds.find_map(|(kind, readings)| {
            let index = readings
                .iter()
                .position(|reading| reading.status != SensorStatus::Ok)?;
            Some((kind, index, readings[index].status))
        })
    }

    fn warn(
        &self,
        sensors: &dyn AnalogSensors,
        kind: SensorKind,
        index: usize,
        status: SensorStatus,
    ) {
        let infos = sensors.sensors(kind);
        let sensor = infos.get(index).map_or("?", |info| info.name.as_str());
        tracing::warn!(
            "{}: sensor {sensor} of {} is in state {status:?}; no measures are sent until all sensors work",
            self.name,
            kind.stock_name()
        );
    }
}
