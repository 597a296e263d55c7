//! Connects ports of other programs, with stock's messages.

use yarp_ports::remote_admin::{self, ConnectError, Connection};
use yarp_ports::{Network, PortError};
use yarp_wire::Contact;

use crate::error::Result;
use crate::network_access;

const COMPONENT: &str = "yarp.os.Network";

/// Selects the results that are logged.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Verbosity {
    /// Success and failure.
    All,
    /// Failure only.
    FailuresOnly,
}

/// Connects two ports; returns true on success.
pub(crate) async fn connect(
    network: &Network,
    source: &str,
    destination: &str,
    carrier: Option<&str>,
    verbosity: Verbosity,
) -> bool {
    if let Some(text) = refused(source, destination) {
        tracing::error!(target: COMPONENT, "Failure: {text}");
        return false;
    }
    let result = remote_admin::connect(network, source, destination, carrier).await;
    log_result(source, destination, result, verbosity)
}

/// Disconnects two ports; returns true on success.
pub(crate) async fn disconnect(network: &Network, source: &str, destination: &str) -> bool {
    if let Some(text) = refused(source, destination) {
        tracing::error!(target: COMPONENT, "Failure: {text}");
        return false;
    }
    let result = remote_admin::disconnect(network, source, destination).await;
    log_result(source, destination, result, Verbosity::All)
}

/// Returns the reason why two names cannot be connected, before any request is sent.
fn refused(source: &str, destination: &str) -> Option<String> {
    let invalid = |text: &str| {
        let contact = Contact::parse(text);
        let name = &contact.name;
        let anonymous = name.is_empty() && contact.address.is_some();
        !anonymous && (!name.starts_with('/') || name.ends_with('/'))
    };
    if source.contains(' ') || destination.contains(' ') {
        Some(format!(
            "no way to make connection {source}->{destination}, one of the port names contains a space character."
        ))
    } else if invalid(source) {
        Some(format!(
            "no way to make connection, invalid source '{source}'"
        ))
    } else if invalid(destination) {
        Some(format!(
            "no way to make connection, invalid destination '{destination}'"
        ))
    } else {
        None
    }
}

fn log_result(
    source: &str,
    destination: &str,
    result: std::result::Result<String, ConnectError>,
    verbosity: Verbosity,
) -> bool {
    let text = match result {
        Ok(text) => {
            if verbosity == Verbosity::All {
                // The answer of a port ends with its own line end.
                tracing::info!(target: COMPONENT, "Success: {text}\r\n");
            }
            return true;
        }
        Err(ConnectError::NoSource { .. } | ConnectError::Port(PortError::NoNameServer)) => {
            format!("Failure: could not find source port {source}")
        }
        Err(ConnectError::NoDestination { .. }) => {
            format!("Failure: could not find destination port {destination}")
        }
        Err(ConnectError::Port(error @ PortError::NameServer { .. })) => {
            network_access::log_unreachable(&error);
            format!("Failure: could not find source port {source}")
        }
        Err(ConnectError::Port(PortError::Connect { peer, .. })) => {
            format!("Cannot connect to port {peer}")
        }
        Err(ConnectError::Port(error)) => format!("Failure: {}", error.error_chain()),
        Err(ConnectError::Refused { text }) => format!("Failure: {text}\r\n"),
        Err(error) => format!("Failure: {error}"),
    };
    tracing::error!(target: COMPONENT, "{text}");
    false
}

/// Returns true if two ports are connected: with the carrier that `destination` names, else with any.
pub(crate) async fn is_connected(
    network: &Network,
    source: &str,
    destination: &str,
) -> Result<bool> {
    let found = find_connection(network, source, destination).await?;
    match found {
        Some((connection, wanted)) => {
            let Connection {
                from, to, carrier, ..
            } = &connection;
            let connected = wanted.is_none_or(|wanted| is_carrier(carrier, &wanted));
            if connected {
                tracing::info!(target: COMPONENT, "Connection found between {from} and {to} using carrier {carrier}");
            } else {
                tracing::info!(target: COMPONENT, "No connection from {source} to {destination} found: {from} and {to} are connected using carrier {carrier}");
            }
            Ok(connected)
        }
        None => {
            tracing::info!(target: COMPONENT, "No connection from {source} to {destination} found");
            Ok(false)
        }
    }
}

/// Returns true if a connection uses the wanted carrier; without modifiers in `wanted`, the connection may have any.
fn is_carrier(carrier: &str, wanted: &str) -> bool {
    let base = carrier.split('+').next().unwrap_or(carrier);
    carrier == wanted || base == wanted
}

/// Returns the connection between two ports, and the carrier that `destination` or else `source` names.
async fn find_connection(
    network: &Network,
    source: &str,
    destination: &str,
) -> Result<Option<(Connection, Option<String>)>> {
    let (from, to) = (Contact::parse(source), Contact::parse(destination));
    let wanted = to.carrier.clone().or_else(|| from.carrier.clone());
    let Some(from) = network_access::find(network, &from).await? else {
        tracing::error!(target: COMPONENT, "Failure: could not find source port {source}");
        return Ok(None);
    };
    let Some(reader) = network_access::find(network, &to).await? else {
        tracing::error!(target: COMPONENT, "Failure: could not find destination port {destination}");
        return Ok(None);
    };
    match remote_admin::connection_of_either(network, &from, &reader).await {
        Ok(known) => Ok(known.map(|known| (known, wanted))),
        Err(_) => {
            tracing::error!(target: COMPONENT, "Cannot connect to port {source}");
            Ok(None)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_carrier_without_modifiers_means_any_modifiers() {
        let check = |carrier: &str, wanted: &str, expected: bool| {
            assert_eq!(is_carrier(carrier, wanted), expected, "{carrier} {wanted}");
        };
        check("udp", "udp", true);
        check("udp", "tcp", false);
        check("tcp+log.in", "tcp", true);
        check("tcp+log.in", "tcp+log.in", true);
        check("tcp", "tcp+log.in", false);
        check("fast_tcp", "tcp", false);
    }

    #[test]
    fn invalid_names_are_refused_as_in_stock() {
        let check = |source: &str, destination: &str, expected: Option<&str>| {
            assert_eq!(refused(source, destination).as_deref(), expected);
        };
        check("/a", "/b", None);
        check("tcp://a", "tcp://10.0.0.1:10002/", None);
        check(
            "w",
            "/r",
            Some("no way to make connection, invalid source 'w'"),
        );
        check(
            "/w",
            "/w/",
            Some("no way to make connection, invalid destination '/w/'"),
        );
        check(
            "/w x",
            "/r",
            Some(
                "no way to make connection /w x->/r, one of the port names contains a space character.",
            ),
        );
    }
}
