//! Joints that another program serves.

use std::sync::Arc;
use std::time::Duration;

use yarp_devices::Device;
use yarp_wire::PortName;
use yarp_wrappers::{RemoteControlBoard, RemoteControlBoardOptions};

use super::{Opening, Outcome};
use crate::{Future, HostError, Hosted, Parts};

/// What stock reads, and what we do without.
const WITHOUT_EFFECT: [&str; 5] = [
    "writeStrict",
    "diagnostic",
    "local_qos",
    "remote_qos",
    "use_streaming",
];

pub(super) async fn open(opening: Opening<'_>) -> Outcome {
    let parameters = opening.parameters;
    let remote: PortName = parameters.need("remote")?;
    let local: PortName = parameters.need("local")?;
    let mut options = RemoteControlBoardOptions::new(remote.to_string(), local.to_string());
    if let Some(carrier) = parameters.get::<String>("carrier")? {
        options = options.carrier(carrier);
    }
    if let Some(timeout) = parameters.get::<Duration>("timeout")? {
        options = options.timeout(timeout);
    }
    if parameters.has("ignoreProtocolCheck") {
        options = options.ignore_protocol_version();
    }
    for name in WITHOUT_EFFECT {
        if parameters.has(name) {
            tracing::warn!("{}: parameter {name} has no effect", parameters.device());
        }
    }
    let network = opening.network.clone();
    // Opening blocks until the board has answered.
    let opened = tokio::task::spawn_blocking(move || RemoteControlBoard::open(&network, options));
    let opened = opened
        .await
        .unwrap_or_else(|panicked| std::panic::resume_unwind(panicked.into_panic()));
    let board = opened.map_err(|source| HostError::Open {
        origin: parameters.origin().clone(),
        device: parameters.device().to_owned(),
        source: Box::new(source),
    })?;
    Ok(Box::new(Remote(Arc::new(board))))
}

struct Remote(Arc<RemoteControlBoard>);

impl Hosted for Remote {
    fn parts(&self) -> Parts {
        let board: Arc<dyn Device> = self.0.clone();
        Parts { board: Some(board) }
    }

    fn close(self: Box<Self>) -> Future<'static, ()> {
        Box::pin(async {
            // Its ports are closed with a wait.
            let _ = tokio::task::spawn_blocking(move || drop(self)).await;
        })
    }
}
