//! Listening and accepting.

use std::io;
use std::net::{IpAddr, Ipv4Addr};
use std::sync::{Arc, Once};
use std::time::{Duration, Instant};

use socket2::SockRef;
use tokio::net::TcpListener;
use tokio::task::JoinSet;
use yarp_wire::name_service::RegisterRequest;

use super::accept_throttle::{self, AcceptThrottle};
use super::connection_slots;
use super::dedicated_thread::ConnectionControl;
use super::idle_connections::ConnectionTable;
use super::input::{self, Guest, WasValid};
use super::port_options::PortOptions;
use super::port_parts::Parts;
use crate::cancel::join;
use crate::error::PortError;
use crate::log_text::LogLimit;
use crate::network::{Endpoint, Network};
use crate::port_limits::{self, ACCEPT_LOG_INTERVAL};
use crate::socket;

/// Maximum number of other TCP ports tried if the assigned one is used by a program that the name
/// server does not know. Another name server with a robot's ports may use a hundred in a row.
const MAX_BIND_ATTEMPTS: usize = 512;

/// Backlogs of the listening socket: of a port with connection limits, of other ports (stock has
/// one), and while throttling. A peer that finds the backlog full retries, after a second at first.
const LIMITED_PORT_BACKLOG: i32 = 1024;
const DEFAULT_BACKLOG: i32 = 128;
const THROTTLED_BACKLOG: i32 = 16;

/// Listens at all addresses of this machine, or at the configured one.
pub(super) fn bind(
    name: &str,
    number: u16,
    options: &PortOptions,
) -> Result<TcpListener, PortError> {
    let address = options.address.unwrap_or(Ipv4Addr::UNSPECIFIED);
    let listen = || {
        let socket = tokio::net::TcpSocket::new_v4()?;
        socket.set_reuseaddr(true)?;
        socket.bind((address, number).into())?;
        let waiting = match options.connection_limits {
            Some(_) => LIMITED_PORT_BACKLOG,
            None => DEFAULT_BACKLOG,
        };
        socket.listen(waiting as u32)
    };
    listen().map_err(|source| PortError::Listen {
        name: name.to_owned(),
        number,
        source,
    })
}

/// Listens on another TCP port chosen by the name server, and registers it.
///
/// A server assigns a name its previous number, so numbers are requested under temporary names.
/// Numbers outside the server's choice are not used: they may be unreachable.
///
/// Errors: `taken`, with what became of the attempts.
pub(super) async fn bind_other_port(
    network: &Network,
    name: &str,
    options: &PortOptions,
    taken: PortError,
) -> Result<(Endpoint, TcpListener), PortError> {
    let mut result = Err(taken);
    let mut invented = Vec::new();
    let mut end = "no more were tried".to_owned();
    while result.is_err() && invented.len() < MAX_BIND_ATTEMPTS {
        let given = match network.register_one(RegisterRequest::named("...")).await {
            Ok(given) => given,
            Err(error) => {
                end = error.error_chain();
                break;
            }
        };
        invented.push(given.name);
        if let Ok(listener) = bind(name, given.port, options) {
            let address = options.address.unwrap_or(Ipv4Addr::UNSPECIFIED);
            let asking = RegisterRequest {
                host: network.host_of(address),
                number: Some(given.port.into()),
                type_name: options.type_name.clone(),
                ..RegisterRequest::named(name)
            };
            // Otherwise the server would probe the old address first. The name was registered until
            // now, so it is none of the temporary ones.
            network.unregister(name).await?;
            result = network
                .register(asking)
                .await
                .map(|endpoint| (endpoint, listener));
        }
    }
    for name in &invented {
        // A leftover would be a superfluous name, no more.
        let _ = network.unregister(name).await;
    }
    result.map_err(|error| error.after_attempts(invented.len(), &end))
}

fn is_out_of_descriptors(error: &io::Error) -> bool {
    matches!(error.raw_os_error(), Some(libc::EMFILE | libc::ENFILE))
}

/// Logs, once, that every host can connect: ports listen at all addresses of the machine.
pub(super) fn log_missing_key() {
    static LOGGED: Once = Once::new();
    LOGGED.call_once(|| {
        tracing::debug!(
            "no auth.conf with a key: any host that reaches a port of this process can use it"
        );
    });
}

/// Wait after a failed accept.
const ACCEPT_RETRY_INTERVAL: Duration = Duration::from_millis(50);

/// Accepts connections until the port closes, then waits for them to end.
pub(super) async fn listen(parts: Arc<Parts>, listener: TcpListener) {
    let mut connections = JoinSet::new();
    let mut cancelled = parts.context.cancelled.clone();
    let table = parts
        .context
        .options
        .connection_limits
        .map(ConnectionTable::new);
    let silence = tokio::time::sleep(Duration::ZERO);
    tokio::pin!(silence);
    let mut throttle = AcceptThrottle::new(Instant::now());
    let (mut is_open, mut is_throttling) = (true, false);
    let closed = tokio::time::sleep(Duration::ZERO);
    tokio::pin!(closed);
    // Only while there may be connections whose header is not complete.
    let header_due = tokio::time::sleep(Duration::ZERO);
    tokio::pin!(header_due);
    let mut awaits_headers = false;
    let failures = LogLimit::new(1, ACCEPT_LOG_INTERVAL);
    let refusals = LogLimit::new(1, ACCEPT_LOG_INTERVAL);
    loop {
        tokio::select! {
            accepted = listener.accept(), if is_open => match accepted {
                Ok((stream, peer)) => {
                    // Without it small messages are late, but they come.
                    let _ = socket::prepare(&stream);
                    let guard = match &table {
                        None => None,
                        Some(table) => match table.admit(Instant::now()) {
                            // Everybody waits for an answer.
                            None => continue,
                            endpoint => endpoint,
                        },
                    };
                    let now = Instant::now();
                    let (control, control_receiver) = ConnectionControl::new();
                    // A port with limits of its own has its own times.
                    let due = table.is_none().then(|| now + port_limits::header_timeout());
                    let slots = connection_slots::process();
                    let slot = slots.admit(&control, due);
                    if slots.wants_to_know(now) {
                        tokio::spawn(connection_slots::ask_about_peers(parts.context.network.clone()));
                    }
                    let Some(slot) = slot else {
                        log_no_slot(&parts, &refusals, peer.ip());
                        continue;
                    };
                    if let Some(due) = due && (!awaits_headers || header_due.deadline() > due.into()) {
                        awaits_headers = true;
                        header_due.as_mut().reset(due.into());
                    }
                    let number = parts.connections.next_number();
                    let guest = Guest { address: peer.ip(), number, guard, slot, control, control_receiver };
                    connections.spawn(input::serve(parts.clone(), stream, guest));
                    let throttling = table.is_none() && throttle.is_throttling(now);
                    if throttling != is_throttling {
                        is_throttling = throttling;
                        if throttling {
                            log_throttling(&parts, peer.ip());
                        }
                        let waiting = if throttling { THROTTLED_BACKLOG } else { DEFAULT_BACKLOG };
                        // If the system refuses, the backlog remains unchanged.
                        let _ = SockRef::from(&listener).listen(waiting);
                    }
                    if throttling {
                        is_open = false;
                        closed.as_mut().reset((now + accept_throttle::ACCEPT_INTERVAL).into());
                    }
                }
                Err(error) => {
                    log_failure(&parts, &failures, &error);
                    recover(&error, table.as_ref()).await;
                }
            },
            () = &mut silence, if table.is_some() => {
                let next = table.as_ref().map(|table| table.close_idle(Instant::now()));
                let next = next.unwrap_or_else(Instant::now);
                silence.as_mut().reset(next.into());
            }
            () = &mut closed, if !is_open => is_open = true,
            () = &mut header_due, if awaits_headers => {
                match connection_slots::process().end_overdue(Instant::now()) {
                    Some(next) => header_due.as_mut().reset(next.into()),
                    None => awaits_headers = false,
                }
            }
            Some(ended) = connections.join_next(), if !connections.is_empty() => {
                if let Ok(WasValid(false)) = ended {
                    throttle.record_failure(Instant::now());
                }
            }
            () = cancelled.cancelled() => break,
        }
    }
    drop(listener);
    join(connections).await;
}

/// Logs that accepts are throttled.
fn log_throttling(parts: &Parts, address: IpAddr) {
    tracing::warn!(
        port = %parts.context.name, %address,
        "too many invalid connections, last from {address}; throttling accepts",
    );
}

/// Logs a connection that is refused because no slot of the process is free.
fn log_no_slot(parts: &Parts, refusals: &LogLimit, address: IpAddr) {
    if let Some(more) = refusals.pass(Instant::now()) {
        tracing::warn!(
            port = %parts.context.name, %address,
            "refusing a connection from {address}: all {} connections of this process are in use by ports; \
             raise `ulimit -n`{more}",
            port_limits::connections(),
        );
    }
}

/// Logs a failed accept.
fn log_failure(parts: &Parts, failures: &LogLimit, error: &io::Error) {
    if let Some(more) = failures.pass(Instant::now()) {
        tracing::warn!(port = %parts.context.name, "cannot accept: {error}{more}");
    }
}

/// Frees a descriptor after a failed accept, and waits until others may have freed some.
async fn recover(error: &io::Error, table: Option<&Arc<ConnectionTable>>) {
    if is_out_of_descriptors(error) {
        let freed = table.is_some_and(|table| table.evict_one());
        let _ = freed || connection_slots::process().make_room();
    }
    tokio::time::sleep(ACCEPT_RETRY_INTERVAL).await;
}
