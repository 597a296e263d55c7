//! Shapes, masses and friction of bodies.

use nalgebra::{Quaternion, Rotation3, Translation3, UnitQuaternion};
use rapier3d::math::{Pose as EnginePose, Vector};
use rapier3d::prelude::{
    ActiveCollisionTypes, CoefficientCombineRule, Collider, ColliderBuilder, Group,
    InteractionGroups, InteractionTestMode, PhysicsWorld, RigidBody, RigidBodyBuilder,
    RigidBodyHandle,
};

use crate::object::{Object, Shape};
use crate::simulated_robot::{self, PARTS, RobotPosture};
use crate::{Pose, Scene};

/// Friction of two bodies is the smaller of their coefficients: rubber leaves the object's, which is against rubber.
const RUBBER: f32 = 5.0;
/// Friction coefficient of baskets.
const BASKET: f32 = 0.5;
/// Thickness of the table, and depth of the room's floor below it, m.
const TABLE_THICKNESS: f64 = 0.05;
const FLOOR: f64 = 0.75;

/// The link of a finger that grips, and the number of balls that stand for it: 5 mm apart, so that the surface is 0.3 mm
/// uneven. The engine finds the contact of a capsule with a cylinder from faceted approximations, whose points change from
/// step to step and lose their forces with it: a grip let go for single steps. A ball has one contact, which stays.
const OUTER_LINK: usize = 2;
const TIP_BALLS: usize = 11;

/// Groups: the robot's parts pass through each other.
const ROBOT: Group = Group::GROUP_1;
const WORLD: Group = Group::GROUP_2;

/// Meaning of a collider, kept in its user data.
pub(super) mod tag {
    pub(in crate::physics) const FLOOR: u128 = 1;
    pub(in crate::physics) const TABLE: u128 = 2;
    pub(in crate::physics) const BASKET: u128 = 3;
    /// Plus the part.
    pub(in crate::physics) const ROBOT: u128 = 100;
    /// Plus the place in the scene.
    pub(in crate::physics) const OBJECT: u128 = 1000;
}

pub(super) fn to_engine(pose: &Pose) -> EnginePose {
    let turn = UnitQuaternion::from_rotation_matrix(&pose.rotation);
    let place = pose.translation.vector.cast::<f32>();
    let [x, y, z, w]: [f64; 4] = turn.coords.into();
    EnginePose::from_parts(
        Vector::new(place.x, place.y, place.z),
        rapier3d::math::Rotation::from_xyzw(x as f32, y as f32, z as f32, w as f32).normalize(),
    )
}

/// Sends a kinematic body to a pose, by the short way.
///
/// The engine takes the speed of the body from the difference of two quaternions. Both signs are the same rotation, but from
/// one to the other is a whole turn: in a step, 3 000 rad/s, and objects flew out of a hand at up to 7 m/s.
pub(super) fn send(body: &mut RigidBody, pose: &Pose) {
    let mut next = to_engine(pose);
    if next.rotation.dot(body.position().rotation) < 0.0 {
        next.rotation = -next.rotation;
    }
    body.set_next_kinematic_position(next);
}

pub(super) fn from_engine(pose: &EnginePose) -> Pose {
    let (place, turn) = (pose.translation, pose.rotation);
    let [x, y, z, w] = [turn.x, turn.y, turn.z, turn.w].map(f64::from);
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    Pose::from_parts(
        Translation3::new(f64::from(place.x), f64::from(place.y), f64::from(place.z)),
        Rotation3::from(turn),
    )
}

/// Table, baskets and floor.
pub(super) fn add_surroundings(world: &mut PhysicsWorld, scene: &Scene) {
    let table = &scene.table;
    let mut fixed = |middle: [f64; 3], edges: [f64; 3], friction: f64, tag: u128| {
        let [x, y, z] = edges.map(|edge| (edge / 2.0) as f32);
        let collider = ColliderBuilder::cuboid(x, y, z)
            .translation(Vector::from(middle.map(|value| value as f32)))
            .friction(friction as f32)
            .friction_combine_rule(CoefficientCombineRule::Min)
            .collision_groups(groups(WORLD, Group::ALL))
            .user_data(tag);
        world.insert_collider(collider, None);
    };
    let span = |[from, to]: [f64; 2]| ((from + to) / 2.0, to - from);
    let ((x, length), (y, width)) = (span(table.x), span(table.y));
    fixed(
        [x, y, table.surface - TABLE_THICKNESS / 2.0],
        [length, width, TABLE_THICKNESS],
        table.friction,
        tag::TABLE,
    );
    fixed(
        [0.0, 0.0, table.surface - FLOOR - 0.05],
        [6.0, 6.0, 0.1],
        0.5,
        tag::FLOOR,
    );
    for basket in &scene.baskets {
        for (middle, edges) in basket.walls() {
            fixed(middle, edges, f64::from(BASKET), tag::BASKET);
        }
    }
}

fn groups(member: Group, with: Group) -> InteractionGroups {
    InteractionGroups::new(member, with, InteractionTestMode::And)
}

pub(super) fn add_object(
    world: &mut PhysicsWorld,
    object: &Object,
    index: usize,
) -> RigidBodyHandle {
    let body = RigidBodyBuilder::dynamic().pose(to_engine(&object.pose));
    let collider: Collider = shape(&object.shape)
        .mass(object.mass as f32)
        .friction(object.friction as f32)
        .friction_combine_rule(CoefficientCombineRule::Min)
        .collision_groups(groups(WORLD, Group::ALL))
        .user_data(tag::OBJECT + index as u128)
        .build();
    world.insert(body, collider).0
}

fn shape(shape: &Shape) -> ColliderBuilder {
    match *shape {
        // A cup is grasped from outside: it is solid here.
        Shape::Glass { radius, height, .. } | Shape::Plate { radius, height } => {
            ColliderBuilder::cylinder(height as f32 / 2.0, radius as f32)
                // The engine's cylinders are along y.
                .rotation(Vector::new(std::f32::consts::FRAC_PI_2, 0.0, 0.0))
        }
        Shape::Prism { side, height } => {
            let corners = Shape::triangle(side).into_iter().flat_map(|[x, y]| {
                [-0.5, 0.5].map(|end| Vector::new(x as f32, y as f32, (height * end) as f32))
            });
            let corners: Vec<Vector> = corners.collect();
            let edge = side as f32 / 2.0;
            // Six corners that are not in a plane have a hull.
            ColliderBuilder::convex_hull(&corners)
                .unwrap_or_else(|| ColliderBuilder::cuboid(edge, edge, height as f32 / 2.0))
        }
        Shape::Box { .. } | Shape::Brick { .. } | Shape::Board { .. } | Shape::Clutter { .. } => {
            let [x, y, z] = shape.extent().map(|edge| (edge / 2.0) as f32);
            ColliderBuilder::cuboid(x, y, z)
        }
    }
}

/// A body for each part of the robot that has a solid.
pub(super) fn add_robot(
    world: &mut PhysicsWorld,
    frames: &[Pose; PARTS],
    posture: &RobotPosture,
) -> [Option<RigidBodyHandle>; PARTS] {
    let mut parts = [None; PARTS];
    for solid in simulated_robot::solids(posture.hand.is_some()) {
        let body = *parts[solid.part].get_or_insert_with(|| {
            let body =
                RigidBodyBuilder::kinematic_position_based().pose(to_engine(&frames[solid.part]));
            world.insert_body(body)
        });
        let point = |point: nalgebra::Point3<f64>| {
            Vector::new(point.x as f32, point.y as f32, point.z as f32)
        };
        let shapes = match simulated_robot::finger_of(solid.part) {
            Some((_, OUTER_LINK)) => (0..TIP_BALLS)
                .map(|index| {
                    let share = index as f64 / (TIP_BALLS - 1) as f64;
                    let middle = solid.from + (solid.to - solid.from) * share;
                    ColliderBuilder::ball(solid.radius as f32).translation(point(middle))
                })
                .collect(),
            _ => vec![ColliderBuilder::capsule_from_endpoints(
                point(solid.from),
                point(solid.to),
                solid.radius as f32,
            )],
        };
        for shape in shapes {
            let collider = shape
                .friction(RUBBER)
                .friction_combine_rule(CoefficientCombineRule::Min)
                .collision_groups(groups(ROBOT, WORLD))
                .active_collision_types(
                    ActiveCollisionTypes::default() | ActiveCollisionTypes::KINEMATIC_FIXED,
                )
                .user_data(tag::ROBOT + solid.part as u128);
            world.insert_collider(collider, Some(body));
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sign of a body's quaternion changed while it turned, and the body threw what it held.
    #[test]
    fn a_kinematic_body_turns_as_fast_as_it_was_sent() {
        let mut world = PhysicsWorld::default();
        let body = RigidBodyBuilder::kinematic_position_based().build();
        let body = world.insert_body(body);
        world.integration_parameters.dt = 0.002;
        let axis = nalgebra::Unit::new_normalize(nalgebra::Vector3::new(1.0, 1.0, 0.1));
        // Two turns in steps of 0.01 rad: 5 rad/s.
        for step in 0..1257 {
            let turn = Rotation3::from_axis_angle(&axis, 0.01 * f64::from(step));
            send(
                &mut world.bodies[body],
                &Pose::from_parts(Translation3::identity(), turn),
            );
            world.step();
            let speed = world.bodies[body].angvel().length();
            assert!(step == 0 || (speed - 5.0).abs() < 0.1, "{step}: {speed}");
        }
    }

    #[test]
    fn poses_survive_the_engine() {
        let pose = Pose::from_parts(
            Translation3::new(0.1, -0.2, 0.3),
            Rotation3::from_euler_angles(0.4, -1.0, 2.5),
        );
        let back = from_engine(&to_engine(&pose));
        assert!((back.translation.vector - pose.translation.vector).norm() < 1e-6);
        assert!(back.rotation.angle_to(&pose.rotation) < 1e-5);
    }
}
