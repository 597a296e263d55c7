//! A bus in this process, with simulated pucks at the other end.

use std::collections::VecDeque;
use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use crate::can::{BusError, CanBus, CanFrame};
use crate::kinematics::Joints;
use crate::pseudo_random::Random;
use crate::simulation::SimulatedPucks;

/// Maximum time that the arm is behind when somebody looks at it after a long time: longer than pucks take to wake, and than
/// the safety module waits for a heartbeat.
const MAX_CATCH_UP: Duration = Duration::from_secs(3);
/// Number of periods after which time passes without a query of the driver.
const UNQUERIED_PERIODS: u32 = 2;
/// Purpose of the random numbers that decide which frames are lost.
const LOSS_PURPOSE: u64 = 100;
/// Interval between looks at the bus while a frame is waited for.
const POLL_INTERVAL: Duration = Duration::from_micros(500);

/// Function that is called after each control period with the joint angles, rad, and returns the torques that contact puts on the
/// joints during the next, Nm, or `None` to leave them.
type Surroundings<const N: usize> = Box<dyn FnMut(&Joints<N>) -> Option<Joints<N>> + Send>;

/// Simulated pucks, and the time until which they have been simulated.
pub(super) struct PucksInTime<const N: usize> {
    pucks: SimulatedPucks<N>,
    to_host: VecDeque<CanFrame>,
    frames: Vec<CanFrame>,
    passed: Instant,
    surroundings: Surroundings<N>,
    /// Pose in which somebody holds the arm, rad.
    held: Option<Joints<N>>,
    /// Share of the frames that are lost on their way, and the number of those that were.
    lost_share: f64,
    lost: u64,
    random: Random,
}

impl<const N: usize> fmt::Debug for PucksInTime<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("PucksInTime")
            .field("pucks", &self.pucks)
            .field("lost", &self.lost)
            .finish_non_exhaustive()
    }
}

impl<const N: usize> PucksInTime<N> {
    pub(super) fn new(pucks: SimulatedPucks<N>, surroundings: Surroundings<N>) -> Self {
        let seed = pucks.simulator().options().seed;
        Self {
            pucks,
            to_host: VecDeque::new(),
            frames: Vec::new(),
            passed: Instant::now(),
            surroundings,
            held: None,
            lost_share: 0.0,
            lost: 0,
            random: Random::for_purpose(seed, LOSS_PURPOSE),
        }
    }

    /// Holds the arm in a pose, as somebody does who stands beside it, or lets it go.
    pub(super) fn hold(&mut self, pose: Option<Joints<N>>) {
        self.held = pose;
    }

    /// Loses this share of all frames from now on, in both directions.
    pub(super) fn lose(&mut self, share: f64) {
        self.lost_share = share;
    }

    /// Returns the number of frames that were lost.
    pub(super) fn lost(&self) -> u64 {
        self.lost
    }

    fn is_lost(&mut self) -> bool {
        let is_lost = self.random.chance(self.lost_share);
        self.lost += u64::from(is_lost);
        is_lost
    }

    /// Queues the frames of the pucks for the driver.
    fn transmit(&mut self) {
        for frame in std::mem::take(&mut self.frames) {
            if !self.is_lost() {
                self.to_host.push_back(frame);
            }
        }
    }

    /// Receives a frame of the driver.
    fn receive(&mut self, frame: &CanFrame, now: Instant) {
        self.pass_until(now, SimulatedPucks::asks_for_positions(frame));
        if !self.is_lost() {
            self.pucks.receive(frame, &mut self.frames);
            self.transmit();
        }
    }

    /// Returns the pucks.
    pub(super) fn pucks_mut(&mut self) -> &mut SimulatedPucks<N> {
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
        let mut left = time;
        while !left.is_zero() {
            let step = left.min(period);
            self.pucks.advance(step, &mut self.frames);
            left -= step;
            if let Some(pose) = &self.held {
                self.pucks.simulator_mut().place(pose);
            }
            let angles = self.pucks.simulator().angles();
            if let Some(torques) = (self.surroundings)(&angles) {
                self.pucks.simulator_mut().set_contact_torques(torques);
            }
        }
        self.transmit();
    }
}

/// The driver's end of the bus.
pub(super) struct InProcessBus<const N: usize>(Arc<Mutex<PucksInTime<N>>>);

impl<const N: usize> InProcessBus<N> {
    /// Connects to the pucks; frames that nobody has received are gone.
    pub(super) fn new(pucks: Arc<Mutex<PucksInTime<N>>>) -> Self {
        let bus = Self(pucks);
        bus.lock().to_host.clear();
        bus
    }

    fn lock(&self) -> MutexGuard<'_, PucksInTime<N>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<const N: usize> CanBus for InProcessBus<N> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), BusError> {
        self.lock().receive(frame, Instant::now());
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
    use crate::wam::AXES;
    use crate::wam::WamModel;

    const PERIOD: Duration = Duration::from_millis(2);

    fn pucks() -> PucksInTime<AXES> {
        let pucks = SimulatedPucks::new(WamModel::<7>::new(), SimulatorOptions::default());
        PucksInTime::new(pucks, Box::new(|_| None))
    }

    #[test]
    fn surroundings_are_told_the_angles_of_each_period() {
        let mut pucks = pucks();
        let told = Arc::new(Mutex::new(Vec::new()));
        let theirs = Arc::clone(&told);
        pucks.surroundings = Box::new(move |angles| {
            let mut told = theirs.lock().unwrap();
            told.push(angles[1]);
            Some(Joints::<AXES>::repeat(told.len() as f64))
        });
        let start = pucks.passed;
        pucks.pass_until(start + PERIOD, true);
        pucks.pass_until(start + PERIOD * 4, true);
        assert_eq!(told.lock().unwrap().len(), 4);
        assert!((told.lock().unwrap()[3] - pucks.pucks.simulator().angles()[1]).abs() < 1e-12);
        let torques = pucks.pucks.simulator().contact_torques();
        assert_eq!(torques, Joints::<AXES>::repeat(4.0));
    }

    /// Puck 1 is asked for its state.
    #[test]
    fn the_share_of_frames_that_are_lost_is_lost() {
        let mut pucks = pucks();
        let asked = CanFrame::new(0x001, &[0x05]).unwrap();
        let answered = |share: f64, pucks: &mut PucksInTime<AXES>| {
            pucks.lose(share);
            pucks.to_host.clear();
            let now = pucks.passed;
            for _ in 0..1000 {
                pucks.receive(&asked, now);
            }
            pucks.to_host.len()
        };
        assert_eq!(answered(0.0, &mut pucks), 1000);
        assert_eq!(pucks.lost(), 0);
        assert_eq!(answered(1.0, &mut pucks), 0);
        assert_eq!(pucks.lost(), 1000);
        // Question or answer.
        let answers = answered(0.1, &mut pucks);
        assert!((750..870).contains(&answers), "{answers}");
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
