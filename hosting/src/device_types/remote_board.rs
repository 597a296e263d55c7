//! A client of a control board that another program serves.

use std::sync::Arc;
use std::time::Duration;

use yarp_devices::Device;
use yarp_wire::PortName;
use yarp_wire::settings::Parameters;
use yarp_wrappers::{OpenError, RemoteControlBoard, RemoteControlBoardOptions};

use super::attached_server::not_opened;
use super::local_device::LocalDevice;
use super::{OpenResult, Opening};
use crate::HostError;
use crate::shared_parameters::warn_of_ignored;

/// Parameters that stock reads and that have no effect here.
const IGNORED_PARAMETERS: [&str; 5] = [
    "writeStrict",
    "diagnostic",
    "local_qos",
    "remote_qos",
    "use_streaming",
];

pub(super) async fn open(opening: Opening<'_>) -> OpenResult {
    let parameters = opening.parameters;
    let remote: PortName = parameters.need("remote")?;
    let local: PortName = parameters.need("local")?;
    let options = options(parameters, "", remote.as_ref(), local.as_ref())?;
    Ok(Box::new(LocalDevice::board(
        connect(opening, options).await?,
    )))
}

/// Reads the options of a connection to a board, from parameters with the prefix `group`.
pub(super) fn options(
    parameters: &Parameters,
    group: &str,
    remote: &str,
    local: &str,
) -> Result<RemoteControlBoardOptions, HostError> {
    let named = |name: &str| format!("{group}{name}");
    let mut options = RemoteControlBoardOptions::new(remote, local);
    if let Some(carrier) = parameters.get::<String>(&named("carrier"))? {
        options = options.carrier(carrier);
    }
    if let Some(timeout) = parameters.get::<Duration>(&named("timeout"))? {
        options = options.max_state_age(timeout);
    }
    if parameters.has(&named("ignoreProtocolCheck")) {
        options = options.ignore_protocol_version();
    }
    warn_of_ignored(parameters, &IGNORED_PARAMETERS.map(named));
    Ok(options)
}

/// Connects to a board; waits for its first answer.
pub(super) async fn connect(
    opening: Opening<'_>,
    options: RemoteControlBoardOptions,
) -> Result<Arc<RemoteControlBoard>, HostError> {
    let parameters = opening.parameters;
    let network = opening.network.clone();
    cast(parameters, move || {
        RemoteControlBoard::open(&network, options)
    })
    .await
}

/// Connects to a device of another program, on a thread that may block.
pub(super) async fn cast<D: Device + 'static>(
    parameters: &Parameters,
    open: impl FnOnce() -> Result<D, OpenError> + Send + 'static,
) -> Result<Arc<D>, HostError> {
    let opened = tokio::task::spawn_blocking(open).await;
    let opened = opened.unwrap_or_else(|panicked| std::panic::resume_unwind(panicked.into_panic()));
    let (origin, device) = (parameters.origin(), parameters.device());
    Ok(Arc::new(
        opened.map_err(|source| not_opened(origin, device, source))?,
    ))
}
