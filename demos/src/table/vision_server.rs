//! Recognition as a program of its own: objects of a table at a port.

use std::sync::{Mutex, PoisonError};

use yarp_client::{Bottle, Network, RpcServer, Value, bottle};
use yarp_manipulation::Detector;

use super::item_message::{self, MAX_OBJECTS};
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
    RpcServer::open_on(network, name, move |request: Bottle| {
        if request.get(0).and_then(Value::as_str) != Some("list") {
            return bottle!["fail", "expected list"];
        }
        let mut vision = vision.lock().unwrap_or_else(PoisonError::into_inner);
        match vision.detect() {
            Ok(items) => {
                let mut reply = bottle!["is"];
                for item in items.iter().take(MAX_OBJECTS) {
                    reply.push(Value::List(item_message::of_item(item)));
                }
                reply
            }
            Err(error) => {
                let why = yarp_client::ports::error_chain(&error);
                tracing::warn!(error = why, "no objects");
                bottle!["fail", why]
            }
        }
    })
}
