//! Squares of the image: which solids one may show, and which may cast shadows on what it shows.

use nalgebra::Matrix3;

use super::light::{Bound, Light};
use super::primitive::{Hit, Primitive, Vector};

/// Side of the squares for which solids are listed, pixels.
pub(super) const TILE: usize = 16;
/// Distance beyond the border of a tile at which solids still count, pixels: rays at its border and those to its neighbours.
const MARGIN: f32 = 2.0;
/// Largest error of single precision in a distance, m.
const ROUNDING: f32 = 1e-5;

/// Smallest and largest x and y of the directions of a tile's rays, as multiples of the focal length.
pub(super) type Directions = [[f32; 2]; 2];

/// Returns the directions of each tile, row after row, with a margin; `focal` is in pixels.
pub(super) fn directions(places: &[[f32; 2]], width: usize, focal: [f64; 2]) -> Vec<Directions> {
    let height = places.len() / width;
    let mut all = Vec::new();
    for top in (0..height).step_by(TILE) {
        for left in (0..width).step_by(TILE) {
            let (right, bottom) = ((left + TILE).min(width), (top + TILE).min(height));
            let (mut low, mut high) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
            for row in top..bottom {
                for place in &places[row * width + left..row * width + right] {
                    for axis in 0..2 {
                        low[axis] = low[axis].min(place[axis]);
                        high[axis] = high[axis].max(place[axis]);
                    }
                }
            }
            let steps = [right - left, bottom - top].map(|pixels| (pixels - 1).max(1) as f32);
            for axis in 0..2 {
                let pixel = (high[axis] - low[axis]) / steps[axis];
                let margin = MARGIN * pixel.max(1.0 / focal[axis] as f32);
                low[axis] -= margin;
                high[axis] += margin;
            }
            all.push([low, high]);
        }
    }
    all
}

/// The space that the rays of a tile cross: inward normals of its four sides, in the axes of the world.
pub(super) struct Frustum([Vector; 4]);

impl Frustum {
    pub(super) fn new([low, high]: Directions, rotation: &Matrix3<f32>) -> Self {
        Self([
            rotation * Vector::new(1.0, 0.0, -low[0]),
            rotation * Vector::new(-1.0, 0.0, high[0]),
            rotation * Vector::new(0.0, 1.0, -low[1]),
            rotation * Vector::new(0.0, -1.0, high[1]),
        ])
    }

    /// Returns whether part of a solid may be inside.
    pub(super) fn may_show(&self, solid: &Primitive) -> bool {
        let Self(sides) = self;
        sides.iter().all(|side| solid.farthest(side) >= -ROUNDING)
    }
}

/// Rays of a tile with the surfaces that each meets, the nearest first.
#[derive(Default)]
pub(super) struct Sights {
    /// Direction of each ray, and its number of hits.
    rays: Vec<(Vector, usize)>,
    /// Hits of all rays, with the number of the solid.
    hits: Vec<(usize, Hit)>,
}

impl Sights {
    pub(super) fn clear(&mut self) {
        self.rays.clear();
        self.hits.clear();
    }

    pub(super) fn push(&mut self, direction: Vector, hits: impl Iterator<Item = (usize, Hit)>) {
        let before = self.hits.len();
        self.hits.extend(hits);
        self.rays.push((direction, self.hits.len() - before));
    }

    /// Returns direction and hits of each ray, in order.
    pub(super) fn iter(&self) -> impl Iterator<Item = (&Vector, &[(usize, Hit)])> {
        let mut next = 0;
        self.rays.iter().map(move |(direction, count)| {
            let first = next;
            next += count;
            (direction, &self.hits[first..next])
        })
    }

    /// Returns which solids may cast shadows on the surfaces.
    pub(super) fn casters(&self, all: &[Primitive], bounds: &[Bound], light: &Light) -> Casters {
        let mut seen: Vec<(usize, Vector, Vector)> = Vec::new();
        for (direction, hits) in self.iter() {
            for &(index, hit) in hits {
                let place = direction * hit.distance;
                match seen.iter_mut().find(|(other, ..)| *other == index) {
                    Some((_, low, high)) => {
                        *low = low.inf(&place);
                        *high = high.sup(&place);
                    }
                    None => seen.push((index, place, place)),
                }
                if all[index].opacity >= 1.0 {
                    break;
                }
            }
        }
        let casters = seen.into_iter().map(|(index, low, high)| {
            let (middle, radius) = ((low + high) / 2.0, (high - low).norm() / 2.0);
            (index, light.casters(index, bounds, &middle, radius))
        });
        Casters(casters.collect())
    }
}

/// Solids that may cast shadows on what a tile shows of each solid.
#[derive(Default)]
pub(super) struct Casters(Vec<(usize, Vec<Vec<usize>>)>);

impl Casters {
    /// Returns which may cast a shadow on a solid, for each lamp.
    pub(super) fn on(&self, index: usize) -> &[Vec<usize>] {
        let Self(all) = self;
        let found = all.iter().find(|(other, _)| *other == index);
        found.map_or(&[], |(_, casters)| casters)
    }
}
