//! Random tables: what lies where, without overlaps, within the arm's reach.

use std::f64::consts::{PI, TAU};

use nalgebra::{Point2, Vector2};

use crate::bricks::BrickKind;
use crate::object::{Class, Finish, Object, Shape};
use crate::table_scene::{Scene, Table};
use crate::{Lighting, Random};

/// Attempts to find a place for one object, and to find a whole table.
const TRIES: usize = 400;
const RESTARTS: usize = 20;
/// Sides of the polygon that stands for a round footprint.
const ROUND: usize = 16;

/// Rules for the placement of objects.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Placement {
    /// Number of objects.
    pub count: usize,
    /// Classes, each as likely as the others; a class may occur several times.
    pub classes: Vec<Class>,
    /// Smallest distance between two objects, m.
    pub gap: f64,
    /// Range of the middle of an object along x, m.
    pub x: [f64; 2],
    /// Along y.
    pub y: [f64; 2],
    /// Distance of an object's middle from the arm's vertical axis, m.
    pub reach: [f64; 2],
    /// Number of things that nobody looks for; they may touch nothing either.
    pub clutter: usize,
    /// True if table and light are random too.
    pub surroundings: bool,
}

impl Default for Placement {
    fn default() -> Self {
        Self {
            count: 8,
            classes: vec![
                Class::Glass,
                Class::Plate,
                Class::Box,
                Class::Prism,
                Class::Brick,
            ],
            gap: 0.02,
            x: [0.33, 0.77],
            y: [-0.30, 0.30],
            reach: [0.36, 0.76],
            clutter: 0,
            surroundings: true,
        }
    }
}

impl Placement {
    /// Returns the same with another number of objects.
    pub fn with_count(self, count: usize) -> Self {
        Self { count, ..self }
    }

    /// Returns the same with other classes.
    pub fn with_classes(self, classes: &[Class]) -> Self {
        Self {
            classes: classes.to_vec(),
            ..self
        }
    }

    /// Returns the same with another number of things that nobody looks for.
    pub fn with_clutter(self, clutter: usize) -> Self {
        Self { clutter, ..self }
    }

    /// Returns the same with another smallest distance between objects, m.
    pub fn with_gap(self, gap: f64) -> Self {
        Self { gap, ..self }
    }
}

/// There is no room for so many objects.
#[derive(Clone, Copy, Debug, Eq, PartialEq, thiserror::Error)]
#[error(
    "no room for {asked} objects on the table, {placed} fitted; ask for fewer or for a smaller gap"
)]
pub struct NoRoom {
    /// Number of objects that were requested.
    pub asked: usize,
    /// The most that fitted.
    pub placed: usize,
}

impl Scene {
    /// Returns a random table.
    ///
    /// Errors: [`NoRoom`].
    pub fn random(seed: u64, placement: &Placement) -> Result<Self, NoRoom> {
        let mut best = 0;
        for restart in 0..RESTARTS as u64 {
            let mut random = Random::for_purpose(seed, 0x100 + restart);
            let mut scene = Self::empty();
            if placement.surroundings {
                scene.table.seed = random.bits();
                scene.lighting = Lighting::random(seed);
            }
            match fill(&mut scene, placement, &mut random) {
                Ok(()) => return Ok(scene),
                Err(placed) => best = best.max(placed),
            }
        }
        Err(NoRoom {
            asked: placement.count + placement.clutter,
            placed: best,
        })
    }
}

fn fill(scene: &mut Scene, placement: &Placement, random: &mut Random) -> Result<(), usize> {
    let mut drawn: Vec<(Shape, Finish, f64)> = Vec::new();
    for index in 0..placement.count + placement.clutter {
        let class = if index >= placement.count || placement.classes.is_empty() {
            Class::Clutter
        } else {
            *random.pick(&placement.classes)
        };
        drawn.push(draw(class, random));
    }
    // Large ones first, while there is room; numbers follow the order on the table.
    drawn.sort_by(|one, other| {
        let size = |entry: &(Shape, Finish, f64)| entry.0.footprint_radius();
        size(other).total_cmp(&size(one))
    });
    let mut taken: Vec<Vec<Point2<f64>>> = Vec::new();
    for (placed, (shape, finish, mass)) in drawn.into_iter().enumerate() {
        let place = find(&shape, scene.table, placement, &taken, random);
        let (x, y, yaw, outline) = place.ok_or(placed)?;
        taken.push(outline);
        let id = scene.put(shape, x, y, yaw, finish);
        let object = scene.objects.last_mut().filter(|object| object.id == id);
        if let Some(object) = object {
            object.mass = mass;
        }
    }
    Ok(())
}

fn find(
    shape: &Shape,
    table: Table,
    placement: &Placement,
    taken: &[Vec<Point2<f64>>],
    random: &mut Random,
) -> Option<(f64, f64, f64, Vec<Point2<f64>>)> {
    (0..TRIES).find_map(|_| {
        let x = random.between(placement.x[0], placement.x[1]);
        let y = random.between(placement.y[0], placement.y[1]);
        let yaw = random.between(-PI, PI);
        let distance = x.hypot(y);
        if distance < placement.reach[0] || distance > placement.reach[1] {
            return None;
        }
        let outline = outline(shape, x, y, yaw);
        let on_table = outline.iter().all(|corner| {
            (table.x[0]..=table.x[1]).contains(&corner.x)
                && (table.y[0]..=table.y[1]).contains(&corner.y)
        });
        let free = taken
            .iter()
            .all(|other| distance_between(&outline, other) >= placement.gap);
        (on_table && free).then_some((x, y, yaw, outline))
    })
}

/// Returns the outline of something on the table, counterclockwise.
pub(crate) fn outline(shape: &Shape, x: f64, y: f64, yaw: f64) -> Vec<Point2<f64>> {
    let corners: Vec<[f64; 2]> = match *shape {
        Shape::Glass { radius, .. } | Shape::Plate { radius, .. } => {
            // Around the circle, not inside it.
            let outer = radius / (PI / ROUND as f64).cos();
            (0..ROUND)
                .map(|step| TAU * step as f64 / ROUND as f64)
                .map(|angle| [outer * angle.cos(), outer * angle.sin()])
                .collect()
        }
        Shape::Prism { side, .. } => Shape::triangle(side).to_vec(),
        _ => {
            let [length, width, _] = shape.extent().map(|edge| edge / 2.0);
            vec![
                [length, width],
                [-length, width],
                [-length, -width],
                [length, -width],
            ]
        }
    };
    let (sine, cosine) = yaw.sin_cos();
    corners
        .into_iter()
        .map(|[a, b]| Point2::new(x + a * cosine - b * sine, y + a * sine + b * cosine))
        .collect()
}

/// Returns the distance of two convex polygons along the best separating edge, m; negative if they overlap.
///
/// Between two corners the true distance is larger.
pub(crate) fn distance_between(one: &[Point2<f64>], other: &[Point2<f64>]) -> f64 {
    let from_edges_of = |one: &[Point2<f64>], other: &[Point2<f64>]| {
        (0..one.len())
            .map(|index| {
                let (a, b) = (one[index], one[(index + 1) % one.len()]);
                let edge = (b - a).normalize();
                let outward = Vector2::new(edge.y, -edge.x);
                other
                    .iter()
                    .map(|corner| outward.dot(&(corner - a)))
                    .fold(f64::INFINITY, f64::min)
            })
            .fold(f64::NEG_INFINITY, f64::max)
    };
    from_edges_of(one, other).max(from_edges_of(other, one))
}

/// Draws shape, looks and mass of an object: sizes and masses as in `docs/table-simulation.md`.
fn draw(class: Class, random: &mut Random) -> (Shape, Finish, f64) {
    let mut finish = finish(random);
    let millimetres = |value: f64| (value * 1e3).round() / 1e3;
    let mut length = |min: f64, max: f64| millimetres(random.between(min, max));
    let (shape, masses) = match class {
        Class::Glass => {
            let shape = Shape::Glass {
                radius: length(0.060, 0.085) / 2.0,
                height: length(0.080, 0.150),
                wall: 0.003,
            };
            (shape, [0.15, 0.35])
        }
        // Larger plates do not fit into the hand.
        Class::Plate => {
            let shape = Shape::Plate {
                radius: length(0.180, 0.200) / 2.0,
                height: length(0.015, 0.025),
            };
            (shape, [0.25, 0.40])
        }
        Class::Box => {
            let (one, other) = (length(0.040, 0.100), length(0.050, 0.160));
            let size = [one.min(other), one.max(other), length(0.030, 0.120)];
            (Shape::Box { size }, [0.05, 0.5])
        }
        Class::Prism => {
            let shape = Shape::Prism {
                side: length(0.060, 0.120),
                height: length(0.040, 0.100),
            };
            (shape, [0.05, 0.2])
        }
        Class::Brick => {
            let kinds: Vec<BrickKind> = BrickKind::all().collect();
            let kind = *random.pick(&kinds);
            (Shape::Brick { kind }, [kind.mass(); 2])
        }
        Class::Board => {
            let shape = Shape::Board {
                columns: 9,
                rows: 6,
                square: 0.025,
            };
            (shape, [0.2; 2])
        }
        Class::Clutter => {
            let size = match random.below(3) {
                // Paper, a pen, cutlery.
                0 => [
                    random.between(0.04, 0.09),
                    random.between(0.09, 0.14),
                    0.001,
                ],
                1 => [0.010, random.between(0.12, 0.15), 0.010],
                _ => [0.022, random.between(0.16, 0.20), 0.003],
            };
            (Shape::Clutter { size }, [0.01, 0.05])
        }
    };
    if matches!(class, Class::Glass) && random.chance(0.4) {
        finish.opacity = random.between(0.35, 0.7) as f32;
    }
    if matches!(class, Class::Plate) {
        let white = random.between(0.65, 0.85) as f32;
        if random.chance(0.7) {
            finish.colour = [white, white, white * random.between(0.9, 1.0) as f32];
        }
        finish.gloss = 0.3;
    }
    let mass = random.between(masses[0], masses[1]);
    (shape, finish, mass)
}

/// Linear reflectances of painted cardboard, plastic and china.
const COLOURS: [[f32; 3]; 12] = [
    [0.65, 0.05, 0.05],
    [0.05, 0.20, 0.60],
    [0.05, 0.40, 0.12],
    [0.80, 0.60, 0.05],
    [0.75, 0.28, 0.03],
    [0.35, 0.08, 0.45],
    [0.80, 0.80, 0.78],
    [0.08, 0.08, 0.09],
    [0.05, 0.42, 0.50],
    [0.75, 0.40, 0.45],
    [0.35, 0.35, 0.37],
    [0.60, 0.75, 0.80],
];

fn finish(random: &mut Random) -> Finish {
    let mut shade = |colour: [f32; 3]| {
        let factor = random.between(0.75, 1.1) as f32;
        colour.map(|value| (value * factor).min(0.9))
    };
    let (one, two) = (shade([1.0; 3]), shade([1.0; 3]));
    let colour = *random.pick(&COLOURS);
    let accent = *random.pick(&COLOURS);
    Finish {
        colour: [0, 1, 2].map(|channel| (colour[channel] * one[channel]).min(0.9)),
        accent: [0, 1, 2].map(|channel| (accent[channel] * two[channel]).min(0.9)),
        gloss: random.between(0.02, 0.25) as f32,
        opacity: 1.0,
        seed: random.bits(),
    }
}

impl Object {
    /// Returns the outline of the object on the table, counterclockwise; of use while it lies as usual.
    pub fn outline(&self) -> Vec<Point2<f64>> {
        let place = self.pose.translation.vector;
        let along = self.pose.rotation * nalgebra::Vector3::x();
        outline(&self.shape, place.x, place.y, along.y.atan2(along.x))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_do_not_overlap_and_are_in_reach() {
        for seed in 0..50 {
            let placement = Placement::default();
            let scene = Scene::random(seed, &placement).unwrap();
            assert_eq!(scene.objects.len(), 8);
            for (index, one) in scene.objects.iter().enumerate() {
                let place = one.pose.translation.vector;
                let distance = place.x.hypot(place.y);
                assert!((0.36..=0.76).contains(&distance), "{distance}");
                for other in &scene.objects[index + 1..] {
                    let apart = distance_between(&one.outline(), &other.outline());
                    assert!(apart >= placement.gap - 1e-9, "seed {seed}: {apart}");
                }
            }
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_table() {
        let placement = Placement::default();
        let scene = |seed| Scene::random(seed, &placement).unwrap();
        assert_eq!(scene(4), scene(4));
        assert_ne!(scene(4), scene(5));
    }

    #[test]
    fn a_full_table_is_refused() {
        let placement = Placement {
            count: 60,
            classes: vec![Class::Plate],
            ..Placement::default()
        };
        let refused = Scene::random(0, &placement).unwrap_err();
        assert_eq!(refused.asked, 60);
        assert!((4..40).contains(&refused.placed), "{refused}");
    }

    #[test]
    fn polygons_know_their_distance() {
        let square = |x| {
            outline(
                &Shape::Box {
                    size: [0.1, 0.1, 0.1],
                },
                x,
                0.0,
                0.0,
            )
        };
        let apart = distance_between(&square(0.0), &square(0.25));
        assert!((apart - 0.15).abs() < 1e-12);
        assert!(distance_between(&square(0.0), &square(0.05)) < 0.0);
    }
}
