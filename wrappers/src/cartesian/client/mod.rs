//! A controller in another program.
//!
//! | file | content |
//! | --- | --- |
//! | `remote_cartesian_options` | names, carrier and timeouts |
//! | `cartesian_link` | the four ports, opening, calls |
//! | `latest_pose` | the newest pose, and the listeners of events |
//! | `remote_cartesian_interface` | implements the interface with messages |

mod cartesian_link;
mod latest_pose;
mod remote_cartesian_interface;
mod remote_cartesian_options;

use std::collections::BTreeSet;
use std::sync::Mutex;

use yarp_devices::Device;
use yarp_ports::{Network, blocking};

use self::cartesian_link::ToolLink;
use super::messages::Request;
use crate::OpenError;
use crate::device_ports::{Link, SharedLink, lock};
pub use remote_cartesian_options::RemoteCartesianOptions;

/// The tool of an arm in another program, as iCub's `cartesiancontrollerclient` casts it.
///
/// * **Poses** are those that the server streams; asking for one waits for nothing. It fails with
///   [`DeviceError::NoDataYet`](yarp_devices::DeviceError::NoDataYet) before the first, and with
///   [`DeviceError::Stale`](yarp_devices::DeviceError::Stale) when the newest is older than the trusted age
///   ([`RemoteCartesianOptions::max_state_age`]).
/// * **Targets without waiting, and velocities** are sent, and a refusal is not reported.
/// * **Blocking calls.** Every other call is a message and its reply, and waits at most
///   [`RemoteCartesianOptions::rpc_timeout`]. Putting on a tip waits besides for the first pose with it.
/// * **Refusals** are [`DeviceError::Refused`](yarp_devices::DeviceError::Refused).
/// * **Connections that are lost** are made again when the server is back; until then calls fail. Settings and motions
///   of the server that went away are not restored.
///
/// Dropping it has the server forget the contexts that it stored and the checkpoints that it registered, and closes its
/// ports; that takes a few seconds at the most.
///
/// ```no_run
/// # fn example() -> Result<(), Box<dyn std::error::Error>> {
/// use yarp_devices::{CartesianControl, Target};
/// use yarp_ports::Network;
/// use yarp_wrappers::{RemoteCartesianControl, RemoteCartesianOptions};
///
/// let network = Network::from_process()?;
/// let options = RemoteCartesianOptions::new("/cartController/wam", "/me/tool");
/// let tool = RemoteCartesianControl::open(&network, options)?;
/// tool.go_to_sync(Target::Position([0.4, 0.1, 0.4]), Some(1.5))?;
/// # Ok(()) }
/// ```
#[derive(Debug)]
pub struct RemoteCartesianControl {
    link: SharedLink<ToolLink>,
    /// Contexts that the server stores for this client.
    contexts: Mutex<BTreeSet<i32>>,
    checkpoints: Mutex<Vec<f64>>,
}

impl RemoteCartesianControl {
    /// Opens four ports of its own and connects them to the server.
    ///
    /// * Ports: `LOCAL/command:o`, `LOCAL/state:i`, `LOCAL/events:i` and `LOCAL/rpc:o`.
    /// * Asks for the version of the protocol and whether the solver is there. Does not wait for the first pose.
    /// * Blocks for a few deadlines at the most.
    /// * Errors: [`OpenError::NoRemote`], [`OpenError::NameTaken`], [`OpenError::Port`], [`OpenError::Connect`],
    ///   [`OpenError::Query`]; then nothing stays open.
    pub fn open(network: &Network, options: RemoteCartesianOptions) -> Result<Self, OpenError> {
        let network = network.with_timeout(options.common.rpc_timeout);
        let link = blocking::wait(async move { ToolLink::open(&network, &options).await })?;
        tracing::info!(remote = link.ports.remote(), "remote tool connected");
        Ok(Self {
            link: SharedLink::new(link),
            contexts: Mutex::default(),
            checkpoints: Mutex::default(),
        })
    }

    /// Returns the name of the server, as it was given.
    pub fn remote(&self) -> &str {
        self.link.ports.remote()
    }
}

impl Drop for RemoteCartesianControl {
    fn drop(&mut self) {
        let contexts = lock(&self.contexts).iter().copied().collect::<Vec<_>>();
        let checkpoints = lock(&self.checkpoints).clone();
        let forget = (!contexts.is_empty()).then_some(Request::Delete(Some(contexts)));
        let requests: Vec<Request> = forget
            .into_iter()
            .chain(checkpoints.into_iter().map(Request::Unregister))
            .collect();
        if let Some(link) = self.link.take() {
            blocking::wait(async move {
                for request in requests {
                    if let Err(error) = link.ask(&request).await {
                        // The server is gone, and with it its contexts.
                        tracing::debug!("{error}");
                        break;
                    }
                }
                link.close().await;
            });
        }
    }
}

impl Device for RemoteCartesianControl {
    yarp_devices::offers! { cartesian_control: CartesianControl }
}
