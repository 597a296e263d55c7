//! How urgent the packets of a connection are: what programs ask for, in stock's words.
//!
//! The type of service is set on the socket of the connection and read back from it. Threads are
//! another matter: connections here are tasks that share the threads of the runtime, so there is
//! no thread of a connection whose priority could be raised; who asks for that is told. What can be
//! had is a policy for all threads of the process, by `process` and the name of the port itself, as
//! in stock: then those that wait for bytes have it, too. The system must allow it.

use std::fmt;
use std::io;
use std::os::fd::AsFd;
use std::sync::{Arc, Weak};
use std::time::Duration;

use socket2::{SockRef, TcpKeepalive};
use tokio::net::TcpStream;
use yarp_wire::qos::{Scheduling, type_of_service};
use yarp_wire::{Bottle, Value, Vocab32};

use super::admin::{fail, group, ok, pair};
use super::core::Core;
use crate::schedule::{self, Schedule};

/// Why a thread's priority is not set.
const NO_THREAD: &str = "a connection of this port has no thread of its own to schedule: set \
    `process` of the port itself, for all threads of its process";
/// What stock answers for a connection whose thread was not asked for, and for sockets that have
/// no type of service.
const UNKNOWN: i32 = -1;
const NO_SCHEDULE: Schedule = Schedule {
    policy: UNKNOWN,
    priority: UNKNOWN,
};

/// The socket of a connection, as long as the connection has it.
#[derive(Clone)]
pub(crate) struct SocketHandle(Weak<dyn AsFd + Send + Sync>);

impl SocketHandle {
    /// A handle that does not keep the socket open.
    pub(crate) fn of<S: AsFd + Send + Sync + 'static>(socket: &Arc<S>) -> Self {
        let weak: Weak<S> = Arc::downgrade(socket);
        Self(weak)
    }

    /// For a connection that has no socket.
    pub(crate) fn none() -> Self {
        let weak: Weak<TcpStream> = Weak::new();
        Self(weak)
    }

    /// What stands in the head of each packet.
    fn type_of_service(&self) -> io::Result<u32> {
        self.with(|socket, six| match six {
            true => socket.tclass_v6(),
            false => socket.tos_v4(),
        })
    }

    fn set_type_of_service(&self, value: u32) -> io::Result<()> {
        self.with(|socket, six| match six {
            true => socket.set_tclass_v6(value),
            false => socket.set_tos_v4(value),
        })
    }

    /// Lets the system end a TCP connection whose other host has not been heard of for this long.
    pub(crate) fn give_up_after(&self, silence: Duration) -> io::Result<()> {
        let second = Duration::from_secs(1);
        let asking = TcpKeepalive::new()
            .with_time((silence / 2).max(second))
            .with_interval((silence / 4).max(second));
        self.with(|socket, _| {
            socket.set_tcp_user_timeout(Some(silence))?;
            socket.set_tcp_keepalive(&asking)
        })
    }

    /// Calls `ask` with the socket, and with whether it speaks version 6.
    fn with<T>(&self, ask: impl FnOnce(SockRef<'_>, bool) -> io::Result<T>) -> io::Result<T> {
        let socket = self.0.upgrade().ok_or(io::ErrorKind::NotConnected)?;
        let descriptor = socket.as_fd();
        let socket = SockRef::from(&descriptor);
        let six = socket.local_addr()?.is_ipv6();
        ask(socket, six)
    }
}

impl fmt::Debug for SocketHandle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("SocketHandle")
    }
}

impl Core {
    /// `[prop] [get] /PEER`: how the connection to or from a port is treated.
    pub(super) fn connection_properties(&self, name: &str) -> Bottle {
        let (outputs, inputs) = (self.output_sockets(name), self.input_sockets(name));
        // Stock knows the policy of a thread that reads, and none of one that only writes.
        let schedule = match outputs.is_empty() {
            true => Schedule::now().unwrap_or_default(),
            false => NO_SCHEDULE,
        };
        let Some(socket) = outputs.iter().chain(&inputs).next() else {
            return fail(&format!("cannot find any connection to/from {name}"));
        };
        let service = socket.type_of_service().ok();
        let service = service.and_then(|service| i32::try_from(service).ok());
        Bottle::from_iter([
            scheduling(schedule, UNKNOWN),
            group("qos", [pair("tos", service.unwrap_or(UNKNOWN))]),
        ])
    }

    /// `[prop] [set] /NAME GROUP...`: nothing is changed unless all of it can be.
    pub(super) fn set_connection_properties(&self, name: &str, groups: &Bottle) -> Bottle {
        // A group without content asks for nothing that there is.
        let wanted = |key: &str| {
            let group = groups.find_group(key)?;
            Some(group.get(1).and_then(Value::as_list))
        };
        let scheduled = |key: &str| wanted(key).map(|wanted| Scheduling::parse(wanted?));
        let refused = || Bottle::of(Vocab32::FAIL);
        match scheduled("process").filter(|_| name == self.name) {
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
        let mut sockets = self.output_sockets(name);
        sockets.extend(self.input_sockets(name));
        if sockets.is_empty() {
            return refused();
        }
        match schedule {
            Some(None) => return refused(),
            Some(Some(schedule)) if !stays(schedule) => return fail(NO_THREAD),
            _ => {}
        }
        let Some(quality) = quality else {
            return ok();
        };
        let Some(service) = quality.and_then(type_of_service) else {
            return refused();
        };
        for socket in &sockets {
            if let Err(error) = socket.set_type_of_service(service) {
                tracing::debug!(port = %self.name, peer = name, service, "not set: {error}");
                return fail(&format!("cannot set the type of service: {error}"));
            }
        }
        ok()
    }

    fn output_sockets(&self, name: &str) -> Vec<SocketHandle> {
        let outputs = self.outputs();
        let found = outputs.iter().filter(|output| output.to == name);
        found.map(|output| output.socket.clone()).collect()
    }

    fn input_sockets(&self, name: &str) -> Vec<SocketHandle> {
        let inputs = self.inputs();
        let found = inputs.iter().filter(|input| input.from == name);
        found.map(|input| input.socket.clone()).collect()
    }
}

/// Whether all that is asked for is there already.
fn stays(wanted: Scheduling) -> bool {
    let now = Schedule::now().unwrap_or_default();
    wanted
        .policy
        .is_none_or(|policy| policy == now.policy.into())
        && wanted
            .priority
            .is_none_or(|priority| priority == now.priority.into())
}

/// Gives all threads of the process what is asked for; tells why not.
fn schedule_process(wanted: Scheduling) -> Result<(), String> {
    let now = Schedule::now().map_err(|error| schedule::reason(&error))?;
    let number = |wanted: Option<i64>, now: i32| match wanted.map(i32::try_from) {
        None => Ok(now),
        Some(number) => number.map_err(|error| error.to_string()),
    };
    let wanted = Schedule {
        policy: number(wanted.policy, now.policy)?,
        priority: number(wanted.priority, now.priority)?,
    };
    wanted.set().map_err(|error| schedule::reason(&error))?;
    tracing::info!(
        policy = wanted.policy,
        priority = wanted.priority,
        "all threads are scheduled anew"
    );
    Ok(())
}

/// `(sched ((policy P) (priority P) (tid T)))`
pub(super) fn scheduling(schedule: Schedule, thread: i32) -> Value {
    let policy = [
        pair("policy", schedule.policy),
        pair("priority", schedule.priority),
        pair("tid", thread),
    ];
    group("sched", policy)
}
