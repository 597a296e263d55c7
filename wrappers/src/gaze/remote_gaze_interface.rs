//! Implements the interface with messages.

use std::sync::mpsc::Receiver;

use yarp_devices::{
    DeviceError, Eye, FixationPoint, GazeAngles, GazeControl, GazeEvent, GazeFrame, GazeInfo,
    GazeOptions, GazeReference, GazeTarget, Limits, NeckJoint, StampedGazeAngles, StampedPose,
};
use yarp_wire::Bottle;

use super::RemoteGazeControl;
use super::messages::GazeValues;
use super::messages::gaze_request::{self as request, get, set_flag, set_number, set_options};
use crate::device_ports::lock;
use crate::wait_first_value;

/// Place of the vergence among the joints of the head; those of the neck are the first.
const VERGENCE: usize = 5;

impl RemoteGazeControl {
    /// Sends a request, and waits for the reply. Not generic, so that its task is compiled once.
    fn reply_to(&self, request: Bottle) -> (Bottle, Result<GazeValues, DeviceError>) {
        self.link.run(|link| async move {
            let values = link.ask(&request).await;
            (request, values)
        })
    }

    fn ask<T>(
        &self,
        request: Bottle,
        read: impl Fn(&GazeValues) -> Option<T>,
    ) -> Result<T, DeviceError> {
        let (request, values) = self.reply_to(request);
        self.link.read(&request, &values?, read)
    }

    fn done(&self, request: Bottle) -> Result<(), DeviceError> {
        self.reply_to(request).1.map(drop)
    }

    /// Returns the position of a joint of the head, degrees; waits for the first message of the stream.
    fn head_joint(&self, joint: usize) -> Result<f64, DeviceError> {
        let timeout = self.link.ports.options().rpc_timeout;
        let joints = &self.link.latest.joints;
        wait_first_value(timeout, || joints.read(|joints| joints[joint]))
    }

    /// Returns an error unless this client stored the context, or it is there from the beginning.
    fn check_context(&self, id: i32) -> Result<(), DeviceError> {
        let contexts = lock(&self.contexts);
        match id == 0 || contexts.contains(&id) {
            true => Ok(()),
            false => Err(DeviceError::Unsuitable {
                what: "context",
                asked: id.to_string(),
                expected: format!("0, or one that this client stored: {contexts:?}"),
            }),
        }
    }
}

impl GazeControl for RemoteGazeControl {
    fn set_tracking(&self, tracking: bool) -> Result<(), DeviceError> {
        self.done(set_flag("track", tracking))
    }

    fn tracking(&self) -> Result<bool, DeviceError> {
        self.ask(get("track"), GazeValues::flag)
    }

    fn set_stabilization(&self, stabilization: bool) -> Result<(), DeviceError> {
        self.done(set_flag("stab", stabilization))
    }

    fn stabilization(&self) -> Result<bool, DeviceError> {
        self.ask(get("stab"), GazeValues::flag)
    }

    fn fixation_point(&self) -> Result<FixationPoint, DeviceError> {
        self.link.latest.point.read(|point| *point)
    }

    fn gaze_angles(&self) -> Result<StampedGazeAngles, DeviceError> {
        self.link.latest.angles.read(|angles| *angles)
    }

    fn look_at(&self, target: GazeTarget) -> Result<(), DeviceError> {
        self.link
            .run(|link| async move { link.send_target(&target).await })
    }

    fn look_at_sync(&self, target: GazeTarget) -> Result<(), DeviceError> {
        self.done(request::look(&target))
    }

    fn neck_trajectory_time(&self) -> Result<f64, DeviceError> {
        self.ask(get("Tneck"), GazeValues::number)
    }

    fn set_neck_trajectory_time(&self, time: f64) -> Result<(), DeviceError> {
        self.done(set_number("Tneck", time))
    }

    fn eyes_trajectory_time(&self) -> Result<f64, DeviceError> {
        self.ask(get("Teyes"), GazeValues::number)
    }

    fn set_eyes_trajectory_time(&self, time: f64) -> Result<(), DeviceError> {
        self.done(set_number("Teyes", time))
    }

    fn vor_gain(&self) -> Result<f64, DeviceError> {
        self.ask(get("vor"), GazeValues::number)
    }

    fn set_vor_gain(&self, gain: f64) -> Result<(), DeviceError> {
        self.done(set_number("vor", gain))
    }

    fn ocr_gain(&self) -> Result<f64, DeviceError> {
        self.ask(get("ocr"), GazeValues::number)
    }

    fn set_ocr_gain(&self, gain: f64) -> Result<(), DeviceError> {
        self.done(set_number("ocr", gain))
    }

    fn saccades(&self) -> Result<bool, DeviceError> {
        self.ask(get("sacc"), GazeValues::flag)
    }

    fn set_saccades(&self, saccades: bool) -> Result<(), DeviceError> {
        self.done(set_flag("sacc", saccades))
    }

    fn saccade_inhibition_period(&self) -> Result<f64, DeviceError> {
        self.ask(get("sinh"), GazeValues::number)
    }

    fn set_saccade_inhibition_period(&self, period: f64) -> Result<(), DeviceError> {
        self.done(set_number("sinh", period))
    }

    fn saccade_activation_angle(&self) -> Result<f64, DeviceError> {
        self.ask(get("sact"), GazeValues::number)
    }

    fn set_saccade_activation_angle(&self, angle: f64) -> Result<(), DeviceError> {
        self.done(set_number("sact", angle))
    }

    fn neck_tolerance(&self) -> Result<f64, DeviceError> {
        self.ask(get("ntol"), GazeValues::number)
    }

    fn set_neck_tolerance(&self, angle: f64) -> Result<(), DeviceError> {
        self.done(set_number("ntol", angle))
    }

    fn gaze_pose(&self, frame: GazeFrame) -> Result<StampedPose, DeviceError> {
        self.ask(request::get_pose(frame), GazeValues::pose)
    }

    fn pixel(&self, eye: Eye, point: [f64; 3]) -> Result<[f64; 2], DeviceError> {
        self.ask(request::get_pixel(eye, &point), GazeValues::array)
    }

    fn point_at_depth(
        &self,
        eye: Eye,
        pixel: [f64; 2],
        depth: f64,
    ) -> Result<[f64; 3], DeviceError> {
        let request = request::get_point_at_depth(eye, &pixel, depth);
        self.ask(request, GazeValues::array)
    }

    fn point_on_plane(
        &self,
        eye: Eye,
        pixel: [f64; 2],
        plane: [f64; 4],
    ) -> Result<[f64; 3], DeviceError> {
        let request = request::get_point_on_plane(eye, &pixel, &plane);
        self.ask(request, GazeValues::array)
    }

    fn point_from_angles(
        &self,
        reference: GazeReference,
        angles: GazeAngles,
    ) -> Result<[f64; 3], DeviceError> {
        let request = request::get_point_from_angles(reference, angles);
        self.ask(request, GazeValues::array)
    }

    fn angles_from_point(&self, point: [f64; 3]) -> Result<GazeAngles, DeviceError> {
        self.ask(request::get_angles(&point), GazeValues::angles)
    }

    fn triangulate(&self, left: [f64; 2], right: [f64; 2]) -> Result<[f64; 3], DeviceError> {
        self.ask(request::get_triangulated(&left, &right), GazeValues::array)
    }

    fn desired_joints(&self) -> Result<Vec<f64>, DeviceError> {
        self.ask(get("des"), GazeValues::list)
    }

    fn joint_velocities(&self) -> Result<Vec<f64>, DeviceError> {
        self.ask(get("vel"), GazeValues::list)
    }

    fn stereo_options(&self) -> Result<GazeOptions, DeviceError> {
        self.ask(get("pid"), GazeValues::options)
    }

    fn set_stereo_options(&self, options: &GazeOptions) -> Result<(), DeviceError> {
        self.done(set_options("pid", options))
    }

    fn bind_neck(&self, joint: NeckJoint, range: Limits) -> Result<(), DeviceError> {
        self.done(request::bind_neck(joint, range))
    }

    fn block_neck(&self, joint: NeckJoint, angle: Option<f64>) -> Result<(), DeviceError> {
        let place = match joint {
            NeckJoint::Pitch => 0,
            NeckJoint::Roll => 1,
            NeckJoint::Yaw => 2,
        };
        let angle = angle.map_or_else(|| self.head_joint(place), Ok)?;
        self.bind_neck(joint, Limits::new(angle, angle))
    }

    fn neck_range(&self, joint: NeckJoint) -> Result<Limits, DeviceError> {
        self.ask(get(request::neck_word(joint)), GazeValues::range)
    }

    fn clear_neck(&self, joint: NeckJoint) -> Result<(), DeviceError> {
        self.done(request::clear(request::neck_word(joint)))
    }

    fn block_eyes(&self, vergence: Option<f64>) -> Result<(), DeviceError> {
        let vergence = vergence.map_or_else(|| self.head_joint(VERGENCE), Ok)?;
        self.done(request::bind_eyes(vergence))
    }

    fn blocked_vergence(&self) -> Result<Option<f64>, DeviceError> {
        self.ask(get("eyes"), GazeValues::blocked_vergence)
    }

    fn clear_eyes(&self) -> Result<(), DeviceError> {
        self.done(request::clear("eyes"))
    }

    fn motion_done(&self) -> Result<bool, DeviceError> {
        self.ask(get("done"), GazeValues::flag)
    }

    fn saccade_done(&self) -> Result<bool, DeviceError> {
        self.ask(get("sdon"), GazeValues::flag)
    }

    fn stop(&self) -> Result<(), DeviceError> {
        self.done(Bottle::of("stop"))
    }

    fn store_context(&self) -> Result<i32, DeviceError> {
        let id = self.ask(Bottle::of("stor"), GazeValues::id)?;
        lock(&self.contexts).insert(id);
        Ok(id)
    }

    fn restore_context(&self, id: i32) -> Result<(), DeviceError> {
        self.check_context(id)?;
        self.done(request::restore(id))
    }

    fn delete_context(&self, id: i32) -> Result<(), DeviceError> {
        self.check_context(id)?;
        self.done(request::delete([id]))?;
        lock(&self.contexts).remove(&id);
        Ok(())
    }

    fn gaze_info(&self) -> Result<GazeInfo, DeviceError> {
        self.ask(get("info"), GazeValues::info)
    }

    fn tweaks(&self) -> Result<GazeOptions, DeviceError> {
        self.ask(get("tweak"), GazeValues::options)
    }

    fn tweak(&self, change: &GazeOptions) -> Result<(), DeviceError> {
        self.done(set_options("tweak", change))
    }

    fn register_checkpoint(&self, checkpoint: f64) -> Result<(), DeviceError> {
        self.done(request::register(checkpoint))?;
        let mut checkpoints = lock(&self.checkpoints);
        if !checkpoints.contains(&checkpoint) {
            checkpoints.push(checkpoint);
        }
        Ok(())
    }

    fn unregister_checkpoint(&self, checkpoint: f64) -> Result<(), DeviceError> {
        self.done(request::unregister(checkpoint))?;
        lock(&self.checkpoints).retain(|&known| known != checkpoint);
        Ok(())
    }

    fn checkpoints(&self) -> Result<Vec<f64>, DeviceError> {
        self.ask(Bottle::of("list").with("ongoing"), GazeValues::list)
    }

    fn events(&self) -> Result<Receiver<GazeEvent>, DeviceError> {
        Ok(self.link.latest.events.listen())
    }
}
