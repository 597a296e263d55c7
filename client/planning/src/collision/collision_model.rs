//! The clearance of a posture.

use nalgebra::Point3;
use smallvec::SmallVec;
use yarp_devices::kinematics::{Chain, Joints, Pose};

use super::arm_geometry::{ArmGeometry, LinkSphere, reaches};
use crate::planning_scene::Scene;

/// Distance that a planned motion keeps from every obstacle, in metres.
pub const MARGIN: f64 = 0.01;

/// Returns the part of the arm that a link belongs to: shoulder, upper arm, forearm, wrist with hand.
///
/// The axes of joints 1 to 3 meet in the shoulder and those of joints 5 to 7 in the wrist, so neighbouring parts overlap at
/// their common joint and are not checked against each other.
fn part(link: usize) -> usize {
    match link {
        0..=2 => 0,
        3 => 1,
        4 => 2,
        _ => 3,
    }
}

/// The closest pair of a posture.
#[derive(Clone, Debug, PartialEq)]
pub enum Contact {
    /// An obstacle, by its name.
    Obstacle {
        /// Link of the arm: 0 is the base, 7 the last link with hand and held object.
        link: usize,
        /// Name of the obstacle.
        name: String,
    },
    /// Two links of the arm.
    Arm {
        /// Lower link.
        link: usize,
        /// Upper link.
        other: usize,
    },
}

impl std::fmt::Display for Contact {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Obstacle { link, name } => write!(f, "link {link} and {name}"),
            Self::Arm { link, other } => write!(f, "links {link} and {other}"),
        }
    }
}

/// Collision checks for one arm in one scene.
#[derive(Clone, Debug)]
pub struct CollisionModel {
    pub(super) chain: Chain<7>,
    geometry: ArmGeometry,
    scene: Scene,
    margin: f64,
    /// Spheres of one link each, in the order of the geometry's spheres in `sorted`.
    groups: Vec<Group>,
    /// Indices of the spheres, those of a group side by side.
    sorted: Vec<u16>,
    /// Pairs of groups of links that can collide.
    pairs: Vec<(u8, u8)>,
    /// See [`reaches`].
    pub(super) reaches: Vec<Joints<7>>,
    /// Bounding radius of each obstacle.
    bounds: Vec<f64>,
}

/// Upper bound of the distance that any sphere of each group moves during a motion, m.
pub(super) type Travels = SmallVec<[f64; 24]>;

/// The spheres of one part of a link, and a sphere around all of them.
#[derive(Clone, Debug)]
struct Group {
    link: usize,
    center: Point3<f64>,
    radius: f64,
    /// Range in [`CollisionModel::sorted`].
    spheres: std::ops::Range<usize>,
}

/// Number of spheres of a group: few, so that groups stay small.
const MAX_GROUP: usize = 8;

/// Divides the spheres of an arm into groups.
fn groups(spheres: &[LinkSphere]) -> (Vec<Group>, Vec<u16>) {
    let mut sorted: Vec<u16> = (0..spheres.len() as u16).collect();
    // Spheres of a link are listed along its capsules: neighbours in the list are neighbours in space.
    sorted.sort_by_key(|&index| spheres[usize::from(index)].link);
    let mut groups: Vec<Group> = Vec::new();
    let mut begin = 0;
    while begin < sorted.len() {
        let sphere = |place: usize| &spheres[usize::from(sorted[place])];
        let link = sphere(begin).link;
        let mut end = begin + 1;
        while end < sorted.len() && end - begin < MAX_GROUP && sphere(end).link == link {
            end += 1;
        }
        let sum = (begin..end).fold(nalgebra::Vector3::zeros(), |sum, place| {
            sum + sphere(place).center.coords
        });
        let center = Point3::from(sum / (end - begin) as f64);
        let reach = |place: usize| (sphere(place).center - center).norm() + sphere(place).radius;
        let radius = (begin..end).map(reach).fold(0.0, f64::max);
        groups.push(Group {
            link,
            center,
            radius,
            spheres: begin..end,
        });
        begin = end;
    }
    (groups, sorted)
}

/// A clearance, and the sphere or pair that has it.
#[derive(Clone, Copy, Debug)]
struct Nearest {
    distance: f64,
    sphere: usize,
    other: Other,
}

#[derive(Clone, Copy, Debug)]
enum Other {
    Nothing,
    Obstacle(usize),
    Sphere(usize),
}

impl Nearest {
    /// Returns nothing within this distance.
    fn beyond(distance: f64) -> Self {
        Self {
            distance,
            sphere: usize::MAX,
            other: Other::Nothing,
        }
    }
}

impl CollisionModel {
    /// Returns the checks for an arm in a scene, with the default [`MARGIN`].
    pub fn new(chain: &Chain<7>, geometry: ArmGeometry, scene: Scene) -> Self {
        let spheres = geometry.spheres();
        let (groups, sorted) = groups(spheres);
        let mut pairs = Vec::new();
        for (first, one) in groups.iter().enumerate() {
            for (second, two) in groups.iter().enumerate().skip(first + 1) {
                if part(one.link).abs_diff(part(two.link)) >= 2 {
                    pairs.push((first as u8, second as u8));
                }
            }
        }
        let obstacles = scene.obstacles().iter();
        Self {
            chain: chain.clone(),
            reaches: reaches(chain, spheres),
            bounds: obstacles
                .map(|obstacle| obstacle.shape.bounding_radius())
                .collect(),
            groups,
            sorted,
            pairs,
            geometry,
            scene,
            margin: MARGIN,
        }
    }

    /// Keeps another distance from every obstacle, in metres.
    pub fn with_margin(mut self, margin: f64) -> Self {
        self.margin = margin;
        self
    }

    /// Returns the kinematic chain of the arm.
    pub fn chain(&self) -> &Chain<7> {
        &self.chain
    }

    /// Returns the scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Returns the shape of the arm.
    pub fn geometry(&self) -> &ArmGeometry {
        &self.geometry
    }

    /// Returns the smallest distance between the arm and something it can collide with, less the margin.
    ///
    /// It is negative for a posture in collision.
    pub fn clearance(&self, joints: &Joints<7>) -> f64 {
        self.nearest(joints, f64::INFINITY).distance
    }

    /// Returns whether a posture is within the joint limits and collides with nothing.
    pub fn is_free(&self, joints: &Joints<7>) -> bool {
        // A positive bound is enough to decide: larger distances need not be exact.
        self.chain.contains(joints) && self.nearest(joints, 1e-9).distance >= 0.0
    }

    /// Returns what the arm is closest to, with the distance less the margin; `None` if there is nothing.
    pub fn contact(&self, joints: &Joints<7>) -> Option<(f64, Contact)> {
        let nearest = self.nearest(joints, f64::INFINITY);
        let spheres = self.geometry.spheres();
        let link = spheres.get(nearest.sphere)?.link;
        let contact = match nearest.other {
            Other::Nothing => return None,
            Other::Obstacle(index) => Contact::Obstacle {
                link,
                name: self.scene.obstacles()[index].name.clone(),
            },
            Other::Sphere(other) => Contact::Arm {
                link: link.min(spheres[other].link),
                other: link.max(spheres[other].link),
            },
        };
        Some((nearest.distance, contact))
    }

    /// Returns an upper bound of the distance that any sphere of each group moves between two postures, m.
    pub(super) fn travels(&self, from: &Joints<7>, to: &Joints<7>) -> Travels {
        let motion = (to - from).abs();
        let travel = |group: &Group| {
            let reaches = self.sorted[group.spheres.clone()].iter();
            let moved = reaches.map(|&sphere| self.reaches[usize::from(sphere)].dot(&motion));
            moved.fold(0.0, f64::max)
        };
        self.groups.iter().map(travel).collect()
    }

    /// Returns the part of a motion, before and after this posture, during which nothing can collide: at most `most`, and
    /// negative if this posture collides.
    ///
    /// `travels` is that of the whole motion.
    pub(super) fn free_fraction(&self, joints: &Joints<7>, travels: &Travels, most: f64) -> f64 {
        let places = self.places(joints);
        let middles = self.middles(&places);
        let mut free = most;
        for (index, obstacle) in self.scene.obstacles().iter().enumerate() {
            let middle = Point3::from(obstacle.pose.translation.vector);
            for ((group, center), travel) in self.groups.iter().zip(&middles).zip(travels) {
                let keep = group.radius + self.margin;
                let needed = free * travel;
                let reach = needed + keep + self.bounds[index];
                if group.link == 0 || (center - middle).norm_squared() > reach * reach {
                    continue;
                }
                if obstacle.distance(center) - keep >= needed {
                    continue;
                }
                let mut nearest = Nearest::beyond(needed);
                self.nearest_of_group(group, &places, index, &mut nearest);
                if nearest.distance < 0.0 {
                    return -1.0;
                }
                if nearest.distance < needed {
                    free = nearest.distance / travel;
                }
            }
        }
        for &(first, second) in &self.pairs {
            let (first, second) = (usize::from(first), usize::from(second));
            let groups = [&self.groups[first], &self.groups[second]];
            let travel = travels[first].max(travels[second]);
            let needed = free * travel;
            let reach = needed + groups[0].radius + groups[1].radius;
            if (middles[first] - middles[second]).norm_squared() >= reach * reach {
                continue;
            }
            let mut nearest = Nearest::beyond(needed);
            self.nearest_of_pair(groups, &places, &mut nearest);
            if nearest.distance < 0.0 {
                return -1.0;
            }
            if nearest.distance < needed {
                free = nearest.distance / travel;
            }
        }
        free
    }

    /// Returns the middle of each group in the base frame.
    fn middles(&self, places: &[Pose; 8]) -> SmallVec<[Point3<f64>; 24]> {
        let groups = self.groups.iter();
        groups
            .map(|group| places[group.link] * group.center)
            .collect()
    }

    /// Returns the frame of each link, with the base as link 0.
    fn places(&self, joints: &Joints<7>) -> [Pose; 8] {
        let frames = self.chain.frames(joints);
        std::array::from_fn(|link| match link {
            0 => Pose::identity(),
            _ => frames[link - 1],
        })
    }

    fn nearest(&self, joints: &Joints<7>, bound: f64) -> Nearest {
        let places = self.places(joints);
        let middles = self.middles(&places);
        let mut nearest = Nearest::beyond(bound);
        for (index, obstacle) in self.scene.obstacles().iter().enumerate() {
            let middle = Point3::from(obstacle.pose.translation.vector);
            for (group, center) in self.groups.iter().zip(&middles) {
                // The base stands on what it stands on.
                if group.link == 0 {
                    continue;
                }
                let keep = group.radius + self.margin;
                let reach = nearest.distance + keep + self.bounds[index];
                let far = match reach < f64::INFINITY {
                    true => reach <= 0.0 || (center - middle).norm_squared() > reach * reach,
                    false => false,
                };
                if far || obstacle.distance(center) - keep >= nearest.distance {
                    continue;
                }
                self.nearest_of_group(group, &places, index, &mut nearest);
            }
        }
        for &(first, second) in &self.pairs {
            let (first, second) = (usize::from(first), usize::from(second));
            let groups = [&self.groups[first], &self.groups[second]];
            let reach = nearest.distance + groups[0].radius + groups[1].radius;
            let square = (middles[first] - middles[second]).norm_squared();
            if reach < f64::INFINITY && (reach <= 0.0 || square >= reach * reach) {
                continue;
            }
            self.nearest_of_pair(groups, &places, &mut nearest);
        }
        nearest
    }

    /// Compares each sphere of a group with an obstacle.
    fn nearest_of_group(
        &self,
        group: &Group,
        places: &[Pose; 8],
        obstacle: usize,
        nearest: &mut Nearest,
    ) {
        let spheres = self.geometry.spheres();
        for &sphere in &self.sorted[group.spheres.clone()] {
            let sphere = usize::from(sphere);
            let center = places[group.link] * spheres[sphere].center;
            let distance = self.scene.obstacles()[obstacle].distance(&center)
                - spheres[sphere].radius
                - self.margin;
            if distance < nearest.distance {
                *nearest = Nearest {
                    distance,
                    sphere,
                    other: Other::Obstacle(obstacle),
                };
            }
        }
    }

    /// Compares each sphere of one group with each of another.
    fn nearest_of_pair(&self, groups: [&Group; 2], places: &[Pose; 8], nearest: &mut Nearest) {
        let spheres = self.geometry.spheres();
        let [one, two] = groups.map(|group| &self.sorted[group.spheres.clone()]);
        for &first in one {
            let first = usize::from(first);
            let center = places[groups[0].link] * spheres[first].center;
            for &second in two {
                let second = usize::from(second);
                let other = places[groups[1].link] * spheres[second].center;
                let keep = spheres[first].radius + spheres[second].radius;
                let distance = (center - other).norm() - keep;
                if distance < nearest.distance {
                    *nearest = Nearest {
                        distance,
                        sphere: first,
                        other: Other::Sphere(second),
                    };
                }
            }
        }
    }
}
