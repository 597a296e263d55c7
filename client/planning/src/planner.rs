//! Plans of motions.

use yarp_devices::kinematics::Joints;
use yarp_devices::pseudo_random::Random;
use yarp_devices::trajectory::JointLimits;
use yarp_devices::wam::WamModel;

use crate::collision::{ArmGeometry, CollisionModel, Contact};
use crate::path::{Path, Trajectory, TrajectoryError, shorten};
use crate::planning_scene::Scene;
use crate::rrt_connect::search;

/// Options of a [`Planner`].
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct PlannerOptions {
    /// Maximum number of random postures of a search; 20 000 by default.
    pub max_iterations: usize,
    /// Number of attempts to shorten a path; 60 by default.
    pub shortcuts: usize,
    /// Number of independent searches of which the shortest path is taken; 1 by default.
    pub searches: usize,
    /// Velocity and acceleration limits; 1 rad/s and 3 rad/s² by default, below the arm's own.
    pub limits: JointLimits<7>,
    /// Seed of the random postures; the same seed gives the same plan.
    pub seed: u64,
}

impl Default for PlannerOptions {
    fn default() -> Self {
        Self {
            max_iterations: 20_000,
            shortcuts: 60,
            searches: 1,
            limits: JointLimits::uniform(1.0, 3.0),
            seed: 1,
        }
    }
}

/// An error of planning. Nothing has moved.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlanError {
    /// The start is outside the joint limits or not finite.
    #[error("the start is outside the limits of joint {joint}: {angle:.3} rad")]
    StartOutOfRange {
        /// Joint, counted from 0.
        joint: usize,
        /// Its angle, in rad.
        angle: f64,
    },
    /// The start collides.
    #[error(
        "the start is in collision: {contact}, {depth:.3} m inside the margin; move the arm away by hand or enlarge the scene's gap"
    )]
    StartInCollision {
        /// Name of the colliding part.
        contact: Contact,
        /// Penetration depth, in metres.
        depth: f64,
    },
    /// No goal is reachable: each is outside the joint limits or collides.
    #[error("none of {count} goals is free{}", first.as_ref().map(|contact| format!("; the first collides: {contact}")).unwrap_or_default())]
    NoFreeGoal {
        /// Number of goals.
        count: usize,
        /// Part that the first posture collides with, unless it is outside the joint limits.
        first: Option<Contact>,
    },
    /// The search found no path.
    #[error("no path found with {iterations} random postures")]
    NoPath {
        /// Number of random postures.
        iterations: usize,
    },
}

/// A planner of collision-free motions for one arm in one scene.
#[derive(Clone, Debug)]
pub struct Planner {
    model: CollisionModel,
    options: PlannerOptions,
    random: Random,
}

impl Planner {
    /// Returns a planner for a WAM with a bare tool plate.
    pub fn new(arm: &WamModel<7>, scene: Scene) -> Self {
        Self::with_geometry(arm, ArmGeometry::wam(), scene)
    }

    /// Returns a planner for a WAM of the given shape, for example with a hand.
    pub fn with_geometry(arm: &WamModel<7>, geometry: ArmGeometry, scene: Scene) -> Self {
        Self::with_model(CollisionModel::new(&arm.chain, geometry, scene))
    }

    /// Returns a planner with the given collision checks.
    pub fn with_model(model: CollisionModel) -> Self {
        let options = PlannerOptions::default();
        Self {
            random: Random::new(options.seed),
            model,
            options,
        }
    }

    /// Sets the options.
    pub fn with_options(mut self, options: PlannerOptions) -> Self {
        self.random = Random::new(options.seed);
        self.options = options;
        self
    }

    /// Returns the collision checks.
    pub fn model(&self) -> &CollisionModel {
        &self.model
    }

    /// Plans a motion from `start` to the most convenient of `goals`, in rad.
    ///
    /// Every posture of the path keeps the margin from every obstacle and from the arm itself.
    ///
    /// Errors: [`PlanError`]; goals that are not free are ignored unless none is left.
    pub fn plan(&mut self, start: &Joints<7>, goals: &[Joints<7>]) -> Result<Path, PlanError> {
        self.check_start(start)?;
        let free: Vec<Joints<7>> = goals
            .iter()
            .filter(|goal| self.model.is_free(goal))
            .copied()
            .collect();
        if free.is_empty() {
            let first = goals.first().and_then(|goal| self.model.contact(goal));
            return Err(PlanError::NoFreeGoal {
                count: goals.len(),
                first: first
                    .filter(|contact| contact.0 < 0.0)
                    .map(|contact| contact.1),
            });
        }
        let mut best: Option<Path> = None;
        for _ in 0..self.options.searches.max(1) {
            let iterations = self.options.max_iterations;
            let found = search(&self.model, start, &free, iterations, &mut self.random);
            let Some(postures) = found else { continue };
            let direct = postures.len() == 2;
            let attempts = self.options.shortcuts;
            let path = shorten(Path::new(postures), &self.model, attempts, &mut self.random);
            let better = best
                .as_ref()
                .is_none_or(|best| path.weighted_length() < best.weighted_length());
            if better {
                best = Some(path);
            }
            if direct {
                break;
            }
        }
        best.ok_or(PlanError::NoPath {
            iterations: self.options.max_iterations,
        })
    }

    /// Returns the fastest motion along a path within the limits of the options.
    pub fn trajectory(&self, path: &Path) -> Result<Trajectory, TrajectoryError> {
        Trajectory::new(path, &self.options.limits)
    }

    fn check_start(&self, start: &Joints<7>) -> Result<(), PlanError> {
        let limits = self.model.chain().limits();
        for joint in 0..7 {
            if !limits[joint].contains(start[joint]) {
                let angle = start[joint];
                return Err(PlanError::StartOutOfRange { joint, angle });
            }
        }
        match self.model.contact(start) {
            Some((distance, contact)) if distance < 0.0 => Err(PlanError::StartInCollision {
                contact,
                depth: -distance,
            }),
            _ => Ok(()),
        }
    }
}
