//! The task that has the draft.
//!
//! Two registries: the *copy*, from which questions are answered, holds what was committed, commit
//! after commit, and nothing else. The *draft* is the same between two batches of requests. A batch is
//! tried on the draft and committed under the condition that the commit which the draft is made of is
//! the last one. If so, the copy follows the draft. If not, the draft is taken back to the copy, both
//! follow the commits of the others, and the batch is tried again. So each batch is done on the state
//! that all batches before it, of all servers, have left: nothing is handed out twice.
//!
//! Whether a commit was done whose answer got lost is seen by the server's mark, which it writes with
//! each commit: everything is loaded again, and either the mark is there, or the generation is still
//! the same and the same commit is sent again (of the two at most one can be done), or another
//! generation rules out that the lost one comes after all, and the batch is tried again.

use std::collections::{BTreeSet, VecDeque};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use tokio::sync::mpsc;
use tokio::time::{MissedTickBehavior, interval, timeout};
use yarp_wire::name_service::Command;

use super::content::{self, Content};
use super::line::{Job, May, Outcome, Pulse};
use super::{Commit, Truth, TruthError, Verdict, Write};
use crate::registry::{Body, Claim, Effect, Item, Registry, Reply};
use crate::server::lock;

/// Items that a batch may touch: etcd takes 128 writes at once, unless told otherwise.
const MOST_ITEMS: usize = 120;
/// Items from which on no further request joins a batch.
const ENOUGH_ITEMS: usize = 40;
/// Bytes of a batch: etcd takes 1.5 MiB at once, unless told otherwise.
const MOST_BYTES: usize = 1 << 20;
/// Time between two looks whether we are up to date.
const BEAT: Duration = Duration::from_secs(1);
/// How long news may take to arrive of which it is known that they are there.
const NEWS: Duration = Duration::from_secs(1);
/// Rest between two attempts to get back in touch.
const PAUSE: Duration = Duration::from_millis(200);

/// The task, before it runs.
pub(crate) struct Writer<T> {
    pub(crate) truth: T,
    /// What the truth calls itself, for messages.
    pub(crate) name: String,
    /// Where this server is.
    pub(crate) place: (String, u16),
    /// The number of the commit that copy and draft are made of.
    pub(crate) generation: i64,
    pub(crate) copy: Arc<Mutex<Registry>>,
    pub(crate) draft: Registry,
    pub(crate) jobs: mpsc::Receiver<Job>,
    pub(crate) waiting: VecDeque<Job>,
    pub(crate) pulse: Pulse,
    /// Who is told what else requests cause.
    pub(crate) tell: Box<dyn Fn(Vec<Effect>) + Send>,
    /// Whether names are given to whoever asks.
    pub(crate) replace: bool,
    /// Tells one run of this server from another.
    pub(crate) run: u64,
    /// Batches that were tried in it.
    pub(crate) tried: u64,
    /// Requests to be done one by one.
    pub(crate) single: usize,
}

/// A batch that was tried on the draft.
struct Batch {
    /// The commit that it was tried on.
    generation: i64,
    id: String,
    items: BTreeSet<Item>,
    writes: Vec<Write>,
    done: Vec<Tried>,
}

/// One request of a batch.
struct Tried {
    job: Job,
    outcome: Outcome,
    effects: Vec<Effect>,
}

impl<T: Truth> Writer<T> {
    /// Works until nobody can ask any more.
    pub(crate) async fn run(mut self) {
        let mut beat = interval(BEAT);
        beat.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            let busy = !self.waiting.is_empty();
            let step = tokio::select! {
                () = std::future::ready(()), if busy => self.serve().await,
                job = self.jobs.recv(), if !busy => match job {
                    None => break,
                    Some(job) => {
                        self.waiting.push_back(job);
                        self.serve().await
                    }
                },
                news = self.truth.next() => news.map(|commits| self.follow(commits)),
                _ = beat.tick() => self.beat().await,
            };
            if let Err(error) = step {
                self.recover(error, None).await;
            }
        }
        self.truth.leave((&self.place.0, self.place.1)).await;
    }

    /// Sees that we are up to date, and that the others know of us.
    async fn beat(&mut self) -> Result<(), TruthError> {
        let asked = Instant::now();
        let heard = self.truth.beat((&self.place.0, self.place.1)).await?;
        self.reach(heard.generation).await?;
        lock(&self.copy).set_others(heard.others);
        self.pulse.is_fresh(asked);
        Ok(())
    }

    /// Does some of what waits.
    async fn serve(&mut self) -> Result<(), TruthError> {
        while let Ok(job) = self.jobs.try_recv() {
            self.waiting.push_back(job);
        }
        let asked = Instant::now();
        let Some(batch) = self.attempt() else {
            return Ok(());
        };
        match self.truth.commit(batch.generation, &batch.writes).await {
            Ok(Verdict::Done(generation)) => {
                self.settle(batch, generation);
                self.pulse.is_fresh(asked);
                Ok(())
            }
            Ok(Verdict::Behind(generation)) => {
                self.take_back(batch);
                self.reach(generation).await
            }
            Err(TruthError::Declined { place, reason }) => {
                self.decline(batch, format!("{place} does not take it: {reason}"));
                Ok(())
            }
            Err(error) => {
                self.recover(error, Some(batch)).await;
                Ok(())
            }
        }
    }

    /// Tries some of the waiting requests on the draft; gives none if that did not work out.
    fn attempt(&mut self) -> Option<Batch> {
        self.tried += 1;
        let mut items = BTreeSet::new();
        let mut done = Vec::new();
        let most = match self.single {
            0 => usize::MAX,
            _ => 1,
        };
        self.single = self.single.saturating_sub(1);
        while items.len() < ENOUGH_ITEMS && done.len() < most {
            let Some(job) = self.waiting.pop_front() else {
                break;
            };
            // Who asked may have given up.
            if job.answer.is_closed() {
                continue;
            }
            let (outcome, effects) = self.try_one(&job, &mut items);
            done.push(Tried {
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
            .map(|item| content::write(item, self.draft.held(item).as_ref()))
            .collect();
        let value = |write: &Write| write.value.as_ref().map_or(0, Vec::len);
        let bytes: usize = writes
            .iter()
            .map(|write| write.key.len() + value(write))
            .sum();
        let server = server(&self.place);
        let id = format!("{} {}", self.run, self.tried);
        let touched = items.len();
        if !writes.is_empty() {
            writes.push(content::mark(&server, &id));
        }
        let batch = Batch {
            generation: self.generation,
            id,
            items,
            writes,
            done,
        };
        if touched <= MOST_ITEMS && bytes <= MOST_BYTES {
            return Some(batch);
        }
        self.decline(
            batch,
            format!(
                "it changes {touched} things in {bytes} bytes at once, {MOST_ITEMS} in {MOST_BYTES} can be kept"
            ),
        );
        None
    }

    /// The batch cannot be kept; if it is of several requests, each is tried by itself.
    fn decline(&mut self, mut batch: Batch, reason: String) {
        if batch.done.len() > 1 {
            self.single = batch.done.len();
        } else if let Some(one) = batch.done.pop() {
            // Who asked may be gone.
            let _ = one.job.answer.send(Outcome::Failed(reason));
        }
        self.take_back(batch);
    }

    /// Tries one request on the draft.
    fn try_one(&mut self, job: &Job, items: &mut BTreeSet<Item>) -> (Outcome, Vec<Effect>) {
        let now = Instant::now();
        let nothing = || Outcome::Done(Body::Lines(Vec::new()));
        let Some(request) = &job.request else {
            return (nothing(), Vec::new());
        };
        match (&job.may, &request.command) {
            (May::Displace(gone), Command::Register(asked)) if !self.replace => {
                match self.draft.claim(now, asked) {
                    Claim::Held { holder, patience } if gone.as_ref() != Some(&holder) => {
                        return (Outcome::Held { holder, patience }, Vec::new());
                    }
                    Claim::Refused(refusal) => return (Outcome::Refused(refusal), Vec::new()),
                    _ => {}
                }
            }
            (May::Drop(port), _) if self.draft.find(&port.name).as_ref() != Some(port) => {
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
        (Outcome::Done(body), effects)
    }

    /// Takes the draft back to the copy; the requests wait again.
    fn take_back(&mut self, batch: Batch) {
        let now = Instant::now();
        let copy = lock(&self.copy);
        for item in &batch.items {
            self.draft.adopt(now, item, copy.held(item));
        }
        drop(copy);
        self.wait_again(batch.done);
    }

    fn wait_again(&mut self, done: Vec<Tried>) {
        for tried in done.into_iter().rev() {
            self.waiting.push_front(tried.job);
        }
    }

    /// The batch is committed: the copy follows the draft, and everybody is answered.
    fn settle(&mut self, batch: Batch, generation: i64) {
        if !batch.items.is_empty() {
            self.generation = generation;
            let now = Instant::now();
            let mut copy = lock(&self.copy);
            for item in &batch.items {
                // What else it causes is known from the requests.
                copy.adopt(now, item, self.draft.held(item));
            }
        }
        self.answer(batch.done);
    }

    fn answer(&self, done: Vec<Tried>) {
        for Tried {
            job,
            outcome,
            effects,
        } in done
        {
            (self.tell)(effects);
            // Who asked may be gone.
            let _ = job.answer.send(outcome);
        }
    }

    /// Follows commits, most of them of others.
    fn follow(&mut self, commits: Vec<Commit>) {
        for commit in commits {
            // Our own were followed when they were made.
            if commit.generation <= self.generation {
                continue;
            }
            self.generation = commit.generation;
            let now = Instant::now();
            let read = |write: &Write| content::item_of(&write.key, write.value.as_deref());
            let items: Vec<_> = commit.writes.iter().filter_map(read).collect();
            let mut effects = Vec::new();
            let mut copy = lock(&self.copy);
            for (item, held) in items {
                effects.extend(copy.adopt(now, &item, held.clone()));
                self.draft.adopt(now, &item, held);
            }
            drop(copy);
            (self.tell)(effects);
        }
    }

    /// Follows commits until the one called `generation`.
    async fn reach(&mut self, generation: i64) -> Result<(), TruthError> {
        if generation < self.generation {
            // Somebody has put an old state back.
            return Err(self.silent());
        }
        while self.generation < generation {
            let news = timeout(NEWS, self.truth.next()).await;
            let commits = news.map_err(|_| self.silent())??;
            self.follow(commits);
        }
        Ok(())
    }

    fn silent(&self) -> TruthError {
        let place = self.name.clone();
        TruthError::Silent { place }
    }

    /// Gets back in touch, however long that takes, and sees to a batch of which nothing is known.
    async fn recover(&mut self, error: TruthError, mut unknown: Option<Batch>) {
        let mut trouble = Some(error);
        loop {
            if let Some(error) = trouble.take() {
                if self.pulse.is_in_trouble(error.clone()) {
                    tracing::warn!("no names can be changed at the moment: {error}");
                }
                tokio::time::sleep(PAUSE).await;
                if self.jobs.is_closed() && self.jobs.is_empty() {
                    return;
                }
            }
            let asked = Instant::now();
            let content = match Content::load(&mut self.truth, &self.name).await {
                Ok(content) => content,
                Err(error) => {
                    trouble = Some(error);
                    continue;
                }
            };
            self.start_from(&content);
            let Some(batch) = unknown.take() else {
                self.pulse.is_fresh(asked);
                tracing::info!("names can be changed");
                return;
            };
            if content.mark(&server(&self.place)) == Some(&batch.id) {
                self.answer(batch.done);
            } else if batch.generation != self.generation || batch.writes.is_empty() {
                self.wait_again(batch.done);
            } else if batch.done.iter().all(|tried| tried.job.answer.is_closed()) {
                // Nobody waits for it any more, nobody was told that it is done.
            } else {
                match self.truth.commit(batch.generation, &batch.writes).await {
                    // The next look shows it, or what came first.
                    Ok(_) => unknown = Some(batch),
                    Err(TruthError::Declined { place, reason }) => {
                        self.decline(batch, format!("{place} does not take it: {reason}"));
                    }
                    Err(error) => {
                        trouble = Some(error);
                        unknown = Some(batch);
                    }
                }
            }
        }
    }

    /// Copy and draft as everything is now; what is known of who lives stays.
    fn start_from(&mut self, content: &Content) {
        let now = Instant::now();
        self.generation = content.generation;
        let changes = content.changes();
        let renew = |registry: &mut Registry, changes| {
            registry.set_incarnation(content.incarnation);
            *registry = registry.again(now, changes);
        };
        renew(&mut self.draft, changes.clone());
        renew(&mut lock(&self.copy), changes);
    }
}

/// What a server is called by its mark.
fn server((host, port): &(String, u16)) -> String {
    format!("{host}:{port}")
}
