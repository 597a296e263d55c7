//! The hand at the other end.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use yarp_devices::hand::{HandError, check_move};
use yarp_devices::{Axes, Device, DeviceError, Grasp, GraspKind, Hand};
use yarp_ports::{Network, Port, PortError, PortOptions, ReconnectingConnection, blocking};
use yarp_wire::Bottle;

use super::messages::{Answer, Reply, Request};
use super::port_of;
use crate::OpenError;
use crate::open_ports::{close_all, open};
use crate::reconnect::{PORT_CLOSE_TIMEOUT, RPC_CARRIER, check_exists, connect_supervised};

/// Interval between checks whether an aborted call has ended.
const POLL_INTERVAL: Duration = Duration::from_millis(5);

/// Options of a [`RemoteHand`].
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct RemoteHandOptions {
    remote: String,
    local: String,
    rpc_timeout: Duration,
    motion_timeout: Duration,
}

impl RemoteHandOptions {
    /// The hand named `remote`, by ports named after `local`: `/hand` and, for instance, `/me/hand`.
    ///
    /// 2 s for each step of opening; two minutes for a call, which may be several commands of 15 s; 35 s for an abort.
    pub fn new(remote: impl Into<String>, local: impl Into<String>) -> Self {
        Self {
            remote: remote.into(),
            local: local.into(),
            rpc_timeout: Duration::from_secs(2),
            motion_timeout: Duration::from_secs(120),
        }
    }

    /// Sets the timeout of each step of opening, and of the query whether the hand is connected.
    pub fn rpc_timeout(mut self, rpc_timeout: Duration) -> Self {
        self.rpc_timeout = rpc_timeout;
        self
    }

    /// Sets the timeout of a call that may move the hand.
    pub fn motion_timeout(mut self, motion_timeout: Duration) -> Self {
        self.motion_timeout = motion_timeout;
        self
    }
}

/// A hand in another program: a [`Hand`] and a [`Grasp`] as the one there.
///
/// * Calls block until the motion has ended there, and never longer than [`RemoteHandOptions::motion_timeout`].
/// * One call at a time: a second one from this program is refused as [`HandError::Busy`], one from another program by the
///   hand. [`abort`](Hand::abort) works at any time, over a connection of its own.
/// * An error of the hand is a [`HandError`] here too, of the same [`kind`](HandError::kind).
/// * A lost connection fails the call in progress, which may have been executed; it is connected again when the
///   server is back. Nothing is sent again by itself.
///
/// Dropping it closes its ports and unregisters their names; that takes a few seconds at the most.
///
/// ```no_run
/// # fn example() -> Result<(), Box<dyn std::error::Error>> {
/// use yarp_devices::{Grasp, GraspKind};
/// use yarp_ports::Network;
/// use yarp_wrappers::hand::{RemoteHand, RemoteHandOptions};
///
/// let options = RemoteHandOptions::new("/hand", "/me/hand");
/// let hand = RemoteHand::open(&Network::from_process()?, options)?;
/// hand.grasp(GraspKind::Rectangular)?;
/// hand.close_fingers_with_torque()?;
/// # Ok(()) }
/// ```
#[derive(Debug)]
pub struct RemoteHand {
    /// Taken only on drop.
    link: Option<Arc<Link>>,
    calling: Mutex<ActiveCall>,
}

/// The call in progress.
#[derive(Debug, Default)]
struct ActiveCall {
    /// Number of calls so far.
    count: u64,
    /// The request in progress.
    doing: Option<String>,
}

/// The end of a call.
struct Ended<'h>(&'h RemoteHand);

impl Drop for Ended<'_> {
    fn drop(&mut self) {
        self.0.calling().doing = None;
    }
}

/// Two ports, connected to the one of the server.
#[derive(Debug)]
struct Link {
    calls: Port,
    aborts: Port,
    peer: String,
    options: RemoteHandOptions,
    /// The connections, made again whenever they are lost.
    kept: Vec<ReconnectingConnection>,
}

impl Link {
    async fn open(network: &Network, options: RemoteHandOptions) -> Result<Self, OpenError> {
        let peer = port_of(&options.remote);
        // Before anything of our own is opened: usually the server is just not running.
        check_exists(network, peer.clone()).await?;
        let local = |end: &str| format!("{}/{end}", options.local);
        let calls = open(network, local("rpc:o"), PortOptions::new().rpc_client()).await?;
        let aborts = match open(network, local("abort:o"), PortOptions::new().rpc_client()).await {
            Ok(port) => port,
            Err(error) => {
                close_all([calls]).await;
                return Err(error);
            }
        };
        let mut link = Self {
            calls,
            aborts,
            peer,
            options,
            kept: Vec::new(),
        };
        match link.greet().await {
            Ok(()) => Ok(link),
            Err(error) => {
                link.close().await;
                Err(error)
            }
        }
    }

    async fn greet(&mut self) -> Result<(), OpenError> {
        for port in [&self.calls, &self.aborts] {
            let kept =
                connect_supervised(port, &self.peer, RPC_CARRIER, self.options.rpc_timeout).await;
            self.kept.push(kept?);
        }
        let asked = self.ask(
            &self.aborts,
            &Request::IsConnected,
            self.options.rpc_timeout,
        );
        match asked.await {
            Ok(_) => Ok(()),
            Err(source) => Err(OpenError::Query {
                question: "whether it is a hand",
                source,
            }),
        }
    }

    /// Sends a request, and waits for the reply.
    async fn ask(
        &self,
        port: &Port,
        request: &Request,
        rpc_timeout: Duration,
    ) -> Result<Answer, DeviceError> {
        let message = request.to_bottle();
        let reply = port.call_within::<Bottle>(&message, rpc_timeout).await;
        let reply = reply.map_err(|error| self.lost(&message, error))?;
        match Reply::read(request, &reply) {
            Some(Reply::Done(answer)) => Ok(answer),
            Some(Reply::Refused(refused)) => {
                Err(refused.into_error(&self.peer, &message.to_string()))
            }
            None => Err(self.unreadable(&message, &reply)),
        }
    }

    fn lost(&self, message: &Bottle, error: PortError) -> DeviceError {
        let peer = &self.peer;
        DeviceError::Remote {
            peer: peer.clone(),
            step: format!("`{message}`"),
            advice: format!("`yarp ping {peer}`; when the hand is back, it is connected again"),
            source: Some(Box::new(error)),
        }
    }

    fn unreadable(&self, message: &Bottle, reply: &Bottle) -> DeviceError {
        DeviceError::Remote {
            peer: self.peer.clone(),
            step: format!("understanding the answer `{reply}` to `{message}`"),
            advice: "whether it is a hand".to_owned(),
            source: None,
        }
    }

    /// Closes the ports; takes a few seconds at the most.
    async fn close(self) {
        let closing = close_all([self.calls, self.aborts]);
        if tokio::time::timeout(PORT_CLOSE_TIMEOUT, closing)
            .await
            .is_err()
        {
            tracing::warn!(peer = %self.peer, "closing took too long; names may be left behind");
        }
    }
}

impl RemoteHand {
    /// Opens two ports of its own, `LOCAL/rpc:o` and `LOCAL/abort:o`, and connects them to the server's.
    ///
    /// * Blocks for a few deadlines at the most.
    /// * Errors: [`OpenError::NoRemote`], [`OpenError::NameTaken`], [`OpenError::Port`], [`OpenError::Connect`],
    ///   [`OpenError::Query`]; then nothing stays open.
    pub fn open(network: &Network, options: RemoteHandOptions) -> Result<Self, OpenError> {
        let network = network.with_timeout(options.rpc_timeout);
        let link = blocking::wait(async move { Link::open(&network, options).await })?;
        tracing::info!(peer = link.peer, "remote hand connected");
        Ok(Self {
            link: Some(Arc::new(link)),
            calling: Mutex::default(),
        })
    }

    /// The name of the server's port.
    pub fn peer(&self) -> &str {
        &self.link().peer
    }

    fn link(&self) -> &Arc<Link> {
        self.link.as_ref().expect("taken only on drop")
    }

    fn calling(&self) -> MutexGuard<'_, ActiveCall> {
        self.calling.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A call that may last.
    fn call(&self, request: Request) -> Result<Answer, DeviceError> {
        {
            let mut calling = self.calling();
            if let Some(doing) = calling.doing.clone() {
                return Err(HandError::Busy { doing }.at(self.peer()));
            }
            calling.count += 1;
            calling.doing = Some(request.to_bottle().to_string());
        }
        let _ended = Ended(self);
        let link = Arc::clone(self.link());
        blocking::wait(async move {
            let answer = link
                .ask(&link.calls, &request, link.options.motion_timeout)
                .await;
            // Before anybody learns of the answer, so that dropping the hand finds itself alone.
            drop(link);
            answer
        })
    }

    /// Sends a call that is answered at once, also during a motion.
    fn call_beside(&self, request: Request, rpc_timeout: Duration) -> Result<Answer, DeviceError> {
        let link = Arc::clone(self.link());
        blocking::wait(async move {
            let answer = link.ask(&link.aborts, &request, rpc_timeout).await;
            drop(link);
            answer
        })
    }

    fn order(&self, request: Request) -> Result<(), DeviceError> {
        self.call(request).map(drop)
    }

    fn numbers(&self, request: Request) -> Result<[f64; 4], DeviceError> {
        match self.call(request)? {
            Answer::Numbers(numbers) => Ok(numbers),
            other => unreachable!("{other:?} was read as the answer to this request"),
        }
    }
}

impl Drop for RemoteHand {
    fn drop(&mut self) {
        // Calls borrow the hand, so none is in progress.
        if let Some(link) = self.link.take().and_then(Arc::into_inner) {
            blocking::wait(link.close());
        }
    }
}

impl Device for RemoteHand {
    yarp_devices::offers! {
        hand: Hand,
        grasp: Grasp,
    }
}

impl Hand for RemoteHand {
    fn initialise(&self) -> Result<(), DeviceError> {
        self.order(Request::Initialise)
    }

    fn abort(&self) -> Result<(), DeviceError> {
        /// Longer than the server itself waits for the end of motions.
        const TEST_TIMEOUT: Duration = Duration::from_secs(35);
        let number = self.calling().count;
        let deadline = Instant::now() + TEST_TIMEOUT;
        loop {
            self.call_beside(Request::Abort, TEST_TIMEOUT)?;
            // A call that was on its way to the server when the abort came there has begun since.
            let calling = self.calling();
            let doing = calling.doing.clone().filter(|_| calling.count == number);
            drop(calling);
            match doing {
                None => return Ok(()),
                Some(doing) if Instant::now() > deadline => {
                    return Err(HandError::Busy { doing }.at(self.peer()));
                }
                Some(_) => thread::sleep(POLL_INTERVAL),
            }
        }
    }

    fn is_connected(&self) -> bool {
        let asked = self.call_beside(Request::IsConnected, self.link().options.rpc_timeout);
        matches!(asked, Ok(Answer::Flag(true)))
    }

    fn send_command(&self, command: &str) -> Result<String, DeviceError> {
        match self.call(Request::Command(command.to_owned()))? {
            Answer::Text(text) => Ok(text),
            other => unreachable!("{other:?} was read as the answer to a command"),
        }
    }

    fn move_fingers(&self, axes: Axes<'_>, angles: &[f64]) -> Result<(), DeviceError> {
        check_move(axes, angles)?;
        self.order(Request::Move(axes.into(), angles.to_vec()))
    }

    fn finger_positions(&self) -> Result<[f64; 4], DeviceError> {
        self.numbers(Request::Positions)
    }
}

impl Grasp for RemoteHand {
    fn open_fingers(&self) -> Result<(), DeviceError> {
        self.order(Request::Open)
    }

    fn close_fingers(&self) -> Result<(), DeviceError> {
        self.order(Request::Close)
    }

    fn close_fingers_with_torque(&self) -> Result<(), DeviceError> {
        self.order(Request::CloseWithTorque)
    }

    fn grasp(&self, kind: GraspKind) -> Result<(), DeviceError> {
        self.order(Request::Grasp(kind))
    }

    fn check_grasp(&self, expected: [Option<f64>; 4]) -> Result<[f64; 4], DeviceError> {
        self.numbers(Request::Check(expected))
    }
}
