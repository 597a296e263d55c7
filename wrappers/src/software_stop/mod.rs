//! The software stop of a device, on a port of its own.
//!
//! ```text
//! NAME/stop/rpc:i    stop     -> [ok] stopped            every joint comes to rest and holds
//!                    brake    -> [ok] braked             the machine brakes; its pendant activates it again
//!                    release  -> [ok] released           commands are taken again
//!                    status   -> [is] released, stopped or braked
//!                    help     -> [many] ...
//!                    anything that fails -> [fail] "reason" state
//! ```
//!
//! The port shares no queue, connection or thread with the ports of the control board, so that a client that floods those
//! keeps no stop away. Who may call it is said by the roles of the port (`write`), as for commands.

use std::sync::Arc;

use tokio::runtime::Handle;
use yarp_devices::{Device, DeviceError, SoftwareStop, StopState};
use yarp_ports::{Answer, Network, Port, Received};
use yarp_wire::{Bottle, Value, Vocab32};

use crate::OpenError;
use crate::open_ports::{open, request_port};
use crate::page_request::request_of;

const IS: Vocab32 = Vocab32::new("is");
const MANY: Vocab32 = Vocab32::new("many");
/// Behind the name of the device.
const SUFFIX: &str = "stop/rpc:i";
/// Requests, with what they do.
const HELP: [(&str, &str); 5] = [
    (STOP, "brings every joint to rest, and refuses commands"),
    (BRAKE, "has the machine brake, and refuses commands"),
    (RELEASE, "takes commands again"),
    (
        STATUS,
        "tells whether the device is released, stopped or braked",
    ),
    ("help", "tells this"),
];
/// Request that stops.
pub const STOP: &str = "stop";
/// Request that brakes.
pub const BRAKE: &str = "brake";
/// Request that releases.
pub const RELEASE: &str = "release";
/// Request for the state.
pub const STATUS: &str = "status";

/// Returns the name of the port of a device.
pub fn port_of(name: &str) -> String {
    format!("{name}/{SUFFIX}")
}

/// The software stop of a device, served on `NAME/stop/rpc:i`.
///
/// Closing the server releases nothing: a stopped device stays stopped.
#[derive(Debug)]
pub struct StopServer {
    port: Option<Port>,
    /// Runtime of the port, for closing it from anywhere.
    runtime: Handle,
}

impl StopServer {
    /// Opens the port.
    ///
    /// * `name`: begins with `/`.
    /// * Errors: [`OpenError::NoInterface`] when the device has no software stop, [`OpenError::NameTaken`],
    ///   [`OpenError::Port`].
    pub async fn open(
        network: &Network,
        device: Arc<dyn Device>,
        name: &str,
    ) -> Result<Self, OpenError> {
        if device.software_stop().is_none() {
            return Err(OpenError::NoInterface("software stop"));
        }
        let answering = move |received: &mut Received| {
            let request = request_of(received);
            Answer::reply(match device.software_stop() {
                Some(stop) => answer(stop, &request),
                None => Bottle::of(Vocab32::FAIL),
            })
        };
        let options = request_port().handler(answering).input_only();
        let port = open(network, port_of(name), options).await?;
        tracing::info!(port = port.name(), "software stop served");
        Ok(Self {
            port: Some(port),
            runtime: Handle::current(),
        })
    }

    /// Closes the port and unregisters its name; takes a few seconds at most.
    pub async fn close(mut self) {
        if let Some(port) = self.port.take() {
            port.close().await;
        }
    }
}

impl Drop for StopServer {
    /// Closes like [`close`](Self::close), in the background, as far as the runtime still runs.
    fn drop(&mut self) {
        if let Some(port) = self.port.take() {
            self.runtime.spawn(port.close());
        }
    }
}

fn answer(stop: &dyn SoftwareStop, request: &Bottle) -> Bottle {
    let word = match request.as_slice() {
        [word] => match word.as_vocab() {
            Some(word) => Some(word.to_string()),
            None => word.as_str().map(str::to_owned),
        },
        _ => None,
    };
    let done = |outcome: Result<(), DeviceError>| match outcome {
        Ok(()) => Bottle::of(Vocab32::OK).with(state(stop)),
        Err(error) => {
            tracing::warn!("{request}: {error}");
            failed(&error.to_string(), stop)
        }
    };
    match word.as_deref() {
        Some(STOP) => done(stop.stop_motion()),
        Some(BRAKE | "brak") => done(stop.brake()),
        Some(RELEASE | "rele") => {
            stop.release();
            done(Ok(()))
        }
        Some(STATUS | "stat") => Bottle::of(IS).with(state(stop)),
        Some("help") => HELP
            .iter()
            .map(|(name, purpose)| Value::from(format!("{name}: {purpose}").as_str()))
            .fold(Bottle::of(MANY), Bottle::with),
        _ => failed("expected stop, brake, release, status or help", stop),
    }
}

fn state(stop: &dyn SoftwareStop) -> Value {
    let state: StopState = stop.stop_state();
    Value::from(state.to_string().as_str())
}

fn failed(reason: &str, stop: &dyn SoftwareStop) -> Bottle {
    Bottle::of(Vocab32::FAIL).with(reason).with(state(stop))
}
