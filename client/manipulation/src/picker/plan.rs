//! Plans of one object: grasp, straight lines, and motions between them.

use std::f64::consts::{PI, TAU};

use nalgebra::{Point3, Rotation3, Vector3};
use yarp_devices::hand::FingerJoints;
use yarp_devices::kinematics::{Joints, Pose};
use yarp_devices::trajectory::JointLimits;
use yarp_planning::{
    ArmGeometry, CollisionModel, LinkSphere, Path, Planner, PlannerOptions, Scene, Trajectory,
};

use super::motion::Motion;
use super::{PickError, Picker, PlanFailure, Step, UNFOLDED};
use crate::filling::{Filling, Spot, half_extent};
use crate::grasp::{Grasp, finger_joints, grasps};
use crate::item::{Item, ItemShape};
use crate::workcell::Workcell;

/// Distance that the straight approach keeps from the table and other objects, m.
const APPROACH_MARGIN: f64 = 0.0;
/// Length of the straight approach, m, and lower ones where the arm does not reach so high.
const LIFTS: [f64; 5] = [0.20, 0.15, 0.12, 0.09, 0.06];
/// Length of a step of a straight line, m.
const LINE_STEP: f64 = 0.02;
/// Height of a held object's bottom above the rim of the container when it is released, m.
const RELEASE_HEIGHT: f64 = 0.022;
/// Height of a held object's bottom above the table when it is set down, m: the arm may be so much lower than its set point.
const SET_DOWN_HEIGHT: f64 = 0.003;
/// Number of directions of the hand above a container.
const RELEASE_DIRECTIONS: u32 = 8;
/// Number of directions in which the sides of an object are along the walls.
const ALIGNED_DIRECTIONS: u32 = 4;
/// Number of directions and places that are goals of one plan, and maximum number of plans for a release.
const RELEASES_AT_ONCE: usize = 8;
const MAX_RELEASE_PLANS: usize = 6;
/// Length of the motion up from beside an object, m, and lower ones where the arm does not reach so high.
const BACK_UPS: [f64; 3] = [0.20, 0.12, 0.06];
/// Position of fingers that point straight down, counts.
const STEEP_FINGERS: i32 = 8000;
/// Openings of the fingers that are tried, as parts of the usual one.
const OPENINGS: [f64; 3] = [1.0, 0.65, 0.4];
/// Distance of the palm's middle to the outside of the fingers beside an object, m.
const FINGER_ROOM: f64 = 0.05;
/// Step of the posture in which an unfolding motion is examined, rad, and how much nearer than before it may come to anything, m.
const UNFOLDING_STEP: f64 = 0.02;
const UNFOLDING_TOLERANCE: f64 = 0.001;
/// Steps of fingers and spread in which shapes between two others are examined, counts: 12 degrees each, which moves a fingertip by 30 mm.
const SHAPE_STEP_FINGER: f64 = 1500.0;
const SHAPE_STEP_SPREAD: f64 = 210.0;
/// Number of postures per grasp for which a straight approach is tried.
const POSTURES: usize = 4;
/// Largest and smallest radius of the spheres that stand for a held object, m.
const HELD_RADIUS: [f64; 2] = [0.02, 0.008];

/// A plan of picking one object.
#[derive(Debug)]
pub(super) struct PickPlan {
    pub(super) grasp: Grasp,
    pub(super) line: Line,
}

/// A plan of setting a held object down on the table.
#[derive(Debug)]
pub(super) struct SetDownPlan {
    pub(super) transport: Motion,
    pub(super) line: Line,
}

/// A straight motion down to a pose of the hand, and up again.
#[derive(Debug)]
pub(super) struct Line {
    /// Posture at its upper end.
    above: Joints<7>,
    pub(super) down: Motion,
    pub(super) up: Motion,
}

impl<W: Workcell> Picker<W> {
    /// Chooses a grasp that can be reached.
    pub(super) fn plan_pick(
        &mut self,
        item: &Item,
        others: &[Item],
        first: usize,
    ) -> Result<PickPlan, PickError> {
        let mut count = 0;
        let mut last = None;
        // What stands close together leaves less room for the fingers.
        let mut scripted = self.scripts.grasps(item, &self.options.grasp);
        for narrower in OPENINGS {
            let mut options = self.options.grasp;
            options.opening *= narrower;
            let mut all = std::mem::take(&mut scripted);
            all.extend(grasps(item, &options));
            count += all.len();
            let number = all.len();
            for grasp in all.into_iter().cycle().skip(first).take(number) {
                match self.plan_grasp(item, others, grasp) {
                    Ok(plan) => return Ok(plan),
                    Err(failure) => last = Some(failure),
                }
            }
        }
        let item = item.label.clone();
        Err(match last {
            Some(last) => PickError::Unreachable { item, count, last },
            None => PickError::NoGrasp { item },
        })
    }

    fn plan_grasp(
        &mut self,
        item: &Item,
        others: &[Item],
        grasp: Grasp,
    ) -> Result<PickPlan, PlanFailure> {
        let geometry = ArmGeometry::wam_with_hand(&grasp.fingers());
        let near = self.collisions(geometry.clone(), self.scene(others));
        let near = near.with_margin(APPROACH_MARGIN);
        let around = self.scene(others.iter().chain([item]));
        let far = self.collisions(geometry, around);
        let hand = grasp.hand;
        let line = self.plan_line(&hand, &near, &far)?;
        Ok(PickPlan { grasp, line })
    }

    /// Plans a straight motion to a pose of the hand: free in `near` all along, and in `far` at its upper end.
    fn plan_line(
        &mut self,
        hand: &Pose,
        near: &CollisionModel,
        far: &CollisionModel,
    ) -> Result<Line, PlanFailure> {
        let postures = self.solver.postures(hand, &self.at, near)?;
        for posture in postures.iter().take(POSTURES) {
            for lift in LIFTS {
                let mut above = *hand;
                above.translation.z += lift;
                let steps = (lift / LINE_STEP).ceil() as usize;
                let Some(line) = self.solver.line(posture, &above, steps) else {
                    continue;
                };
                let mut up = vec![*posture];
                up.extend(line);
                let ends_free = up.last().is_some_and(|last| far.is_free(last));
                let free = ends_free
                    && up
                        .windows(2)
                        .all(|pair| near.is_motion_free(&pair[0], &pair[1]));
                if !free {
                    continue;
                }
                let above = up[up.len() - 1];
                let down: Vec<Joints<7>> = up.iter().rev().copied().collect();
                let (Some(up), Some(down)) = (self.timed(up), self.timed(down)) else {
                    continue;
                };
                return Ok(Line { above, down, up });
            }
        }
        Err(PlanFailure::NoLine)
    }

    /// Plans the motion to the place above the object.
    pub(super) fn plan_transit(
        &mut self,
        item: &Item,
        others: &[Item],
        plan: &PickPlan,
    ) -> Result<Motion, PickError> {
        let geometry = ArmGeometry::wam_with_hand(&plan.grasp.fingers());
        let scene = self.scene(others.iter().chain([item]));
        self.plan_motion(geometry, scene, &[plan.line.above])
            .map_err(|source| PickError::Plan {
                step: Step::PreGrasp,
                source,
            })
    }

    /// Returns whether the hand may change its shape anywhere on this way to a grasp: from these positions of the motors to open
    /// fingers, another spread and the fingers of the grasp.
    pub(super) fn has_room_to_shape<'a>(
        &self,
        transit: &Motion,
        before: &[f64; 4],
        grasp: &Grasp,
        items: impl IntoIterator<Item = &'a Item>,
    ) -> bool {
        let scene = self.scene(items);
        let postures = transit.postures();
        shapes_between(before, grasp).iter().all(|fingers| {
            let geometry = ArmGeometry::wam_with_hand(fingers);
            let model = self.collisions(geometry, scene.clone());
            let is_free = |pair: &[Joints<7>]| model.is_motion_free(&pair[0], &pair[1]);
            postures.windows(2).all(is_free)
        })
    }

    /// Plans the motion of a held object to the place in the container where what is there is lowest.
    pub(super) fn plan_transport(
        &mut self,
        item: &Item,
        others: &[Item],
        grasp: &Grasp,
        container: usize,
    ) -> Result<(Motion, Spot), PickError> {
        let step = Step::Transport;
        let mut geometry = ArmGeometry::wam_with_hand(&grasp.fingers());
        for sphere in held(item, grasp) {
            geometry = geometry.with_sphere(sphere);
        }
        let scene = self.scene(others);
        let model = self.collisions(geometry.clone(), scene.clone());
        let filling = &self.fillings[container].clone();
        let mut last = PlanFailure::NoLine;
        let releases = releases(item, filling);
        for some in releases.chunks(RELEASES_AT_ONCE).take(MAX_RELEASE_PLANS) {
            let mut goals: Vec<(Joints<7>, Spot)> = Vec::new();
            for (angle, spot) in some {
                let target = release_pose(item, grasp, filling, *angle, spot);
                match self.solver.postures(&target, &self.at, &model) {
                    Ok(postures) => {
                        goals.extend(postures.iter().take(2).map(|goal| (*goal, *spot)))
                    }
                    Err(error) => last = error.into(),
                }
            }
            // The planner tries straight motions in this order.
            goals.sort_by(|one, other| {
                let distance = |goal: &Joints<7>| (goal - self.at).norm();
                distance(&one.0).total_cmp(&distance(&other.0))
            });
            if goals.is_empty() {
                continue;
            }
            let postures: Vec<Joints<7>> = goals.iter().map(|goal| goal.0).collect();
            match self.plan_motion(geometry.clone(), scene.clone(), &postures) {
                Ok(motion) => {
                    let end = motion.end();
                    let away = |goal: &Joints<7>| (goal - end).norm();
                    goals.sort_by(|one, other| away(&one.0).total_cmp(&away(&other.0)));
                    return Ok((motion, goals[0].1));
                }
                Err(error) => last = error,
            }
        }
        Err(PickError::Plan { step, source: last })
    }

    /// Plans the motions of a held object to a place on the table, in the first direction in which there are any.
    pub(super) fn plan_set_down(
        &mut self,
        item: &Item,
        others: &[Item],
        grasp: &Grasp,
        place: [f64; 2],
    ) -> Result<SetDownPlan, PickError> {
        let mut held_geometry = ArmGeometry::wam_with_hand(&grasp.fingers());
        for sphere in held(item, grasp) {
            held_geometry = held_geometry.with_sphere(sphere);
        }
        let scene = self.scene(others);
        let near = self.collisions(held_geometry.clone(), scene.clone());
        let near = near.with_margin(APPROACH_MARGIN);
        let far = self.collisions(held_geometry.clone(), scene.clone());
        let mut last = PlanFailure::NoLine;
        for turn in set_down_turns(item) {
            let hand = set_down_pose(item, grasp, place, turn);
            let line = match self.plan_line(&hand, &near, &far) {
                Ok(line) => line,
                Err(failure) => {
                    last = failure;
                    continue;
                }
            };
            match self.plan_motion(held_geometry.clone(), scene.clone(), &[line.above]) {
                Ok(transport) => return Ok(SetDownPlan { transport, line }),
                Err(failure) => last = failure,
            }
        }
        let step = Step::Transport;
        Err(PickError::Plan { step, source: last })
    }

    /// Plans a straight motion out of a posture in which the arm is nearer to itself than planned motions begin; `None` if it is
    /// in no such posture, or would come nearer to anything on the way.
    pub(super) fn plan_unfold(&self, items: &[Item]) -> Option<Motion> {
        let itself = self.collisions(self.open_hand(), Scene::default());
        if itself.is_free(&self.at) {
            return None;
        }
        let unfolded = Joints::<7>::from(UNFOLDED);
        let around = self.collisions(self.open_hand(), self.scene(items));
        let least = around.clearance(&self.at) - UNFOLDING_TOLERANCE;
        let away = unfolded - self.at;
        let steps = (away.amax() / UNFOLDING_STEP).ceil();
        let goes_apart = (1..=steps as usize)
            .map(|step| self.at + away * (step as f64 / steps))
            .all(|posture| around.clearance(&posture) >= least);
        match goes_apart {
            true => self.timed(vec![self.at, unfolded]),
            false => None,
        }
    }

    /// Plans a motion straight up, out of the margin of the objects; `None` if the arm is free or cannot go up.
    pub(super) fn plan_back_up(&self, items: &[Item]) -> Option<Motion> {
        // The fingers are not always open: those that point down reach farthest.
        let down = [finger_joints(f64::from(STEEP_FINGERS), f64::from(self.spread)); 3];
        let geometries = [self.open_hand(), ArmGeometry::wam_with_hand(&down)];
        let models = geometries.map(|geometry| self.collisions(geometry, self.scene(items)));
        let is_free = |posture: &Joints<7>| models.iter().all(|model| model.is_free(posture));
        if is_free(&self.at) {
            return None;
        }
        BACK_UPS.into_iter().find_map(|height| {
            let mut above = self.model.chain.forward(&self.at);
            above.translation.z += height;
            let steps = (height / LINE_STEP).ceil() as usize;
            let line = self.solver.line(&self.at, &above, steps)?;
            let free = line.iter().position(is_free)?;
            let mut postures = vec![self.at];
            postures.extend_from_slice(&line[..=free]);
            self.timed(postures)
        })
    }

    /// Plans a motion with an empty hand.
    pub(super) fn plan_retreat(
        &mut self,
        items: &[Item],
        to: &Joints<7>,
    ) -> Result<Motion, PlanFailure> {
        let scene = self.scene(items);
        self.plan_motion(self.open_hand(), scene, &[*to])
    }

    /// Returns table, containers with what piles up beyond their rims, and these objects as obstacles.
    fn scene<'a>(&self, items: impl IntoIterator<Item = &'a Item>) -> Scene {
        let mut scene = self.surroundings.scene(items);
        for filling in &self.fillings {
            for obstacle in filling.obstacles(filling.container().size[2]) {
                scene.add(obstacle);
            }
        }
        scene
    }

    fn open_hand(&self) -> ArmGeometry {
        ArmGeometry::wam_with_hand(&[finger_joints(0.0, f64::from(self.spread)); 3])
    }

    fn plan_motion(
        &mut self,
        geometry: ArmGeometry,
        scene: Scene,
        goals: &[Joints<7>],
    ) -> Result<Motion, PlanFailure> {
        let mut options = PlannerOptions::default();
        options.limits = self.limits();
        self.plans += 1;
        options.seed = self
            .options
            .seed
            .wrapping_mul(1_000_003)
            .wrapping_add(self.plans);
        let mut planner =
            Planner::with_geometry(&self.model, geometry, scene).with_options(options);
        let path = planner.plan(&self.at, goals)?;
        let trajectory = planner.trajectory(&path).map_err(|_| PlanFailure::NoLine)?;
        Ok(self.motion(trajectory))
    }

    pub(super) fn timed(&self, postures: Vec<Joints<7>>) -> Option<Motion> {
        let path = Path::through(postures)?;
        let trajectory = Trajectory::new(&path, &self.limits()).ok()?;
        Some(self.motion(trajectory))
    }

    fn limits(&self) -> JointLimits<7> {
        JointLimits::uniform(self.options.joint_speed, self.options.joint_acceleration)
    }

    fn collisions(&self, geometry: ArmGeometry, scene: Scene) -> CollisionModel {
        CollisionModel::new(&self.model.chain, geometry, scene)
    }
}

/// Returns shapes of the hand between these positions of its motors and a grasp: the fingers open, the spread turns, the fingers
/// close a little.
fn shapes_between(before: &[f64; 4], grasp: &Grasp) -> Vec<[FingerJoints; 3]> {
    let [one, two, three, spread] = *before;
    let (open, turned) = (f64::from(grasp.open), f64::from(grasp.spread));
    let parts = |length: f64, step: f64| {
        let count = (length.abs() / step).ceil().max(1.0) as u32;
        (0..=count).map(move |index| f64::from(index) / f64::from(count))
    };
    let mut shapes = Vec::new();
    for part in parts(one.max(two).max(three), SHAPE_STEP_FINGER) {
        shapes.push([one, two, three].map(|finger| finger_joints(finger * part, spread)));
    }
    for part in parts(turned - spread, SHAPE_STEP_SPREAD) {
        shapes.push([finger_joints(0.0, spread + (turned - spread) * part); 3]);
    }
    for part in parts(open, SHAPE_STEP_FINGER) {
        shapes.push([finger_joints(open * part, turned); 3]);
    }
    shapes
}

/// Returns turns about the vertical after which the sides of an item are along x and y, rad; the least turn first.
fn set_down_turns(item: &Item) -> Vec<f64> {
    let (directions, begin) = match item.shape {
        ItemShape::Cylinder { .. } => (RELEASE_DIRECTIONS, 0.0),
        ItemShape::Cuboid { .. } | ItemShape::Prism { .. } => (ALIGNED_DIRECTIONS, -item.yaw()),
    };
    let turn = |direction| begin + TAU * f64::from(direction) / f64::from(directions);
    let centred = |angle: f64| (angle + PI).rem_euclid(TAU) - PI;
    let mut turns: Vec<f64> = (0..directions).map(turn).map(centred).collect();
    turns.sort_by(|one, other| one.abs().total_cmp(&other.abs()));
    turns
}

/// Returns the pose of the hand in which it sets an item down, turned by `turn` about the vertical.
fn set_down_pose(item: &Item, grasp: &Grasp, place: [f64; 2], turn: f64) -> Pose {
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), turn);
    let beside = turn * (grasp.hand.translation.vector - item.pose.translation.vector);
    let middle = Vector3::new(place[0], place[1], item.pose.translation.z);
    let hand = middle + beside + Vector3::new(0.0, 0.0, SET_DOWN_HEIGHT);
    Pose::from_parts(hand.into(), turn * grasp.hand.rotation)
}

/// Returns directions and places of a release, rad about the vertical, the lowest places first.
fn releases(item: &Item, filling: &Filling) -> Vec<(f64, Spot)> {
    let mut all = Vec::new();
    // Along the walls, where objects lie close to each other; only what is round fits as well in other directions.
    let (directions, begin) = match item.shape {
        ItemShape::Cylinder { .. } => (RELEASE_DIRECTIONS, 0.0),
        ItemShape::Cuboid { .. } | ItemShape::Prism { .. } => (ALIGNED_DIRECTIONS, -item.yaw()),
    };
    for direction in 0..directions {
        let angle = begin + TAU * f64::from(direction) / f64::from(directions);
        let spots = filling.spots(half_extent(item, angle));
        // One of each direction in turn among those that are equally low.
        all.extend(
            spots
                .into_iter()
                .enumerate()
                .map(|(rank, spot)| (rank, angle, spot)),
        );
    }
    if all.is_empty() {
        // It is longer than the container: across the rim is better than nowhere.
        let spot = Spot {
            offset: [0.0; 2],
            half: half_extent(item, 0.0),
            level: 0.0,
        };
        all.push((0, 0.0, spot));
    }
    all.sort_by(|one, other| {
        let levels = one.2.level.total_cmp(&other.2.level);
        levels.then(one.0.cmp(&other.0))
    });
    all.into_iter()
        .map(|(_, angle, spot)| (angle, spot))
        .collect()
}

/// Returns the pose of the hand in which it releases an item.
fn release_pose(item: &Item, grasp: &Grasp, filling: &Filling, angle: f64, spot: &Spot) -> Pose {
    let container = filling.container();
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), angle);
    let bottom = item.pose.translation.z - item.shape.height() / 2.0;
    let room = spot.half.map(|half| half + FINGER_ROOM);
    let around = container.bottom[2] + filling.level(spot.offset, room);
    let tips = grasp.hand.translation.z - grasp.depth - bottom;
    // Fingertips beside a tall object are above its bottom, and clear of what is around it sooner.
    let under = container.bottom[2] + spot.level;
    let below = container.rim().max(under).max(around - tips);
    // The object's middle comes to the spot, beside which the hand may be.
    let beside = grasp.hand.translation.vector - item.pose.translation.vector;
    let beside = turn * Vector3::new(beside.x, beside.y, 0.0);
    let place = Vector3::new(
        container.bottom[0] + spot.offset[0] + beside.x,
        container.bottom[1] + spot.offset[1] + beside.y,
        below + RELEASE_HEIGHT + (grasp.hand.translation.z - bottom),
    );
    Pose::from_parts(place.into(), turn * grasp.hand.rotation)
}

/// Returns spheres for the surface of a held object, in the frame of the hand.
fn held(item: &Item, grasp: &Grasp) -> Vec<LinkSphere> {
    let into_hand = grasp.hand.inverse() * item.pose;
    let (radius, height) = (item.shape.radius(), item.shape.height());
    let size = (height / 2.0).clamp(HELD_RADIUS[1], HELD_RADIUS[0]);
    let ring = (radius - size).max(0.0);
    // From the bottom to the top of the object, and not beyond: it is set down on the table.
    let end = (height / 2.0 - size).max(0.0);
    let levels = (2.0 * end / (1.5 * size)).ceil() as usize;
    let around = ((TAU * ring / (3.0 * size)).ceil() as usize).max(1);
    let mut spheres = Vec::new();
    for level in 0..=levels {
        let z = end * (2.0 * level as f64 / levels.max(1) as f64 - 1.0);
        let mut add = |x: f64, y: f64, radius: f64| {
            spheres.push(LinkSphere {
                link: 7,
                center: into_hand * Point3::new(x, y, z),
                radius,
            });
        };
        if let ItemShape::Cuboid {
            size: [long, wide, _],
        } = item.shape
        {
            // Along its edges; a cylinder would be much wider.
            let ball = size.min(long / 2.0).min(wide / 2.0);
            let ends = [long / 2.0 - ball, wide / 2.0 - ball];
            let number = |end: f64| ((2.0 * end / (1.5 * ball)).ceil() as usize).max(1);
            let counts = ends.map(number);
            for row in 0..=counts[0] {
                for column in 0..=counts[1] {
                    let edge = row == 0 || row == counts[0] || column == 0 || column == counts[1];
                    if edge {
                        let part = |index: usize, axis: usize| {
                            ends[axis] * (2.0 * index as f64 / counts[axis] as f64 - 1.0)
                        };
                        add(part(row, 0), part(column, 1), ball);
                    }
                }
            }
            continue;
        }
        for step in 0..around {
            let (sine, cosine) = (TAU * step as f64 / around as f64).sin_cos();
            add(ring * cosine, ring * sine, size);
        }
    }
    spheres
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grasp::{GraspOptions, grasps};
    use crate::item::Class;
    use crate::surroundings::Surroundings;

    fn brick(yaw: f64) -> Item {
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), yaw);
        let shape = ItemShape::Cuboid {
            size: [0.07, 0.195, 0.07],
        };
        Item {
            id: 1,
            label: "brick".into(),
            class: Class::Polygon,
            shape,
            pose: Pose::from_parts(Vector3::new(0.5, 0.1, -0.015).into(), turn),
        }
    }

    #[test]
    fn cuboids_are_released_along_the_walls() {
        let filling = Filling::new(Surroundings::default().containers[0]);
        let item = brick(0.4);
        let all = releases(&item, &filling);
        assert!(!all.is_empty());
        for (angle, spot) in all {
            let quarter = (item.yaw() + angle).rem_euclid(std::f64::consts::FRAC_PI_2);
            assert!(quarter.min(std::f64::consts::FRAC_PI_2 - quarter) < 1e-9);
            assert!((spot.half[0] - 0.035).abs() < 1e-9 || (spot.half[0] - 0.0975).abs() < 1e-9);
        }
    }

    /// Objects that were released beside a high pile came down on it.
    #[test]
    fn fingertips_are_released_above_what_is_beside_the_place() {
        let mut filling = Filling::new(Surroundings::default().containers[0]);
        let item = brick(0.0);
        let grasp = &grasps(&item, &GraspOptions::default())[0];
        let (angle, spot) = releases(&item, &filling)[0];
        let low = release_pose(&item, grasp, &filling, angle, &spot);
        let [x, y, z] = filling.container().bottom;
        let beside = Point3::new(
            x + spot.offset[0] + spot.half[0] + 0.02,
            y + spot.offset[1],
            z + filling.container().size[2] + 0.04,
        );
        filling.measure(&[beside]);
        let high = release_pose(&item, grasp, &filling, angle, &spot);
        assert!(high.translation.z > low.translation.z + 0.03);
        assert!(high.translation.z - grasp.depth > beside.z + 0.01);
    }

    #[test]
    fn a_held_cuboid_is_no_wider_than_it_is() {
        let item = brick(0.4);
        let grasp = &grasps(&item, &GraspOptions::default())[0];
        let from_hand = item.pose.inverse() * grasp.hand;
        let mut reach = [0.0_f64; 3];
        for sphere in held(&item, grasp) {
            let place = from_hand * sphere.center;
            for axis in 0..3 {
                reach[axis] = reach[axis].max(place[axis].abs() + sphere.radius);
            }
        }
        for (axis, half) in [0.035, 0.0975, 0.035].into_iter().enumerate() {
            assert!(
                (reach[axis] - half).abs() < 0.006,
                "{axis}: {}",
                reach[axis]
            );
        }
        assert!((reach[2] - 0.035).abs() < 1e-9, "{}", reach[2]);
    }
}
