//! Motions of the arm: set points along a trajectory, and the correction at its end.

use yarp_devices::kinematics::Joints;
use yarp_planning::Trajectory;

use super::{PickError, Picker, Step};
use crate::task_event::TaskEvent;
use crate::workcell::Workcell;

/// Number of corrections at the end of a motion, and the time for each, s.
const CORRECTIONS: usize = 4;
const CORRECTION_TIME: f64 = 0.12;
/// Maximum correction of a joint, rad: more is no friction.
const MAX_CORRECTION: f64 = 0.06;
/// Maximum change of a correction, rad: a larger step would be a jerk.
const MAX_CORRECTION_STEP: f64 = 0.015;
/// Tracking errors, as parts of the maximum, from which on a motion slows down and at which its set point waits for the arm: an
/// arm that gets set points again after some were lost must not be so far behind that it becomes too fast.
const SLOWS_FROM: f64 = 0.12;
const WAITS_AT: f64 = 0.24;
/// Time between two set points, as a multiple of their interval, from which on the motion begins anew, slower.
const MAX_LATENESS: f64 = 3.0;
/// Time in which a motion that waited gets its planned pace again, s.
const PACE_RISE_TIME: f64 = 0.4;
/// Part of the planned pace below which the arm counts as not moving on, and the time after which it is blocked, s.
const MIN_PACE: f64 = 0.1;
const BLOCKED_TIME: f64 = 1.0;
/// Number of postures that describe a path in an event.
const PATH_POSTURES: usize = 40;
/// Interval at which the speed of elbow and wrist is examined, s.
const SPEED_INTERVAL: f64 = 0.02;

/// Returns how far each joint is from where it should be, rad: from the planned place, or the corrected one if it is nearer to that. A
/// correction against friction that the joint does not meet on its way brings it there.
fn distance_from_way(
    planned: &Joints<7>,
    correction: &Joints<7>,
    measured: &Joints<7>,
) -> Joints<7> {
    let from_planned = (planned - measured).abs();
    from_planned.inf(&(planned + correction - measured).abs())
}

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

    /// Returns postures along the motion, from its begin to its end.
    pub(super) fn postures(&self) -> Vec<Joints<7>> {
        let last = PATH_POSTURES - 1;
        let part = |index: usize| self.trajectory.duration() * index as f64 / last as f64;
        (0..=last)
            .map(|index| self.trajectory.joints_at(part(index)))
            .collect()
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
        if self.observer.is_watching() {
            let path = motion.postures();
            self.notify(&TaskEvent::Step { step, path: &path });
        }
        let interval = self.options.interval;
        let duration = motion.trajectory.duration() * motion.slower;
        let correction = self.correction;
        let (mut time, mut pace, mut waiting) = (0.0, 1.0, 0.0);
        while time < duration {
            self.check_stop(step)?;
            time = (time + interval * pace).min(duration);
            let planned = motion.trajectory.joints_at(time / motion.slower);
            self.at = planned;
            if fades {
                // What corrected the last posture does not suit the next.
                self.correction = correction * (1.0 - time / duration.max(interval));
            }
            self.command_or_stall(step)?;
            let passed = self.call(step, |cell| cell.wait(interval))?;
            let (joint, error) = self.tracking_error(step)?;
            // Slower at once, and faster again little by little: a start at full speed overshoots. An arm that got no set point
            // for a while stands.
            let most = self.pace(error).min(MAX_LATENESS * interval / passed);
            pace = most.min(pace + interval / PACE_RISE_TIME);
            waiting = match pace < MIN_PACE {
                true => waiting + interval,
                false => 0.0,
            };
            if error > self.options.max_tracking_error || waiting > BLOCKED_TIME {
                return Err(PickError::Blocked { step, joint, error });
            }
        }
        Ok(())
    }

    /// Returns the part of its planned speed at which a motion goes on while the arm is this far from its set point, rad: a
    /// network or a robot that is late for a moment makes a motion slower, and does not end it.
    fn pace(&self, error: f64) -> f64 {
        let part = error / self.options.max_tracking_error;
        ((WAITS_AT - part) / (WAITS_AT - SLOWS_FROM)).clamp(0.0, 1.0)
    }

    /// Waits at the end of a motion until friction and load are corrected.
    pub(super) fn settle(&mut self, step: Step) -> Result<(), PickError> {
        for _ in 0..CORRECTIONS {
            self.pause(CORRECTION_TIME, step)?;
            let measured = self.call(step, Workcell::joints)?;
            let step_of = |angle: f64| angle.clamp(-MAX_CORRECTION_STEP, MAX_CORRECTION_STEP);
            let more = self.correction + (self.at - measured).map(step_of);
            self.correction = more.map(|angle| angle.clamp(-MAX_CORRECTION, MAX_CORRECTION));
            self.command_or_stall(step)?;
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

    /// Sends the set point. An arm that noticed itself that a joint stalled refuses it, and takes set points again once it
    /// resumes: then it was blocked, and has not failed.
    fn command_or_stall(&mut self, step: Step) -> Result<(), PickError> {
        let refused = match self.command(step) {
            Ok(()) => return Ok(()),
            Err(refused) => refused,
        };
        self.call(step, Workcell::resume)?;
        let (joint, error) = self.tracking_error(step)?;
        tracing::info!(error = %refused, %step, "the arm stopped");
        Err(PickError::Blocked { step, joint, error })
    }

    /// Returns the joint that is farthest from its set point, and how far, rad.
    fn tracking_error(&mut self, step: Step) -> Result<(usize, f64), PickError> {
        let measured = self.call(step, Workcell::joints)?;
        let away = distance_from_way(&self.at, &self.correction, &measured);
        let joint = away.imax();
        Ok((joint, away[joint]))
    }

    pub(super) fn call<R>(
        &mut self,
        step: Step,
        call: impl FnOnce(&mut W) -> Result<R, crate::WorkcellError>,
    ) -> Result<R, PickError> {
        call(&mut self.cell).map_err(|source| PickError::Workcell { step, source })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wrist that was corrected by as much as a motion waits for counted as blocked once it moved freely.
    #[test]
    fn a_joint_at_its_corrected_place_is_not_behind() {
        let only = |angle: f64| Joints::<7>::from([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, angle]);
        let (planned, correction) = (only(1.0), only(MAX_CORRECTION));
        let away = |measured: f64| distance_from_way(&planned, &correction, &only(measured)).amax();
        assert!(away(1.0) < 1e-12);
        assert!(away(1.0 + MAX_CORRECTION) < 1e-12);
        // Halfway, behind and beyond.
        assert!((away(1.0 + MAX_CORRECTION / 2.0) - MAX_CORRECTION / 2.0).abs() < 1e-12);
        assert!((away(0.9) - 0.1).abs() < 1e-12);
        assert!((away(1.1 + MAX_CORRECTION) - 0.1).abs() < 1e-12);
    }
}
