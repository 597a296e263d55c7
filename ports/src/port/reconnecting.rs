//! Connections that come back.

use std::hash::{BuildHasher, RandomState};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use tokio::sync::watch;
use tokio::task::JoinHandle;
use tokio::time::Instant;
use yarp_wire::Contact;

use super::core::Core;
use super::log_modifier;
use super::send_queue::SendQueue;
use crate::cancel::{Cancel, Cancelled};

/// How a connection is kept up.
#[derive(Clone, Debug, Eq, PartialEq)]
#[non_exhaustive]
pub struct ReconnectOptions {
    /// Pause before the first try after a connection was lost; it doubles with each try.
    pub initial_backoff: Duration,
    /// The pause does not grow beyond this.
    pub max_backoff: Duration,
    /// How long one try may take.
    pub connect_timeout: Duration,
    /// A reader from whose host nothing has been heard for so long, though it was asked or sent
    /// something, is lost: whole seconds count. So is one that has taken nothing of what was
    /// sent for so long. Only TCP connections can tell.
    pub peer_timeout: Duration,
}

impl Default for ReconnectOptions {
    /// A quarter of a second to ten seconds between tries, each of ten seconds at the most; lost
    /// after twenty seconds of silence.
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
    /// As many tries as the default.
    pub fn new() -> Self {
        Self::default()
    }

    /// Waits between tries from `first` on, doubling up to `longest`; at least 1 ms.
    ///
    /// Each pause is shortened by up to a quarter of it at random, so that not all who lost a
    /// reader come back at the same moment.
    pub fn backoff(mut self, first: Duration, longest: Duration) -> Self {
        self.initial_backoff = first;
        self.max_backoff = longest;
        self
    }

    /// Takes a reader for lost after this long a silence; see [`ReconnectOptions::silence`].
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

/// What is the matter with a supervised connection.
#[derive(Clone, Debug, Eq, PartialEq)]
#[non_exhaustive]
pub enum ConnectionState {
    /// A try is under way, the how manieth since the connection was last up.
    Connecting {
        /// 1 for the first.
        attempt: u32,
    },
    /// It is up.
    Connected,
    /// It ended, or could not be made; the next try follows after a pause.
    Disconnected {
        /// Why.
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
    /// Whether the connection shall outlive this.
    kept: Arc<AtomicBool>,
    /// Ends by itself, within the goodbye to the reader, once `cancel` is dropped.
    task: JoinHandle<()>,
}

impl ReconnectingConnection {
    pub(super) fn start(core: Arc<Core>, to: Contact, options: ReconnectOptions) -> Self {
        let (sender, state) = watch::channel(ConnectionState::Connecting { attempt: 1 });
        let (cancel, released) = Cancel::new();
        let kept = Arc::new(AtomicBool::new(false));
        let logs = to.carrier.as_deref().is_some_and(log_modifier::is_named);
        let reconnector = Reconnector {
            core,
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

    /// What is the matter with it now.
    pub fn state(&self) -> ConnectionState {
        self.state.borrow().clone()
    }

    /// Waits until something changes, and tells what is the matter then. Changes that follow each
    /// other quickly may be seen as one. Cancelling loses nothing.
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

    /// A receiver of its own for whoever else wants to know of changes.
    pub fn watch(&self) -> watch::Receiver<ConnectionState> {
        self.state.clone()
    }

    /// Looks after the connection no more, but leaves it up if it is.
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
    core: Arc<Core>,
    to: Contact,
    /// Whether the connection is one of copies.
    logs: bool,
    options: ReconnectOptions,
    state: watch::Sender<ConnectionState>,
    kept: Arc<AtomicBool>,
}

impl Reconnector {
    async fn run(self, mut released: Cancelled) {
        let mut closing = self.core.closing.clone();
        let mut name = None;
        tokio::select! {
            () = self.keep_connected(&mut name) => {}
            () = closing.cancelled() => {}
            () = released.cancelled() => {
                if let Some(name) = name.filter(|_| !self.kept.load(Ordering::Acquire)) {
                    self.core.disconnect(&name).await;
                }
            }
        }
        self.state.send_replace(ConnectionState::Closed);
    }

    /// Connects, waits for the end, and so on; puts down whom it was connected to.
    async fn keep_connected(&self, name: &mut Option<String>) {
        let mut backoff = Backoff::new(&self.options);
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
                    backoff.record_uptime(since.elapsed());
                    attempt = 0;
                    reason
                }
                Ok(Err(reason)) => reason,
                Err(_) => "connecting timed out".into(),
            };
            let port = &self.core.name;
            tracing::info!(%port, to = %self.to.name, "no connection: {reason}");
            self.state
                .send_replace(ConnectionState::Disconnected { reason });
            tokio::time::sleep(jittered(backoff.next())).await;
            attempt = attempt.saturating_add(1);
        }
    }

    /// The connection that there is, or else a new one.
    async fn connect(&self, name: &mut Option<String>) -> Result<Arc<SendQueue>, Arc<str>> {
        let connected = |name: &str| {
            let outputs = self.core.outputs();
            let mut outputs = outputs.iter();
            let found = outputs.find(|output| output.to == name && output.logs == self.logs)?;
            // Connections that are not TCP cannot.
            let _ = found.socket().set_user_timeout(self.options.peer_timeout);
            Some(found.send_queue.clone())
        };
        // Somebody else may have connected the two in the meantime.
        if let Some(send_queue) = name.as_deref().and_then(connected) {
            return Ok(send_queue);
        }
        let connecting = self.core.connect(&self.to);
        let to = connecting
            .await
            .map_err(|error| Arc::from(error.error_chain()))?;
        let to = name.insert(to);
        connected(to).ok_or_else(|| "the connection closed at once".into())
    }
}

/// The pauses between tries.
struct Backoff {
    next: Duration,
    first: Duration,
    longest: Duration,
}

impl Backoff {
    fn new(options: &ReconnectOptions) -> Self {
        let first = options.initial_backoff.max(MIN_BACKOFF);
        Self {
            next: first,
            first,
            longest: options.max_backoff.max(first),
        }
    }

    fn next(&mut self) -> Duration {
        let delay = self.next;
        self.next = (2 * delay).min(self.longest);
        delay
    }

    /// The connection was up for so long. A reader that hangs up at once is not asked any more
    /// often than one that is not there.
    fn record_uptime(&mut self, time: Duration) {
        if time >= self.next {
            self.next = self.first;
        }
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
        let mut backoff = Backoff::new(&ReconnectOptions::new().backoff(seconds(1), seconds(5)));
        assert_eq!(
            [(); 5].map(|()| backoff.next()),
            [1, 2, 4, 5, 5].map(seconds)
        );
        backoff.record_uptime(seconds(4));
        assert_eq!(backoff.next(), seconds(5));
        backoff.record_uptime(seconds(5));
        assert_eq!([(); 2].map(|()| backoff.next()), [1, 2].map(seconds));
    }

    #[test]
    fn backoff_is_never_zero() {
        let mut backoff =
            Backoff::new(&ReconnectOptions::new().backoff(Duration::ZERO, Duration::ZERO));
        backoff.record_uptime(Duration::ZERO);
        assert_eq!([(); 3].map(|()| backoff.next()), [MIN_BACKOFF; 3]);
    }
}
