//! Queries all ports for their connections, in rounds, while a browser shows the page.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::sync::{Notify, watch};
use tokio::task::{JoinError, JoinSet};
use tokio::time::Instant;
use yarp_ports::{Endpoint, Network};
use yarp_wire::name_service::Registration;

use super::port_query::{self, ConnectionCounters, PortReport, Process};
use crate::name_request_handler::RequestHandler;
use crate::prober::probe_connected;

/// Settings of the survey.
#[derive(Clone, Debug)]
pub(crate) struct Settings {
    /// Interval between two rounds; `None` disables the survey.
    pub(crate) interval: Option<Duration>,
    /// Network through which the ports are queried; its timeout bounds each step of a query.
    pub(crate) network: Network,
}

/// Maximum number of concurrent queries.
const MAX_CONCURRENT_QUERIES: usize = 16;
/// Maximum duration of a query, in timeouts of a step.
const MAX_STEPS: u32 = 4;
/// Maximum delay before a port is queried again that did not answer; the delay doubles from failure
/// to failure.
const MAX_RETRY_DELAY: Duration = Duration::from_secs(60);

/// Last reports of all ports.
#[derive(Debug)]
pub(crate) struct Survey {
    settings: Settings,
    /// Notified when a browser requests data.
    wanted: Notify,
    /// Number of completed rounds.
    rounds: watch::Sender<u64>,
    records: Mutex<HashMap<String, PortRecord>>,
}

/// A queried port, and its report if it answered.
type QueriedPort = (Endpoint, Option<PortReport>);

/// Last report of one port.
#[derive(Debug)]
pub(super) struct PortRecord {
    /// Address at which it was queried; another address is another port.
    place: Endpoint,
    pub(super) process: Option<Process>,
    pub(super) links: Vec<Measured>,
    /// Time of the report.
    at: Instant,
    /// Time from which the port may be queried again.
    due: Instant,
    /// Number of failures since the last answer.
    failures: u32,
}

/// A connection with its rates.
#[derive(Clone, Debug)]
pub(super) struct Measured {
    pub(super) link: port_query::ReportedConnection,
    /// Rates since the previous round, if the port counts.
    pub(super) rate: Option<Rate>,
}

/// Messages and bytes per second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rate {
    pub(super) messages: f64,
    pub(super) bytes: f64,
}

impl Survey {
    pub(crate) fn new(settings: Settings) -> Self {
        Self {
            settings,
            wanted: Notify::new(),
            rounds: watch::Sender::new(0),
            records: Mutex::default(),
        }
    }

    /// Requests a round, and waits for the end of the first one, at most for `wait`.
    pub(super) async fn request_round(&self, wait: Duration) {
        if self.settings.interval.is_none() {
            return;
        }
        self.wanted.notify_one();
        let mut rounds = self.rounds.subscribe();
        let first = rounds.wait_for(|rounds| *rounds > 0);
        // The reports known by then are shown in any case.
        let _ = tokio::time::timeout(wait, first).await;
    }

    /// Returns the interval between two rounds.
    pub(super) fn interval(&self) -> Option<Duration> {
        self.settings.interval
    }

    /// Returns the number of completed rounds.
    pub(super) fn rounds(&self) -> u64 {
        *self.rounds.borrow()
    }

    /// Returns the reports, by name of the port.
    pub(super) fn records(&self) -> MutexGuard<'_, HashMap<String, PortRecord>> {
        self.records.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Runs requested rounds forever.
    pub(crate) async fn run(self: Arc<Self>, request_handler: Arc<RequestHandler>) {
        let Some(interval) = self.settings.interval else {
            return;
        };
        loop {
            self.wanted.notified().await;
            let places = request_handler
                .registry()
                .registrations()
                .filter(|place| can_be_asked(place))
                .cloned()
                .collect();
            self.round(&request_handler, places, interval).await;
            self.rounds.send_modify(|rounds| *rounds += 1);
            tokio::time::sleep(interval).await;
        }
    }

    /// Queries each port that is due.
    async fn round(
        &self,
        request_handler: &Arc<RequestHandler>,
        places: Vec<Endpoint>,
        interval: Duration,
    ) {
        let waiting = self.due(places);
        let mut asking = JoinSet::new();
        for (place, process) in waiting {
            while asking.len() >= MAX_CONCURRENT_QUERIES {
                self.record_result(asking.join_next().await, interval);
            }
            let network = self.settings.network.clone();
            let request_handler = request_handler.clone();
            asking.spawn(async move {
                let (probe, client) = probe_connected(&network, &place).await;
                request_handler.record_probe(&place, probe);
                let most = network.timeout() * MAX_STEPS;
                let told = match client {
                    Some(mut client) => {
                        let asking = port_query::query(&mut client, &place.name, process);
                        tokio::time::timeout(most, asking).await
                    }
                    None => Ok(None),
                };
                let told = told.unwrap_or_default();
                (place, told)
            });
        }
        while let done @ Some(_) = asking.join_next().await {
            self.record_result(done, interval);
        }
    }

    /// Forgets ports that are gone, and returns those that are due, each with a flag if its process
    /// is still unknown.
    fn due(&self, places: Vec<Endpoint>) -> Vec<(Endpoint, bool)> {
        let now = Instant::now();
        let mut heard = self.records();
        let mut kept = HashMap::with_capacity(places.len());
        let mut due = Vec::new();
        for place in places {
            let known = heard.remove(&place.name);
            let known = known.filter(|known| known.place == place);
            if known.as_ref().is_none_or(|known| known.due <= now) {
                let process = known.as_ref().is_none_or(|known| known.process.is_none());
                due.push((place.clone(), process));
            }
            kept.extend(known.map(|known| (place.name, known)));
        }
        *heard = kept;
        due
    }

    fn record_result(&self, done: Option<Result<QueriedPort, JoinError>>, interval: Duration) {
        // A query that panicked has no report.
        let Some(Ok((place, told))) = done else {
            return;
        };
        let mut heard = self.records();
        let before = heard.remove(&place.name);
        heard.insert(
            place.name.clone(),
            PortRecord::after(before, place, told, interval),
        );
    }
}

impl PortRecord {
    fn after(
        before: Option<Self>,
        place: Endpoint,
        told: Option<PortReport>,
        interval: Duration,
    ) -> Self {
        let at = Instant::now();
        let told = match told {
            Some(told) => told,
            None => {
                let failures = before.as_ref().map_or(0, |before| before.failures) + 1;
                let rest = interval * 2_u32.saturating_pow(failures.min(16));
                return Self {
                    place,
                    process: before.and_then(|before| before.process),
                    links: Vec::new(),
                    at,
                    due: at + rest.min(MAX_RETRY_DELAY.max(interval)),
                    failures,
                };
            }
        };
        let rate = |link: &port_query::ReportedConnection| {
            let before = before.as_ref()?;
            let same = |old: &&Measured| {
                let old = &old.link;
                (&old.peer, old.incoming, &old.carrier)
                    == (&link.peer, link.incoming, &link.carrier)
            };
            let old = before.links.iter().find(same)?.link.counted?;
            Rate::between(&old, &link.counted?, at - before.at)
        };
        let links = told.links.into_iter();
        let links = links.map(|link| Measured {
            rate: rate(&link),
            link,
        });
        Self {
            links: links.collect(),
            process: told.process.or(before.and_then(|before| before.process)),
            place,
            at,
            due: at,
            failures: 0,
        }
    }
}

impl Rate {
    /// Returns `None` if the counters were reset, or no time has passed.
    fn between(old: &ConnectionCounters, new: &ConnectionCounters, time: Duration) -> Option<Self> {
        let (old, new) = (old.traffic, new.traffic);
        let seconds = time.as_secs_f64();
        if seconds == 0.0 {
            return None;
        }
        Some(Self {
            messages: new.messages.checked_sub(old.messages)? as f64 / seconds,
            bytes: new.bytes.checked_sub(old.bytes)? as f64 / seconds,
        })
    }
}

/// Returns false for groups and topics, which are not ports.
fn can_be_asked(place: &Registration) -> bool {
    !matches!(place.carrier.as_str(), "mcast" | "topic")
}
