//! Collisions of an arm along a path, found by the physics engine's own geometry.

use rapier3d::math::Vector;
use rapier3d::parry::query::distance;
use rapier3d::prelude::SharedShape;
use yarp_devices::kinematics::{Chain, Joints};

use super::bodies::to_engine;
use crate::Pose;
use crate::simulated_robot::{self, HandPosture, RobotPosture, RobotSolid};

/// Shape of an obstacle, around its own origin, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Solid {
    /// A cuboid with these edges.
    Cuboid([f64; 3]),
    /// An upright cylinder.
    Cylinder {
        /// Radius.
        radius: f64,
        /// Along z.
        height: f64,
    },
    /// A sphere.
    Sphere {
        /// Radius.
        radius: f64,
    },
    /// Everything below the plane z = 0.
    HalfSpace,
}

/// Distance that no point of the arm moves farther than between two examined postures, m, if every joint has a reach of 1 m.
const SAMPLE_STEP: f64 = 0.004;

/// Checks of the arm with an open hand against obstacles, by the collision library of the physics engine.
///
/// It shares nothing with a planner: the arm is the solids that the simulation gives it, and the engine's distances between
/// convex shapes decide.
pub struct PathCheck {
    obstacles: Vec<(SharedShape, rapier3d::math::Pose)>,
    solids: Vec<(RobotSolid, SharedShape)>,
    chain: Chain<7>,
}

impl std::fmt::Debug for PathCheck {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("PathCheck")
            .field("obstacles", &self.obstacles.len())
            .finish_non_exhaustive()
    }
}

impl PathCheck {
    /// Returns the checks of an arm among these obstacles.
    pub fn new(chain: &Chain<7>, obstacles: impl IntoIterator<Item = (Solid, Pose)>) -> Self {
        let obstacles = obstacles
            .into_iter()
            .map(|(solid, pose)| placed(solid, &pose))
            .collect();
        let solids = simulated_robot::solids(true)
            .into_iter()
            // The base stands on what it stands on.
            .filter(|solid| solid.part > 0)
            .map(|solid| {
                let end = |point: nalgebra::Point3<f64>| {
                    let point = point.cast::<f32>();
                    Vector::new(point.x, point.y, point.z)
                };
                let shape =
                    SharedShape::capsule(end(solid.from), end(solid.to), solid.radius as f32);
                (solid, shape)
            })
            .collect();
        Self {
            obstacles,
            solids,
            chain: chain.clone(),
        }
    }

    /// Returns the smallest distance of the arm from an obstacle, m; 0 in collision.
    pub fn distance(&self, joints: &Joints<7>) -> f64 {
        let posture = RobotPosture {
            joints: *joints,
            hand: Some(HandPosture::default()),
        };
        let frames = simulated_robot::frames(&self.chain, &posture);
        let mut smallest = f64::INFINITY;
        for (solid, shape) in &self.solids {
            let place = to_engine(&frames[solid.part]);
            for (obstacle, there) in &self.obstacles {
                // Two shapes that the engine cannot compare would count as a collision.
                let apart = distance(&place, shape.as_ref(), there, obstacle.as_ref());
                smallest = smallest.min(apart.map_or(0.0, |apart| f64::from(apart.distance)));
            }
        }
        smallest
    }

    /// Returns the smallest distance along straight motions between postures, m; stops at the first collision with 0.
    pub fn distance_along(&self, postures: &[Joints<7>]) -> f64 {
        let mut smallest = postures
            .first()
            .map_or(f64::INFINITY, |first| self.distance(first));
        for pair in postures.windows(2) {
            let steps = ((pair[1] - pair[0]).abs().sum() / SAMPLE_STEP)
                .ceil()
                .max(1.0);
            let mut step = 1.0;
            while step <= steps {
                let here = self.distance(&pair[0].lerp(&pair[1], step / steps));
                smallest = smallest.min(here);
                if here <= 0.0 {
                    return 0.0;
                }
                // What is this far away cannot be touched before the arm has moved as far.
                step += (here / SAMPLE_STEP).floor().max(1.0);
            }
        }
        smallest
    }
}

fn placed(solid: Solid, pose: &Pose) -> (SharedShape, rapier3d::math::Pose) {
    let half = |edge: f64| (edge / 2.0) as f32;
    match solid {
        Solid::Cuboid([x, y, z]) => {
            let shape = SharedShape::cuboid(half(x), half(y), half(z));
            (shape, to_engine(pose))
        }
        Solid::Cylinder { radius, height } => {
            // The engine's cylinders are along y.
            let upright = nalgebra::Rotation3::from_axis_angle(
                &nalgebra::Vector3::x_axis(),
                std::f64::consts::FRAC_PI_2,
            );
            let pose = pose * upright;
            (
                SharedShape::cylinder(half(height), radius as f32),
                to_engine(&pose),
            )
        }
        Solid::Sphere { radius } => (SharedShape::ball(radius as f32), to_engine(pose)),
        Solid::HalfSpace => (SharedShape::halfspace(Vector::Z), to_engine(pose)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm_model;

    fn check(solid: Solid, pose: Pose) -> f64 {
        let chain = arm_model().chain;
        let bent = Joints::<7>::from([0.6, 0.8, 0.0, 1.4, 0.0, 0.0, 0.0]);
        let back = Joints::<7>::from([-0.6, 0.8, 0.0, 1.4, 0.0, 0.0, 0.0]);
        PathCheck::new(&chain, [(solid, pose)]).distance_along(&[back, bent])
    }

    #[test]
    fn every_shape_in_the_way_is_found() {
        let tool = arm_model()
            .chain
            .forward(&Joints::<7>::from([0.0, 0.8, 0.0, 1.4, 0.0, 0.0, 0.0]));
        let middle = Pose::from(tool.translation);
        let radius = 0.02;
        let solids = [
            Solid::Cuboid([0.04; 3]),
            Solid::Cylinder {
                radius,
                height: 0.1,
            },
            Solid::Sphere { radius },
            Solid::HalfSpace,
        ];
        for solid in solids {
            assert_eq!(check(solid, middle), 0.0, "{solid:?}");
            let away = check(solid, Pose::translation(0.0, 0.0, -1.5));
            assert!(away > 0.3, "{solid:?}: {away}");
        }
        // An upright pole beside the way, not a lying one.
        let pole = Solid::Cylinder {
            radius,
            height: 1.0,
        };
        let beside = Pose::translation(0.0, 0.0, 2.0);
        assert!(check(pole, beside) > 0.2);
    }
}
