//! How a port is to be opened.

use std::net::Ipv4Addr;
use std::pin::Pin;
use std::sync::Arc;
use std::time::Duration;

use yarp_wire::http::{Request, Response};
use yarp_wire::{Bottle, WireVersion};

use super::idle_connections::ConnectionLimits;
use super::monitor::{Monitor, MonitorSetup, OwnMonitor};
use super::{Answer, Queue, Received};

/// Called for each message, on the task of its connection; must not block for long.
pub type Handler = Arc<dyn Fn(&mut Received) -> Answer + Send + Sync>;

/// Called for admin requests that the port itself does not know.
pub type AdminHandler = Arc<dyn Fn(&Bottle) -> Option<Bottle> + Send + Sync>;

/// Called for what browsers ask of a port; `None` leaves the answer to the port.
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
    /// Whether the port is the reader.
    pub incoming: bool,
    /// Whether it began.
    pub began: bool,
}

/// What a port does with messages that arrive.
#[derive(Clone)]
pub(crate) enum Input {
    Discard,
    Queue(Queue, Serving),
    Handler(Handler),
}

/// Whether queued messages may be replied to.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Serving {
    Reads,
    Replies,
}

/// How a port is to be opened. The default writes, and discards what arrives.
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
    pub(super) connection_limits: Option<ConnectionLimits>,
    pub(super) monitors: Vec<OwnMonitor>,
    pub(super) datagram_timeout: Duration,
}

/// How long writers in datagrams may be silent before they are asked; as long as the system waits
/// before it asks the other end of a silent TCP connection.
const DEFAULT_DATAGRAM_TIMEOUT: Duration = Duration::from_secs(60);

/// Which outgoing connections a port takes.
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
            connection_limits: None,
            monitors: Vec::new(),
            datagram_timeout: DEFAULT_DATAGRAM_TIMEOUT,
        }
    }
}

impl PortOptions {
    /// A port that writes, and discards what arrives.
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
    /// Messages of one connection come one after the other, those of several at once.
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

    /// Listens at this address of the machine alone, instead of at all.
    pub fn address(mut self, address: Ipv4Addr) -> Self {
        self.address = Some(address);
        self
    }

    /// The host that others are told, of a port that is [`unregistered`](Self::unregistered); usually the best address of
    /// the machine. For those that are registered the name server decides.
    pub fn host(mut self, host: &str) -> Self {
        self.host = Some(host.to_owned());
        self
    }

    /// Does not tell the name server.
    pub fn unregistered(mut self) -> Self {
        self.registered = false;
        self
    }

    /// The generation to assume of readers and callers that do not betray theirs.
    pub fn wire_version(mut self, wire_version: WireVersion) -> Self {
        self.wire_version = wire_version;
        self
    }

    /// The generation that readers are spoken to as, instead of asking each which it is: for callers of whoever
    /// understands both.
    pub fn peer_version(mut self, wire_version: WireVersion) -> Self {
        self.peer_version = Some(wire_version);
        self
    }

    /// Wire type name to register, such as `yarp/vector`.
    pub fn type_name(mut self, name: impl Into<String>) -> Self {
        self.type_name = Some(name.into());
        self
    }

    /// Lets everybody send messages, whatever `roles.conf` says: the owner looks at each by itself.
    pub fn allow_any_writer(mut self) -> Self {
        self.allows_any_writer = true;
        self
    }

    /// Ends connections that are silent for too long, and the most silent ones when there are too
    /// many. Without it a port waits for whoever has connected, as in stock.
    pub fn connection_limits(mut self, limits: ConnectionLimits) -> Self {
        self.connection_limits = Some(limits);
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

    /// Offers a monitor of the owner's own to connections that ask for it by
    /// `send.portmonitor+type.dll+file.NAME` or `recv.`, before one of the same name that is built
    /// in. `make` is called for each connection, and may refuse its options with a reason.
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
    /// as any port does.
    pub fn pages(
        mut self,
        pages: impl Fn(&Request) -> Option<Page> + Send + Sync + 'static,
    ) -> Self {
        self.pages = Some(Arc::new(pages));
        self
    }

    /// Asks a writer over `udp` or `mcast` from which nothing has come for so long, a minute unless
    /// told otherwise, whether it still writes here: its connection ends if its port is gone, or
    /// has not written here any more each of three times. Asking needs a name server that knows
    /// the writer; each question ends at the deadline of the network.
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
