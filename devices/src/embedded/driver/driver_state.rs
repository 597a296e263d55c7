//! What callers and the thread of the driver have in common.

use std::sync::atomic::AtomicBool;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use tracing::warn;

use super::DriverOptions;
use super::pending_requests::PendingRequests;
use crate::embedded::CycleStatistics;
use crate::embedded::link_error::LinkError;
use crate::fake::AxesModel;
use crate::{DeviceError, EncoderReading};

/// How the connection to the embedded PC stands.
#[derive(Clone, Debug)]
pub struct LinkStatus {
    /// Whether there is one.
    pub state: LinkState,
    /// Who the other end is or was, in words.
    pub peer: String,
    /// How many connections there have been whose opening succeeded.
    pub sessions: u64,
    /// How often connecting failed or a connection broke.
    pub failures: u64,
    /// Which step that was at last, and why.
    pub last_failure: Option<String>,
    /// Why the last move ended otherwise than at its target.
    pub last_interruption: Option<String>,
    /// How many further connections were closed because there was one.
    pub rejected_connections: u64,
}

/// Whether there is a connection to the embedded PC.
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
    /// Whether there is a connection.
    pub fn is_up(&self) -> bool {
        self.state != LinkState::Down
    }

    /// That a step failed, for the caller who asked for it.
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

/// Where the joints are after a move that was accepted.
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
    /// Where the joints were told to go on this connection, degrees.
    pub(super) targets: Option<Vec<f64>>,
    /// Which joints are given their addresses step by step; none on a new connection.
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

    /// Whether a move is under way, or will be.
    pub(super) fn is_moving(&self) -> bool {
        self.moving || self.sending || self.pending.has_move()
    }

    /// The connection is gone, or none came about: as [`close`](Self::close), and the log has why, once for each loss and
    /// once for what keeps a connection from coming about.
    pub(super) fn lose(&mut self, error: &LinkError) {
        let failure = error.to_string();
        if self.link.is_up() || self.link.last_failure.as_ref() != Some(&failure) {
            warn!(peer = %self.link.peer, %error, "the embedded arm is out of reach; it holds by itself");
        }
        self.link.last_failure = Some(failure);
        self.close(error);
    }

    /// Nobody is kept waiting for a connection, and nothing is carried out later.
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
