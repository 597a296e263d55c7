//! Packet priority and thread scheduling of connections, requested in stock's format.
//!
//! The type of service is set on the socket of the connection and read back from it. Connections
//! are tasks that share the threads of the runtime; a connection that is given a policy gets a
//! dedicated thread ([`dedicated_thread`](super::dedicated_thread)). `process` and the name of the
//! port itself set the policy of all threads of the process, as in stock. The system must allow
//! either.

use std::io;
use std::sync::Arc;

use yarp_wire::carrier::{Carrier, Transport};
use yarp_wire::qos::{Scheduling, type_of_service};
use yarp_wire::{Bottle, Value, Vocab32};

use super::admin_reply::{fail, group, ok, pair, scheduling};
use super::administration::Administration;
use super::dedicated_thread::DedicatedThread;
use super::send_queue::SendQueue;
use super::socket_handle::SocketHandle;
use crate::thread_schedule::{self, Schedule};

/// The reason why a connection gets no dedicated thread.
const NO_THREAD_REASON: &str = "connections within a process have no thread of their own; `process` of the port itself is for \
    all threads of its process";
/// Stock's answer for a connection whose thread is unknown, and for sockets without a type of
/// service.
const UNKNOWN: i32 = -1;
const NO_SCHEDULE: Schedule = Schedule {
    policy: UNKNOWN,
    priority: UNKNOWN,
};

impl Administration {
    /// `[prop] [get] /PEER`: returns the properties of the connection to or from a port.
    pub(super) fn connection_properties(&self, name: &str) -> Bottle {
        let Some(found) = self.connections_of(name).into_iter().next() else {
            return fail(&format!("cannot find any connection to/from {name}"));
        };
        let service = found.socket.type_of_service().ok();
        let service = service.and_then(|service| i32::try_from(service).ok());
        let (schedule, thread) = match &found.thread {
            Some(thread) => (thread.schedule().unwrap_or(NO_SCHEDULE), thread.id()),
            // Stock knows the policy of a thread that reads, and none of one that only writes.
            None if found.place.is_output() => (NO_SCHEDULE, UNKNOWN),
            None => (Schedule::now().unwrap_or_default(), UNKNOWN),
        };
        Bottle::from_iter([
            scheduling(schedule, thread),
            group("qos", [pair("tos", service.unwrap_or(UNKNOWN))]),
        ])
    }

    /// `[prop] [set] /NAME GROUP...`: nothing is changed unless all of it can be.
    pub(super) async fn set_connection_properties(&self, name: &str, groups: &Bottle) -> Bottle {
        // A group without content requests nothing known.
        let wanted = |key: &str| {
            let group = groups.find_group(key)?;
            Some(group.get(1).and_then(Value::as_list))
        };
        let scheduled = |key: &str| wanted(key).map(|wanted| Scheduling::parse(wanted?));
        let refused = || Bottle::of(Vocab32::FAIL);
        match scheduled("process").filter(|_| name == self.port.name) {
            Some(None) => return refused(),
            Some(Some(process)) => {
                if let Err(error) = schedule_process(process) {
                    let text = format!("cannot schedule the threads of this process: {error}");
                    return fail(&text);
                }
            }
            None => {}
        }
        let (schedule, quality) = (scheduled("sched"), wanted("qos"));
        if schedule.is_none() && quality.is_none() {
            return ok();
        }
        let connections = self.connections_of(name);
        if connections.is_empty() || schedule == Some(None) {
            return refused();
        }
        let service = match quality.map(|quality| quality.and_then(type_of_service)) {
            Some(None) => return refused(),
            Some(Some(service)) => Some(service),
            None => None,
        };
        let unable = |error: &io::Error| fail(&format!("cannot set the type of service: {error}"));
        for found in connections.iter().filter(|_| service.is_some()) {
            if let Err(error) = found.socket.type_of_service() {
                return unable(&error);
            }
        }
        if let Some(schedule) = schedule.flatten()
            && let Err(reason) = self.schedule(&connections, schedule).await
        {
            return fail(&format!("cannot schedule this connection: {reason}"));
        }
        for found in connections {
            if let Some(service) = service
                && let Err(error) = found.socket.set_type_of_service(service)
            {
                tracing::debug!(port = %self.port.name, peer = name, service, "not set: {error}");
                return unable(&error);
            }
        }
        ok()
    }

    /// Sets the requested scheduling of each connection, on a dedicated thread; returns the reason
    /// on failure.
    async fn schedule(&self, connections: &[Found], wanted: Scheduling) -> Result<(), String> {
        let reason = |error: io::Error| thread_schedule::reason(&error);
        let mut threads = Vec::new();
        for found in connections {
            if let Some(thread) = &found.thread {
                let now = thread.schedule().map_err(reason)?;
                thread
                    .set_schedule(schedule_of(wanted, now)?)
                    .map_err(reason)?;
                continue;
            }
            let now = Schedule::now().map_err(reason)?;
            let schedule = schedule_of(wanted, now)?;
            // It has that already.
            if schedule == now {
                continue;
            }
            if !found.moves {
                return Err(NO_THREAD_REASON.to_owned());
            }
            let thread = DedicatedThread::start(Some(schedule))
                .await
                .map_err(reason)?;
            threads.push((&found.place, schedule, thread));
        }
        for (place, schedule, thread) in threads {
            let has = match place {
                FoundAt::Output(send_queue) => send_queue.give(thread.clone()),
                FoundAt::Input(id) => {
                    let inputs = self.connections.inputs();
                    match inputs.iter().find(|entry| entry.id == *id) {
                        Some(entry) => entry.control.give(thread.clone()),
                        // It has ended meanwhile.
                        None => continue,
                    }
                }
            };
            // Another request may have started a thread in the meantime.
            if !Arc::ptr_eq(&has, &thread) {
                has.set_schedule(schedule).map_err(reason)?;
            }
            let Schedule { policy, priority } = schedule;
            tracing::debug!(port = %self.port.name, thread = has.id(), policy, priority, "a connection moved to a dedicated thread");
        }
        Ok(())
    }

    /// Returns the connections to and from a port, those to it first.
    fn connections_of(&self, name: &str) -> Vec<Found> {
        let moves = |carrier: &Carrier| carrier.transport != Transport::Local;
        let mut connections: Vec<_> = self
            .connections
            .outputs()
            .iter()
            .filter(|output| output.to == name)
            .map(|output| Found {
                place: FoundAt::Output(output.send_queue.clone()),
                socket: output.socket(),
                thread: output.send_queue.thread(),
                moves: moves(output.carrier),
            })
            .collect();
        let inputs = self.connections.inputs();
        let inputs = inputs.iter().filter(|input| input.from == name);
        connections.extend(inputs.map(|input| Found {
            place: FoundAt::Input(input.id),
            socket: input.socket.clone(),
            thread: input.control.thread(),
            moves: moves(input.carrier),
        }));
        connections
    }
}

/// A connection to or from a port that was asked for.
struct Found {
    place: FoundAt,
    socket: SocketHandle,
    thread: Option<Arc<DedicatedThread>>,
    /// `true` if it can move to a dedicated thread.
    moves: bool,
}

enum FoundAt {
    Output(Arc<SendQueue>),
    /// By its number.
    Input(u64),
}

impl FoundAt {
    fn is_output(&self) -> bool {
        matches!(self, Self::Output(_))
    }
}

/// Combines the requested values with the current ones for the rest.
fn schedule_of(wanted: Scheduling, now: Schedule) -> Result<Schedule, String> {
    let number = |wanted: Option<i64>, now: i32| match wanted.map(i32::try_from) {
        None => Ok(now),
        Some(number) => number.map_err(|error| error.to_string()),
    };
    Ok(Schedule {
        policy: number(wanted.policy, now.policy)?,
        priority: number(wanted.priority, now.priority)?,
    })
}

/// Sets the requested scheduling of all threads of the process; returns the reason on failure.
fn schedule_process(wanted: Scheduling) -> Result<(), String> {
    let now = Schedule::now().map_err(|error| thread_schedule::reason(&error))?;
    let wanted = schedule_of(wanted, now)?;
    wanted
        .set()
        .map_err(|error| thread_schedule::reason(&error))?;
    tracing::info!(
        policy = wanted.policy,
        priority = wanted.priority,
        "all threads are scheduled anew"
    );
    Ok(())
}
