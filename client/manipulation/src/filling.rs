//! Estimates of how full a container is, and the places in it where the next object lies lowest.

use crate::item::{Item, ItemShape};
use crate::surroundings::Container;

/// Edge of a cell of the height map, m.
const CELL: f64 = 0.01;
/// Distance of an object from the walls while it falls, m.
const WALL_CLEARANCE: f64 = 0.012;
/// Number of places that are compared along x and along y.
const PLACES: [usize; 2] = [5, 3];

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
/// Nobody sees into the containers: an object counts as lying as it was held.
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
        spots.sort_by(|one, other| one.level.total_cmp(&other.level));
        spots
    }

    /// Records that an object of this height, m, was released at a place.
    pub fn add(&mut self, spot: &Spot, height: f64) {
        let top = self.level(spot.offset, spot.half) + height;
        for index in self.covered(spot.offset, spot.half) {
            self.heights[index] = top;
        }
    }

    /// Returns the height of what lies below an object at this place, m.
    fn level(&self, offset: [f64; 2], half: [f64; 2]) -> f64 {
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

    #[test]
    fn spots_keep_clear_of_the_walls() {
        for spot in Filling::new(container()).spots([0.05, 0.04]) {
            assert!(spot.offset[0].abs() + spot.half[0] <= 0.15 - WALL_CLEARANCE + 1e-9);
            assert!(spot.offset[1].abs() + spot.half[1] <= 0.125 - WALL_CLEARANCE + 1e-9);
        }
    }
}
