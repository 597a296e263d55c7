//! One port, asked for its connections and for what it is part of.

use serde::Serialize;
use yarp_ports::{AdminClient, PortCounters, PortError, Traffic};
use yarp_wire::admin::{self, Direction};
use yarp_wire::{Bottle, Value};

/// Connections that a port is believed; more would be a nuisance to it and to us.
const MAX_CONNECTIONS_PER_PORT: usize = 1024;
/// Connections of which a port that does not count is asked the carrier.
const MAX_CARRIER_QUERIES: usize = 64;
/// Longest text that is kept of what a port says, in characters.
const MAX_TEXT_CHARS: usize = 999;

/// What a port tells of itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct PortReport {
    pub(super) links: Vec<ReportedConnection>,
    /// Where it was asked for and the port said it.
    pub(super) process: Option<Process>,
}

/// A connection as the port at one of its ends tells of it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ReportedConnection {
    pub(super) peer: String,
    /// Whether the port is the reader.
    pub(super) incoming: bool,
    /// Carrier with its modifiers, where the port was asked for it.
    pub(super) carrier: Option<String>,
    /// What passed, if the port counts.
    pub(super) counted: Option<ConnectionCounters>,
}

/// What a port counted of a connection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ConnectionCounters {
    pub(super) traffic: Traffic,
    pub(super) queued: usize,
    pub(super) age: Option<f64>,
}

/// The program that a port is part of.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(super) struct Process {
    /// Its number.
    pub(super) pid: Option<i64>,
    /// The program.
    pub(super) name: Option<String>,
    /// What it was started with.
    pub(super) arguments: Option<String>,
    /// The machine.
    pub(super) host: Option<String>,
}

/// Asks a port; none if it does not say. `process` says whether to ask for that, too.
pub(super) async fn query(
    client: &mut AdminClient,
    name: &str,
    process: bool,
) -> Option<PortReport> {
    match try_query(client, name, process).await {
        Ok(told) => Some(told),
        Err(error) => {
            tracing::debug!("{name} does not tell of its connections: {error}");
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

/// The connections of a port that counts.
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

/// The connections of a port of stock.
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
    // The writer knows how it writes; readers need not be asked the same.
    let outputs = links.iter_mut().filter(|link| !link.incoming);
    for link in outputs.take(MAX_CARRIER_QUERIES) {
        let request = admin::list(Direction::Out, Some(&link.peer));
        let answer = client.admin(&request).await?;
        link.carrier = text_at(&answer, "carrier");
    }
    Ok(links)
}

/// Terminals, browsers and programs that ask are no ports.
fn is_between_ports(link: &ReportedConnection) -> bool {
    link.peer.starts_with('/') && link.peer.len() <= MAX_TEXT_CHARS
}

/// `(process ((arguments A) (name N) (pid P) ...)) (platform ((hostname H) ...)) ...`
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
    fn what_a_port_says_of_its_process() {
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
