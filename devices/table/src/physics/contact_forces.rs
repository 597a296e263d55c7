//! Forces between the robot and the world.

use nalgebra::{Point3, Vector3};
use rapier3d::geometry::{Collider, ContactManifold, ContactPair};
use rapier3d::math::Vector;
use rapier3d::prelude::PhysicsWorld;
use yarp_devices::hand::simulated::Load;
use yarp_devices::kinematics::Joints;

use super::bodies::tag;
use crate::Pose;
use crate::simulated_robot::{self, PALM, PARTS};

/// Stiffness and damping of the robot against table and baskets, N/m and N s/m; no source gives them. Both are as large
/// as a step of 2 ms allows for a wrist.
const STIFFNESS: f64 = 10_000.0;
const DAMPING: f64 = 60.0;
/// Friction of the robot on table and baskets, and the speed at which it is fully there, m/s.
const FRICTION: f64 = 0.5;
const SLIDING: f64 = 0.02;

/// The counterpart of a contact of the robot.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Other {
    /// The table, or the floor of the room.
    Table,
    /// A basket.
    Basket,
    /// An object, by its place in the scene.
    Object(usize),
}

/// A contact of the robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Part of the robot: see [`robot`](crate::simulated_robot).
    pub part: usize,
    /// The counterpart.
    pub other: Other,
    /// Position, m.
    pub point: Point3<f64>,
    /// Force on the robot, N.
    pub force: Vector3<f64>,
}

/// Sum of the contacts of one step, unfiltered.
#[derive(Debug, Default)]
pub(super) struct Sharp {
    /// Joint torques from table and baskets, Nm.
    pub(super) stiff: Joints<7>,
    /// Joint torques from objects.
    pub(super) soft: Joints<7>,
    pub(super) loads: [Load; 3],
}

/// Adds up all contacts of the robot.
pub(super) fn reaction(
    world: &PhysicsWorld,
    frames: &[Pose; PARTS],
    contacts: &mut Vec<Contact>,
) -> Sharp {
    for pair in world.narrow_phase.contact_pairs() {
        let first = &world.colliders[pair.collider1];
        let second = &world.colliders[pair.collider2];
        match (part_of(first), part_of(second)) {
            (Some(part), None) => collect(world, pair, part, true, [first, second], contacts),
            (None, Some(part)) => collect(world, pair, part, false, [first, second], contacts),
            _ => {}
        }
    }
    let mut sharp = Sharp::default();
    for contact in contacts.iter() {
        let torques = joint_torques(frames, contact);
        match contact.other {
            Other::Object(_) => sharp.soft += torques,
            Other::Table | Other::Basket => sharp.stiff += torques,
        }
        if let Some((finger, link)) = simulated_robot::finger_of(contact.part) {
            add_load(&mut sharp.loads[finger], frames, finger, link, contact);
        }
    }
    sharp
}

fn part_of(collider: &Collider) -> Option<usize> {
    (tag::ROBOT..tag::OBJECT)
        .contains(&collider.user_data)
        .then(|| (collider.user_data - tag::ROBOT) as usize)
}

fn collect(
    world: &PhysicsWorld,
    pair: &ContactPair,
    part: usize,
    robot_is_first: bool,
    colliders: [&Collider; 2],
    contacts: &mut Vec<Contact>,
) {
    let other = colliders[usize::from(robot_is_first)];
    let other = match other.user_data {
        tag::FLOOR | tag::TABLE => Other::Table,
        tag::BASKET => Other::Basket,
        object => Other::Object((object - tag::OBJECT) as usize),
    };
    let manifolds = match other {
        Other::Object(_) => pair.solver_manifolds(),
        _ => pair.manifolds(),
    };
    for manifold in manifolds {
        for index in 0..manifold.points.len() {
            let force = match other {
                Other::Object(_) => solved(world, manifold, index, robot_is_first),
                _ => penalty(world, manifold, index, robot_is_first, colliders),
            };
            if let Some(force) = force {
                let point = colliders[0].position() * manifold.points[index].local_p1;
                contacts.push(Contact {
                    part,
                    other,
                    point: Point3::from(wide(point)),
                    force,
                });
            }
        }
    }
}

fn wide(vector: Vector) -> Vector3<f64> {
    Vector3::new(vector.x, vector.y, vector.z).cast()
}

/// The force that the solver found: its impulses are those of the last substep.
fn solved(
    world: &PhysicsWorld,
    manifold: &ContactManifold,
    index: usize,
    robot_is_first: bool,
) -> Option<Vector3<f64>> {
    let data = &manifold.points[index].data;
    if data.warmstart_impulse <= 0.0 {
        return None;
    }
    let parameters = &world.integration_parameters;
    let seconds = f64::from(parameters.dt) / parameters.num_solver_iterations as f64;
    // The normal is from the first to the second; both impulses are on the first.
    let on_first = wide(data.warmstart_tangent_world)
        - wide(manifold.data.normal) * f64::from(data.warmstart_impulse);
    let sign = if robot_is_first { 1.0 } else { -1.0 };
    Some(on_first * (sign / seconds))
}

/// The force of a spring, a damper and friction.
fn penalty(
    world: &PhysicsWorld,
    manifold: &ContactManifold,
    index: usize,
    robot_is_first: bool,
    colliders: [&Collider; 2],
) -> Option<Vector3<f64>> {
    let contact = &manifold.points[index];
    if contact.dist >= 0.0 {
        return None;
    }
    let first = colliders[0].position();
    // From the world to the robot.
    let sign = if robot_is_first { -1.0 } else { 1.0 };
    let normal = wide(first.rotation * manifold.local_n1) * sign;
    let point = first * contact.local_p1;
    let robot = colliders[usize::from(!robot_is_first)].parent()?;
    let speed = wide(world.bodies.get(robot)?.velocity_at_point(point));
    let approach = -speed.dot(&normal);
    let push = STIFFNESS * f64::from(-contact.dist) + DAMPING * approach;
    let share = push.max(0.0) / manifold.points.len() as f64;
    let along = speed + normal * approach;
    let drag = along * (-FRICTION * share / along.norm().max(SLIDING));
    Some(normal * share + drag)
}

/// The torques of a contact on the joints of the arm.
fn joint_torques(frames: &[Pose; PARTS], contact: &Contact) -> Joints<7> {
    let moved = contact.part.min(PALM);
    let mut torques = Joints::<7>::zeros();
    for joint in 0..moved {
        // Joint n turns about z of the frame before its link; frame 0 is the base.
        let frame = &frames[joint];
        torques[joint] = moment(frame, contact);
    }
    torques
}

/// The moment of a contact about the z axis of a frame.
fn moment(frame: &Pose, contact: &Contact) -> f64 {
    let arm = contact.point.coords - frame.translation.vector;
    (frame.rotation * Vector3::z()).dot(&arm.cross(&contact.force))
}

/// Closing turns positively about z of the inner and of the outer frame.
fn add_load(
    load: &mut Load,
    frames: &[Pose; PARTS],
    finger: usize,
    link: usize,
    contact: &Contact,
) {
    let frame = |link: usize| &frames[8 + 3 * finger + link];
    if link >= 1 {
        load.inner -= moment(frame(1), contact);
    }
    if link == 2 {
        load.outer -= moment(frame(2), contact);
    }
}
