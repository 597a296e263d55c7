//! Status of each name.

use std::time::Instant;

use serde::Serialize;

use super::connection_survey::Survey;
use super::port_query::Process;
use crate::registry::{PortStatus, Registry};

/// Status of a name, as shown to browsers and programs.
#[derive(Debug, Serialize)]
pub(super) struct NameStatus {
    name: String,
    /// `alive`, `unreachable` or `gone`.
    state: String,
    /// Reason why the port is not alive.
    #[serde(skip_serializing_if = "Option::is_none")]
    reason: Option<String>,
    host: String,
    port: u16,
    /// Carrier that the port prefers.
    carrier: String,
    /// Carriers that the port accepts, if it reports them.
    accepts: Vec<String>,
    /// Type of its messages, if the port reports it.
    #[serde(rename = "type", skip_serializing_if = "Option::is_none")]
    type_name: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    process: Option<Process>,
}

/// Returns the status of all names, sorted: the registry's data joined with the reports of the
/// ports.
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
