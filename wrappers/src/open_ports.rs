//! Opening ports: all of them, or none.

use yarp_ports::{Network, Port, PortOptions, remote_admin};

use crate::OpenError;

/// Bytes of a request or command to a device, as written on the wire; the largest in use have a few kilobytes.
pub(crate) const MAX_REQUEST: usize = 256 << 10;

/// Returns the options of a port that takes requests or commands of a device.
///
/// A bottle takes many times the memory of its bytes, so that a longer message ends its connection instead.
pub(crate) fn request_port() -> PortOptions {
    PortOptions::new().max_message(MAX_REQUEST)
}

/// Opens a port with a name that no other port has.
///
/// A name server gives a name away again to any client that asks, so that a second port of one name replaces the
/// first. For a robot that must not happen by mistake.
pub(crate) async fn open(
    network: &Network,
    name: String,
    options: PortOptions,
) -> Result<Port, OpenError> {
    match remote_admin::owner(network, &name).await {
        Ok(Some(owner)) => return Err(OpenError::NameTaken { name, owner }),
        Ok(None) => {}
        Err(source) => return Err(OpenError::Port { name, source }),
    }
    Port::open(network, &name, options)
        .await
        .map_err(|source| OpenError::Port { name, source })
}

/// Returns the name of a port: `PREFIX/SUFFIX`, or the prefix alone if the suffix is empty.
pub(crate) fn port_name(prefix: &str, suffix: &str) -> String {
    match suffix {
        "" => prefix.to_owned(),
        _ => format!("{prefix}/{suffix}"),
    }
}

/// Opens ports by their names, in this order; all of them, or none.
pub(crate) async fn open_all(
    network: &Network,
    wanted: Vec<(String, PortOptions)>,
) -> Result<Vec<Port>, OpenError> {
    let mut opened = Vec::with_capacity(wanted.len());
    for (name, options) in wanted {
        match open(network, name, options).await {
            Ok(port) => opened.push(port),
            Err(error) => {
                close_all(opened).await;
                return Err(error);
            }
        }
    }
    Ok(opened)
}

/// Closes ports concurrently; takes a few seconds at most, even if peers do not answer.
pub(crate) async fn close_all(ports: impl IntoIterator<Item = Port>) {
    let closing: tokio::task::JoinSet<()> = ports.into_iter().map(Port::close).collect();
    closing.join_all().await;
}
