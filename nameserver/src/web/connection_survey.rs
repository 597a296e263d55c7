//! Rounds of questions to all ports, while somebody looks.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::sync::{Notify, watch};
use tokio::task::{JoinError, JoinSet};
use tokio::time::Instant;
use yarp_ports::{Endpoint, Network};
use yarp_wire::name_service::Registration;

use super::port_query::{self, ConnectionCounters, PortReport, Process};
use crate::prober::probe_connected;
use crate::request_handler::RequestHandler;

/// How the ports are asked.
#[derive(Clone, Debug)]
pub(crate) struct Settings {
    /// Rest between two rounds; none asks nobody ever.
    pub(crate) interval: Option<Duration>,
    /// The ports are asked as programs of this network ask, in whose deadline each step of a
    /// conversation is done.
    pub(crate) network: Network,
}

/// Ports that are asked at the same time.
const MAX_CONCURRENT_QUERIES: usize = 16;
/// What a whole conversation may take, in steps.
const MAX_STEPS: u32 = 4;
/// A port that did not answer is let alone for longer and longer, up to this.
const MAX_RETRY_DELAY: Duration = Duration::from_secs(60);

/// What the ports said when they were last asked.
#[derive(Debug)]
pub(crate) struct Survey {
    settings: Settings,
    /// Somebody looks.
    wanted: Notify,
    /// How many rounds have been made.
    rounds: watch::Sender<u64>,
    records: Mutex<HashMap<String, PortRecord>>,
}

/// A port that was asked, and what it said, if it did.
type QueriedPort = (Endpoint, Option<PortReport>);

/// What is known of one port.
#[derive(Debug)]
pub(super) struct PortRecord {
    /// Where it was asked; another place is another port.
    place: Endpoint,
    pub(super) process: Option<Process>,
    pub(super) links: Vec<Measured>,
    /// When the links were told.
    at: Instant,
    /// Not to be asked before.
    due: Instant,
    /// How often it did not answer since it last did.
    failures: u32,
}

/// A connection with its speed.
#[derive(Clone, Debug)]
pub(super) struct Measured {
    pub(super) link: port_query::ReportedConnection,
    /// Messages and bytes per second since the round before, if the port counts.
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

    /// Somebody looks: a round is due. Waits for the end of the first one, `patience` at the most.
    pub(super) async fn request_round(&self, wait: Duration) {
        if self.settings.interval.is_none() {
            return;
        }
        self.wanted.notify_one();
        let mut rounds = self.rounds.subscribe();
        let first = rounds.wait_for(|rounds| *rounds > 0);
        // What has been heard by then is shown, round or no round.
        let _ = tokio::time::timeout(wait, first).await;
    }

    /// Rest between two rounds.
    pub(super) fn interval(&self) -> Option<Duration> {
        self.settings.interval
    }

    /// Rounds that have been made.
    pub(super) fn rounds(&self) -> u64 {
        *self.rounds.borrow()
    }

    /// What was heard, by name.
    pub(super) fn records(&self) -> MutexGuard<'_, HashMap<String, PortRecord>> {
        self.records.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Makes the rounds; for ever.
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

    /// Asks each port whose turn it is.
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
                self.keep(asking.join_next().await, interval);
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
            self.keep(done, interval);
        }
    }

    /// Forgets ports that went, and gives those whose turn it is, each with whether its process is
    /// still to be asked for.
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

    fn keep(&self, done: Option<Result<QueriedPort, JoinError>>, interval: Duration) {
        // A conversation that panicked has told nothing.
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
    /// None if the counters began anew, or no time has passed.
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

/// Groups and topics are no ports.
fn can_be_asked(place: &Registration) -> bool {
    !matches!(place.carrier.as_str(), "mcast" | "topic")
}
