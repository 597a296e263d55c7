//! The task that commits changes to the shared store.
//!
//! It has two registries. The *copy*, from which queries are answered, contains what was committed,
//! commit after commit, and nothing else. The *draft* equals the copy between two batches of
//! requests. A batch is tried on the draft and committed on the condition that the last commit is
//! the one that the draft is based on. If the commit succeeds, the copy adopts the changes of the
//! draft. If not, the draft is rolled back to the copy, both apply the commits of other servers,
//! and the batch is tried again. So each batch is applied to the state that all earlier batches of
//! all servers have left, and nothing is handed out twice.
//!
//! If the answer to a commit is lost, the server's mark, which it writes with each commit, shows if
//! the commit was done. The store is loaded again. Either the mark is there; or the generation is
//! unchanged, and the same commit is sent again (at most one of the two can succeed); or another
//! generation rules out that the lost commit still succeeds, and the batch is tried again.

use std::collections::{BTreeSet, VecDeque};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use tokio::sync::mpsc;
use tokio::time::{MissedTickBehavior, interval, timeout};
use yarp_wire::name_service::Kind;

use super::store_format::{self, Content};
use super::writer_channel::{Precondition, StoreHealth, WriteOutcome, WriteRequest};
use super::{Commit, CommitResult, SharedStore, SharedStoreError, Write};
use crate::name_server::lock;
use crate::registry::{Body, ClaimResult, Effect, Item, Lines, Registry, Reply};

/// Maximum number of items that a batch may change: etcd accepts 128 writes per transaction by
/// default.
const MAX_BATCH_ITEMS: usize = 120;
/// Number of items at which no further request joins a batch.
const TARGET_BATCH_ITEMS: usize = 40;
/// Maximum size of a batch, in bytes: etcd accepts 1.5 MiB per transaction by default.
const MAX_BATCH_BYTES: usize = 1 << 20;
/// Interval between two heartbeats.
const HEARTBEAT_INTERVAL: Duration = Duration::from_secs(1);
/// Maximum time until commits arrive that are known to exist.
const CATCH_UP_TIMEOUT: Duration = Duration::from_secs(1);
/// Delay between two attempts to reconnect.
const RECONNECT_DELAY: Duration = Duration::from_millis(200);

/// The task that writes the shared store, before it runs.
pub(crate) struct Writer<T> {
    pub(crate) store: T,
    /// Name of the store, for messages.
    pub(crate) name: String,
    /// Host and TCP port of this server.
    pub(crate) place: (String, u16),
    /// Number of the commit that copy and draft are based on.
    pub(crate) generation: i64,
    pub(crate) copy: Arc<Mutex<Registry>>,
    pub(crate) draft: Registry,
    pub(crate) jobs: mpsc::Receiver<WriteRequest>,
    pub(crate) queue: VecDeque<WriteRequest>,
    pub(crate) health: StoreHealth,
    /// Receives the effects of committed requests.
    pub(crate) on_effects: Box<dyn Fn(Vec<Effect>) + Send>,
    /// Gives a name to any port that asks for it.
    pub(crate) replace: bool,
    /// Number that distinguishes this run of the server from others.
    pub(crate) run: u64,
    /// Number of batches tried in this run.
    pub(crate) attempts: u64,
    /// Number of requests that are still to be tried one by one.
    pub(crate) one_by_one: usize,
}

/// A batch that was tried on the draft.
struct Batch {
    /// Number of the commit that the batch was tried on.
    generation: i64,
    id: String,
    items: BTreeSet<Item>,
    writes: Vec<Write>,
    done: Vec<TriedRequest>,
}

/// One request of a batch.
struct TriedRequest {
    job: WriteRequest,
    outcome: WriteOutcome,
    effects: Vec<Effect>,
}

impl<T: SharedStore> Writer<T> {
    /// Runs until all senders of requests are dropped.
    pub(crate) async fn run(mut self) {
        let mut beat = interval(HEARTBEAT_INTERVAL);
        beat.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            let busy = !self.queue.is_empty();
            let step = tokio::select! {
                () = std::future::ready(()), if busy => self.process_batch().await,
                job = self.jobs.recv(), if !busy => match job {
                    None => break,
                    Some(job) => {
                        self.queue.push_back(job);
                        self.process_batch().await
                    }
                },
                news = self.store.next() => news.map(|commits| self.apply_commits(commits)),
                _ = beat.tick() => self.heartbeat().await,
            };
            if let Err(error) = step {
                self.recover(error, None).await;
            }
        }
        self.store.leave((&self.place.0, self.place.1)).await;
    }

    /// Sends a heartbeat, and catches up with the store.
    async fn heartbeat(&mut self) -> Result<(), SharedStoreError> {
        let asked = Instant::now();
        let heard = self.store.heartbeat((&self.place.0, self.place.1)).await?;
        self.catch_up_to(heard.generation).await?;
        lock(&self.copy).set_others(heard.others);
        self.health.record_success(asked);
        Ok(())
    }

    /// Processes a batch of queued requests.
    async fn process_batch(&mut self) -> Result<(), SharedStoreError> {
        while let Ok(job) = self.jobs.try_recv() {
            self.queue.push_back(job);
        }
        let asked = Instant::now();
        let Some(batch) = self.try_batch() else {
            return Ok(());
        };
        match self.store.commit(batch.generation, &batch.writes).await {
            Ok(CommitResult::Committed(generation)) => {
                self.finish_batch(batch, generation);
                self.health.record_success(asked);
                Ok(())
            }
            Ok(CommitResult::Conflict(generation)) => {
                self.roll_back(batch);
                self.catch_up_to(generation).await
            }
            Err(SharedStoreError::Rejected { place, reason }) => {
                self.reject_batch(batch, format!("{place} rejected the change: {reason}"));
                Ok(())
            }
            Err(error) => {
                self.recover(error, Some(batch)).await;
                Ok(())
            }
        }
    }

    /// Tries a batch of queued requests on the draft; returns `None` if there is nothing to commit.
    fn try_batch(&mut self) -> Option<Batch> {
        self.attempts += 1;
        let mut items = BTreeSet::new();
        let mut done = Vec::new();
        let most = match self.one_by_one {
            0 => usize::MAX,
            _ => 1,
        };
        self.one_by_one = self.one_by_one.saturating_sub(1);
        while items.len() < TARGET_BATCH_ITEMS && done.len() < most {
            let Some(job) = self.queue.pop_front() else {
                break;
            };
            // The client may have given up.
            if job.answer.is_closed() {
                continue;
            }
            let (outcome, effects) = self.try_one(&job, &mut items);
            done.push(TriedRequest {
                job,
                outcome,
                effects,
            });
        }
        if done.is_empty() {
            return None;
        }
        let mut writes: Vec<Write> = items
            .iter()
            .map(|item| store_format::write(item, self.draft.item_value(item).as_ref()))
            .collect();
        let value = |write: &Write| write.value.as_ref().map_or(0, Vec::len);
        let bytes: usize = writes
            .iter()
            .map(|write| write.key.len() + value(write))
            .sum();
        let server = server(&self.place);
        let id = format!("{} {}", self.run, self.attempts);
        let touched = items.len();
        if !writes.is_empty() {
            writes.push(store_format::mark(&server, &id));
        }
        let batch = Batch {
            generation: self.generation,
            id,
            items,
            writes,
            done,
        };
        if touched <= MAX_BATCH_ITEMS && bytes <= MAX_BATCH_BYTES {
            return Some(batch);
        }
        self.reject_batch(
            batch,
            format!(
                "it changes {touched} things in {bytes} bytes at once, {MAX_BATCH_ITEMS} in {MAX_BATCH_BYTES} can be kept"
            ),
        );
        None
    }

    /// Rejects a batch that cannot be committed; if it has several requests, each is tried alone.
    fn reject_batch(&mut self, mut batch: Batch, reason: String) {
        if batch.done.len() > 1 {
            self.one_by_one = batch.done.len();
        } else if let Some(one) = batch.done.pop() {
            // The client may be gone.
            let _ = one.job.answer.send(WriteOutcome::Failed(reason));
        }
        self.roll_back(batch);
    }

    /// Tries one request on the draft.
    fn try_one(
        &mut self,
        job: &WriteRequest,
        items: &mut BTreeSet<Item>,
    ) -> (WriteOutcome, Vec<Effect>) {
        let now = Instant::now();
        let nothing = || WriteOutcome::Done(Body::Lines(Lines::default()));
        let Some(request) = &job.request else {
            return (nothing(), Vec::new());
        };
        match (&job.precondition, request.command.rules().kind) {
            (Precondition::NameFree(gone), Kind::Claim(asked)) if !self.replace => {
                match self.draft.claim(now, job.from, asked) {
                    ClaimResult::Held {
                        holder,
                        retry_until,
                    } if gone.as_ref() != Some(&holder) => {
                        return (
                            WriteOutcome::Held {
                                holder,
                                retry_until,
                            },
                            Vec::new(),
                        );
                    }
                    ClaimResult::Refused(refusal) => {
                        return (WriteOutcome::Refused(refusal), Vec::new());
                    }
                    _ => {}
                }
            }
            (Precondition::Unmoved(port), _)
                if self.draft.find(&port.name).as_ref() != Some(port) =>
            {
                return (nothing(), Vec::new());
            }
            _ => {}
        }
        let Reply {
            body,
            effects,
            changes,
        } = self.draft.handle(now, job.from, request);
        items.extend(changes.iter().map(Item::of));
        (WriteOutcome::Done(body), effects)
    }

    /// Rolls the draft back to the copy and queues the requests again.
    fn roll_back(&mut self, batch: Batch) {
        let now = Instant::now();
        let copy = lock(&self.copy);
        for item in &batch.items {
            self.draft.adopt(now, item, copy.item_value(item));
        }
        drop(copy);
        self.requeue(batch.done);
    }

    fn requeue(&mut self, done: Vec<TriedRequest>) {
        for tried in done.into_iter().rev() {
            self.queue.push_front(tried.job);
        }
    }

    /// Finishes a committed batch: the copy adopts the changes, and all requests are answered.
    fn finish_batch(&mut self, batch: Batch, generation: i64) {
        if !batch.items.is_empty() {
            self.generation = generation;
            let now = Instant::now();
            let mut copy = lock(&self.copy);
            for item in &batch.items {
                // The effects are known from the requests.
                copy.adopt(now, item, self.draft.item_value(item));
            }
        }
        self.answer(batch.done);
    }

    fn answer(&self, done: Vec<TriedRequest>) {
        for TriedRequest {
            job,
            outcome,
            effects,
        } in done
        {
            (self.on_effects)(effects);
            // The client may be gone.
            let _ = job.answer.send(outcome);
        }
    }

    /// Applies commits, most of them by other servers, to copy and draft.
    fn apply_commits(&mut self, commits: Vec<Commit>) {
        for commit in commits {
            // Own commits were applied when they were made.
            if commit.generation <= self.generation {
                continue;
            }
            self.generation = commit.generation;
            let now = Instant::now();
            let read = |write: &Write| store_format::item_of(&write.key, write.value.as_deref());
            let items: Vec<_> = commit.writes.iter().filter_map(read).collect();
            let mut effects = Vec::new();
            let mut copy = lock(&self.copy);
            for (item, held) in items {
                effects.extend(copy.adopt(now, &item, held.clone()));
                self.draft.adopt(now, &item, held);
            }
            drop(copy);
            (self.on_effects)(effects);
        }
    }

    /// Applies commits up to the one numbered `generation`.
    async fn catch_up_to(&mut self, generation: i64) -> Result<(), SharedStoreError> {
        if generation < self.generation {
            // The store was reset to an older state.
            return Err(self.watch_lagged());
        }
        while self.generation < generation {
            let news = timeout(CATCH_UP_TIMEOUT, self.store.next()).await;
            let commits = news.map_err(|_| self.watch_lagged())??;
            self.apply_commits(commits);
        }
        Ok(())
    }

    fn watch_lagged(&self) -> SharedStoreError {
        let place = self.name.clone();
        SharedStoreError::WatchLagged { place }
    }

    /// Reconnects, for as long as it takes, and resolves a batch whose outcome is unknown.
    async fn recover(&mut self, error: SharedStoreError, mut unknown: Option<Batch>) {
        let mut pending_error = Some(error);
        loop {
            if let Some(error) = pending_error.take() {
                if self.health.record_error(error.clone()) {
                    tracing::warn!("names cannot be changed at the moment: {error}");
                }
                tokio::time::sleep(RECONNECT_DELAY).await;
                if self.jobs.is_closed() && self.jobs.is_empty() {
                    return;
                }
            }
            let asked = Instant::now();
            let content = match Content::load(&mut self.store, &self.name).await {
                Ok(content) => content,
                Err(error) => {
                    pending_error = Some(error);
                    continue;
                }
            };
            self.start_from(&content);
            let Some(batch) = unknown.take() else {
                self.health.record_success(asked);
                tracing::info!("names can be changed again");
                return;
            };
            if content.mark(&server(&self.place)) == Some(&batch.id) {
                self.answer(batch.done);
            } else if batch.generation != self.generation || batch.writes.is_empty() {
                self.requeue(batch.done);
            } else if batch.done.iter().all(|tried| tried.job.answer.is_closed()) {
                // No client waits for it, and no client was told that it is done.
            } else {
                match self.store.commit(batch.generation, &batch.writes).await {
                    // The next load shows this commit, or the one that came first.
                    Ok(_) => unknown = Some(batch),
                    Err(SharedStoreError::Rejected { place, reason }) => {
                        self.reject_batch(batch, format!("{place} rejected the change: {reason}"));
                    }
                    Err(error) => {
                        pending_error = Some(error);
                        unknown = Some(batch);
                    }
                }
            }
        }
    }

    /// Resets copy and draft to `content`; the recorded liveness of ports is kept.
    fn start_from(&mut self, content: &Content) {
        let now = Instant::now();
        self.generation = content.generation;
        let changes = content.changes();
        let renew = |registry: &mut Registry, changes| {
            registry.set_incarnation(content.incarnation);
            *registry = registry.rebuilt(now, changes);
        };
        renew(&mut self.draft, changes.clone());
        renew(&mut lock(&self.copy), changes);
    }
}

/// Returns the key of a server's mark.
fn server((host, port): &(String, u16)) -> String {
    format!("{host}:{port}")
}
