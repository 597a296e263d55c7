//! Connections of clients to their servers.

use std::fmt::Debug;
use std::sync::Arc;
use std::time::Duration;

use tokio::task::JoinSet;
use yarp_devices::DeviceError;
use yarp_ports::{
    ConnectionState, Network, Port, ReconnectOptions, ReconnectingConnection, remote_admin,
};
use yarp_wire::message::WireObject;

use crate::OpenError;

/// Queries and commands need replies, so their carrier is fixed.
pub(crate) const RPC_CARRIER: &str = "tcp";
/// Timeout of closing.
pub(crate) const PORT_CLOSE_TIMEOUT: Duration = Duration::from_secs(3);
/// Minimum and maximum pause before a lost connection is tried again.
const BACKOFF: (Duration, Duration) = (Duration::from_millis(100), Duration::from_secs(1));
/// Interval between checks whether messages still arrive.
pub(crate) const WATCH_INTERVAL: Duration = Duration::from_millis(500);

/// Sees to it that there is a port of that name.
pub(crate) async fn check_exists(network: &Network, name: String) -> Result<(), OpenError> {
    match remote_admin::exists(network, &name).await {
        Ok(true) => Ok(()),
        Ok(false) => Err(OpenError::NoRemote { name }),
        Err(source) => Err(OpenError::Port { name, source }),
    }
}

/// Returns the error for a request that no message encodes.
pub(crate) fn unsupported_request(request: &impl Debug) -> DeviceError {
    DeviceError::NotSupported {
        what: format!("{request:?} in one message"),
    }
}

/// A message as a person would type it.
pub(crate) fn to_text(message: &impl WireObject) -> String {
    let mut text = bytes::BytesMut::new();
    message.write_text(&mut text);
    String::from_utf8_lossy(&text).trim_end().to_owned()
}

/// Connects a port, and again whenever the connection is lost. An error is that of the first try.
pub(crate) async fn connect_supervised(
    port: &Port,
    to: &str,
    carrier: &str,
    deadline: Duration,
) -> Result<ReconnectingConnection, OpenError> {
    let failed = |reason: &str| OpenError::Connect {
        from: port.name().to_owned(),
        to: to.to_owned(),
        carrier: carrier.to_owned(),
        source: reason.into(),
    };
    let (first, longest) = BACKOFF;
    let options = ReconnectOptions::new()
        .backoff(first, longest)
        .connect_timeout(deadline);
    let place = format!("{carrier}:/{to}");
    let mut kept = port.connect_persistent(&place, options);
    loop {
        match kept.state() {
            ConnectionState::Connected => return Ok(kept),
            ConnectionState::Disconnected { reason } => {
                kept.end().await;
                return Err(failed(&reason));
            }
            ConnectionState::Closed => return Err(failed("the port closed")),
            _ => drop(kept.changed().await),
        }
    }
}

/// Test for missing messages of a stream; boxed, so that the task that runs it is compiled once.
pub(crate) type Missing = Box<dyn Fn() -> bool + Send>;
/// Held by whoever makes or ends the connection of a stream.
pub(crate) type Turn = Arc<tokio::sync::Mutex<()>>;

/// Connects a writer to a port of ours, and again whenever `are_missing` returns true; `asking` does the latter. An
/// error is that of the first time.
pub(crate) async fn subscribe(
    network: &Network,
    (from, to): (&str, &str),
    carrier: &str,
    asking: &mut JoinSet<()>,
    turn: Turn,
    are_missing: Missing,
) -> Result<(), OpenError> {
    remote_admin::connect(network, from, to, Some(carrier))
        .await
        .map_err(|source| OpenError::Connect {
            from: from.to_owned(),
            to: to.to_owned(),
            carrier: carrier.to_owned(),
            source: source.into(),
        })?;
    let (from, to, carrier) = (from.to_owned(), to.to_owned(), carrier.to_owned());
    asking.spawn(resubscribe(
        network.clone(),
        from,
        to,
        carrier,
        turn,
        are_missing,
    ));
    Ok(())
}

/// Connects a writer again whenever no messages arrive: it is the writer that connects, so that no other side notices
/// when it comes back.
async fn resubscribe(
    network: Network,
    from: String,
    to: String,
    carrier: String,
    turn: Turn,
    are_missing: Missing,
) {
    loop {
        tokio::time::sleep(WATCH_INTERVAL).await;
        let _turn = turn.lock().await;
        if are_missing()
            && let Err(error) = remote_admin::connect(&network, &from, &to, Some(&carrier)).await
        {
            tracing::debug!(%from, "cannot ask for messages: {error}");
        }
    }
}
