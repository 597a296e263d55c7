//! The client of a gaze controller that another program serves.
//!
//! Parameters are those of icub-main's `gazecontrollerclient`.
//!
//! Source: `ClientGazeController.cpp` of icub-main 2.11.

use std::time::Duration;

use yarp_wire::PortName;
use yarp_wrappers::{RemoteGazeControl, RemoteGazeOptions};

use super::local_device::LocalDevice;
use super::remote_board::cast;
use super::{OpenResult, Opening};

pub(super) async fn remote(opening: Opening<'_>) -> OpenResult {
    let parameters = opening.parameters;
    let remote: PortName = parameters.need("remote")?;
    let local: PortName = parameters.need("local")?;
    let mut options = RemoteGazeOptions::new(remote.to_string(), local.to_string());
    if let Some(carrier) = parameters.get::<String>("carrier")? {
        options = options.carrier(carrier);
    }
    if let Some(timeout) = parameters.get::<Duration>("timeout")? {
        options = options.max_state_age(timeout);
    }
    let network = opening.network.clone();
    let open = move || RemoteGazeControl::open(&network, options);
    Ok(Box::new(LocalDevice::other(cast(parameters, open).await?)))
}
