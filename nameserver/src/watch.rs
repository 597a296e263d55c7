//! Looking after the ports that do not speak up by themselves.
//!
//! A port is looked at by asking it to describe itself, as `yarp ping` does: one short connection, at
//! most so many at once, each with a deadline, and no port more often than configured.

use std::io;
use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::task::JoinSet;
use yarp_ports::{Network, PortError, remote};
use yarp_wire::name_service::Registration;

use crate::desk::Desk;
use crate::registry::{Outcome, Terms};

/// Ports that are looked at at once.
const TOGETHER: usize = 32;
/// How long a port has to answer.
const PATIENCE: Duration = Duration::from_secs(2);
/// Time between two rounds; in each, those are looked at that are due.
const ROUND: Duration = Duration::from_secs(1);

/// Looks at ports for ever.
pub(crate) async fn over(desk: Arc<Desk>, terms: Terms) {
    let mut looking = JoinSet::new();
    let mut round = tokio::time::interval(ROUND.min(terms.every));
    round.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    let mut more = false;
    loop {
        tokio::select! {
            _ = round.tick() => {}
            Some(_) = looking.join_next(), if !looking.is_empty() => {
                if !more || looking.len() > TOGETHER / 2 {
                    continue;
                }
            }
        }
        let room = TOGETHER - looking.len();
        let due = desk.registry().to_look_at(Instant::now(), &terms, room);
        more = due.len() == room;
        for port in due {
            let desk = desk.clone();
            looking.spawn(async move {
                let how = look(desk.network(), &port, PATIENCE).await;
                let drop = desk.registry().seen(Instant::now(), &terms, &port, how);
                if drop {
                    desk.drop_port(&port);
                }
            });
        }
    }
}

/// Looks at one port, at most until `deadline`.
pub(crate) async fn look(network: &Network, port: &Registration, deadline: Duration) -> Outcome {
    let network = network.with_deadline(deadline);
    let looking = remote::describe(&network, port);
    match tokio::time::timeout(2 * deadline, looking).await {
        Ok(Ok(lines)) => told(port, &lines),
        Ok(Err(error)) => failed(&error),
        Err(_) => Outcome::Silent,
    }
}

/// Whether nobody is there who could come back by waiting.
pub(crate) fn is_gone(how: Outcome) -> bool {
    matches!(how, Outcome::Refused | Outcome::Stranger)
}

/// Ports of all versions begin with `This is NAME at ADDRESS`.
fn told(port: &Registration, lines: &[String]) -> Outcome {
    let name = lines.iter().find_map(|line| line.strip_prefix("This is "));
    let name = name.and_then(|rest| rest.split(' ').next());
    match name {
        Some(name) if name != port.name => Outcome::Stranger,
        // It speaks the protocol, whatever it says.
        _ => Outcome::Answered,
    }
}

fn failed(error: &PortError) -> Outcome {
    match error {
        PortError::Connect { source, .. } => match source.kind() {
            io::ErrorKind::ConnectionRefused => Outcome::Refused,
            _ => Outcome::NoWay,
        },
        PortError::Deadline {
            step: "TCP connection",
            ..
        } => Outcome::NoWay,
        PortError::Protocol { .. } => Outcome::Stranger,
        _ => Outcome::Silent,
    }
}
