//! Connections that reconnect.

use std::hash::{BuildHasher, RandomState};
use std::iter::Peekable;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use backon::{BackoffBuilder, ExponentialBackoff, ExponentialBuilder};
use tokio::sync::watch;
use tokio::task::JoinHandle;
use tokio::time::Instant;
use yarp_wire::Contact;

use super::log_modifier;
use super::port_parts::Parts;
use super::send_queue::SendQueue;
use crate::cancel::{Cancel, Cancelled};
use crate::log_text::printable;

/// Options of a reconnecting connection.
#[derive(Clone, Debug, Eq, PartialEq)]
#[non_exhaustive]
pub struct ReconnectOptions {
    /// Pause before the first try after a connection was lost; it doubles with each try.
    pub initial_backoff: Duration,
    /// The pause does not grow beyond this.
    pub max_backoff: Duration,
    /// Timeout of one attempt.
    pub connect_timeout: Duration,
    /// A connection is lost if its host has answered nothing for this long, or has accepted no data
    /// for this long; in whole seconds. Only TCP connections support it.
    pub peer_timeout: Duration,
}

impl Default for ReconnectOptions {
    /// Backoff of a quarter of a second to ten seconds, timeout of ten seconds per attempt, and of
    /// twenty seconds for an unresponsive host.
    fn default() -> Self {
        Self {
            initial_backoff: Duration::from_millis(250),
            max_backoff: Duration::from_secs(10),
            connect_timeout: Duration::from_secs(10),
            peer_timeout: Duration::from_secs(20),
        }
    }
}

impl ReconnectOptions {
    /// Creates the default options.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets the backoff between attempts: from `first`, doubling up to `longest`; at least 1 ms.
    ///
    /// Each delay is shortened at random by up to a quarter, so that the writers of a lost reader
    /// do not reconnect simultaneously.
    pub fn backoff(mut self, first: Duration, longest: Duration) -> Self {
        self.initial_backoff = first;
        self.max_backoff = longest;
        self
    }

    /// Sets the timeout of an unresponsive host; see [`ReconnectOptions::peer_timeout`].
    pub fn peer_timeout(mut self, timeout: Duration) -> Self {
        self.peer_timeout = timeout;
        self
    }

    /// Gives a try up after this long.
    pub fn connect_timeout(mut self, timeout: Duration) -> Self {
        self.connect_timeout = timeout;
        self
    }
}

/// No two tries follow each other more closely.
const MIN_BACKOFF: Duration = Duration::from_millis(1);

/// The state of a reconnecting connection.
#[derive(Clone, Debug, Eq, PartialEq)]
#[non_exhaustive]
pub enum ConnectionState {
    /// An attempt is under way: its number since the last connected state.
    Connecting {
        /// 1 for the first.
        attempt: u32,
    },
    /// It is up.
    Connected,
    /// It ended, or could not be made; the next try follows after a pause.
    Disconnected {
        /// The reason.
        reason: Arc<str>,
    },
    /// It is not looked after any more: the port closed.
    Closed,
}

/// A connection that is made again whenever it is lost, for as long as this lives.
///
/// Dropping it ends the connection as well, in the background; [`ReconnectingConnection::release`] leaves it
/// up. It ends with its port.
#[derive(Debug)]
pub struct ReconnectingConnection {
    state: watch::Receiver<ConnectionState>,
    cancel: Cancel,
    /// `true` if the connection outlives this value.
    kept: Arc<AtomicBool>,
    /// Ends by itself, after closing the connection, once `cancel` is dropped.
    task: JoinHandle<()>,
}

impl ReconnectingConnection {
    pub(super) fn start(parts: Arc<Parts>, to: Contact, options: ReconnectOptions) -> Self {
        let (sender, state) = watch::channel(ConnectionState::Connecting { attempt: 1 });
        let (cancel, released) = Cancel::new();
        let kept = Arc::new(AtomicBool::new(false));
        let logs = to.carrier.as_deref().is_some_and(log_modifier::is_named);
        let reconnector = Reconnector {
            parts,
            logs,
            to,
            options,
            state: sender,
            kept: kept.clone(),
        };
        let task = tokio::spawn(reconnector.run(released));
        Self {
            state,
            cancel,
            kept,
            task,
        }
    }

    /// Returns the current state.
    pub fn state(&self) -> ConnectionState {
        self.state.borrow().clone()
    }

    /// Waits for a change of the state and returns the new state. Changes in quick succession may
    /// be seen as one. Safe to cancel.
    pub async fn changed(&mut self) -> ConnectionState {
        if self.state.changed().await.is_err() {
            return ConnectionState::Closed;
        }
        self.state.borrow_and_update().clone()
    }

    /// Waits until it is up; `false` if its port closed before.
    pub async fn connected(&self) -> bool {
        let mut state = self.state.clone();
        let up = state.wait_for(|state| {
            matches!(state, ConnectionState::Connected | ConnectionState::Closed)
        });
        up.await
            .is_ok_and(|state| *state == ConnectionState::Connected)
    }

    /// Returns an independent receiver of state changes.
    pub fn watch(&self) -> watch::Receiver<ConnectionState> {
        self.state.clone()
    }

    /// Stops reconnecting, but leaves an established connection open.
    pub fn release(self) {
        self.kept.store(true, Ordering::Release);
    }

    /// Ends the connection and waits until it has ended: about a second at the most.
    pub async fn end(self) {
        self.cancel.cancel();
        // A task that panicked has ended, too.
        let _ = self.task.await;
    }
}

/// The task behind a [`ReconnectingConnection`].
struct Reconnector {
    parts: Arc<Parts>,
    to: Contact,
    /// `true` if the connection carries copies.
    logs: bool,
    options: ReconnectOptions,
    state: watch::Sender<ConnectionState>,
    kept: Arc<AtomicBool>,
}

impl Reconnector {
    async fn run(self, mut released: Cancelled) {
        let mut closing = self.parts.context.closing.clone();
        let mut name = None;
        tokio::select! {
            () = self.keep_connected(&mut name) => {}
            () = closing.cancelled() => {}
            () = released.cancelled() => {
                if let Some(name) = name.filter(|_| !self.kept.load(Ordering::Acquire)) {
                    self.parts.connections.disconnect(&name).await;
                }
            }
        }
        self.state.send_replace(ConnectionState::Closed);
    }

    /// Connects, waits for the end, and so on; puts down whom it was connected to.
    async fn keep_connected(&self, name: &mut Option<String>) {
        let mut pauses = backoff(&self.options);
        let mut attempt = 1;
        loop {
            self.state
                .send_replace(ConnectionState::Connecting { attempt });
            let connecting = self.connect(name);
            let reason = match tokio::time::timeout(self.options.connect_timeout, connecting).await
            {
                Ok(Ok(send_queue)) => {
                    self.state.send_replace(ConnectionState::Connected);
                    let since = Instant::now();
                    let reason = send_queue.ended().await;
                    pauses = backoff_after(since.elapsed(), pauses, &self.options);
                    attempt = 0;
                    reason
                }
                Ok(Err(reason)) => reason,
                Err(_) => "connecting timed out".into(),
            };
            let port = &self.parts.context.name;
            tracing::info!(%port, to = %printable(&self.to.name), "no connection: {}", printable(&reason));
            self.state
                .send_replace(ConnectionState::Disconnected { reason });
            let pause = pauses.next().expect("attempts are not limited");
            tokio::time::sleep(jittered(pause)).await;
            attempt = attempt.saturating_add(1);
        }
    }

    /// Returns the connection that there is, or else a new one.
    async fn connect(&self, name: &mut Option<String>) -> Result<Arc<SendQueue>, Arc<str>> {
        let connected = |name: &str| {
            let outputs = self.parts.connections.outputs();
            let mut outputs = outputs.iter();
            let found = outputs.find(|output| output.to == name && output.logs == self.logs)?;
            // Connections that are not TCP cannot.
            let _ = found.socket().set_user_timeout(self.options.peer_timeout);
            Some(found.send_queue.clone())
        };
        // Another program may have connected the two in the meantime.
        if let Some(send_queue) = name.as_deref().and_then(connected) {
            return Ok(send_queue);
        }
        let connecting = self.parts.connector.connect(&self.to);
        let to = connecting
            .await
            .map_err(|error| Arc::from(error.error_chain()))?;
        let to = name.insert(to);
        connected(to).ok_or_else(|| "the connection closed at once".into())
    }
}

/// Returns the pauses between attempts.
fn backoff(options: &ReconnectOptions) -> Peekable<ExponentialBackoff> {
    let first = options.initial_backoff.max(MIN_BACKOFF);
    ExponentialBuilder::new()
        .with_min_delay(first)
        .with_max_delay(options.max_backoff.max(first))
        .without_max_times()
        .build()
        .peekable()
}

/// Returns the pauses after a connection that was open for this long. A reader that closes connections at once is retried no more
/// often than an unreachable one.
fn backoff_after(
    uptime: Duration,
    mut pauses: Peekable<ExponentialBackoff>,
    options: &ReconnectOptions,
) -> Peekable<ExponentialBackoff> {
    match pauses.peek().is_some_and(|pause| uptime >= *pause) {
        true => backoff(options),
        false => pauses,
    }
}

/// `pause`, shortened by up to a quarter.
fn jittered(delay: Duration) -> Duration {
    // The keys of each `RandomState` are different and unforeseeable.
    let random = RandomState::new().hash_one(0) as u32;
    delay - (delay / 4).mul_f64(f64::from(random) / f64::from(u32::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn backoff_is_shortened_by_a_quarter_at_most() {
        let delay = Duration::from_secs(4);
        let backoff: Vec<_> = (0..100).map(|_| jittered(delay)).collect();
        let bounds = Duration::from_secs(3)..=delay;
        assert!(backoff.iter().all(|delay| bounds.contains(delay)));
        assert!(backoff.iter().any(|other| *other != backoff[0]));
    }

    #[test]
    fn backoff_doubles_up_to_its_maximum() {
        let seconds = Duration::from_secs;
        let options = ReconnectOptions::new().backoff(seconds(1), seconds(5));
        let mut pauses = backoff(&options);
        let first: Vec<_> = pauses.by_ref().take(5).collect();
        assert_eq!(first, [1, 2, 4, 5, 5].map(seconds));
        let mut pauses = backoff_after(seconds(4), pauses, &options);
        assert_eq!(pauses.next(), Some(seconds(5)));
        let pauses = backoff_after(seconds(5), pauses, &options);
        let anew: Vec<_> = pauses.take(2).collect();
        assert_eq!(anew, [1, 2].map(seconds));
    }

    #[test]
    fn backoff_is_never_zero() {
        let options = ReconnectOptions::new().backoff(Duration::ZERO, Duration::ZERO);
        let pauses = backoff_after(Duration::ZERO, backoff(&options), &options);
        let pauses: Vec<_> = pauses.take(3).collect();
        assert_eq!(pauses, [MIN_BACKOFF; 3]);
    }
}
