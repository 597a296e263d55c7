//! The device behind the ports, and what becomes of a message.

use std::fmt::{self, Display};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use tokio::sync::mpsc;

use yarp_devices::{AxisInfo, Device, DeviceError};
use yarp_ports::Answer;
use yarp_wire::{Bottle, Stamp, Value, Vocab32};

use super::super::messages::{
    Get, Malformed, MotionUpdate, ProtocolVersion, Query, Reply, Request, Set,
};
use super::command_queue::CommandQueue;
use super::command_submission::{PendingCommand, ReplyTiming, Submission};
use super::motion_tracker::MotionTracker;
use super::{help_text, supported_interfaces};
use crate::thrift::{Item, Message, ReturnCode, ServiceVersion};
use yarp_devices::clock;

/// A device with what its server must remember.
pub(super) struct RequestHandler {
    device: Arc<dyn Device>,
    name: String,
    axes: usize,
    /// Orders go to the device by this.
    pub(super) queue: CommandQueue<PendingCommand>,
    pub(super) motions: MotionTracker,
    /// Of the last reply to a query.
    stamp: Mutex<Stamp>,
    /// True if the last streamed command was refused: the first of a run is logged as a warning.
    pub(super) refusing: AtomicBool,
    /// True once a command with a reply was refused.
    pub(super) has_refused: AtomicBool,
    /// Number of motor torque parameters that 3.x clients use; see [`RequestHandler::answer`].
    motor_parameters: AtomicUsize,
}

impl fmt::Debug for RequestHandler {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RequestHandler")
            .field("name", &self.name)
            .finish_non_exhaustive()
    }
}

/// Reasons why a request was not executed. In 3.x all of them are `[fail]`.
#[derive(Debug, thiserror::Error)]
pub(super) enum Refusal {
    #[error(transparent)]
    Malformed(#[from] Malformed),
    #[error(transparent)]
    Device(#[from] DeviceError),
    #[error("the device has no {0}")]
    NoInterface(&'static str),
    #[error("replaced by command {0} before the device executed it")]
    Dropped(u64),
}

impl RequestHandler {
    /// With the ends of motions as they come; `None` for a device without axes.
    pub(super) fn new(
        device: Arc<dyn Device>,
        name: &str,
    ) -> Option<(Self, mpsc::Receiver<MotionUpdate>)> {
        let axes = count_axes(device.as_ref()).filter(|&axes| axes > 0)?;
        let (motions, announced) = MotionTracker::new(axes);
        let board = Self {
            device,
            name: name.to_owned(),
            axes,
            queue: CommandQueue::new(name),
            motions,
            // Answers are counted from 0.
            stamp: Mutex::new(Stamp::new(-1, 0.0)),
            refusing: AtomicBool::new(false),
            has_refused: AtomicBool::new(false),
            motor_parameters: AtomicUsize::new(9),
        };
        Some((board, announced))
    }

    pub(super) fn axes(&self) -> usize {
        self.axes
    }

    /// Ends what works on the device; what waits for it is refused.
    pub(super) fn end(&self) {
        self.queue.end();
        self.motions.end();
    }

    pub(super) fn name(&self) -> &str {
        &self.name
    }

    /// Executes a request of 3.x and returns the reply.
    ///
    /// Up to 3.6 four numbers describe the torque of a motor, later nine, and nothing on the wire identifies the
    /// client. It gets nine, unless the last that set them set four.
    pub(super) fn answer(&self, message: &Bottle, from: &str) -> ReplyTiming<Reply> {
        let request = match Request::parse(message) {
            Ok(request) => request,
            Err(Malformed::TooShort) => return ReplyTiming::Now(Reply::not_understood()),
            Err(error) => {
                self.report(None, message, from, &error);
                return ReplyTiming::Now(Reply::fail());
            }
        };
        let outcome = match &request {
            Request::Help => Ok(help_text::reply()),
            Request::ProtocolVersion => Ok(Reply::version(ProtocolVersion::CURRENT)),
            Request::Interfaces => Ok(Reply::fail()),
            Request::Get(get) => self.ask(get).map(|mut results| {
                let echo = message.get(1).cloned().unwrap_or(Value::Int32(0));
                results.truncate(self.shown(get));
                get.answer_v3(echo, results, self.next_stamp())
            }),
            Request::Set(set) => match self.submit(set, from, false) {
                (_, Submission::Done(outcome)) => outcome.map(|()| {
                    if let Set::MotorParameters(_, sent) = set {
                        self.motor_parameters.store(sent.count, Ordering::Relaxed);
                    }
                    Reply::ok()
                }),
                (_, Submission::Queued(pending_outcome)) => {
                    return ReplyTiming::later(async {
                        pending_outcome
                            .await
                            .map_or_else(|_| Reply::fail(), |()| Reply::ok())
                    });
                }
            },
        };
        ReplyTiming::Now(outcome.unwrap_or_else(|error| {
            self.report(Some(&request), message, from, &error);
            Reply::fail()
        }))
    }

    /// Returns the number of results of a query that a 3.x client gets.
    fn shown(&self, get: &Get) -> usize {
        match get {
            Get::About(Query::MotorParameters, _) => self.motor_parameters.load(Ordering::Relaxed),
            _ => usize::MAX,
        }
    }

    /// Executes a call of 4.0 and returns the reply.
    pub(super) fn answer_call(&self, message: &Bottle, from: &str) -> Answer {
        let request = match Request::parse_call(message) {
            Ok(request) => request,
            Err(error) => {
                self.report(None, message, from, &error);
                // Stock gives no answer to a function it does not know with something behind it, and leaves the
                // client to find out; this is what it answers otherwise.
                return Answer::reply(Bottle::of(Vocab32::FAIL));
            }
        };
        let items = match &request {
            Request::Help => return Answer::reply(help_text::functions()),
            Request::ProtocolVersion => return Answer::reply(ServiceVersion::SERVED),
            Request::Interfaces => {
                ReturnCode::Ok.with([supported_interfaces::list(self.device.as_ref())])
            }
            Request::Get(get) => match self.ask(get) {
                Ok(results) => answered(get, results),
                Err(error) => {
                    self.report(Some(&request), message, from, &error);
                    let nothing = get.nothing();
                    match nothing.is_empty() {
                        true => error.code().alone(),
                        false => error.code().with(nothing),
                    }
                }
            },
            Request::Set(set) => match self.submit(set, from, false) {
                (_, Submission::Done(Ok(()))) => ReturnCode::Ok.alone(),
                (_, Submission::Done(Err(error))) => {
                    self.report(Some(&request), message, from, &error);
                    error.code().alone()
                }
                (_, Submission::Queued(pending_outcome)) => {
                    return Answer::Later(Box::pin(async {
                        let code = pending_outcome
                            .await
                            .map_or_else(|error| error.code(), |()| ReturnCode::Ok);
                        Answer::reply(Message(code.alone()))
                    }));
                }
            },
        };
        Answer::reply(Message(items))
    }

    fn report(&self, request: Option<&Request>, message: &Bottle, from: &str, error: &dyn Display) {
        // Refused commands of a person are logged; polling clients query unsupported values.
        if let Some(Request::Set(_)) = request {
            self.report_refusal(&format_args!("{message} from {from} refused: {error}"));
        } else {
            tracing::debug!("{}: {message} from {from} refused: {error}", self.name);
        }
    }

    /// Logs a refused command: the first of this server at WARNING, later ones at INFO.
    pub(super) fn report_refusal(&self, refusal: &dyn Display) {
        if self.has_refused.swap(true, Ordering::Relaxed) {
            tracing::info!("{}: {refusal}", self.name);
        } else {
            tracing::warn!("{}: {refusal}; later ones are logged at INFO", self.name);
        }
    }

    pub(super) fn cannot_read(&self, error: &dyn Display, from: &str) {
        self.refused(error, from);
    }

    pub(super) fn refused(&self, error: &dyn Display, from: &str) {
        if self.refusing.swap(true, Ordering::Relaxed) {
            tracing::debug!(board = %self.name, from, "streamed command refused: {error}");
        } else {
            tracing::warn!(board = %self.name, from, "streamed command refused: {error}");
        }
    }

    fn next_stamp(&self) -> Stamp {
        let mut stamp = self.stamp.lock().unwrap_or_else(PoisonError::into_inner);
        *stamp = stamp.next(clock::now());
        *stamp
    }

    pub(super) fn device(&self) -> &dyn Device {
        self.device.as_ref()
    }
}

/// Returns the results of a query after the success code.
fn answered(get: &Get, results: Vec<Item>) -> Vec<Item> {
    if let Get::About(Query::CalibrationDone, _) = get {
        // The code itself is the answer.
        let code = match results[..] {
            [Item::Bool(true)] => ReturnCode::Ok,
            _ => ReturnCode::Failed,
        };
        return code.alone();
    }
    ReturnCode::Ok.with(results)
}

impl Refusal {
    /// Returns the code of 4.0.
    fn code(&self) -> ReturnCode {
        match self {
            Self::NoInterface(_) => ReturnCode::NotReady,
            Self::Device(DeviceError::NotSupported { .. }) => ReturnCode::NotImplemented,
            Self::Device(
                DeviceError::OutOfRange { .. }
                | DeviceError::NotFinite { .. }
                | DeviceError::NoSuchAxis { .. },
            ) => ReturnCode::OutOfBounds,
            Self::Device(_) | Self::Malformed(_) | Self::Dropped(_) => ReturnCode::Failed,
        }
    }
}

/// Any interface knows how many axes there are.
fn count_axes(device: &dyn Device) -> Option<usize> {
    device
        .axis_info()
        .map(AxisInfo::axes)
        .or_else(|| device.position_control().map(AxisInfo::axes))
        .or_else(|| device.velocity_control().map(AxisInfo::axes))
        .or_else(|| device.encoders().map(AxisInfo::axes))
        .or_else(|| device.control_mode().map(AxisInfo::axes))
        .or_else(|| device.control_limits().map(AxisInfo::axes))
}

#[cfg(test)]
#[path = "board_request_handler_tests.rs"]
mod tests;
