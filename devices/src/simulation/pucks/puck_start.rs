//! From the power-up of a puck to its firmware.

use std::time::Duration;

use crate::can::puck::status;

/// Default time from the command to wake to the first reply. Not published: libbarrett waits 1 s for it, btclient and
/// owd up to 1.2 s.
const WAKE_TIME: Duration = Duration::from_millis(500);
/// Default time after power-up at which the firmware starts by itself (BH8-262 manual, appendix D).
const SELF_START_TIME: Duration = Duration::from_secs(2);

/// Times of a simulated puck from monitor state to its firmware.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub struct WakeUp {
    /// Time from the command to wake to the first reply; the puck is silent meanwhile. `None`: it never replies again.
    pub wake_time: Option<Duration>,
    /// Time after power-up at which the firmware starts without a command. `None`: never, as with older firmware.
    pub self_start: Option<Duration>,
}

/// Half a second after the command, two seconds without one.
impl Default for WakeUp {
    fn default() -> Self {
        Self {
            wake_time: Some(WAKE_TIME),
            self_start: Some(SELF_START_TIME),
        }
    }
}

#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum State {
    Off,
    Monitor,
    Waking,
    Ready,
}

/// State of a puck's start.
#[derive(Clone, Copy, Debug)]
pub(super) struct PuckStart {
    wake_up: WakeUp,
    state: State,
    /// Time in this state.
    elapsed: Duration,
}

impl PuckStart {
    /// A puck after power-up.
    pub(super) fn switched_on(wake_up: WakeUp) -> Self {
        Self {
            wake_up,
            state: State::Monitor,
            elapsed: Duration::ZERO,
        }
    }

    pub(super) fn switch_off(&mut self) {
        self.enter(State::Off);
    }

    pub(super) fn wake_up(&self) -> WakeUp {
        self.wake_up
    }

    pub(super) fn set_wake_up(&mut self, wake_up: WakeUp) {
        self.wake_up = wake_up;
    }

    fn enter(&mut self, state: State) {
        self.state = state;
        self.elapsed = Duration::ZERO;
    }

    pub(super) fn advance(&mut self, time: Duration) {
        self.elapsed += time;
        let limit = match self.state {
            State::Monitor => self.wake_up.self_start,
            State::Waking => self.wake_up.wake_time,
            State::Off | State::Ready => None,
        };
        if limit.is_some_and(|limit| self.elapsed >= limit) {
            self.enter(State::Ready);
        }
    }

    /// Returns `STAT`; `None` while the puck cannot reply.
    pub(super) fn status(&self) -> Option<i32> {
        match self.state {
            State::Off | State::Waking => None,
            State::Monitor => Some(status::MONITOR),
            State::Ready => Some(status::READY),
        }
    }

    /// Handles a command that sets `STAT`.
    pub(super) fn set_status(&mut self, value: i32) {
        match (self.state, value) {
            (State::Off | State::Waking, _) | (State::Ready, status::READY) => {}
            (State::Monitor, status::READY) => {
                self.enter(State::Waking);
                self.advance(Duration::ZERO);
            }
            _ => self.enter(State::Monitor),
        }
    }

    pub(super) fn is_awake(&self) -> bool {
        self.state == State::Ready
    }

    pub(super) fn is_waking(&self) -> bool {
        self.state == State::Waking
    }
}
