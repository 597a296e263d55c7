//! Motions of the arm: set points along a trajectory, and the correction at its end.

use yarp_devices::kinematics::Joints;
use yarp_planning::Trajectory;

use super::{PickError, Picker, Step};
use crate::workcell::Workcell;

/// Number of corrections at the end of a motion, and the time for each, s.
const CORRECTIONS: usize = 4;
const CORRECTION_TIME: f64 = 0.12;
/// Maximum correction of a joint, rad: more is no friction.
const MAX_CORRECTION: f64 = 0.06;
/// Maximum change of a correction, rad: a larger step would be a jerk.
const MAX_CORRECTION_STEP: f64 = 0.015;
/// Interval at which the speed of elbow and wrist is examined, s.
const SPEED_INTERVAL: f64 = 0.02;

/// A motion, and how much slower than its trajectory it is.
#[derive(Clone, Debug)]
pub(super) struct Motion {
    trajectory: Trajectory,
    slower: f64,
}

impl Motion {
    /// Returns the same motion with this multiple of its duration.
    pub(super) fn slowed(&self, factor: f64) -> Self {
        Self {
            slower: self.slower * factor,
            ..self.clone()
        }
    }

    /// Returns the posture at the end.
    pub(super) fn end(&self) -> Joints<7> {
        self.trajectory.joints_at(self.trajectory.duration())
    }
}

impl<W: Workcell> Picker<W> {
    /// Returns the motion along a trajectory on which elbow and wrist keep their maximum speed.
    pub(super) fn motion(&self, trajectory: Trajectory) -> Motion {
        let places = |time: f64| {
            let frames = self.model.chain.frames(&trajectory.joints_at(time));
            [frames[2], frames[5]].map(|frame| frame.translation.vector)
        };
        let mut fastest: f64 = 0.0;
        let mut last = places(0.0);
        let mut time = 0.0;
        while time < trajectory.duration() {
            time += SPEED_INTERVAL;
            let here = places(time);
            for (here, last) in here.iter().zip(&last) {
                fastest = fastest.max((here - last).norm() / SPEED_INTERVAL);
            }
            last = here;
        }
        Motion {
            trajectory,
            slower: (fastest / self.options.max_speed).max(1.0),
        }
    }

    /// Sends the arm along a motion, which begins where the last one ended.
    pub(super) fn follow(&mut self, motion: &Motion, step: Step) -> Result<(), PickError> {
        self.follow_with(motion, step, true)
    }

    /// Sends the arm along a motion with the correction of its start: that for the weight of a held object.
    pub(super) fn carry(&mut self, motion: &Motion, step: Step) -> Result<(), PickError> {
        self.follow_with(motion, step, false)
    }

    fn follow_with(&mut self, motion: &Motion, step: Step, fades: bool) -> Result<(), PickError> {
        let interval = self.options.interval;
        let duration = motion.trajectory.duration() * motion.slower;
        let count = (duration / interval).ceil() as usize;
        let correction = self.correction;
        for index in 1..=count {
            self.check_stop(step)?;
            let time = (index as f64 * interval).min(duration);
            let planned = motion.trajectory.joints_at(time / motion.slower);
            self.at = planned;
            if fades {
                // What corrected the last posture does not suit the next.
                self.correction = correction * (1.0 - time / duration.max(interval));
            }
            self.command(step)?;
            self.call(step, |cell| cell.wait(interval))?;
            self.check_tracking(step)?;
        }
        Ok(())
    }

    /// Waits at the end of a motion until friction and load are corrected.
    pub(super) fn settle(&mut self, step: Step) -> Result<(), PickError> {
        for _ in 0..CORRECTIONS {
            self.pause(CORRECTION_TIME, step)?;
            let measured = self.call(step, Workcell::joints)?;
            let step_of = |angle: f64| angle.clamp(-MAX_CORRECTION_STEP, MAX_CORRECTION_STEP);
            let more = self.correction + (self.at - measured).map(step_of);
            self.correction = more.map(|angle| angle.clamp(-MAX_CORRECTION, MAX_CORRECTION));
            self.command(step)?;
        }
        self.pause(CORRECTION_TIME, step)
    }

    /// Waits, and ends early on a request to halt.
    pub(super) fn pause(&mut self, seconds: f64, step: Step) -> Result<(), PickError> {
        let interval = self.options.interval;
        let count = (seconds / interval).ceil() as usize;
        for _ in 0..count {
            self.check_stop(step)?;
            self.call(step, |cell| cell.wait(interval))?;
        }
        Ok(())
    }

    fn command(&mut self, step: Step) -> Result<(), PickError> {
        let target: Joints<7> = self.model.chain.clamp(&(self.at + self.correction));
        self.call(step, |cell| cell.command(&target))
    }

    fn check_tracking(&mut self, step: Step) -> Result<(), PickError> {
        let measured = self.call(step, Workcell::joints)?;
        let away = (self.at - measured).abs();
        let joint = away.imax();
        match away[joint] > self.options.max_tracking_error {
            true => Err(PickError::Blocked {
                step,
                joint,
                error: away[joint],
            }),
            false => Ok(()),
        }
    }

    fn call<R>(
        &mut self,
        step: Step,
        call: impl FnOnce(&mut W) -> Result<R, crate::WorkcellError>,
    ) -> Result<R, PickError> {
        call(&mut self.cell).map_err(|source| PickError::Workcell { step, source })
    }
}
