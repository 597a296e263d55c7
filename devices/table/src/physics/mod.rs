//! Rigid bodies: objects, table and baskets at rest or falling, arm and hand where their devices say.
//!
//! | file | what it is about |
//! | --- | --- |
//! | `mod` | [`Physics`]: the world and one step of it |
//! | `bodies` | shapes, masses and friction |
//! | `contact_forces` | forces between robot and world, joint torques and finger loads |
//! | `rolling_resistance` | damping of cylinders that roll on a rim |
//! | `path_check` | [`PathCheck`]: collisions of an arm along a path, for judging planners |
//!
//! The robot's parts move as their devices tell (kinematic bodies), so objects feel them as they are; what objects, table
//! and baskets do to them comes back as torques and loads one step later. Contact and friction alone hold an object.

mod bodies;
mod contact_forces;
mod path_check;
mod rolling_resistance;

use std::time::Duration;

use rapier3d::prelude::{PhysicsWorld, RigidBodyHandle, SpringCoefficients};
use yarp_devices::hand::finger_coupling::{self, Links};
use yarp_devices::hand::simulated::Load;
use yarp_devices::kinematics::{Chain, Joints};
use yarp_devices::wam::WamModel;

use crate::simulated_robot::{self, HandPosture, PARTS, RobotPosture};
use crate::{Pose, Scene};

pub use contact_forces::{Contact, Other};
pub use path_check::{PathCheck, Solid};

/// Time of one step: the control period of the arm.
pub const STEP: Duration = Duration::from_millis(2);
/// Steps of the solver in one of ours.
const SUBSTEPS: usize = 4;
/// m/s², as in the arm's model.
const GRAVITY: f32 = 9.805;
/// Size of usual things, m: scales the engine's tolerances.
const LENGTH: f32 = 0.1;
/// Stiffness of contacts: natural frequency in Hz of the bodies that touch, and damping ratio.
const CONTACT: (f32, f32) = (45.0, 5.0);
const CONTACT_WITH_TABLE: (f32, f32) = (60.0, 10.0);
/// Share of a new force that counts at once. What holds an object feels its inertia one step late; without this low-pass
/// a heavy object in a light wrist would swing up.
const NEW: f64 = 0.08;
/// Torque at an outer joint above which the finger gives way, Nm, how fast, counts per step, and how far: the elasticity of
/// cables and of the rubber covers. No source gives it.
const GIVES_ABOVE: f64 = 1.3;
const GIVES: f64 = 15.0;
const MOST_GIVEN: f64 = 400.0;
/// Bound of the torques of objects on the joints in one step, before the low-pass, Nm: what lifts twice the heaviest carton
/// far from the joint. The solver's forces between a squeezed object and bodies that only their devices move are noisy; the
/// last joint is so light that single steps of them would shake it beyond the limits of its motor.
const MOST_SOFT: [f64; 7] = [30.0, 30.0, 15.0, 15.0, 3.0, 3.0, 0.4];
/// Bound of the torques on joints, Nm: above what the mechanics of the arm allow (110 Nm).
const MOST: f64 = 120.0;

/// State of the robot, as its devices report it.
#[derive(Clone, Copy, Debug)]
pub struct RobotState {
    /// Joint angles, rad.
    pub joints: Joints<7>,
    /// Positions of the hand's motors, counts, and where the clutches of the fingers are disengaged; `None` without hand.
    pub hand: Option<([f64; 4], [Option<f64>; 3])>,
}

/// Effect of the world on the robot.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reaction {
    /// Torques on the joints, Nm.
    pub torques: Joints<7>,
    /// On each finger.
    pub loads: [Load; 3],
}

/// The bodies of a scene.
pub struct Physics {
    world: PhysicsWorld,
    objects: Vec<RigidBodyHandle>,
    robot: [Option<RigidBodyHandle>; PARTS],
    chain: Chain<7>,
    reaction: Reaction,
    /// Filtered torques of objects alone, Nm.
    soft: Joints<7>,
    given: [f64; 3],
    contacts: Vec<Contact>,
}

impl std::fmt::Debug for Physics {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Physics")
            .field("objects", &self.objects.len())
            .finish_non_exhaustive()
    }
}

impl Physics {
    /// Creates the bodies of a scene: its objects, and the robot if there is one, in its posture.
    pub fn new(scene: &Scene) -> Self {
        let mut world = PhysicsWorld {
            gravity: rapier3d::math::Vector::new(0.0, 0.0, -GRAVITY),
            ..PhysicsWorld::default()
        };
        let parameters = &mut world.integration_parameters;
        parameters.dt = STEP.as_secs_f32();
        parameters.num_solver_iterations = SUBSTEPS;
        parameters.length_unit = LENGTH;
        parameters.contact_softness = SpringCoefficients::new(CONTACT.0, CONTACT.1);
        parameters.static_contact_softness =
            SpringCoefficients::new(CONTACT_WITH_TABLE.0, CONTACT_WITH_TABLE.1);
        // Contacts are determined in every step: what a moving hand holds would lose its grip whenever kept ones are replaced.
        parameters.normalized_contact_recycle_distance = 0.0;
        // One friction force per contact point, which can be read back.
        parameters.friction_model = rapier3d::prelude::FrictionModel::Coulomb;
        parameters.contact_clustering = false;
        bodies::add_surroundings(&mut world, scene);
        let objects = scene
            .objects
            .iter()
            .enumerate()
            .map(|(index, object)| bodies::add_object(&mut world, object, index))
            .collect();
        let chain = WamModel::<7>::new().chain;
        let robot = match &scene.robot {
            Some(posture) => bodies::add_robot(
                &mut world,
                &simulated_robot::frames(&chain, posture),
                posture,
            ),
            None => [None; PARTS],
        };
        Self {
            world,
            objects,
            robot,
            chain,
            reaction: Reaction::default(),
            soft: Joints::<7>::zeros(),
            given: [0.0; 3],
            contacts: Vec::new(),
        }
    }

    /// Lets [`STEP`] pass: the robot goes where its devices say, and the objects' poses in the scene follow.
    pub fn step(&mut self, scene: &mut Scene, state: &RobotState) -> Reaction {
        let posture = self.posture(state);
        if scene.robot.is_some() {
            scene.robot = Some(posture);
        }
        let frames = simulated_robot::frames(&self.chain, &posture);
        for (body, frame) in self.robot.iter().zip(&frames) {
            if let Some(body) = body.and_then(|body| self.world.bodies.get_mut(body)) {
                bodies::send(body, frame);
            }
        }
        self.world.step();
        rolling_resistance::resist(&mut self.world);
        self.contacts.clear();
        let sharp = contact_forces::reaction(&self.world, &frames, &mut self.contacts);
        self.blend(&sharp);
        for (object, body) in scene.objects.iter_mut().zip(&self.objects) {
            let body = &self.world.bodies[*body];
            if !body.is_sleeping() {
                object.pose = bodies::from_engine(body.position());
            }
        }
        self.reaction
    }

    /// Returns the contacts of the robot in the last step.
    pub fn contacts(&self) -> &[Contact] {
        &self.contacts
    }

    /// Returns the speed of an object, m/s, by its place in the scene.
    pub fn speed(&self, index: usize) -> f64 {
        self.objects
            .get(index)
            .and_then(|body| self.world.bodies.get(*body))
            .map_or(0.0, |body| f64::from(body.linvel().length()))
    }

    /// Puts an object somewhere else, at rest, by its place in the scene.
    pub fn place(&mut self, scene: &mut Scene, index: usize, pose: Pose) {
        let body = self.objects.get(index);
        let Some(body) = body.and_then(|body| self.world.bodies.get_mut(*body)) else {
            return;
        };
        body.set_position(bodies::to_engine(&pose), true);
        body.set_linvel(rapier3d::math::Vector::ZERO, true);
        body.set_angvel(rapier3d::math::Vector::ZERO, true);
        scene.objects[index].pose = pose;
    }

    /// Returns where the links are: where the motors are, but for what they give way.
    fn posture(&self, state: &RobotState) -> RobotPosture {
        /// Counts of the spread per degree.
        const SPREAD: f64 = 17.5;
        RobotPosture {
            joints: state.joints,
            hand: state.hand.map(|(positions, clutches)| HandPosture {
                spread: (positions[3] / SPREAD).to_radians(),
                fingers: std::array::from_fn(|finger| {
                    let counts = (positions[finger] - self.given[finger]).max(0.0);
                    let links = finger_coupling::links(counts, clutches[finger]);
                    Links {
                        outer: links.outer.min(finger_coupling::OUTER_LIMIT + 1.0),
                        ..links
                    }
                }),
            }),
        }
    }

    fn blend(&mut self, sharp: &contact_forces::Sharp) {
        let before = self.reaction;
        // Table and baskets push as springs on what is stiff itself: there a delay would do harm.
        let bounded = Joints::<7>::from_fn(|joint, _| {
            sharp.soft[joint].clamp(-MOST_SOFT[joint], MOST_SOFT[joint])
        });
        self.soft += (bounded - self.soft) * NEW;
        self.reaction.torques = (self.soft + sharp.stiff).map(|torque| torque.clamp(-MOST, MOST));
        for finger in 0..3 {
            let (old, new) = (before.loads[finger], sharp.loads[finger]);
            let mix = |old: f64, new: f64| old + (new - old) * NEW;
            let load = Load {
                inner: mix(old.inner, new.inner),
                outer: mix(old.outer, new.outer),
            };
            self.reaction.loads[finger] = load;
            let given = &mut self.given[finger];
            if load.outer > GIVES_ABOVE {
                *given = (*given + GIVES).min(MOST_GIVEN);
            } else if load.outer < GIVES_ABOVE / 2.0 {
                *given = (*given - GIVES).max(0.0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Rotation3, Vector3};

    use super::*;
    use crate::{Finish, Shape};

    /// Returns the bodies of a glass at this height above the table, turned about x, with this angular velocity, rad/s.
    fn glass(
        [radius, height]: [f64; 2],
        above: f64,
        tilt: f64,
        turning: [f32; 3],
    ) -> (Physics, Scene) {
        let mut scene = Scene::empty();
        let wall = 0.003;
        let shape = Shape::Glass {
            radius,
            height,
            wall,
        };
        scene.put(shape, 0.5, 0.0, 0.0, Finish::default());
        let pose = &mut scene.objects[0].pose;
        pose.translation.z = scene.table.surface + above;
        pose.rotation = Rotation3::from_euler_angles(tilt, 0.0, 0.0);
        let mut physics = Physics::new(&scene);
        let body = physics.objects[0];
        physics.world.bodies[body].set_angvel(turning.into(), true);
        (physics, scene)
    }

    /// Lets time pass and returns the largest tilt of the glass in it, rad.
    fn largest_tilt(physics: &mut Physics, scene: &mut Scene, seconds: f64) -> f64 {
        let state = RobotState {
            joints: Joints::<7>::zeros(),
            hand: None,
        };
        let steps = (seconds / STEP.as_secs_f64()) as usize;
        let mut largest = 0.0_f64;
        for _ in 0..steps {
            physics.step(scene, &state);
            let up = scene.objects[0].pose.rotation * Vector3::z();
            largest = largest.max(up.z.clamp(-1.0, 1.0).acos());
        }
        largest
    }

    /// The engine gave it energy until it fell over.
    #[test]
    fn a_glass_that_rolls_on_its_rim_comes_to_rest() {
        for size @ [radius, height] in [[0.030, 0.150], [0.034, 0.11], [0.042, 0.08]] {
            for tilt in [0.03, 0.06, 0.12] {
                for turn in [0.0, 0.5, 2.0] {
                    let above = height / 2.0 + radius * tilt + 0.002;
                    let (mut physics, mut scene) =
                        glass(size, above, tilt, [0.0, turn / 2.0, turn]);
                    let what = format!("{size:?}, tilt {tilt}, turn {turn}");
                    let most = largest_tilt(&mut physics, &mut scene, 4.0);
                    assert!(most < tilt + 0.03, "{what}: {most}");
                    let end = largest_tilt(&mut physics, &mut scene, 0.2);
                    assert!(end < 0.003, "{what}: {end}");
                }
            }
        }
    }

    #[test]
    fn a_glass_on_its_side_rolls_on() {
        let radius = 0.034;
        let side = std::f64::consts::FRAC_PI_2;
        let (mut physics, mut scene) = glass([radius, 0.11], radius + 1e-4, side, [0.0, 5.0, 0.0]);
        let body = physics.objects[0];
        physics.world.bodies[body].set_linvel([5.0 * radius as f32, 0.0, 0.0].into(), true);
        largest_tilt(&mut physics, &mut scene, 1.0);
        let rolled = scene.objects[0].pose.translation.x - 0.5;
        // Without resistance 0.17 m.
        assert!(rolled > 0.14, "{rolled}");
    }
}
