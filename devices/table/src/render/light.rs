//! Light on the table and on things, with soft shadows.

use std::f32::consts::TAU;
use std::sync::Mutex;

use super::hit::Vector;
use super::primitive::Primitive;
use super::{THREADS, work};
use crate::random::hash;
use crate::table_scene::{Scene, Table};

/// Samples of each lamp's disc, and of the sky, for shadows on the table; at most 16.
const SAMPLES: usize = 8;
/// Samples of each lamp's disc for shadows on things.
const MIN_SAMPLES: usize = 4;
/// Distance of the places at which light on the table is computed, m.
const CELL: f32 = 0.002;
/// Twice the distance from a surface at which rays to lamps start, m.
const LIFT: f32 = 4e-4;
/// Largest growth of a cone's radius per length: beyond it, the tip is nearly a sphere.
const MAX_GROWTH: f32 = 0.95;
/// Part of the ambient light that reaches a place that sees nothing of the sky.
const BOUNCED: f32 = 0.25;

/// The lamps, relative to the camera.
pub(super) struct Light {
    lamps: Vec<Source>,
    ambient: f32,
    tint: [f32; 3],
    /// For each lamp and solid: who can be in the way.
    blockers: Vec<Vec<Vec<usize>>>,
    shadows: bool,
    table: Plane,
}

struct Source {
    centre: Vector,
    samples: [Vector; SAMPLES],
    power: f32,
}

/// Spheres that contain a solid together.
pub(super) struct Bound {
    middles: Vec<Vector>,
    radius: f32,
}

impl Bound {
    pub(super) fn new(solid: &Primitive) -> Self {
        let (middles, radius) = solid.solid.spheres();
        let place = |middle: Vector| solid.centre + solid.rotation * middle;
        Self {
            middles: middles.into_iter().map(place).collect(),
            radius: radius + 1e-5,
        }
    }
}

/// Everything between a sphere and a lamp: the spheres from the one to the other whose radius changes evenly.
struct Cone {
    from: Vector,
    radius: f32,
    /// To the lamp.
    direction: Vector,
    length: f32,
    /// Growth of the radius per length.
    growth: f32,
    /// Offset per distance from the axis at which a sphere comes nearest.
    slant: f32,
}

impl Cone {
    /// Returns the cone; `None` if one end contains the other.
    fn new(from: &Vector, radius: f32, lamp: &Source) -> Option<Self> {
        let to = lamp.centre - from;
        let length = to.norm();
        let spread = (lamp.samples[SAMPLES - 1] - lamp.centre).norm();
        let growth = (spread - radius) / length;
        (growth.abs() < MAX_GROWTH).then(|| Self {
            from: *from,
            radius,
            direction: to / length,
            length,
            growth,
            slant: growth / (1.0 - growth * growth).sqrt(),
        })
    }

    /// Returns whether a solid may be in the way.
    fn touches(&self, bound: &Bound) -> bool {
        bound.middles.iter().any(|middle| {
            let gap = middle - self.from;
            let along = gap.dot(&self.direction);
            let beside = (gap.norm_squared() - along * along).max(0.0).sqrt();
            let nearest = (along + beside * self.slant).clamp(0.0, self.length);
            let distance = beside.hypot(along - nearest);
            distance <= self.radius + self.growth * nearest + bound.radius
        })
    }
}

/// Irradiance of the table.
struct Plane {
    origin: [f32; 2],
    height: f32,
    columns: usize,
    rows: usize,
    light: Vec<f32>,
}

impl Light {
    pub(super) fn new(scene: &Scene, eye: &nalgebra::Vector3<f64>, all: &[Primitive]) -> Self {
        let lighting = &scene.lighting;
        let lamps: Vec<Source> = lighting
            .lamps
            .iter()
            .map(|lamp| {
                let centre: Vector = (nalgebra::Vector3::from(lamp.position) - eye).cast();
                Source {
                    centre,
                    samples: std::array::from_fn(|index| {
                        let [a, b] = disc(index);
                        centre + Vector::new(a, b, 0.0) * lamp.radius as f32
                    }),
                    power: lamp.power,
                }
            })
            .collect();
        let blockers = lamps
            .iter()
            .map(|lamp| all.iter().map(|one| blockers(lamp, one, all)).collect())
            .collect();
        let mut light = Self {
            table: Plane::new(&scene.table, eye),
            lamps,
            ambient: lighting.ambient,
            tint: lighting.tint,
            blockers,
            shadows: lighting.shadows,
        };
        light.fall_on_table(all);
        light
    }

    pub(super) fn tint(&self) -> [f32; 3] {
        self.tint
    }

    /// Irradiance of the table at a place relative to the camera, m.
    pub(super) fn on_table(&self, x: f32, y: f32) -> f32 {
        self.table.at(x, y)
    }

    /// Irradiance without shadows.
    pub(super) fn unshadowed(&self, place: &Vector, normal: &Vector) -> f32 {
        let direct: f32 = self
            .lamps
            .iter()
            .map(|lamp| lamp.falls(place, normal))
            .sum();
        direct + self.ambient
    }

    /// Returns, for each lamp, which solids may cast its shadow on places of a solid that are within a sphere.
    pub(super) fn casters(
        &self,
        index: usize,
        bounds: &[Bound],
        middle: &Vector,
        radius: f32,
    ) -> Vec<Vec<usize>> {
        let of_lamp = |(lamp, blockers): (&Source, &Vec<Vec<usize>>)| {
            let cone = Cone::new(middle, radius + LIFT, lamp);
            let touches = |other: &usize| match &cone {
                Some(cone) => cone.touches(&bounds[*other]),
                None => true,
            };
            blockers[index].iter().copied().filter(touches).collect()
        };
        if !self.shadows {
            return vec![Vec::new(); self.lamps.len()];
        }
        self.lamps.iter().zip(&self.blockers).map(of_lamp).collect()
    }

    /// Irradiance of a place on a solid, and the light of its highlight; `casters`: for each lamp, which solids may be in
    /// the way; `pixel`: which ray, and 1 if it is the only one of its pixel.
    pub(super) fn on_solid(
        &self,
        casters: &[Vec<usize>],
        all: &[Primitive],
        place: &Vector,
        normal: &Vector,
        pixel: [u64; 2],
    ) -> (f32, f32) {
        let view = -place.normalize();
        let mut diffuse = self.ambient * (0.7 + 0.3 * normal.z);
        let mut highlight = 0.0;
        for (number, lamp) in self.lamps.iter().enumerate() {
            let falls = lamp.falls(place, normal);
            if falls <= 0.0 {
                continue;
            }
            let casters = &casters[number];
            let seen = if self.shadows && !casters.is_empty() {
                lamp.seen(casters, all, place, normal, pixel)
            } else {
                1.0
            };
            diffuse += falls * seen;
            let half = ((lamp.centre - place).normalize() + view).normalize();
            let along = normal.dot(&half);
            if along > 0.85 {
                highlight += seen * lamp.power * along.powi(60);
            }
        }
        (diffuse, highlight)
    }

    /// Asserts that each solid that blocks a ray from a place on a solid to a lamp is listed; returns the number of such rays.
    #[cfg(test)]
    pub(super) fn check_casters(
        &self,
        index: usize,
        casters: &[Vec<usize>],
        all: &[Primitive],
        place: &Vector,
    ) -> usize {
        let mut blocked = 0;
        for (number, lamp) in self.lamps.iter().enumerate() {
            for &other in &self.blockers[number][index] {
                for sample in &lamp.samples {
                    if all[other].blocks(place, &(sample - place), 1.0) {
                        assert!(casters[number].contains(&other), "{index} {other}");
                        blocked += 1;
                    }
                }
            }
        }
        blocked
    }

    fn fall_on_table(&mut self, all: &[Primitive]) {
        let mut light = std::mem::take(&mut self.table.light);
        let (plane, lamps) = (&self.table, &self.lamps);
        let sky: [Vector; SAMPLES] = std::array::from_fn(|index| {
            let [a, b] = disc(index);
            // Projected onto the disc, the sky weighs as its cosine.
            Vector::new(a, b, (1.0 - a * a - b * b).max(0.02).sqrt())
        });
        let corners: Vec<[Vector; 8]> = all.iter().map(Primitive::corners).collect();
        let band = plane.columns * 16;
        let bands = Mutex::new(light.chunks_mut(band).enumerate());
        work(THREADS, || {
            while let Some((number, cells)) = super::next(&bands) {
                let first = number * 16;
                let last = (first + cells.len() / plane.columns).min(plane.rows);
                let mut covered = vec![0_u16; cells.len()];
                if self.shadows {
                    for (solid, corners) in all.iter().zip(&corners) {
                        if solid.opacity >= 1.0 {
                            plane.cover(&mut covered, [first, last], solid, corners);
                        }
                    }
                }
                let mut masks = covered.clone();
                let open = |masks: &mut Vec<u16>, towards: &dyn Fn(usize) -> (Vector, bool)| {
                    masks.copy_from_slice(&covered);
                    if self.shadows {
                        for sample in 0..SAMPLES {
                            let (towards, is_place) = towards(sample);
                            for (index, solid) in all.iter().enumerate() {
                                if passes(solid, sample, index) {
                                    continue;
                                }
                                plane.darken(
                                    masks,
                                    [first, last],
                                    (solid, &corners[index]),
                                    &towards,
                                    is_place,
                                    sample,
                                );
                            }
                        }
                    }
                };
                for lamp in lamps {
                    open(&mut masks, &|sample| (lamp.samples[sample], true));
                    for (cell, (value, mask)) in cells.iter_mut().zip(&masks).enumerate() {
                        let place = plane.place(cell % plane.columns, first + cell / plane.columns);
                        *value += lamp.falls(&place, &Vector::z()) * share(*mask);
                    }
                }
                open(&mut masks, &|sample| (sky[sample], false));
                for (value, mask) in cells.iter_mut().zip(&masks) {
                    // What something stands on is not seen; it must not darken what is beside it.
                    if *mask == u16::MAX {
                        *value = f32::NAN;
                        continue;
                    }
                    *value += self.ambient * (BOUNCED + (1.0 - BOUNCED) * share(*mask));
                }
            }
        });
        self.table.light = light;
        self.table.fill();
    }
}

/// Part of the samples that no bit stands for.
fn share(mask: u16) -> f32 {
    1.0 - (mask.count_ones() as f32 / SAMPLES as f32).min(1.0)
}

/// Returns whether this sample passes a solid that lets some light through.
fn passes(solid: &Primitive, sample: usize, index: usize) -> bool {
    solid.opacity < 1.0
        && (hash((sample * 1000 + index) as u64) % 1000) as f32 > solid.opacity * 1000.0
}

/// Places of a sunflower's seeds on a disc of radius 1.
fn disc(index: usize) -> [f32; 2] {
    let radius = ((index as f32 + 0.5) / SAMPLES as f32).sqrt();
    let angle = TAU * 0.381_966 * index as f32;
    [radius * angle.cos(), radius * angle.sin()]
}

/// Returns who can cast a shadow of this lamp on a solid: whose sphere comes near the cone between both.
fn blockers(lamp: &Source, one: &Primitive, all: &[Primitive]) -> Vec<usize> {
    let to = lamp.centre - one.centre;
    let length = to.norm();
    let direction = to / length;
    let spread = (lamp.samples[SAMPLES - 1] - lamp.centre).norm();
    let near = |other: &Primitive| {
        let gap = other.centre - one.centre;
        let along = gap.dot(&direction);
        let beside = (gap - direction * along).norm();
        let wide = one.radius + (spread - one.radius) * (along / length).clamp(0.0, 1.0);
        along > -(one.radius + other.radius)
            && along < length
            && beside < wide.max(one.radius.min(spread)) + other.radius
    };
    all.iter()
        .enumerate()
        .filter(|(_, other)| {
            // What is hollow shades itself.
            let itself = std::ptr::eq(*other, one);
            near(other) && (!itself || matches!(one.solid, super::primitive::Solid::Cup(..)))
        })
        .map(|(index, _)| index)
        .collect()
}

impl Source {
    /// Irradiance without shadow.
    fn falls(&self, place: &Vector, normal: &Vector) -> f32 {
        let to = self.centre - place;
        let square = to.norm_squared();
        self.power * normal.dot(&to).max(0.0) / (square * square.sqrt())
    }

    fn seen(
        &self,
        blockers: &[usize],
        all: &[Primitive],
        place: &Vector,
        normal: &Vector,
        [pixel, alone]: [u64; 2],
    ) -> f32 {
        let from = place + normal * (LIFT / 2.0);
        let first = hash(pixel) as usize % (SAMPLES / MIN_SAMPLES);
        let is_free = |step: usize| {
            let sample = first + step * SAMPLES / MIN_SAMPLES;
            let towards = self.samples[sample] - from;
            !blockers.iter().any(|&index| {
                let solid = &all[index];
                solid.is_near(&from, &towards)
                    && !passes(solid, sample, index)
                    && solid.blocks(&from, &towards, 1.0)
            })
        };
        // Mostly all samples agree: two that do are enough, and one where a pixel has several rays.
        let one = is_free(0);
        if alone == 0 || one == is_free(MIN_SAMPLES / 2) {
            return if one { 1.0 } else { 0.0 };
        }
        let free = 1
            + (0..MIN_SAMPLES)
                .filter(|step| step % (MIN_SAMPLES / 2) != 0 && is_free(*step))
                .count();
        free as f32 / MIN_SAMPLES as f32
    }
}

impl Plane {
    fn new(table: &Table, eye: &nalgebra::Vector3<f64>) -> Self {
        let length =
            |[from, to]: [f64; 2]| (((to - from) as f32 / CELL).ceil() as usize).max(1) + 1;
        let (columns, rows) = (length(table.x), length(table.y));
        Self {
            origin: [(table.x[0] - eye.x) as f32, (table.y[0] - eye.y) as f32],
            height: (table.surface - eye.z) as f32,
            columns,
            rows,
            light: vec![0.0; columns * rows],
        }
    }

    /// Gives the cells below things the light of the cells beside them.
    fn fill(&mut self) {
        let before = self.light.clone();
        let (width, height) = (self.columns, self.rows);
        for (index, value) in self.light.iter_mut().enumerate() {
            if !value.is_nan() {
                continue;
            }
            let (column, row) = (index % width, index / width);
            let columns = column.saturating_sub(1)..(column + 2).min(width);
            let rows = row.saturating_sub(1)..(row + 2).min(height);
            let around =
                rows.flat_map(|row| columns.clone().map(move |column| row * width + column));
            let lit: Vec<f32> = around
                .map(|index| before[index])
                .filter(|light| !light.is_nan())
                .collect();
            *value = lit.iter().sum::<f32>() / lit.len().max(1) as f32;
        }
    }

    fn place(&self, column: usize, row: usize) -> Vector {
        Vector::new(
            self.origin[0] + column as f32 * CELL,
            self.origin[1] + row as f32 * CELL,
            self.height,
        )
    }

    fn at(&self, x: f32, y: f32) -> f32 {
        let across = ((x - self.origin[0]) / CELL).clamp(0.0, (self.columns - 1) as f32);
        let along = ((y - self.origin[1]) / CELL).clamp(0.0, (self.rows - 1) as f32);
        let (left, top) = (across as usize, along as usize);
        let right = (left + 1).min(self.columns - 1);
        let bottom = (top + 1).min(self.rows - 1);
        let (a, b) = (across - left as f32, along - top as f32);
        let value = |column: usize, row: usize| self.light[row * self.columns + column];
        let upper = value(left, top) + (value(right, top) - value(left, top)) * a;
        let lower = value(left, bottom) + (value(right, bottom) - value(left, bottom)) * a;
        upper + (lower - upper) * b
    }

    /// Marks the cells on which a solid stands: nothing shines there, whatever the direction.
    fn cover(&self, masks: &mut [u16], rows: [usize; 2], solid: &Primitive, corners: &[Vector; 8]) {
        let lowest = corners
            .iter()
            .map(|corner| corner.z)
            .fold(f32::INFINITY, f32::min);
        if lowest > self.height + CELL {
            return;
        }
        let [columns, rows_below] = [0, 1].map(|axis| {
            let cell = |value: f32| ((value - self.origin[axis]) / CELL).max(0.0) as usize;
            let (low, high) = (
                solid.centre[axis] - solid.radius - CELL,
                solid.centre[axis] + solid.radius + CELL,
            );
            cell(low)..cell(high) + 1
        });
        let (first, last) = (rows[0].max(rows_below.start), rows[1].min(rows_below.end));
        for row in first..last {
            for column in columns.start..columns.end.min(self.columns) {
                let place = self.place(column, row);
                let reach = (place - solid.centre).xy().norm_squared();
                if reach < solid.radius * solid.radius && solid.is_over(&place) {
                    masks[(row - rows[0]) * self.columns + column] = u16::MAX;
                }
            }
        }
    }

    /// Marks the cells of some rows that a solid hides from a place or a direction.
    fn darken(
        &self,
        masks: &mut [u16],
        rows: [usize; 2],
        (solid, corners): (&Primitive, &[Vector; 8]),
        towards: &Vector,
        is_place: bool,
        sample: usize,
    ) {
        let mut low = [f32::INFINITY; 2];
        let mut high = [f32::NEG_INFINITY; 2];
        for &corner in corners {
            let away = if is_place { corner - towards } else { -towards };
            // What is not above the table, or not below the lamp, casts no shadow that ends.
            if corner.z <= self.height {
                for (axis, value) in [corner.x, corner.y].into_iter().enumerate() {
                    low[axis] = low[axis].min(value);
                    high[axis] = high[axis].max(value);
                }
                continue;
            }
            if away.z > -1e-3 {
                return;
            }
            let foot = corner + away * ((self.height - corner.z) / away.z);
            for (axis, value) in [foot.x, foot.y].into_iter().enumerate() {
                low[axis] = low[axis].min(value);
                high[axis] = high[axis].max(value);
            }
        }
        let cell = |value: f32, axis: usize| (value - self.origin[axis]) / CELL;
        let range = |axis: usize, from: usize, to: usize| {
            let first = cell(low[axis], axis).ceil().max(from as f32) as usize;
            let last = (cell(high[axis], axis).floor() + 1.0).clamp(0.0, to as f32) as usize;
            first..last
        };
        let columns = range(0, 0, self.columns);
        for row in range(1, rows[0], rows[1]) {
            for column in columns.clone() {
                let mask = &mut masks[(row - rows[0]) * self.columns + column];
                let place = self.place(column, row);
                let to = if is_place { towards - place } else { *towards };
                let most = if is_place { 1.0 } else { f32::INFINITY };
                if *mask >> sample & 1 == 0 && solid.blocks(&place, &to, most) {
                    *mask |= 1 << sample;
                }
            }
        }
    }
}

impl Primitive {
    /// Returns whether it stands on this place: a ray from inside of it meets nothing.
    fn is_over(&self, place: &Vector) -> bool {
        let local = self.rotation.tr_mul(&(place - self.centre));
        let half = self.solid.half_extent() + Vector::repeat(1e-4);
        if (0..3).any(|axis| local[axis].abs() > half[axis]) {
            return false;
        }
        match self.solid {
            super::primitive::Solid::Cup(radius, ..)
            | super::primitive::Solid::Cylinder(radius, _) => local.xy().norm() < radius,
            super::primitive::Solid::Box(_) => true,
            _ => false,
        }
    }
}

const _: () = assert!(SAMPLES <= 16 && SAMPLES.is_multiple_of(MIN_SAMPLES));
