//! Gaze controllers of iCub, the module `iKinGazeCtrl`, in another program.
//!
//! ```text
//! requests        LOCAL/rpc      -> REMOTE/rpc
//! points          LOCAL/xd:o     -> REMOTE/xd:i        x y z
//! directions      LOCAL/angles:o -> REMOTE/angles:i    abs azimuth elevation vergence
//! pixels          LOCAL/mono:o   -> REMOTE/mono:i      left u v z
//! pairs of them   LOCAL/stereo:o -> REMOTE/stereo:i    ul vl ur vr
//! fixation point  LOCAL/x:i      <- REMOTE/x:o         (x y z)
//! direction       LOCAL/angles:i <- REMOTE/angles:o    (azimuth elevation vergence)
//! joints          LOCAL/q:i      <- REMOTE/q:o         torso, then six of the head, degrees
//! events          LOCAL/events:i <- REMOTE/events:o    motion-ongoing 1204.1 0.5
//! ```
//!
//! | folder or file | content |
//! | --- | --- |
//! | `messages` | messages |
//! | `remote_gaze_options` | names, carrier and timeouts |
//! | `gaze_link` | the nine ports, opening, calls |
//! | `latest_gaze` | the newest message of each stream, and the listeners of events |
//! | `remote_gaze_interface` | implements the interface with messages |
//!
//! **Invariant:** a call ends within the timeout of a reply, whatever the controller does, and a reply of an unexpected kind is
//! an error.
//!
//! Where stock's client and its controller disagree, the controller is right: a vergence at which the eyes are kept is one
//! number behind `[ack]`, for which stock's client demands two. Keeping the eyes at their present vergence sends the
//! vergence; stock's client sends the yaw of the neck.
//!
//! Source: `ClientGazeController.cpp` and `src/modules/iKinGazeCtrl` of icub-main 2.11, `GazeControl.h` of YARP 4.0.

mod gaze_link;
mod latest_gaze;
pub mod messages;
mod remote_gaze_interface;
mod remote_gaze_options;

use std::collections::BTreeSet;
use std::sync::Mutex;

use yarp_devices::Device;
use yarp_ports::{Network, blocking};

use self::gaze_link::GazeLink;
use self::messages::gaze_request;
use crate::OpenError;
use crate::device_ports::{Link, SharedLink, lock};
pub use remote_gaze_options::RemoteGazeOptions;

/// The gaze controller of a head in another program, as iCub's `gazecontrollerclient` casts it.
///
/// * **Fixation point and direction** are those that the controller streams; asking for one waits for nothing. It fails with
///   [`DeviceError::NoDataYet`](yarp_devices::DeviceError::NoDataYet) before the first, and with
///   [`DeviceError::Stale`](yarp_devices::DeviceError::Stale) when the newest is older than the trusted age
///   ([`RemoteGazeOptions::max_state_age`]).
/// * **Targets without waiting** are sent, and a refusal is not reported.
/// * **Blocking calls.** Every other call is a message and its reply, and waits at most
///   [`RemoteGazeOptions::rpc_timeout`].
/// * **Refusals** are [`DeviceError::Refused`](yarp_devices::DeviceError::Refused).
/// * **Connections that are lost** are made again when the controller is back; until then calls fail. Settings and motions
///   of the controller that went away are not restored.
///
/// Dropping it has the controller forget the contexts that it stored and the checkpoints that it registered, and closes
/// its ports; that takes a few seconds at the most.
///
/// ```no_run
/// # fn example() -> Result<(), Box<dyn std::error::Error>> {
/// use yarp_devices::{GazeControl, GazeTarget};
/// use yarp_ports::Network;
/// use yarp_wrappers::{RemoteGazeControl, RemoteGazeOptions};
///
/// let network = Network::from_process()?;
/// let options = RemoteGazeOptions::new("/iKinGazeCtrl", "/me/gaze");
/// let gaze = RemoteGazeControl::open(&network, options)?;
/// gaze.look_at_sync(GazeTarget::Point([-0.5, 0.0, 0.3]))?;
/// # Ok(()) }
/// ```
#[derive(Debug)]
pub struct RemoteGazeControl {
    link: SharedLink<GazeLink>,
    /// Contexts that the controller stores for this client.
    contexts: Mutex<BTreeSet<i32>>,
    /// Checkpoints that this client registered.
    checkpoints: Mutex<Vec<f64>>,
}

impl RemoteGazeControl {
    /// Opens nine ports of its own and connects them to the controller.
    ///
    /// * Ports: `LOCAL/rpc`, `LOCAL/xd:o`, `LOCAL/angles:o`, `LOCAL/mono:o`, `LOCAL/stereo:o`, `LOCAL/x:i`,
    ///   `LOCAL/angles:i`, `LOCAL/q:i` and `LOCAL/events:i`.
    /// * Asks for the version of the protocol, and refuses others than 2.0 and 1.2, whose words are the same. Does not wait
    ///   for the first message of a stream.
    /// * Blocks for a few deadlines at the most.
    /// * Errors: [`OpenError::NoRemote`], [`OpenError::NameTaken`], [`OpenError::Port`], [`OpenError::Connect`],
    ///   [`OpenError::Query`]; then nothing stays open.
    pub fn open(network: &Network, options: RemoteGazeOptions) -> Result<Self, OpenError> {
        let network = network.with_timeout(options.common.rpc_timeout);
        let link = blocking::wait(async move { GazeLink::open(&network, &options).await })?;
        tracing::info!(
            remote = link.ports.remote(),
            "remote gaze controller connected"
        );
        Ok(Self {
            link: SharedLink::new(link),
            contexts: Mutex::default(),
            checkpoints: Mutex::default(),
        })
    }

    /// Returns the name of the controller, as it was given.
    pub fn remote(&self) -> &str {
        self.link.ports.remote()
    }
}

impl Drop for RemoteGazeControl {
    fn drop(&mut self) {
        let contexts = std::mem::take(&mut *lock(&self.contexts));
        let checkpoints = std::mem::take(&mut *lock(&self.checkpoints));
        let forget = (!contexts.is_empty()).then(|| gaze_request::delete(contexts));
        let requests: Vec<_> = forget
            .into_iter()
            .chain(checkpoints.into_iter().map(gaze_request::unregister))
            .collect();
        if let Some(link) = self.link.take() {
            blocking::wait(async move {
                for request in requests {
                    if let Err(error) = link.ask(&request).await {
                        // The controller is gone, and with it its contexts.
                        tracing::debug!("{error}");
                        break;
                    }
                }
                link.close().await;
            });
        }
    }
}

impl Device for RemoteGazeControl {
    yarp_devices::offers! { gaze_control: GazeControl }
}
