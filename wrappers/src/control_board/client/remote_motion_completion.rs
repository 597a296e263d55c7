//! Moves with a number, and the wait for their ends.

use std::collections::{HashMap, VecDeque};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use tokio::sync::Notify;
use tokio::task::JoinSet;
use tokio::time::{Instant, timeout_at};
use yarp_devices::{Axes, DeviceError};
use yarp_ports::{Port, Received};

use super::super::OpenError;
use super::super::messages::{
    MotionEnd, MotionState, MotionUpdate, Numbered, Selection, Set, Setting,
};
use super::RemoteControlBoard;
use super::board_link::{BoardLink, REFUSAL_ADVICE};
use crate::device_ports::{RemotePorts, stream_port};
use crate::open_ports::open;
use crate::reconnect::{Turn, check_exists, subscribe};

/// Maximum number of remembered completions; older ones are queried from the board.
const MAX_REMEMBERED_MOTIONS: usize = 1000;
/// Interval between queries for the completion of a motion, in case its announcement was lost.
const POLL_INTERVAL: Duration = Duration::from_millis(500);

/// The port for announcements, connected while it is there.
#[derive(Debug)]
pub(super) struct Announcements {
    pub(super) port: Port,
    ends: Arc<CompletedMotions>,
    /// Asks for announcements again; ends with this.
    _asking: JoinSet<()>,
}

/// The ends of motions that were announced.
#[derive(Debug, Default)]
struct CompletedMotions {
    known: Mutex<(HashMap<u64, MotionEnd>, VecDeque<u64>)>,
    came: Notify,
}

impl CompletedMotions {
    fn take(&self, received: &Received) {
        let news = received.bottle().ok();
        let news = news.and_then(|message| MotionUpdate::from_bottle(&message));
        match news {
            Some(MotionUpdate {
                number,
                state: MotionState::Ended(end),
                ..
            }) => self.add(number, end),
            _ => tracing::debug!(from = %received.from, "not the end of a motion"),
        }
    }

    fn add(&self, number: u64, end: MotionEnd) {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let (ends, order) = &mut *known;
        if ends.insert(number, end).is_none() {
            order.push_back(number);
        }
        if order.len() > MAX_REMEMBERED_MOTIONS
            && let Some(oldest) = order.pop_front()
        {
            ends.remove(&oldest);
        }
        drop(known);
        self.came.notify_waiters();
    }

    fn of(&self, number: u64) -> Option<MotionEnd> {
        let known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        known.0.get(&number).cloned()
    }
}

impl Announcements {
    /// Opens `LOCAL/async:i` and has the board announce ends to it.
    pub(super) async fn open(ports: &RemotePorts) -> Result<Self, OpenError> {
        let (network, names) = (ports.network(), ports.options());
        let from = names.remote_port("async:o");
        check_exists(network, from.clone()).await?;
        let ends = Arc::new(CompletedMotions::default());
        let (taker, writers) = (ends.clone(), Arc::new(AtomicUsize::new(0)));
        let counted = writers.clone();
        let options =
            stream_port(move |received| taker.take(received)).on_connection_change(move |change| {
                match (change.incoming, change.began) {
                    (false, _) => {}
                    (true, true) => drop(counted.fetch_add(1, Ordering::Relaxed)),
                    (true, false) => drop(counted.fetch_sub(1, Ordering::Relaxed)),
                }
            });
        let port = open(network, format!("{}/async:i", names.local), options).await?;
        let mut asking = JoinSet::new();
        let are_missing = Box::new(move || writers.load(Ordering::Relaxed) == 0);
        let between = (from.as_str(), port.name());
        let turn = Turn::default();
        match subscribe(
            network,
            between,
            &names.carrier,
            &mut asking,
            turn,
            are_missing,
        )
        .await
        {
            Ok(()) => Ok(Self {
                port,
                ends,
                _asking: asking,
            }),
            Err(error) => {
                port.close().await;
                Err(error)
            }
        }
    }
}

impl BoardLink {
    /// Starts a move; gives its number.
    async fn move_numbered(&self, set: Set) -> Result<u64, DeviceError> {
        let announcements = self.announcements().await?;
        let (news, said) = self.ask_numbered(&Numbered::Submit(set)).await?;
        match news.state {
            MotionState::Moving => {}
            MotionState::Ended(MotionEnd::Failed { reason }) => {
                return Err(self.ports.refused(said, format!("what it says: {reason}")));
            }
            MotionState::Ended(end) => announcements.ends.add(news.number, end),
            MotionState::Unknown => return Err(self.senseless(said, &news)),
        }
        Ok(news.number)
    }

    /// Waits until a motion has ended.
    async fn end_of(&self, number: u64, deadline: Duration) -> Result<MotionEnd, DeviceError> {
        let deadline = Instant::now() + deadline;
        let ends = &self.announcements().await?.ends;
        loop {
            let came = ends.came.notified();
            tokio::pin!(came);
            // From here on nothing is missed.
            came.as_mut().enable();
            if let Some(end) = ends.of(number) {
                return Ok(end);
            }
            let pause = deadline.min(Instant::now() + POLL_INTERVAL);
            if timeout_at(pause, came).await.is_ok() {
                continue;
            }
            let asked = Numbered::Ask(number);
            match timeout_at(deadline, self.ask_numbered(&asked)).await {
                Ok(Ok((news, said))) => match news.state {
                    MotionState::Ended(end) if news.number == number => return Ok(end),
                    MotionState::Unknown => return Err(self.forgotten(number)),
                    MotionState::Moving => {}
                    MotionState::Ended(_) => return Err(self.senseless(said, &news)),
                },
                // Nothing is known until the board is back.
                Ok(Err(error)) => tracing::debug!("cannot ask for motion {number}: {error}"),
                Err(_) => {}
            }
            if Instant::now() >= deadline {
                return Err(self.not_ended(number));
            }
        }
    }

    async fn ask_numbered(&self, wanted: &Numbered) -> Result<(MotionUpdate, String), DeviceError> {
        let message = wanted
            .to_bottle()
            .ok_or_else(|| crate::reconnect::unsupported_request(wanted))?;
        let reply = self.ports.call(&message).await?;
        let said = message.to_string();
        match MotionUpdate::from_bottle(&reply) {
            Some(news) => Ok((news, said)),
            None => Err(self.ports.refused(said, REFUSAL_ADVICE)),
        }
    }

    fn remote_error(&self, step: String, advice: &str) -> DeviceError {
        DeviceError::Remote {
            peer: self.ports.remote().to_owned(),
            step,
            advice: advice.to_owned(),
            source: None,
        }
    }

    fn senseless(&self, said: String, news: &MotionUpdate) -> DeviceError {
        let step = format!("understanding `{}` to `{said}`", news.to_bottle());
        self.remote_error(step, "whether both are of one version")
    }

    fn forgotten(&self, number: u64) -> DeviceError {
        let step = format!("learning what became of motion {number}, which it does not know,");
        self.remote_error(step, "where the joints are: it was started again meanwhile")
    }

    fn not_ended(&self, number: u64) -> DeviceError {
        let step = format!("waiting in time for the end of motion {number}");
        self.remote_error(step, "a longer deadline, or whether the board is there")
    }
}

/// A move that was started here, under its number.
#[derive(Clone, Copy, Debug)]
pub struct RemoteMotion<'a> {
    board: &'a RemoteControlBoard,
    number: u64,
}

impl RemoteMotion<'_> {
    /// The number that the board gave it.
    pub fn number(&self) -> u64 {
        self.number
    }

    /// Waits until it has ended, however it ended. Blocks at most until `deadline` from now.
    ///
    /// The board announces the end; if an announcement is lost with its connection, the board is queried. An end of
    /// another move is never taken for this one's.
    ///
    /// Errors: [`DeviceError::Remote`] when the timeout has passed, or when the board does not know the number: it
    /// was restarted, and the end of the move is unknown.
    pub fn wait(&self, deadline: Duration) -> Result<MotionEnd, DeviceError> {
        let (link, number) = (&self.board.link, self.number);
        link.run(|link| async move { link.end_of(number, deadline).await })
    }

    /// Waits like [`wait`](Self::wait), for async code on a tokio runtime. Cancelling is safe.
    pub async fn ended(&self, deadline: Duration) -> Result<MotionEnd, DeviceError> {
        self.board.link.end_of(self.number, deadline).await
    }
}

impl RemoteControlBoard {
    /// Moves like [`PositionControl::position_move`](yarp_devices::PositionControl::position_move), and returns the
    /// motion, whose end can be waited for.
    ///
    /// * The first such call opens one more port, `LOCAL/async:i`. Blocks for a few deadlines at the most.
    /// * Errors: [`DeviceError::NotSupported`] by a board of stock, which has no numbers;
    ///   [`DeviceError::Refused`] with the reason of the board; else as for a move without number.
    pub fn position_move_numbered(
        &self,
        axes: Axes<'_>,
        targets: &[f64],
    ) -> Result<RemoteMotion<'_>, DeviceError> {
        self.numbered(Setting::Position, "target positions", axes, targets)
    }

    /// Moves like [`PositionControl::relative_move`](yarp_devices::PositionControl::relative_move), and returns the
    /// motion; otherwise as [`position_move_numbered`](Self::position_move_numbered).
    pub fn relative_move_numbered(
        &self,
        axes: Axes<'_>,
        distances: &[f64],
    ) -> Result<RemoteMotion<'_>, DeviceError> {
        self.numbered(Setting::Distance, "distances", axes, distances)
    }

    fn numbered(
        &self,
        setting: Setting,
        what: &'static str,
        axes: Axes<'_>,
        values: &[f64],
    ) -> Result<RemoteMotion<'_>, DeviceError> {
        axes.check_command(self.axes, what, values.len())?;
        axes.check_finite(self.axes, what, values)?;
        let set = Set::Values(setting, Selection::from(axes), values.to_vec());
        let moving = self
            .link
            .run(|link| async move { link.move_numbered(set).await });
        let number = moving?;
        Ok(RemoteMotion {
            board: self,
            number,
        })
    }
}
