//! Administration of other ports: connect, disconnect, describe.
//!
//! Any program may use it; each request is a short connection over `text_ack`, as in stock. All
//! requests are limited by the network's timeout.

use yarp_wire::admin::{self, Direction};
use yarp_wire::carrier::{Carrier, CarrierSpec};
use yarp_wire::message::Command;
use yarp_wire::{Bottle, Contact, Value};

use crate::admin_client::AdminClient;
use crate::compiled_here::CompiledHere;
use crate::error::PortError;
use crate::log_text::printable;
use crate::network::{Endpoint, Network};

/// The sender name of the requests.
const ADMIN: &str = "admin";

/// The reason why other ports were not connected.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConnectError {
    /// The writer is not known.
    #[error("could not find source port {name}")]
    NoSource {
        /// Its name.
        name: String,
    },
    /// The reader is not known.
    #[error("could not find destination port {name}")]
    NoDestination {
        /// Its name.
        name: String,
    },
    /// The writer refused, in its own words.
    #[error("{text}")]
    Refused {
        /// The answer.
        text: String,
    },
    /// There is no such connection.
    #[error("no such connection")]
    NoConnection,
    /// Name server or port did not answer.
    #[error(transparent)]
    Port(#[from] PortError),
}

/// A connection as one of its ends describes it.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct Connection {
    /// The writer.
    pub from: String,
    /// The reader.
    pub to: String,
    /// Carrier with its modifiers.
    pub carrier: String,
    /// `true` if the other side must be notified of its end separately.
    pub connectionless: bool,
}

/// Sends an admin request to a port.
pub async fn administer(
    network: &Network,
    endpoint: &Endpoint,
    request: &Bottle,
) -> Result<Bottle, PortError> {
    administering(network, endpoint, request).await
}

#[inline(never)]
fn administering<'a>(
    network: &'a Network,
    endpoint: &'a Endpoint,
    request: &'a Bottle,
) -> CompiledHere<'a, Result<Bottle, PortError>> {
    Box::pin(async move {
        let mut client = open_admin_client(network, endpoint, ADMIN).await?;
        client.admin(request).await
    })
}

/// Returns the lines in which a port describes itself.
pub async fn describe(network: &Network, endpoint: &Endpoint) -> Result<Vec<String>, PortError> {
    let mut client = open_admin_client(network, endpoint, "<ping>").await?;
    client.command(&Command::Describe).await
}

/// Opens an admin connection to a port, as `sender`; ports do not report connections of programs
/// that are not ports.
pub async fn open_admin_client(
    network: &Network,
    endpoint: &Endpoint,
    sender: &str,
) -> Result<AdminClient, PortError> {
    let carrier = Carrier::by_name("text_ack").expect("text_ack is in the table");
    let address = (endpoint.host.as_str(), endpoint.port);
    AdminClient::open(&endpoint.name, address, carrier, sender, network).await
}

/// Returns the connection from one port to another, as the writer sees it.
pub async fn connection(
    network: &Network,
    source: &Endpoint,
    destination: &str,
) -> Result<Option<Connection>, PortError> {
    let request = admin::list(Direction::Out, Some(destination));
    let answer = administer(network, source, &request).await?;
    Ok(described(&answer))
}

/// Returns the connection from one port to another, as the writer sees it, else as a reader that made it sees it: over
/// carriers such as `mjpeg` the reader connects to the writer.
pub async fn connection_of_either(
    network: &Network,
    source: &Endpoint,
    destination: &Endpoint,
) -> Result<Option<Connection>, PortError> {
    if let Some(known) = connection(network, source, &destination.name).await? {
        return Ok(Some(known));
    }
    let known = input(network, destination, &source.name).await?;
    Ok(known.filter(|known| !pushes(&known.carrier)))
}

/// Returns a connection in the words of one of its ends.
fn described(answer: &Bottle) -> Option<Connection> {
    let text = |key: &str| answer.find(key).map(Value::to_plain_string);
    match (text("from"), text("to")) {
        (Some(from), Some(to)) => Some(Connection {
            from,
            to,
            carrier: text("carrier").unwrap_or_default(),
            connectionless: answer.find("connectionless").is_some(),
        }),
        _ => None,
    }
}

/// Connects two ports of others; gives the words in which the writer confirmed it.
///
/// `carrier` wins over the one that a contact names, and that over the one that the reader is
/// registered with.
pub async fn connect(
    network: &Network,
    source: &str,
    destination: &str,
    carrier: Option<&str>,
) -> Result<String, ConnectError> {
    connecting(network, source, destination, carrier).await
}

#[inline(never)]
fn connecting<'a>(
    network: &'a Network,
    source: &'a str,
    destination: &'a str,
    carrier: Option<&'a str>,
) -> CompiledHere<'a, Result<String, ConnectError>> {
    Box::pin(async move {
        let (from, to) = (Contact::parse(source), Contact::parse(destination));
        let (source, destination) = both(network, &from, &to).await?;
        let carrier = carrier
            .map(str::to_owned)
            .or(to.carrier.clone())
            .or(from.carrier.clone())
            .unwrap_or_else(|| destination.carrier.clone());
        if !pushes(&carrier) {
            return pull(network, &source, &from, &destination, &carrier).await;
        }
        let known = connection(network, &source, &destination.name).await?;
        known.iter().for_each(report);
        if known.is_none_or(|known| known.connectionless) {
            // A connection that the writer does not control may linger at the reader.
            forget_connectionless(network, &source, &destination, &carrier).await;
        }
        let request = admin::add(&format!("{carrier}:/{}", at(&to, &destination)));
        let answer = administer(network, &source, &request).await?;
        judge(&answer)
    })
}

/// Asks the reader to connect to the writer, as stock does for carriers that do not push.
async fn pull(
    network: &Network,
    source: &Endpoint,
    from: &Contact,
    destination: &Endpoint,
    carrier: &str,
) -> Result<String, ConnectError> {
    let known = input(network, destination, &source.name).await?;
    known.iter().for_each(report);
    let request = admin::add(&format!("{carrier}:/{}", at(from, source)));
    let answer = administer(network, destination, &request).await?;
    judge(&answer)
}

/// Returns whether the writer connects over this carrier, which is assumed for unknown ones.
fn pushes(carrier: &str) -> bool {
    let spec = carrier.parse().ok();
    let known = spec.as_ref().and_then(Carrier::of);
    known.is_none_or(|carrier| carrier.push)
}

/// Returns the connection from one port to another, as the reader sees it.
async fn input(
    network: &Network,
    destination: &Endpoint,
    source: &str,
) -> Result<Option<Connection>, PortError> {
    let request = admin::list(Direction::In, Some(source));
    let answer = administer(network, destination, &request).await?;
    Ok(described(&answer))
}

/// Logs a connection that was found, in stock's words.
fn report(known: &Connection) {
    let Connection {
        from, to, carrier, ..
    } = known;
    tracing::info!("Connection found between {from} and {to} using carrier {carrier}");
}

/// Returns the address that the writer uses for the reader: its name, or that of the contact.
fn at(contact: &Contact, endpoint: &Endpoint) -> String {
    match &contact.address {
        Some((host, port)) => format!("/{host}:{port}{}", contact.name),
        None => endpoint.name.clone(),
    }
}

async fn forget_connectionless(
    network: &Network,
    source: &Endpoint,
    destination: &Endpoint,
    carrier: &str,
) {
    let base = carrier.parse().map(|spec: CarrierSpec| spec.base);
    let connectionless = base
        .ok()
        .and_then(|base| Carrier::by_name(&base))
        .is_some_and(|carrier| carrier.connectionless);
    // A request to drop a name also closes the reader's outputs of that name: it is sent only if
    // necessary.
    if connectionless && let Ok(Some(_)) = input(network, destination, &source.name).await {
        let request = admin::remove(&source.name);
        let _ = administer(network, destination, &request).await;
    }
}

/// Ends the connection between two ports of others; gives the words that confirmed it.
pub async fn disconnect(
    network: &Network,
    source: &str,
    destination: &str,
) -> Result<String, ConnectError> {
    disconnecting(network, source, destination).await
}

#[inline(never)]
fn disconnecting<'a>(
    network: &'a Network,
    source: &'a str,
    destination: &'a str,
) -> CompiledHere<'a, Result<String, ConnectError>> {
    Box::pin(async move {
        let (from, to) = (Contact::parse(source), Contact::parse(destination));
        let (source, destination) = both(network, &from, &to).await?;
        let known = connection(network, &source, &destination.name).await?;
        if let Some(known) = known {
            report(&known);
            let request = admin::remove(&destination.name);
            let answer = administer(network, &source, &request).await?;
            return judge(&answer);
        }
        // One that the reader made is known to the reader alone.
        let known = input(network, &destination, &source.name).await?;
        let pulled = known.filter(|known| !pushes(&known.carrier));
        report(&pulled.ok_or(ConnectError::NoConnection)?);
        let request = admin::remove(&source.name);
        let answer = administer(network, &destination, &request).await?;
        judge(&answer)
    })
}

async fn both(
    network: &Network,
    from: &Contact,
    to: &Contact,
) -> Result<(Endpoint, Endpoint), ConnectError> {
    let source = network.resolve(from).await.map_err(|error| match error {
        PortError::Unknown { name } => ConnectError::NoSource { name },
        other => other.into(),
    })?;
    let destination = network.resolve(to).await.map_err(|error| match error {
        PortError::Unknown { name } => ConnectError::NoDestination { name },
        other => other.into(),
    })?;
    Ok((source, destination))
}

/// Returns a code of 0 in front is success.
fn judge(answer: &Bottle) -> Result<String, ConnectError> {
    let text = answer
        .get(1)
        .map(Value::to_plain_string)
        .unwrap_or_default();
    let text = text.trim_end().to_owned();
    match answer.get(0).and_then(Value::as_i64) {
        Some(0) => Ok(text),
        _ => Err(ConnectError::Refused { text }),
    }
}

/// Returns whether a port is known and answers.
pub async fn exists(network: &Network, name: &str) -> Result<bool, PortError> {
    let endpoint = match network.resolve(&Contact::parse(name)).await {
        Ok(endpoint) => endpoint,
        Err(PortError::Unknown { .. }) => return Ok(false),
        Err(error) => return Err(error),
    };
    let answer = administer(network, &endpoint, &admin::version()).await;
    Ok(answer.is_ok_and(|answer| admin::is_version(&answer)))
}

/// Returns address and process of the port of this name, in words for people; `None` if no port of it answers.
///
/// For example `tcp://10.0.0.2:10002/, process 4711 (yarp) on robot`; the process is left out if the port does not
/// tell it.
pub async fn owner(network: &Network, name: &str) -> Result<Option<String>, PortError> {
    let endpoint = match network.resolve(&Contact::parse(name)).await {
        Ok(endpoint) => endpoint,
        Err(PortError::Unknown { .. }) => return Ok(None),
        Err(error) => return Err(error),
    };
    let answer = administer(network, &endpoint, &admin::version()).await;
    if !answer.is_ok_and(|answer| admin::is_version(&answer)) {
        return Ok(None);
    }
    let properties = administer(network, &endpoint, &admin::property(&endpoint.name)).await;
    Ok(Some(owner_in_words(
        &endpoint,
        &properties.unwrap_or_default(),
    )))
}

/// Formats an address, and the process in the properties of a port.
fn owner_in_words(endpoint: &Endpoint, properties: &Bottle) -> String {
    let Endpoint { host, port, .. } = endpoint;
    let mut text = format!("tcp://{host}:{port}/");
    let of = |group: &str, key: &str| {
        let value = properties.find(group)?.as_list()?.find(key)?;
        Some(printable(&value.to_plain_string()).to_string())
    };
    if let Some(pid) = of("process", "pid") {
        let program = of("process", "name").unwrap_or_default();
        text += &format!(", process {pid} ({program})");
        if let Some(machine) = of("platform", "hostname") {
            text += &format!(" on {machine}");
        }
    }
    text
}

/// Returns whether the TCP port of a port accepts connections.
pub async fn listens(network: &Network, endpoint: &Endpoint) -> bool {
    let deadline = network.timeout();
    crate::connect::connect_only(&endpoint.name, &endpoint.host, endpoint.port, deadline)
        .await
        .is_ok()
}
