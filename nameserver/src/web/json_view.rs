//! The shapes of the JSON.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::json;
use yarp_wire::http::Response;

use super::connection_survey::{Measured, Survey};
use crate::registry::Settings;

/// Connections in one answer.
const MAX_CONNECTIONS: usize = 100_000;

/// The name server itself.
#[derive(Serialize)]
pub(super) struct Server {
    name: String,
    host: String,
    port: u16,
    version: &'static str,
}

impl Server {
    pub(super) fn of(settings: &Settings) -> Self {
        Self {
            name: settings.name.clone(),
            host: settings.host.clone(),
            port: settings.port,
            version: env!("CARGO_PKG_VERSION"),
        }
    }
}

/// The connections of the whole network.
#[derive(Serialize)]
pub(super) struct Connections {
    /// Seconds of rest between two rounds of questions; none if the ports are not asked.
    interval: Option<f64>,
    /// Rounds that have been made.
    rounds: u64,
    connections: Vec<Connection>,
}

/// A connection, from what both its ends say.
#[derive(Default, Serialize)]
struct Connection {
    from: String,
    to: String,
    carrier: Option<String>,
    /// As the writer counts.
    sent: Option<PassedTraffic>,
    /// As the reader counts.
    received: Option<PassedTraffic>,
    /// Bytes that wait at the writer.
    queued: Option<usize>,
    /// Seconds since the newest stamp that the reader got, or else the writer sent.
    age: Option<f64>,
}

#[derive(Serialize)]
struct PassedTraffic {
    messages: u64,
    bytes: u64,
    dropped: u64,
    messages_per_second: Option<f64>,
    bytes_per_second: Option<f64>,
}

/// What the ports said of their connections, sorted by writer and reader.
pub(super) fn connections(survey: &Survey) -> Connections {
    let mut found: BTreeMap<(String, String), Connection> = BTreeMap::new();
    for (name, heard) in survey.records().iter() {
        for measured in &heard.links {
            let peer = measured.link.peer.clone();
            let ends = match measured.link.incoming {
                true => (peer, name.clone()),
                false => (name.clone(), peer),
            };
            if found.len() >= MAX_CONNECTIONS && !found.contains_key(&ends) {
                continue;
            }
            found.entry(ends).or_default().join(measured);
        }
    }
    let connections = found
        .into_iter()
        .map(|((from, to), known)| Connection { from, to, ..known });
    Connections {
        interval: survey.interval().map(|interval| interval.as_secs_f64()),
        rounds: survey.rounds(),
        connections: connections.collect(),
    }
}

impl Connection {
    /// Adds what one of the ends says.
    fn join(&mut self, measured: &Measured) {
        let link = &measured.link;
        if self.carrier.is_none() || !link.incoming && link.carrier.is_some() {
            self.carrier.clone_from(&link.carrier);
        }
        let Some(counted) = &link.counted else {
            return;
        };
        let passed = Some(PassedTraffic {
            messages: counted.traffic.messages,
            bytes: counted.traffic.bytes,
            dropped: counted.traffic.dropped,
            messages_per_second: measured.rate.map(|rate| rate.messages),
            bytes_per_second: measured.rate.map(|rate| rate.bytes),
        });
        if link.incoming {
            self.received = passed;
            self.age = counted.age.or(self.age);
        } else {
            self.sent = passed;
            self.queued = Some(counted.queued);
            self.age = self.age.or(counted.age);
        }
    }
}

/// What there is to read.
pub(super) fn addresses() -> Response {
    Response::json(
        json!({
            "/api/names": "every name: place, state, carriers, type and process; with ?revision=R \
                of an earlier answer only whether it changed",
            "/api/connections": "every connection: ends, carrier, and what passed where the ports count",
        })
        .to_string(),
    )
}
