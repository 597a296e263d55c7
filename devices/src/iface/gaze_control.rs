//! Control of the gaze of a head with two eyes.

use std::sync::mpsc::Receiver;
use std::thread;
use std::time::{Duration, Instant};

use crate::{DeviceError, Limits, StampedPose, VariableValue};

/// Points the eyes of a head at places, by turning neck and eyes (stock: `IGazeControl`).
///
/// * Points are in metres, in the root frame of the robot. Angles are in degrees; only the orientation in
///   [`gaze_pose`](Self::gaze_pose) is an axis and an angle in **radians**, as in stock. Pixels are a column and a row of
///   an image, from its upper left corner.
/// * A head has six joints: neck pitch, roll and yaw, then tilt, version and vergence of the eyes.
///
/// Errors, of every call: [`DeviceError::Unsuitable`] for numbers that are not finite, and nothing changes then; for a
/// device behind a network [`DeviceError::Refused`] and [`DeviceError::Remote`].
pub trait GazeControl: Send + Sync {
    /// Holds the gaze on the target after it was reached, instead of releasing the head (`setTrackingMode`).
    fn set_tracking(&self, tracking: bool) -> Result<(), DeviceError>;

    /// Returns whether the gaze is held on the target (`getTrackingMode`).
    fn tracking(&self) -> Result<bool, DeviceError>;

    /// Stabilizes the gaze with an inertial sensor (`setStabilizationMode`). Refused without such a sensor.
    fn set_stabilization(&self, stabilization: bool) -> Result<(), DeviceError>;

    /// Returns whether the gaze is stabilized (`getStabilizationMode`).
    fn stabilization(&self) -> Result<bool, DeviceError>;

    /// Returns the point at which both eyes look (`getFixationPoint`).
    ///
    /// Errors: for a device behind a network also [`DeviceError::NoDataYet`] and [`DeviceError::Stale`].
    fn fixation_point(&self) -> Result<FixationPoint, DeviceError>;

    /// Returns the direction of the gaze, absolute (`getAngles`).
    ///
    /// Errors: as [`fixation_point`](Self::fixation_point).
    fn gaze_angles(&self) -> Result<StampedGazeAngles, DeviceError>;

    /// Turns the gaze to a target, and returns at once (`lookAtFixationPoint`, `lookAtAbsAngles`, `lookAtRelAngles`,
    /// `lookAtMonoPixel`, `lookAtMonoPixelWithVergence`, `lookAtStereoPixels`).
    ///
    /// A device behind a network does not get a refusal; [`look_at_sync`](Self::look_at_sync) does.
    fn look_at(&self, target: GazeTarget) -> Result<(), DeviceError>;

    /// Turns the gaze like [`look_at`](Self::look_at), but returns when the motion has begun
    /// (`lookAtFixationPointSync` and so on).
    ///
    /// Stock's controller does not answer while it is suspended, and refuses pixels of a camera that it does not know.
    fn look_at_sync(&self, target: GazeTarget) -> Result<(), DeviceError>;

    /// Returns the duration of motions of the neck, s (`getNeckTrajTime`).
    fn neck_trajectory_time(&self) -> Result<f64, DeviceError>;

    /// Sets the duration of motions of the neck, s (`setNeckTrajTime`). Stock's controller raises it to 0.2 s more than
    /// that of the eyes.
    fn set_neck_trajectory_time(&self, time: f64) -> Result<(), DeviceError>;

    /// Returns the duration of motions of the eyes, s (`getEyesTrajTime`).
    fn eyes_trajectory_time(&self) -> Result<f64, DeviceError>;

    /// Sets the duration of motions of the eyes, s (`setEyesTrajTime`).
    fn set_eyes_trajectory_time(&self, time: f64) -> Result<(), DeviceError>;

    /// Returns the gain of the vestibulo-ocular reflex, without unit; 0 is off (`getVORGain`).
    fn vor_gain(&self) -> Result<f64, DeviceError>;

    /// Sets the gain of the vestibulo-ocular reflex; 0 disables it (`setVORGain`).
    fn set_vor_gain(&self, gain: f64) -> Result<(), DeviceError>;

    /// Returns the gain of the oculo-collic reflex, without unit; 0 is off (`getOCRGain`).
    fn ocr_gain(&self) -> Result<f64, DeviceError>;

    /// Sets the gain of the oculo-collic reflex; 0 disables it (`setOCRGain`).
    fn set_ocr_gain(&self, gain: f64) -> Result<(), DeviceError>;

    /// Returns whether the eyes make saccades, which are very fast motions (`getSaccadesMode`).
    fn saccades(&self) -> Result<bool, DeviceError>;

    /// Allows or forbids saccades (`setSaccadesMode`).
    fn set_saccades(&self, saccades: bool) -> Result<(), DeviceError>;

    /// Returns the minimum time between two saccades, s (`getSaccadesInhibitionPeriod`).
    fn saccade_inhibition_period(&self) -> Result<f64, DeviceError>;

    /// Sets the minimum time between two saccades, s (`setSaccadesInhibitionPeriod`).
    fn set_saccade_inhibition_period(&self, period: f64) -> Result<(), DeviceError>;

    /// Returns the angle to the target from which on a saccade is made, degrees (`getSaccadesActivationAngle`).
    fn saccade_activation_angle(&self) -> Result<f64, DeviceError>;

    /// Sets the angle to the target from which on a saccade is made, degrees (`setSaccadesActivationAngle`).
    fn set_saccade_activation_angle(&self, angle: f64) -> Result<(), DeviceError>;

    /// Returns the angle to the target that the neck leaves to the eyes, degrees (`getNeckAngleUserTolerance`).
    fn neck_tolerance(&self) -> Result<f64, DeviceError>;

    /// Sets the angle to the target that the neck leaves to the eyes, degrees (`setNeckAngleUserTolerance`).
    fn set_neck_tolerance(&self, angle: f64) -> Result<(), DeviceError>;

    /// Returns the pose of an eye or of the head (`getLeftEyePose`, `getRightEyePose`, `getHeadPose`).
    ///
    /// The frame of the head is in the middle between the eyes: x to the right, y down, z forward.
    fn gaze_pose(&self, frame: GazeFrame) -> Result<StampedPose, DeviceError>;

    /// Returns the pixel at which an eye sees a point (`get2DPixel`).
    fn pixel(&self, eye: Eye, point: [f64; 3]) -> Result<[f64; 2], DeviceError>;

    /// Returns the point behind a pixel at a depth, in metres along the optical axis of the eye (`get3DPoint`).
    fn point_at_depth(
        &self,
        eye: Eye,
        pixel: [f64; 2],
        depth: f64,
    ) -> Result<[f64; 3], DeviceError>;

    /// Returns the point behind a pixel on the plane `a x + b y + c z + d = 0`, as `[a, b, c, d]` (`get3DPointOnPlane`).
    fn point_on_plane(
        &self,
        eye: Eye,
        pixel: [f64; 2],
        plane: [f64; 4],
    ) -> Result<[f64; 3], DeviceError>;

    /// Returns the point at which eyes of these angles look (`get3DPointFromAngles`).
    fn point_from_angles(
        &self,
        reference: GazeReference,
        angles: GazeAngles,
    ) -> Result<[f64; 3], DeviceError>;

    /// Returns the absolute angles of eyes that look at a point (`getAnglesFrom3DPoint`).
    fn angles_from_point(&self, point: [f64; 3]) -> Result<GazeAngles, DeviceError>;

    /// Returns the point that both eyes see, each at its pixel (`triangulate3DPoint`).
    fn triangulate(&self, left: [f64; 2], right: [f64; 2]) -> Result<[f64; 3], DeviceError>;

    /// Returns the target of each joint of the head, degrees (`getJointsDesired`).
    fn desired_joints(&self) -> Result<Vec<f64>, DeviceError>;

    /// Returns the commanded velocity of each joint of the head, deg/s (`getJointsVelocities`).
    fn joint_velocities(&self) -> Result<Vec<f64>, DeviceError>;

    /// Returns the parameters of the control loop behind [`GazeTarget::StereoPixels`]: `Kp`, `Ki`, `Kd`, `satLim`, `Ts`,
    /// `dominantEye` and others (`getStereoOptions`).
    fn stereo_options(&self) -> Result<GazeOptions, DeviceError>;

    /// Sets parameters of that control loop; others stay (`setStereoOptions`).
    fn set_stereo_options(&self, options: &GazeOptions) -> Result<(), DeviceError>;

    /// Keeps a joint of the neck in a range, degrees (`bindNeckPitch`, `bindNeckRoll`, `bindNeckYaw`).
    fn bind_neck(&self, joint: NeckJoint, range: Limits) -> Result<(), DeviceError>;

    /// Keeps a joint of the neck at an angle, degrees; at the present one for `None` (`blockNeckPitch` and so on).
    ///
    /// Errors: for a device behind a network, for `None`, also [`DeviceError::NoDataYet`] and [`DeviceError::Stale`].
    fn block_neck(&self, joint: NeckJoint, angle: Option<f64>) -> Result<(), DeviceError>;

    /// Returns the range of a joint of the neck, degrees (`getNeckPitchRange`, `getNeckRollRange`, `getNeckYawRange`).
    fn neck_range(&self, joint: NeckJoint) -> Result<Limits, DeviceError>;

    /// Gives a joint of the neck its whole range again (`clearNeckPitch`, `clearNeckRoll`, `clearNeckYaw`).
    fn clear_neck(&self, joint: NeckJoint) -> Result<(), DeviceError>;

    /// Keeps the eyes straight ahead with a vergence, degrees; with the present one for `None` (`blockEyes`). Their tilt
    /// is free.
    ///
    /// Errors: as [`block_neck`](Self::block_neck).
    fn block_eyes(&self, vergence: Option<f64>) -> Result<(), DeviceError>;

    /// Returns the vergence at which the eyes are kept, degrees; `None` if they are free (`getBlockedVergence`).
    fn blocked_vergence(&self) -> Result<Option<f64>, DeviceError>;

    /// Frees the eyes again (`clearEyes`).
    fn clear_eyes(&self) -> Result<(), DeviceError>;

    /// Returns whether no motion is in progress (`checkMotionDone`).
    fn motion_done(&self) -> Result<bool, DeviceError>;

    /// Asks every `period` whether the motion is done, until `timeout` (`waitMotionDone`). Blocks.
    fn wait_motion_done(&self, period: Duration, timeout: Duration) -> Result<bool, DeviceError> {
        wait_until(period, timeout, || self.motion_done())
    }

    /// Returns whether no saccade is in progress (`checkSaccadeDone`).
    fn saccade_done(&self) -> Result<bool, DeviceError>;

    /// Asks every `period` whether the saccade is done, until `timeout` (`waitSaccadeDone`). Blocks.
    fn wait_saccade_done(&self, period: Duration, timeout: Duration) -> Result<bool, DeviceError> {
        wait_until(period, timeout, || self.saccade_done())
    }

    /// Ends the motion (`stopControl`).
    fn stop(&self) -> Result<(), DeviceError>;

    /// Keeps all settings under a number (`storeContext`). Number 0 is there from the beginning.
    fn store_context(&self) -> Result<i32, DeviceError>;

    /// Takes the settings of that number again (`restoreContext`).
    ///
    /// Errors: also [`DeviceError::Unsuitable`] for a number other than 0 that
    /// [`store_context`](Self::store_context) did not return.
    fn restore_context(&self, id: i32) -> Result<(), DeviceError>;

    /// Forgets the settings of that number (`deleteContext`).
    ///
    /// Errors: as [`restore_context`](Self::restore_context).
    fn delete_context(&self, id: i32) -> Result<(), DeviceError>;

    /// Returns information about the controller and its head (`getInfo`).
    fn gaze_info(&self) -> Result<GazeInfo, DeviceError>;

    /// Returns the calibration of the cameras: `camera_intrinsics_left`, `camera_width_left`, `camera_extrinsics_left`
    /// and others (`tweakGet`).
    fn tweaks(&self) -> Result<GazeOptions, DeviceError>;

    /// Changes the calibration of the cameras; what is not named stays (`tweakSet`).
    fn tweak(&self, change: &GazeOptions) -> Result<(), DeviceError>;

    /// Has the controller announce when this fraction of a motion is done, 0 to 1 (`registerEvent`).
    fn register_checkpoint(&self, checkpoint: f64) -> Result<(), DeviceError>;

    /// Takes that back (`unregisterEvent`). Refused for a fraction that is not registered.
    fn unregister_checkpoint(&self, checkpoint: f64) -> Result<(), DeviceError>;

    /// Returns the fractions that are announced.
    fn checkpoints(&self) -> Result<Vec<f64>, DeviceError>;

    /// Subscribes to the events from now on (`registerEvent` with `*`). A receiver that does not read for long misses
    /// the newest events.
    fn events(&self) -> Result<Receiver<GazeEvent>, DeviceError>;
}

/// Asks every `period`, until the answer is yes, an error, or `timeout`.
fn wait_until(
    period: Duration,
    timeout: Duration,
    is_done: impl Fn() -> Result<bool, DeviceError>,
) -> Result<bool, DeviceError> {
    let begun = Instant::now();
    loop {
        if is_done()? {
            return Ok(true);
        }
        let left = timeout.saturating_sub(begun.elapsed());
        if left.is_zero() {
            return Ok(false);
        }
        thread::sleep(period.min(left));
    }
}

/// An eye, and the camera in it.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub enum Eye {
    /// The left one of the robot (stock: 0).
    Left,
    /// The right one (stock: 1).
    Right,
}

/// A frame that moves with the head.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub enum GazeFrame {
    /// That of the left eye.
    LeftEye,
    /// That of the right eye.
    RightEye,
    /// That of the head, in the middle between the eyes.
    Head,
}

/// A joint of the neck.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub enum NeckJoint {
    /// Nodding.
    Pitch,
    /// Tilting to a side.
    Roll,
    /// Turning to a side.
    Yaw,
}

/// A direction of the gaze.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GazeAngles {
    /// Angle to the side, degrees.
    pub azimuth: f64,
    /// Angle upwards, degrees.
    pub elevation: f64,
    /// Angle between the optical axes of the eyes, degrees; 0 for eyes that look at something far away.
    pub vergence: f64,
}

impl GazeAngles {
    /// Returns the angles of `azimuth elevation vergence`, as on the wire.
    pub fn from_array([azimuth, elevation, vergence]: [f64; 3]) -> Self {
        Self {
            azimuth,
            elevation,
            vergence,
        }
    }

    /// Returns `azimuth elevation vergence`, as on the wire.
    pub fn to_array(self) -> [f64; 3] {
        [self.azimuth, self.elevation, self.vergence]
    }
}

/// The frame of a direction. Both are in the middle between the eyes.
#[derive(Clone, Copy, Debug, Default, Eq, Hash, PartialEq)]
pub enum GazeReference {
    /// That of the head of a robot whose torso and head joints are all 0.
    #[default]
    Absolute,
    /// That of the head at present.
    Relative,
}

/// The target of the gaze.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GazeTarget {
    /// A point, metres.
    Point([f64; 3]),
    /// A direction.
    Angles {
        /// The frame of the direction.
        reference: GazeReference,
        /// The direction.
        angles: GazeAngles,
    },
    /// The point behind a pixel of an image.
    Pixel {
        /// The eye that sees it.
        eye: Eye,
        /// Column and row.
        pixel: [f64; 2],
        /// Its depth along the optical axis, metres; 1 in stock where it does not matter.
        depth: f64,
    },
    /// The point behind a pixel of an image, at the distance of a vergence.
    PixelWithVergence {
        /// The eye that sees it.
        eye: Eye,
        /// Column and row.
        pixel: [f64; 2],
        /// The vergence, degrees.
        vergence: f64,
    },
    /// The point that both eyes see. Without a reply it is approached by a control loop on the images, which needs the
    /// target again for every image.
    StereoPixels {
        /// Column and row in the left image.
        left: [f64; 2],
        /// Column and row in the right image.
        right: [f64; 2],
    },
}

/// A point at which both eyes look.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FixationPoint {
    /// The point, metres.
    pub point: [f64; 3],
    /// Time of the measurement: seconds since the start of 1970.
    pub time: f64,
}

/// A direction of the gaze, and when it was measured.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StampedGazeAngles {
    /// The direction, absolute.
    pub angles: GazeAngles,
    /// Time of the measurement: seconds since the start of 1970.
    pub time: f64,
}

/// Named values of a gaze controller, in their order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GazeOptions {
    /// Names and values.
    pub options: Vec<(String, Vec<VariableValue>)>,
}

impl GazeOptions {
    /// Returns the value of the first option of that name.
    pub fn get(&self, name: &str) -> Option<&[VariableValue]> {
        let named = self.options.iter().find(|(known, _)| known == name);
        named.map(|(_, value)| value.as_slice())
    }

    /// Adds an option.
    #[must_use]
    pub fn with(mut self, name: impl Into<String>, value: Vec<VariableValue>) -> Self {
        self.options.push((name.into(), value));
        self
    }
}

/// Information about a gaze controller and its head.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GazeInfo {
    /// The version of the protocol, `2.0`; empty if it is not reported.
    pub server_version: String,
    /// The version of the kinematics of the head.
    pub head_version: String,
    /// The smallest vergence that the eyes may have, degrees.
    pub min_vergence: Option<f64>,
    /// The kinds of events that the controller announces, as words.
    pub events: Vec<String>,
    /// Everything else: the calibration of the cameras, as [`GazeControl::tweaks`] returns it.
    pub others: GazeOptions,
}

/// An event of a gaze controller.
#[derive(Clone, Debug, PartialEq)]
pub struct GazeEvent {
    /// Kind of event.
    pub kind: GazeEventKind,
    /// Time of the event: seconds since the start of 1970.
    pub time: f64,
}

/// The kind of an event of a gaze controller.
#[derive(Clone, Debug, PartialEq)]
pub enum GazeEventKind {
    /// A motion begins (`motion-onset`).
    MotionOnset,
    /// A registered fraction of a motion is done (`motion-ongoing`).
    MotionOngoing {
        /// The fraction, 0 to 1.
        checkpoint: f64,
    },
    /// The motion has ended (`motion-done`).
    MotionDone,
    /// A saccade begins (`saccade-onset`).
    SaccadeOnset,
    /// The saccade has ended (`saccade-done`).
    SaccadeDone,
    /// Stabilization is on (`stabilization-on`).
    StabilizationOn,
    /// Stabilization is off (`stabilization-off`).
    StabilizationOff,
    /// The controller ends (`closing`).
    Closing,
    /// The controller is suspended (`suspended`).
    Suspended,
    /// The controller runs again (`resumed`).
    Resumed,
    /// The controller has lost the robot and is suspended (`comm-timeout`).
    CommTimeout,
    /// Any other word, as received.
    Other(String),
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    #[test]
    fn a_wait_ends_with_the_motion_an_error_or_the_timeout() {
        const HOUR: Duration = Duration::from_secs(3600);
        let asked = Cell::new(0);
        let third = || {
            asked.set(asked.get() + 1);
            Ok(asked.get() == 3)
        };
        assert!(wait_until(Duration::from_millis(1), HOUR, third).unwrap());
        assert_eq!(asked.get(), 3);
        // An hour's period does not outlast the timeout.
        let never = || Ok(false);
        assert!(!wait_until(HOUR, Duration::from_millis(5), never).unwrap());
        let broken = || Err(DeviceError::NoDataYet { what: "answer" });
        assert!(wait_until(HOUR, HOUR, broken).is_err());
    }

    #[test]
    fn options_are_found_by_name() {
        let options = GazeOptions::default()
            .with("Kp", vec![VariableValue::Number(0.5)])
            .with("Ts", vec![VariableValue::Integer(1)]);
        assert_eq!(options.get("Ts"), Some(&[VariableValue::Integer(1)][..]));
        assert_eq!(options.get("Kd"), None);
    }
}
