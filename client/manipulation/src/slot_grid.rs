//! Slots on the table, arranged in a grid.

/// A grid of slots on the table, into which objects are sorted.
///
/// Slots are numbered from 0, row after row: slot 0 is nearest to the arm and leftmost, seen from the arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlotGrid {
    /// Middle of the grid along x and y, m.
    pub middle: [f64; 2],
    /// Distance between the middles of neighbours along x and y, m.
    pub pitch: [f64; 2],
    /// Number of slots along x and y.
    pub count: [usize; 2],
}

/// Largest distance of an object's middle from that of its slot, m.
const IN_SLOT: f64 = 0.02;

impl Default for SlotGrid {
    /// Two rows of three slots within the reach of the arm above the table of `docs/table-simulation.md`, with room for any two
    /// boxes, prisms and glasses beside each other.
    fn default() -> Self {
        Self {
            middle: [0.55, 0.0],
            pitch: [0.24, 0.24],
            count: [2, 3],
        }
    }
}

impl SlotGrid {
    /// Returns the number of slots.
    pub fn len(&self) -> usize {
        self.count[0] * self.count[1]
    }

    /// Returns whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the middle of a slot along x and y, m; `None` for a number that no slot has.
    pub fn place(&self, slot: usize) -> Option<[f64; 2]> {
        if slot >= self.len() {
            return None;
        }
        let (row, column) = (slot / self.count[1], slot % self.count[1]);
        let offset = |index: usize, axis: usize| {
            (index as f64 - (self.count[axis] - 1) as f64 / 2.0) * self.pitch[axis]
        };
        Some([
            self.middle[0] + offset(row, 0),
            self.middle[1] - offset(column, 1),
        ])
    }

    /// Returns the slot in which an object with this middle, m, stands.
    pub fn slot_at(&self, place: [f64; 2]) -> Option<usize> {
        (0..self.len()).find(|slot| {
            let middle = self.place(*slot).expect("it is one of them");
            distance(middle, place) <= IN_SLOT
        })
    }
}

/// Returns the distance between two places on the table, m.
pub(crate) fn distance(one: [f64; 2], other: [f64; 2]) -> f64 {
    (one[0] - other[0]).hypot(one[1] - other[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_are_numbered_row_after_row_from_the_arm_and_from_the_left() {
        let grid = SlotGrid {
            middle: [0.5, 0.1],
            pitch: [0.2, 0.3],
            count: [2, 3],
        };
        let close = |slot: usize, expected: [f64; 2]| {
            let place = grid.place(slot).expect("a slot");
            assert!(distance(place, expected) < 1e-9, "{slot}: {place:?}");
        };
        close(0, [0.4, 0.4]);
        close(1, [0.4, 0.1]);
        close(2, [0.4, -0.2]);
        close(5, [0.6, -0.2]);
        assert_eq!(grid.place(6), None);
    }

    #[test]
    fn an_object_is_in_a_slot_up_to_two_centimetres_from_its_middle() {
        let grid = SlotGrid::default();
        let [x, y] = grid.place(4).expect("a slot");
        assert_eq!(grid.slot_at([x, y]), Some(4));
        assert_eq!(grid.slot_at([x + 0.019, y]), Some(4));
        assert_eq!(grid.slot_at([x + 0.021, y]), None);
    }
}
