//! Implements the interface on the controller.

use std::sync::mpsc::Receiver;

use nalgebra::{Translation3, Vector3};

use super::cartesian_controller::CartesianController;
use super::pose_conversion::{axis_and_angle, finite, from_pose, to_pose, turn, within};
use crate::kinematics::{Chain, Joints, Pose, Task};
use crate::{
    AxisIndex, CartesianControl, CartesianEvent, CartesianInfo, DeviceError, Limits, PoseSolution,
    Priority, StampedPose, Target, TaskPose, TaskVelocity, TweakChange, Tweaks,
};

/// Paths are straight, and no joint exceeds its limit: properties, not settings.
const STRAIGHTNESS: f64 = 1.0;
const CONSTRAINT_TOLERANCE: f64 = 0.0;
/// Of motions, s.
const TRAJECTORY_TIME_RANGE: (f64, f64) = (0.05, 600.0);
const TOLERANCE_RANGE: (f64, f64) = (1e-6, 1.0);
const SOLVER_TOLERANCE_RANGE: (f64, f64) = (1e-9, 1e-2);
const ITERATION_RANGE: (f64, f64) = (1.0, 1000.0);
/// Weights of the rest posture.
const WEIGHT_RANGE: (f64, f64) = (0.0, 1e6);

fn degrees<const N: usize>(joints: &Joints<N>) -> Vec<f64> {
    joints.iter().map(|angle| angle.to_degrees()).collect()
}

/// One number per joint.
fn all<const N: usize>(what: &'static str, numbers: &[f64]) -> Result<Joints<N>, DeviceError> {
    finite(what, numbers)?;
    if numbers.len() != N {
        return Err(DeviceError::WrongCount {
            what,
            expected: N,
            got: numbers.len(),
        });
    }
    Ok(Joints::from_column_slice(numbers))
}

/// Returns the pose and task of a target.
fn asked(target: &Target) -> Result<(Pose, Task), DeviceError> {
    match target {
        Target::Pose(pose) => Ok((to_pose(pose)?, Task::Pose)),
        Target::Position(place) => {
            finite("place", place)?;
            Ok((Pose::from(Translation3::from(*place)), Task::Position))
        }
    }
}

fn reached<const N: usize>(pose: &Pose, joints: &Joints<N>) -> PoseSolution {
    PoseSolution {
        pose: from_pose(pose),
        joints: degrees(joints),
    }
}

impl<const N: usize> CartesianController<N> {
    fn joint(&self, axis: AxisIndex) -> Result<usize, DeviceError> {
        crate::Axes::One(axis).check(N)?;
        Ok(axis.index())
    }

    /// Returns the arm with its present tip, the joint positions and their time.
    fn now(&self) -> Result<(Chain<N>, Joints<N>, f64), DeviceError> {
        let measured = self.shared.arm.measured()?;
        let settings = self.shared.lock().settings.clone();
        let joints = match settings.reference {
            true => self.shared.stand()?,
            false => measured.joints,
        };
        let chain = settings.chain(&self.shared.chain, &joints);
        Ok((chain, joints, measured.time))
    }
}

impl<const N: usize> CartesianControl for CartesianController<N> {
    fn set_tracking(&self, tracking: bool) -> Result<(), DeviceError> {
        self.shared.lock().settings.tracking = tracking;
        Ok(())
    }

    fn tracking(&self) -> Result<bool, DeviceError> {
        Ok(self.shared.lock().settings.tracking)
    }

    fn set_reference_mode(&self, reference: bool) -> Result<(), DeviceError> {
        self.shared.lock().settings.reference = reference;
        Ok(())
    }

    fn reference_mode(&self) -> Result<bool, DeviceError> {
        Ok(self.shared.lock().settings.reference)
    }

    fn set_priority(&self, priority: Priority) -> Result<(), DeviceError> {
        self.shared.change(|settings| settings.priority = priority)
    }

    fn priority(&self) -> Result<Priority, DeviceError> {
        Ok(self.shared.lock().settings.priority)
    }

    fn pose(&self) -> Result<StampedPose, DeviceError> {
        let (chain, joints, time) = self.now()?;
        let pose = from_pose(&chain.forward(&joints));
        Ok(StampedPose { pose, time })
    }

    fn link_pose(&self, axis: AxisIndex) -> Result<StampedPose, DeviceError> {
        let joint = self.joint(axis)?;
        let (chain, joints, time) = self.now()?;
        let pose = from_pose(&chain.frames(&joints)[joint]);
        Ok(StampedPose { pose, time })
    }

    fn go_to(&self, target: Target, time: Option<f64>) -> Result<(), DeviceError> {
        let (pose, task) = asked(&target)?;
        if let Some(time) = time {
            finite("trajectory time", &[time])?;
            if time > 0.0 {
                within("trajectory time", time, TRAJECTORY_TIME_RANGE)?;
            }
        }
        self.shared.go(pose, task, time)
    }

    fn go_to_sync(&self, target: Target, time: Option<f64>) -> Result<(), DeviceError> {
        self.go_to(target, time)
    }

    fn desired(&self) -> Result<PoseSolution, DeviceError> {
        let (pose, joints) = self.shared.desired()?;
        Ok(reached(&pose, &joints))
    }

    fn ask(&self, target: Target, start: Option<&[f64]>) -> Result<PoseSolution, DeviceError> {
        let (pose, task) = asked(&target)?;
        let settings = self.shared.lock().settings.clone();
        let stand = match start {
            Some(degrees) => all::<N>("joints", degrees)?.map(f64::to_radians),
            None => self.shared.stand()?,
        };
        let chain = settings.chain(&self.shared.chain, &stand);
        let max_velocities = self.shared.arm.max_velocities()?;
        let joints = match settings.follow(&chain, &pose, task, &stand, &max_velocities) {
            Ok(way) => way.joints,
            Err(_) => settings.reach(&chain, &pose, task, &stand).joints,
        };
        Ok(reached(&chain.forward(&joints), &joints))
    }

    fn dof(&self) -> Result<Vec<bool>, DeviceError> {
        Ok(self.shared.lock().settings.dof.to_vec())
    }

    fn set_dof(&self, dof: &[Option<bool>]) -> Result<Vec<bool>, DeviceError> {
        if dof.len() > N {
            return Err(DeviceError::WrongCount {
                what: "degrees of freedom",
                expected: N,
                got: dof.len(),
            });
        }
        self.shared.change(|settings| {
            for (now, wish) in settings.dof.iter_mut().zip(dof) {
                *now = wish.unwrap_or(*now);
            }
        })?;
        self.dof()
    }

    fn rest_positions(&self) -> Result<Vec<f64>, DeviceError> {
        Ok(degrees(&self.shared.lock().settings.rest))
    }

    fn set_rest_positions(&self, positions: &[f64]) -> Result<Vec<f64>, DeviceError> {
        let rest = all::<N>("rest positions", positions)?.map(f64::to_radians);
        self.shared.change(|settings| {
            settings.rest = Joints::from_fn(|joint, _| settings.limits[joint].clamp(rest[joint]));
        })?;
        self.rest_positions()
    }

    fn rest_weights(&self) -> Result<Vec<f64>, DeviceError> {
        Ok(self.shared.lock().settings.weights.as_slice().to_vec())
    }

    fn set_rest_weights(&self, weights: &[f64]) -> Result<Vec<f64>, DeviceError> {
        let weights: Joints<N> = all("rest weights", weights)?;
        for &weight in weights.iter() {
            within("rest weight", weight, WEIGHT_RANGE)?;
        }
        self.shared.change(|settings| settings.weights = weights)?;
        self.rest_weights()
    }

    fn joint_limits(&self, axis: AxisIndex) -> Result<Limits, DeviceError> {
        let joint = self.joint(axis)?;
        let limits = self.shared.lock().settings.limits[joint];
        Ok(Limits::new(
            limits.min.to_degrees(),
            limits.max.to_degrees(),
        ))
    }

    fn set_joint_limits(&self, axis: AxisIndex, limits: Limits) -> Result<(), DeviceError> {
        let joint = self.joint(axis)?;
        let widest = self.shared.chain.limits()[joint];
        // A margin, so that a reported value may be sent back.
        let hair = 1e-9;
        let range = (
            widest.min.to_degrees() - hair,
            widest.max.to_degrees() + hair,
        );
        within("lower limit", limits.min, range)?;
        within("upper limit", limits.max, (limits.min, range.1))?;
        let (min, max) = (limits.min.to_radians(), limits.max.to_radians());
        let limits = Limits::new(widest.clamp(min), widest.clamp(max));
        self.shared.change(|settings| {
            settings.limits[joint] = limits;
            settings.rest[joint] = limits.clamp(settings.rest[joint]);
        })
    }

    fn trajectory_time(&self) -> Result<f64, DeviceError> {
        Ok(self.shared.lock().settings.time)
    }

    fn set_trajectory_time(&self, time: f64) -> Result<(), DeviceError> {
        self.shared.lock().settings.time = within("trajectory time", time, TRAJECTORY_TIME_RANGE)?;
        Ok(())
    }

    fn tolerance(&self) -> Result<f64, DeviceError> {
        Ok(self.shared.lock().settings.tolerance)
    }

    fn set_tolerance(&self, tolerance: f64) -> Result<(), DeviceError> {
        self.shared.lock().settings.tolerance = within("tolerance", tolerance, TOLERANCE_RANGE)?;
        Ok(())
    }

    fn joint_velocities(&self) -> Result<Vec<f64>, DeviceError> {
        let state = self.shared.lock();
        let moving = state.motion.as_ref().map(|motion| motion.velocity);
        Ok(degrees(&moving.unwrap_or_else(Joints::zeros)))
    }

    fn task_velocity(&self) -> Result<TaskVelocity, DeviceError> {
        let state = self.shared.lock();
        let Some(motion) = &state.motion else {
            return Ok(TaskVelocity {
                axis: [0.0, 0.0, 1.0],
                ..TaskVelocity::default()
            });
        };
        let (_, jacobian) = motion.chain.forward_and_jacobian(&motion.commanded);
        let velocity = jacobian * motion.velocity;
        let (axis, speed) = axis_and_angle(velocity.fixed_rows::<3>(3).into_owned());
        Ok(TaskVelocity {
            linear: velocity.fixed_rows::<3>(0).into_owned().into(),
            axis,
            speed,
        })
    }

    fn set_task_velocity(&self, velocity: TaskVelocity) -> Result<(), DeviceError> {
        finite("velocity", &velocity.linear)?;
        let angular = turn(velocity.axis, velocity.speed)?;
        self.shared.move_at(Vector3::from(velocity.linear), angular)
    }

    fn attach_tip(&self, tip: TaskPose) -> Result<(), DeviceError> {
        let tip = to_pose(&tip)?;
        self.shared.change(|settings| settings.tip = tip)
    }

    fn tip(&self) -> Result<TaskPose, DeviceError> {
        Ok(from_pose(&self.shared.lock().settings.tip))
    }

    fn motion_done(&self) -> Result<bool, DeviceError> {
        Ok(self.shared.lock().is_done())
    }

    fn stop(&self) -> Result<(), DeviceError> {
        self.shared.stop()
    }

    fn store_context(&self) -> Result<i32, DeviceError> {
        self.shared.lock().store()
    }

    fn restore_context(&self, id: i32) -> Result<(), DeviceError> {
        let stored = self.shared.lock().stored(id)?;
        self.shared.change(|settings| *settings = stored)
    }

    fn delete_contexts(&self, ids: &[i32]) -> Result<(), DeviceError> {
        self.shared.lock().forget(ids)
    }

    fn cartesian_info(&self) -> Result<CartesianInfo, DeviceError> {
        Ok(self.shared.info.clone())
    }

    fn tweaks(&self) -> Result<Tweaks, DeviceError> {
        let state = self.shared.lock();
        Ok(Tweaks {
            straightness: STRAIGHTNESS,
            tolerance: state.settings.solver_tolerance,
            constraint_tolerance: CONSTRAINT_TOLERANCE,
            iterations: state.settings.iterations,
        })
    }

    fn tweak(&self, change: TweakChange) -> Result<(), DeviceError> {
        let fact = |what, asked: Option<f64>, fact: f64| match asked {
            Some(asked) => within(what, asked, (fact, fact)).map(drop),
            None => Ok(()),
        };
        fact("straightness", change.straightness, STRAIGHTNESS)?;
        fact(
            "tolerance of constraints",
            change.constraint_tolerance,
            CONSTRAINT_TOLERANCE,
        )?;
        if let Some(tolerance) = change.tolerance {
            within("tolerance of the solver", tolerance, SOLVER_TOLERANCE_RANGE)?;
        }
        if let Some(iterations) = change.iterations {
            within("iterations", iterations as f64, ITERATION_RANGE)?;
        }
        let mut state = self.shared.lock();
        let settings = &mut state.settings;
        settings.solver_tolerance = change.tolerance.unwrap_or(settings.solver_tolerance);
        settings.iterations = change.iterations.unwrap_or(settings.iterations);
        Ok(())
    }

    fn register_checkpoint(&self, checkpoint: f64) -> Result<(), DeviceError> {
        within("checkpoint", checkpoint, (0.0, 1.0))?;
        let mut state = self.shared.lock();
        if !state.checkpoints.contains(&checkpoint) {
            within(
                "number of checkpoints",
                state.checkpoints.len() as f64,
                (0.0, 999.0),
            )?;
            state.checkpoints.push(checkpoint);
            state.checkpoints.sort_by(f64::total_cmp);
        }
        Ok(())
    }

    fn unregister_checkpoint(&self, checkpoint: f64) -> Result<(), DeviceError> {
        let mut state = self.shared.lock();
        let before = state.checkpoints.len();
        state.checkpoints.retain(|&known| known != checkpoint);
        if state.checkpoints.len() == before {
            return Err(DeviceError::Unsuitable {
                what: "checkpoint",
                asked: checkpoint.to_string(),
                expected: "one that is registered".to_owned(),
            });
        }
        Ok(())
    }

    fn checkpoints(&self) -> Result<Vec<f64>, DeviceError> {
        Ok(self.shared.lock().checkpoints.clone())
    }

    fn events(&self) -> Result<Receiver<CartesianEvent>, DeviceError> {
        Ok(self.shared.lock().listen())
    }
}
