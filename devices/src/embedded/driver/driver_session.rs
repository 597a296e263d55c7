//! One connection from its opening to its end.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::atomic::Ordering;
use std::thread;
use std::time::{Duration, Instant};

use tracing::{debug, info, warn};

use super::driver_state::{Goal, LinkState, Shared};
use super::pending_requests::PendingRequest;
use crate::clock;
use crate::embedded::link_error::{LinkError, LinkErrorKind};
use crate::embedded::link_setup::{LinkConnector, SocketPair};
use crate::embedded::protocol::{ARM, PacketReader, Reply, ReplyReader, Request, TRAJECTORY};
use crate::periodic_timer::{CycleStatistics, MissedCycles, PeriodicTimer};
use crate::{DeviceError, EncoderReading};

/// Step of an exchange that has begun to be answered.
const READING: &str = "reading its answer";
/// Maximum angle of any joint of an arm, rad: larger values are noise.
const MAX_JOINT_ANGLE: f64 = 10.0;
/// Maximum number of reads of packets per cycle, so that a flood of them leaves time for the rest.
const MAX_READS_PER_CYCLE: usize = 16;
/// Minimum interval between warnings that the rate was not kept.
const WARNING_INTERVAL: Duration = Duration::from_secs(1);

/// Reasons why a connection ended.
#[derive(Debug)]
pub(super) enum End {
    /// The driver is dropped.
    Asked,
    /// It broke.
    Lost(LinkError),
}

/// A connection, in the hands of the driver's thread.
pub(super) struct Session<'a> {
    shared: &'a Shared,
    connector: &'a LinkConnector,
    arm: TcpStream,
    packets: TcpStream,
    reader: PacketReader,
    /// Number of `trf` requests sent.
    queries: i32,
    timer: PeriodicTimer,
    /// Statistics of the earlier connections.
    earlier: CycleStatistics,
    last_warning: Option<Instant>,
    /// Angles in degrees and velocities, and when they came.
    last: Option<(Instant, Vec<f64>, Vec<f64>)>,
}

impl<'a> Session<'a> {
    /// Opens and serves; returns whether the opening succeeded, and the end.
    pub(super) fn run(
        shared: &'a Shared,
        connector: &'a LinkConnector,
        pair: SocketPair,
    ) -> (bool, End) {
        let mut session = Self {
            shared,
            connector,
            arm: pair.arm,
            packets: pair.packets,
            reader: PacketReader::new(),
            queries: 0,
            timer: PeriodicTimer::new(Instant::now(), shared.options.period, MissedCycles::Skip),
            earlier: shared.lock().timing,
            last_warning: None,
            last: None,
        };
        if let Err(error) = session.open() {
            return (false, End::Lost(error));
        }
        let end = match session.serve() {
            Ok(()) => {
                // Delivery of this message does not matter.
                let _ = session.exchange(&Request::Shutdown);
                End::Asked
            }
            Err(error) => End::Lost(error),
        };
        (true, end)
    }

    /// Queries the joint positions, switches gravity compensation on, and queries whether the joints move.
    fn open(&mut self) -> Result<(), LinkError> {
        let options = &self.shared.options;
        let prepare = || {
            let peer = self.arm.peer_addr()?;
            self.arm.set_write_timeout(Some(options.timeout))?;
            self.packets.set_nonblocking(true)?;
            Ok(peer)
        };
        let peer = prepare().map_err(|error| self.broken("opening the connection", &error))?;
        self.shared.lock().link.peer = format!("the embedded PC at {peer}");
        // Before anything changes: an arm with other joints than this driver's shows here.
        let joints = options.joints.len();
        self.read_joints().map_err(|mut error| {
            // An answer that is too long comes with its acknowledgement, one that is too short breaks off.
            let surplus = matches!(error.cause, LinkErrorKind::Protocol(_));
            if surplus || error.step.ends_with(READING) {
                error.step += &format!(
                    " for {joints} joints (if the arm has another number of them, set `joints`)"
                );
            }
            error
        })?;
        let mut up = LinkState::Idle;
        if options.gravity {
            match self.exchange(&Request::Gravity)? {
                Reply::Refused => {
                    warn!(%peer, "the arm refuses gravity compensation; it takes no moves")
                }
                _ => up = LinkState::Up,
            }
        }
        self.ask_for_the_end()?;
        let mut state = self.shared.lock();
        state.link.state = up;
        state.link.sessions += 1;
        info!(%peer, sessions = state.link.sessions, ?up, "connected to the embedded arm");
        self.timer = PeriodicTimer::new(Instant::now(), options.period, MissedCycles::Skip);
        Ok(())
    }

    fn serve(&mut self) -> Result<(), LinkError> {
        while !self.shared.ending.load(Ordering::Acquire) {
            self.read_packets()?;
            let now = Instant::now();
            if now >= self.timer.next() {
                self.reject_pending();
                self.read_joints()?;
                self.keep_pace();
                continue;
            }
            let order = {
                let mut state = self.shared.lock();
                let order = state.pending.take();
                state.sending = order
                    .as_ref()
                    .is_some_and(|order| order.request.kind().is_move());
                order
            };
            match order {
                Some(order) => self.carry_out(&order)?,
                None => thread::park_timeout(self.timer.next() - now),
            }
        }
        Ok(())
    }

    fn reject_pending(&self) {
        let strangers = self.connector.reject_pending();
        if strangers > 0 {
            debug!(strangers, "further connections were closed");
            self.shared.lock().link.rejected_connections += strangers as u64;
        }
    }

    fn keep_pace(&mut self) {
        let now = Instant::now();
        let missed = self.timer.done(now);
        self.shared.lock().timing = self.earlier.and(self.timer.statistics());
        if missed > 0
            && self
                .last_warning
                .is_none_or(|last| now - last > WARNING_INTERVAL)
        {
            self.last_warning = Some(now);
            let timing = self.timer.statistics();
            warn!(
                missed,
                of = timing.cycles,
                in_all = timing.missed,
                "the joints were read late"
            );
        }
    }

    fn carry_out(&mut self, order: &PendingRequest) -> Result<(), LinkError> {
        let outcome = self.obey(order);
        self.shared.lock().sending = false;
        let answer = match &outcome {
            Ok(Some(reply)) => Ok(reply.clone()),
            Ok(None) => Err(DeviceError::Refused {
                peer: self.shared.lock().link.peer.clone(),
                step: order.request.kind().step().to_owned(),
                advice: "within what it can reach, with gravity compensation on; the server's log has the reason"
                    .to_owned(),
            }),
            Err(error) => {
                // The connection is reported as broken before the caller gets the error.
                let mut state = self.shared.lock();
                state.lose(error);
                Err(state.link.failed(error))
            }
        };
        order.answer(answer);
        outcome.map(drop)
    }

    /// Sends it; the answer, or `None` if the arm refused.
    fn obey(&mut self, order: &PendingRequest) -> Result<Option<Reply>, LinkError> {
        let reply = self.exchange(&order.request)?;
        if reply == Reply::Refused {
            return Ok(None);
        }
        if order.request == Request::Gravity {
            self.shared.lock().link.state = LinkState::Up;
        }
        if order.request.kind().is_move() {
            {
                let mut state = self.shared.lock();
                state.targets = match &order.goal {
                    Goal::Unknown => None,
                    Goal::Home => Some(self.home()),
                    Goal::Joints(targets) => Some(targets.clone()),
                };
                state.moving = true;
                state.link.last_interruption = None;
            }
            self.ask_for_the_end()?;
        }
        Ok(Some(reply))
    }

    fn home(&self) -> Vec<f64> {
        let joints = self.shared.options.joints.iter();
        joints.map(|joint| joint.home).collect()
    }

    /// `trf` for the newest move; from now on only its packet counts.
    fn ask_for_the_end(&mut self) -> Result<(), LinkError> {
        if self.exchange(&Request::TellFinish)? == Reply::Refused {
            return Err(LinkError {
                step: Request::TellFinish.kind().step().to_owned(),
                cause: LinkErrorKind::Refused,
            });
        }
        self.queries = self.queries.wrapping_add(1);
        self.shared.lock().moving = true;
        Ok(())
    }

    fn read_joints(&mut self) -> Result<(), LinkError> {
        let step = || Request::Joints.kind().step().to_owned();
        let angles = match self.exchange(&Request::Joints)? {
            Reply::Joints(angles) => angles,
            _ => {
                return Err(LinkError {
                    step: step(),
                    cause: LinkErrorKind::Refused,
                });
            }
        };
        let impossible = |angle: &f64| !angle.is_finite() || angle.abs() > MAX_JOINT_ANGLE;
        if let Some(joint) = angles.iter().position(impossible) {
            return Err(LinkError {
                step: step(),
                cause: LinkErrorKind::Impossible {
                    joint,
                    angle: angles[joint],
                },
            });
        }
        self.keep(angles);
        Ok(())
    }

    /// Makes readings of angles in rad.
    fn keep(&mut self, angles: Vec<f64>) {
        let now = Instant::now();
        let addresses: Vec<f64> = angles.into_iter().map(f64::to_degrees).collect();
        let quotients = |new: &[f64], old: &[f64], seconds: f64| -> Vec<f64> {
            new.iter()
                .zip(old)
                .map(|(new, old)| (new - old) / seconds)
                .collect()
        };
        let none = vec![0.0; addresses.len()];
        let (speeds, accelerations) = match &self.last {
            Some((then, before, speeds_before)) if now > *then => {
                let seconds = (now - *then).as_secs_f64();
                let speeds = quotients(&addresses, before, seconds);
                let accelerations = quotients(&speeds, speeds_before, seconds);
                (speeds, accelerations)
            }
            _ => (none.clone(), none),
        };
        let time = clock::now();
        {
            let mut state = self.shared.lock();
            state.readings.clear();
            let values = addresses.iter().zip(&speeds).zip(&accelerations);
            state
                .readings
                .extend(
                    values.map(|((&position, &speed), &acceleration)| EncoderReading {
                        position,
                        speed,
                        acceleration,
                        time,
                    }),
                );
            state.read_at = Some(now);
        }
        self.last = Some((now, addresses, speeds));
    }

    /// Takes what has come on the connection for packets, without waiting.
    fn read_packets(&mut self) -> Result<(), LinkError> {
        const STEP: &str = "reading asynchronous packets";
        let mut piece = [0; 1024];
        for _ in 0..MAX_READS_PER_CYCLE {
            match self.packets.read(&mut piece) {
                Ok(0) => {
                    return Err(LinkError {
                        step: STEP.to_owned(),
                        cause: LinkErrorKind::Closed,
                    });
                }
                Ok(length) => self.reader.push(&piece[..length]),
                Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => break,
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => continue,
                Err(error) => return Err(self.broken(STEP, &error)),
            }
            while let Some(packet) = self.reader.next_packet().map_err(|error| LinkError {
                step: STEP.to_owned(),
                cause: error.into(),
            })? {
                let about_us = packet.sender == ARM && packet.kind == TRAJECTORY;
                if about_us && packet.query == self.queries {
                    let mut state = self.shared.lock();
                    state.moving = false;
                    if !packet.done {
                        info!(reason = %packet.reason, "the move ended before its target");
                        state.link.last_interruption = Some(packet.reason);
                        // Not because of a newer move, so of a fault: `gra` is what leads out.
                        state.link.state = LinkState::Idle;
                        state.direct.fill(false);
                    }
                } else {
                    // Of an older move, or of a kind that is not ours.
                    debug!(?packet, "asynchronous packet ignored");
                }
            }
        }
        Ok(())
    }

    /// Sends a request and reads its answer.
    fn exchange(&mut self, request: &Request) -> Result<Reply, LinkError> {
        let kind = request.kind();
        let timeout = self.shared.options.timeout;
        let failed = |doing: &str, cause: LinkErrorKind| LinkError {
            step: format!("{}, {doing}", kind.step()),
            cause,
        };
        if let Err(error) = self.arm.write_all(&request.to_bytes()) {
            return Err(failed("sending it", LinkErrorKind::io(&error, timeout)));
        }
        let deadline = Instant::now() + timeout;
        let mut reader = ReplyReader::new(kind, self.shared.options.joints.len());
        let mut piece = [0; 64];
        loop {
            let doing = if reader.has_begun() {
                READING
            } else {
                "waiting for its acknowledgement"
            };
            // One more read after the deadline: this process may have been suspended.
            let left = deadline.saturating_duration_since(Instant::now());
            let left = left.max(Duration::from_millis(1));
            let read = self
                .arm
                .set_read_timeout(Some(left))
                .and_then(|()| self.arm.read(&mut piece));
            match read {
                Ok(0) => return Err(failed(doing, LinkErrorKind::Closed)),
                Ok(length) => match reader.push(&piece[..length]) {
                    Ok(Some(reply)) => return Ok(reply),
                    Ok(None) => {}
                    Err(error) => return Err(failed(doing, error.into())),
                },
                Err(error)
                    if matches!(
                        error.kind(),
                        std::io::ErrorKind::WouldBlock
                            | std::io::ErrorKind::TimedOut
                            | std::io::ErrorKind::Interrupted
                    ) =>
                {
                    if Instant::now() >= deadline {
                        return Err(failed(doing, LinkErrorKind::Silent(timeout)));
                    }
                }
                Err(error) => return Err(failed(doing, LinkErrorKind::io(&error, timeout))),
            }
        }
    }

    fn broken(&self, step: &str, error: &std::io::Error) -> LinkError {
        LinkError {
            step: step.to_owned(),
            cause: LinkErrorKind::io(error, self.shared.options.timeout),
        }
    }
}
