//! Options of a port.

use std::net::Ipv4Addr;
use std::pin::Pin;
use std::sync::Arc;
use std::time::Duration;

use yarp_wire::http::{Request, Response};
use yarp_wire::{Bottle, Limits, WireVersion};

use super::idle_connections::ConnectionLimits;
use super::monitor::{Monitor, MonitorSetup, OwnMonitor};
use super::{Answer, Queue, Received};

/// Called for each message, on the task of its connection; must not block for long.
pub type Handler = Arc<dyn Fn(&mut Received) -> Answer + Send + Sync>;

/// Called for admin requests that the port itself does not handle.
pub type AdminHandler = Arc<dyn Fn(&Bottle) -> Option<Bottle> + Send + Sync>;

/// Called for HTTP requests to a port; `None` leaves the response to the port.
pub type Pages = Arc<dyn Fn(&Request) -> Option<Page> + Send + Sync>;

/// A page that is being made.
pub type Page = Pin<Box<dyn Future<Output = Response> + Send>>;

/// Called when a connection begins or ends.
pub type ConnectionObserver = Arc<dyn Fn(&ConnectionChange) + Send + Sync>;

/// A connection that began or ended.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct ConnectionChange {
    /// The writer.
    pub from: String,
    /// The reader.
    pub to: String,
    /// Carrier with its modifiers.
    pub carrier: String,
    /// `true` if the port is the reader.
    pub incoming: bool,
    /// `true` if the connection began, `false` if it ended.
    pub began: bool,
}

/// The handling of received messages.
#[derive(Clone)]
pub(crate) enum Input {
    Discard,
    Queue(Queue, Serving),
    Handler(Handler),
}

/// Selects whether queued messages can be replied to.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Serving {
    Reads,
    Replies,
}

/// Options of a port. By default it writes, and discards received messages.
#[derive(Clone)]
#[non_exhaustive]
pub struct PortOptions {
    pub(crate) input: Input,
    pub(crate) tcp_port: Option<u16>,
    pub(crate) address: Option<Ipv4Addr>,
    pub(crate) host: Option<String>,
    pub(crate) outputs: Outputs,
    pub(crate) registered: bool,
    pub(crate) wire_version: WireVersion,
    pub(crate) peer_version: Option<WireVersion>,
    pub(crate) admin: Option<AdminHandler>,
    pub(crate) pages: Option<Pages>,
    pub(crate) on_connection_change: Option<ConnectionObserver>,
    pub(crate) type_name: Option<String>,
    pub(crate) allows_any_writer: bool,
    pub(crate) administered_port: Option<String>,
    pub(crate) modifiable: bool,
    pub(crate) browsers: bool,
    pub(super) connection_limits: Option<ConnectionLimits>,
    pub(super) monitors: Vec<OwnMonitor>,
    pub(super) datagram_timeout: Duration,
    pub(super) limits: Limits,
    pub(super) copies: bool,
    pub(super) max_unsent: Option<u32>,
}

/// Idle time after which a datagram writer is probed; the same as the keepalive time of an idle TCP
/// connection.
const DEFAULT_DATAGRAM_TIMEOUT: Duration = Duration::from_secs(60);

/// The outgoing connections that a port allows.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Outputs {
    Any,
    None,
    One,
}

impl Default for PortOptions {
    fn default() -> Self {
        Self {
            input: Input::Discard,
            tcp_port: None,
            address: None,
            host: None,
            outputs: Outputs::Any,
            registered: true,
            wire_version: WireVersion::default(),
            peer_version: None,
            admin: None,
            pages: None,
            on_connection_change: None,
            type_name: None,
            allows_any_writer: false,
            administered_port: None,
            modifiable: true,
            browsers: true,
            connection_limits: None,
            monitors: Vec::new(),
            datagram_timeout: DEFAULT_DATAGRAM_TIMEOUT,
            limits: Limits::DEFAULT,
            copies: true,
            max_unsent: None,
        }
    }
}

impl PortOptions {
    /// Creates a port that writes, and discards what arrives.
    pub fn new() -> Self {
        Self::default()
    }

    /// Keeps what arrives for [`Port::read`](super::Port::read).
    pub fn queue(mut self, queue: Queue) -> Self {
        self.input = Input::Queue(queue, Serving::Reads);
        self
    }

    /// Keeps requests for [`Port::read`](super::Port::read), each to be answered with
    /// [`Received::reply`]; takes no outgoing connections.
    pub fn rpc_server(mut self) -> Self {
        self.input = Input::Queue(Queue::Wait(1), Serving::Replies);
        self.outputs = Outputs::None;
        self
    }

    /// Calls `handler` for each message, on the task of its connection.
    ///
    /// Messages of one connection are handled in order, those of several connections concurrently.
    pub fn handler(
        mut self,
        handler: impl Fn(&mut Received) -> Answer + Send + Sync + 'static,
    ) -> Self {
        self.input = Input::Handler(Arc::new(handler));
        self
    }

    /// Takes no outgoing connections.
    pub fn input_only(mut self) -> Self {
        self.outputs = Outputs::None;
        self
    }

    /// Takes one outgoing connection, for calls.
    pub fn rpc_client(mut self) -> Self {
        self.outputs = Outputs::One;
        self
    }

    /// Listens on this TCP port instead of one the name server chooses.
    pub fn tcp_port(mut self, port: u16) -> Self {
        self.tcp_port = Some(port);
        self
    }

    /// Listens at this address of the machine, instead of at [`Network::listen_address`](crate::Network::listen_address);
    /// `0.0.0.0` stands for all. One that is registered is registered with this address.
    pub fn address(mut self, address: Ipv4Addr) -> Self {
        self.address = Some(address);
        self
    }

    /// Sets the host that is announced for an [`unregistered`](Self::unregistered) port; by default
    /// the best address of the machine. For registered ports the name server decides.
    pub fn host(mut self, host: &str) -> Self {
        self.host = Some(host.to_owned());
        self
    }

    /// Does not tell the name server.
    pub fn unregistered(mut self) -> Self {
        self.registered = false;
        self
    }

    /// Sets the wire version assumed for readers and callers that do not reveal theirs.
    pub fn wire_version(mut self, wire_version: WireVersion) -> Self {
        self.wire_version = wire_version;
        self
    }

    /// Sets the wire version for messages to readers, instead of probing each: for callers of peers
    /// that understand both.
    pub fn peer_version(mut self, wire_version: WireVersion) -> Self {
        self.peer_version = Some(wire_version);
        self
    }

    /// Wire type name to register, such as `yarp/vector`.
    pub fn type_name(mut self, name: impl Into<String>) -> Self {
        self.type_name = Some(name.into());
        self
    }

    /// Allows every peer to send messages, regardless of `roles.conf`: the owner checks each
    /// message itself.
    pub fn allow_any_writer(mut self) -> Self {
        self.allows_any_writer = true;
        self
    }

    /// Allows a peer everything if `roles.conf` gives it the right to administer `port`, and else nothing but to ask what this
    /// port is; roles about this port do not count.
    ///
    /// For ports that belong to a request to `port`, and must not be more open than that.
    pub fn administrators_of(mut self, port: &str) -> Self {
        self.administered_port = Some(port.to_owned());
        self
    }

    /// Refuses `[atch]`, `[dtch]` and the scheduling of the process, whoever asks: for ports that must not fall silent
    /// because of a request.
    ///
    /// Without it programs of this machine may ask for these, those of others if `roles.conf` gives them `administer` on
    /// the port, and pages never. These rules hold for the scheduling of a connection in any case.
    pub fn deny_modification(mut self) -> Self {
        self.modifiable = false;
        self
    }

    /// Refuses every connection that begins with an HTTP request, as those of browsers do: pages, frames, and images.
    ///
    /// For ports where a web page that a user happens to visit must not have a say, whatever it sends.
    pub fn no_browsers(mut self) -> Self {
        self.browsers = false;
        self
    }

    /// Ends connections that are silent for too long, and the most silent ones when there are too
    /// many. Without it the limits of the process hold alone ([`limits`](crate::port_limits)): a port waits for whoever has
    /// sent a header, as in stock, until there are too many connections.
    pub fn connection_limits(mut self, limits: ConnectionLimits) -> Self {
        self.connection_limits = Some(limits);
        self
    }

    /// Limits messages and lines that peers send to this many bytes. A longer one ends its
    /// connection before memory is taken for it. Default: [`Limits::DEFAULT`].
    pub fn max_message(mut self, bytes: usize) -> Self {
        let line = self.limits.line.min(bytes);
        self.limits = self.limits.with_message(bytes).with_line(line);
        self
    }

    /// Refuses connections over `log.in`, which carry copies of what the port receives. Default:
    /// every port offers them, as in stock.
    pub fn without_copies(mut self) -> Self {
        self.copies = false;
        self
    }

    /// Limits the bytes that the system holds for a reader which connected to this port and does
    /// not take them. A message for one at the limit waits in its queue, where
    /// [`Port::try_write`](super::Port::try_write) sees it. By default the system decides: megabytes,
    /// which are minutes of a small stream.
    pub fn max_unsent(mut self, bytes: u32) -> Self {
        self.max_unsent = Some(bytes);
        self
    }

    /// Answers admin requests that the port itself does not know.
    pub fn admin(
        mut self,
        handler: impl Fn(&Bottle) -> Option<Bottle> + Send + Sync + 'static,
    ) -> Self {
        self.admin = Some(Arc::new(handler));
        self
    }

    /// Adds a monitor for connections that request it by `send.portmonitor+type.dll+file.NAME` or
    /// `recv.`; it precedes a built-in one of the same name. `make` is called for each connection,
    /// and may refuse its options with a reason.
    pub fn monitor(
        mut self,
        name: impl Into<String>,
        make: impl Fn(&MonitorSetup) -> Result<Arc<dyn Monitor>, String> + Send + Sync + 'static,
    ) -> Self {
        self.monitors.push(OwnMonitor {
            name: name.into(),
            factory: Arc::new(make),
        });
        self
    }

    /// Answers browsers with pages of the owner's own; what `pages` does not know, the port answers
    /// as any port does. A page may be asked for by a browser that follows a link of anybody: making it must change nothing
    /// unless [`Admission::may_only_view`](yarp_wire::http::Admission::may_only_view) is false.
    pub fn pages(
        mut self,
        pages: impl Fn(&Request) -> Option<Page> + Send + Sync + 'static,
    ) -> Self {
        self.pages = Some(Arc::new(pages));
        self
    }

    /// Sets the idle time, a minute by default, after which a `udp` or `mcast` writer is asked
    /// whether it still writes here. Its connection is closed if its port is gone, or reports three
    /// times in a row that it does not write here. Probing needs a name server that knows the
    /// writer; each probe is limited by the timeout of the network.
    pub fn datagram_timeout(mut self, timeout: Duration) -> Self {
        self.datagram_timeout = timeout;
        self
    }

    /// Calls `watcher` when a connection begins or ends.
    pub fn on_connection_change(
        mut self,
        watcher: impl Fn(&ConnectionChange) + Send + Sync + 'static,
    ) -> Self {
        self.on_connection_change = Some(Arc::new(watcher));
        self
    }
}
