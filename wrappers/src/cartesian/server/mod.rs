//! A controller on ports.
//!
//! | file | content |
//! | --- | --- |
//! | `cartesian_request_handler` | executes requests on the controller |
//! | `pose_publisher` | its pose and events, every period |

mod cartesian_request_handler;
mod pose_publisher;

use std::sync::Arc;
use std::time::Duration;

use tokio::sync::mpsc::{UnboundedReceiver, unbounded_channel};
use tokio::task::JoinHandle;
use yarp_devices::clock;
use yarp_devices::{CartesianEvent, Device};
use yarp_ports::{Answer, Network, Port, PortOptions, Received};
use yarp_wire::Stamp;

use self::cartesian_request_handler::RequestHandler;
use super::CartesianVersion;
use super::messages::to_event;
use crate::OpenError;
use crate::device_ports::{PortWork, ServedPort, ServedPorts};
use crate::open_ports::request_port;
use crate::page_request::request_of;
use crate::periodic_thread::{PeriodicThread, check_period};
use crate::reconnect::PORT_CLOSE_TIMEOUT;

/// Stock's default.
const DEFAULT_PERIOD: Duration = Duration::from_millis(10);

/// Options of a Cartesian server.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct CartesianServerOptions {
    period: Duration,
    version: CartesianVersion,
}

impl Default for CartesianServerOptions {
    fn default() -> Self {
        Self {
            period: DEFAULT_PERIOD,
            version: CartesianVersion::default(),
        }
    }
}

impl CartesianServerOptions {
    /// The pose every 10 ms, for clients of icub-main from 2.0 on.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets the interval between poses, 1 ms to 60 s.
    pub fn period(mut self, period: Duration) -> Self {
        self.period = period;
        self
    }

    /// Sets the protocol version of the clients.
    pub fn version(mut self, version: CartesianVersion) -> Self {
        self.version = version;
        self
    }
}

/// A controller of a tool, served as iCub's `cartesiancontrollerserver` serves one.
///
/// * `NAME/rpc:i` answers queries and executes commands.
/// * `NAME/command:i` accepts targets and velocities; a refusal is not reported.
/// * `NAME/state:o` sends `x y z ax ay az theta` every period, in metres and radians, stamped with the time of the
///   encoders.
/// * `NAME/events:o` notifies every reader when a motion begins, has covered a part of its way, ends, and when the
///   server closes.
///
/// Malformed requests, and those that the controller refuses, are answered `[nack]`; the log has the reason.
///
/// Dropping it closes the ports in the background.
#[derive(Debug)]
pub struct CartesianServer {
    ports: ServedPorts<Publishing>,
}

#[derive(Debug)]
struct Publishing {
    publisher: PeriodicThread,
    /// Ends when the publisher does; gives its last word.
    writer: JoinHandle<()>,
}

impl CartesianServer {
    /// Opens the four ports and begins to publish.
    ///
    /// * `name`: begins with `/`.
    /// * Errors: [`OpenError::NoInterface`] when the device controls no tool, [`OpenError::Period`],
    ///   [`OpenError::NameTaken`], [`OpenError::Port`], [`OpenError::Query`], [`OpenError::Thread`]; then all that was
    ///   opened is closed again.
    pub async fn open(
        network: &Network,
        device: Arc<dyn Device>,
        name: &str,
        options: CartesianServerOptions,
    ) -> Result<Self, OpenError> {
        let CartesianServerOptions { period, version } = options;
        check_period(period)?;
        if device.cartesian_control().is_none() {
            return Err(OpenError::NoInterface("tool to be moved in space"));
        }
        let handler = Arc::new(RequestHandler::new(device, name, version));
        let question = "what happens on its way";
        let events = handler.controller().and_then(|arm| arm.events());
        let events = events.map_err(|source| OpenError::Query { question, source })?;
        let wanted = vec![
            ServedPort::output("state:o", PortOptions::new().type_name("yarp/vector")),
            ServedPort::output("events:o", PortOptions::new()),
            ServedPort::input("command:i", obeying(&handler)),
            ServedPort::input("rpc:i", answering(&handler)),
        ];
        let start = |outputs: &[Arc<Port>]| {
            let (sender, receiver) = unbounded_channel();
            Ok(Publishing {
                publisher: pose_publisher::start(
                    handler,
                    outputs[0].clone(),
                    events,
                    sender,
                    period,
                )?,
                writer: tokio::spawn(write_events(outputs[1].clone(), receiver)),
            })
        };
        let ports = ServedPorts::open(network, name, wanted, start).await?;
        tracing::info!(name, ?period, "controller of a tool served");
        // New requests are rejected, then pending events are sent.
        Ok(Self {
            ports: ports.inputs_close_first(),
        })
    }

    /// Returns the prefix of the ports' names.
    pub fn name(&self) -> &str {
        self.ports.name()
    }

    /// Says that it closes, closes the ports and unregisters their names.
    ///
    /// Takes a few seconds at most, even if peers do not answer. The controller continues.
    pub async fn close(self) {
        self.ports.close().await;
    }
}

impl PortWork for Publishing {
    async fn end(self) {
        PortWork::end(self.publisher).await;
        let mut writer = self.writer;
        if tokio::time::timeout(PORT_CLOSE_TIMEOUT, &mut writer)
            .await
            .is_err()
        {
            writer.abort();
            let _ = writer.await;
        }
    }
}

/// Writes events to every reader, and at the end that there will be no more.
async fn write_events(port: Arc<Port>, mut events: UnboundedReceiver<CartesianEvent>) {
    let mut stamp = Stamp::new(-1, 0.0);
    let mut closed = false;
    while !closed {
        let event = events
            .recv()
            .await
            .unwrap_or_else(|| CartesianEvent::Closing { time: clock::now() });
        closed = matches!(event, CartesianEvent::Closing { .. });
        let (CartesianEvent::Onset { time }
        | CartesianEvent::Ongoing { time, .. }
        | CartesianEvent::Done { time }
        | CartesianEvent::Closing { time }) = event;
        stamp = stamp.next(time);
        port.write_strict(&to_event(&event), Some(stamp.into()))
            .await;
    }
    port.flush().await;
}

fn obeying(handler: &Arc<RequestHandler>) -> PortOptions {
    let handler = handler.clone();
    let take = move |received: &mut Received| {
        let message = request_of(received);
        handler.obey(&message, &received.from);
        Answer::Nothing
    };
    request_port().handler(take).input_only()
}

fn answering(handler: &Arc<RequestHandler>) -> PortOptions {
    let handler = handler.clone();
    let answer = move |received: &mut Received| {
        let request = request_of(received);
        Answer::reply(handler.answer(&request, &received.from))
    };
    request_port().handler(answer).input_only()
}
