//! From pixels to light: rays, edges, transparency.

use std::sync::Mutex;

use nalgebra::Matrix3;

use super::hit::{Hit, Vector};
use super::light::{Bound, Light};
use super::primitive::Primitive;
use super::tile::{self, Casters, Directions, Frustum, Sights, TILE};
use super::{THREADS, next, work};
use crate::table_scene::{Scene, Table};
use crate::texture::Wood;
use crate::{Camera, Lens};

/// Depth of the room's floor below the table, m, and its linear reflectance.
const FLOOR: f32 = 0.75;
const FLOOR_COLOUR: [f32; 3] = [0.18, 0.18, 0.19];
/// Identifiers of pixels in the ground truth: no solid, or its number in the upper bits and its face in the lowest three.
const NOTHING: u32 = 0;
/// Maximum number of transparent surfaces seen one behind the other.
const DEEPEST: usize = 3;

/// Directions of all pixels of a lens, as multiples of its focal length.
pub(super) struct Rays {
    pub(super) lens: Lens,
    places: Vec<[f32; 2]>,
    /// Directions of each tile, row after row.
    tiles: Vec<Directions>,
}

impl Rays {
    pub(super) fn new(lens: Lens) -> Self {
        let mut places = vec![[0.0; 2]; lens.width * lens.height];
        let rows = Mutex::new(places.chunks_mut(lens.width).enumerate());
        work(THREADS, || {
            while let Some((row, places)) = next(&rows) {
                for (column, place) in places.iter_mut().enumerate() {
                    let ray = lens.direction([column as f64, row as f64]);
                    *place = [ray.x as f32, ray.y as f32];
                }
            }
        });
        Self {
            lens,
            tiles: tile::directions(&places, lens.width, lens.focal),
            places,
        }
    }

    /// Direction of a place beside a pixel, in pixels: from the pixel and its neighbours.
    pub(super) fn at(&self, column: usize, row: usize, right: f32, down: f32) -> [f32; 2] {
        let here = row * self.lens.width + column;
        let place = self.places[here];
        if right == 0.0 && down == 0.0 {
            return place;
        }
        let step = |can: bool, forward: usize, back: usize, axis: usize| {
            if can {
                self.places[forward][axis] - place[axis]
            } else {
                place[axis] - self.places[back][axis]
            }
        };
        let width = self.lens.width;
        let (has_right, has_below) = (column + 1 < width, row + 1 < self.lens.height);
        std::array::from_fn(|axis| {
            let across = step(has_right, here + 1, here.saturating_sub(1), axis);
            let along = step(has_below, here + width, here.saturating_sub(width), axis);
            // The image of one pixel has no neighbours.
            let across = if width > 1 { across } else { 0.0 };
            let along = if self.lens.height > 1 { along } else { 0.0 };
            place[axis] + across * right + along * down
        })
    }
}

/// Surface at the centre of each pixel.
pub(super) struct Picture {
    /// Linear light in red, green and blue.
    pub(super) light: Vec<[f32; 3]>,
    /// Visible surface.
    pub(super) keys: Vec<u32>,
    /// Depth along the optical axis, m.
    pub(super) depth: Vec<f32>,
    /// Pixels that each owner would have, were nothing in front of it.
    pub(super) whole: Vec<usize>,
}

impl Picture {
    /// Number of the solid that a pixel shows.
    pub(super) fn solid(key: u32) -> Option<usize> {
        (key != NOTHING).then(|| (key as usize >> 3) - 1)
    }
}

fn key_of(index: usize, face: u8) -> u32 {
    ((index + 1) << 3) as u32 | u32::from(face)
}

/// A scene as one camera sees it.
pub(super) struct Caster<'a> {
    pub(super) all: &'a [Primitive],
    pub(super) rays: &'a Rays,
    pub(super) light: Option<&'a Light>,
    pub(super) owners: usize,
    rotation: Matrix3<f32>,
    eye: [f32; 2],
    wood: Wood,
    table: Table,
    height: f32,
    /// First and last column and row that show something of a solid.
    boxes: Vec<[usize; 4]>,
    /// Spheres that contain each solid.
    bounds: Vec<Bound>,
}

struct Seen {
    key: u32,
    depth: f32,
    light: [f32; 3],
}

impl<'a> Caster<'a> {
    pub(super) fn new(
        scene: &Scene,
        camera: &Camera,
        all: &'a [Primitive],
        rays: &'a Rays,
        light: Option<&'a Light>,
        owners: usize,
    ) -> Self {
        let rotation: Matrix3<f32> = camera.pose.rotation.matrix().cast();
        let eye = camera.pose.translation.vector;
        Self {
            boxes: all
                .iter()
                .map(|solid| tile::on_image(solid, camera))
                .collect(),
            bounds: all.iter().map(Bound::new).collect(),
            all,
            rays,
            light,
            owners,
            rotation,
            eye: [eye.x as f32, eye.y as f32],
            wood: Wood::new(scene.table.seed),
            table: scene.table,
            height: (scene.table.surface - eye.z) as f32,
        }
    }

    /// Casts a ray through the middle of each pixel.
    pub(super) fn cast(&self) -> Picture {
        let (width, height) = (self.rays.lens.width, self.rays.lens.height);
        let mut picture = Picture {
            light: vec![[0.0; 3]; width * height],
            keys: vec![NOTHING; width * height],
            depth: vec![0.0; width * height],
            whole: vec![0; self.owners],
        };
        let band = width * TILE;
        let parts = picture.light.chunks_mut(band);
        let parts = parts.zip(picture.keys.chunks_mut(band));
        let parts = Mutex::new(parts.zip(picture.depth.chunks_mut(band)).enumerate());
        let totals = Mutex::new(&mut picture.whole);
        work(THREADS, || {
            let mut whole = vec![0; self.owners];
            let mut sights = Sights::default();
            while let Some((number, ((light, keys), depth))) = next(&parts) {
                let top = number * TILE;
                for left in (0..width).step_by(TILE) {
                    let near = self.near(left, top);
                    let columns = left..(left + TILE).min(width);
                    let rows = top..(top + TILE).min(height);
                    if near.is_empty() {
                        for row in rows {
                            for column in columns.clone() {
                                let place = (row - top) * width + column;
                                let ray = self.rays.at(column, row, 0.0, 0.0);
                                let direction = self.rotation * Vector::new(ray[0], ray[1], 1.0);
                                (depth[place], light[place]) = self.ground(&direction);
                            }
                        }
                        continue;
                    }
                    sights.clear();
                    for row in rows.clone() {
                        for column in columns.clone() {
                            let ray = self.rays.at(column, row, 0.0, 0.0);
                            self.meet(ray, &near, Some(&mut whole), &mut sights);
                        }
                    }
                    let casters = self.casters(&sights);
                    let pixels = rows.flat_map(|row| columns.clone().map(move |c| (row, c)));
                    for ((row, column), (direction, hits)) in pixels.zip(sights.iter()) {
                        let place = (row - top) * width + column;
                        let pixel = (row * width + column) as u64;
                        let seen = self.see(direction, hits, &casters, pixel, true);
                        light[place] = seen.light;
                        keys[place] = seen.key;
                        depth[place] = seen.depth;
                    }
                }
            }
            let mut totals = super::lock(&totals);
            for (total, here) in totals.iter_mut().zip(whole) {
                *total += here;
            }
        });
        picture
    }

    /// Casts more rays through the pixels where a face ends; `finer` along each side.
    pub(super) fn smooth(&self, picture: &mut Picture, finer: usize) {
        if finer < 2 {
            return;
        }
        let (width, height) = (self.rays.lens.width, self.rays.lens.height);
        let keys = &picture.keys;
        let bands = Mutex::new(picture.light.chunks_mut(width * TILE).enumerate());
        work(THREADS, || {
            let (mut sights, mut edges) = (Sights::default(), Vec::new());
            let mut few = Vec::new();
            while let Some((number, light)) = next(&bands) {
                let top = number * TILE;
                for left in (0..width).step_by(TILE) {
                    let near = self.near(left, top);
                    if near.is_empty() {
                        continue;
                    }
                    let clear = |index: &usize| self.all[*index].opacity < 1.0;
                    let clear: Vec<usize> = near.iter().copied().filter(clear).collect();
                    sights.clear();
                    edges.clear();
                    for row in top..(top + TILE).min(height) {
                        for column in left..(left + TILE).min(width) {
                            if is_edge(keys, width, height, column, row) {
                                few.clone_from(&clear);
                                add_around(&mut few, keys, [width, height], column, row);
                                self.meet_within(column, row, finer, &few, &mut sights);
                                edges.push((column, row));
                            }
                        }
                    }
                    let casters = self.casters(&sights);
                    let mut sights = sights.iter();
                    for &(column, row) in &edges {
                        let first = (row * width + column) as u64;
                        let place = (row - top) * width + column;
                        light[place] = self.mean(&mut sights, finer, &casters, first);
                    }
                }
            }
        });
    }

    /// Meets what the rays of one pixel show, `finer` along each side.
    fn meet_within(
        &self,
        column: usize,
        row: usize,
        finer: usize,
        near: &[usize],
        sights: &mut Sights,
    ) {
        let offset = |step: usize| (step as f32 + 0.5) / finer as f32 - 0.5;
        for part in 0..finer * finer {
            let (right, down) = (offset(part % finer), offset(part / finer));
            let ray = self.rays.at(column, row, right, down);
            self.meet(ray, near, None, sights);
        }
    }

    /// Returns the mean light of the next rays, those of one pixel.
    fn mean<'s>(
        &self,
        sights: &mut impl Iterator<Item = (&'s Vector, &'s [(usize, Hit)])>,
        finer: usize,
        casters: &Casters,
        pixel: u64,
    ) -> [f32; 3] {
        let mut sum = [0.0; 3];
        let rays = sights.take(finer * finer);
        for (part, (direction, hits)) in rays.enumerate() {
            let seen = self.see(direction, hits, casters, pixel + part as u64, false);
            for (sum, light) in sum.iter_mut().zip(seen.light) {
                *sum += light;
            }
        }
        sum.map(|sum| sum / (finer * finer) as f32)
    }

    /// The solids that a tile may show.
    pub(super) fn near(&self, left: usize, top: usize) -> Vec<usize> {
        let [right, bottom] = [left + TILE, top + TILE];
        let number = top / TILE * self.rays.lens.width.div_ceil(TILE) + left / TILE;
        let frustum = Frustum::new(self.rays.tiles[number], &self.rotation);
        (0..self.all.len())
            .filter(|&index| {
                let [first, last, upper, lower] = self.boxes[index];
                first < right
                    && last >= left
                    && upper < bottom
                    && lower >= top
                    && frustum.may_show(&self.all[index])
            })
            .collect()
    }

    /// Adds a ray and the surfaces that it meets.
    pub(super) fn meet(
        &self,
        ray: [f32; 2],
        near: &[usize],
        mut whole: Option<&mut Vec<usize>>,
        sights: &mut Sights,
    ) {
        let direction = self.rotation * Vector::new(ray[0], ray[1], 1.0);
        let mut hits: [Option<(usize, Hit)>; DEEPEST] = [None; DEEPEST];
        for &index in near {
            let solid = &self.all[index];
            let Some(hit) = solid.meet_from_eye(&direction) else {
                continue;
            };
            if let (Some(whole), Some(owner)) = (&mut whole, solid.owner) {
                whole[owner] += 1;
            }
            insert(&mut hits, index, hit);
        }
        sights.push(direction, hits.into_iter().flatten());
    }

    pub(super) fn casters(&self, sights: &Sights) -> Casters {
        match self.light {
            Some(light) => sights.casters(self.all, &self.bounds, light),
            None => Casters::default(),
        }
    }

    /// Returns what a ray sees; `alone` if it is the only one through its pixel.
    fn see(
        &self,
        direction: &Vector,
        hits: &[(usize, Hit)],
        casters: &Casters,
        pixel: u64,
        alone: bool,
    ) -> Seen {
        let mut seen = Seen {
            key: NOTHING,
            depth: 0.0,
            light: [0.0; 3],
        };
        let mut left = 1.0;
        for &(index, hit) in hits {
            if self.is_under_table(direction, hit.distance) {
                break;
            }
            if seen.depth == 0.0 {
                seen.depth = hit.distance;
                seen.key = key_of(index, hit.face);
            }
            let opacity = self.all[index].opacity;
            let light = self.shade((index, &hit), direction, casters, pixel, alone);
            for (sum, light) in seen.light.iter_mut().zip(light) {
                *sum += left * opacity * light;
            }
            left *= 1.0 - opacity;
            if left < 0.01 {
                return seen;
            }
        }
        let (distance, light) = self.ground(direction);
        if seen.depth == 0.0 {
            seen.depth = distance;
        }
        for (sum, light) in seen.light.iter_mut().zip(light) {
            *sum += left * light;
        }
        seen
    }

    fn is_under_table(&self, direction: &Vector, distance: f32) -> bool {
        if direction.z >= 0.0 {
            return false;
        }
        let table = self.height / direction.z;
        table < distance - 1e-5 && self.is_table(direction * table)
    }

    fn is_table(&self, place: Vector) -> bool {
        let inside = |value: f32, [from, to]: [f64; 2]| (from as f32..to as f32).contains(&value);
        inside(place.x + self.eye[0], self.table.x) && inside(place.y + self.eye[1], self.table.y)
    }

    /// The table, or the floor beside it.
    fn ground(&self, direction: &Vector) -> (f32, [f32; 3]) {
        if direction.z >= -1e-6 {
            return (0.0, [0.05; 3]);
        }
        let distance = self.height / direction.z;
        let place = direction * distance;
        let light = |colour: [f32; 3], irradiance: f32, tint: [f32; 3]| {
            std::array::from_fn(|channel| colour[channel] * irradiance * tint[channel])
        };
        let Some(lamps) = self.light else {
            let beside = (self.height - FLOOR) / direction.z;
            let distance = if self.is_table(place) {
                distance
            } else {
                beside
            };
            return (distance, [0.0; 3]);
        };
        if self.is_table(place) {
            let colour = self
                .wood
                .colour(place.x + self.eye[0], place.y + self.eye[1]);
            let irradiance = lamps.on_table(place.x, place.y);
            return (distance, light(colour, irradiance, lamps.tint()));
        }
        let distance = (self.height - FLOOR) / direction.z;
        let irradiance = lamps.unshadowed(&(direction * distance), &Vector::z());
        (distance, light(FLOOR_COLOUR, irradiance, lamps.tint()))
    }

    fn shade(
        &self,
        (index, hit): (usize, &Hit),
        direction: &Vector,
        casters: &Casters,
        pixel: u64,
        alone: bool,
    ) -> [f32; 3] {
        let Some(lamps) = self.light else {
            return [0.0; 3];
        };
        let solid = &self.all[index];
        let wide = hit.distance / self.rays.lens.focal[0] as f32;
        let surface = solid.material.at(hit, &solid.solid.half_extent(), wide);
        let place = direction * hit.distance;
        let normal = solid.rotation * surface.normal;
        let casters = casters.on(index);
        let ray = [pixel, u64::from(alone)];
        let (diffuse, highlight) = lamps.on_solid(casters, self.all, &place, &normal, ray);
        let tint = lamps.tint();
        std::array::from_fn(|channel| {
            (surface.colour[channel] * diffuse + surface.gloss * highlight) * tint[channel]
        })
    }
}

fn insert(hits: &mut [Option<(usize, Hit)>; DEEPEST], index: usize, hit: Hit) {
    let mut new = Some((index, hit));
    for slot in hits {
        let nearer = match (&new, &*slot) {
            (Some((_, new)), Some((_, old))) => new.distance < old.distance,
            (Some(_), None) => true,
            (None, _) => return,
        };
        if nearer {
            std::mem::swap(slot, &mut new);
        }
    }
}

/// Adds the solids that a pixel and those around it show.
fn add_around(
    solids: &mut Vec<usize>,
    keys: &[u32],
    [width, height]: [usize; 2],
    column: usize,
    row: usize,
) {
    for y in row.saturating_sub(1)..(row + 2).min(height) {
        for x in column.saturating_sub(1)..(column + 2).min(width) {
            if let Some(index) = Picture::solid(keys[y * width + x])
                && !solids.contains(&index)
            {
                solids.push(index);
            }
        }
    }
}

fn is_edge(keys: &[u32], width: usize, height: usize, column: usize, row: usize) -> bool {
    let here = row * width + column;
    let key = keys[here];
    (column > 0 && keys[here - 1] != key)
        || (column + 1 < width && keys[here + 1] != key)
        || (row > 0 && keys[here - width] != key)
        || (row + 1 < height && keys[here + width] != key)
}
