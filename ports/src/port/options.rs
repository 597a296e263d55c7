//! How a port is to be opened.

use std::net::Ipv4Addr;
use std::pin::Pin;
use std::sync::Arc;
use std::time::Duration;

use yarp_wire::http::{Request, Response};
use yarp_wire::{Bottle, Dialect};

use super::callers::CallerLimits;
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
pub type Watcher = Arc<dyn Fn(&ConnectionChange) + Send + Sync>;

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
    pub(crate) number: Option<u16>,
    pub(crate) address: Option<Ipv4Addr>,
    pub(crate) host: Option<String>,
    pub(crate) outputs: Outputs,
    pub(crate) registered: bool,
    pub(crate) dialect: Dialect,
    pub(crate) readers: Option<Dialect>,
    pub(crate) admin: Option<AdminHandler>,
    pub(crate) pages: Option<Pages>,
    pub(crate) watcher: Option<Watcher>,
    pub(crate) type_name: Option<String>,
    pub(crate) judges_itself: bool,
    pub(super) callers: Option<CallerLimits>,
    pub(super) monitors: Vec<OwnMonitor>,
    pub(super) silence: Duration,
}

/// How long writers in datagrams may be silent before they are asked; as long as the system waits
/// before it asks the other end of a silent TCP connection.
const SILENCE: Duration = Duration::from_secs(60);

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
            number: None,
            address: None,
            host: None,
            outputs: Outputs::Any,
            registered: true,
            dialect: Dialect::default(),
            readers: None,
            admin: None,
            pages: None,
            watcher: None,
            type_name: None,
            judges_itself: false,
            callers: None,
            monitors: Vec::new(),
            silence: SILENCE,
        }
    }
}

impl PortOptions {
    /// A port that writes, and discards what arrives.
    pub fn new() -> Self {
        Self::default()
    }

    /// Keeps what arrives for [`Port::read`](super::Port::read).
    pub fn reading(mut self, queue: Queue) -> Self {
        self.input = Input::Queue(queue, Serving::Reads);
        self
    }

    /// Keeps requests for [`Port::read`](super::Port::read), each to be answered with
    /// [`Received::reply`]; takes no outgoing connections.
    pub fn serving(mut self) -> Self {
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
    pub fn calling(mut self) -> Self {
        self.outputs = Outputs::One;
        self
    }

    /// Listens on this TCP port instead of one the name server chooses.
    pub fn number(mut self, number: u16) -> Self {
        self.number = Some(number);
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
    pub fn dialect(mut self, dialect: Dialect) -> Self {
        self.dialect = dialect;
        self
    }

    /// The generation that readers are spoken to as, instead of asking each which it is: for callers of whoever
    /// understands both.
    pub fn readers_are(mut self, dialect: Dialect) -> Self {
        self.readers = Some(dialect);
        self
    }

    /// Wire type name to register, such as `yarp/vector`.
    pub fn type_name(mut self, name: impl Into<String>) -> Self {
        self.type_name = Some(name.into());
        self
    }

    /// Lets everybody send messages, whatever `roles.conf` says: the owner looks at each by itself.
    pub fn open_to_messages(mut self) -> Self {
        self.judges_itself = true;
        self
    }

    /// Ends connections that are silent for too long, and the most silent ones when there are too
    /// many. Without it a port waits for whoever has connected, as in stock.
    pub fn callers(mut self, limits: CallerLimits) -> Self {
        self.callers = Some(limits);
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
    pub fn silence(mut self, silence: Duration) -> Self {
        self.silence = silence;
        self
    }

    /// Calls `watcher` when a connection begins or ends.
    pub fn watcher(mut self, watcher: impl Fn(&ConnectionChange) + Send + Sync + 'static) -> Self {
        self.watcher = Some(Arc::new(watcher));
        self
    }
}
