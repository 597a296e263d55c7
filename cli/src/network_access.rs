//! The network that the configuration names, and ports on it, in stock's words.

use std::time::Duration;

use yarp_ports::config::ResourceFinder;
use yarp_ports::{AdminClient, Endpoint, Network, Port, PortError, PortOptions, remote_admin};
use yarp_wire::carrier::Carrier;
use yarp_wire::message::{Command, WireObject};
use yarp_wire::name_service::UNSUPPORTED_PREFIX;
use yarp_wire::{Bottle, Contact, PortName, Value};

use crate::error::Result;

/// What the administration calls itself.
const ADMIN_NAME: &str = "admin";
/// How long a port that may have our name has to say so.
const ALIVE_TIMEOUT: Duration = Duration::from_secs(2);
/// How long the name server has to say that it is there.
const NAME_SERVER_TIMEOUT: Duration = Duration::from_secs(5);
/// Longer than anybody waits; what waits so long ends on a signal.
pub(crate) const FOREVER: Duration = Duration::from_secs(30 * 24 * 3600);

/// The network of this process; warns as stock does if there is no name server on it.
pub(crate) fn network() -> Result<Network> {
    let network = Network::from_process()?;
    if network.server().is_none() {
        for text in [
            "YARP name server(s) not configured, ports will be anonymous",
            "check your namespace and settings with 'yarp detect'",
        ] {
            tracing::warn!(target: "yarp.os.MultiNamespace", "{text}");
        }
    }
    Ok(network)
}

/// Where files are found for a program with this command line, whose configuration file is `file` if the command line
/// names none. Says what is wrong with what it read.
pub(crate) fn finder(words: &[String], file: Option<&str>) -> Result<ResourceFinder> {
    let mut finder = ResourceFinder::from_process()?;
    for problem in finder.configure(words, file)? {
        tracing::error!(target: "yarp.os.Property", "{problem}");
    }
    Ok(finder)
}

/// Whether the name server of `network` answers to its name.
pub(crate) async fn serves(network: &Network, namespace: &str) -> bool {
    let impatient = network.with_timeout(network.timeout().min(NAME_SERVER_TIMEOUT));
    impatient.query(namespace).await.is_ok()
}

/// Where a port is, if that is known; says so if the name server does not answer.
pub(crate) async fn find(network: &Network, contact: &Contact) -> Result<Option<Endpoint>> {
    match network.resolve(contact).await {
        Ok(place) => Ok(Some(place)),
        Err(PortError::Unknown { .. } | PortError::NoNameServer) => Ok(None),
        Err(error @ PortError::NameServer { .. }) => {
            away(&error);
            Ok(None)
        }
        Err(error) => Err(error.into()),
    }
}

/// Says that the name server does not answer: stock's two lines, and the reason.
pub(crate) fn away(error: &PortError) {
    const COMPONENT: &str = "yarp.os.impl.NameClient";
    tracing::info!(target: COMPONENT, "No connection to nameserver");
    tracing::info!(target: COMPONENT, "*** try running: yarp detect ***");
    tracing::error!(target: COMPONENT, "{}", error.error_chain());
}

/// Opens a port; if that fails, says why in stock's words and gives nothing.
///
/// Without a name server the port is open but not registered. A name that is in use stays with
/// the port that has it.
pub(crate) async fn open(
    network: &Network,
    name: &str,
    options: PortOptions,
) -> Result<Option<Port>> {
    const COMPONENT: &str = "yarp.os.Port";
    if name != "..." {
        if !name.starts_with('/') {
            tracing::error!(target: COMPONENT, "Port name '{name}' needs to start with a '/' character");
            return Ok(None);
        }
        if let Err(error) = name.parse::<PortName>() {
            tracing::error!(target: COMPONENT, "{error}");
            return Ok(None);
        }
    }
    if network.server().is_none() {
        let name = if name == "..." { "/anonymous" } else { name };
        return Ok(Some(
            Port::open(network, name, options.unregistered()).await?,
        ));
    }
    if name != "..."
        && let Some(place) = alive(network, name).await
    {
        let (host, port) = (&place.host, place.port);
        tracing::error!(
            target: COMPONENT,
            "Port {name} failed to activate at tcp://{host}:{port}/ (address conflict)"
        );
        return Ok(None);
    }
    match Port::open(network, name, options).await {
        Ok(port) => Ok(Some(port)),
        Err(error) => {
            let reason = match &error {
                PortError::Listen { .. } => "address conflict",
                PortError::NameServer { .. } | PortError::Refused { .. } => "invalid address",
                _ => return Err(error.into()),
            };
            tracing::error!(target: "yarp.os.Network", "{}", error.error_chain());
            tracing::error!(target: COMPONENT, "Port {name} failed to activate ({reason})");
            Ok(None)
        }
    }
}

/// Where the port of this name is, if it is there and says that this is its name.
pub(crate) async fn alive(network: &Network, name: &str) -> Option<Endpoint> {
    let network = network.with_timeout(ALIVE_TIMEOUT);
    let place = network.query(name).await.ok()?;
    let lines = remote_admin::describe(&network, &place).await.ok()?;
    let greeting = format!("This is {name} ");
    lines.first()?.starts_with(&greeting).then_some(place)
}

/// Asks the name server something that it answers with a bottle.
pub(crate) async fn ask_server(
    network: &Network,
    request: &(impl WireObject + Sync),
) -> std::result::Result<Bottle, PortError> {
    let carrier = Carrier::by_name("text_ack").expect("text_ack is in the table");
    network
        .at_each_server(|network| async move {
            let server = network.server().ok_or(PortError::NoNameServer)?;
            let opening =
                AdminClient::open("the name server", server, carrier, ADMIN_NAME, &network);
            let payload = opening
                .await?
                .request(&Command::data(true), request)
                .await?;
            let answer = payload
                .to_bottle()
                .map_err(|source| PortError::Unreadable {
                    peer: "the name server".to_owned(),
                    source,
                })?;
            // It is not about the request: another server of the same names may do it.
            let reason = answer.get(1).map(Value::to_plain_string);
            let cannot = UNSUPPORTED_PREFIX.trim_start_matches("refused: ");
            match reason.filter(|reason| reason.starts_with(cannot)) {
                Some(answer) => Err(PortError::Refused {
                    server: format!("{}:{}", server.0, server.1),
                    request: "a change".to_owned(),
                    answer,
                }),
                None => Ok(answer),
            }
        })
        .await
}

/// Says that the name server cannot be asked, as stock does of its port.
pub(crate) fn server_away(network: &Network, error: &PortError) {
    let namespace = network.namespace();
    let text = match network.server() {
        Some(_) => format!(
            "Cannot connect to port {namespace}: {}",
            error.error_chain()
        ),
        None => format!("Cannot make connection to '{namespace}'"),
    };
    tracing::error!(target: "yarp.os.Network", "{text}");
}
