//! `simulated_network_delay`: holds each message back, for tests.
//!
//! Source: 4.0.0, `portmonitors/simulated_network_delay`. As there, a message waits behind those
//! before it.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use yarp_wire::Bottle;

use super::throttle::milliseconds;
use super::{Made, Monitor, MonitorSetup, Passing, parameter, wanted};

/// The longest that a message may be held back.
const MAX_DELAY: Duration = Duration::from_secs(60);

/// Delay in microseconds.
#[derive(Debug)]
pub(super) struct Delay(AtomicU64);

impl Delay {
    pub(super) fn make(setup: &MonitorSetup) -> Made {
        let delay = Self(AtomicU64::new(0));
        delay.put(setup.number("delay_ms")?.unwrap_or_default());
        Ok(Arc::new(delay))
    }

    fn put(&self, number: f64) {
        let delay = milliseconds(number).min(MAX_DELAY);
        self.0.store(delay.as_micros() as u64, Ordering::Relaxed);
    }

    fn delay(&self) -> Duration {
        Duration::from_micros(self.0.load(Ordering::Relaxed))
    }
}

impl Monitor for Delay {
    fn update(&self, mut message: Passing) -> Option<Passing> {
        message.delay += self.delay();
        Some(message)
    }

    fn set(&self, parameters: &Bottle) {
        if let Some(delay) = wanted(parameters, "delay_ms") {
            self.put(delay);
        }
    }

    fn get(&self) -> Bottle {
        Bottle::of(parameter("delay_ms", self.delay().as_secs_f64() * 1000.0))
    }
}
