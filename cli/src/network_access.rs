//! Access to the configured network, with stock's messages.

use std::time::Duration;

use yarp_ports::config::ResourceFinder;
use yarp_ports::{AdminClient, Endpoint, Network, Port, PortError, PortOptions, remote_admin};
use yarp_wire::carrier::Carrier;
use yarp_wire::message::{Command, WireObject};
use yarp_wire::name_service::UNSUPPORTED_PREFIX;
use yarp_wire::{Bottle, Contact, PortName, Value};
use yarp_wrappers::network_time;

use crate::error::Result;
use crate::signals::Interrupt;

/// Name of the client in administrative connections.
const ADMIN_NAME: &str = "admin";
/// Timeout for a port that may have the requested name.
const ALIVE_TIMEOUT: Duration = Duration::from_secs(2);
/// Timeout for the name server.
const NAME_SERVER_TIMEOUT: Duration = Duration::from_secs(5);
/// A timeout that never expires in practice; such a wait ends on a signal.
pub(crate) const FOREVER: Duration = Duration::from_secs(30 * 24 * 3600);

/// Returns the network of this process; warns as stock does if it has no name server.
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

/// Returns whether `YARP_CLOCK` names a clock.
pub(crate) fn names_clock() -> bool {
    std::env::var("YARP_CLOCK").is_ok_and(|clock| !clock.is_empty())
}

/// Follows the clock of `YARP_CLOCK`, if it is set, until the command ends. A signal ends the wait for the clock.
pub(crate) async fn follow_clock(network: &Network, interrupt: &mut Interrupt) -> Result<()> {
    Ok(network_time::follow_until(network, interrupt.interrupted()).await?)
}

/// Returns the resource finder of a program with this command line, with `file` as default
/// configuration file. Logs errors in the files it reads.
pub(crate) fn finder(words: &[String], file: Option<&str>) -> Result<ResourceFinder> {
    let mut finder = ResourceFinder::from_process()?;
    for problem in finder.configure(words, file)? {
        tracing::error!(target: "yarp.os.Property", "{problem}");
    }
    Ok(finder)
}

/// Returns true if the name server of `network` answers for its namespace.
pub(crate) async fn serves(network: &Network, namespace: &str) -> bool {
    let impatient = network.with_timeout(network.timeout().min(NAME_SERVER_TIMEOUT));
    impatient.query(namespace).await.is_ok()
}

/// Returns the address of a port, if it is registered; logs an error if the name server does not
/// answer.
pub(crate) async fn find(network: &Network, contact: &Contact) -> Result<Option<Endpoint>> {
    match network.resolve(contact).await {
        Ok(place) => Ok(Some(place)),
        Err(PortError::Unknown { .. } | PortError::NoNameServer) => Ok(None),
        Err(error @ PortError::NameServer { .. }) => {
            log_unreachable(&error);
            Ok(None)
        }
        Err(error) => Err(error.into()),
    }
}

/// Logs that the name server does not answer: stock's two lines, and the reason.
pub(crate) fn log_unreachable(error: &PortError) {
    const COMPONENT: &str = "yarp.os.impl.NameClient";
    tracing::info!(target: COMPONENT, "No connection to nameserver");
    tracing::info!(target: COMPONENT, "*** try running: yarp detect ***");
    tracing::error!(target: COMPONENT, "{}", error.error_chain());
}

/// Opens a port; logs stock's message and returns `None` on failure.
///
/// Without a name server the port is opened but not registered. A name in use stays with its port.
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
        if let Ok(Some(owner)) =
            remote_admin::owner(&network.with_timeout(ALIVE_TIMEOUT), name).await
        {
            tracing::error!(target: COMPONENT, "{name} belongs to {owner}");
        }
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

/// Returns the address of the port with this name, if it answers with this name.
pub(crate) async fn alive(network: &Network, name: &str) -> Option<Endpoint> {
    let network = network.with_timeout(ALIVE_TIMEOUT);
    let place = network.query(name).await.ok()?;
    let lines = remote_admin::describe(&network, &place).await.ok()?;
    let greeting = format!("This is {name} ");
    lines.first()?.starts_with(&greeting).then_some(place)
}

/// Sends the name server a request that it answers with a bottle.
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
            let answer = opening.await?.call(&Command::data(true), request).await?;
            // This refusal concerns one server; another server of the same names may accept the
            // request.
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

/// Logs that the name server cannot be reached, as stock does for its port.
pub(crate) fn log_server_unreachable(network: &Network, error: &PortError) {
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
