//! What is known of each name.

use std::io::ErrorKind;

use serde::Serialize;
use yarp_ports::PortError;

use super::ask::Process;
use super::survey::Survey;
use crate::registry::Registry;

/// Whether a port is there.
#[derive(Clone, Copy, Debug, Eq, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum State {
    /// It answered.
    Alive,
    /// Its machine cannot be reached, or it does not answer in time, or not as a port.
    Unreachable,
    /// Its machine says that nobody listens there.
    Gone,
    /// It has not been asked yet, or cannot be asked.
    Unknown,
}

impl State {
    /// What a port is after it could not be asked.
    pub(super) fn after(error: &PortError) -> Self {
        match error {
            PortError::Connect { source, .. } if source.kind() == ErrorKind::ConnectionRefused => {
                Self::Gone
            }
            _ => Self::Unreachable,
        }
    }
}

/// A name, as the page and programs are told of it.
#[derive(Debug, Serialize)]
pub(super) struct NameStatus {
    name: String,
    state: State,
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

/// All names, sorted: what the registry holds, joined with what the ports said.
///
/// This is the one place that says in which state a name is.
pub(super) fn names(registry: &Registry, survey: &Survey) -> Vec<NameStatus> {
    let heard = survey.heard();
    let status = |place: &yarp_ports::Place| {
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
            name: place.name.clone(),
            state: known.map_or(State::Unknown, |known| known.state),
            reason: known.and_then(|known| known.reason.clone()),
            host: place.host.clone(),
            port: place.port,
            carrier: place.carrier.clone(),
            accepts: values("accepts").to_vec(),
            type_name: values("type").first().cloned(),
            process,
        }
    };
    registry.registrations().map(status).collect()
}
