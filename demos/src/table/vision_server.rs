//! Recognition as a program of its own: objects of a table at a port.

use std::sync::{Mutex, PoisonError};

use yarp_client::{Network, RpcServer};
use yarp_manipulation::Detector;

use super::item_message;
use super::vision::RemoteVision;

/// Opens a port that answers `list` with the objects that the cameras see now:
/// `is (id word x y z roll pitch yaw (sizes) label) ...` in m and rad, or `fail` with the reason.
pub fn serve_vision(
    network: &Network,
    name: &str,
    vision: RemoteVision,
) -> yarp_client::Result<RpcServer> {
    // One look at a time: the detector compares it with the one before.
    let vision = Mutex::new(vision);
    item_message::serve(network, name, move || {
        let mut vision = vision.lock().unwrap_or_else(PoisonError::into_inner);
        match vision.detect() {
            Ok(items) => Ok(items.iter().map(item_message::of_item).collect()),
            Err(error) => {
                // It contains its source.
                let why = error.to_string();
                tracing::warn!(error = why, "no objects");
                Err(why)
            }
        }
    })
}
