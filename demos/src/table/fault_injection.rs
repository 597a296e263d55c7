//! A port at which a program breaks the simulated table on purpose, to see what another one does about it.

use std::sync::{Arc, Weak};

use yarp_client::{Bottle, Network, RpcServer, Value, bottle};
use yarp_table::LiveTable;

const HELP: &str = "camera freeze: camera and depth sensor take no new images; camera cover: the lens of the camera is dark; \
    camera run: ends both; hand stall: the motors of the hand stand still; hand run: ends that";

/// Opens a port that answers `camera freeze`, `camera cover`, `camera run`, `hand stall`, `hand run` and `help`.
///
/// Errors: those of [`RpcServer::open_on`].
pub(super) fn serve_faults(
    network: &Network,
    name: &str,
    table: &Arc<LiveTable>,
) -> yarp_client::Result<RpcServer> {
    // The port's own threads must not be the last to have the table, whose end waits for others.
    let table = Arc::downgrade(table);
    RpcServer::open_on(network, name, move |request: Bottle| {
        answer(&table, &request)
    })
}

fn answer(table: &Weak<LiveTable>, request: &Bottle) -> Bottle {
    let Some(table) = table.upgrade() else {
        return bottle!["fail", "the table is closing"];
    };
    let words: Vec<&str> = request.iter().filter_map(Value::as_str).collect();
    match words[..] {
        ["camera", state @ ("freeze" | "cover" | "run")] => {
            for camera in [table.camera(), table.depth()] {
                camera.set_frozen(state == "freeze");
            }
            table.camera().set_covered(state == "cover");
        }
        ["hand", state @ ("stall" | "run")] => table.stall_hand(state == "stall"),
        ["help"] => return bottle!["is", HELP],
        _ => return bottle!["fail", HELP],
    }
    tracing::warn!(fault = words.join(" "), "a fault was set or ended");
    bottle!["ok"]
}
