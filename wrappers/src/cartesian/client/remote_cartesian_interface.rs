//! Implements the interface with messages.

use std::sync::mpsc::Receiver;
use std::thread;
use std::time::{Duration, Instant};

use yarp_devices::{
    AxisIndex, CartesianControl, CartesianEvent, CartesianInfo, DeviceError, Limits, PoseSolution,
    Priority, StampedPose, Target, TaskPose, TaskVelocity, TweakChange, Tweaks,
};

use super::RemoteCartesianControl;
use crate::cartesian::messages::cartesian_reply::Values;
use crate::cartesian::messages::{Query, Request, Setting};
use crate::device_ports::lock;

/// Interval between checks for a pose with the new tip, and their maximum duration.
const POLL_INTERVAL: Duration = Duration::from_millis(5);
const MAX_POLL_TIME: Duration = Duration::from_secs(1);

impl RemoteCartesianControl {
    /// Sends a request, and waits for the reply. Not generic, so that its task is compiled once.
    fn reply_to(&self, request: Request) -> (Request, Result<Values, DeviceError>) {
        self.link.run(|link| async move {
            let values = link.ask(&request).await;
            (request, values)
        })
    }

    fn ask<T>(
        &self,
        request: Request,
        read: impl Fn(&Values) -> Option<T>,
    ) -> Result<T, DeviceError> {
        let (request, values) = self.reply_to(request);
        self.link.read(&request, &values?, read)
    }

    fn get<T>(&self, question: Query, read: fn(&Values) -> Option<T>) -> Result<T, DeviceError> {
        self.ask(Request::Get(question), read)
    }

    fn done(&self, request: Request) -> Result<(), DeviceError> {
        self.ask(request, |_| Some(()))
    }

    fn set(&self, setting: Setting) -> Result<(), DeviceError> {
        self.done(Request::Set(setting))
    }

    fn order(&self, request: Request) -> Result<(), DeviceError> {
        self.link
            .run(|link| async move { link.order(&request).await })
    }
}

impl CartesianControl for RemoteCartesianControl {
    fn set_tracking(&self, tracking: bool) -> Result<(), DeviceError> {
        self.set(Setting::Tracking(tracking))
    }

    fn tracking(&self) -> Result<bool, DeviceError> {
        self.get(Query::Tracking, Values::tracking)
    }

    fn set_reference_mode(&self, reference: bool) -> Result<(), DeviceError> {
        self.set(Setting::Reference(reference))
    }

    fn reference_mode(&self) -> Result<bool, DeviceError> {
        self.get(Query::Reference, Values::yes_or_no)
    }

    fn set_priority(&self, priority: Priority) -> Result<(), DeviceError> {
        self.set(Setting::Priority(priority))
    }

    fn priority(&self) -> Result<Priority, DeviceError> {
        self.get(Query::Priority, Values::priority)
    }

    fn pose(&self) -> Result<StampedPose, DeviceError> {
        self.link.latest.pose()
    }

    fn link_pose(&self, axis: AxisIndex) -> Result<StampedPose, DeviceError> {
        self.get(Query::Pose(axis), Values::stamped)
    }

    fn go_to(&self, target: Target, time: Option<f64>) -> Result<(), DeviceError> {
        self.order(Request::Go(target, time.unwrap_or(0.0)))
    }

    fn go_to_sync(&self, target: Target, time: Option<f64>) -> Result<(), DeviceError> {
        self.done(Request::Go(target, time.unwrap_or(0.0)))
    }

    fn desired(&self) -> Result<PoseSolution, DeviceError> {
        self.get(Query::Desired, Values::reach)
    }

    fn ask(&self, target: Target, start: Option<&[f64]>) -> Result<PoseSolution, DeviceError> {
        let request = Request::Ask(target, start.map(<[f64]>::to_vec));
        self.ask(request, Values::reach)
    }

    fn dof(&self) -> Result<Vec<bool>, DeviceError> {
        self.get(Query::Dof, Values::dof)
    }

    fn set_dof(&self, dof: &[Option<bool>]) -> Result<Vec<bool>, DeviceError> {
        self.ask(Request::Set(Setting::Dof(dof.to_vec())), Values::dof)
    }

    fn rest_positions(&self) -> Result<Vec<f64>, DeviceError> {
        self.get(Query::Rest, Values::list)
    }

    fn set_rest_positions(&self, positions: &[f64]) -> Result<Vec<f64>, DeviceError> {
        self.ask(
            Request::Set(Setting::Rest(positions.to_vec())),
            Values::list,
        )
    }

    fn rest_weights(&self) -> Result<Vec<f64>, DeviceError> {
        self.get(Query::Weights, Values::list)
    }

    fn set_rest_weights(&self, weights: &[f64]) -> Result<Vec<f64>, DeviceError> {
        self.ask(
            Request::Set(Setting::Weights(weights.to_vec())),
            Values::list,
        )
    }

    fn joint_limits(&self, axis: AxisIndex) -> Result<Limits, DeviceError> {
        self.get(Query::Limits(axis), Values::limits)
    }

    fn set_joint_limits(&self, axis: AxisIndex, limits: Limits) -> Result<(), DeviceError> {
        self.set(Setting::Limits(axis, limits))
    }

    fn trajectory_time(&self) -> Result<f64, DeviceError> {
        self.get(Query::Time, Values::number)
    }

    fn set_trajectory_time(&self, time: f64) -> Result<(), DeviceError> {
        self.set(Setting::Time(time))
    }

    fn tolerance(&self) -> Result<f64, DeviceError> {
        self.get(Query::Tolerance, Values::number)
    }

    fn set_tolerance(&self, tolerance: f64) -> Result<(), DeviceError> {
        self.set(Setting::Tolerance(tolerance))
    }

    fn joint_velocities(&self) -> Result<Vec<f64>, DeviceError> {
        self.get(Query::JointVelocities, Values::list)
    }

    fn task_velocity(&self) -> Result<TaskVelocity, DeviceError> {
        self.get(Query::TaskVelocity, Values::velocity)
    }

    fn set_task_velocity(&self, velocity: TaskVelocity) -> Result<(), DeviceError> {
        self.order(Request::Move(velocity))
    }

    /// Returns when a pose has come that was sent after the tip was put on, or a second later.
    fn attach_tip(&self, tip: TaskPose) -> Result<(), DeviceError> {
        self.set(Setting::Tip(tip))?;
        let put_on = Instant::now();
        let latest = &self.link.latest;
        while put_on.elapsed() < MAX_POLL_TIME
            && latest.arrived().is_none_or(|arrived| arrived <= put_on)
        {
            thread::sleep(POLL_INTERVAL);
        }
        Ok(())
    }

    fn tip(&self) -> Result<TaskPose, DeviceError> {
        self.get(Query::Tip, Values::pose)
    }

    fn motion_done(&self) -> Result<bool, DeviceError> {
        self.get(Query::Done, Values::yes_or_no)
    }

    fn stop(&self) -> Result<(), DeviceError> {
        self.done(Request::Stop)
    }

    fn store_context(&self) -> Result<i32, DeviceError> {
        let id = self.ask(Request::Store, Values::id)?;
        lock(&self.contexts).insert(id);
        Ok(id)
    }

    fn restore_context(&self, id: i32) -> Result<(), DeviceError> {
        self.done(Request::Restore(Some(id)))
    }

    fn delete_contexts(&self, ids: &[i32]) -> Result<(), DeviceError> {
        self.done(Request::Delete(Some(ids.to_vec())))?;
        lock(&self.contexts).retain(|id| !ids.contains(id));
        Ok(())
    }

    fn cartesian_info(&self) -> Result<CartesianInfo, DeviceError> {
        self.get(Query::Info, Values::info)
    }

    fn tweaks(&self) -> Result<Tweaks, DeviceError> {
        self.get(Query::Tweaks, Values::tweaks)
    }

    fn tweak(&self, change: TweakChange) -> Result<(), DeviceError> {
        self.set(Setting::Tweaks(change))
    }

    fn register_checkpoint(&self, checkpoint: f64) -> Result<(), DeviceError> {
        self.done(Request::Register(checkpoint))?;
        lock(&self.checkpoints).push(checkpoint);
        Ok(())
    }

    fn unregister_checkpoint(&self, checkpoint: f64) -> Result<(), DeviceError> {
        self.done(Request::Unregister(checkpoint))?;
        lock(&self.checkpoints).retain(|&known| known != checkpoint);
        Ok(())
    }

    fn checkpoints(&self) -> Result<Vec<f64>, DeviceError> {
        self.ask(Request::Checkpoints, Values::list)
    }

    fn events(&self) -> Result<Receiver<CartesianEvent>, DeviceError> {
        Ok(self.link.latest.events.listen())
    }
}
