//! The connections of one port, in both directions: their lists, counts and reports.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::task::JoinSet;
use yarp_wire::admin;
use yarp_wire::carrier::Carrier;

use super::counters::{Ended, Meter};
use super::dedicated_thread::ConnectionControl;
use super::monitor::Chain;
use super::multicast_group::Group;
use super::output::Output;
use super::port_context::{CLOSE_TIMEOUT, PortContext, is_port};
use super::port_options::ConnectionChange;
use super::socket_handle::SocketHandle;
use crate::cancel::join;
use crate::compiled_here::CompiledHere;
use crate::error::PortError;
use crate::log_text::{LogLimit, printable};
use crate::network::Endpoint;
use crate::port_limits::{BAD_CONNECTION_LOG_INTERVAL, BAD_CONNECTION_LOG_LINES};
use crate::remote_admin;
use crate::udp_socket;

/// The lists of connections of a port. Each list has a lock of its own, which is held for no wait.
pub(crate) struct Connections {
    port: Arc<PortContext>,
    /// Cloned by each sender, so that nothing is sent under the lock.
    outputs: Mutex<Arc<Vec<Arc<Output>>>>,
    groups: Mutex<Vec<Group>>,
    inputs: Mutex<Vec<InputEntry>>,
    next_input: AtomicU64,
    ended: Mutex<Ended>,
    /// Limit on log lines about connections that are refused or break.
    pub(super) bad_connections: LogLimit,
    /// `true` if there may be connections that carry copies of received messages.
    logged: AtomicBool,
    /// Connections that this port made to read from.
    pulls: Mutex<JoinSet<()>>,
}

/// An incoming connection as others see it.
pub(crate) struct InputEntry {
    /// Connections that began later have larger ones.
    pub(crate) id: u64,
    pub(crate) from: String,
    pub(crate) carrier_text: String,
    pub(crate) carrier: &'static Carrier,
    pub(crate) socket: SocketHandle,
    pub(crate) meter: Arc<Meter>,
    /// The monitors of its messages, if any.
    pub(super) monitors: Option<Arc<Chain>>,
    /// Ends it, or has it move to a thread of its own.
    pub(super) control: ConnectionControl,
}

/// An entry in the port's list of connections, removed on drop, also after a panic of the handler.
pub(super) struct Entry {
    pub(super) id: u64,
    pub(super) connections: Arc<Connections>,
}

impl Drop for Entry {
    fn drop(&mut self) {
        self.connections.remove_input(self.id);
    }
}

impl Connections {
    pub(crate) fn new(port: Arc<PortContext>) -> Self {
        Self {
            port,
            outputs: Mutex::default(),
            groups: Mutex::default(),
            inputs: Mutex::default(),
            next_input: AtomicU64::new(1),
            ended: Mutex::default(),
            bad_connections: LogLimit::new(BAD_CONNECTION_LOG_LINES, BAD_CONNECTION_LOG_INTERVAL),
            logged: AtomicBool::new(false),
            pulls: Mutex::default(),
        }
    }

    fn outputs_mut(&self) -> MutexGuard<'_, Arc<Vec<Arc<Output>>>> {
        let lock = || self.outputs.lock().unwrap_or_else(PoisonError::into_inner);
        let mut outputs = lock();
        // The end is reported after the beginning.
        let has_ended = |output: &Output| {
            output.send_queue.is_closed() && output.reported.load(Ordering::Acquire)
        };
        if !outputs.iter().any(|output| has_ended(output)) {
            return outputs;
        }
        let ended: Vec<_> = Arc::make_mut(&mut outputs)
            .extract_if(.., |output| has_ended(output))
            .collect();
        self.count_ended(&ended);
        // The owner may query the connections in its callback.
        drop(outputs);
        for output in &ended {
            self.report_output(output, false);
        }
        lock()
    }

    pub(crate) fn inputs(&self) -> MutexGuard<'_, Vec<InputEntry>> {
        self.inputs.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the counters of closed connections.
    pub(crate) fn ended(&self) -> MutexGuard<'_, Ended> {
        self.ended.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn count_ended(&self, outputs: &[Arc<Output>]) {
        let mut ended = self.ended();
        for output in outputs {
            ended.sent.add(output.send_queue.depth().traffic);
        }
    }

    /// Returns the outgoing connections that are up.
    pub(crate) fn outputs(&self) -> Arc<Vec<Arc<Output>>> {
        self.outputs_mut().clone()
    }

    /// Returns the outgoing connections that transmit: of those that share a group, one.
    pub(crate) fn senders(&self) -> Vec<Arc<Output>> {
        let mut senders = Vec::new();
        self.for_each_sender(|output| senders.push(output.clone()));
        senders
    }

    /// Calls `visit` for each outgoing connection that transmits, under no lock.
    pub(crate) fn for_each_sender(&self, visit: impl FnMut(&Arc<Output>)) {
        transmitting(&self.outputs(), false).for_each(visit);
    }

    pub(crate) fn add_output(&self, output: Output) {
        let output = Arc::new(output);
        {
            let mut outputs = self.outputs_mut();
            if output.logs {
                self.logged.store(true, Ordering::Relaxed);
            }
            Arc::make_mut(&mut outputs).push(output.clone());
        }
        // Not earlier: the owner may write in its callback, and that must reach the new reader.
        self.report_output(&output, true);
        output.reported.store(true, Ordering::Release);
    }

    /// Ends the outgoing connections to `name`; returns whether there was one.
    #[inline(never)]
    pub(crate) fn disconnect<'a>(&'a self, name: &'a str) -> CompiledHere<'a, bool> {
        Box::pin(async move {
            let gone: Vec<_> = Arc::make_mut(&mut self.outputs_mut())
                .extract_if(.., |output| output.to == name)
                .collect();
            self.count_ended(&gone);
            close_outputs(&gone).await;
            for output in &gone {
                self.report_output(output, false);
            }
            if gone.iter().any(|output| output.group.is_some()) {
                self.release_groups().await;
            }
            !gone.is_empty()
        })
    }

    /// Returns the multicast group of this port in the network of a reader, for the owner's
    /// messages or for copies of received ones; allocated at the first use.
    pub(super) async fn group(&self, reader: &Endpoint, logs: bool) -> Result<Group, PortError> {
        let way = udp_socket::local_address_towards(&reader.host, reader.port).await;
        let local = way.map_err(|error| {
            let step = "interface that leads to the reader";
            PortError::connect(&reader.name, &reader.host, step, error)
        })?;
        let is_it = |group: &&Group| group.local == local && group.logs == logs;
        let known = self.groups().iter().find(is_it).cloned();
        if let Some(group) = known {
            return Ok(group);
        }
        let group = Group::allocate(&self.port.network, &self.port.name, local, logs).await?;
        self.groups().push(group.clone());
        Ok(group)
    }

    /// Gives groups back that no connection uses any more.
    pub(crate) async fn release_groups(&self) {
        let outputs = self.outputs();
        let used = |group: &Group| outputs.iter().any(|output| output.is_of(group));
        let unused: Vec<Group> = self.groups().extract_if(.., |group| !used(group)).collect();
        for group in unused {
            // The name server also frees it with its owner.
            let _ = self.port.network.unregister(&group.name).await;
        }
    }

    fn groups(&self) -> MutexGuard<'_, Vec<Group>> {
        self.groups.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Ends the incoming connections from `name`; returns whether there was one.
    pub(crate) fn drop_inputs(&self, name: &str) -> bool {
        let inputs = self.inputs();
        let mut found = false;
        for entry in inputs.iter().filter(|entry| entry.from == name) {
            entry.control.end();
            found = true;
        }
        found
    }

    /// Asks the ports that write to this one to close their connections, as stock does when
    /// closing: otherwise a writer notices only at its next write.
    pub(crate) async fn disconnect_sources(&self) {
        let sources: Vec<_> = self
            .inputs()
            .iter()
            // A writer does not know the readers of a group, and need not be notified.
            .filter(|entry| entry.carrier.push)
            .map(|entry| entry.from.clone())
            .collect();
        let network = self.port.network.with_timeout(CLOSE_TIMEOUT);
        let asking: JoinSet<()> = sources
            .into_iter()
            .filter(|source| is_port(source))
            .map(|source| {
                let (network, request) = (network.clone(), admin::remove(&self.port.name));
                let asking = async move {
                    let endpoint = network.query(&source).await?;
                    remote_admin::administer(&network, &endpoint, &request).await
                };
                // One that does not answer will notice by itself.
                async move { drop(tokio::time::timeout(CLOSE_TIMEOUT, asking).await) }
            })
            .collect();
        join(asking).await;
    }

    /// Returns the number of a connection that begins now: a later one has a larger number.
    pub(super) fn next_number(&self) -> u64 {
        self.next_input.fetch_add(1, Ordering::Relaxed)
    }

    /// Records an incoming connection. Older ones from the same port are closed; if there is a
    /// newer one already, the result is `false` and this one is superseded.
    ///
    /// The time of accepting decides: headers of two connections may be read in the other order.
    pub(super) fn add_input(&self, entry: InputEntry) -> bool {
        let (from, carrier) = (entry.from.clone(), entry.carrier_text.clone());
        let mut inputs = self.inputs();
        if is_port(&from) {
            let same = || inputs.iter().filter(|other| other.from == from);
            if same().any(|other| other.id > entry.id) {
                return false;
            }
            same().for_each(|other| other.control.end());
        }
        inputs.push(entry);
        drop(inputs);
        self.report(&from, &self.port.name, &carrier, true, true);
        true
    }

    /// Records that an incoming connection continues over another socket.
    pub(crate) fn move_input(&self, id: u64, socket: SocketHandle) {
        if let Some(entry) = self.inputs().iter_mut().find(|entry| entry.id == id) {
            entry.socket = socket;
        }
    }

    /// Runs a connection that this port made to read from.
    pub(super) fn own(&self, task: impl Future<Output = ()> + Send + 'static) {
        let mut pulls = self.pulls.lock().unwrap_or_else(PoisonError::into_inner);
        while pulls.try_join_next().is_some() {}
        pulls.spawn(task);
    }

    /// Waits for the end of the connections that this port made to read from.
    pub(super) async fn join_pulls(&self) {
        let pulls = {
            let mut pulls = self.pulls.lock().unwrap_or_else(PoisonError::into_inner);
            std::mem::take(&mut *pulls)
        };
        join(pulls).await;
    }

    /// Takes note that an incoming connection ended.
    pub(crate) fn remove_input(&self, id: u64) {
        let mut inputs = self.inputs();
        let Some(index) = inputs.iter().position(|entry| entry.id == id) else {
            return;
        };
        let entry = inputs.remove(index);
        self.ended().received.add(entry.meter.traffic());
        drop(inputs);
        self.report(
            &entry.from,
            &self.port.name,
            &entry.carrier_text,
            true,
            false,
        );
    }

    fn report_output(&self, output: &Output, began: bool) {
        self.report(
            &self.port.name,
            &output.to,
            &output.carrier_text,
            false,
            began,
        );
    }

    /// Reports the beginning or end of a connection to log and owner; peers that are not ports are
    /// not reported, as in stock.
    fn report(&self, from: &str, to: &str, carrier: &str, incoming: bool, began: bool) {
        if is_port(from) && is_port(to) {
            let (from, to, carrier) = (printable(from), printable(to), printable(carrier));
            let what = match (incoming, began) {
                (true, true) => "Receiving input",
                (true, false) => "Removing input",
                (false, true) => "Sending output",
                (false, false) => "Removing output",
            };
            // As in stock, the closing message does not name the carrier.
            let using = match began {
                true => format!(" using {carrier}"),
                false => String::new(),
            };
            tracing::info!(port = %self.port.name, "{what} from {from} to {to}{using}");
        }
        if let Some(watcher) = &self.port.options.on_connection_change {
            watcher(&ConnectionChange {
                from: from.to_owned(),
                to: to.to_owned(),
                carrier: carrier.to_owned(),
                incoming,
                began,
            });
        }
    }

    /// Returns whether there may be loggers; nearly free.
    pub(super) fn is_logged(&self) -> bool {
        self.logged.load(Ordering::Relaxed)
    }

    /// Returns the connections that carry copies of received messages.
    pub(super) fn loggers(&self) -> Vec<Arc<Output>> {
        let outputs = self.outputs_mut();
        let loggers: Vec<_> = transmitting(&outputs, true).cloned().collect();
        // Under the lock, under which it is also set.
        self.logged.store(!loggers.is_empty(), Ordering::Relaxed);
        loggers
    }

    /// Counts a message from connection `id` that was dropped.
    pub(super) fn count_dropped(&self, id: u64) {
        if let Some(entry) = self.inputs().iter().find(|entry| entry.id == id) {
            entry.meter.drop_one();
        } else {
            self.ended().received.dropped += 1;
        }
    }
}

/// Ends connections, all at once: each may take its time.
pub(super) async fn close_outputs(outputs: &[Arc<Output>]) {
    let goodbyes: JoinSet<()> = outputs
        .iter()
        .cloned()
        .map(|output| async move { output.close(CLOSE_TIMEOUT).await })
        .collect();
    join(goodbyes).await;
}

/// Iterates over the outputs that transmit, either copies of received messages or the owner's: the
/// first of each group.
fn transmitting(outputs: &[Arc<Output>], logs: bool) -> impl Iterator<Item = &Arc<Output>> {
    let is_first = |at: usize, group| !outputs[..at].iter().any(|earlier| earlier.is_of(group));
    let all = outputs.iter().enumerate();
    all.filter(move |(at, output)| {
        let group = output.group.as_ref();
        output.logs == logs && group.is_none_or(|group| is_first(*at, group))
    })
    .map(|(_, output)| output)
}
