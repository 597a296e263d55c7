//! Heights above the table in the depth image, and connected faces of one height.

use nalgebra::{Point3, Vector3};

use crate::{CameraModel, DepthImage, Result, VisionError};

/// Pixels between two pixels of one face: lost measurements leave gaps.
const REACH: i64 = 2;
/// Height up to which a pixel must have neighbours of about its height, m: noise on flat things.
const LOW: f32 = 0.025;
/// Width of the bins of the histogram of heights, m.
const BIN: f32 = 0.002;
/// Pixels beside a point among which the first measured one is compared with it, and the least difference in height, m,
/// from which that one hides something.
const BESIDE: usize = 4;
const NEARER: f32 = 0.025;

/// Bounds of the search for faces.
#[derive(Clone, Copy, Debug)]
pub(super) struct FaceLimits {
    /// Heights above the table, m.
    pub(super) height: [f64; 2],
    /// Largest difference in height of neighbouring cells of one face, m.
    pub(super) step: f64,
    /// Largest distance of a point from its face, m.
    pub(super) thickness: f64,
    /// Fewest points of a face.
    pub(super) min_points: usize,
}

/// Points of the upper face of one thing.
#[derive(Clone, Debug)]
pub(super) struct Face {
    /// Height above the table, m.
    pub(super) height: f64,
    /// x and y in the arm's base frame, m.
    pub(super) points: Vec<[f64; 2]>,
    /// True for each point beside which the depth image shows something nearer that hides the rest.
    pub(super) hidden_beside: Vec<bool>,
}

/// The directions of a depth sensor's pixels, kept from image to image.
#[derive(Debug)]
pub(super) struct DepthRays {
    camera: CameraModel,
    directions: Vec<Vector3<f32>>,
}

impl DepthRays {
    pub(super) fn new(camera: CameraModel) -> Self {
        let [width, height] = camera.intrinsics.size;
        let pixels =
            (0..height).flat_map(|row| (0..width).map(move |column| [column as f64, row as f64]));
        let directions = pixels
            .map(|pixel| (camera.pose.rotation * camera.intrinsics.direction(pixel)).cast())
            .collect();
        Self { camera, directions }
    }

    /// Returns the sensor.
    pub(super) fn camera(&self) -> &CameraModel {
        &self.camera
    }

    /// Returns the points of a depth image.
    ///
    /// Errors: [`VisionError::Unsuitable`] if the image has another size than the sensor.
    pub(super) fn points(&self, depth: &DepthImage, surface: f64) -> Result<Cloud> {
        let [width, height] = self.camera.intrinsics.size;
        if [depth.width(), depth.height()] != [width, height] {
            return Err(VisionError::Unsuitable {
                what: "depth image".to_owned(),
                expected: format!("{width} x {height} pixels, as the sensor's intrinsics"),
                actual: format!("{} x {}", depth.width(), depth.height()),
            });
        }
        let mut origin: Vector3<f32> = self.camera.pose.translation.vector.cast();
        origin.z -= surface as f32;
        let point = |(metres, direction): (&f32, &Vector3<f32>)| {
            if *metres > 0.0 && metres.is_finite() {
                Point3::from(origin + direction * *metres)
            } else {
                Point3::from(Vector3::repeat(f32::NAN))
            }
        };
        let pixels = depth.metres().iter().zip(&self.directions);
        Ok(Cloud {
            width,
            points: pixels.map(point).collect(),
        })
    }

    /// Returns the pixels at which the sensor would see a part of an empty table, between two corners of it, m.
    pub(super) fn pixels_of_table(
        &self,
        surface: f64,
        low: [f64; 2],
        high: [f64; 2],
    ) -> impl Iterator<Item = usize> + '_ {
        let mut origin: Vector3<f32> = self.camera.pose.translation.vector.cast();
        origin.z -= surface as f32;
        let is_inside = move |direction: &Vector3<f32>| {
            let there = origin - direction * (origin.z / direction.z);
            let between =
                |value: f32, axis: usize| (low[axis]..=high[axis]).contains(&f64::from(value));
            direction.z < 0.0 && between(there.x, 0) && between(there.y, 1)
        };
        let pixels = self.directions.iter().enumerate();
        pixels.filter_map(move |(index, direction)| is_inside(direction).then_some(index))
    }
}

/// The points of a depth image: x, y and height above the table, m; not a number where nothing was measured.
pub(super) struct Cloud {
    width: usize,
    points: Vec<Point3<f32>>,
}

impl Cloud {
    /// Returns the points of all pixels, row after row.
    pub(super) fn points(&self) -> &[Point3<f32>] {
        &self.points
    }

    /// Returns the height above the table at a pixel, m; `None` where nothing was measured.
    pub(super) fn height(&self, index: usize) -> Option<f32> {
        let height = self.points.get(index)?.z;
        height.is_finite().then_some(height)
    }

    /// Returns the share of the pixels that show something no higher than this above the table, m.
    pub(super) fn share_below(&self, height: f64) -> f64 {
        let low = |point: &&Point3<f32>| f64::from(point.z) <= height;
        self.points.iter().filter(low).count() as f64 / self.points.len().max(1) as f64
    }

    /// Returns whether something nearer hides what is beside a pixel.
    fn is_hidden_beside(&self, index: usize) -> bool {
        let (width, here) = (self.width as i64, self.points[index].z);
        let column = index as i64 % width;
        [(1, 1), (-1, -1), (0, width), (0, -width)].into_iter().any(
            |(across, offset): (i64, i64)| {
                let beside = (1..=BESIDE as i64).find_map(|step| {
                    let inside = (0..width).contains(&(column + across * step));
                    let other = usize::try_from(index as i64 + offset * step).ok()?;
                    let height = self.points.get(other).filter(|_| inside)?.z;
                    height.is_finite().then_some(height)
                });
                beside.is_some_and(|height| height > here + NEARER)
            },
        )
    }
}

/// Heights of the pixels of a depth image that show a part of the table. What hangs above a face hides none of its pixels:
/// a grid in the plane of the table would have both in one cell.
pub(super) struct HeightMap {
    columns: usize,
    rows: usize,
    /// Height at each pixel, m; minus infinity outside of the part and where nothing was measured.
    cells: Vec<f32>,
}

impl HeightMap {
    /// Takes the points between two corners.
    pub(super) fn new(cloud: &Cloud, low: [f64; 2], high: [f64; 2]) -> Self {
        let [low, high] = [low, high].map(|corner| corner.map(|value| value as f32));
        let height = |point: &Point3<f32>| {
            let inside =
                (low[0]..high[0]).contains(&point.x) && (low[1]..high[1]).contains(&point.y);
            if inside { point.z } else { f32::NEG_INFINITY }
        };
        let columns = cloud.width.max(1);
        Self {
            columns,
            rows: cloud.points.len() / columns,
            cells: cloud.points.iter().map(height).collect(),
        }
    }

    fn around(&self, cell: usize, reach: i64) -> impl Iterator<Item = usize> + '_ {
        let (column, row) = ((cell % self.columns) as i64, (cell / self.columns) as i64);
        let rows = (row - reach).max(0)..=(row + reach).min(self.rows as i64 - 1);
        rows.flat_map(move |row| {
            let columns = (column - reach).max(0)..=(column + reach).min(self.columns as i64 - 1);
            columns.map(move |column| (row * self.columns as i64 + column) as usize)
        })
    }

    /// Returns the faces between the limits, the highest first.
    pub(super) fn faces(&self, cloud: &Cloud, limits: &FaceLimits) -> Vec<Face> {
        let [low, high] = limits.height.map(|height| height as f32);
        let in_range = |cell: usize| (low..=high).contains(&self.cells[cell]);
        let belongs = |cell: usize| {
            in_range(cell)
                && (self.cells[cell] > LOW
                    || self.around(cell, 1).filter(|cell| in_range(*cell)).count() >= 5)
        };
        let wanted: Vec<bool> = (0..self.cells.len()).map(belongs).collect();
        // 0: none; otherwise the number of the component.
        let mut labels = vec![0_u32; self.cells.len()];
        let mut tops: Vec<f32> = vec![f32::NAN];
        let mut open = Vec::new();
        for start in 0..self.cells.len() {
            if !wanted[start] || labels[start] != 0 {
                continue;
            }
            let label = tops.len() as u32;
            let mut heights = Vec::new();
            labels[start] = label;
            open.push(start);
            while let Some(cell) = open.pop() {
                heights.push(self.cells[cell]);
                for other in self.around(cell, REACH) {
                    let near = (self.cells[other] - self.cells[cell]).abs() < limits.step as f32;
                    if wanted[other] && labels[other] == 0 && near {
                        labels[other] = label;
                        open.push(other);
                    }
                }
            }
            tops.push(mode(&heights));
        }
        self.collect(cloud, &labels, &tops, limits)
    }

    fn collect(
        &self,
        cloud: &Cloud,
        labels: &[u32],
        tops: &[f32],
        limits: &FaceLimits,
    ) -> Vec<Face> {
        let empty = Face {
            height: 0.0,
            points: Vec::new(),
            hidden_beside: Vec::new(),
        };
        let mut faces = vec![empty; tops.len()];
        for (index, point) in cloud.points.iter().enumerate() {
            let label = labels[index] as usize;
            if label != 0 && (point.z - tops[label]).abs() < limits.thickness as f32 {
                let face = &mut faces[label];
                face.height += f64::from(point.z);
                face.points.push([f64::from(point.x), f64::from(point.y)]);
                face.hidden_beside.push(cloud.is_hidden_beside(index));
            }
        }
        faces.retain(|face| face.points.len() >= limits.min_points);
        for face in &mut faces {
            face.height /= face.points.len() as f64;
        }
        faces.sort_by(|one, other| other.height.total_cmp(&one.height));
        faces
    }
}

/// Returns the height that most values are near to.
fn mode(heights: &[f32]) -> f32 {
    let lowest = heights.iter().copied().fold(f32::INFINITY, f32::min);
    let bin = |height: f32| ((height - lowest) / BIN) as usize;
    let highest = heights.iter().copied().fold(lowest, f32::max);
    let mut counts = vec![0_usize; bin(highest) + 3];
    for height in heights {
        counts[bin(*height) + 1] += 1;
    }
    let sum = |index: usize| counts[index - 1] + counts[index] + counts[index + 1];
    let best = (1..counts.len() - 1).max_by_key(|index| sum(*index));
    let best = best.unwrap_or(1);
    let near = |height: &&f32| bin(**height).abs_diff(best - 1) <= 1;
    let (count, total) = heights
        .iter()
        .filter(near)
        .fold((0, 0.0), |(count, total), height| {
            (count + 1, total + height)
        });
    total / count.max(1) as f32
}
