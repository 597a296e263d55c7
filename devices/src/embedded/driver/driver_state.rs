//! State shared by callers and the thread of the driver.

use std::sync::atomic::AtomicBool;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use tracing::warn;

use super::DriverOptions;
use super::pending_requests::PendingRequests;
use crate::embedded::link_error::LinkError;
use crate::fake::AxesModel;
use crate::periodic_timer::CycleStatistics;
use crate::{DeviceError, EncoderReading};

/// State of the connection to the embedded PC.
#[derive(Clone, Debug)]
pub struct LinkStatus {
    /// State of the connection.
    pub state: LinkState,
    /// The peer, in words; the last one while there is none.
    pub peer: String,
    /// Number of connections that were opened successfully.
    pub sessions: u64,
    /// Number of failed attempts to connect and of broken connections.
    pub failures: u64,
    /// The last step that failed, and why.
    pub last_failure: Option<String>,
    /// The reason why the last move ended elsewhere than at its target.
    pub last_interruption: Option<String>,
    /// Number of further connections that were rejected because there was one.
    pub rejected_connections: u64,
}

/// State of the connection to the embedded PC.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum LinkState {
    /// Not now; the driver tries by itself.
    Down,
    /// Yes, but the arm is without gravity compensation, or a fault ended its move: position mode, that is `gra`, leads out.
    Idle,
    /// Yes, and the arm takes moves.
    Up,
}

impl LinkStatus {
    /// Returns whether there is a connection.
    pub fn is_up(&self) -> bool {
        self.state != LinkState::Down
    }

    /// Returns the error of a failed step for the caller.
    pub(super) fn failed(&self, error: &LinkError) -> DeviceError {
        DeviceError::Remote {
            peer: self.peer.clone(),
            step: error.step.clone(),
            advice: "again: the driver connects by itself, the arm holds meanwhile; see that `yarp wam-node` runs on the \
                     arm's PC"
                .to_owned(),
            source: Some(Box::new(error.cause.clone())),
        }
    }
}

/// Position of the joints after an accepted move.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Goal {
    /// Not known in joint angles.
    Unknown,
    /// Home.
    Home,
    /// Degrees.
    Joints(Vec<f64>),
}

#[derive(Debug)]
pub(super) struct Shared {
    pub(super) options: DriverOptions,
    pub(super) ending: AtomicBool,
    state: Mutex<State>,
}

#[derive(Debug)]
pub(super) struct State {
    pub(super) link: LinkStatus,
    pub(super) pending: PendingRequests,
    /// Names, kinds and limits; where its joints are does not count.
    pub(super) limits: AxesModel,
    /// The newest, and when it came.
    pub(super) readings: Vec<EncoderReading>,
    pub(super) read_at: Option<Instant>,
    /// Commanded positions of the joints on this connection, degrees.
    pub(super) targets: Option<Vec<f64>>,
    /// Joints that receive direct positions; none on a new connection.
    pub(super) direct: Vec<bool>,
    pub(super) moving: bool,
    /// A move is on its way to the arm, which has not answered yet.
    pub(super) sending: bool,
    pub(super) timing: CycleStatistics,
}

impl Shared {
    pub(super) fn new(options: DriverOptions) -> Self {
        let state = State {
            link: LinkStatus {
                state: LinkState::Down,
                peer: "the embedded PC".to_owned(),
                sessions: 0,
                failures: 0,
                last_failure: None,
                last_interruption: None,
                rejected_connections: 0,
            },
            pending: PendingRequests::default(),
            limits: AxesModel::new(options.joints.clone()),
            direct: vec![false; options.joints.len()],
            readings: Vec::new(),
            read_at: None,
            targets: None,
            moving: false,
            sending: false,
            timing: CycleStatistics::default(),
        };
        Self {
            options,
            ending: AtomicBool::new(false),
            state: Mutex::new(state),
        }
    }

    pub(super) fn lock(&self) -> MutexGuard<'_, State> {
        // The state is whole between any two statements that could panic.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    /// Checks that there is a connection for a step; the error has what ended the last one.
    pub(super) fn check_up(&self, step: &str) -> Result<(), DeviceError> {
        if self.link.is_up() {
            return Ok(());
        }
        let last = match &self.link.last_failure {
            Some(last) => format!("the last connection broke at {last}"),
            None => "none has come yet".to_owned(),
        };
        Err(DeviceError::Remote {
            peer: self.link.peer.clone(),
            step: step.to_owned(),
            advice: format!(
                "whether `yarp wam-node` runs on the arm's PC: there is no connection, {last}"
            ),
            source: None,
        })
    }

    /// Returns whether a move is in progress or pending.
    pub(super) fn is_moving(&self) -> bool {
        self.moving || self.sending || self.pending.has_move()
    }

    /// Handles a lost or failed connection: like [`close`](Self::close), and the log has the reason, once for each
    /// loss and once for a repeated failure to connect.
    pub(super) fn lose(&mut self, error: &LinkError) {
        let failure = error.to_string();
        if self.link.is_up() || self.link.last_failure.as_ref() != Some(&failure) {
            warn!(peer = %self.link.peer, %error, "the embedded arm is out of reach; it holds by itself");
        }
        self.link.last_failure = Some(failure);
        self.close(error);
    }

    /// No caller waits for a connection, and nothing is executed later.
    pub(super) fn close(&mut self, error: &LinkError) {
        self.link.state = LinkState::Down;
        self.targets = None;
        self.direct.fill(false);
        self.moving = false;
        self.sending = false;
        for order in self.pending.clear() {
            let unsent = LinkError {
                step: format!(
                    "{}, not sent because the connection broke at {}",
                    order.request.kind().step(),
                    error.step
                ),
                cause: error.cause.clone(),
            };
            order.answer(Err(self.link.failed(&unsent)));
        }
    }
}
