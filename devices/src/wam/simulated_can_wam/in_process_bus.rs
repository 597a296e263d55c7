//! A bus in this process, with simulated pucks at the other end.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use crate::can::{BusError, CanBus, CanFrame};
use crate::simulation::SimulatedPucks;

/// Maximum time that the arm is behind when somebody looks at it after a long time: longer than pucks take to wake, and than
/// the safety module waits for a heartbeat.
const MAX_CATCH_UP: Duration = Duration::from_secs(3);
/// Number of periods after which time passes without a query of the driver.
const UNQUERIED_PERIODS: u32 = 2;
/// Interval between looks at the bus while a frame is waited for.
const POLL_INTERVAL: Duration = Duration::from_micros(500);

/// Simulated pucks, and the time until which they have been simulated.
#[derive(Debug)]
pub(super) struct PucksInTime {
    pucks: SimulatedPucks,
    to_host: VecDeque<CanFrame>,
    frames: Vec<CanFrame>,
    passed: Instant,
}

impl PucksInTime {
    pub(super) fn new(pucks: SimulatedPucks) -> Self {
        Self {
            pucks,
            to_host: VecDeque::new(),
            frames: Vec::new(),
            passed: Instant::now(),
        }
    }

    /// Returns the pucks.
    pub(super) fn pucks_mut(&mut self) -> &mut SimulatedPucks {
        &mut self.pucks
    }

    /// Lets the time pass that has passed outside, if the driver does not query positions.
    pub(super) fn pass(&mut self) {
        self.pass_until(Instant::now(), false);
    }

    /// Lets time pass in whole periods. With a query of positions, which begins a control period, the number of periods is rounded:
    /// so that each query sees the arm one period later, though threads wake some time early or late.
    fn pass_until(&mut self, now: Instant, is_query: bool) {
        let period = self.pucks.simulator().options().period;
        if period.is_zero() {
            return;
        }
        let elapsed = now.saturating_duration_since(self.passed);
        let within = elapsed.min(MAX_CATCH_UP);
        let periods = within.as_secs_f64() / period.as_secs_f64();
        let time = if is_query {
            self.passed = now;
            period * periods.round() as u32
        } else if within >= period * UNQUERIED_PERIODS {
            let time = period * periods as u32;
            self.passed = now - (within - time);
            time
        } else {
            return;
        };
        self.pucks.advance(time, &mut self.frames);
        self.to_host.extend(self.frames.drain(..));
    }
}

/// The driver's end of the bus.
pub(super) struct InProcessBus(Arc<Mutex<PucksInTime>>);

impl InProcessBus {
    /// Connects to the pucks; frames that nobody has received are gone.
    pub(super) fn new(pucks: Arc<Mutex<PucksInTime>>) -> Self {
        let bus = Self(pucks);
        bus.lock().to_host.clear();
        bus
    }

    fn lock(&self) -> MutexGuard<'_, PucksInTime> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl CanBus for InProcessBus {
    fn send(&mut self, frame: &CanFrame) -> Result<(), BusError> {
        let mut end = self.lock();
        let end = &mut *end;
        end.pass_until(Instant::now(), SimulatedPucks::asks_for_positions(frame));
        end.pucks.receive(frame, &mut end.frames);
        end.to_host.extend(end.frames.drain(..));
        Ok(())
    }

    fn receive(&mut self, deadline: Instant) -> Result<Option<CanFrame>, BusError> {
        loop {
            let now = Instant::now();
            {
                let mut end = self.lock();
                end.pass_until(now, false);
                if let Some(frame) = end.to_host.pop_front() {
                    return Ok(Some(frame));
                }
            }
            if now >= deadline {
                return Ok(None);
            }
            thread::sleep((deadline - now).min(POLL_INTERVAL));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::SimulatorOptions;
    use crate::wam::WamModel;

    const PERIOD: Duration = Duration::from_millis(2);

    fn pucks() -> PucksInTime {
        PucksInTime::new(SimulatedPucks::new(
            WamModel::<7>::new(),
            SimulatorOptions::default(),
        ))
    }

    #[test]
    fn each_query_sees_the_arm_one_period_later_though_it_comes_early_or_late() {
        let mut pucks = pucks();
        let start = pucks.passed;
        for cycle in 1..=10_u32 {
            let early = Duration::from_micros(if cycle % 2 == 0 { 0 } else { 900 });
            pucks.pass_until(start + PERIOD * cycle - early, true);
            assert_eq!(pucks.pucks.simulator().time(), PERIOD * cycle);
        }
        // After an interruption the arm has moved on; the driver, which makes up for it, moves nothing more.
        pucks.pass_until(start + PERIOD * 30, true);
        assert_eq!(pucks.pucks.simulator().time(), PERIOD * 30);
        pucks.pass_until(start + PERIOD * 30 + PERIOD / 10, true);
        assert_eq!(pucks.pucks.simulator().time(), PERIOD * 30);
    }

    #[test]
    fn time_passes_without_a_driver_too() {
        let mut pucks = pucks();
        let start = pucks.passed;
        pucks.pass_until(start + PERIOD * 3 / 2, false);
        assert_eq!(pucks.pucks.simulator().time(), Duration::ZERO);
        pucks.pass_until(start + PERIOD * 7 / 2, false);
        assert_eq!(pucks.pucks.simulator().time(), PERIOD * 3);
        // The rest is kept, and a long time is cut.
        pucks.pass_until(start + PERIOD * 5, false);
        assert_eq!(pucks.pucks.simulator().time(), PERIOD * 5);
        pucks.pass_until(start + Duration::from_secs(1000), false);
        assert_eq!(pucks.pucks.simulator().time(), PERIOD * 5 + MAX_CATCH_UP);
    }
}
