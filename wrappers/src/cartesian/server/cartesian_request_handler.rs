//! Executes requests on a controller.

use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};

use yarp_devices::{CartesianControl, Device, DeviceError};
use yarp_wire::Bottle;

use crate::cartesian::CartesianVersion;
use crate::cartesian::messages::{Query, Request, Setting, acknowledged, cartesian_reply, refused};

/// Answers requests with a controller.
pub(super) struct RequestHandler {
    device: Arc<dyn Device>,
    name: String,
    version: CartesianVersion,
    /// The number of the last published state, for the stamp of a pose in a reply.
    pub(super) count: AtomicI32,
}

impl RequestHandler {
    pub(super) fn new(device: Arc<dyn Device>, name: &str, version: CartesianVersion) -> Self {
        Self {
            device,
            name: name.to_owned(),
            version,
            count: AtomicI32::new(0),
        }
    }

    pub(super) fn controller(&self) -> Result<&dyn CartesianControl, DeviceError> {
        let missing = || DeviceError::NotSupported {
            what: "moving a tool".to_owned(),
        };
        self.device.cartesian_control().ok_or_else(missing)
    }

    /// Answers a request.
    pub(super) fn answer(&self, message: &Bottle, from: &str) -> Bottle {
        let request = match Request::parse(message) {
            Ok(request) => request,
            Err(error) => {
                tracing::debug!("{}: {message} from {from}: {error}", self.name);
                return refused();
            }
        };
        self.carry_out(&request).unwrap_or_else(|error| {
            tracing::warn!("{}: {message} from {from} refused: {error}", self.name);
            refused()
        })
    }

    /// Executes messages of the command port; no reply is sent.
    pub(super) fn obey(&self, message: &Bottle, from: &str) {
        let done = match Request::parse(message) {
            Ok(Request::Go(target, time)) => self
                .controller()
                .and_then(|arm| arm.go_to(target, Some(time))),
            Ok(Request::Move(velocity)) => self
                .controller()
                .and_then(|arm| arm.set_task_velocity(velocity)),
            _ => {
                tracing::debug!("{}: {message} from {from} is not a command", self.name);
                return;
            }
        };
        if let Err(error) = done {
            tracing::warn!("{}: {message} from {from} refused: {error}", self.name);
        }
    }

    fn carry_out(&self, request: &Request) -> Result<Bottle, DeviceError> {
        let arm = self.controller()?;
        let done = match request {
            Request::Stop => arm.stop(),
            Request::Go(target, time) => arm.go_to_sync(*target, Some(*time)),
            // Not on this port: a refusal could not be distinguished from the end of a motion.
            Request::Move(_) => return Ok(refused()),
            Request::Ask(target, start) => {
                return Ok(cartesian_reply::reach(&arm.ask(*target, start.as_deref())?));
            }
            Request::Store => return Ok(cartesian_reply::id(arm.store_context()?)),
            // As stock: no answer is worth more than an empty one.
            Request::Restore(None) | Request::Delete(None) => return Ok(Bottle::new()),
            Request::Restore(Some(id)) => arm.restore_context(*id),
            Request::Delete(Some(ids)) => arm.delete_contexts(ids),
            Request::Get(question) => return self.tell(arm, *question),
            Request::Set(setting) => return set(arm, setting),
            Request::Register(checkpoint) => arm.register_checkpoint(*checkpoint),
            Request::Unregister(checkpoint) => arm.unregister_checkpoint(*checkpoint),
            Request::Checkpoints => return Ok(cartesian_reply::list(&arm.checkpoints()?)),
        };
        done.map(|()| acknowledged())
    }

    fn tell(&self, arm: &dyn CartesianControl, question: Query) -> Result<Bottle, DeviceError> {
        Ok(match question {
            Query::Tracking => cartesian_reply::tracking(arm.tracking()?),
            Query::Reference => cartesian_reply::yes_or_no(arm.reference_mode()?),
            Query::Priority => cartesian_reply::priority(arm.priority()?),
            Query::Time => cartesian_reply::number(arm.trajectory_time()?),
            Query::Tolerance => cartesian_reply::number(arm.tolerance()?),
            Query::Done => cartesian_reply::yes_or_no(arm.motion_done()?),
            // Here the solver is part of the controller.
            Query::IsOn => cartesian_reply::yes_or_no(true),
            Query::Limits(axis) => cartesian_reply::limits(arm.joint_limits(axis)?),
            Query::Dof => cartesian_reply::dof(&arm.dof()?),
            Query::Rest => cartesian_reply::list(&arm.rest_positions()?),
            Query::Weights => cartesian_reply::list(&arm.rest_weights()?),
            Query::Desired => cartesian_reply::reach(&arm.desired()?),
            Query::JointVelocities => cartesian_reply::list(&arm.joint_velocities()?),
            Query::TaskVelocity => cartesian_reply::velocity(&arm.task_velocity()?),
            Query::Pose(axis) => {
                cartesian_reply::stamped(&arm.link_pose(axis)?, self.count.load(Ordering::Relaxed))
            }
            Query::Tip => cartesian_reply::pose(&arm.tip()?),
            Query::Info => cartesian_reply::info(&arm.cartesian_info()?, self.version),
            Query::Tweaks => cartesian_reply::tweaks(&arm.tweaks()?),
        })
    }
}

fn set(arm: &dyn CartesianControl, setting: &Setting) -> Result<Bottle, DeviceError> {
    let done = match setting {
        Setting::Tracking(on) => arm.set_tracking(*on),
        Setting::Reference(on) => arm.set_reference_mode(*on),
        Setting::Priority(priority) => arm.set_priority(*priority),
        Setting::Time(time) => arm.set_trajectory_time(*time),
        Setting::Tolerance(tolerance) => arm.set_tolerance(*tolerance),
        Setting::Limits(axis, limits) => arm.set_joint_limits(*axis, *limits),
        Setting::Dof(dof) => return Ok(cartesian_reply::dof(&arm.set_dof(dof)?)),
        Setting::Rest(rest) => return Ok(cartesian_reply::list(&arm.set_rest_positions(rest)?)),
        Setting::Weights(weights) => {
            return Ok(cartesian_reply::list(&arm.set_rest_weights(weights)?));
        }
        Setting::Tip(tip) => arm.attach_tip(*tip),
        Setting::Tweaks(change) => arm.tweak(*change),
    };
    done.map(|()| acknowledged())
}
