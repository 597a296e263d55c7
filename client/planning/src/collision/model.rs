//! The clearance of a posture.

use nalgebra::Point3;
use yarp_devices::kinematics::{Chain, Joints, Pose};

use super::arm_geometry::{ArmGeometry, reaches};
use crate::scene::Scene;

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
    /// Pairs of spheres of links that can collide.
    pairs: Vec<(u16, u16)>,
    /// See [`reaches`].
    pub(super) reaches: Vec<Joints<7>>,
    /// Bounding radius of each obstacle.
    bounds: Vec<f64>,
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

impl CollisionModel {
    /// Returns the checks for an arm in a scene, with the default [`MARGIN`].
    pub fn new(chain: &Chain<7>, geometry: ArmGeometry, scene: Scene) -> Self {
        let spheres = geometry.spheres();
        let mut pairs = Vec::new();
        for (first, one) in spheres.iter().enumerate() {
            for (second, two) in spheres.iter().enumerate().skip(first + 1) {
                if part(one.link).abs_diff(part(two.link)) >= 2 {
                    pairs.push((first as u16, second as u16));
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

    /// Returns the smallest distance less the margin; distances above `bound` are not computed exactly, but are above it.
    pub(super) fn clearance_below(&self, joints: &Joints<7>, bound: f64) -> f64 {
        self.nearest(joints, bound).distance
    }

    /// Returns the centre of each sphere in the base frame.
    fn centers(&self, joints: &Joints<7>) -> Vec<Point3<f64>> {
        let frames = self.chain.frames(joints);
        let place = |link: usize| match link {
            0 => Pose::identity(),
            _ => frames[link - 1],
        };
        let places: [Pose; 8] = std::array::from_fn(place);
        let spheres = self.geometry.spheres().iter();
        spheres
            .map(|sphere| places[sphere.link] * sphere.center)
            .collect()
    }

    fn nearest(&self, joints: &Joints<7>, bound: f64) -> Nearest {
        let spheres = self.geometry.spheres();
        let centers = self.centers(joints);
        let mut nearest = Nearest {
            distance: bound,
            sphere: usize::MAX,
            other: Other::Nothing,
        };
        for (index, obstacle) in self.scene.obstacles().iter().enumerate() {
            let middle = Point3::from(obstacle.pose.translation.vector);
            for (sphere, center) in centers.iter().enumerate() {
                // The base stands on what it stands on.
                if spheres[sphere].link == 0 {
                    continue;
                }
                let keep = spheres[sphere].radius + self.margin;
                let reach = nearest.distance + keep + self.bounds[index];
                if reach < f64::INFINITY && (center - middle).norm_squared() > reach * reach {
                    continue;
                }
                let distance = obstacle.distance(center) - keep;
                if distance < nearest.distance {
                    nearest = Nearest {
                        distance,
                        sphere,
                        other: Other::Obstacle(index),
                    };
                }
            }
        }
        for &(first, second) in &self.pairs {
            let (first, second) = (usize::from(first), usize::from(second));
            let keep = spheres[first].radius + spheres[second].radius;
            let reach = nearest.distance + keep;
            let square = (centers[first] - centers[second]).norm_squared();
            if reach < f64::INFINITY && (reach <= 0.0 || square >= reach * reach) {
                continue;
            }
            nearest = Nearest {
                distance: square.sqrt() - keep,
                sphere: first,
                other: Other::Sphere(second),
            };
        }
        nearest
    }
}
