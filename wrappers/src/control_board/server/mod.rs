//! A device on ports.
//!
//! | file | content |
//! | --- | --- |
//! | `board_request_handler` | executes requests on the device |
//! | `command_queue` | commands that wait while the device executes an earlier one |
//! | `submit` | submits commands through the queue, and polls the motions that they start |
//! | `motion_tracker` | numbered motions, and their ends |
//! | `board_command_execution` | calls of the device, generated from the descriptions of the interfaces |
//! | `supported_interfaces` | the interfaces of the device |
//! | `state_publisher` | the state, every period |
//! | `deadline_monitor` | missed publish deadlines |
//! | `help_text` | help for people |

mod board_command_execution;
mod board_request_handler;
mod command_queue;
mod command_submission;
mod deadline_monitor;
mod help_text;
mod motion_tracker;
mod state_publisher;
mod supported_interfaces;

use std::io;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread;
use std::time::Duration;

use tokio::sync::{mpsc, oneshot};
use tokio::task::JoinHandle;
use yarp_devices::Device;
use yarp_ports::{Answer, Network, Port, PortOptions, Received};
use yarp_wire::WireVersion;

use self::board_request_handler::RequestHandler;
use super::OpenError;
use super::messages::{Command, MotionUpdate, Numbered};
use crate::device_ports::{PUBLISHER_END_TIMEOUT, PortWork, ServedPort, ServedPorts};
use crate::open_ports::request_port;
use crate::page_request::request_of;
use crate::periodic_thread::{PeriodicThread, check_period};

/// Default interval between published states: 50 Hz, as stock.
const DEFAULT_PERIOD: Duration = Duration::from_millis(20);
/// Timeout of queueing an announcement for a slow reader.
const ANNOUNCE_TIMEOUT: Duration = Duration::from_secs(1);

/// Options of a control board server.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ControlBoardOptions {
    period: Duration,
}

impl Default for ControlBoardOptions {
    fn default() -> Self {
        Self {
            period: DEFAULT_PERIOD,
        }
    }
}

impl ControlBoardOptions {
    /// The state every 20 ms.
    pub fn new() -> Self {
        Self::default()
    }

    /// The time from one state to the next, 1 ms to 60 s.
    pub fn period(mut self, period: Duration) -> Self {
        self.period = period;
        self
    }
}

/// A device, served like stock's `controlBoard_nws_yarp`, to clients of 3.x and of 4.0 at once.
///
/// * `NAME/rpc:i` answers queries and executes commands of 3.x, `NAME/nws/rpc:i` those of 4.0, one after the other
///   for each client. The device is called on the task of the connection: a device that blocks delays that client.
/// * `NAME/command:i` accepts velocities, torques and the like in either wire version, in their order of arrival.
/// * Commands to move, from all ports, reach the device one by one. While the device executes one the others are
///   queued; a queued command is dropped when a newer one of its kind for all its axes comes, or a stop for one of
///   them. A client that waits for the reply then gets `[fail]`; drops are counted and logged.
/// * `NAME/async:o` announces the end of each numbered move, and of all that begin while it has a reader, as a
///   [`MotionUpdate`]; a client that requests a move by [`Numbered`] gets its number.
/// * `NAME/state:o` and `NAME/stateExt:o` send joint positions and the whole state every period, to each reader that
///   is not more than 20 ms behind: while the machine does something else, those of 1 kHz wait and none is lost. Both
///   carry one stamp: its count goes up by one, its time is the mean of the encoder times. A period is left out when
///   the time of a joint is more than a second from that of the first, as in stock. A period that begins more than 20
///   ms late is logged.
/// * Each reader of `NAME/stateExt:o` gets the layout of its own wire version, which is found out before the first state.
/// * A request that is malformed, or that the device has no interface for or refuses, is answered at once with `[fail]`
///   in 3.x and with its code in 4.0, and nothing moves. Parking is never waited for. Parts of the state that the device does not measure are zeros that are marked invalid; while it
///   does not know its positions nothing is sent on `state:o`, which has no mark.
/// * Any client that can connect can send commands. **Nothing times out**: a velocity stays in force after its sender
///   has disconnected.
///
/// ```no_run
/// # async fn example() -> Result<(), Box<dyn std::error::Error>> {
/// use std::sync::Arc;
/// use yarp_devices::wam::SimulatedWam;
/// use yarp_ports::Network;
/// use yarp_wrappers::{ControlBoardOptions, ControlBoardServer};
///
/// let network = Network::from_process()?;
/// let arm = Arc::new(SimulatedWam::new());
/// let board = ControlBoardServer::open(&network, arm, "/wam", ControlBoardOptions::new()).await?;
/// tokio::signal::ctrl_c().await?;
/// board.close().await;
/// # Ok(()) }
/// ```
///
/// Dropping it closes the ports in the background.
///
/// Source: `ControlBoard_nws_yarp.cpp` and `RPCMessagesParser.cpp` of YARP 3.12, `ControlBoardServerImpl.cpp` of 4.0;
/// answers of 3.5.0 and 4.0.0, recorded traffic of 3.12.3 and 4.0.0.
#[derive(Debug)]
pub struct ControlBoardServer {
    ports: ServedPorts<BoardWork>,
}

/// Threads and tasks that use the device beside the ports.
#[derive(Debug)]
struct BoardWork {
    board: Arc<RequestHandler>,
    publisher: PeriodicThread,
    workers: [oneshot::Receiver<()>; 2],
    announcer: JoinHandle<()>,
}

impl ControlBoardServer {
    /// Opens the six ports and begins to publish.
    ///
    /// * `name`: begins with `/`; the ports are `NAME/rpc:i`, `NAME/nws/rpc:i`, `NAME/command:i`, `NAME/state:o`,
    ///   `NAME/stateExt:o`, `NAME/async:o`.
    /// * Errors: [`OpenError::NoAxes`], [`OpenError::Period`], [`OpenError::NameTaken`], [`OpenError::Port`],
    ///   [`OpenError::Thread`]; then all that was opened is closed and unregistered again.
    ///
    /// Cancelling closes the ports in the background.
    pub async fn open(
        network: &Network,
        device: Arc<dyn Device>,
        name: &str,
        options: ControlBoardOptions,
    ) -> Result<Self, OpenError> {
        let period = options.period;
        check_period(period)?;
        let (board, announced) = RequestHandler::new(device, name).ok_or(OpenError::NoAxes)?;
        let board = Arc::new(board);
        let wanted = [
            ServedPort::input("rpc:i", answering(board.clone())),
            ServedPort::input("nws/rpc:i", answering_calls(board.clone())),
            ServedPort::input("command:i", obeying(board.clone())),
            ServedPort::output("state:o", PortOptions::new()),
            ServedPort::output("stateExt:o", PortOptions::new()),
            ServedPort::output("async:o", announcing(board.clone())),
        ];
        let wanted = wanted.into();
        let axes = board.axes();
        let start = |outputs: &[Arc<Port>]| {
            BoardWork::start(&board, outputs, period, announced).inspect_err(|_| board.end())
        };
        let ports = ServedPorts::open(network, name, wanted, start).await?;
        tracing::info!(name, axes, ?period, "control board served");
        Ok(Self { ports })
    }

    /// The name that the six ports have in common.
    pub fn name(&self) -> &str {
        self.ports.name()
    }

    /// Ends publishing, closes the six ports and unregisters their names.
    ///
    /// Takes a few seconds at most, even if peers do not answer. The device keeps its state: a joint that moves
    /// continues.
    pub async fn close(self) {
        self.ports.close().await;
    }
}

impl BoardWork {
    /// Starts queued commands, polling of motions, publishing and announcing on `[state, extended, ends]`.
    fn start(
        board: &Arc<RequestHandler>,
        outputs: &[Arc<Port>],
        period: Duration,
        announced: mpsc::Receiver<MotionUpdate>,
    ) -> io::Result<Self> {
        let workers = [
            start(
                "control-board-orders",
                board.clone(),
                RequestHandler::run_queue,
            )?,
            start(
                "control-board-motions",
                board.clone(),
                RequestHandler::watch,
            )?,
        ];
        let feeds = [outputs[0].clone(), outputs[1].clone()];
        Ok(Self {
            board: board.clone(),
            publisher: state_publisher::start(board.clone(), feeds, period)?,
            workers,
            announcer: tokio::spawn(announce(announced, outputs[2].clone())),
        })
    }
}

impl PortWork for BoardWork {
    async fn end(self) {
        self.board.end();
        PortWork::end(self.publisher).await;
        for ended in self.workers {
            let ended = tokio::time::timeout(PUBLISHER_END_TIMEOUT, ended);
            if ended.await.is_err() {
                tracing::warn!("a device call is still blocking; closing without waiting for it");
            }
        }
        self.announcer.abort();
        // It holds a port; that it was aborted is what was wanted.
        let _ = self.announcer.await;
    }
}

/// A thread that works on the board; it reports its end after it released the board.
fn start(
    name: &str,
    board: Arc<RequestHandler>,
    work: fn(&RequestHandler),
) -> io::Result<oneshot::Receiver<()>> {
    let (alive, ended) = oneshot::channel();
    thread::Builder::new().name(name.into()).spawn(move || {
        work(&board);
        drop(board);
        drop(alive);
    })?;
    Ok(ended)
}

/// Announces the ends of motions as they come.
async fn announce(mut announced: mpsc::Receiver<MotionUpdate>, port: Arc<Port>) {
    while let Some(news) = announced.recv().await {
        let message = news.to_bottle();
        let writing = port.write_strict(&message, None);
        // A client that misses one can query it.
        if tokio::time::timeout(ANNOUNCE_TIMEOUT, writing)
            .await
            .is_err()
        {
            tracing::debug!(port = port.name(), "a reader is too slow");
        }
    }
}

/// Counts the listeners.
fn announcing(board: Arc<RequestHandler>) -> PortOptions {
    PortOptions::new().on_connection_change(move |change| {
        let readers = &board.motions.readers;
        match (change.incoming, change.began) {
            (true, _) => {}
            (false, true) => drop(readers.fetch_add(1, Ordering::Relaxed)),
            (false, false) => drop(readers.fetch_sub(1, Ordering::Relaxed)),
        }
    })
}

fn answering(board: Arc<RequestHandler>) -> PortOptions {
    let answer = move |received: &mut Received| {
        let request = request_of(received);
        match Numbered::parse(&request) {
            Some(wanted) => board.answer_numbered(wanted, &received.from),
            None => board.answer(&request, &received.from).into_answer(),
        }
    };
    request_port().handler(answer).input_only()
}

fn answering_calls(board: Arc<RequestHandler>) -> PortOptions {
    let answer = move |received: &mut Received| {
        let call = request_of(received);
        match Numbered::parse(&call) {
            Some(wanted) => board.answer_numbered(wanted, &received.from),
            None => board.answer_call(&call, &received.from),
        }
    };
    request_port()
        .handler(answer)
        .input_only()
        .wire_version(WireVersion::V4)
}

fn obeying(board: Arc<RequestHandler>) -> PortOptions {
    let obey = move |received: &mut Received| {
        match received.read::<Command>() {
            Ok(command) => board.handle_command(command, &received.from),
            Err(error) => board.cannot_read(&error, &received.from),
        }
        Answer::Nothing
    };
    request_port().handler(obey).input_only()
}
