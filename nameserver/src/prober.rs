//! Looking after the ports that do not speak up by themselves.
//!
//! A port is looked at by asking it to describe itself, as `yarp ping` does: one short connection, at
//! most so many at once, each with a deadline, and no port more often than configured.

use std::io;
use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::task::JoinSet;
use yarp_ports::{AdminClient, Network, PortError, remote_admin};
use yarp_wire::message::Command::Describe;
use yarp_wire::name_service::Registration;

use crate::registry::{Probe, ProbeResult};
use crate::request_handler::RequestHandler;

/// How we introduce ourselves; ports keep quiet about who is no port.
const ADMIN_NAME: &str = "admin";
/// Ports that are looked at at once.
const MAX_CONCURRENT_PROBES: usize = 32;
/// How long a port has to answer.
const PROBE_TIMEOUT: Duration = Duration::from_secs(2);
/// Time between two rounds; in each, those are looked at that are due.
const ROUND_INTERVAL: Duration = Duration::from_secs(1);

/// Looks at ports for ever, at each once in the time given.
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

/// Looks at one port, at most until twice the deadline.
pub(crate) async fn probe(network: &Network, port: &Registration, deadline: Duration) -> Probe {
    probe_connected(&network.with_timeout(deadline), port)
        .await
        .0
}

/// Looks at one port, each step in the deadline of the network; gives the conversation, if somebody is
/// there to go on with.
///
/// This is the one place where it is judged whether a port is there.
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

/// Whether nobody is there who could come back by waiting.
pub(crate) fn is_not_there(how: &Probe) -> bool {
    matches!(how.result, ProbeResult::Refused | ProbeResult::WrongPort)
}

/// Ports of all versions begin with `This is NAME at ADDRESS`.
fn check_description(port: &Registration, lines: &[String]) -> Probe {
    let name = lines.iter().find_map(|line| line.strip_prefix("This is "));
    let name = name.and_then(|rest| rest.split(' ').next());
    match name {
        Some(name) if name != port.name => Probe {
            result: ProbeResult::WrongPort,
            reason: Some(format!("another port, {name}, is where it should be")),
        },
        // It speaks the protocol, whatever it says.
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
