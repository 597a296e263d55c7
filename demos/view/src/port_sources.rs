//! Connections to the ports that are shown, made while somebody watches.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use serde_json::{Value as Json, json};
use tokio::task::JoinSet;
use tokio::time::Instant;
use yarp_ports::{Port, remote_admin};

use crate::network_status;
use crate::view_model::{Model, Role};

/// Interval between two looks at the connections.
const CHECK_INTERVAL: Duration = Duration::from_secs(1);
/// Maximum duration of an attempt to connect.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);
/// Time without viewers after which the connections end.
const UNWATCHED_TIMEOUT: Duration = Duration::from_secs(10);
/// Number of checks between two requests to the name server for the connections of the network.
const CHECKS_PER_SURVEY: u64 = 2;

/// A port that is shown.
#[derive(Clone, Debug)]
pub(crate) struct Subscription {
    pub(crate) port: String,
    pub(crate) role: Role,
}

impl Subscription {
    pub(crate) fn new(port: String, role: Role) -> Self {
        Self { port, role }
    }
}

/// The connections of a view to its sources.
#[derive(Debug)]
pub(crate) struct Sources {
    input: Arc<Port>,
    subscriptions: Arc<Vec<Subscription>>,
    watched: AtomicBool,
    /// Messages per second of each source.
    rates: Mutex<BTreeMap<String, f64>>,
}

impl Sources {
    pub(crate) fn new(input: Arc<Port>, subscriptions: Arc<Vec<Subscription>>) -> Self {
        Self {
            input,
            subscriptions,
            watched: AtomicBool::new(false),
            rates: Mutex::default(),
        }
    }

    /// Records if there is a viewer.
    pub(crate) fn set_watched(&self, watched: bool) {
        self.watched.store(watched, Ordering::Relaxed);
    }

    /// Returns each source: its port, if it is connected, and its rate.
    pub(crate) fn to_json(&self) -> Json {
        let connected = self.input.inputs();
        let rates = self
            .rates
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone();
        let own = self.subscriptions.iter().map(|known| &known.port);
        let others = connected
            .iter()
            .filter(|name| !self.subscriptions.iter().any(|known| known.port == **name));
        let told = own.chain(others).map(|port| {
            json!({
                "port": port,
                "connected": connected.contains(port),
                "rate": rates.get(port).copied().unwrap_or_default(),
            })
        });
        Json::Array(told.collect())
    }

    /// Keeps the sources connected while somebody watches; runs until it is aborted.
    pub(crate) async fn run(self: Arc<Self>, model: Arc<Model>) {
        let mut watched_at: Option<Instant> = None;
        let mut counted: BTreeMap<String, u64> = BTreeMap::new();
        let mut measured_at = Instant::now();
        let mut checks = 0;
        loop {
            if self.watched.load(Ordering::Relaxed) {
                watched_at = Some(Instant::now());
                self.connect_missing().await;
                if checks % CHECKS_PER_SURVEY == 0 {
                    let told = network_status::connections(self.input.network()).await;
                    model.latest().network = told;
                }
                checks += 1;
            } else if watched_at.is_some_and(|at| at.elapsed() > UNWATCHED_TIMEOUT) {
                self.disconnect().await;
                watched_at = None;
            }
            // A page that was just opened is served sooner than after a whole interval.
            let step = if watched_at.is_some() {
                CHECK_INTERVAL
            } else {
                CHECK_INTERVAL / 4
            };
            tokio::time::sleep(step).await;
            let counts = model.latest().counts.clone();
            let seconds = measured_at.elapsed().as_secs_f64();
            measured_at = Instant::now();
            let rate = |(port, count): (&String, &u64)| {
                let before = counted.get(port).copied().unwrap_or_default();
                (port.clone(), (count - before) as f64 / seconds)
            };
            let rates = counts.iter().map(rate).collect();
            *self.rates.lock().unwrap_or_else(PoisonError::into_inner) = rates;
            counted = counts;
        }
    }

    async fn connect_missing(&self) {
        let connected = self.input.inputs();
        let mut attempts = JoinSet::new();
        for missing in self
            .subscriptions
            .iter()
            .filter(|known| !connected.contains(&known.port))
        {
            let (network, from) = (self.input.network().clone(), missing.port.clone());
            let to = self.input.name().to_owned();
            attempts.spawn(tokio::time::timeout(CONNECT_TIMEOUT, async move {
                match remote_admin::connect(&network, &from, &to, None).await {
                    Ok(_) => tracing::debug!(%from, "the view shows it"),
                    // It may not be there yet, or never.
                    Err(error) => tracing::debug!(%from, "not connected: {error}"),
                }
            }));
        }
        // Each has its timeout.
        while attempts.join_next().await.is_some() {}
    }

    async fn disconnect(&self) {
        for known in self.subscriptions.iter() {
            if !self.input.inputs().contains(&known.port) {
                continue;
            }
            let ending =
                remote_admin::disconnect(self.input.network(), &known.port, self.input.name());
            // A source that does not answer is gone, or is tried again when the next viewer leaves.
            let _ = tokio::time::timeout(CONNECT_TIMEOUT, ending).await;
        }
    }
}
