//! Cartesian control of the tool of an arm.

use std::sync::mpsc::Receiver;
use std::thread;
use std::time::{Duration, Instant};

use crate::{AxisIndex, DeviceError, Limits};

/// Moves the tool of an arm to places and orientations (stock: `ICartesianControl`).
///
/// Places are metres, orientations an axis and an angle in **radians**, both in the base frame of the arm, as stock has
/// them: the one interface with radians. Joints are in degrees, and number as many as [`dof`](Self::dof) answers.
///
/// Errors, of every call: [`DeviceError::NotFinite`] and [`DeviceError::Unsuitable`] for numbers that make no sense, and
/// nothing changes then; those of the arm itself; for a device behind a network [`DeviceError::Refused`] and
/// [`DeviceError::Remote`].
pub trait CartesianControl: Send + Sync {
    /// Holds the target after it was reached, instead of releasing the arm (`setTrackingMode`).
    fn set_tracking(&self, tracking: bool) -> Result<(), DeviceError>;

    /// Returns whether a target is held (`getTrackingMode`).
    fn tracking(&self) -> Result<bool, DeviceError>;

    /// Uses the commanded joint positions instead of the measured ones (`setReferenceMode`).
    fn set_reference_mode(&self, reference: bool) -> Result<(), DeviceError>;

    /// See [`set_reference_mode`](Self::set_reference_mode) (`getReferenceMode`).
    fn reference_mode(&self) -> Result<bool, DeviceError>;

    /// Sets the priority where a whole pose is out of reach (`setPosePriority`).
    fn set_priority(&self, priority: Priority) -> Result<(), DeviceError>;

    /// See [`set_priority`](Self::set_priority) (`getPosePriority`).
    fn priority(&self) -> Result<Priority, DeviceError>;

    /// Returns the pose of the tool (`getPose`).
    ///
    /// Errors: for a device behind a network also [`DeviceError::NoDataYet`] and [`DeviceError::Stale`].
    fn pose(&self) -> Result<StampedPose, DeviceError>;

    /// Returns the pose of the frame of a link (`getPose` with an axis); that of the last is without the tool.
    ///
    /// Errors: also [`DeviceError::NoSuchAxis`].
    fn link_pose(&self, axis: AxisIndex) -> Result<StampedPose, DeviceError>;

    /// Goes there in about `time` seconds, and returns at once (`goToPose`, `goToPosition`).
    ///
    /// * `time`: none, or none above 0, for the trajectory time that is set.
    /// * A target is refused if what has priority in it is out of reach by more than the tolerance; nothing moves then.
    ///   [`ask`](Self::ask) finds the nearest pose.
    /// * A device behind a network does not get a refusal; [`go_to_sync`](Self::go_to_sync) does.
    fn go_to(&self, target: Target, time: Option<f64>) -> Result<(), DeviceError>;

    /// Commands a motion like [`go_to`](Self::go_to), but returns when the joint positions are known and the motion
    /// has been commanded (`goToPoseSync`, `goToPositionSync`).
    fn go_to_sync(&self, target: Target, time: Option<f64>) -> Result<(), DeviceError>;

    /// Returns the last target pose, as far as it can be reached, and its joints (`getDesired`).
    fn desired(&self) -> Result<PoseSolution, DeviceError>;

    /// Solves for a target without moving (`askForPose`, `askForPosition`).
    ///
    /// * `start`: start positions of the joints, degrees; the present ones if there is none.
    /// * Answers the nearest that was found, with its pose: how far that is away is for the caller to judge.
    fn ask(&self, target: Target, start: Option<&[f64]>) -> Result<PoseSolution, DeviceError>;

    /// Returns which joints are used (`getDOF`).
    fn dof(&self) -> Result<Vec<bool>, DeviceError>;

    /// Chooses the joints that are used; the others stay (`setDOF`). Returns the value in force.
    ///
    /// `None` leaves a joint unchanged; a list may be shorter than the number of joints.
    fn set_dof(&self, dof: &[Option<bool>]) -> Result<Vec<bool>, DeviceError>;

    /// Returns the preferred posture where the target leaves a choice, degrees (`getRestPos`).
    fn rest_positions(&self) -> Result<Vec<f64>, DeviceError>;

    /// Sets the preferred posture, degrees; what lies outside the limits is put onto them (`setRestPos`). Returns the
    /// value in force.
    fn set_rest_positions(&self, positions: &[f64]) -> Result<Vec<f64>, DeviceError>;

    /// Returns the weight with which each joint is drawn to its rest position, 0 for none (`getRestWeights`).
    fn rest_weights(&self) -> Result<Vec<f64>, DeviceError>;

    /// Sets the weights, 0 or more (`setRestWeights`). Returns the value in force.
    fn set_rest_weights(&self, weights: &[f64]) -> Result<Vec<f64>, DeviceError>;

    /// Returns the range of a joint, degrees (`getLimits`).
    fn joint_limits(&self, axis: AxisIndex) -> Result<Limits, DeviceError>;

    /// Sets the range of a joint, degrees, inside the range of the arm (`setLimits`).
    fn set_joint_limits(&self, axis: AxisIndex, limits: Limits) -> Result<(), DeviceError>;

    /// Returns the duration of motions, s (`getTrajTime`).
    fn trajectory_time(&self) -> Result<f64, DeviceError>;

    /// Sets how long motions take, s (`setTrajTime`).
    fn set_trajectory_time(&self, time: f64) -> Result<(), DeviceError>;

    /// Returns the tolerance of targets: metres, and radians (`getInTargetTol`).
    fn tolerance(&self) -> Result<f64, DeviceError>;

    /// Sets how near is there (`setInTargetTol`).
    fn set_tolerance(&self, tolerance: f64) -> Result<(), DeviceError>;

    /// Returns the commanded joint velocities, deg/s (`getJointsVelocities`).
    fn joint_velocities(&self) -> Result<Vec<f64>, DeviceError>;

    /// Returns the commanded velocity of the tool (`getTaskVelocities`).
    fn task_velocity(&self) -> Result<TaskVelocity, DeviceError>;

    /// Moves the tool at a velocity until the next command; zeros end it (`setTaskVelocities`).
    ///
    /// A device behind a network does not get a refusal.
    fn set_task_velocity(&self, velocity: TaskVelocity) -> Result<(), DeviceError>;

    /// Puts a tool onto the last link, given by its frame there (`attachTipFrame`).
    fn attach_tip(&self, tip: TaskPose) -> Result<(), DeviceError>;

    /// The tool that was put on (`getTipFrame`).
    fn tip(&self) -> Result<TaskPose, DeviceError>;

    /// Takes the tool off again (`removeTipFrame`).
    fn remove_tip(&self) -> Result<(), DeviceError> {
        self.attach_tip(TaskPose::default())
    }

    /// Returns whether no motion is in progress (`checkMotionDone`).
    fn motion_done(&self) -> Result<bool, DeviceError>;

    /// Asks every `period` whether the motion is done, until `timeout` (`waitMotionDone`). Blocks.
    fn wait_motion_done(&self, period: Duration, timeout: Duration) -> Result<bool, DeviceError> {
        let begun = Instant::now();
        loop {
            if self.motion_done()? {
                return Ok(true);
            }
            let left = timeout.saturating_sub(begun.elapsed());
            if left.is_zero() {
                return Ok(false);
            }
            thread::sleep(period.min(left));
        }
    }

    /// Ends the motion; the arm holds (`stopControl`).
    fn stop(&self) -> Result<(), DeviceError>;

    /// Keeps all settings under a number (`storeContext`). Number 0 is there from the beginning.
    fn store_context(&self) -> Result<i32, DeviceError>;

    /// Takes the settings of that number again (`restoreContext`).
    ///
    /// Errors: also [`DeviceError::Unsuitable`] for a number that is not known.
    fn restore_context(&self, id: i32) -> Result<(), DeviceError>;

    /// Forgets the settings of these numbers (`deleteContext`); number 0 stays.
    ///
    /// Errors: as [`restore_context`](Self::restore_context); then none is forgotten.
    fn delete_contexts(&self, ids: &[i32]) -> Result<(), DeviceError>;

    /// Returns information about the controller and its arm (`getInfo`).
    fn cartesian_info(&self) -> Result<CartesianInfo, DeviceError>;

    /// Returns the settings of the solver (`tweakGet`).
    fn tweaks(&self) -> Result<Tweaks, DeviceError>;

    /// Changes settings of the solver; those that are `None` stay (`tweakSet`).
    fn tweak(&self, change: TweakChange) -> Result<(), DeviceError>;

    /// Has the controller announce when this fraction of a path is covered, 0 to 1 (`registerEvent`).
    fn register_checkpoint(&self, checkpoint: f64) -> Result<(), DeviceError>;

    /// Takes that back (`unregisterEvent`).
    ///
    /// Errors: also [`DeviceError::Unsuitable`] for a fraction that is not registered.
    fn unregister_checkpoint(&self, checkpoint: f64) -> Result<(), DeviceError>;

    /// The fractions that are announced.
    fn checkpoints(&self) -> Result<Vec<f64>, DeviceError>;

    /// Subscribes to the events from now on. A receiver that does not read for long misses the newest events.
    fn events(&self) -> Result<Receiver<CartesianEvent>, DeviceError>;
}

/// A position and an orientation: metres, an axis of any length above 0, and an angle in rad.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TaskPose {
    /// Metres.
    pub position: [f64; 3],
    /// The axis of the turn; all zeros for no turn.
    pub axis: [f64; 3],
    /// The angle of the turn, rad.
    pub angle: f64,
}

impl TaskPose {
    /// From `x y z ax ay az theta`, as on the wire.
    pub fn from_array([x, y, z, ax, ay, az, angle]: [f64; 7]) -> Self {
        Self {
            position: [x, y, z],
            axis: [ax, ay, az],
            angle,
        }
    }

    /// `x y z ax ay az theta`, as on the wire.
    pub fn to_array(self) -> [f64; 7] {
        let [x, y, z] = self.position;
        let [ax, ay, az] = self.axis;
        [x, y, z, ax, ay, az, self.angle]
    }
}

/// A pose, and when it was measured.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StampedPose {
    /// The pose.
    pub pose: TaskPose,
    /// Time of the measurement: seconds since the start of 1970.
    pub time: f64,
}

/// The target of a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// A place and an orientation.
    Pose(TaskPose),
    /// A position, with any orientation; metres.
    Position([f64; 3]),
}

/// Priority where a whole pose is out of reach.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub enum Priority {
    /// The place.
    #[default]
    Position,
    /// The orientation.
    Orientation,
}

/// A pose that can be reached, and how.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PoseSolution {
    /// The pose.
    pub pose: TaskPose,
    /// All joints, degrees.
    pub joints: Vec<f64>,
}

/// Velocity of the tool.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TaskVelocity {
    /// m/s.
    pub linear: [f64; 3],
    /// The axis it turns about, in the base frame.
    pub axis: [f64; 3],
    /// rad/s.
    pub speed: f64,
}

/// Information about a controller and its arm.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CartesianInfo {
    /// The version of the protocol, `2.0`.
    pub server_version: String,
    /// Name of the part, for instance `arm`.
    pub part: String,
    /// The version of its kinematics.
    pub part_version: String,
    /// Type of the part, for instance `wam7`.
    pub part_type: String,
}

/// Settings of a solver.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tweaks {
    /// Straightness of paths.
    pub straightness: f64,
    /// Tolerance of a solution, metres and rad.
    pub tolerance: f64,
    /// Tolerance of joint limits.
    pub constraint_tolerance: f64,
    /// The most iterations.
    pub iterations: usize,
}

/// Knobs to be turned; those that are `None` stay.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TweakChange {
    /// See [`Tweaks::straightness`].
    pub straightness: Option<f64>,
    /// See [`Tweaks::tolerance`].
    pub tolerance: Option<f64>,
    /// See [`Tweaks::constraint_tolerance`].
    pub constraint_tolerance: Option<f64>,
    /// See [`Tweaks::iterations`].
    pub iterations: Option<usize>,
}

/// An event during a motion. Times are seconds since the start of 1970.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CartesianEvent {
    /// A motion begins (`motion-onset`).
    Onset {
        /// Time of the event.
        time: f64,
    },
    /// A registered fraction of the path is covered (`motion-ongoing`).
    Ongoing {
        /// Time of the event.
        time: f64,
        /// The fraction, 0 to 1.
        checkpoint: f64,
    },
    /// The motion has ended, there or elsewhere (`motion-done`).
    Done {
        /// Time of the event.
        time: f64,
    },
    /// The controller ends (`closing`).
    Closing {
        /// Time of the event.
        time: f64,
    },
}
