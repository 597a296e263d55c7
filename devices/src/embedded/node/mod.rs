//! The embedded server, which runs on the arm's PC.

mod line_follower;
mod node_arm;
mod node_motion_completion;
mod node_session;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use tracing::{info, warn};

pub use self::node_arm::CartesianMoves;
use self::node_arm::{ServedArm, served_arm};
use self::node_session::{End, Session};
use super::backoff;
use super::link_setup::{LinkAddresses, LinkConnector, LinkMode, join};
use crate::{Device, DeviceError};

/// Options of a server.
#[derive(Clone, Copy, Debug)]
pub struct NodeOptions {
    /// The end that listens, and the addresses. In the thesis the driver listens, and the server connects.
    pub link_mode: LinkMode,
    /// Timeout of the rest of a request that has begun, and of writing a reply.
    pub timeout: Duration,
    /// Timeout after which an idle client counts as gone. Our driver reads the joints all the time.
    pub idle_timeout: Duration,
    /// The pause after a connection that ended; it doubles with each that fails in a row.
    pub initial_backoff: Duration,
    /// The longest such pause.
    pub max_backoff: Duration,
    /// Moves of the tool.
    pub moves: CartesianMoves,
}

impl NodeOptions {
    /// Returns options with a second for the rest of a request, an idle timeout of five seconds, and an attempt to
    /// connect each second.
    pub fn new(link_mode: LinkMode) -> Self {
        Self {
            link_mode,
            timeout: Duration::from_secs(1),
            idle_timeout: Duration::from_secs(5),
            initial_backoff: Duration::from_millis(50),
            max_backoff: Duration::from_secs(1),
            moves: CartesianMoves::default(),
        }
    }
}

/// State of a server.
#[derive(Clone, Debug, Default)]
pub struct NodeStatus {
    /// True if a client is connected.
    pub connected: bool,
    /// Number of clients so far.
    pub sessions: u64,
    /// Requests that were carried out or answered.
    pub served: u64,
    /// Requests that were answered `q`.
    pub refused: u64,
    /// The reason why the last connection ended.
    pub last_end: Option<String>,
}

/// The server of the protocol, around a device with the four or seven joints of a WAM.
///
/// * The arm is idle until the first `gra`, which puts its joints into position mode: held, with gravity compensated.
/// * A command replaces the previous one; nothing is queued.
/// * `moc` moves the tool on a straight line, in the posture that the arm has; a line that would need another one is
///   refused ([`CartesianMoves`]).
/// * When the client disconnects, in any way, the server stops the current move and the arm holds.
/// * A thread of its own does all of it. Dropping the server joins it; the arm holds as long as its device lives.
#[derive(Debug)]
pub struct WamNode {
    shared: Arc<Shared>,
    addresses: LinkAddresses,
    thread: Option<JoinHandle<()>>,
}

#[derive(Debug, Default)]
struct Shared {
    ending: AtomicBool,
    status: Mutex<NodeStatus>,
}

impl Shared {
    fn status(&self) -> MutexGuard<'_, NodeStatus> {
        // Numbers are consistent even after a panic.
        self.status.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl WamNode {
    /// Starts a server for this arm, which becomes idle.
    ///
    /// Errors: [`DeviceError::NotSupported`] for a device that has not four or seven joints with encoders, position control and
    /// modes; [`DeviceError::Start`] if the ports to listen at are taken, or the machine has no thread left.
    pub fn start(device: Arc<dyn Device>, options: NodeOptions) -> Result<Self, DeviceError> {
        let arm = served_arm(device, options.moves)?;
        arm.rest()?;
        let failed = |what| move |source| DeviceError::Start { what, source };
        let (connector, addresses) = LinkConnector::start(options.link_mode)
            .map_err(failed("the sockets of the arm's server"))?;
        let shared = Arc::new(Shared::default());
        let theirs = Arc::clone(&shared);
        let thread = thread::Builder::new()
            .name("wam-node".into())
            .spawn(move || theirs.run(&connector, arm, &options))
            .map_err(failed("the thread of the arm's server"))?;
        info!(arm = %addresses.arm, packets = %addresses.packets, "server of the arm started");
        Ok(Self {
            shared,
            addresses,
            thread: Some(thread),
        })
    }

    /// Returns the addresses at which it listens, or to which it connects.
    pub fn addresses(&self) -> LinkAddresses {
        self.addresses
    }

    /// Returns the state of the server.
    pub fn status(&self) -> NodeStatus {
        self.shared.status().clone()
    }
}

impl Drop for WamNode {
    fn drop(&mut self) {
        self.shared.ending.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            join(thread, "the thread of the arm's server");
        }
    }
}

impl Shared {
    fn run(&self, connector: &LinkConnector, mut arm: Box<dyn ServedArm>, options: &NodeOptions) {
        let new_pauses = || backoff::backoff(options.initial_backoff, options.max_backoff);
        let mut pauses = new_pauses();
        let mut last_error = String::new();
        while !self.ending.load(Ordering::Acquire) {
            match connector.connect(&self.ending) {
                Ok(None) => break,
                Ok(Some(pair)) => {
                    {
                        let mut status = self.status();
                        status.connected = true;
                        status.sessions += 1;
                    }
                    let (served, end) = Session::run(self, connector, arm.as_mut(), options, pair);
                    arm.hold();
                    if served > 0 {
                        pauses = new_pauses();
                    }
                    match &end {
                        End::Shutdown => info!("the client closed the session; the arm holds"),
                        End::Lost(error) => warn!(%error, "the client is gone; the arm holds"),
                    }
                    let mut status = self.status();
                    status.connected = false;
                    status.last_end = Some(end.to_string());
                }
                Err(error) => {
                    let error = error.to_string();
                    if error != last_error {
                        warn!(error, "no client yet");
                        last_error = error;
                    }
                }
            }
            backoff::wait(&mut pauses, &self.ending);
        }
        arm.hold();
    }
}
