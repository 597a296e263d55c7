//! Solids that rays meet.

use nalgebra::Matrix3;

use super::hit::{Hit, Vector};
use super::material::Material;

/// A solid in its own frame.
#[derive(Clone, Copy, Debug)]
pub(super) enum Solid {
    /// Half edges.
    Box(Vector),
    /// Radius and half height, along z.
    Cylinder(f32, f32),
    /// Outer and inner radius, half height and thickness of the bottom, open at +z.
    Cup(f32, f32, f32, f32),
    /// Side of the triangle and half height, along z.
    Prism(f32, f32),
    /// Radius and half length between the middles of its round ends, along z.
    Capsule(f32, f32),
}

/// A solid at its place, relative to the camera.
#[derive(Clone, Debug)]
pub(super) struct Primitive {
    pub(super) solid: Solid,
    /// From the frame of the solid to the axes of the world.
    pub(super) rotation: Matrix3<f32>,
    /// From the camera, in the axes of the world.
    pub(super) centre: Vector,
    /// Of a sphere about the centre that contains it.
    pub(super) radius: f32,
    /// The camera in the frame of the solid.
    pub(super) eye: Vector,
    /// Whose it is: an index into what the truth lists.
    pub(super) owner: Option<usize>,
    pub(super) material: Material,
    /// Part of the light that does not pass.
    pub(super) opacity: f32,
}

/// Shortest distance at which a ray meets a solid, in lengths of its direction.
const NEAR: f32 = 1e-4;
/// Largest number of spheres that stand for a long solid.
const MAX_SPHERES: f32 = 6.0;

impl Primitive {
    /// Meets a ray from the camera.
    pub(super) fn meet_from_eye(&self, direction: &Vector) -> Option<Hit> {
        self.solid.meet(&self.eye, &self.rotation.tr_mul(direction))
    }

    /// Returns whether a ray from `origin`, relative to the camera, meets it nearer than `limit` lengths of its direction.
    pub(super) fn blocks(&self, origin: &Vector, direction: &Vector, limit: f32) -> bool {
        let from = self.rotation.tr_mul(&(origin - self.centre));
        let along = self.rotation.tr_mul(direction);
        self.solid.blocks(&from, &along, limit)
    }

    /// Returns the largest distance of its points along an axis, from the camera.
    pub(super) fn farthest(&self, axis: &Vector) -> f32 {
        self.centre.dot(axis) + self.solid.reach(&self.rotation.tr_mul(axis))
    }

    /// Returns whether the ray intersects the bounding sphere.
    pub(super) fn is_near(&self, origin: &Vector, direction: &Vector) -> bool {
        let to = self.centre - origin;
        let along = to.dot(direction);
        let square = to.norm_squared() - along * along / direction.norm_squared();
        square <= self.radius * self.radius && (along > 0.0 || to.norm() < self.radius)
    }

    /// Corners of the cuboid that contains it, relative to the camera.
    pub(super) fn corners(&self) -> [Vector; 8] {
        let half = self.solid.half_extent();
        std::array::from_fn(|index| {
            let sign = |bit: usize| if index >> bit & 1 == 1 { 1.0 } else { -1.0 };
            let corner = Vector::new(sign(0) * half.x, sign(1) * half.y, sign(2) * half.z);
            self.centre + self.rotation * corner
        })
    }
}

impl Solid {
    pub(super) fn half_extent(&self) -> Vector {
        match *self {
            Self::Box(half) => half,
            Self::Cylinder(radius, half) | Self::Cup(radius, _, half, _) => {
                Vector::new(radius, radius, half)
            }
            Self::Prism(side, half) => Vector::new(side / 3_f32.sqrt(), side / 2.0, half),
            Self::Capsule(radius, half) => Vector::new(radius, radius, half + radius),
        }
    }

    /// Returns the largest distance of its points from its middle along an axis.
    fn reach(&self, axis: &Vector) -> f32 {
        match *self {
            Self::Box(half) => half.dot(&axis.abs()),
            Self::Prism(..) => self.half_extent().dot(&axis.abs()),
            Self::Cylinder(radius, half) | Self::Cup(radius, _, half, _) => {
                radius * axis.x.hypot(axis.y) + half * axis.z.abs()
            }
            Self::Capsule(radius, half) => radius * axis.norm() + half * axis.z.abs(),
        }
    }

    /// Returns the middles of spheres in a row that contain it together, and their radius.
    pub(super) fn spheres(&self) -> (Vec<Vector>, f32) {
        let half = self.half_extent();
        let axis = half.imax();
        let (second, third) = (half[(axis + 1) % 3], half[(axis + 2) % 3]);
        let count = (half[axis] / second.max(third))
            .round()
            .clamp(1.0, MAX_SPHERES);
        let part = half[axis] / count;
        let middle = |index: usize| {
            let mut middle = Vector::zeros();
            middle[axis] = (2 * index + 1) as f32 * part - half[axis];
            middle
        };
        let across = match self {
            Self::Box(_) | Self::Prism(..) => second.hypot(third),
            // Round about z: no point is further from the axis than the radius.
            _ if axis == 2 => second,
            _ => second.hypot(third),
        };
        (
            (0..count as usize).map(middle).collect(),
            across.hypot(part),
        )
    }

    pub(super) fn meet(&self, from: &Vector, along: &Vector) -> Option<Hit> {
        match *self {
            Self::Box(half) => cuboid(&half, from, along),
            Self::Cylinder(radius, half) => cylinder(radius, half, from, along),
            Self::Cup(outer, inner, half, bottom) => cup(outer, inner, half, bottom, from, along),
            Self::Prism(side, half) => prism(side, half, from, along),
            Self::Capsule(radius, half) => capsule(radius, half, from, along),
        }
    }

    /// Returns whether [`Self::meet`] has a hit nearer than the limit: without looking for the nearest.
    fn blocks(&self, from: &Vector, along: &Vector, limit: f32) -> bool {
        let is_before = |hit| is_before(hit, limit);
        match *self {
            Self::Box(half) => is_before(cuboid(&half, from, along)),
            Self::Prism(side, half) => is_before(prism(side, half, from, along)),
            Self::Cylinder(radius, half) => {
                is_before(wall(radius, [-half, half], true, from, along))
                    || is_before(ring(half, 0.0, radius, 1.0, from, along))
                    || is_before(ring(-half, 0.0, radius, -1.0, from, along))
            }
            Self::Cup(outer, inner, half, bottom) => {
                is_before(wall(outer, [-half, half], true, from, along))
                    || is_before(wall(inner, [bottom - half, half], false, from, along))
                    || is_before(ring(half, inner, outer, 1.0, from, along))
                    || is_before(ring(bottom - half, 0.0, inner, 1.0, from, along))
                    || is_before(ring(-half, 0.0, outer, -1.0, from, along))
            }
            Self::Capsule(radius, half) => {
                is_before(wall(radius, [-half, half], true, from, along))
                    || is_before(ball(radius, half, from, along))
                    || is_before(ball(radius, -half, from, along))
            }
        }
    }
}

/// Returns whether a face is met nearer than the limit.
fn is_before(hit: Option<Hit>, limit: f32) -> bool {
    hit.is_some_and(|hit| hit.distance < limit)
}

#[inline]
fn cuboid(half: &Vector, from: &Vector, along: &Vector) -> Option<Hit> {
    let mut enter = f32::NEG_INFINITY;
    let mut leave = f32::INFINITY;
    let mut axis = 0;
    for index in 0..3 {
        let inverse = 1.0 / along[index];
        let one = (-half[index] - from[index]) * inverse;
        let other = (half[index] - from[index]) * inverse;
        let (first, last) = if one < other {
            (one, other)
        } else {
            (other, one)
        };
        if first > enter {
            enter = first;
            axis = index;
        }
        leave = leave.min(last);
    }
    if enter > leave || enter < NEAR {
        return None;
    }
    let place = from + along * enter;
    let mut normal = Vector::zeros();
    let positive = along[axis] < 0.0;
    normal[axis] = if positive { 1.0 } else { -1.0 };
    Some(Hit {
        distance: enter,
        normal,
        place,
        face: (axis * 2 + usize::from(!positive)) as u8,
    })
}

/// Distances at which a ray meets an endless cylinder about z.
#[inline]
fn roots(radius: f32, from: &Vector, along: &Vector) -> Option<(f32, f32)> {
    let a = along.x * along.x + along.y * along.y;
    if a < 1e-12 {
        return None;
    }
    let b = from.x * along.x + from.y * along.y;
    // The square of the distance of the ray from the axis, without the loss of digits of b² - ac.
    let cross = from.x * along.y - from.y * along.x;
    let inside = radius * radius * a - cross * cross;
    if inside < 0.0 {
        return None;
    }
    let root = inside.sqrt();
    Some(((-b - root) / a, (-b + root) / a))
}

/// The disc or ring at height z, seen from either side.
#[inline]
fn ring(z: f32, inner: f32, outer: f32, up: f32, from: &Vector, along: &Vector) -> Option<Hit> {
    // Only from the side it faces.
    if along.z * up >= 0.0 {
        return None;
    }
    let distance = (z - from.z) / along.z;
    let place = from + along * distance;
    let square = place.x * place.x + place.y * place.y;
    (distance > NEAR && square <= outer * outer && square >= inner * inner).then_some(Hit {
        distance,
        normal: Vector::new(0.0, 0.0, up),
        place,
        face: if up > 0.0 { 1 } else { 2 },
    })
}

/// The side of a cylinder, from outside or from inside.
#[inline]
fn wall(
    radius: f32,
    [low, high]: [f32; 2],
    outside: bool,
    from: &Vector,
    along: &Vector,
) -> Option<Hit> {
    let (first, last) = roots(radius, from, along)?;
    let distance = if outside { first } else { last };
    let place = from + along * distance;
    let normal = Vector::new(place.x / radius, place.y / radius, 0.0);
    (distance > NEAR && place.z >= low && place.z <= high).then_some(Hit {
        distance,
        normal: if outside { normal } else { -normal },
        place,
        face: if outside { 0 } else { 3 },
    })
}

fn nearest<const N: usize>(hits: [Option<Hit>; N]) -> Option<Hit> {
    hits.into_iter()
        .flatten()
        .min_by(|one, other| one.distance.total_cmp(&other.distance))
}

fn cylinder(radius: f32, half: f32, from: &Vector, along: &Vector) -> Option<Hit> {
    nearest([
        wall(radius, [-half, half], true, from, along),
        ring(half, 0.0, radius, 1.0, from, along),
        ring(-half, 0.0, radius, -1.0, from, along),
    ])
}

fn cup(
    outer: f32,
    inner: f32,
    half: f32,
    bottom: f32,
    from: &Vector,
    along: &Vector,
) -> Option<Hit> {
    // The floor inside is face 4.
    let floor = ring(bottom - half, 0.0, inner, 1.0, from, along).map(|hit| Hit { face: 4, ..hit });
    nearest([
        wall(outer, [-half, half], true, from, along),
        wall(inner, [bottom - half, half], false, from, along),
        ring(half, inner, outer, 1.0, from, along),
        floor,
        ring(-half, 0.0, outer, -1.0, from, along),
    ])
}

fn prism(side: f32, half: f32, from: &Vector, along: &Vector) -> Option<Hit> {
    // Distance of each side from the axis.
    let reach = side / (2.0 * 3_f32.sqrt());
    let (sine, cosine) = (3_f32.sqrt() / 2.0, 0.5);
    let planes = [
        (Vector::new(0.0, 0.0, 1.0), half),
        (Vector::new(0.0, 0.0, -1.0), half),
        (Vector::new(-1.0, 0.0, 0.0), reach),
        (Vector::new(cosine, sine, 0.0), reach),
        (Vector::new(cosine, -sine, 0.0), reach),
    ];
    let mut enter = f32::NEG_INFINITY;
    let mut leave = f32::INFINITY;
    let mut face = 0;
    for (index, (normal, offset)) in planes.iter().enumerate() {
        let speed = normal.dot(along);
        let gap = offset - normal.dot(from);
        if speed.abs() < 1e-12 {
            if gap < 0.0 {
                return None;
            }
        } else if speed < 0.0 {
            if gap / speed > enter {
                enter = gap / speed;
                face = index;
            }
        } else {
            leave = leave.min(gap / speed);
        }
    }
    (enter <= leave && enter > NEAR).then(|| Hit {
        distance: enter,
        normal: planes[face].0,
        place: from + along * enter,
        face: face as u8,
    })
}

fn capsule(radius: f32, half: f32, from: &Vector, along: &Vector) -> Option<Hit> {
    nearest([
        wall(radius, [-half, half], true, from, along),
        ball(radius, half, from, along),
        ball(radius, -half, from, along),
    ])
}

/// A ball with its middle at height z.
#[inline]
fn ball(radius: f32, z: f32, from: &Vector, along: &Vector) -> Option<Hit> {
    let to = from - Vector::new(0.0, 0.0, z);
    let a = along.norm_squared();
    let b = to.dot(along);
    // From the nearest point of the ray, so that no digits are lost.
    let beside = to - along * (b / a);
    let root = a * (radius * radius - beside.norm_squared());
    if root < 0.0 {
        return None;
    }
    let distance = (-b - root.sqrt()) / a;
    let place = from + along * distance;
    (distance > NEAR).then(|| Hit {
        distance,
        normal: (place - Vector::new(0.0, 0.0, z)).normalize(),
        place,
        face: 0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn down(solid: Solid, x: f32, y: f32) -> Option<Hit> {
        solid.meet(&Vector::new(x, y, 1.0), &Vector::new(0.0, 0.0, -1.0))
    }

    #[test]
    fn a_cup_is_open_at_the_top() {
        let cup = Solid::Cup(0.04, 0.037, 0.05, 0.004);
        let rim = down(cup, 0.0385, 0.0).unwrap();
        assert!((rim.place.z - 0.05).abs() < 1e-6 && rim.face == 1);
        let floor = down(cup, 0.0, 0.0).unwrap();
        assert!((floor.place.z + 0.046).abs() < 1e-6 && floor.face == 4);
        assert!(down(cup, 0.041, 0.0).is_none());
        // Slanting, through the opening onto the wall inside.
        let slanting = Vector::new(0.03, 0.0, -0.02);
        let wall = cup.meet(&Vector::new(-0.05, 0.0, 0.09), &slanting).unwrap();
        assert_eq!(wall.face, 3);
        assert!(wall.normal.x < -0.99);
    }

    #[test]
    fn solids_are_as_high_as_they_say() {
        let solids = [
            (Solid::Box(Vector::new(0.1, 0.2, 0.05)), 0.05),
            (Solid::Cylinder(0.1, 0.05), 0.05),
            (Solid::Prism(0.1, 0.05), 0.05),
            (Solid::Capsule(0.02, 0.03), 0.05),
        ];
        for (solid, height) in solids {
            let hit = down(solid, 0.0, 0.0).unwrap();
            assert!((hit.place.z - height).abs() < 1e-6, "{solid:?}");
            assert!((hit.normal.z - 1.0).abs() < 1e-6, "{solid:?}");
            assert!(down(solid, 0.3, 0.3).is_none(), "{solid:?}");
        }
    }

    /// Points of each solid, from rays that meet it, are within its reach along any axis and in one of its spheres.
    #[test]
    fn bounds_contain_the_solids() {
        let solids = [
            Solid::Box(Vector::new(0.1, 0.02, 0.05)),
            Solid::Cylinder(0.1, 0.02),
            Solid::Cup(0.04, 0.037, 0.06, 0.004),
            Solid::Prism(0.1, 0.03),
            Solid::Capsule(0.02, 0.11),
        ];
        let mut random = crate::Random::new(1);
        let mut vector = || Vector::from_fn(|_, _| random.between(-1.0, 1.0) as f32);
        for solid in solids {
            let (middles, radius) = solid.spheres();
            let mut points = 0;
            while points < 2000 {
                let (from, target) = (vector().normalize(), vector() * 0.1);
                let Some(hit) = solid.meet(&from, &(target - from)) else {
                    continue;
                };
                points += 1;
                for limit in [0.99, 1.01].map(|part| part * hit.distance) {
                    let blocks = solid.blocks(&from, &(target - from), limit);
                    assert_eq!(blocks, limit > hit.distance, "{solid:?} {:?}", hit.place);
                }
                let axis = vector();
                let along = axis.dot(&hit.place);
                assert!(
                    along <= solid.reach(&axis) + 1e-6,
                    "{solid:?} {:?}",
                    hit.place
                );
                let inside = |middle: &Vector| (hit.place - middle).norm() <= radius + 1e-6;
                assert!(middles.iter().any(inside), "{solid:?} {:?}", hit.place);
            }
        }
    }

    #[test]
    fn a_prism_is_a_triangle() {
        let prism = Solid::Prism(0.12, 0.05);
        let [apex, left, _] = crate::Shape::triangle(0.12);
        let at = |scale: f64, corner: [f64; 2]| {
            down(
                prism,
                (corner[0] * scale) as f32,
                (corner[1] * scale) as f32,
            )
        };
        assert!(at(0.99, apex).is_some() && at(1.01, apex).is_none());
        assert!(at(0.99, left).is_some() && at(1.01, left).is_none());
    }
}
