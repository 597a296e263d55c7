//! A port: a named place that other programs connect to.
//!
//! A port is composed of three parts with state of their own, and of one that connects:
//!
//! | part | file | state |
//! | --- | --- | --- |
//! | `Connections` | `connections` | the connections in both directions, their groups and counts |
//! | `Dispatcher` | `dispatch` | the queue of received messages, pending replies, monitors of the port |
//! | `Connector` | `connector` | none: makes outgoing connections with the two above |
//! | `Administration` | `administration` | the properties that peers set |
//!
//! `parts` composes them; `port_context` holds what does not change while the port is open.
//!
//! | file | content |
//! | --- | --- |
//! | `port_options` | options of a port |
//! | `tcp_listener`, `accept_throttle`, `idle_connections` | accepted connections, and those that send nothing |
//! | `connection_slots` | the number of connections of the process, and which one makes room |
//! | `input`, `receive_queue`, `received_message` | incoming connections and their messages |
//! | `output`, `send_queue`, `multicast_group` | outgoing connections, messages to be sent, multicast |
//! | `encode_once`, `reply_channel` | a message in the forms that readers want, pending replies |
//! | `in_process` | connections within the process |
//! | `background_closing` | ports that were dropped, until they are closed |
//! | `mjpeg_client`, `jpeg` | connections made to read from, images as browsers see them |
//! | `admin_commands`, `text_commands`, `http_server` | requests of programs and people to the port itself |
//! | `socket_qos`, `dedicated_thread` | priority of the packets and the thread of a connection |
//! | `reconnecting` | connections that are made again |
//! | `datagram_liveness` | writers in datagrams that may be gone |
//! | `log_modifier` | copies of received messages |
//! | `counters`, `counter_snapshot` | counts of messages |
//! | `monitor` | monitors that messages pass |

mod accept_throttle;
mod admin_commands;
mod admin_reply;
mod administration;
mod background_closing;
mod connection_slots;
mod connections;
mod counter_snapshot;
mod counters;
mod datagram_liveness;
pub(crate) mod dedicated_thread;
mod dispatch;
mod encode_once;
mod http_server;
mod idle_connections;
mod in_process;
mod input;
#[cfg_attr(not(feature = "jpeg"), path = "jpeg_absent.rs")]
mod jpeg;
mod jpeg_decoder;
mod large_messages;
mod log_modifier;
mod mjpeg_client;
mod monitor;
mod multicast_group;
mod output;
mod output_connector;
mod port_context;
mod port_options;
mod port_parts;
mod pray_command;
mod receive_queue;
mod received_message;
mod reconnecting;
mod reply_channel;
mod send_queue;
mod shared_reply;
mod socket_handle;
mod socket_qos;
mod tcp_listener;
mod text_commands;

use std::pin::Pin;
use std::sync::Arc;
use std::task::Poll;
use std::time::Duration;

use bytes::Bytes;
use smallvec::SmallVec;
use tokio::task::JoinHandle;
use yarp_wire::message::{Command, Payload, ReadObject, WireObject};
use yarp_wire::name_service::RegisterRequest;
use yarp_wire::{Contact, PortName, Stamp, WireVersion};

use self::background_closing::Unfinished;
use self::encode_once::Encoded;
use self::monitor::Outgoing;
use self::output::Output;
use self::port_context::PortContext;
use self::port_parts::Parts;
use crate::addresses;
use crate::cancel::Cancel;
use crate::error::PortError;
use crate::latency::Form;
use crate::lease_renewal::LeasedNames;
use crate::network::Network;

pub use background_closing::wait_for_dropped_ports;
pub use counters::{ConnectionCounters, PortCounters, Traffic};
pub use idle_connections::ConnectionLimits;
pub use large_messages::run_large;
pub use monitor::{
    Monitor, MonitorError, MonitorFactory, MonitorSetup, MonitorSide, Passing, built_in,
    built_in_names, modifier_names,
};
pub use port_options::{
    AdminHandler, ConnectionChange, ConnectionObserver, Handler, Page, Pages, PortOptions,
};
pub use receive_queue::Queue;
pub use received_message::{Answer, Received, Reply};
pub use reconnecting::{ConnectionState, ReconnectOptions, ReconnectingConnection};
pub use shared_reply::SharedReply;

/// A reader of a port, for [`Port::try_write_to`].
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Reader<'a> {
    /// Its name.
    pub name: &'a str,
    /// The wire version that it reads.
    pub wire_version: WireVersion,
}

/// An open port.
///
/// ```no_run
/// # async fn example() -> Result<(), yarp_ports::PortError> {
/// use yarp_ports::{Network, Port, PortOptions, Queue};
/// use yarp_wire::Bottle;
///
/// let network = Network::from_process()?;
/// let reader = Port::open(&network, "/reader", PortOptions::new().queue(Queue::Latest)).await?;
/// let writer = Port::open(&network, "/writer", PortOptions::new()).await?;
/// writer.connect("/reader").await?;
/// writer.write(&Bottle::of("hello")).await;
/// let message = reader.read().await?;
/// # Ok(()) }
/// ```
///
/// [`Port::close`] unregisters the name and closes the connections. Dropping the port does the same
/// in the background, as long as the runtime runs.
pub struct Port {
    parts: Arc<Parts>,
    cancel: Cancel,
    listener: Option<JoinHandle<()>>,
    registered: bool,
}

impl std::fmt::Debug for Port {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Port")
            .field("name", &self.parts.context.name)
            .finish()
    }
}

impl Port {
    /// Opens a port: listens, registers with the name server, serves connections.
    ///
    /// The name may be `...` for one that the name server chooses. If the caller is cancelled
    /// meanwhile, the port is closed in the background.
    pub async fn open(
        network: &Network,
        name: &str,
        options: PortOptions,
    ) -> Result<Self, PortError> {
        // In a task of its own: the name may be registered before the caller is cancelled.
        let (network, name) = (network.clone(), network.full_name(name));
        let asked = name.clone();
        match Self::start_opening(network, name, options).await {
            Ok((opened, _)) => opened,
            Err(error) => match error.try_into_panic() {
                Ok(panic) => std::panic::resume_unwind(panic),
                // The runtime ends.
                Err(_) => Err(PortError::Closed { name: asked }),
            },
        }
    }

    /// Opens a port in a task, which is compiled here.
    #[inline(never)]
    fn start_opening(
        network: Network,
        name: String,
        options: PortOptions,
    ) -> JoinHandle<(Result<Self, PortError>, Unfinished)> {
        let unfinished = Unfinished::new();
        tokio::spawn(async move {
            let opened = Self::open_uncancelled(&network, name, options).await;
            // A port that nobody receives is dropped with the task, and counts from then on.
            (opened, unfinished)
        })
    }

    async fn open_uncancelled(
        network: &Network,
        name: String,
        mut options: PortOptions,
    ) -> Result<Self, PortError> {
        if options.tcp_port.is_none() {
            options.tcp_port = network.fixed_number(&name)?;
        }
        if name != "..." {
            name.parse::<PortName>()?;
        }
        let mut registered = None;
        let address = options.address.unwrap_or_else(|| network.listen_address());
        options.address = Some(address);
        let (name, host, number) = if options.registered {
            let asking = RegisterRequest {
                host: network.host_of(address),
                number: options.tcp_port.map(i64::from),
                type_name: options.type_name.clone(),
                ..RegisterRequest::named(&name)
            };
            let given = network.register(asking).await?;
            registered = Some(given.clone());
            (given.name, given.host, given.port)
        } else {
            let host = options.host.take();
            let host = host.or_else(|| network.host_of(address));
            let host = host.unwrap_or_else(addresses::best);
            (name, host, options.tcp_port.unwrap_or(0))
        };
        let listener = match tcp_listener::bind(&name, number, &options) {
            Err(taken) if taken.is_taken() && options.tcp_port.is_none() => {
                let moved = tcp_listener::bind_other_port(network, &name, &options, taken).await;
                moved.map(|(endpoint, listener)| {
                    registered = Some(endpoint);
                    listener
                })
            }
            listening => listening,
        };
        let listener = match listener {
            Ok(listener) => listener,
            Err(error) => {
                if registered.is_some() {
                    // The first error is the one to report.
                    let _ = network.unregister(&name).await;
                }
                return Err(error);
            }
        };
        let number = listener
            .local_addr()
            .map_or(number, |address| address.port());
        let (cancel, cancelled) = Cancel::new();
        let parts = Arc::new(Parts::new(PortContext::new(
            name,
            host,
            number,
            network.clone(),
            options,
            cancelled,
        )));
        in_process::announce(&parts.dispatcher);
        let listener = tokio::spawn(tcp_listener::listen(parts.clone(), listener));
        let port = Self {
            parts,
            cancel,
            listener: Some(listener),
            registered: registered.is_some(),
        };
        if let Some(endpoint) = registered {
            let addresses = Network::reached_at(address);
            network.register_properties(port.name(), &addresses).await?;
            let type_name = port.parts.context.options.type_name.clone();
            LeasedNames::keep(network, &endpoint, type_name, address);
        }
        tracing::info!(port = %port.parts.context.name, "Port {} active at {}", port.name(), port.address());
        if network.key().is_none() {
            tcp_listener::log_missing_key();
        }
        Ok(port)
    }

    /// Returns the name.
    pub fn name(&self) -> &str {
        &self.parts.context.name
    }

    /// The TCP port that it listens on.
    pub fn tcp_port(&self) -> u16 {
        self.parts.context.number
    }

    /// Returns its address in stock's format: `tcp://HOST:PORT/`.
    pub fn address(&self) -> String {
        format!(
            "tcp://{}:{}/",
            self.parts.context.host, self.parts.context.number
        )
    }

    /// Returns the network it is on.
    pub fn network(&self) -> &Network {
        &self.parts.context.network
    }

    /// Connects to a reader, given as a name or a contact such as `fast_tcp://reader`.
    ///
    /// Over `tcp+log.in` the reader gets copies of the messages that this port receives, and of its
    /// replies, instead of the messages it writes.
    pub async fn connect(&self, to: &str) -> Result<(), PortError> {
        self.parts
            .connector
            .connect(&Contact::parse(to))
            .await
            .map(drop)
    }

    /// Connects to a reader over a carrier such as `fast_tcp`.
    pub async fn connect_over(&self, to: &str, carrier: &str) -> Result<(), PortError> {
        let mut contact = Contact::parse(to);
        contact.carrier = Some(carrier.to_owned());
        self.parts.connector.connect(&contact).await.map(drop)
    }

    /// Connects to a reader, given as for [`Port::connect`], and reconnects whenever the connection
    /// is lost, until the result is dropped.
    ///
    /// Returns at once; [`ReconnectingConnection::connected`] waits for the connection. A reader
    /// that restarts at another address is found if it was given by its name. A connection that
    /// another program closes is made again. Over `udp` and `mcast` the end of a reader that does
    /// not close the connection is not detected.
    ///
    /// ```no_run
    /// # async fn example(port: &yarp_ports::Port) {
    /// use yarp_ports::{ConnectionState, ReconnectOptions};
    ///
    /// let mut link = port.connect_persistent("/camera/viewer", ReconnectOptions::new());
    /// while link.state() != ConnectionState::Closed {
    ///     println!("{:?}", link.changed().await);
    /// }
    /// # }
    /// ```
    ///
    /// # Panics
    ///
    /// Panics outside a tokio runtime.
    pub fn connect_persistent(
        &self,
        to: &str,
        options: ReconnectOptions,
    ) -> ReconnectingConnection {
        ReconnectingConnection::start(self.parts.clone(), Contact::parse(to), options)
    }

    /// Ends the connection to a reader; returns whether there was one.
    pub async fn disconnect(&self, to: &str) -> bool {
        self.parts.connections.disconnect(to).await
    }

    /// Returns the readers that it is connected to.
    pub fn outputs(&self) -> Vec<String> {
        let outputs = self.parts.connections.outputs();
        outputs.iter().map(|output| output.to.clone()).collect()
    }

    /// Returns the writers that are connected to it.
    pub fn inputs(&self) -> Vec<String> {
        let inputs = self.parts.connections.inputs();
        inputs.iter().map(|input| input.from.clone()).collect()
    }

    /// Returns the oldest message that was kept and not read yet; waits for one.
    ///
    /// Needs [`PortOptions::queue`] or [`PortOptions::rpc_server`]. Cancelling loses nothing.
    pub async fn read(&self) -> Result<Received, PortError> {
        let receive_queue = self.parts.dispatcher.receive_queue.as_ref();
        let message = match receive_queue {
            Some(receive_queue) => receive_queue.pop().await,
            None => None,
        };
        message.ok_or_else(|| self.closed())
    }

    /// Returns the oldest queued message, if there is one now.
    pub fn try_read(&self) -> Option<Received> {
        self.parts.dispatcher.receive_queue.as_ref()?.try_pop()
    }

    /// Returns the number of messages dropped because they were not read soon enough.
    pub fn dropped(&self) -> u64 {
        self.parts
            .dispatcher
            .receive_queue
            .as_ref()
            .map_or(0, |receive_queue| receive_queue.dropped())
    }

    /// Returns the message counters of this port and of each of its connections.
    pub fn counters(&self) -> PortCounters {
        self.parts.dispatcher.counters()
    }

    /// Ends all waits of [`Port::read`], now and later; queued messages can still be read.
    pub fn interrupt(&self) {
        if let Some(receive_queue) = &self.parts.dispatcher.receive_queue {
            receive_queue.close();
        }
    }

    /// Sends to every reader, and waits until each has taken it: acknowledged it if the carrier has
    /// acknowledgements, else until it has been passed to the socket.
    ///
    /// Readers do not wait for each other. Returns the number of readers that took it. A reader
    /// that stops reading blocks this call; cancelling is safe, the message is then sent in the
    /// background, except to readers without room for it.
    pub async fn write(&self, message: &impl WireObject) -> usize {
        self.write_with(message, None).await
    }

    /// Sends like [`Port::write`], with an envelope such as a [`Stamp`].
    pub async fn write_with(&self, message: &impl WireObject, envelope: Option<Envelope>) -> usize {
        let Some(message) = self.monitored(message).await else {
            return 0;
        };
        let message = &message;
        let command = data(false, envelope);
        let mut encoded = Encoded::of(&command);
        let mut taken = 0;
        let mut late = Vec::new();
        let mut sent = SmallVec::<[_; 4]>::new();
        self.parts.connections.for_each_sender(|output| {
            let Some(form) = encoded.form(message, output) else {
                return;
            };
            match output.send_queue.try_push(&command, form) {
                Some(Ok(ticket)) if ticket.is_awaited() => sent.push((output.clone(), ticket)),
                Some(Ok(_)) => taken += 1,
                // It has ended.
                Some(Err(_)) => {}
                None => late.push((output.clone(), form.clone())),
            }
        });
        taken += push_late(late, &command, true).await;
        for (output, ticket) in sent {
            taken += usize::from(output.send_queue.done(ticket).await.is_ok());
        }
        // Carriers without acknowledgements never wait here: let others run now and then.
        tokio::task::coop::consume_budget().await;
        taken
    }

    /// Sends to every reader that has completed earlier messages, without waiting.
    ///
    /// A busy reader misses this message. Returns the number of readers that will get it.
    pub fn write_if_idle(&self, message: &impl WireObject, envelope: Option<Envelope>) -> usize {
        self.try_write(message, envelope, 0)
    }

    /// Sends to every reader with at most `backlog` earlier messages pending, without waiting.
    ///
    /// For periodic messages: a short delay of the machine drops no message, and a reader that is
    /// too slow still gets recent ones. The calling thread writes to the sockets directly if they
    /// accept the message at once. Returns the number of readers that will get it.
    pub fn try_write(
        &self,
        message: &impl WireObject,
        envelope: Option<Envelope>,
        backlog: usize,
    ) -> usize {
        self.try_write_to(message, envelope, backlog, |_| true)
    }

    /// Sends like [`try_write`](Self::try_write), to the selected readers alone.
    ///
    /// For messages whose layout depends on the reader.
    pub fn try_write_to(
        &self,
        message: &impl WireObject,
        envelope: Option<Envelope>,
        backlog: usize,
        select: impl Fn(&Reader<'_>) -> bool,
    ) -> usize {
        let Some((message, _)) = self.outgoing(message) else {
            return 0;
        };
        let command = data(false, envelope);
        let mut encoded = Encoded::of(&command);
        let mut taken = 0;
        self.parts.connections.for_each_sender(|output| {
            let reader = Reader {
                name: &output.to,
                wire_version: output.wire_version,
            };
            if !select(&reader) {
                return;
            }
            if output.send_queue.is_behind(backlog) {
                output.send_queue.count_dropped();
            } else {
                let Some(form) = encoded.form(&message, output) else {
                    return;
                };
                taken += usize::from(output.send_queue.push_now(&command, form).is_ok());
            }
        });
        taken
    }

    /// Sends to every reader and waits for none; messages are kept until they can be sent, up to
    /// a bound, beyond which this waits for room.
    pub async fn write_strict(
        &self,
        message: &impl WireObject,
        envelope: Option<Envelope>,
    ) -> usize {
        let Some(message) = self.monitored(message).await else {
            return 0;
        };
        let message = &message;
        let command = data(false, envelope);
        let mut encoded = Encoded::of(&command);
        let mut taken = 0;
        let mut late = Vec::new();
        self.parts.connections.for_each_sender(|output| {
            let Some(form) = encoded.form(message, output) else {
                return;
            };
            match output.send_queue.try_push(&command, form) {
                Some(pushed) => taken += usize::from(pushed.is_ok()),
                None => late.push((output.clone(), form.clone())),
            }
        });
        taken += push_late(late, &command, false).await;
        tokio::task::coop::consume_budget().await;
        taken
    }

    /// Waits until every message has been sent, and acknowledged if the carrier has
    /// acknowledgements.
    pub async fn flush(&self) {
        for output in self.parts.connections.senders() {
            // A reader that is gone has nothing left to take.
            let _ = output.send_queue.drained().await;
        }
    }

    /// Sends a request to the reader that the port is connected to, and waits for the reply.
    ///
    /// With several readers the first answers. Cancelling is safe: the reply is thrown away.
    pub async fn call<R: ReadObject>(&self, request: &impl WireObject) -> Result<R, PortError> {
        let (output, payload) = self.call_raw(request).await?;
        R::read(&payload).map_err(|source| PortError::Unreadable {
            peer: output.to.clone(),
            source,
        })
    }

    /// Calls like [`Port::call`], with a timeout.
    pub async fn call_within<R: ReadObject>(
        &self,
        request: &impl WireObject,
        deadline: Duration,
    ) -> Result<R, PortError> {
        match tokio::time::timeout(deadline, self.call(request)).await {
            Ok(result) => result,
            Err(_) => Err(PortError::Timeout {
                peer: self.outputs().first().cloned().unwrap_or_default(),
                step: "reply",
                seconds: deadline.as_secs_f64(),
            }),
        }
    }

    async fn call_raw(
        &self,
        request: &impl WireObject,
    ) -> Result<(Arc<Output>, Payload), PortError> {
        let mut first = None;
        self.parts.connections.for_each_sender(|output| {
            if output.carrier.push {
                first.get_or_insert_with(|| output.clone());
            }
        });
        let output = first.ok_or_else(|| PortError::NotConnected {
            name: self.name().to_owned(),
        })?;
        let lost = |reason: Arc<str>| PortError::Lost {
            peer: output.to.clone(),
            reason: reason.to_string(),
        };
        let stopped = || lost("a monitor stopped the request".into());
        let request = &self.monitored(request).await.ok_or_else(stopped)?;
        let command = Command::data(true);
        let waiting = {
            let mut encoded = Encoded::of(&command);
            let form = encoded.form(request, &output);
            let form = form.expect("all but pictures can carry a request");
            output.send_queue.request(&command, form).map_err(lost)?
        };
        let reply = match waiting.outcome().await {
            Ok(Some(reply)) => reply,
            Ok(None) => return Err(lost("it acknowledged without a reply".into())),
            Err(reason) => return Err(lost(reason)),
        };
        let reply = match &output.monitors {
            Some(chain) => chain.reply(reply),
            None => reply,
        };
        Ok((output, reply))
    }

    /// Passes a message through the monitor of the port, if there is one; `None` if it stops it.
    async fn monitored<'a, T: WireObject>(&self, message: &'a T) -> Option<Outgoing<'a, T>> {
        let (message, delay) = self.outgoing(message)?;
        if !delay.is_zero() {
            tokio::time::sleep(delay).await;
        }
        Some(message)
    }

    /// Passes a message like [`Port::monitored`]; also returns the delay that the monitor requests.
    fn outgoing<'a, T: WireObject>(&self, message: &'a T) -> Option<(Outgoing<'a, T>, Duration)> {
        let chain = self.parts.dispatcher.attached_out.chain();
        Outgoing::of(
            message,
            chain.as_deref(),
            self.parts.context.options.wire_version,
        )
    }

    /// Closes the connections, stops listening and unregisters the name.
    ///
    /// Takes a few seconds at most, whatever peers do.
    pub async fn close(mut self) {
        if let Some(closing) = self.shut() {
            closing.await;
        }
    }

    /// Shuts everything down; the returned future waits for the rest.
    ///
    /// It is boxed: the futures of callers would be nested as deeply as what it does.
    fn shut(&mut self) -> Option<Pin<Box<dyn Future<Output = ()> + Send>>> {
        let listener = self.listener.take()?;
        let parts = self.parts.clone();
        let registered = std::mem::take(&mut self.registered);
        self.interrupt();
        // Closed connections must not reconnect now.
        self.parts.context.close();
        if registered {
            self.parts
                .context
                .network
                .leased_names()
                .forget(&self.parts.context.name);
        }
        in_process::withdraw(&self.parts.context);
        let (keep, _) = Cancel::new();
        let cancel = std::mem::replace(&mut self.cancel, keep);
        Some(Box::pin(async move {
            connections::close_outputs(&parts.connections.outputs()).await;
            parts.connections.disconnect_sources().await;
            parts.connections.release_groups().await;
            cancel.cancel();
            // The listener ends its connections, all of which heed the signal.
            let _ = listener.await;
            parts.connections.join_pulls().await;
            if registered
                && let Err(error) = parts.context.network.unregister(&parts.context.name).await
            {
                tracing::warn!(port = %parts.context.name, "cannot unregister: {}", error.error_chain());
            }
        }))
    }

    fn closed(&self) -> PortError {
        PortError::Closed {
            name: self.name().to_owned(),
        }
    }
}

impl Drop for Port {
    fn drop(&mut self) {
        let Some(closing) = self.shut() else {
            return;
        };
        // Outside a runtime the tasks are gone already; only the name is left behind.
        if let Ok(runtime) = tokio::runtime::Handle::try_current() {
            let unfinished = Unfinished::new();
            runtime.spawn(async move {
                closing.await;
                drop(unfinished);
            });
        }
    }
}

/// Sends to readers that had no room, to each as soon as it has; returns the number of readers that
/// took it.
async fn push_late(late: Vec<(Arc<Output>, Form)>, command: &Command, watched: bool) -> usize {
    if late.is_empty() {
        return 0;
    }
    let mut sends: Vec<_> = late
        .into_iter()
        .map(|(output, form)| {
            Box::pin(async move {
                output.send_queue.room().await?;
                let ticket = output.send_queue.push(command, &form)?;
                match watched {
                    true => output.send_queue.done(ticket).await,
                    false => Ok(()),
                }
            })
        })
        .collect();
    let mut taken = 0;
    std::future::poll_fn(|context| {
        sends.retain_mut(|send| match send.as_mut().poll(context) {
            Poll::Ready(outcome) => {
                taken += usize::from(outcome.is_ok());
                false
            }
            Poll::Pending => true,
        });
        match sends.is_empty() {
            true => Poll::Ready(taken),
            false => Poll::Pending,
        }
    })
    .await
}

fn data(reply: bool, envelope: Option<Envelope>) -> Command {
    Command::Data {
        reply,
        envelope: envelope.map(|envelope| envelope.0),
    }
}

/// The envelope of a message: usually a [`Stamp`], in any case one line of text.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct Envelope(Bytes);

impl From<Stamp> for Envelope {
    fn from(stamp: Stamp) -> Self {
        Self(stamp.to_string().into())
    }
}

impl From<&str> for Envelope {
    /// Takes the text up to its first control character, as stock does.
    fn from(text: &str) -> Self {
        let end = text.find(|c: char| c.is_control()).unwrap_or(text.len());
        Self(Bytes::copy_from_slice(&text.as_bytes()[..end]))
    }
}
