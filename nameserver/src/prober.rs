//! Probes registered ports that hold no lease.
//!
//! A probe asks a port to describe itself, as `yarp ping` does: one short connection with a
//! timeout. The number of concurrent probes is bounded, and no port is probed more often than
//! configured.

use std::io;
use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::task::JoinSet;
use yarp_ports::{AdminClient, Network, PortError, remote_admin};
use yarp_wire::message::Command::Describe;
use yarp_wire::name_service::Registration;

use crate::name_request_handler::RequestHandler;
use crate::registry::{Probe, ProbeResult};

/// Name that the prober sends in the handshake; ports do not log connections from names that are
/// not ports.
const ADMIN_NAME: &str = "admin";
/// Maximum number of concurrent probes.
const MAX_CONCURRENT_PROBES: usize = 32;
/// Timeout of a probe.
const PROBE_TIMEOUT: Duration = Duration::from_secs(2);
/// Interval between two rounds; each probes the ports that are due.
const ROUND_INTERVAL: Duration = Duration::from_secs(1);

/// Probes all ports forever, each once per interval `every`.
pub(crate) async fn run(request_handler: Arc<RequestHandler>, every: Duration) {
    let mut probing = JoinSet::new();
    let mut round = tokio::time::interval(ROUND_INTERVAL.min(every));
    round.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    let mut more = false;
    loop {
        tokio::select! {
            _ = round.tick() => {}
            Some(_) = probing.join_next(), if !probing.is_empty() => {
                if !more || probing.len() > MAX_CONCURRENT_PROBES / 2 {
                    continue;
                }
            }
        }
        let room = MAX_CONCURRENT_PROBES - probing.len();
        let due = request_handler
            .registry()
            .due_for_probe(Instant::now(), every, room);
        more = due.len() == room;
        for port in due {
            let request_handler = request_handler.clone();
            probing.spawn(async move {
                let probe = probe(request_handler.network(), &port, PROBE_TIMEOUT).await;
                request_handler.record_probe(&port, probe);
            });
        }
    }
}

/// Probes one port; takes at most twice `deadline`.
pub(crate) async fn probe(network: &Network, port: &Registration, deadline: Duration) -> Probe {
    probe_connected(&network.with_timeout(deadline), port)
        .await
        .0
}

/// Probes one port, with the timeout of the network for each step. Also returns the open connection
/// if the port answered.
///
/// Liveness is decided here and nowhere else.
pub(crate) async fn probe_connected(
    network: &Network,
    port: &Registration,
) -> (Probe, Option<AdminClient>) {
    let probing = async {
        let mut client = remote_admin::open_admin_client(network, port, ADMIN_NAME).await?;
        let lines = client.command(&Describe).await?;
        Ok((lines, client))
    };
    let most = 2 * network.timeout();
    let met = match tokio::time::timeout(most, probing).await {
        Ok(met) => met,
        Err(_) => Err(PortError::Timeout {
            peer: port.name.clone(),
            step: "its description",
            seconds: most.as_secs_f64(),
        }),
    };
    match met {
        Ok((lines, client)) => {
            let probe = check_description(port, &lines);
            let there = probe.result == ProbeResult::Answered;
            (probe, there.then_some(client))
        }
        Err(error) => {
            let (result, reason) = (classify_error(&error), Some(error.error_chain()));
            (Probe { result, reason }, None)
        }
    }
}

/// Returns true if waiting cannot help: no port of this name listens at the address.
pub(crate) fn is_not_there(how: &Probe) -> bool {
    matches!(how.result, ProbeResult::Refused | ProbeResult::WrongPort)
}

/// Checks a description: ports of all versions begin it with `This is NAME at ADDRESS`.
fn check_description(port: &Registration, lines: &[String]) -> Probe {
    let name = lines.iter().find_map(|line| line.strip_prefix("This is "));
    let name = name.and_then(|rest| rest.split(' ').next());
    match name {
        Some(name) if name != port.name => Probe {
            result: ProbeResult::WrongPort,
            reason: Some(format!("another port, {name}, listens at its address")),
        },
        // Any answer in the protocol counts as alive.
        _ => ProbeResult::Answered.into(),
    }
}

fn classify_error(error: &PortError) -> ProbeResult {
    match error {
        PortError::Connect { source, .. } => match source.kind() {
            io::ErrorKind::ConnectionRefused => ProbeResult::Refused,
            _ => ProbeResult::Unroutable,
        },
        PortError::Timeout {
            step: PortError::CONNECTING,
            ..
        } => ProbeResult::Unroutable,
        PortError::Protocol { .. } => ProbeResult::WrongPort,
        _ => ProbeResult::NoReply,
    }
}
