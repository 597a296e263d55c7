//! A controller on ports.
//!
//! | file | content |
//! | --- | --- |
//! | `request_handler` | executes requests on the controller |
//! | `publisher` | its pose and events, every period |

mod publisher;
mod request_handler;

use std::sync::Arc;
use std::time::Duration;

use tokio::runtime::Handle;
use tokio::sync::mpsc::{UnboundedReceiver, unbounded_channel};
use tokio::task::JoinHandle;
use yarp_devices::clock::wall_clock;
use yarp_devices::{CartesianEvent, Device};
use yarp_ports::{Answer, Network, Port, PortOptions, Received};
use yarp_wire::Stamp;

use self::request_handler::RequestHandler;
use super::CartesianVersion;
use super::messages::to_event;
use crate::OpenError;
use crate::open_ports::{close_all, open_all, request_port};
use crate::periodic_thread::{PeriodicThread, check_period};
use crate::reconnect::PORT_CLOSE_TIMEOUT;

/// Stock's default.
const DEFAULT_PERIOD: Duration = Duration::from_millis(10);
/// Timeout of the end of publishing.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(1);

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
#[derive(Debug)]
pub struct CartesianServer {
    name: String,
    running: Option<Running>,
    /// Runtime of the ports, for closing them from anywhere.
    runtime: Handle,
}

#[derive(Debug)]
struct Running {
    inputs: [Port; 2],
    state: Arc<Port>,
    events: Arc<Port>,
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
        let wanted = [
            ("state:o", PortOptions::new().type_name("yarp/vector")),
            ("events:o", PortOptions::new()),
            ("command:i", obeying(&handler)),
            ("rpc:i", answering(&handler)),
        ];
        let [state, event_port, command, rpc] = open_all(network, name, wanted).await?;
        let inputs = [command, rpc];
        let (state, event_port) = (Arc::new(state), Arc::new(event_port));
        let (sender, receiver) = unbounded_channel();
        match publisher::start(handler, state.clone(), events, sender, period) {
            Ok(publisher) => {
                tracing::info!(name, ?period, "controller of a tool served");
                let writer = tokio::spawn(write_events(event_port.clone(), receiver));
                Ok(Self {
                    name: name.to_owned(),
                    running: Some(Running {
                        inputs,
                        state,
                        events: event_port,
                        publisher,
                        writer,
                    }),
                    runtime: Handle::current(),
                })
            }
            Err(error) => {
                let outputs = [state, event_port].into_iter().filter_map(Arc::into_inner);
                close_all(inputs.into_iter().chain(outputs)).await;
                Err(OpenError::Thread(error))
            }
        }
    }

    /// Returns the prefix of the ports' names.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Says that it closes, closes the ports and unregisters their names.
    ///
    /// Takes a few seconds at most, even if peers do not answer. The controller continues.
    pub async fn close(mut self) {
        if let Some(running) = self.running.take() {
            running.close().await;
        }
    }
}

impl Drop for CartesianServer {
    /// Closes like [`close`](Self::close), in the background, as far as the runtime still runs.
    fn drop(&mut self) {
        if let Some(running) = self.running.take() {
            self.runtime.spawn(running.close());
        }
    }
}

impl Running {
    async fn close(self) {
        // New requests are rejected, then pending events are sent.
        close_all(self.inputs).await;
        self.publisher.end(CLOSE_TIMEOUT).await;
        let mut writer = self.writer;
        if tokio::time::timeout(PORT_CLOSE_TIMEOUT, &mut writer)
            .await
            .is_err()
        {
            writer.abort();
            let _ = writer.await;
        }
        let outputs = [self.state, self.events]
            .into_iter()
            .filter_map(Arc::into_inner);
        close_all(outputs).await;
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
            .unwrap_or_else(|| CartesianEvent::Closing { time: wall_clock() });
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
        let message = received.bottle().unwrap_or_default();
        handler.obey(&message, &received.from);
        Answer::Nothing
    };
    request_port().handler(take).input_only()
}

fn answering(handler: &Arc<RequestHandler>) -> PortOptions {
    let handler = handler.clone();
    let answer = move |received: &mut Received| {
        let request = received.bottle().unwrap_or_default();
        Answer::reply(handler.answer(&request, &received.from))
    };
    request_port().handler(answer).input_only()
}
