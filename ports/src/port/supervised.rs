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
use super::log;
use super::outbox::Outbox;
use crate::cancel::{Cancel, Cancelled};

/// How a connection is kept up.
#[derive(Clone, Debug, Eq, PartialEq)]
#[non_exhaustive]
pub struct Supervision {
    /// Pause before the first try after a connection was lost; it doubles with each try.
    pub first_pause: Duration,
    /// The pause does not grow beyond this.
    pub longest_pause: Duration,
    /// How long one try may take.
    pub deadline: Duration,
    /// A reader from whose host nothing has been heard for so long, though it was asked or sent
    /// something, is lost: whole seconds count. So is one that has taken nothing of what was
    /// sent for so long. Only TCP connections can tell.
    pub silence: Duration,
}

impl Default for Supervision {
    /// A quarter of a second to ten seconds between tries, each of ten seconds at the most; lost
    /// after twenty seconds of silence.
    fn default() -> Self {
        Self {
            first_pause: Duration::from_millis(250),
            longest_pause: Duration::from_secs(10),
            deadline: Duration::from_secs(10),
            silence: Duration::from_secs(20),
        }
    }
}

impl Supervision {
    /// As many tries as the default.
    pub fn new() -> Self {
        Self::default()
    }

    /// Waits between tries from `first` on, doubling up to `longest`; at least 1 ms.
    ///
    /// Each pause is shortened by up to a quarter of it at random, so that not all who lost a
    /// reader come back at the same moment.
    pub fn pauses(mut self, first: Duration, longest: Duration) -> Self {
        self.first_pause = first;
        self.longest_pause = longest;
        self
    }

    /// Takes a reader for lost after this long a silence; see [`Supervision::silence`].
    pub fn silence(mut self, silence: Duration) -> Self {
        self.silence = silence;
        self
    }

    /// Gives a try up after this long.
    pub fn deadline(mut self, deadline: Duration) -> Self {
        self.deadline = deadline;
        self
    }
}

/// No two tries follow each other more closely.
const SHORTEST: Duration = Duration::from_millis(1);

/// What is the matter with a supervised connection.
#[derive(Clone, Debug, Eq, PartialEq)]
#[non_exhaustive]
pub enum LinkState {
    /// A try is under way, the how manieth since the connection was last up.
    Connecting {
        /// 1 for the first.
        attempt: u32,
    },
    /// It is up.
    Up,
    /// It ended, or could not be made; the next try follows after a pause.
    Lost {
        /// Why.
        reason: Arc<str>,
    },
    /// It is not looked after any more: the port closed.
    Ended,
}

/// A connection that is made again whenever it is lost, for as long as this lives.
///
/// Dropping it ends the connection as well, in the background; [`Supervised::release`] leaves it
/// up. It ends with its port.
#[derive(Debug)]
pub struct Supervised {
    state: watch::Receiver<LinkState>,
    cancel: Cancel,
    /// Whether the connection shall outlive this.
    kept: Arc<AtomicBool>,
    /// Ends by itself, within the goodbye to the reader, once `cancel` is dropped.
    task: JoinHandle<()>,
}

impl Supervised {
    pub(super) fn start(core: Arc<Core>, to: Contact, options: Supervision) -> Self {
        let (sender, state) = watch::channel(LinkState::Connecting { attempt: 1 });
        let (cancel, released) = Cancel::new();
        let kept = Arc::new(AtomicBool::new(false));
        let logs = to.carrier.as_deref().is_some_and(log::is_named);
        let supervisor = Supervisor {
            core,
            logs,
            to,
            options,
            state: sender,
            kept: kept.clone(),
        };
        let task = tokio::spawn(supervisor.run(released));
        Self {
            state,
            cancel,
            kept,
            task,
        }
    }

    /// What is the matter with it now.
    pub fn state(&self) -> LinkState {
        self.state.borrow().clone()
    }

    /// Waits until something changes, and tells what is the matter then. Changes that follow each
    /// other quickly may be seen as one. Cancelling loses nothing.
    pub async fn changed(&mut self) -> LinkState {
        if self.state.changed().await.is_err() {
            return LinkState::Ended;
        }
        self.state.borrow_and_update().clone()
    }

    /// Waits until it is up; `false` if its port closed before.
    pub async fn up(&self) -> bool {
        let mut state = self.state.clone();
        let up = state.wait_for(|state| matches!(state, LinkState::Up | LinkState::Ended));
        up.await.is_ok_and(|state| *state == LinkState::Up)
    }

    /// A receiver of its own for whoever else wants to know of changes.
    pub fn watch(&self) -> watch::Receiver<LinkState> {
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

/// The task behind a [`Supervised`].
struct Supervisor {
    core: Arc<Core>,
    to: Contact,
    /// Whether the connection is one of copies.
    logs: bool,
    options: Supervision,
    state: watch::Sender<LinkState>,
    kept: Arc<AtomicBool>,
}

impl Supervisor {
    async fn run(self, mut released: Cancelled) {
        let mut closing = self.core.closing.clone();
        let mut name = None;
        tokio::select! {
            () = self.keep_up(&mut name) => {}
            () = closing.cancelled() => {}
            () = released.cancelled() => {
                if let Some(name) = name.filter(|_| !self.kept.load(Ordering::Acquire)) {
                    self.core.disconnect(&name).await;
                }
            }
        }
        self.state.send_replace(LinkState::Ended);
    }

    /// Connects, waits for the end, and so on; puts down whom it was connected to.
    async fn keep_up(&self, name: &mut Option<String>) {
        let mut pauses = Pauses::new(&self.options);
        let mut attempt = 1;
        loop {
            self.state.send_replace(LinkState::Connecting { attempt });
            let connecting = self.connect(name);
            let reason = match tokio::time::timeout(self.options.deadline, connecting).await {
                Ok(Ok(outbox)) => {
                    self.state.send_replace(LinkState::Up);
                    let since = Instant::now();
                    let reason = outbox.ended().await;
                    pauses.was_up(since.elapsed());
                    attempt = 0;
                    reason
                }
                Ok(Err(reason)) => reason,
                Err(_) => "it did not answer in time".into(),
            };
            let port = &self.core.name;
            tracing::info!(%port, to = %self.to.name, "no connection: {reason}");
            self.state.send_replace(LinkState::Lost { reason });
            tokio::time::sleep(jittered(pauses.next())).await;
            attempt = attempt.saturating_add(1);
        }
    }

    /// The connection that there is, or else a new one.
    async fn connect(&self, name: &mut Option<String>) -> Result<Arc<Outbox>, Arc<str>> {
        let connected = |name: &str| {
            let outputs = self.core.outputs();
            let mut outputs = outputs.iter();
            let found = outputs.find(|output| output.to == name && output.logs == self.logs)?;
            // Connections that are not TCP cannot.
            let _ = found.socket().give_up_after(self.options.silence);
            Some(found.outbox.clone())
        };
        // Somebody else may have connected the two in the meantime.
        if let Some(outbox) = name.as_deref().and_then(connected) {
            return Ok(outbox);
        }
        let connecting = self.core.connect(&self.to);
        let to = connecting.await.map_err(|error| Arc::from(error.story()))?;
        let to = name.insert(to);
        connected(to).ok_or_else(|| "it ended at once".into())
    }
}

/// The pauses between tries.
struct Pauses {
    next: Duration,
    first: Duration,
    longest: Duration,
}

impl Pauses {
    fn new(options: &Supervision) -> Self {
        let first = options.first_pause.max(SHORTEST);
        Self {
            next: first,
            first,
            longest: options.longest_pause.max(first),
        }
    }

    fn next(&mut self) -> Duration {
        let pause = self.next;
        self.next = (2 * pause).min(self.longest);
        pause
    }

    /// The connection was up for so long. A reader that hangs up at once is not asked any more
    /// often than one that is not there.
    fn was_up(&mut self, time: Duration) {
        if time >= self.next {
            self.next = self.first;
        }
    }
}

/// `pause`, shortened by up to a quarter.
fn jittered(pause: Duration) -> Duration {
    // The keys of each `RandomState` are different and unforeseeable.
    let random = RandomState::new().hash_one(0) as u32;
    pause - (pause / 4).mul_f64(f64::from(random) / f64::from(u32::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_are_shortened_by_a_quarter_at_the_most() {
        let pause = Duration::from_secs(4);
        let pauses: Vec<_> = (0..100).map(|_| jittered(pause)).collect();
        let bounds = Duration::from_secs(3)..=pause;
        assert!(pauses.iter().all(|pause| bounds.contains(pause)));
        assert!(pauses.iter().any(|other| *other != pauses[0]));
    }

    #[test]
    fn pauses_double_up_to_the_longest() {
        let seconds = Duration::from_secs;
        let mut pauses = Pauses::new(&Supervision::new().pauses(seconds(1), seconds(5)));
        assert_eq!(
            [(); 5].map(|()| pauses.next()),
            [1, 2, 4, 5, 5].map(seconds)
        );
        pauses.was_up(seconds(4));
        assert_eq!(pauses.next(), seconds(5));
        pauses.was_up(seconds(5));
        assert_eq!([(); 2].map(|()| pauses.next()), [1, 2].map(seconds));
    }

    #[test]
    fn pauses_are_never_nothing() {
        let mut pauses = Pauses::new(&Supervision::new().pauses(Duration::ZERO, Duration::ZERO));
        pauses.was_up(Duration::ZERO);
        assert_eq!([(); 3].map(|()| pauses.next()), [SHORTEST; 3]);
    }
}
