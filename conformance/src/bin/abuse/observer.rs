//! A client that does nothing wrong: calls the arm and reads its state.

use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use tokio::task::JoinSet;

use yarp_client::Queue;
use yarp_client::asynchronous::Subscriber;
use yarp_ports::{Port, PortOptions};
use yarp_wire::Bottle;

use crate::Failure;
use crate::victim::Victim;

/// Interval between two calls.
const CALL_INTERVAL: Duration = Duration::from_millis(2);
/// Time after which a call has failed.
const CALL_TIMEOUT: Duration = Duration::from_secs(5);
/// Messages of the state stream that may wait to be counted.
const BACKLOG: usize = 10_000;

/// Figures of the time between [`Observer::begin`] and [`Observer::finish`].
pub(crate) struct Seen {
    pub(crate) p50: Duration,
    pub(crate) p99: Duration,
    pub(crate) max: Duration,
    pub(crate) failed: usize,
    pub(crate) messages: usize,
    pub(crate) lost: i64,
    /// Longest time without a message of the state stream.
    pub(crate) pause: Duration,
    /// Time that was observed.
    pub(crate) time: Duration,
}

struct Counts {
    begin: Instant,
    last_arrival: Instant,
    pause: Duration,
    round_trips: Vec<Duration>,
    failed: usize,
    messages: usize,
    lost: i64,
    last: Option<i32>,
}

impl Counts {
    fn new(last: Option<i32>) -> Self {
        let now = Instant::now();
        Self {
            begin: now,
            last_arrival: now,
            pause: Duration::ZERO,
            round_trips: Vec::new(),
            failed: 0,
            messages: 0,
            lost: 0,
            last,
        }
    }

    /// Ends the pause since the last message of the stream.
    fn end_pause(&mut self) {
        let now = Instant::now();
        self.pause = self.pause.max(now - self.last_arrival);
        self.last_arrival = now;
    }

    /// Adds a call, which may have failed.
    fn add(&mut self, round_trip: Option<Duration>) {
        match round_trip {
            Some(time) => self.round_trips.push(time),
            None => self.failed += 1,
        }
    }
}

pub(crate) struct Observer {
    counts: Arc<Mutex<Counts>>,
    tasks: JoinSet<()>,
}

impl Observer {
    /// Connects to the arm's ports and begins to call and read.
    pub(crate) async fn connect(victim: &Victim) -> Result<Self, Failure> {
        let network = victim.network();
        let caller = Port::open(&network, "...", PortOptions::new().rpc_client()).await?;
        caller.connect("/wam/rpc:i").await?;
        let state = Subscriber::open_on(&network, "/abuse/state:i", Queue::Wait(BACKLOG)).await?;
        state.connect("/wam/stateExt:o").await?;
        let counts = Arc::new(Mutex::new(Counts::new(None)));
        let mut tasks = JoinSet::new();
        tasks.spawn(call(caller, Arc::clone(&counts)));
        tasks.spawn(read(state, Arc::clone(&counts)));
        Ok(Self { counts, tasks })
    }

    /// Forgets what was counted.
    pub(crate) fn begin(&self) {
        let mut counts = self.counts.lock().unwrap();
        *counts = Counts::new(counts.last);
    }

    /// Returns the figures since [`Self::begin`], and disconnects.
    pub(crate) async fn finish(mut self) -> Seen {
        self.tasks.shutdown().await;
        let mut counts = self.counts.lock().unwrap();
        counts.end_pause();
        counts.round_trips.sort_unstable();
        let at = |part: f64| {
            let last = counts.round_trips.len().saturating_sub(1);
            let index = (last as f64 * part).round() as usize;
            let time = counts.round_trips.get(index);
            time.copied().unwrap_or(Duration::MAX)
        };
        Seen {
            p50: at(0.5),
            p99: at(0.99),
            max: at(1.0),
            failed: counts.failed,
            messages: counts.messages,
            lost: counts.lost,
            pause: counts.pause,
            time: counts.last_arrival - counts.begin,
        }
    }
}

/// Calls the arm until the task is aborted.
async fn call(caller: Port, counts: Arc<Mutex<Counts>>) {
    let request = Bottle::parse("[get] [encs]").unwrap_or_default();
    loop {
        let start = Instant::now();
        let reply = caller.call_within::<Bottle>(&request, CALL_TIMEOUT).await;
        counts
            .lock()
            .unwrap()
            .add(reply.map(|_| start.elapsed()).ok());
        tokio::time::sleep(CALL_INTERVAL).await;
    }
}

/// Counts the messages of the state stream until the task is aborted.
async fn read(state: Subscriber<Bottle>, counts: Arc<Mutex<Counts>>) {
    while let Ok(received) = state.receive().await {
        let mut counts = counts.lock().unwrap();
        counts.messages += 1;
        counts.end_pause();
        let Some(stamp) = received.stamp else {
            continue;
        };
        if let Some(last) = counts.last.replace(stamp.count) {
            counts.lost += i64::from(stamp.count) - i64::from(last) - 1;
        }
    }
}
