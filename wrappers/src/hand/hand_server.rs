//! A hand on a port.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use tokio::task::spawn_blocking;
use yarp_devices::hand::HandError;
use yarp_devices::{Device, DeviceError, Grasp, Hand};
use yarp_ports::{Answer as PortAnswer, Network, Received};
use yarp_wire::Bottle;

use super::messages::{Answer, Refused, Reply, Request, help};
use super::{RPC_PORT, port_of};
use crate::OpenError;
use crate::device_ports::{PortWork, ServedPort, ServedPorts};
use crate::open_ports::request_port;
use crate::page_request::request_of;

/// Timeout of the end of motions when the hand is stopped.
const STOP_TIMEOUT: Duration = Duration::from_secs(30);
/// Interval between checks whether they have ended.
const POLL_INTERVAL: Duration = Duration::from_millis(5);

/// A hand, served as a whole on `NAME/hand/rpc:i`.
///
/// * Each call lasts as long as its motion; only the connection that it came over waits. Two motions at once are for the
///   device to judge: a hand refuses the second.
/// * An abort ends every motion that was requested before it, and is answered when they have ended. It is for
///   anybody, and comes over another connection than the motion.
/// * A client that vanishes leaves its motion to end by itself, as a hand's motions do; closing the server stops it.
/// * Invalid requests are answered `[fail] malformed` with words, and move nothing.
///
/// Dropping it closes the port in the background.
///
/// ```no_run
/// # async fn example() -> Result<(), Box<dyn std::error::Error>> {
/// use std::sync::Arc;
/// use yarp_devices::hand::{BarrettHand, HandBoard, HandOptions};
/// use yarp_ports::Network;
/// use yarp_wrappers::HandServer;
///
/// let board = HandBoard::start(BarrettHand::open(HandOptions::new("/dev/ttyUSB0"))?)?;
/// let server = HandServer::open(&Network::from_process()?, Arc::new(board), "/robot").await?;
/// tokio::signal::ctrl_c().await?;
/// server.close().await;
/// # Ok(()) }
/// ```
#[derive(Debug)]
pub struct HandServer {
    ports: ServedPorts<Arc<ServedHand>>,
}

impl HandServer {
    /// Opens the port.
    ///
    /// * `name`: begins with `/`; the port is `NAME/hand/rpc:i`.
    /// * Errors: [`OpenError::NoInterface`] when the device is no hand, [`OpenError::NameTaken`], [`OpenError::Port`].
    pub async fn open(
        network: &Network,
        device: Arc<dyn Device>,
        name: &str,
    ) -> Result<Self, OpenError> {
        if device.hand().is_none() || device.grasp().is_none() {
            return Err(OpenError::NoInterface("interfaces of a hand"));
        }
        let served = Arc::new(ServedHand {
            device,
            port: port_of(name),
            under_way: Mutex::default(),
            ending: AtomicBool::new(false),
        });
        let answering = {
            let served = Arc::clone(&served);
            move |received: &mut Received| served.answer(received)
        };
        let options = request_port().handler(answering).input_only();
        let wanted = vec![ServedPort::input(RPC_PORT, options)];
        let ports = ServedPorts::open(network, name, wanted, |_| Ok(served.clone())).await?;
        tracing::info!(port = served.port, "hand served");
        Ok(Self { ports })
    }

    /// Stops motions in progress, closes the port and unregisters its name. The hand itself continues.
    ///
    /// Takes a few seconds at the most, unless the hand cannot be stopped.
    pub async fn close(self) {
        self.ports.close().await;
    }
}

impl PortWork for Arc<ServedHand> {
    /// Stops motions in progress.
    async fn end(self) {
        self.ending.store(true, Ordering::Release);
        if !self.under_way().waiting.is_empty() {
            let served = Arc::clone(&self);
            let stopping = spawn_blocking(move || served.stop());
            if let Ok(Err(error)) = stopping.await {
                tracing::warn!(port = self.port, "{}", error.words);
            }
        }
    }
}

/// The hand behind the port, and its requests.
struct ServedHand {
    device: Arc<dyn Device>,
    /// Name of the port.
    port: String,
    under_way: Mutex<RunningMotions>,
    ending: AtomicBool,
}

impl fmt::Debug for ServedHand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ServedHand")
            .field("port", &self.port)
            .finish_non_exhaustive()
    }
}

/// Requests that last, from when they arrive until they are answered.
#[derive(Default)]
struct RunningMotions {
    next: u64,
    /// By their number, whether they were aborted.
    waiting: BTreeMap<u64, bool>,
}

/// One of them; it ends when this is dropped.
struct RunningMotion {
    served: Arc<ServedHand>,
    number: u64,
}

impl Drop for RunningMotion {
    fn drop(&mut self) {
        self.served.under_way().waiting.remove(&self.number);
    }
}

impl ServedHand {
    fn under_way(&self) -> MutexGuard<'_, RunningMotions> {
        self.under_way
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }

    /// Executes a message and returns the reply.
    fn answer(self: &Arc<Self>, received: &Received) -> PortAnswer {
        let message = request_of(received);
        let from = Arc::clone(&received.from);
        let request = match Request::parse(&message) {
            Ok(Request::Help) => return PortAnswer::reply(help()),
            Ok(request) => request,
            Err(error) => return PortAnswer::reply(refuse(&message, &from, error.into())),
        };
        // From here on an abort is about it too.
        let lasting = request.lasts().then(|| self.begin());
        let served = Arc::clone(self);
        let work = spawn_blocking(move || {
            let outcome = served.carry_out(&request, lasting.as_ref());
            drop(lasting);
            match outcome {
                Ok(answer) => Reply::Done(answer).to_bottle(),
                Err(refused) => refuse(&message, &from, refused),
            }
        });
        PortAnswer::Later(Box::pin(async move {
            match work.await {
                Ok(reply) => PortAnswer::reply(reply),
                // It panicked, which has been logged, or the program ends.
                Err(_) => PortAnswer::Nothing,
            }
        }))
    }

    fn begin(self: &Arc<Self>) -> RunningMotion {
        let mut under_way = self.under_way();
        let number = under_way.next;
        under_way.next += 1;
        under_way.waiting.insert(number, false);
        let served = Arc::clone(self);
        RunningMotion { served, number }
    }

    fn carry_out(
        &self,
        request: &Request,
        lasting: Option<&RunningMotion>,
    ) -> Result<Answer, Refused> {
        if self.is_called_off(lasting) {
            let command = request.to_bottle().to_string();
            return Err((&HandError::Aborted { command }).into());
        }
        let (hand, grasp) = self.hand()?;
        let done = |outcome: Result<(), DeviceError>| {
            outcome.map(|()| Answer::Done).map_err(Refused::from)
        };
        match request {
            Request::Help => Ok(Answer::Done),
            Request::Initialise => done(hand.initialise()),
            Request::Abort => self.stop().map(|()| Answer::Done),
            Request::IsConnected => Ok(Answer::Flag(hand.is_connected())),
            Request::Positions => Ok(Answer::Numbers(hand.finger_positions()?)),
            Request::Move(axes, angles) => done(hand.move_fingers(axes.axes(), angles)),
            Request::Command(line) => Ok(Answer::Text(hand.send_command(line)?)),
            Request::Open => done(grasp.open_fingers()),
            Request::Close => done(grasp.close_fingers()),
            Request::CloseWithTorque => done(grasp.close_fingers_with_torque()),
            Request::Grasp(kind) => done(grasp.grasp(*kind)),
            Request::Check(expected) => Ok(Answer::Numbers(grasp.check_grasp(*expected)?)),
        }
    }

    fn hand(&self) -> Result<(&dyn Hand, &dyn Grasp), DeviceError> {
        let both = self.device.hand().zip(self.device.grasp());
        both.ok_or_else(|| DeviceError::NotSupported {
            what: "moving as a hand".to_owned(),
        })
    }

    /// Returns whether a pending motion has been aborted.
    fn is_called_off(&self, lasting: Option<&RunningMotion>) -> bool {
        let Some(lasting) = lasting else { return false };
        let aborted = self.under_way().waiting.get(&lasting.number) == Some(&true);
        aborted || self.ending.load(Ordering::Acquire)
    }

    /// Stops the hand, and all earlier requests; later ones are executed.
    fn stop(&self) -> Result<(), Refused> {
        let until = {
            let mut under_way = self.under_way();
            under_way
                .waiting
                .values_mut()
                .for_each(|aborted| *aborted = true);
            under_way.next
        };
        let deadline = Instant::now() + STOP_TIMEOUT;
        loop {
            // Again and again: some may have been about to begin.
            self.hand()?.0.abort()?;
            if self.under_way().waiting.range(..until).next().is_none() {
                return Ok(());
            }
            if Instant::now() > deadline {
                let doing = "a motion that does not end when it is aborted".to_owned();
                return Err((&HandError::Busy { doing }).into());
            }
            thread::sleep(POLL_INTERVAL);
        }
    }
}

/// Says no, and why.
fn refuse(message: &Bottle, from: &str, refused: Refused) -> Bottle {
    tracing::debug!("{message} from {from} refused: {}", refused.words);
    Reply::Refused(refused).to_bottle()
}
