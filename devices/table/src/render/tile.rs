//! Squares of the image: which solids one may show, and which may cast shadows on what it shows.

use nalgebra::Matrix3;

use super::hit::{Hit, Vector};
use super::light::{Bound, Light};
use super::primitive::Primitive;
use crate::Camera;

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

/// First and last column, first and last row that may show a solid; none for one behind the camera.
pub(super) fn on_image(solid: &Primitive, camera: &Camera) -> [usize; 4] {
    /// Maximum shift of the bounding box of the corners by lens distortion, pixels.
    const MARGIN: f64 = 4.0;
    let lens = &camera.lens;
    let all = [0, lens.width - 1, 0, lens.height - 1];
    let mut low = [f64::INFINITY; 2];
    let mut high = [f64::NEG_INFINITY; 2];
    let mut behind = 0;
    for corner in solid.corners() {
        let local = camera.pose.rotation.inverse() * corner.cast::<f64>();
        if local.z < 0.02 {
            behind += 1;
            continue;
        }
        let ideal = [local.x / local.z, local.y / local.z];
        // Far outside, the polynomial of the distortion means nothing.
        let limit = 1.5 * (lens.width as f64 / lens.focal[0]);
        let place = lens.distort(ideal.map(|value| value.clamp(-limit, limit)));
        for axis in 0..2 {
            let pixel = place[axis] * lens.focal[axis] + lens.centre[axis];
            low[axis] = low[axis].min(pixel);
            high[axis] = high[axis].max(pixel);
        }
    }
    match behind {
        8 => [1, 0, 1, 0],
        0 => {
            let first = |value: f64| (value - MARGIN).max(0.0) as usize;
            let last =
                |value: f64, size: usize| ((value + MARGIN).max(-1.0) as i64).min(size as i64 - 1);
            let right = last(high[0], lens.width);
            let bottom = last(high[1], lens.height);
            if high[0] + MARGIN < 0.0 || high[1] + MARGIN < 0.0 {
                return [1, 0, 1, 0];
            }
            [
                first(low[0]),
                right.max(0) as usize,
                first(low[1]),
                bottom.max(0) as usize,
            ]
        }
        _ => all,
    }
}

#[cfg(test)]
mod tests {
    use super::super::cast::{Caster, Rays};
    use super::*;
    use crate::{Dataset, DatasetOptions};

    /// Tables with the arm, glasses that let light through, and a camera with distortion.
    fn options() -> DatasetOptions {
        let mut options = DatasetOptions::default();
        (options.with_arm, options.placement.clutter) = (1.0, 4);
        options
    }

    #[test]
    fn a_tile_lists_all_that_its_rays_and_their_shadow_rays_meet() {
        let dataset = Dataset::new(9000, options());
        for index in 0..3 {
            let (scene, _) = dataset.scene(index).unwrap();
            let mut camera = scene.camera();
            camera.lens = camera.lens.scaled(0.2);
            let all = super::super::scene_geometry::primitives(&scene, &camera);
            let light = Light::new(&scene, &camera.pose.translation.vector, &all);
            let rays = Rays::new(camera.lens);
            let caster = Caster::new(&scene, &camera, &all, &rays, Some(&light), all.len());
            let everything: Vec<usize> = (0..all.len()).collect();
            let (mut met, mut blocked, mut listed) = (0, 0, [0; 2]);
            for top in (0..camera.lens.height).step_by(TILE) {
                for left in (0..camera.lens.width).step_by(TILE) {
                    let near = caster.near(left, top);
                    let mut sights = Sights::default();
                    for row in top..(top + TILE).min(camera.lens.height) {
                        for column in left..(left + TILE).min(camera.lens.width) {
                            for offset in [-0.5, 0.0, 0.5] {
                                let ray = rays.at(column, row, offset, -offset);
                                caster.meet(ray, &everything, None, &mut sights);
                            }
                        }
                    }
                    let casters = caster.casters(&sights);
                    listed[0] += near.len();
                    for (direction, hits) in sights.iter() {
                        let Some((solid, hit)) = hits.first() else {
                            continue;
                        };
                        met += 1;
                        assert!(hits.iter().all(|(index, _)| near.contains(index)));
                        let on = casters.on(*solid);
                        listed[1] += on.iter().map(Vec::len).sum::<usize>();
                        let place = direction * hit.distance;
                        blocked += light.check_casters(*solid, on, &all, &place);
                    }
                }
            }
            assert!(met > 1000 && blocked > 1000, "{met} {blocked}");
            // The lists are short, or they would be of no use.
            let tiles = (camera.lens.width * camera.lens.height).div_ceil(TILE * TILE);
            assert!(listed[0] < tiles * all.len() / 2, "{listed:?}");
            assert!(listed[1] < met * all.len() / 2, "{listed:?}");
        }
    }
}
