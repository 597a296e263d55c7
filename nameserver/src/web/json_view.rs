//! JSON structures of the pages.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::json;
use yarp_wire::http::Response;

use super::connection_survey::{Measured, Survey};
use crate::registry::Settings;

/// Maximum number of connections in one answer.
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

/// All connections of the network.
#[derive(Serialize)]
pub(super) struct Connections {
    /// Interval between two rounds in seconds; `None` if the ports are not queried.
    interval: Option<f64>,
    /// Number of completed rounds.
    rounds: u64,
    connections: Vec<Connection>,
}

/// A connection, merged from the reports of both ends.
#[derive(Default, Serialize)]
struct Connection {
    from: String,
    to: String,
    carrier: Option<String>,
    /// Counters of the writer.
    sent: Option<PassedTraffic>,
    /// Counters of the reader.
    received: Option<PassedTraffic>,
    /// Bytes queued at the writer.
    queued: Option<usize>,
    /// Seconds since the newest stamp received by the reader, or else sent by the writer.
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

/// Returns the reported connections, sorted by writer and reader.
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
    /// Merges the report of one end.
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

/// Returns the list of addresses.
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
