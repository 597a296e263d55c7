//! Estimates of how full a container is, and the places in it where the next object lies lowest.

use nalgebra::Point3;
use yarp_devices::kinematics::Pose;
use yarp_planning::{Obstacle, Shape};

use crate::item::{Item, ItemShape};
use crate::surroundings::Container;

/// Edge of a cell of the height map, m.
const CELL: f64 = 0.01;
/// Distance of an object from the walls while it falls, m.
const WALL_CLEARANCE: f64 = 0.012;
/// Number of places that are compared along x and along y.
const PLACES: [usize; 2] = [7, 5];
/// Levels closer to each other than this count as equally low, m.
const LEVEL_STEP: f64 = 0.006;
/// Number of cells along x and y of a block that is one obstacle.
const BLOCK: usize = 2;
/// Height above the bottom from which on a block is an obstacle, m: less is noise of the sensor.
const MIN_PILE: f64 = 0.008;
/// Height above the rim up to which a measured point belongs to what is in the container, m: the arm is higher.
const MAX_PILE: f64 = 0.20;

/// A place in a container for the middle of an object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// Distance from the middle of the container along x and y, m.
    pub offset: [f64; 2],
    /// Half of the object's extent along x and y, m.
    pub half: [f64; 2],
    /// Height of what lies there, above the bottom of the container, m.
    pub level: f64,
}

/// A container with the estimated height of what was released into it.
///
/// Without a sensor that sees into the container an object counts as lying as it was held.
#[derive(Clone, Debug, PartialEq)]
pub struct Filling {
    container: Container,
    cells: [usize; 2],
    /// Heights above the bottom, m, row after row along x.
    heights: Vec<f64>,
}

impl Filling {
    /// Returns an empty container.
    pub fn new(container: Container) -> Self {
        let cells = [0, 1].map(|axis| ((container.size[axis] / CELL).round() as usize).max(1));
        Self {
            container,
            cells,
            heights: vec![0.0; cells[0] * cells[1]],
        }
    }

    /// Returns the container.
    pub fn container(&self) -> &Container {
        &self.container
    }

    /// Returns places for an object with this half extent along x and y, m, the lowest first; none if it does not fit.
    pub fn spots(&self, half: [f64; 2]) -> Vec<Spot> {
        let free = [0, 1].map(|axis| self.container.size[axis] / 2.0 - WALL_CLEARANCE - half[axis]);
        if free.iter().any(|free| *free < 0.0) {
            return Vec::new();
        }
        let mut spots = Vec::new();
        for row in 0..PLACES[0] {
            for column in 0..PLACES[1] {
                let part =
                    |index: usize, count: usize| 2.0 * index as f64 / (count - 1) as f64 - 1.0;
                let offset = [
                    free[0] * part(row, PLACES[0]),
                    free[1] * part(column, PLACES[1]),
                ];
                let level = self.level(offset, half);
                spots.push(Spot {
                    offset,
                    half,
                    level,
                });
            }
        }
        // Of those that are equally low the first: beside the walls and what is there already.
        let rounded = |spot: &Spot| (spot.level / LEVEL_STEP).floor();
        spots.sort_by(|one, other| rounded(one).total_cmp(&rounded(other)));
        spots
    }

    /// Records that an object of this height, m, was released at a place.
    pub fn add(&mut self, spot: &Spot, height: f64) {
        let top = self.level(spot.offset, spot.half) + height;
        for index in self.covered(spot.offset, spot.half) {
            self.heights[index] = top;
        }
    }

    /// Takes over measured heights: the highest of the points in each cell; cells without a point keep theirs.
    pub fn measure(&mut self, points: &[Point3<f64>]) {
        let Container { bottom, size } = self.container;
        let mut measured: Vec<Option<f64>> = vec![None; self.heights.len()];
        for point in points {
            let place = [0, 1].map(|axis| point[axis] - bottom[axis] + size[axis] / 2.0);
            let inside = (0..2).all(|axis| (0.0..size[axis]).contains(&place[axis]));
            let height = point.z - bottom[2];
            if !inside || height > size[2] + MAX_PILE {
                continue;
            }
            let [row, column] =
                [0, 1].map(|axis| ((place[axis] / CELL) as usize).min(self.cells[axis] - 1));
            let cell = &mut measured[row * self.cells[1] + column];
            *cell = Some(cell.map_or(0.0, |before: f64| before).max(height));
        }
        for (height, measured) in self.heights.iter_mut().zip(measured) {
            *height = measured.unwrap_or(*height);
        }
    }

    /// Returns what lies in the container higher than `above` m over its bottom as obstacles.
    pub fn obstacles(&self, above: f64) -> Vec<Obstacle> {
        let Container { bottom, size } = self.container;
        let mut obstacles = Vec::new();
        for row in (0..self.cells[0]).step_by(BLOCK) {
            for column in (0..self.cells[1]).step_by(BLOCK) {
                let rows = row..(row + BLOCK).min(self.cells[0]);
                let columns = column..(column + BLOCK).min(self.cells[1]);
                let top = rows.clone().flat_map(|row| {
                    let columns = columns.clone();
                    columns.map(move |column| self.heights[row * self.cells[1] + column])
                });
                let top = top.fold(0.0, f64::max);
                if top <= above.max(MIN_PILE) {
                    continue;
                }
                let middle = |range: &std::ops::Range<usize>, axis: usize| {
                    (range.start + range.end) as f64 / 2.0 * CELL - size[axis] / 2.0 + bottom[axis]
                };
                let shape =
                    Shape::cuboid([rows.len() as f64 * CELL, columns.len() as f64 * CELL, top]);
                let pose =
                    Pose::translation(middle(&rows, 0), middle(&columns, 1), bottom[2] + top / 2.0);
                obstacles.push(Obstacle::new("pile", shape, pose));
            }
        }
        obstacles
    }

    /// Returns the height of what lies below an object at this place, m.
    pub(crate) fn level(&self, offset: [f64; 2], half: [f64; 2]) -> f64 {
        let heights = self.covered(offset, half);
        heights.map(|index| self.heights[index]).fold(0.0, f64::max)
    }

    /// Returns the cells below an object.
    fn covered(&self, offset: [f64; 2], half: [f64; 2]) -> impl Iterator<Item = usize> + use<> {
        let range = |axis: usize| {
            let middle = offset[axis] + self.container.size[axis] / 2.0;
            let last = self.cells[axis] - 1;
            let cell = |place: f64| ((place / CELL).floor().max(0.0) as usize).min(last);
            cell(middle - half[axis] + CELL / 2.0)..=cell(middle + half[axis] - CELL / 2.0)
        };
        let (rows, columns, width) = (range(0), range(1), self.cells[1]);
        rows.flat_map(move |row| columns.clone().map(move |column| row * width + column))
    }
}

/// Returns half of an item's extent along x and y when it is turned about z by `turn` rad, m.
pub(crate) fn half_extent(item: &Item, turn: f64) -> [f64; 2] {
    match item.shape {
        ItemShape::Cuboid { size } => {
            let (sine, cosine) = (item.yaw() + turn).sin_cos();
            let [x, y] = [size[0] / 2.0, size[1] / 2.0];
            [
                x * cosine.abs() + y * sine.abs(),
                x * sine.abs() + y * cosine.abs(),
            ]
        }
        ItemShape::Prism { .. } | ItemShape::Cylinder { .. } => [item.shape.radius(); 2],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn container() -> Container {
        Container {
            bottom: [0.0, 0.0, -0.2],
            size: [0.30, 0.25, 0.12],
        }
    }

    #[test]
    fn objects_lie_beside_each_other_while_there_is_room() {
        let mut filling = Filling::new(container());
        let half = [0.06, 0.05];
        for count in 0..4 {
            let spot = filling.spots(half)[0];
            assert_eq!(spot.level, 0.0, "object {count}");
            filling.add(&spot, 0.08);
        }
        assert_eq!(filling.spots(half)[0].level, 0.08);
    }

    #[test]
    fn what_is_longer_than_the_container_has_no_spot_across() {
        let filling = Filling::new(container());
        assert!(filling.spots([0.035, 0.12]).is_empty());
        assert!(!filling.spots([0.12, 0.035]).is_empty());
    }

    /// A point of a surface, `height` above the bottom.
    fn seen(x: f64, y: f64, height: f64) -> Point3<f64> {
        Point3::new(x, y, -0.2 + height)
    }

    #[test]
    fn measured_heights_replace_estimates_where_something_is_seen() {
        let mut filling = Filling::new(container());
        let spot = filling.spots([0.06, 0.05])[0];
        filling.add(&spot, 0.08);
        // It fell over at one end; the highest point of a cell counts.
        let [x, y] = spot.offset;
        filling.measure(&[seen(x, y, 0.03), seen(x, y, 0.05), seen(x, y, 0.04)]);
        assert!((filling.level([x, y], [0.004; 2]) - 0.05).abs() < 1e-9);
        assert!((filling.level([x + 0.04, y], [0.004; 2]) - 0.08).abs() < 1e-9);
    }

    #[test]
    fn points_beside_the_container_and_of_the_arm_above_it_are_ignored() {
        let mut filling = Filling::new(container());
        let before = filling.clone();
        let above = 0.12 + MAX_PILE;
        filling.measure(&[
            seen(0.16, 0.0, 0.05),
            seen(0.0, -0.13, 0.05),
            seen(0.0, 0.0, above + 0.01),
        ]);
        assert_eq!(filling, before);
        filling.measure(&[seen(0.0, 0.0, above - 0.01)]);
        assert_ne!(filling, before);
    }

    #[test]
    fn a_pile_beyond_the_rim_is_an_obstacle_and_a_low_one_is_none() {
        let mut filling = Filling::new(container());
        filling.measure(&[seen(0.105, -0.085, 0.15), seen(-0.105, 0.0, 0.10)]);
        let obstacles = filling.obstacles(filling.container().size[2]);
        assert_eq!(obstacles.len(), 1);
        let inside = |x: f64, y: f64, height: f64| obstacles[0].distance(&seen(x, y, height)) < 0.0;
        assert!(inside(0.105, -0.085, 0.149) && inside(0.105, -0.085, 0.01));
        assert!(!inside(0.105, -0.085, 0.151) && !inside(0.08, -0.085, 0.1));
        // What is no higher than the noise of a sensor is none at all.
        let mut empty = Filling::new(container());
        empty.measure(&[seen(0.0, 0.0, 0.007)]);
        assert!(empty.obstacles(0.0).is_empty());
        empty.measure(&[seen(0.0, 0.0, 0.012)]);
        assert_eq!(empty.obstacles(0.0).len(), 1);
    }

    #[test]
    fn spots_keep_clear_of_the_walls() {
        for spot in Filling::new(container()).spots([0.05, 0.04]) {
            assert!(spot.offset[0].abs() + spot.half[0] <= 0.15 - WALL_CLEARANCE + 1e-9);
            assert!(spot.offset[1].abs() + spot.half[1] <= 0.125 - WALL_CLEARANCE + 1e-9);
        }
    }
}
