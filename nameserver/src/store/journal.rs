//! The thread that keeps what changes.
//!
//! Requests of many clients that come at once are kept together: while one batch is written the next
//! gathers. Nobody is answered before the batch is kept. A batch that cannot be kept is taken back:
//! the registry is made again from what the store has, and everybody in it is refused.

use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use tokio::sync::oneshot;

use super::{Store, StoreError};
use crate::name_server::lock;
use crate::registry::{Change, Registry};

/// Changes of one request, and who waits for them.
struct JournalEntry {
    changes: Vec<Change>,
    /// What else the request causes, once it is kept.
    then: Box<dyn FnOnce() + Send>,
    kept: oneshot::Sender<Result<(), Arc<StoreError>>>,
}

/// Resolves once the changes of a request are kept, or cannot be.
pub(crate) type StoreResult = oneshot::Receiver<Result<(), Arc<StoreError>>>;

/// Requests that are kept together at the most.
const MAX_BATCH_REQUESTS: usize = 1024;
/// Requests in one batch from which on the next batch is given time to gather.
const GATHER_THRESHOLD: usize = 3;
/// How long it gathers.
const GATHER_DELAY: Duration = Duration::from_micros(200);
/// The store may tidy up after this long without a request.
const MAINTENANCE_IDLE_TIME: Duration = Duration::from_millis(500);

/// The way to the thread that writes. Dropping it waits until everything is kept.
pub(crate) struct Journal {
    /// None once it is closed.
    queue: Option<mpsc::Sender<JournalEntry>>,
    thread: Option<JoinHandle<()>>,
}

impl Journal {
    /// Starts the thread. The registry must be as the store has it.
    pub(crate) fn start(
        store: impl Store,
        registry: Arc<Mutex<Registry>>,
    ) -> std::io::Result<Self> {
        let (queue, waiting) = mpsc::channel();
        let thread = std::thread::Builder::new()
            .name("names".to_owned())
            .spawn(move || write(store, &registry, &waiting))?;
        Ok(Self {
            queue: Some(queue),
            thread: Some(thread),
        })
    }

    /// Hands over the changes of one request.
    ///
    /// The registry that made them must still be locked: they are kept in the order in which they
    /// happened.
    pub(crate) fn keep(
        &self,
        changes: Vec<Change>,
        then: impl FnOnce() + Send + 'static,
    ) -> StoreResult {
        let (kept, answer) = oneshot::channel();
        if let Some(queue) = &self.queue {
            // A thread that is gone drops the entry, which the waiting end notices.
            let _ = queue.send(JournalEntry {
                changes,
                then: Box::new(then),
                kept,
            });
        }
        answer
    }
}

impl Drop for Journal {
    fn drop(&mut self) {
        self.queue = None;
        if let Some(thread) = self.thread.take() {
            // A panic there has been reported by then.
            let _ = thread.join();
        }
    }
}

fn write(
    mut store: impl Store,
    registry: &Mutex<Registry>,
    waiting: &mpsc::Receiver<JournalEntry>,
) {
    // Why the registry has what the store has not; nothing new can be kept as long as it does.
    let mut unsaved_error: Option<Arc<StoreError>> = None;
    let mut gather = false;
    while let Some(first) = next(&mut store, waiting) {
        let mut batch = vec![first];
        if gather {
            // Many write: waiting for some more of them costs each less than a batch of its own.
            std::thread::sleep(GATHER_DELAY);
        }
        batch.extend(waiting.try_iter().take(MAX_BATCH_REQUESTS - 1));
        gather = batch.len() >= GATHER_THRESHOLD;
        let kept = match &unsaved_error {
            Some(error) => Err(error.clone()),
            None => {
                let changes = batch
                    .iter_mut()
                    .map(|entry| std::mem::take(&mut entry.changes));
                let changes: Vec<Change> = changes.flatten().collect();
                store.keep(&changes).map_err(Arc::new)
            }
        };
        let outcome = match kept {
            Ok(()) => Ok(()),
            Err(error) => {
                tracing::error!("a request is refused: {error}");
                let mut registry = lock(registry);
                // Nobody changes anything now: what has gathered is as little kept as the batch.
                batch.extend(waiting.try_iter());
                unsaved_error = match store.load() {
                    Ok(changes) => {
                        *registry = registry.rebuilt(Instant::now(), changes);
                        None
                    }
                    Err(_) => Some(error.clone()),
                };
                Err(error)
            }
        };
        for entry in batch {
            if outcome.is_ok() {
                (entry.then)();
            }
            // Whoever asked may be gone.
            let _ = entry.kept.send(outcome.clone());
        }
    }
    store.maintain();
}

/// The next request, or none at the end; lets the store tidy up if none comes for a while.
fn next(store: &mut impl Store, waiting: &mpsc::Receiver<JournalEntry>) -> Option<JournalEntry> {
    match waiting.recv_timeout(MAINTENANCE_IDLE_TIME) {
        Ok(entry) => Some(entry),
        Err(RecvTimeoutError::Disconnected) => None,
        Err(RecvTimeoutError::Timeout) => {
            store.maintain();
            waiting.recv().ok()
        }
    }
}
