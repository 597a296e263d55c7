//! The arm as spheres.

use nalgebra::Point3;
use yarp_devices::hand::gcl::Finger;
use yarp_devices::hand::{FingerJoints, finger_kinematics};
use yarp_devices::kinematics::{Chain, Joints};

/// A sphere that is fixed to a link of the arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkSphere {
    /// Frame that it moves with: 0 is the base, 1 to 7 the links, 7 also hand and held object.
    pub link: usize,
    /// Centre in that frame, in metres.
    pub center: Point3<f64>,
    /// Radius, in metres.
    pub radius: f64,
}

/// The shape of an arm: spheres on its links, and the pairs of links that can collide.
#[derive(Clone, Debug, PartialEq)]
pub struct ArmGeometry {
    spheres: Vec<LinkSphere>,
}

/// A capsule of a link: frame, both centres, radius.
struct Capsule(usize, [f64; 3], [f64; 3], f64);

/// The WAM with 7 joints. Axes and lengths are those of its Denavit-Hartenberg table (libbarrett `wam7w.conf`); radii are
/// estimated from photographs and drawings of the manual, rounded up.
const WAM: [Capsule; 8] = [
    // The base stands 0.346 m below the shoulder.
    Capsule(0, [0.0, 0.0, -0.23], [0.0, 0.0, -0.17], 0.13),
    // Motors on both sides of the shoulder's pitch axis.
    Capsule(1, [0.0, 0.0, -0.09], [0.0, 0.0, 0.09], 0.105),
    // Upper arm; frame 3 is at the elbow.
    Capsule(3, [-0.045, 0.50, 0.0], [-0.045, 0.08, 0.0], 0.065),
    // Elbow.
    Capsule(3, [0.0, 0.0, -0.035], [0.0, 0.0, 0.035], 0.060),
    // Forearm, along z of frame 4.
    Capsule(4, [0.0, 0.0, 0.04], [0.0, 0.0, 0.25], 0.052),
    // Wrist.
    Capsule(5, [0.0, 0.0, -0.03], [0.0, 0.0, 0.03], 0.049),
    Capsule(6, [0.0, 0.0, 0.0], [0.0, 0.0, 0.035], 0.047),
    Capsule(7, [0.0, 0.0, 0.0], [0.0, 0.0, 0.01], 0.047),
];

/// The palm of the BarrettHand beyond the tool plate.
const PALM: [Capsule; 2] = [
    Capsule(7, [0.0, -0.022, 0.030], [0.0, -0.022, 0.045], 0.042),
    Capsule(7, [0.0, 0.022, 0.030], [0.0, 0.022, 0.045], 0.042),
];

/// Links of a finger in their own frames (lengths from the hand's table of Denavit and Hartenberg, radii rounded up): the
/// link that spreads, the inner and the outer one.
const FINGER: [Capsule; 3] = [
    Capsule(0, [0.005, 0.0, -0.012], [0.045, 0.0, 0.0], 0.0125),
    Capsule(1, [0.0, 0.0, 0.0], [0.070, 0.0, 0.0], 0.011),
    Capsule(2, [0.0, 0.0, 0.0], [0.050, 0.0, 0.0], 0.0095),
];

/// Largest ratio of the distance between two spheres of a finger to its radius: thin links would have too many.
const FINGER_SPACING: f64 = 0.9;

/// Largest ratio of the distance between two spheres of a capsule to its radius; a covering sphere is
/// `sqrt(1 + (ratio / 2)^2)` times as large as the capsule.
const SPACING: f64 = 0.9;

impl ArmGeometry {
    /// Returns the WAM with 7 joints and a bare tool plate.
    pub fn wam() -> Self {
        let mut geometry = Self {
            spheres: Vec::new(),
        };
        geometry.extend(&WAM);
        geometry
    }

    /// Returns the WAM with the palm of a BarrettHand; fingers are added with [`with_sphere`](Self::with_sphere) as they
    /// are posed.
    pub fn wam_with_palm() -> Self {
        let mut geometry = Self::wam();
        geometry.extend(&PALM);
        geometry
    }

    /// Returns the WAM with a BarrettHand whose fingers F1, F2 and F3 are posed like this.
    pub fn wam_with_hand(fingers: &[FingerJoints; 3]) -> Self {
        let mut geometry = Self::wam_with_palm();
        for (finger, joints) in Finger::ALL.into_iter().zip(fingers) {
            let frames = finger_kinematics::link_frames(finger, joints);
            for Capsule(link, from, to, radius) in &FINGER {
                let place = |point: &[f64; 3]| frames[*link] * Point3::from(*point);
                geometry.cover_spaced(7, place(from), place(to), *radius, FINGER_SPACING);
            }
        }
        geometry
    }

    /// Adds a sphere, for example of a finger or of a held object.
    pub fn with_sphere(mut self, sphere: LinkSphere) -> Self {
        self.spheres.push(sphere);
        self
    }

    /// Adds spheres that cover a capsule of a link.
    pub fn with_capsule(
        mut self,
        link: usize,
        from: Point3<f64>,
        to: Point3<f64>,
        radius: f64,
    ) -> Self {
        self.cover(link, from, to, radius);
        self
    }

    /// Returns all spheres.
    pub fn spheres(&self) -> &[LinkSphere] {
        &self.spheres
    }

    fn extend(&mut self, capsules: &[Capsule]) {
        for Capsule(link, from, to, radius) in capsules {
            self.cover(*link, (*from).into(), (*to).into(), *radius);
        }
    }

    fn cover(&mut self, link: usize, from: Point3<f64>, to: Point3<f64>, radius: f64) {
        self.cover_spaced(link, from, to, radius, SPACING);
    }

    fn cover_spaced(
        &mut self,
        link: usize,
        from: Point3<f64>,
        to: Point3<f64>,
        radius: f64,
        spacing: f64,
    ) {
        let axis = to - from;
        let intervals = (axis.norm() / (spacing * radius)).ceil().max(1.0);
        let step = axis / intervals;
        let radius = radius.hypot(step.norm() / 2.0);
        let count = if axis.norm() == 0.0 {
            1
        } else {
            intervals as usize + 1
        };
        for index in 0..count {
            self.spheres.push(LinkSphere {
                link,
                center: from + step * index as f64,
                radius,
            });
        }
    }
}

/// Returns, for each sphere and joint, the largest distance of the centre of the sphere from the axis of the joint.
///
/// It is bounded by the sum of the lengths of the links between them, so it holds in every posture. A joint that does not
/// move the sphere has 0.
pub(super) fn reaches(chain: &Chain<7>, spheres: &[LinkSphere]) -> Vec<Joints<7>> {
    // Lengths between successive frames do not depend on the joints.
    let frames = chain.frames(&Joints::<7>::zeros());
    let origin = |frame: usize| match frame {
        0 => Point3::origin(),
        _ => Point3::from(frames[frame - 1].translation.vector),
    };
    let reach = |sphere: &LinkSphere| {
        Joints::<7>::from_fn(|joint, _| {
            if sphere.link <= joint {
                return 0.0;
            }
            // The axis of a joint goes through the origin of the frame before it.
            let along: f64 = (joint..sphere.link)
                .map(|frame| (origin(frame + 1) - origin(frame)).norm())
                .sum();
            along + sphere.center.coords.norm()
        })
    };
    spheres.iter().map(reach).collect()
}
