//! The way from the desk to the task that writes.

use std::net::IpAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::{mpsc, oneshot};
use yarp_wire::name_service::{Command, Registration, Request};

use super::{SharedStoreError, WRITE_TIMEOUT};
use crate::registry::{Body, Refusal};

/// Requests that may wait.
const MAX_QUEUED_REQUESTS: usize = 4096;

/// A request that changes something.
pub(crate) struct WriteRequest {
    pub(crate) from: Option<IpAddr>,
    /// None for nothing but to come up to date.
    pub(crate) request: Option<Request>,
    pub(crate) precondition: Precondition,
    pub(crate) answer: oneshot::Sender<WriteOutcome>,
}

/// Under which condition a request is done.
#[derive(Clone, Debug)]
pub(crate) enum Precondition {
    /// In any case.
    Always,
    /// If nobody has the name that it wants, or this one, who was found to be gone.
    NameFree(Option<Registration>),
    /// If this port is still where it was.
    Unmoved(Registration),
}

/// What became of a request.
#[derive(Debug)]
pub(crate) enum WriteOutcome {
    /// It is done, and written.
    Done(Body),
    /// Somebody has the name; see [`ClaimResult::Held`](crate::registry::ClaimResult::Held).
    Held {
        holder: Registration,
        retry_until: Option<Instant>,
    },
    /// The name cannot be had.
    Refused(Refusal),
    /// It cannot be written.
    Failed(String),
}

/// How the truth was found last.
#[derive(Debug)]
struct HealthState {
    /// When this server was up to date for the last time.
    last_success: Instant,
    /// What went wrong since.
    last_error: Option<SharedStoreError>,
}

/// What the writing task and the desk have in common.
#[derive(Clone, Debug)]
pub(crate) struct StoreHealth(Arc<Mutex<HealthState>>);

impl StoreHealth {
    fn state(&self) -> MutexGuard<'_, HealthState> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// This server was up to date at some moment after `since`.
    pub(crate) fn record_success(&self, since: Instant) {
        let mut health = self.state();
        health.last_success = health.last_success.max(since);
        health.last_error = None;
    }

    /// Something went wrong; tells whether all was well before.
    pub(crate) fn record_error(&self, error: SharedStoreError) -> bool {
        self.state().last_error.replace(error).is_none()
    }
}

/// The way itself.
pub(crate) struct WriterChannel {
    jobs: mpsc::Sender<WriteRequest>,
    health: StoreHealth,
    /// How long questions are answered without news.
    max_staleness: Duration,
}

impl WriterChannel {
    /// A way whose other end is for the writing task; questions are answered for `patience` without
    /// news.
    pub(crate) fn new(
        max_staleness: Duration,
    ) -> (Self, mpsc::Receiver<WriteRequest>, StoreHealth) {
        let (jobs, waiting) = mpsc::channel(MAX_QUEUED_REQUESTS);
        let health = StoreHealth(Arc::new(Mutex::new(HealthState {
            last_success: Instant::now(),
            last_error: None,
        })));
        let line = Self {
            jobs,
            health: health.clone(),
            max_staleness,
        };
        (line, waiting, health)
    }

    /// Why questions are not answered any more, if that is so.
    pub(crate) fn staleness_error(&self) -> Option<String> {
        let health = self.health.state();
        let age = health.last_success.elapsed();
        if age <= self.max_staleness {
            return None;
        }
        let reason = health.last_error.as_ref().map(ToString::to_string);
        let reason = reason.unwrap_or_else(|| "no answer".to_owned());
        Some(format!("no update for {} s: {reason}", age.as_secs()))
    }

    /// Has a request done, at most until the deadline.
    pub(crate) async fn perform(
        &self,
        from: Option<IpAddr>,
        request: Option<Request>,
        precondition: Precondition,
    ) -> WriteOutcome {
        let (answer, outcome) = oneshot::channel();
        let job = WriteRequest {
            from,
            request,
            precondition,
            answer,
        };
        if self.jobs.try_send(job).is_err() {
            return WriteOutcome::Failed(format!(
                "{MAX_QUEUED_REQUESTS} requests are queued, this one is refused"
            ));
        }
        match tokio::time::timeout(WRITE_TIMEOUT, outcome).await {
            Ok(Ok(outcome)) => outcome,
            Ok(Err(_)) => WriteOutcome::Failed("the server is shutting down".to_owned()),
            Err(_) => {
                let last_error = self.health.state().last_error.clone();
                let reason = match last_error {
                    Some(last_error) => last_error.to_string(),
                    None => "other servers committed first".to_owned(),
                };
                let seconds = WRITE_TIMEOUT.as_secs();
                WriteOutcome::Failed(format!(
                    "not committed within {seconds} s, the outcome is unknown: {reason}"
                ))
            }
        }
    }
}

/// Whether a command may change what servers share.
pub(crate) fn is_change(command: &Command) -> bool {
    matches!(
        command,
        Command::Register(_)
            | Command::Unregister { .. }
            | Command::Set { .. }
            | Command::Announce { .. }
            | Command::Subscribe { .. }
            | Command::Unsubscribe { .. }
            | Command::Topic { .. }
            | Command::Untopic { .. }
            | Command::Type { value: Some(_), .. }
    )
}
