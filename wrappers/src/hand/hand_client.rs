//! The hand at the other end.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use yarp_devices::hand::{HandError, check_move};
use yarp_devices::{Axes, Device, DeviceError, Grasp, GraspKind, Hand};
use yarp_ports::{Network, PortOptions, blocking};
use yarp_wire::Bottle;

use super::RPC_PORT;
use super::messages::{Answer, Reply, Request};
use crate::OpenError;
use crate::device_ports::{Link, RemoteOptions, RemotePorts, RpcPort, SharedLink, common_setters};
use crate::reconnect::RPC_CARRIER;

const RPC: RpcPort = RpcPort {
    local: "rpc:o",
    remote: RPC_PORT,
};
/// Index of the port for calls.
const CALLS: usize = 0;
/// Index of the port for aborts.
const ABORTS: usize = 1;
/// Interval between checks whether an aborted call has ended.
const POLL_INTERVAL: Duration = Duration::from_millis(5);

/// Options of a [`RemoteHand`].
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct RemoteHandOptions {
    common: RemoteOptions,
    motion_timeout: Duration,
}

impl RemoteHandOptions {
    /// The hand named `remote`, by ports named after `local`: `/hand` and, for instance, `/me/hand`.
    ///
    /// 2 s for each step of opening; two minutes for a call, which may be several commands of 15 s; 35 s for an abort.
    pub fn new(remote: impl Into<String>, local: impl Into<String>) -> Self {
        Self {
            common: RemoteOptions::new(remote, local).carrier(RPC_CARRIER),
            motion_timeout: Duration::from_secs(120),
        }
    }

    common_setters! {
        /// Sets the timeout of each step of opening, and of the query whether the hand is connected.
        rpc_timeout(timeout: Duration);
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
    link: SharedLink<HandLink>,
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
struct HandLink {
    ports: RemotePorts,
    motion_timeout: Duration,
}

impl Link for HandLink {
    fn close(self) -> impl Future<Output = ()> + Send {
        self.ports.close()
    }
}

impl HandLink {
    async fn open(network: &Network, options: RemoteHandOptions) -> Result<Self, OpenError> {
        let common = &options.common;
        common.check_remote(network, &[RPC_PORT]).await?;
        let wanted = vec![
            (RPC.local, PortOptions::new().rpc_client()),
            ("abort:o", PortOptions::new().rpc_client()),
        ];
        let mut link = Self {
            ports: RemotePorts::open(network, common, "hand", RPC, wanted).await?,
            motion_timeout: options.motion_timeout,
        };
        let greeted = link.greet().await;
        link.unless_failed(greeted).await.map(|(link, ())| link)
    }

    async fn greet(&mut self) -> Result<(), OpenError> {
        self.ports.connect_rpc().await?;
        self.ports.connect(ABORTS, RPC_PORT).await?;
        let asked = self.ask(ABORTS, &Request::IsConnected, self.rpc_timeout());
        match asked.await {
            Ok(_) => Ok(()),
            Err(source) => Err(OpenError::Query {
                question: "whether it is a hand",
                source,
            }),
        }
    }

    fn rpc_timeout(&self) -> Duration {
        self.ports.options().rpc_timeout
    }

    /// Sends a request, and waits for the reply.
    async fn ask(
        &self,
        port: usize,
        request: &Request,
        timeout: Duration,
    ) -> Result<Answer, DeviceError> {
        let message = request.to_bottle();
        let asked = self
            .ports
            .port(port)
            .call_within::<Bottle>(&message, timeout);
        let reply = asked
            .await
            .map_err(|error| self.ports.lost(&message, error))?;
        match Reply::read(request, &reply) {
            Some(Reply::Done(answer)) => Ok(answer),
            Some(Reply::Refused(refused)) => {
                Err(refused.into_error(self.ports.rpc_peer(), &message.to_string()))
            }
            None => Err(self.ports.unreadable(
                format!("understanding the answer `{reply}` to `{message}`"),
                "whether it is a hand",
            )),
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
        let network = network.with_timeout(options.common.rpc_timeout);
        let link = blocking::wait(async move { HandLink::open(&network, options).await })?;
        tracing::info!(peer = link.ports.rpc_peer(), "remote hand connected");
        Ok(Self {
            link: SharedLink::new(link),
            calling: Mutex::default(),
        })
    }

    /// The name of the server's port.
    pub fn peer(&self) -> &str {
        self.link.ports.rpc_peer()
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
        self.link.run(|link| async move {
            let timeout = link.motion_timeout;
            link.ask(CALLS, &request, timeout).await
        })
    }

    /// Sends a call that is answered at once, also during a motion.
    fn call_beside(&self, request: Request, timeout: Duration) -> Result<Answer, DeviceError> {
        self.link
            .run(|link| async move { link.ask(ABORTS, &request, timeout).await })
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
        let asked = self.call_beside(Request::IsConnected, self.link.rpc_timeout());
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
