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

use crate::desk::Desk;
use crate::registry::{Look, Outcome};

/// How we introduce ourselves; ports keep quiet about who is no port.
const ADMIN: &str = "admin";
/// Ports that are looked at at once.
const TOGETHER: usize = 32;
/// How long a port has to answer.
const PATIENCE: Duration = Duration::from_secs(2);
/// Time between two rounds; in each, those are looked at that are due.
const ROUND: Duration = Duration::from_secs(1);

/// Looks at ports for ever, at each once in the time given.
pub(crate) async fn over(desk: Arc<Desk>, every: Duration) {
    let mut looking = JoinSet::new();
    let mut round = tokio::time::interval(ROUND.min(every));
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
        let due = desk.registry().to_look_at(Instant::now(), every, room);
        more = due.len() == room;
        for port in due {
            let desk = desk.clone();
            looking.spawn(async move {
                let look = look(desk.network(), &port, PATIENCE).await;
                desk.note(&port, look);
            });
        }
    }
}

/// Looks at one port, at most until twice the deadline.
pub(crate) async fn look(network: &Network, port: &Registration, deadline: Duration) -> Look {
    meet(&network.with_timeout(deadline), port).await.0
}

/// Looks at one port, each step in the deadline of the network; gives the conversation, if somebody is
/// there to go on with.
///
/// This is the one place where it is judged whether a port is there.
pub(crate) async fn meet(network: &Network, port: &Registration) -> (Look, Option<AdminClient>) {
    let looking = async {
        let mut client = remote_admin::open_admin_client(network, port, ADMIN).await?;
        let lines = client.command(&Describe).await?;
        Ok((lines, client))
    };
    let most = 2 * network.timeout();
    let met = match tokio::time::timeout(most, looking).await {
        Ok(met) => met,
        Err(_) => Err(PortError::Timeout {
            peer: port.name.clone(),
            step: "its description",
            seconds: most.as_secs_f64(),
        }),
    };
    match met {
        Ok((lines, client)) => {
            let look = told(port, &lines);
            let there = look.outcome == Outcome::Answered;
            (look, there.then_some(client))
        }
        Err(error) => {
            let (outcome, reason) = (failed(&error), Some(error.error_chain()));
            (Look { outcome, reason }, None)
        }
    }
}

/// Whether nobody is there who could come back by waiting.
pub(crate) fn is_gone(how: &Look) -> bool {
    matches!(how.outcome, Outcome::Refused | Outcome::Stranger)
}

/// Ports of all versions begin with `This is NAME at ADDRESS`.
fn told(port: &Registration, lines: &[String]) -> Look {
    let name = lines.iter().find_map(|line| line.strip_prefix("This is "));
    let name = name.and_then(|rest| rest.split(' ').next());
    match name {
        Some(name) if name != port.name => Look {
            outcome: Outcome::Stranger,
            reason: Some(format!("another port, {name}, is where it should be")),
        },
        // It speaks the protocol, whatever it says.
        _ => Outcome::Answered.into(),
    }
}

fn failed(error: &PortError) -> Outcome {
    match error {
        PortError::Connect { source, .. } => match source.kind() {
            io::ErrorKind::ConnectionRefused => Outcome::Refused,
            _ => Outcome::NoWay,
        },
        PortError::Timeout {
            step: PortError::CONNECTING,
            ..
        } => Outcome::NoWay,
        PortError::Protocol { .. } => Outcome::Stranger,
        _ => Outcome::Silent,
    }
}
