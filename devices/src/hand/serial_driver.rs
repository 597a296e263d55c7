//! The driver: a hand at the end of a serial line.
//!
//! A command goes out in two steps. Its letters first: the hand repeats them, and only when they came back as they were
//! sent does the line end follow that makes the hand do it. So noise on the line, or a stranger at its other end, never
//! moves anything: what did not come back whole is called off.
//!
//! Calling off is `^C`, then `!` and a line end. If the hand had already discarded its line, `!` is an unknown
//! command; if not, `!` invalidates it. Either way an error is answered, and that answer proves that a hand listens
//! and both ends are in step again.

use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError};
use std::thread;
use std::time::{Duration, Instant};

use tracing::{debug, info, warn};

use super::gcl::{
    ABORT, Command, FirmwareVersion, Layout, PROMPT, Reply, ReplyError, ReplyReader, Verb,
};
use super::gcl_connection::GclConnection;
use super::hand_error::HandError;
use super::realtime_session::RealTimeSession;
use super::serial_line::SerialLine;

/// Baud rate of the hand after power-up.
const POWER_UP_BAUD: u32 = 9600;
/// Characters that turn any line into an error instead of a command.
const INVALIDATE_LINE: &[u8] = b"!\r";
/// Completes any RealTime block that was cut off: speeds and gains of zero. A whole block leads to RealTime's end by
/// way of an error; a hand that listens to commands gets a line that is called off.
const BLOCK_PADDING: [u8; 8] = [0; 8];
/// Maximum number of attempts of a command before noise on the line is reported.
const MAX_COMMAND_ATTEMPTS: usize = 4;
/// Maximum number of attempts to synchronise both ends before no hand is reported.
const MAX_SYNC_ATTEMPTS: u32 = 4;

/// Options of a hand on a serial line.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct HandOptions {
    path: String,
    baud: u32,
    echo_timeout: Duration,
    motion_timeout: Duration,
    block_timeout: Duration,
}

impl HandOptions {
    /// At 9600 bits per second; 2 s for an echo, 15 s for a command, 1 s for a block of RealTime.
    ///
    /// `path`: of the line, for instance `/dev/ttyUSB0`.
    pub fn new(path: impl Into<String>) -> Self {
        Self {
            path: path.into(),
            baud: POWER_UP_BAUD,
            echo_timeout: Duration::from_secs(2),
            motion_timeout: Duration::from_secs(15),
            block_timeout: Duration::from_secs(1),
        }
    }

    /// The speed of the line when it is opened, bits per second. A hand that was reset uses 9600.
    pub fn baud(mut self, baud: u32) -> Self {
        self.baud = baud;
        self
    }

    /// Sets the timeout of a command; initialising may take twice as long.
    pub fn motion_timeout(mut self, motion_timeout: Duration) -> Self {
        self.motion_timeout = motion_timeout;
        self
    }

    /// Sets the timeout of the echo of a command, and of the answer to an abort.
    pub fn echo_timeout(mut self, echo_timeout: Duration) -> Self {
        self.echo_timeout = echo_timeout;
        self
    }

    /// Sets the timeout of the answer to a RealTime block.
    pub fn block_timeout(mut self, block_timeout: Duration) -> Self {
        self.block_timeout = block_timeout;
        self
    }
}

/// A BarrettHand BH8-262 at the end of a serial line.
///
/// * Calls block until the hand's prompt is back, which is when the motion has ended, and never longer than
///   [`HandOptions::motion_timeout`]. A hand that takes longer is stopped.
/// * One command at a time: a second one is refused as [`HandError::Busy`], not queued.
///   [`abort`](super::GclConnection::abort) works at any time.
/// * A line that breaks is reported with what was being done; the next command opens it again. A hand that had lost
///   its power as well then reports that it is not initialised. Nothing is sent again by itself that may move.
///
/// ```no_run
/// use yarp_devices::hand::{BarrettHand, HandOptions};
/// use yarp_devices::{Grasp, GraspKind, Hand};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let hand = BarrettHand::open(HandOptions::new("/dev/ttyUSB0"))?;
/// hand.initialise()?;
/// hand.grasp(GraspKind::Rectangular)?;
/// hand.close_fingers_with_torque()?;
/// # Ok(())
/// # }
/// ```
pub struct BarrettHand {
    options: HandOptions,
    /// Held while a command runs.
    line: Mutex<LineState>,
    abort: AtomicBool,
    connected: AtomicBool,
    doing: Mutex<String>,
}

/// The line and its known state.
pub(super) struct LineState {
    port: Option<SerialLine>,
    baud: u32,
    /// True if the hand waits for a command, as far as is known.
    is_synchronised: bool,
    /// True if it may be in RealTime mode, in the middle of a block.
    in_realtime: bool,
    /// The version that the hand reported since the line was opened.
    version: Option<FirmwareVersion>,
    /// The layout of RealTime that the hand was set to last, if it still has those parameters for certain.
    pub(super) layout: Option<Layout>,
    /// True if it was aborted since the present caller began to use the line: then nothing more is done for that
    /// caller.
    aborted: bool,
}

impl BarrettHand {
    /// Opens the line and checks that a hand answers; any action in progress ends.
    ///
    /// Errors: [`HandError::Open`], [`HandError::LineLost`], [`HandError::NoHand`].
    pub fn open(options: HandOptions) -> Result<Self, HandError> {
        let hand = Self {
            line: Mutex::new(LineState {
                port: None,
                baud: options.baud,
                is_synchronised: false,
                in_realtime: true,
                version: None,
                layout: None,
                aborted: false,
            }),
            options,
            abort: AtomicBool::new(false),
            connected: AtomicBool::new(false),
            doing: Mutex::default(),
        };
        hand.connect(&mut *hand.hold("opening")?)?;
        info!(path = %hand.options.path, "hand answers");
        Ok(hand)
    }

    /// The path of the line.
    pub fn path(&self) -> &str {
        &self.options.path
    }

    /// Carries out a command and gives its answer.
    ///
    /// Errors: [`HandError`]; [`HandError::Status`] if the hand complains.
    pub fn command(&self, command: &Command) -> Result<Reply, HandError> {
        self.line(&command.to_string())
    }

    /// Changes the speed of the line, at both ends.
    ///
    /// * `hundreds`: of bits per second, 6 to 384.
    /// * Errors: [`HandError`]; then both speeds are tried when the line is next used.
    pub fn set_baud(&self, hundreds: u16) -> Result<(), HandError> {
        let text = format!("PSET BAUD {hundreds}");
        let mut line = self.hold(&text)?;
        self.connect(&mut line)?;
        self.send_characters(&mut line, &text)?;
        line.is_synchronised = false;
        line.baud = u32::from(hundreds) * 100;
        // The reply may come at either baud rate: it is not read, both ends are synchronised instead. The line end
        // still went out at the old speed.
        let baud = line.baud;
        let changed = line.port().map_or(Ok(()), |port| port.set_baud(baud));
        self.lost(&mut line, "changing its speed", changed)?;
        self.connect(&mut line)
    }

    /// Returns the version of the hand's firmware, which is asked for once after the line was opened.
    ///
    /// Errors: [`HandError`]; [`HandError::Unreadable`] for a reply without a version.
    pub fn firmware_version(&self) -> Result<FirmwareVersion, HandError> {
        let mut line = self.hold("VERS")?;
        self.version_of(&mut line)
    }

    fn version_of(&self, line: &mut LineState) -> Result<FirmwareVersion, HandError> {
        if let Some(known) = line.version {
            return Ok(known);
        }
        let text = Verb::Version.to_string();
        let reply = self.transact(line, &text)?;
        let version = FirmwareVersion::parse(&reply.text).ok_or(HandError::Unreadable {
            command: text,
            answer: reply.text,
            expected: "a version, such as 4.40",
        })?;
        info!(path = %self.options.path, %version, "firmware of the hand");
        line.version = Some(version);
        Ok(version)
    }

    /// Enters RealTime mode, which lasts until the session ends; other commands are refused meanwhile.
    ///
    /// The blocks are those of the firmware that the hand reports, whatever `layout` says.
    ///
    /// Errors: [`HandError`]; [`HandError::Status`] if the hand refuses.
    pub fn realtime(&self, mut layout: Layout) -> Result<RealTimeSession<'_>, HandError> {
        let mut line = self.hold("LOOP")?;
        layout.firmware = self.version_of(&mut line)?;
        let is_set = line.layout.as_ref() == Some(&layout);
        for command in layout.commands() {
            let text = command.to_string();
            if command.verb != Verb::Loop {
                if !is_set {
                    self.transact(&mut line, &text)?;
                }
                continue;
            }
            self.send_until_echoed(&mut line, &text)?;
            self.send_line_end(&mut line, &text)?;
            line.is_synchronised = false;
            line.in_realtime = true;
            line.layout = None;
            self.enter(&mut line, &text)?;
            line.layout = Some(layout.clone());
        }
        Ok(RealTimeSession::new(
            self,
            line,
            layout,
            self.options.block_timeout,
        ))
    }

    /// Waits for the `*` that marks the start of RealTime.
    fn enter(&self, line: &mut LineState, text: &str) -> Result<(), HandError> {
        let mut complaint = ReplyReader::new("");
        let deadline = Instant::now() + self.options.echo_timeout;
        let mut buffer = [0; 1];
        while Instant::now() < deadline {
            let step = || format!("waiting for `{text}` to begin");
            for &byte in self.receive_or_abort(line, &mut buffer, step)? {
                if byte == b'*'
                    && complaint
                        .excerpt()
                        .replace("\\r", "")
                        .replace("\\n", "")
                        .is_empty()
                {
                    return Ok(());
                }
                if let Some(reply) = complaint.push(&[byte]) {
                    let reply = reply.map_err(|source| garbled(text, source))?;
                    line.is_synchronised = true;
                    line.in_realtime = false;
                    judge(text, reply)?;
                    return Err(HandError::Unreadable {
                        command: text.to_owned(),
                        answer: String::new(),
                        expected: "`*`",
                    });
                }
            }
        }
        let got = complaint.excerpt();
        Err(self.stop(line, text, self.options.echo_timeout, got))
    }

    /// Carries out one line of text.
    pub(super) fn line(&self, text: &str) -> Result<Reply, HandError> {
        let mut line = self.hold(text)?;
        self.transact(&mut line, text)
    }

    /// Locks the line, if no other caller uses it.
    fn hold(&self, text: &str) -> Result<MutexGuard<'_, LineState>, HandError> {
        let mut line = match self.line.try_lock() {
            Ok(line) => line,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => {
                let doing = self.doing().clone();
                return Err(HandError::Busy { doing });
            }
        };
        text.clone_into(&mut self.doing());
        line.aborted = false;
        Ok(line)
    }

    fn doing(&self) -> MutexGuard<'_, String> {
        self.doing.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sends a line, waits for the prompt, and judges the answer.
    fn transact(&self, line: &mut LineState, text: &str) -> Result<Reply, HandError> {
        let verb = Command::parse(text).map(|command| command.verb);
        if !verb.as_ref().is_ok_and(keeps_parameters) {
            line.layout = None;
        }
        self.send_characters(line, text)?;
        let initialises = matches!(verb, Ok(Verb::Initialise));
        let timeout = self.options.motion_timeout * if initialises { 2 } else { 1 };
        line.is_synchronised = false;
        let mut reader = ReplyReader::new("");
        let deadline = Instant::now() + timeout;
        let mut buffer = [0; 256];
        while Instant::now() < deadline {
            let step = || format!("waiting for `{text}` to end");
            let bytes = self.receive_or_abort(line, &mut buffer, step)?;
            if let Some(reply) = reader.push(bytes) {
                let reply = reply.map_err(|source| garbled(text, source))?;
                // ^C to a hand that had just ended causes another prompt.
                line.is_synchronised = !line.aborted;
                debug!(command = text, answer = %reply, "hand answered");
                return judge(text, reply);
            }
        }
        Err(self.stop(line, text, timeout, reader.excerpt()))
    }

    /// Types a command and its end.
    fn send_characters(&self, line: &mut LineState, text: &str) -> Result<(), HandError> {
        self.send_until_echoed(line, text)?;
        self.send_line_end(line, text)
    }

    fn send_line_end(&self, line: &mut LineState, text: &str) -> Result<(), HandError> {
        self.heed_abort(line, text)?;
        self.send(line, b"\r", || format!("ending the line `{text}`"))
    }

    /// Types the letters of a command until they come back right.
    fn send_until_echoed(&self, line: &mut LineState, text: &str) -> Result<(), HandError> {
        let mut problem = None;
        for _ in 0..MAX_COMMAND_ATTEMPTS {
            self.heed_abort(line, text)?;
            self.connect(line)?;
            let drained = line.port().map_or(Ok(()), SerialLine::drain);
            self.lost(line, &format!("beginning `{text}`"), drained)?;
            line.is_synchronised = false;
            self.send(line, text.as_bytes(), || format!("sending `{text}`"))?;
            match self.echo(line, text)? {
                Ok(()) => return Ok(()),
                Err(source) => {
                    warn!(command = text, "called off, noise on the line: {source}");
                    problem = Some(source);
                }
            }
        }
        let source = problem.expect("there was an attempt");
        // The hand shall not be left with half a command.
        let _ = self.connect(line);
        Err(garbled(text, source))
    }

    /// Returns whether the characters were echoed.
    fn echo(&self, line: &mut LineState, text: &str) -> Result<Result<(), ReplyError>, HandError> {
        let mut reader = ReplyReader::new(text);
        let deadline = Instant::now() + self.options.echo_timeout;
        let mut buffer = [0; 64];
        while !reader.is_echoed() {
            self.heed_abort(line, text)?;
            let step = || format!("waiting for the echo of `{text}`");
            let bytes = self.receive(line, &mut buffer, step)?;
            if let Some(Err(error)) = reader.push(bytes) {
                return Ok(Err(error));
            }
            if Instant::now() > deadline {
                return Ok(Err(ReplyError::Echo {
                    sent: text.to_owned(),
                    got: reader.excerpt(),
                }));
            }
        }
        Ok(Ok(()))
    }

    /// Opens the line if needed, and synchronises both ends if needed.
    fn connect(&self, line: &mut LineState) -> Result<(), HandError> {
        if line.port.is_none() {
            let opened = SerialLine::open(&self.options.path, line.baud);
            line.port = Some(opened.map_err(|source| HandError::Open { source })?);
            line.is_synchronised = false;
            self.connected.store(true, Ordering::Release);
        }
        if line.is_synchronised {
            return Ok(());
        }
        let mut seen = Vec::new();
        for attempt in 0..MAX_SYNC_ATTEMPTS {
            // A hand that was reset uses the baud rate of power-up.
            if line.baud != POWER_UP_BAUD && attempt > 0 {
                let baud = if attempt % 2 == 0 {
                    line.baud
                } else {
                    POWER_UP_BAUD
                };
                let changed = line.port().map_or(Ok(()), |port| port.set_baud(baud));
                self.lost(line, "changing its speed", changed)?;
            }
            if self.cancel_command(line, &mut seen)? {
                line.is_synchronised = true;
                line.in_realtime = false;
                return Ok(());
            }
        }
        let from = seen.len().saturating_sub(40);
        Err(HandError::NoHand {
            waited: (self.idle() + self.options.echo_timeout) * MAX_SYNC_ATTEMPTS,
            got: seen[from..].escape_ascii().to_string(),
        })
    }

    /// Returns the maximum time that a hand takes to return to its prompt when it is aborted; an idle one may send
    /// nothing.
    fn idle(&self) -> Duration {
        self.options.echo_timeout / 4
    }

    /// Ends any action of the hand and empties its line; returns whether it answered.
    fn cancel_command(&self, line: &mut LineState, seen: &mut Vec<u8>) -> Result<bool, HandError> {
        const STEP: &str = "calling the hand off";
        seen.clear();
        if line.in_realtime {
            self.send(line, &BLOCK_PADDING, || STEP.to_owned())?;
        }
        self.send(line, &[ABORT], || STEP.to_owned())?;
        // A hand in motion, or in RealTime, first comes back to its prompt.
        self.collect(line, seen, self.idle(), |seen| seen.ends_with(PROMPT))?;
        let before = seen.len();
        self.send(line, INVALIDATE_LINE, || STEP.to_owned())?;
        self.collect(line, seen, self.options.echo_timeout, |seen| {
            is_spoiled(&seen[before..])
        })
    }

    /// Reads until `done`; whether that came in time.
    fn collect(
        &self,
        line: &mut LineState,
        seen: &mut Vec<u8>,
        timeout: Duration,
        done: impl Fn(&[u8]) -> bool,
    ) -> Result<bool, HandError> {
        const MAX_DISCARDED_BYTES: usize = 64 * 1024;
        let deadline = Instant::now() + timeout;
        let mut buffer = [0; 64];
        while Instant::now() < deadline && seen.len() < MAX_DISCARDED_BYTES {
            let received = line
                .port()
                .map_or(Ok([].as_slice()), |port| port.receive(&mut buffer));
            let received = received.map(<[u8]>::to_vec);
            let bytes = self.lost(line, "waiting for the prompt", received)?;
            seen.extend(bytes);
            if done(seen) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Stops a hand that takes too long.
    fn stop(&self, line: &mut LineState, text: &str, waited: Duration, got: String) -> HandError {
        line.is_synchronised = false;
        if let Err(error) = self.send(line, &[ABORT], || format!("stopping `{text}`")) {
            return error;
        }
        HandError::NoPrompt {
            command: text.to_owned(),
            waited,
            got,
        }
    }

    /// Sets or clears the request to stop the present or next user of the line.
    pub(super) fn set_abort(&self, wish: bool) {
        self.abort.store(wish, Ordering::Release);
    }

    /// Returns whether an abort is pending.
    pub(super) fn is_abort_set(&self) -> bool {
        self.abort.load(Ordering::Acquire)
    }

    /// Gives a command up that the hand has not begun with, if that is wished.
    fn heed_abort(&self, line: &mut LineState, text: &str) -> Result<(), HandError> {
        line.aborted |= self.abort.swap(false, Ordering::AcqRel);
        if !line.aborted {
            return Ok(());
        }
        line.is_synchronised = false;
        self.connect(line)?;
        let command = text.to_owned();
        Err(HandError::Aborted { command })
    }

    /// Receives some bytes during a command; passes an abort request on.
    pub(super) fn receive_or_abort<'b>(
        &self,
        line: &mut LineState,
        buffer: &'b mut [u8],
        step: impl Fn() -> String,
    ) -> Result<&'b [u8], HandError> {
        if self.abort.swap(false, Ordering::AcqRel) {
            line.aborted = true;
            self.send(line, &[ABORT], || "aborting".to_owned())?;
        }
        self.receive(line, buffer, step)
    }

    /// Some bytes from the hand.
    fn receive<'b>(
        &self,
        line: &mut LineState,
        buffer: &'b mut [u8],
        step: impl Fn() -> String,
    ) -> Result<&'b [u8], HandError> {
        let Some(port) = line.port() else {
            let source = std::io::ErrorKind::NotConnected.into();
            return Err(HandError::LineLost {
                step: step(),
                source,
            });
        };
        match port.receive(buffer) {
            Ok(bytes) => Ok(bytes),
            Err(source) => Err(self.lose(line, step(), source)),
        }
    }

    pub(super) fn send(
        &self,
        line: &mut LineState,
        bytes: &[u8],
        step: impl Fn() -> String,
    ) -> Result<(), HandError> {
        let sent = line.port().map_or_else(
            || Err(std::io::ErrorKind::NotConnected.into()),
            |port| port.send(bytes),
        );
        sent.map_err(|source| self.lose(line, step(), source))
    }

    fn lost<T>(
        &self,
        line: &mut LineState,
        step: &str,
        outcome: std::io::Result<T>,
    ) -> Result<T, HandError> {
        outcome.map_err(|source| self.lose(line, step.to_owned(), source))
    }

    /// The line broke: it will be opened anew.
    fn lose(&self, line: &mut LineState, step: String, source: std::io::Error) -> HandError {
        line.port = None;
        line.is_synchronised = false;
        // A reconnected hand may have lost its power, and with it the baud rate that was set.
        line.baud = self.options.baud;
        line.version = None;
        line.layout = None;
        self.connected.store(false, Ordering::Release);
        warn!(path = %self.options.path, step, error = %source, "the line to the hand broke");
        HandError::LineLost { step, source }
    }

    /// Leaves RealTime; both ends are synchronised, if necessary by force.
    pub(super) fn leave(&self, line: &mut LineState) -> Result<(), HandError> {
        self.connect(line)
    }
}

impl LineState {
    pub(super) fn port(&mut self) -> Option<&mut SerialLine> {
        self.port.as_mut()
    }
}

impl GclConnection for BarrettHand {
    fn peer(&self) -> &str {
        &self.options.path
    }

    fn run(&self, lines: &[String]) -> Result<Vec<Reply>, HandError> {
        let mut line = self.hold(&lines.join(", "))?;
        lines
            .iter()
            .map(|text| self.transact(&mut line, text))
            .collect()
    }

    fn abort(&self) -> Result<(), HandError> {
        self.set_abort(true);
        let deadline = Instant::now() + 2 * self.options.motion_timeout;
        while self.is_abort_set() {
            match self.hold("^C") {
                // There is no caller to pass it on to.
                Ok(mut line) => {
                    if self.abort.swap(false, Ordering::AcqRel) {
                        line.is_synchronised = false;
                        return self.connect(&mut line);
                    }
                }
                Err(busy) if Instant::now() > deadline => return Err(busy),
                Err(_) => thread::sleep(Duration::from_millis(1)),
            }
        }
        Ok(())
    }

    fn is_connected(&self) -> bool {
        self.connected.load(Ordering::Acquire)
    }
}

impl fmt::Debug for BarrettHand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("BarrettHand")
            .field("options", &self.options)
            .finish_non_exhaustive()
    }
}

/// Returns whether these bytes are the answer to the invalidated line: its echo, an error, and the prompt.
fn is_spoiled(seen: &[u8]) -> bool {
    let Some(echo) = seen.iter().position(|&byte| byte == INVALIDATE_LINE[0]) else {
        return false;
    };
    let answer = &seen[echo + 1..];
    answer.windows(4).any(|four| four == b"ERR ") && answer.ends_with(PROMPT)
}

/// Returns whether all parameters certainly have the same values after a command. A hand that had lost its power is initialised again,
/// which is no such command.
fn keeps_parameters(verb: &Verb) -> bool {
    match verb {
        Verb::Close
        | Verb::Open
        | Verb::TorqueClose
        | Verb::TorqueOpen
        | Verb::StepClose(_)
        | Verb::StepOpen(_)
        | Verb::Move(_)
        | Verb::Home
        | Verb::Terminate
        | Verb::Get(..)
        | Verb::List(..)
        | Verb::Help { .. }
        | Verb::Errors
        | Verb::Version
        | Verb::Ping => true,
        Verb::Initialise | Verb::Loop | Verb::Set(..) | Verb::Keep(..) | Verb::Reset => false,
    }
}

fn garbled(text: &str, source: ReplyError) -> HandError {
    HandError::Garbled {
        command: text.to_owned(),
        source,
    }
}

/// An answer without complaint, or the complaint.
pub(super) fn judge(text: &str, reply: Reply) -> Result<Reply, HandError> {
    match reply.status() {
        status if status.is_fine() => Ok(reply),
        status => Err(HandError::Status {
            command: text.to_owned(),
            status,
            answer: reply.text,
        }),
    }
}
