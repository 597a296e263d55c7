//! The motion in progress, and its computation in each cycle.

use nalgebra::{Rotation3, Translation3, Vector3};

use super::arm_adapter::{ArmAdapter, Measured};
use super::cartesian_settings::{Settings, swept};
use super::minimum_jerk_path::Path;
use crate::DeviceError;
use crate::kinematics::{Chain, Joints, Pose, Task, distances};
use crate::trajectory::MAX_TOOL_SPEED;

/// Maximum time that an arm may take to begin following positions, s.
const ENGAGE_TIMEOUT: f64 = 2.0;
/// An arm that was commanded to the target and has not moved for so long has arrived as far as it can, s.
const SETTLE_TIMEOUT: f64 = 1.0;
/// Change of a joint below which it counts as at rest, rad.
const STANDSTILL_ANGLE: f64 = 1e-4;
/// An arm gets no further commands while it is farther than this from its last command, m. After a pause of its
/// control it catches up in a jump: 2 cm make the simulated arm 0.8 m/s fast, 3 cm 1.03 m/s, which trips the safety
/// module.
const MAX_LAG: f64 = 0.015;
/// The highest speed on a way of minimum jerk from rest to rest, as a multiple of the mean one.
pub(super) const PEAK_TO_MEAN_SPEED: f64 = 1.875;

/// The task of a line on which each position is near the one before, and the places of a step.
pub(super) type Followed<const N: usize> = (Task, Option<Vec<Joints<N>>>);

/// A motion, from its command to its end.
#[derive(Debug)]
pub(super) struct Motion<const N: usize> {
    /// Settings at the time of the command.
    pub(super) settings: Settings<N>,
    pub(super) chain: Chain<N>,
    kind: Kind<N>,
    /// The target it began with: for keeping it.
    pub(super) target: Option<(Pose, Task)>,
    /// The last command sent to the arm, rad.
    pub(super) commanded: Joints<N>,
    /// Velocity of that command, rad/s.
    pub(super) velocity: Joints<N>,
    max_velocities: Joints<N>,
    /// None before the arm follows.
    engaged: bool,
    waited: f64,
    /// Measured state of an arm that is too far behind, so that the motion waits for it.
    behind: Option<Measured<N>>,
}

#[derive(Debug)]
enum Kind<const N: usize> {
    /// To a pose.
    Path {
        path: Box<Path<N>>,
        task: Task,
        /// The joints change little from place to place: the search begins where they are.
        is_followed: bool,
        /// Joint positions evenly spaced on the line, which the arm goes through.
        places: Option<Vec<Joints<N>>>,
        time: f64,
        fraction: f64,
        still: Option<Measured<N>>,
    },
    /// At a velocity: metres and rad per second.
    Velocity {
        linear: Vector3<f64>,
        angular: Vector3<f64>,
        pose: Pose,
    },
    /// There, and kept there.
    Hold,
}

/// Result of a cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Progress {
    /// The motion begins.
    pub(super) onset: bool,
    /// From which to which part of the way it went.
    pub(super) covered: Option<(f64, f64)>,
    /// The target is reached.
    pub(super) there: bool,
}

/// Reasons why a motion ends early.
#[derive(Debug, thiserror::Error)]
pub(super) enum MotionFailure {
    #[error("its joints were set to another mode, or have a fault")]
    ModeChanged,
    #[error("the arm does not follow positions although it was commanded to")]
    NotFollowing,
    #[error("{0}")]
    Device(#[from] DeviceError),
}

impl<const N: usize> Motion<N> {
    fn new(
        arm: &ArmAdapter<N>,
        settings: Settings<N>,
        chain: Chain<N>,
        commanded: Joints<N>,
        kind: Kind<N>,
    ) -> Result<Self, DeviceError> {
        Ok(Self {
            settings,
            chain,
            kind,
            target: None,
            commanded,
            velocity: Joints::zeros(),
            max_velocities: arm.max_velocities()?,
            engaged: false,
            waited: 0.0,
            behind: None,
        })
    }

    /// Plans a path to `goal` from `start`; continues the path of `before`, if it has one. `followed`:
    /// none where the posture has to change on the way.
    pub(super) fn to(
        arm: &ArmAdapter<N>,
        settings: Settings<N>,
        chain: Chain<N>,
        (start, goal): (Joints<N>, Joints<N>),
        (target, task, followed): (Pose, Task, Option<Followed<N>>),
        duration: f64,
        before: Option<&Self>,
    ) -> Result<Self, DeviceError> {
        let left = before.and_then(|motion| match &motion.kind {
            Kind::Path { path, time, .. } => Some((&**path, *time)),
            _ => None,
        });
        let from = (chain.forward(&start), start);
        let end = chain.forward(&goal);
        let way = (end.translation.vector - from.0.translation.vector).norm();
        let duration = duration.max(PEAK_TO_MEAN_SPEED * way / MAX_TOOL_SPEED);
        let path = Path::new(from, (end, goal), duration, left);
        let line = followed.as_ref();
        // A path that continues another one begins with its velocity, beside the line.
        let places = line.and_then(|(_, places)| places.clone());
        let places = places.filter(|_| left.is_none());
        let kind = Kind::Path {
            path: Box::new(path),
            task: line.as_ref().map_or(task, |(task, _)| *task),
            is_followed: line.is_some(),
            places,
            time: 0.0,
            fraction: -1.0,
            still: None,
        };
        let mut motion = Self::new(arm, settings, chain, start, kind)?;
        motion.target = Some((target, task));
        Ok(motion)
    }

    /// At a velocity, from `start`.
    pub(super) fn at(
        arm: &ArmAdapter<N>,
        settings: Settings<N>,
        chain: Chain<N>,
        start: Joints<N>,
        (linear, angular): (Vector3<f64>, Vector3<f64>),
    ) -> Result<Self, DeviceError> {
        let kind = Kind::Velocity {
            linear,
            angular,
            pose: chain.forward(&start),
        };
        Self::new(arm, settings, chain, start, kind)
    }

    /// Returns whether it has reached its target and only holds it.
    pub(super) fn holds(&self) -> bool {
        matches!(self.kind, Kind::Hold)
    }

    /// Advances the motion by `passed` seconds.
    pub(super) fn cycle(
        &mut self,
        arm: &ArmAdapter<N>,
        passed: f64,
    ) -> Result<Progress, MotionFailure> {
        let measured = arm.measured()?;
        let mut progress = Progress::default();
        if !arm.is_engaged(&self.settings.dof)? {
            self.waited += passed;
            return match (self.engaged, self.waited < ENGAGE_TIMEOUT) {
                (true, _) => Err(MotionFailure::ModeChanged),
                (false, true) => Ok(progress),
                (false, false) => Err(MotionFailure::NotFollowing),
            };
        }
        if !self.engaged {
            progress.onset = true;
            self.engaged = true;
            self.waited = 0.0;
        }
        let next = match self.is_behind(&measured, passed)? {
            true => self.commanded,
            false => {
                let wish = self.wish(passed, &mut progress);
                self.limited(&wish, passed)
            }
        };
        arm.send(&self.settings.dof, &next)?;
        self.velocity = (next - self.commanded) / passed;
        self.commanded = next;
        progress.there = self.is_there(&measured);
        if progress.there {
            self.kind = Kind::Hold;
            self.velocity = Joints::zeros();
        }
        Ok(progress)
    }

    /// Returns whether the arm is so far behind that the motion is suspended. An arm at rest that still reports
    /// positions does not follow.
    fn is_behind(&mut self, measured: &Measured<N>, passed: f64) -> Result<bool, MotionFailure> {
        let left = Joints::from_fn(|joint, _| match self.settings.dof[joint] {
            true => measured.joints[joint] - self.commanded[joint],
            false => 0.0,
        });
        if self.swept(&left) <= MAX_LAG {
            self.behind = None;
            return Ok(false);
        }
        let before = *self.behind.get_or_insert(*measured);
        if (before.joints - measured.joints).abs().max() > STANDSTILL_ANGLE {
            self.behind = Some(*measured);
            self.waited = 0.0;
        } else if measured.time > before.time {
            self.behind = Some(Measured {
                time: measured.time,
                ..before
            });
            self.waited += passed;
        }
        match self.waited < ENGAGE_TIMEOUT {
            true => Ok(true),
            false => Err(MotionFailure::NotFollowing),
        }
    }

    /// Returns the desired joint positions.
    fn wish(&mut self, passed: f64, progress: &mut Progress) -> Joints<N> {
        match &mut self.kind {
            Kind::Hold => self.commanded,
            Kind::Path {
                path,
                task,
                is_followed,
                places,
                time,
                fraction,
                ..
            } => {
                *time += passed;
                let covered = path.fraction(*time);
                progress.covered = Some((*fraction, covered));
                *fraction = covered;
                let (pose, joints) = path.at(*time);
                if path.has_ended(*time) {
                    return joints;
                }
                if let Some(places) = places {
                    return between(places, covered);
                }
                let guess = match is_followed {
                    true => self.commanded,
                    false => joints,
                };
                self.settings.step(&self.chain, &pose, *task, &guess).0
            }
            Kind::Velocity {
                linear,
                angular,
                pose,
            } => {
                let translation = pose.translation.vector + *linear * passed;
                let rotation = Rotation3::new(*angular * passed) * pose.rotation;
                let target = Pose::from_parts(Translation3::from(translation), rotation);
                let (joints, gets_there) =
                    self.settings
                        .step(&self.chain, &target, Task::Pose, &self.commanded);
                // At the end of its reach the tool does not pile up a way that it would have to come back.
                *pose = match gets_there {
                    true => target,
                    false => self.chain.forward(&joints),
                };
                joints
            }
        }
    }

    /// The part of the way to `wish` that all joints, and all that they move, may go in this time.
    fn limited(&self, wish: &Joints<N>, passed: f64) -> Joints<N> {
        let step = wish - self.commanded;
        let too_fast = (0..N).map(|joint| match self.max_velocities[joint] * passed {
            most if most > 0.0 => step[joint].abs() / most,
            _ => 0.0,
        });
        let factor = too_fast.fold(1.0, f64::max);
        let step = step / factor;
        // Only of a short step: to a far place a link may go round on a long way and end beside where it was.
        let factor = factor * (self.swept(&step) / (MAX_TOOL_SPEED * passed)).max(1.0);
        if factor > 1.0 {
            self.commanded + (wish - self.commanded) / factor
        } else {
            *wish
        }
    }

    /// Returns the largest displacement of elbow, wrist or tool in a step, m.
    fn swept(&self, step: &Joints<N>) -> f64 {
        swept(&self.chain, &self.commanded, &(self.commanded + step))
    }

    /// Returns whether the target is reached, or the arm is as near as it gets.
    fn is_there(&mut self, measured: &Measured<N>) -> bool {
        let Kind::Path {
            path,
            task,
            time,
            still,
            ..
        } = &mut self.kind
        else {
            return false;
        };
        let (goal, joints) = path.goal();
        if !path.has_ended(*time) || self.commanded != joints {
            return false;
        }
        let at = self.chain.forward(&measured.joints);
        let (place, turn) = distances(&task.error(&goal, &at));
        if place <= self.settings.tolerance && turn <= self.settings.tolerance {
            return true;
        }
        let since = still.get_or_insert(*measured);
        if (since.joints - measured.joints).abs().max() > STANDSTILL_ANGLE {
            *since = *measured;
        }
        measured.time - since.time > SETTLE_TIMEOUT
    }
}

/// Returns the joints at a share of the way through evenly spaced places.
fn between<const N: usize>(places: &[Joints<N>], share: f64) -> Joints<N> {
    let parts = places.len().saturating_sub(1);
    let at = share.clamp(0.0, 1.0) * parts as f64;
    let before = (at as usize).min(parts);
    let after = (before + 1).min(parts);
    places[before].lerp(&places[after], at - before as f64)
}
