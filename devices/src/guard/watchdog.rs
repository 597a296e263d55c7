//! The thread that monitors moving joints.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tracing::{error, warn};

use super::JointLimits;
use super::stop_switch::{StopSwitch, stop_joints};
use crate::{Axes, AxisIndex, Device, DeviceError, Mode};

/// Interval between checks of moving joints.
const CHECK_INTERVAL: Duration = Duration::from_millis(10);

/// Speed below which a joint under torques is at rest, per second: encoders count.
const STANDSTILL_SPEED: f64 = 1.0;

/// State shared by the thread and the callers.
pub(super) struct Watchdog {
    pub(super) device: Arc<dyn Device>,
    settings: WatchSettings,
    /// The software stop, enforced by the thread as long as it is engaged.
    pub(super) stop: StopSwitch,
    /// Number of commands in progress that move a hand as a whole.
    hand_motions: AtomicUsize,
    state: Mutex<State>,
    woken: Condvar,
}

/// Limits and timeouts of a [`Watchdog`].
pub(super) struct WatchSettings {
    /// Limits of joints that move at a velocity: only those narrower than the device's own, which it enforces itself.
    pub(super) limits: JointLimits,
    /// Limits of joints under torques, which no device enforces.
    pub(super) effort_limits: JointLimits,
    /// Maximum age of a velocity.
    pub(super) velocity_timeout: Option<Duration>,
    /// Maximum age of a torque, a current or a duty cycle.
    pub(super) effort_timeout: Option<Duration>,
}

struct State {
    /// One per axis: the last commanded velocity, if that is not 0.
    streams: Vec<Option<Stream>>,
    ending: bool,
}

/// A command in progress that moves a hand as a whole.
pub(super) struct HandMotion<'w>(&'w AtomicUsize);

impl Drop for HandMotion<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::SeqCst);
    }
}

#[derive(Clone, Copy)]
struct Stream {
    /// Time of the command.
    commanded_at: Instant,
    /// Maximum deceleration of the joint, per second squared.
    acceleration: f64,
    /// Pushed by torques: it takes another mode to make it hold.
    pushed: bool,
}

impl Watchdog {
    pub(super) fn new(device: Arc<dyn Device>, settings: WatchSettings, axes: usize) -> Self {
        Self {
            device,
            settings,
            stop: StopSwitch::default(),
            hand_motions: AtomicUsize::new(0),
            state: Mutex::new(State {
                streams: vec![None; axes],
                ending: false,
            }),
            woken: Condvar::new(),
        }
    }

    /// Records a commanded velocity of a joint; 0 ends its stream.
    pub(super) fn record_velocity(&self, joint: AxisIndex, velocity: f64, acceleration: f64) {
        let stream = Stream {
            commanded_at: Instant::now(),
            acceleration,
            pushed: false,
        };
        self.note(joint, (velocity != 0.0).then_some(stream));
    }

    /// Records a commanded torque, current or duty cycle of a joint; 0 does not end its stream, for the joint may coast.
    pub(super) fn record_torque(&self, joint: AxisIndex) {
        let stream = Stream {
            commanded_at: Instant::now(),
            // Not known under torques: judged by where it would be after the two periods alone.
            acceleration: f64::INFINITY,
            pushed: true,
        };
        self.note(joint, Some(stream));
    }

    fn note(&self, joint: AxisIndex, stream: Option<Stream>) {
        if let Some(slot) = self.lock().streams.get_mut(joint.index()) {
            *slot = stream;
        }
        self.woken.notify_all();
    }

    /// Takes note that joints take no velocities any more.
    pub(super) fn end_streams(&self, axes: Axes<'_>, total: usize) {
        let mut state = self.lock();
        for joint in axes.iter(total) {
            if let Some(slot) = state.streams.get_mut(joint.index()) {
                *slot = None;
            }
        }
    }

    /// Has the thread look at once.
    pub(super) fn wake(&self) {
        // Under the lock: the thread is not between its check and its wait.
        let _state = self.lock();
        self.woken.notify_all();
    }

    pub(super) fn end(&self) {
        self.lock().ending = true;
        self.woken.notify_all();
    }

    /// Runs the watchdog until [`end`](Self::end).
    pub(super) fn run(&self) {
        let mut state = self.lock();
        let mut failing = false;
        while !state.ending {
            if state.streams.iter().all(Option::is_none) && !self.stop.is_engaged() {
                state = self
                    .woken
                    .wait(state)
                    .unwrap_or_else(PoisonError::into_inner);
                continue;
            }
            let streams = state.streams.clone();
            drop(state);
            if self.stop.is_engaged() {
                self.enforce_stop(&mut failing);
            }
            for (joint, stream) in streams.iter().enumerate() {
                let Some(stream) = stream else { continue };
                if let Some(why) = self.must_stop(joint.into(), stream) {
                    self.stop(joint.into(), why, stream);
                }
            }
            state = self.lock();
            if !state.ending {
                (state, _) = self
                    .woken
                    .wait_timeout(state, CHECK_INTERVAL)
                    .unwrap_or_else(PoisonError::into_inner);
            }
        }
    }

    /// Counts a command that moves a hand as a whole, until the result is dropped.
    pub(super) fn begin_hand_motion(&self) -> HandMotion<'_> {
        self.hand_motions.fetch_add(1, Ordering::SeqCst);
        HandMotion(&self.hand_motions)
    }

    /// Ends motions of a hand as a whole, and brings the joints to rest; returns the first error.
    pub(super) fn stop_all(&self) -> Result<(), DeviceError> {
        let aborted = match self.device.hand() {
            Some(hand) if self.hand_motions.load(Ordering::SeqCst) > 0 => hand.abort(),
            _ => Ok(()),
        };
        aborted.and(stop_joints(self.device.as_ref()))
    }

    /// A command that came at the same time as the stop may have got past it.
    fn enforce_stop(&self, failing: &mut bool) {
        let stopped = self.stop_all();
        if let Err(error) = &stopped
            && !*failing
        {
            error!(%error, "the software stop could not stop a joint; trying again");
        }
        *failing = stopped.is_err();
    }

    fn must_stop(&self, joint: AxisIndex, stream: &Stream) -> Option<&'static str> {
        let over = |timeout: Duration| stream.commanded_at.elapsed() > timeout;
        let (timeout, limits) = match stream.pushed {
            true => (self.settings.effort_timeout, &self.settings.effort_limits),
            false => (self.settings.velocity_timeout, &self.settings.limits),
        };
        if timeout.is_some_and(over) {
            return Some("its stream of commands has stopped");
        }
        let limits = limits.of(joint)?;
        let reading = self
            .device
            .encoders()?
            .encoder_readings(joint.into())
            .and_then(|readings| readings.first().copied().ok_or(NO_READING));
        let Ok(now) = reading else {
            return Some("its position is not known");
        };
        if stream.pushed && now.speed.abs() < STANDSTILL_SPEED {
            return None;
        }
        // It continues for two periods before a stop can take effect, and then brakes.
        let going_on = now.speed * 2.0 * CHECK_INTERVAL.as_secs_f64();
        let braking = now.speed * now.speed.abs() / (2.0 * stream.acceleration);
        let rest = now.position + going_on + braking;
        let leaves =
            (now.speed > 0.0 && rest >= limits.max) || (now.speed < 0.0 && rest <= limits.min);
        leaves.then_some("it comes to its limit")
    }

    /// Makes a joint hold; tried again in the next round if that fails.
    fn stop(&self, joint: AxisIndex, why: &'static str, seen: &Stream) {
        let stopped = if seen.pushed {
            self.hold(joint)
        } else {
            match (
                self.device.velocity_control(),
                self.device.position_control(),
            ) {
                (Some(control), _) => control.stop(joint.into()),
                (None, Some(control)) => control.stop(joint.into()),
                (None, None) => return,
            }
        };
        match stopped {
            Ok(()) => {
                warn!(%joint, why, "the guard stopped a joint");
                let mut state = self.lock();
                let slot = &mut state.streams[joint.index()];
                // A command that came meanwhile is a stream of its own.
                if slot.is_some_and(|now| now.commanded_at == seen.commanded_at) {
                    *slot = None;
                }
            }
            Err(error) => error!(%joint, why, %error, "the guard could not stop a joint"),
        }
    }

    /// Takes a joint out of torque mode: in position mode it comes to rest and holds; in idle mode if there is no
    /// position mode.
    fn hold(&self, joint: AxisIndex) -> Result<(), DeviceError> {
        match self.device.control_mode() {
            Some(modes) => {
                let held = modes.set_control_modes(joint.into(), &[Mode::Position]);
                held.or_else(|_| modes.set_control_modes(joint.into(), &[Mode::Idle]))
            }
            None => match self.device.torque_control() {
                Some(control) => control.set_reference_torques(joint.into(), &[0.0]),
                None => Ok(()),
            },
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // Each stream is whole between any two calls.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

const NO_READING: DeviceError = DeviceError::NoDataYet {
    what: "encoder reading",
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{AxisInfo, EncoderReading, Encoders, JointType, Limits};

    /// A joint at the upper end of its range that moves on with this speed.
    struct Moving(f64);

    impl AxisInfo for Moving {
        fn axes(&self) -> usize {
            1
        }

        fn axis_name(&self, _: AxisIndex) -> Result<String, DeviceError> {
            Ok("joint".to_owned())
        }

        fn joint_type(&self, _: AxisIndex) -> Result<JointType, DeviceError> {
            Ok(JointType::Revolute)
        }
    }

    impl Encoders for Moving {
        fn read_encoders(
            &self,
            _: Axes<'_>,
            out: &mut [EncoderReading],
        ) -> Result<(), DeviceError> {
            out.fill(EncoderReading {
                position: 20.0,
                speed: self.0,
                ..EncoderReading::default()
            });
            Ok(())
        }

        fn set_encoders(&self, _: Axes<'_>, _: &[f64]) -> Result<(), DeviceError> {
            Err(NO_READING)
        }
    }

    impl Device for Moving {
        crate::offers! { encoders: Encoders }
    }

    /// One encoder count in a period of 2 ms is 1.05 degrees/s at the base of the arm: what is slower is no motion.
    #[test]
    fn a_joint_under_torques_may_rest_at_its_limit_but_not_move_on() {
        let limits = JointLimits(vec![Limits::new(-20.0, 20.0)]);
        for (speed, pushed, stops) in [
            (0.96, true, false),
            (1.05, true, true),
            // At a velocity there is no doubt that it moves.
            (0.96, false, true),
        ] {
            let settings = WatchSettings {
                limits: limits.clone(),
                effort_limits: limits.clone(),
                velocity_timeout: None,
                effort_timeout: None,
            };
            let watchdog = Watchdog::new(Arc::new(Moving(speed)), settings, 1);
            let stream = Stream {
                commanded_at: Instant::now(),
                acceleration: 100.0,
                pushed,
            };
            let why = watchdog.must_stop(0.into(), &stream);
            assert_eq!(why.is_some(), stops, "{speed} deg/s, pushed: {pushed}");
        }
    }
}
