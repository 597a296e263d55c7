//! `throttleDown`: lets one message through per period.
//!
//! Source: 4.0.0, `portmonitors/throttleDown`; the first period begins with the connection.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use yarp_wire::Bottle;

use super::{Made, Monitor, MonitorSetup, Passing, parameter, wanted};

#[derive(Debug)]
pub(super) struct Throttle(Mutex<State>);

#[derive(Debug)]
struct State {
    period: Duration,
    last: Instant,
}

/// Milliseconds as a time; negative ones are none.
pub(super) fn milliseconds(number: f64) -> Duration {
    Duration::try_from_secs_f64(number.max(0.0) / 1000.0).unwrap_or(Duration::MAX)
}

impl Throttle {
    pub(super) fn make(setup: &MonitorSetup) -> Made {
        let period = setup.number("period_ms")?.unwrap_or(1000.0);
        Ok(Arc::new(Self(Mutex::new(State {
            period: milliseconds(period),
            last: Instant::now(),
        }))))
    }

    fn state(&self) -> std::sync::MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Monitor for Throttle {
    fn update(&self, message: Passing) -> Option<Passing> {
        let mut state = self.state();
        let now = Instant::now();
        if now.duration_since(state.last) <= state.period {
            return None;
        }
        state.last = now;
        Some(message)
    }

    fn set(&self, parameters: &Bottle) {
        if let Some(period) = wanted(parameters, "period_ms") {
            self.state().period = milliseconds(period);
        }
    }

    fn get(&self) -> Bottle {
        let period = self.state().period.as_secs_f64() * 1000.0;
        Bottle::of(parameter("period_ms", period))
    }
}
