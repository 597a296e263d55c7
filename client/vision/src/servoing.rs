//! Visual servoing: the last centimetres of an approach, corrected from images (section 9 of the thesis).
//!
//! One camera sees the tool (by the pattern on it) and its goal (by the object beside which it belongs). Both poses pass
//! through the same calibration, so its error is in both and leaves their difference. Without images it is in the goal alone.
//!
//! ```text
//!  image ──▶ pose of the tool ─┐
//!        └─▶ pose of the goal ─┴─▶ difference ──▶ Servo: gain, bound per step ──▶ Correction ──▶ joint_step ──▶ arm
//! ```
//!
//! [`Servo`] has neither camera nor arm nor clock; [`follow_goal`] drives it and makes the tool hold after every error.

use std::time::Duration;

use nalgebra::{Matrix6, Rotation3, Vector3, Vector6};
use yarp_devices::kinematics::{Chain, Joints, rotation_vector};

use crate::Pose;

/// Error of a device or an image source.
type Source = Box<dyn std::error::Error + Send + Sync>;

/// Smallest singular value of the Jacobian at which a tool may be servoed: below it small corrections need large motions of
/// the joints.
pub const MIN_SINGULAR_VALUE: f64 = 0.02;
/// Largest change of a joint by one correction, rad.
const MAX_JOINT_STEP: f64 = 0.1;

/// Options of a [`Servo`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ServoOptions {
    /// Part of the measured difference that one correction removes, 0 to 1. With images one interval old, corrections swing
    /// above 0.6.
    pub gain: f64,
    /// Largest translation of one correction, m.
    pub max_step: f64,
    /// Largest rotation of one correction, rad.
    pub max_turn: f64,
    /// Difference at which the tool has arrived, m and rad.
    pub tolerance: [f64; 2],
    /// Consecutive images in which the tool has to be at its goal.
    pub settled_images: u32,
    /// Largest difference that is corrected, m: a larger one is a wrong detection or a wrong approach.
    pub max_distance: f64,
    /// Longest time without an image that shows tool and goal.
    pub loss_timeout: Duration,
    /// Time during which a goal that the tool hides is where it was: the camera stands still.
    pub goal_memory: Duration,
    /// Longest time until the tool has arrived.
    pub timeout: Duration,
}

impl Default for ServoOptions {
    fn default() -> Self {
        Self {
            gain: 0.4,
            max_step: 0.005,
            max_turn: 0.02,
            tolerance: [0.0005, 0.003],
            settled_images: 3,
            max_distance: 0.08,
            loss_timeout: Duration::from_millis(500),
            goal_memory: Duration::from_secs(1),
            timeout: Duration::from_secs(10),
        }
    }
}

/// Poses in one image, in any frame that both share: the base frame of the arm as the camera's calibration has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Number of the image.
    pub number: u64,
    /// Pose of the tool; `None` if the image does not show it.
    pub tool: Option<Pose>,
    /// Pose in which the tool belongs; `None` if the image does not show its object.
    pub goal: Option<Pose>,
}

/// A small motion of the tool: along and about the axes of the arm's base frame, about the tool's own origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correction {
    /// m.
    pub translation: Vector3<f64>,
    /// Rotation vector, rad.
    pub rotation: Vector3<f64>,
}

impl Correction {
    /// Returns the pose of a tool after the correction.
    pub fn of(&self, tool: &Pose) -> Pose {
        let place = tool.translation.vector + self.translation;
        Pose::from_parts(place.into(), Rotation3::new(self.rotation) * tool.rotation)
    }
}

/// Reaction of a [`Servo`] to an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ServoStep {
    /// The tool has to move.
    Move(Correction),
    /// The tool has to stay: no new image, nothing seen, or at its goal and not yet for long enough.
    Hold,
    /// The tool has arrived.
    Arrived,
}

/// An error of visual servoing. The tool has to hold its place.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ServoError {
    /// An option is out of range.
    #[error("option {option} of visual servoing is {value}, expected {expected}")]
    Option {
        /// Name of the option.
        option: &'static str,
        /// Its value.
        value: f64,
        /// Its range.
        expected: &'static str,
    },
    /// Tool or goal are not in sight.
    #[error(
        "no image has shown {what} for {seconds:.1} s; check camera, light and view, then approach again"
    )]
    Lost {
        /// Tool or goal, whichever was missing last.
        what: &'static str,
        /// Time since the last image with both, s.
        seconds: f64,
    },
    /// The tool is too far from its goal.
    #[error(
        "the tool is {distance:.3} m from its goal, more than the {max:.3} m that are corrected; detect and approach again"
    )]
    TooFar {
        /// Distance, m.
        distance: f64,
        /// Largest one, m.
        max: f64,
    },
    /// The tool does not arrive.
    #[error(
        "the tool has not arrived within {seconds:.1} s: {distance:.4} m and {angle:.4} rad are left"
    )]
    Timeout {
        /// Timeout, s.
        seconds: f64,
        /// Distance in the last image with both, m; not a number without any.
        distance: f64,
        /// Angle in it, rad.
        angle: f64,
    },
    /// The arm cannot follow corrections in this posture.
    #[error(
        "the posture is singular (smallest singular value {value:.4}, expected {MIN_SINGULAR_VALUE} at least); approach from another side"
    )]
    Singular {
        /// Smallest singular value of the Jacobian.
        value: f64,
    },
    /// A joint is at its limit.
    #[error(
        "joint {joint} would have to move to {angle:.3} rad, beyond its limit or too far for one image"
    )]
    Joint {
        /// Number of the joint from 0.
        joint: usize,
        /// Angle, rad.
        angle: f64,
    },
    /// A device or an image source failed.
    #[error("cannot {action}: {source}")]
    Failed {
        /// Action that failed, as a verb with its object.
        action: &'static str,
        /// Reason.
        source: Source,
    },
}

/// The control law of visual servoing: one correction per image.
#[derive(Clone, Debug)]
pub struct Servo {
    options: ServoOptions,
    started: Option<Duration>,
    /// Time of the last image with tool and goal.
    seen: Duration,
    number: Option<u64>,
    goal: Option<(Duration, Pose)>,
    missing: &'static str,
    left: [f64; 2],
    settled: u32,
}

impl Servo {
    /// Creates a control law.
    ///
    /// Errors: [`ServoError::Option`].
    pub fn new(options: ServoOptions) -> Result<Self, ServoError> {
        let positive = |option, value: f64| match value.is_finite() && value > 0.0 {
            true => Ok(()),
            false => Err(ServoError::Option {
                option,
                value,
                expected: "more than 0",
            }),
        };
        if !(options.gain > 0.0 && options.gain <= 1.0) {
            return Err(ServoError::Option {
                option: "gain",
                value: options.gain,
                expected: "more than 0, 1 at most",
            });
        }
        positive("max_step", options.max_step)?;
        positive("max_turn", options.max_turn)?;
        positive("tolerance", options.tolerance[0])?;
        positive("tolerance", options.tolerance[1])?;
        positive("max_distance", options.max_distance)?;
        Ok(Self {
            options,
            started: None,
            seen: Duration::ZERO,
            number: None,
            goal: None,
            missing: "an image",
            left: [f64::NAN; 2],
            settled: 0,
        })
    }

    /// Returns the distance in m and the angle in rad between tool and goal in the last image with both; not numbers before.
    pub fn difference(&self) -> [f64; 2] {
        self.left
    }

    /// Takes the latest image at time `now`, of any clock that does not go back; `None` if there is none.
    ///
    /// An image that was taken before is no new one: the tool moves once per image, at the rate of the camera.
    ///
    /// Errors: [`ServoError::Lost`], [`ServoError::TooFar`], [`ServoError::Timeout`].
    pub fn step(
        &mut self,
        now: Duration,
        image: Option<&Observation>,
    ) -> Result<ServoStep, ServoError> {
        let started = *self.started.get_or_insert_with(|| {
            self.seen = now;
            now
        });
        if now.saturating_sub(started) > self.options.timeout {
            let [distance, angle] = self.left;
            return Err(ServoError::Timeout {
                seconds: self.options.timeout.as_secs_f64(),
                distance,
                angle,
            });
        }
        let new = image.filter(|image| self.number != Some(image.number));
        let Some(image) = new else {
            return self.wait(now, "an image");
        };
        self.number = Some(image.number);
        if let Some(goal) = image.goal {
            self.goal = Some((now, goal));
        }
        let memory = self.options.goal_memory;
        let goal = self
            .goal
            .filter(|(since, _)| now.saturating_sub(*since) <= memory);
        match (image.tool, goal) {
            (Some(tool), Some((_, goal))) => self.correct(now, &tool, &goal),
            (None, _) => self.wait(now, "the tool"),
            (Some(_), None) => self.wait(now, "the goal"),
        }
    }

    /// Waits for tool and goal, not for ever.
    fn wait(&mut self, now: Duration, missing: &'static str) -> Result<ServoStep, ServoError> {
        // Between two images there is none: what the last image lacked is the reason.
        if missing != "an image" {
            (self.missing, self.settled) = (missing, 0);
        }
        let since = now.saturating_sub(self.seen);
        if since > self.options.loss_timeout {
            return Err(ServoError::Lost {
                what: self.missing,
                seconds: since.as_secs_f64(),
            });
        }
        Ok(ServoStep::Hold)
    }

    fn correct(
        &mut self,
        now: Duration,
        tool: &Pose,
        goal: &Pose,
    ) -> Result<ServoStep, ServoError> {
        (self.seen, self.missing) = (now, "a new image");
        let translation = goal.translation.vector - tool.translation.vector;
        let rotation = rotation_vector(&(goal.rotation * tool.rotation.inverse()));
        let (distance, angle) = (translation.norm(), rotation.norm());
        self.left = [distance, angle];
        let max = self.options.max_distance;
        // A pose that is not a number is no distance either.
        if !(distance <= max && angle.is_finite()) {
            return Err(ServoError::TooFar { distance, max });
        }
        let [near, straight] = self.options.tolerance;
        if distance <= near && angle <= straight {
            self.settled += 1;
            return Ok(match self.settled >= self.options.settled_images {
                true => ServoStep::Arrived,
                false => ServoStep::Hold,
            });
        }
        self.settled = 0;
        Ok(ServoStep::Move(Correction {
            translation: bounded(translation * self.options.gain, self.options.max_step),
            rotation: bounded(rotation * self.options.gain, self.options.max_turn),
        }))
    }
}

/// Returns a vector in the same direction that is at most this long.
fn bounded(vector: Vector3<f64>, max: f64) -> Vector3<f64> {
    let length = vector.norm();
    if length > max {
        vector * (max / length)
    } else {
        vector
    }
}

/// Returns the joint angles, rad, after a correction of the chain's tool: least squares, in one step.
///
/// Errors: [`ServoError::Singular`], [`ServoError::Joint`]; the joints have to stay as they are.
pub fn joint_step(
    chain: &Chain<7>,
    joints: &Joints<7>,
    correction: &Correction,
) -> Result<Joints<7>, ServoError> {
    let (_, jacobian) = chain.forward_and_jacobian(joints);
    let square: Matrix6<f64> = jacobian * jacobian.transpose();
    let smallest = square.symmetric_eigenvalues().min().max(0.0).sqrt();
    if smallest < MIN_SINGULAR_VALUE {
        return Err(ServoError::Singular { value: smallest });
    }
    let (there, turn) = (correction.translation, correction.rotation);
    let twist = Vector6::new(there.x, there.y, there.z, turn.x, turn.y, turn.z);
    let inverse = square
        .try_inverse()
        .ok_or(ServoError::Singular { value: smallest })?;
    let change = jacobian.transpose() * (inverse * twist);
    let wanted = joints + change;
    for joint in 0..7 {
        let is_small = change[joint].abs() <= MAX_JOINT_STEP;
        if !(is_small && chain.limits()[joint].contains(wanted[joint])) {
            return Err(ServoError::Joint {
                joint,
                angle: wanted[joint],
            });
        }
    }
    Ok(wanted)
}

/// A tool that visual servoing moves, and the camera that sees it.
pub trait ServoedTool {
    /// Returns the time of a clock that does not go back, and the latest image if there is one; waits for the next for a short
    /// time at most.
    ///
    /// Errors: of the image source.
    fn observe(&mut self) -> Result<(Duration, Option<Observation>), Source>;

    /// Starts a small motion.
    ///
    /// Errors: of the arm, [`ServoError`] of [`joint_step`]; the arm has not moved.
    fn correct(&mut self, correction: &Correction) -> Result<(), Source>;

    /// Stops and holds the tool where it is.
    ///
    /// Errors: of the arm.
    fn hold(&mut self) -> Result<(), Source>;
}

/// Result of [`follow_goal`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Servoed {
    /// Number of corrections.
    pub corrections: u32,
    /// Distance that the last image shows, m.
    pub distance: f64,
    /// Angle that it shows, rad.
    pub angle: f64,
}

/// Corrects a tool until it is at its goal; whatever happens, the tool holds its place afterwards.
///
/// Blocks at most for [`ServoOptions::timeout`] and one image.
///
/// Errors: those of [`Servo`], and of the tool.
pub fn follow_goal(
    tool: &mut dyn ServoedTool,
    options: &ServoOptions,
) -> Result<Servoed, ServoError> {
    let followed = Servo::new(*options).and_then(|mut servo| follow(tool, &mut servo));
    let held = tool.hold().map_err(failed("hold the tool"));
    // The first error is the reason.
    followed.and_then(|servoed| held.map(|()| servoed))
}

fn follow(tool: &mut dyn ServoedTool, servo: &mut Servo) -> Result<Servoed, ServoError> {
    let mut corrections = 0;
    loop {
        let (now, image) = tool.observe().map_err(failed("take an image"))?;
        match servo.step(now, image.as_ref())? {
            ServoStep::Hold => {}
            ServoStep::Move(correction) => {
                tool.correct(&correction)
                    .map_err(failed("correct the tool"))?;
                corrections += 1;
            }
            ServoStep::Arrived => {
                let [distance, angle] = servo.difference();
                return Ok(Servoed {
                    corrections,
                    distance,
                    angle,
                });
            }
        }
    }
}

fn failed(action: &'static str) -> impl FnOnce(Source) -> ServoError {
    move |source| ServoError::Failed { action, source }
}
