//! The way from the desk to the task that writes.

use std::net::IpAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::{mpsc, oneshot};
use yarp_wire::name_service::{Command, Registration, Request};

use super::{DEADLINE, TruthError};
use crate::registry::{Body, Refusal};

/// Requests that may wait.
const JOBS: usize = 4096;

/// A request that changes something.
pub(crate) struct Job {
    pub(crate) from: Option<IpAddr>,
    /// None for nothing but to come up to date.
    pub(crate) request: Option<Request>,
    pub(crate) may: May,
    pub(crate) answer: oneshot::Sender<Outcome>,
}

/// Under which condition a request is done.
#[derive(Clone, Debug)]
pub(crate) enum May {
    /// In any case.
    Always,
    /// If nobody has the name that it wants, or this one, who was found to be gone.
    Displace(Option<Registration>),
    /// If this port is still where it was.
    Drop(Registration),
}

/// What became of a request.
#[derive(Debug)]
pub(crate) enum Outcome {
    /// It is done, and written.
    Done(Body),
    /// Somebody has the name; see [`Claim::Held`](crate::registry::Claim::Held).
    Held {
        holder: Registration,
        patience: Option<Instant>,
    },
    /// The name cannot be had.
    Refused(Refusal),
    /// It cannot be written.
    Failed(String),
}

/// How the truth was found last.
#[derive(Debug)]
struct Health {
    /// When this server was up to date for the last time.
    fresh: Instant,
    /// What went wrong since.
    trouble: Option<TruthError>,
}

/// What the writing task and the desk have in common.
#[derive(Clone, Debug)]
pub(crate) struct Pulse(Arc<Mutex<Health>>);

impl Pulse {
    fn health(&self) -> MutexGuard<'_, Health> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// This server was up to date at some moment after `since`.
    pub(crate) fn is_fresh(&self, since: Instant) {
        let mut health = self.health();
        health.fresh = health.fresh.max(since);
        health.trouble = None;
    }

    /// Something went wrong; tells whether all was well before.
    pub(crate) fn is_in_trouble(&self, error: TruthError) -> bool {
        self.health().trouble.replace(error).is_none()
    }
}

/// The way itself.
pub(crate) struct Line {
    jobs: mpsc::Sender<Job>,
    pulse: Pulse,
    /// How long questions are answered without news.
    patience: Duration,
}

impl Line {
    /// A way whose other end is for the writing task; questions are answered for `patience` without
    /// news.
    pub(crate) fn new(patience: Duration) -> (Self, mpsc::Receiver<Job>, Pulse) {
        let (jobs, waiting) = mpsc::channel(JOBS);
        let pulse = Pulse(Arc::new(Mutex::new(Health {
            fresh: Instant::now(),
            trouble: None,
        })));
        let line = Self {
            jobs,
            pulse: pulse.clone(),
            patience,
        };
        (line, waiting, pulse)
    }

    /// Why questions are not answered any more, if that is so.
    pub(crate) fn is_stale(&self) -> Option<String> {
        let health = self.pulse.health();
        let age = health.fresh.elapsed();
        if age <= self.patience {
            return None;
        }
        let reason = health.trouble.as_ref().map(ToString::to_string);
        let reason = reason.unwrap_or_else(|| "no answer".to_owned());
        Some(format!("no news for {} s: {reason}", age.as_secs()))
    }

    /// Has a request done, at most until the deadline.
    pub(crate) async fn perform(
        &self,
        from: Option<IpAddr>,
        request: Option<Request>,
        may: May,
    ) -> Outcome {
        let (answer, outcome) = oneshot::channel();
        let job = Job {
            from,
            request,
            may,
            answer,
        };
        if self.jobs.try_send(job).is_err() {
            return Outcome::Failed(format!("{JOBS} requests are waiting, this one is not done"));
        }
        match tokio::time::timeout(DEADLINE, outcome).await {
            Ok(Ok(outcome)) => outcome,
            Ok(Err(_)) => Outcome::Failed("it is ending".to_owned()),
            Err(_) => {
                let trouble = self.pulse.health().trouble.clone();
                let reason = match trouble {
                    Some(trouble) => trouble.to_string(),
                    None => "others are faster".to_owned(),
                };
                let seconds = DEADLINE.as_secs();
                Outcome::Failed(format!(
                    "not kept within {seconds} s, it may be done or not: {reason}"
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
