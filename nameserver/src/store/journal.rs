//! The thread that writes changes to the store.
//!
//! Concurrent requests are stored in batches: while one batch is written the next one collects. A
//! request is answered after its batch is stored. If a batch cannot be stored, the registry is
//! rebuilt from the store, and all its requests are refused.

use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use tokio::sync::oneshot;

use super::{Store, StoreError};
use crate::name_server::lock;
use crate::registry::{Change, Registry};

/// Changes of one request, with the sender for the result.
struct JournalEntry {
    changes: Vec<Change>,
    /// Runs once the changes are stored.
    then: Box<dyn FnOnce() + Send>,
    kept: oneshot::Sender<Result<(), Arc<StoreError>>>,
}

/// Resolves once the changes of a request are stored or have failed.
pub(crate) type StoreResult = oneshot::Receiver<Result<(), Arc<StoreError>>>;

/// Maximum number of requests in a batch.
const MAX_BATCH_REQUESTS: usize = 1024;
/// Number of requests in a batch from which the next batch waits for more.
const GATHER_THRESHOLD: usize = 3;
/// Time that a batch waits for more requests.
const GATHER_DELAY: Duration = Duration::from_micros(200);
/// Time without a request after which the store may do maintenance.
const MAINTENANCE_IDLE_TIME: Duration = Duration::from_millis(500);

/// Sender to the thread that writes. Dropping it waits until everything is stored.
pub(crate) struct Journal {
    /// `None` once it is closed.
    queue: Option<mpsc::Sender<JournalEntry>>,
    thread: Option<JoinHandle<()>>,
}

impl Journal {
    /// Starts the thread. The registry must equal the content of the store.
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

    /// Queues the changes of one request.
    ///
    /// The caller must hold the lock of the registry that made them, so that they are stored in the
    /// order in which they happened.
    pub(crate) fn append(
        &self,
        changes: Vec<Change>,
        then: impl FnOnce() + Send + 'static,
    ) -> StoreResult {
        let (kept, answer) = oneshot::channel();
        if let Some(queue) = &self.queue {
            // If the thread is gone, the entry is dropped and the receiver reports it.
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
            // A panic there was reported before.
            let _ = thread.join();
        }
    }
}

fn write(
    mut store: impl Store,
    registry: &Mutex<Registry>,
    waiting: &mpsc::Receiver<JournalEntry>,
) {
    // Error because of which the registry has changes that the store lacks; nothing can be stored
    // until they agree again.
    let mut unsaved_error: Option<Arc<StoreError>> = None;
    let mut gather = false;
    while let Some(first) = next(&mut store, waiting) {
        let mut batch = vec![first];
        if gather {
            // Under load, waiting for more requests costs each of them less than a batch of its
            // own.
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
                store.append(&changes).map_err(Arc::new)
            }
        };
        let outcome = match kept {
            Ok(()) => Ok(()),
            Err(error) => {
                tracing::error!("a batch of requests is refused: {error}");
                let mut registry = lock(registry);
                // The registry is locked: requests queued so far are as little stored as the batch.
                batch.extend(waiting.try_iter());
                let kept = registry.rebuilt_with(Instant::now(), |take| store.load(take));
                unsaved_error = match kept {
                    Ok(kept) => {
                        *registry = kept;
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
            // The client may be gone.
            let _ = entry.kept.send(outcome.clone());
        }
    }
    store.maintain();
}

/// Returns the next request, or `None` at the end; runs maintenance if none comes for a while.
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
