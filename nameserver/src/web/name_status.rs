//! What is known of each name.

use std::time::Instant;

use serde::Serialize;

use super::connection_survey::Survey;
use super::port_query::Process;
use crate::registry::{PortStatus, Registry};

/// A name, as the page and programs are told of it.
#[derive(Debug, Serialize)]
pub(super) struct NameStatus {
    name: String,
    /// `alive`, `unreachable` or `gone`.
    state: String,
    /// Why it is not alive, in words.
    #[serde(skip_serializing_if = "Option::is_none")]
    reason: Option<String>,
    host: String,
    port: u16,
    /// What it wants to be reached by.
    carrier: String,
    /// What it says it accepts, if it says so.
    accepts: Vec<String>,
    /// The type of its messages, if it says so.
    #[serde(rename = "type", skip_serializing_if = "Option::is_none")]
    type_name: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    process: Option<Process>,
}

/// All names, sorted: what the registry holds and knows of their lives, joined with what the ports
/// said of themselves.
pub(super) fn names(registry: &Registry, survey: &Survey) -> Vec<NameStatus> {
    let heard = survey.records();
    let status = |held: PortStatus| {
        let place = held.registration;
        let known = heard.get(&place.name);
        let values = |key| registry.values(&place.name, key);
        let process = known.and_then(|known| known.process.clone()).or_else(|| {
            let pid = values("process").first()?.parse().ok()?;
            Some(Process {
                pid: Some(pid),
                ..Process::default()
            })
        });
        NameStatus {
            state: held.state.to_string(),
            reason: held.reason,
            accepts: values("accepts").to_vec(),
            type_name: values("type").first().cloned(),
            process,
            name: place.name,
            host: place.host,
            port: place.port,
            carrier: place.carrier,
        }
    };
    registry.port_statuses(Instant::now()).map(status).collect()
}
