//! Queries one port for its connections and its process.

use serde::Serialize;
use yarp_ports::{AdminClient, PortCounters, PortError, Traffic};
use yarp_wire::admin::{self, Direction};
use yarp_wire::{Bottle, Value};

/// Maximum number of connections accepted from one port.
const MAX_CONNECTIONS_PER_PORT: usize = 1024;
/// Maximum number of connections whose carrier is queried from a port without counters.
const MAX_CARRIER_QUERIES: usize = 64;
/// Maximum length of a text accepted from a port, in characters.
const MAX_TEXT_CHARS: usize = 999;

/// Report of a port.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct PortReport {
    pub(super) links: Vec<ReportedConnection>,
    /// Process of the port, if it was requested and reported.
    pub(super) process: Option<Process>,
}

/// A connection as reported by one of its ends.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ReportedConnection {
    pub(super) peer: String,
    /// True if the reporting port is the reader.
    pub(super) incoming: bool,
    /// Carrier with its modifiers, if known.
    pub(super) carrier: Option<String>,
    /// Counters, if the port counts.
    pub(super) counted: Option<ConnectionCounters>,
}

/// Counters of one connection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ConnectionCounters {
    pub(super) traffic: Traffic,
    pub(super) queued: usize,
    pub(super) age: Option<f64>,
}

/// Process that a port belongs to.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(super) struct Process {
    /// Process id.
    pub(super) pid: Option<i64>,
    /// Program.
    pub(super) name: Option<String>,
    /// Command line arguments.
    pub(super) arguments: Option<String>,
    /// Host name.
    pub(super) host: Option<String>,
}

/// Queries a port; `None` if it does not answer. `process`: also query its process.
pub(super) async fn query(
    client: &mut AdminClient,
    name: &str,
    process: bool,
) -> Option<PortReport> {
    match try_query(client, name, process).await {
        Ok(told) => Some(told),
        Err(error) => {
            tracing::debug!("{name} does not report its connections: {error}");
            None
        }
    }
}

async fn try_query(
    client: &mut AdminClient,
    name: &str,
    process: bool,
) -> Result<PortReport, PortError> {
    let answer = client.admin(&admin::property("counters")).await?;
    let links = match PortCounters::from_bottle(&answer) {
        Some(counters) => connections_of(counters),
        None => listed(client).await?,
    };
    let process = match process {
        true => process_in(&client.admin(&admin::property(name)).await?),
        false => None,
    };
    Ok(PortReport { links, process })
}

/// Returns the connections of a port with counters.
fn connections_of(counters: PortCounters) -> Vec<ReportedConnection> {
    let links = counters
        .connections
        .into_iter()
        .map(|connection| ReportedConnection {
            peer: connection.peer,
            incoming: connection.incoming,
            carrier: Some(short(connection.carrier)),
            counted: Some(ConnectionCounters {
                traffic: connection.traffic,
                queued: connection.queued,
                age: connection.age.filter(|age| age.is_finite()),
            }),
        });
    links
        .filter(is_between_ports)
        .take(MAX_CONNECTIONS_PER_PORT)
        .collect()
}

/// Queries the connections of a stock port.
async fn listed(client: &mut AdminClient) -> Result<Vec<ReportedConnection>, PortError> {
    let mut links = Vec::new();
    for (direction, incoming) in [(Direction::Out, false), (Direction::In, true)] {
        let names = client.admin(&admin::list(direction, None)).await?;
        let found = names.iter().map(|name| ReportedConnection {
            peer: name.to_plain_string(),
            incoming,
            carrier: None,
            counted: None,
        });
        links.extend(
            found
                .filter(is_between_ports)
                .take(MAX_CONNECTIONS_PER_PORT),
        );
    }
    // The writer knows the carrier, so readers are not queried.
    let outputs = links.iter_mut().filter(|link| !link.incoming);
    for link in outputs.take(MAX_CARRIER_QUERIES) {
        let request = admin::list(Direction::Out, Some(&link.peer));
        let answer = client.admin(&request).await?;
        link.carrier = text_at(&answer, "carrier");
    }
    Ok(links)
}

/// Returns false for terminals, browsers and clients, which are not ports.
fn is_between_ports(link: &ReportedConnection) -> bool {
    link.peer.starts_with('/') && link.peer.len() <= MAX_TEXT_CHARS
}

/// Parses `(process ((arguments A) (name N) (pid P) ...)) (platform ((hostname H) ...)) ...`.
fn process_in(answer: &Bottle) -> Option<Process> {
    let list = |key: &str| answer.find(key).and_then(Value::as_list);
    let process = list("process")?;
    Some(Process {
        pid: process.find("pid").and_then(Value::as_i64),
        name: text_at(process, "name"),
        arguments: text_at(process, "arguments"),
        host: list("platform").and_then(|platform| text_at(platform, "hostname")),
    })
}

fn text_at(list: &Bottle, key: &str) -> Option<String> {
    let text = short(list.find(key)?.to_plain_string());
    (!text.is_empty()).then_some(text)
}

fn short(text: String) -> String {
    match text.char_indices().nth(MAX_TEXT_CHARS) {
        Some((end, _)) => text[..end].to_owned(),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn processes_are_parsed() {
        let answer = "(process ((arguments \"--name /a\") (name /bin/cam) (pid 12) (priority 0))) \
             (platform ((hostname lab) (os Linux)))";
        let process = process_in(&Bottle::parse(answer).unwrap()).unwrap();
        let text = |text: &str| Some(text.to_owned());
        assert_eq!((process.pid, process.host), (Some(12), text("lab")));
        assert_eq!(process.name, text("/bin/cam"));
        assert_eq!(process.arguments, text("--name /a"));
        for other in ["", "[fail]", "(process 5)", "process"] {
            assert_eq!(process_in(&Bottle::parse(other).unwrap()), None, "{other}");
        }
    }

    #[test]
    fn long_texts_are_cut_between_characters() {
        assert_eq!(short("é".repeat(2000)), "é".repeat(MAX_TEXT_CHARS));
        assert_eq!(short("é".to_owned()), "é");
    }
}
