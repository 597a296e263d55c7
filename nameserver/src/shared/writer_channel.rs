//! Channel from the request handler to the task that writes the shared store.

use std::net::IpAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::{mpsc, oneshot};
use yarp_wire::name_service::{Registration, Request};

use super::{SharedStoreError, WRITE_TIMEOUT};
use crate::registry::{Body, Refusal};

/// Maximum number of queued requests.
const MAX_QUEUED_REQUESTS: usize = 4096;

/// A request that changes something.
pub(crate) struct WriteRequest {
    pub(crate) from: Option<IpAddr>,
    /// Request to process; `None` only catches up with the store.
    pub(crate) request: Option<Request>,
    pub(crate) precondition: Precondition,
    pub(crate) answer: oneshot::Sender<WriteOutcome>,
}

/// Condition under which a request is processed.
#[derive(Clone, Debug)]
pub(crate) enum Precondition {
    /// No condition.
    Always,
    /// The name is free, or held by this port, which a probe found gone.
    NameFree(Option<Registration>),
    /// This port is still registered with this address.
    Unmoved(Registration),
}

/// Outcome of a request.
#[derive(Debug)]
pub(crate) enum WriteOutcome {
    /// The request was processed and committed.
    Done(Body),
    /// Another port has the name; see [`ClaimResult::Held`](crate::registry::ClaimResult::Held).
    Held {
        holder: Registration,
        retry_until: Option<Instant>,
    },
    /// The name cannot be claimed.
    Refused(Refusal),
    /// The change cannot be committed.
    Failed(String),
}

/// State of the connection to the shared store.
#[derive(Debug)]
struct HealthState {
    /// Last time at which this server was up to date.
    last_success: Instant,
    /// Error since then, if any.
    last_error: Option<SharedStoreError>,
}

/// State of the connection to the shared store, known to the writing task and the request handler.
#[derive(Clone, Debug)]
pub(crate) struct StoreHealth(Arc<Mutex<HealthState>>);

impl StoreHealth {
    fn state(&self) -> MutexGuard<'_, HealthState> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Records that this server was up to date at some moment after `since`.
    pub(crate) fn record_success(&self, since: Instant) {
        let mut health = self.state();
        health.last_success = health.last_success.max(since);
        health.last_error = None;
    }

    /// Records an error; returns true if there was none before.
    pub(crate) fn record_error(&self, error: SharedStoreError) -> bool {
        self.state().last_error.replace(error).is_none()
    }
}

/// Sender of requests to the writing task.
pub(crate) struct WriterChannel {
    jobs: mpsc::Sender<WriteRequest>,
    health: StoreHealth,
    /// Maximum age of the copy from which queries are answered.
    max_staleness: Duration,
}

impl WriterChannel {
    /// Creates a channel, and returns it with the receiver and the state for the writing task.
    /// Queries are answered for `max_staleness` without an update.
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

    /// Returns the reason why queries are refused, if the copy is too old.
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

    /// Sends a request and waits for its outcome, at most [`WRITE_TIMEOUT`].
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
