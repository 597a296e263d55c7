//! Rectangles and triangles of which something hides a part: sides from the rim in sight, hidden sides from colour edges.

use std::f64::consts::TAU;

use super::outline::{Outline, RimPoint};
use super::visibility::{DepthView, Sight};
use crate::circle_fit::mean;

/// Largest distance of a rim point from its side, m.
const SIDE_REACH: f64 = 0.002;
/// Directions of a side that are tried.
const DIRECTIONS: usize = 90;
/// Fewest rim points on all sides, and on the side that turns the outline.
const MIN_RIM: usize = 12;
const MIN_SIDE_RIM: usize = 5;
/// Smallest share of the rim that lies on the sides.
const MIN_RIM_SHARE: f64 = 0.75;
/// Smallest free share of the places beyond a side that the depth image shows to be the end of the face.
pub(super) const MIN_FREE: f64 = 0.2;
/// Step of the search for a hidden side, m.
const STEP: f64 = 0.0004;
/// Distance that the search begins within the part in sight, m.
const BACK: f64 = 0.003;
/// Places along a hidden side that are asked whether the depth image sees it to be free.
const PLACES: usize = 16;
/// Largest free share of the places on a hidden side.
const MAX_FREE: f64 = 0.3;
/// Smallest share of a hidden side that lies on edges of the colour image.
const MIN_EDGES: f64 = 0.5;
/// Distance by which a side is moved, m, from which on the sides beside it must go on to it, and the share of what is in sight of
/// this part that must lie on edges.
const MIN_MOVED: f64 = 0.006;
const MIN_CONTINUED: f64 = 0.4;

/// A polygon as the distances of its sides from the origin, along normals that turn evenly.
#[derive(Clone, Debug)]
pub(super) struct PartialPolygon {
    normals: Vec<[f64; 2]>,
    offsets: Vec<f64>,
    /// True for each side that the depth image does not show.
    hidden: Vec<bool>,
    height: f64,
}

/// Support of a side by edges of the colour image.
#[derive(Clone, Copy, Debug)]
pub(super) struct EdgeSupport {
    /// Share of the side that lies on edges and is in sight, 0 to 1.
    pub(super) share: f64,
    /// Share of the side that is in sight, 0 to 1.
    pub(super) open: f64,
    /// Mean strength of the edges over the side, grey values per pixel.
    pub(super) strength: f64,
}

impl PartialPolygon {
    /// Returns the polygon with this many sides that fits the rim best; `None` if little of the rim lies on it.
    pub(super) fn fit(
        points: &[[f64; 2]],
        rim: &[RimPoint],
        sides: usize,
        height: f64,
        view: &DepthView<'_>,
    ) -> Option<Self> {
        let seen: Vec<[f64; 2]> = rim.iter().filter(|p| !p.hidden).map(|p| p.point).collect();
        if seen.len() < MIN_RIM {
            return None;
        }
        let step = TAU / sides as f64;
        let trial = |turn: f64| Self::around(points, turn, sides, height);
        let turns = (0..DIRECTIONS).map(|index| step * index as f64 / DIRECTIONS as f64);
        let best = turns
            .map(|turn| (trial(turn).on_sides(&seen), turn))
            .max_by_key(|(count, _)| *count)?;
        let polygon = trial(best.1);
        let turn = best.1 + polygon.correction(&seen)?;
        let mut polygon = trial(turn);
        if (polygon.on_sides(&seen) as f64) < MIN_RIM_SHARE * seen.len() as f64 {
            return None;
        }
        polygon.settle(&seen);
        let corners = polygon.corners()?;
        polygon.hidden = (0..sides)
            .map(|side| {
                let ends = [corners[side], corners[(side + 1) % sides]];
                view.free_beyond(ends, polygon.normals[side], height) < MIN_FREE
            })
            .collect();
        Some(polygon)
    }

    /// Returns the polygon with this turn just around points.
    fn around(points: &[[f64; 2]], turn: f64, sides: usize, height: f64) -> Self {
        let normals: Vec<[f64; 2]> = (0..sides)
            .map(|side| turn + TAU * side as f64 / sides as f64)
            .map(|angle| [angle.cos(), angle.sin()])
            .collect();
        let farthest = |normal: &[f64; 2]| {
            let along = points.iter().map(|point| dot(normal, point));
            along.fold(f64::NEG_INFINITY, f64::max)
        };
        Self {
            offsets: normals.iter().map(farthest).collect(),
            hidden: vec![false; sides],
            normals,
            height,
        }
    }

    /// Returns the number of rim points on the sides.
    fn on_sides(&self, rim: &[[f64; 2]]) -> usize {
        let on = |point: &&[f64; 2]| (0..self.normals.len()).any(|side| self.is_on(side, point));
        rim.iter().filter(on).count()
    }

    fn is_on(&self, side: usize, point: &[f64; 2]) -> bool {
        (dot(&self.normals[side], point) - self.offsets[side]).abs() < SIDE_REACH
    }

    /// Returns the angle by which the polygon has to turn so that the sides run along their rim points; `None` if no side
    /// has enough.
    fn correction(&self, rim: &[[f64; 2]]) -> Option<f64> {
        let (mut sum, mut weight) = (0.0, 0.0);
        for (side, normal) in self.normals.iter().enumerate() {
            let on: Vec<[f64; 2]> = rim
                .iter()
                .filter(|p| self.is_on(side, p))
                .copied()
                .collect();
            if on.len() < MIN_SIDE_RIM {
                continue;
            }
            let middle = mean(&on);
            let (mut square, mut product) = (0.0, 0.0);
            for point in &on {
                let gap = [point[0] - middle[0], point[1] - middle[1]];
                let along = gap[1] * normal[0] - gap[0] * normal[1];
                square += along * along;
                product += along * dot(normal, &gap);
            }
            sum -= product;
            weight += square;
        }
        (weight > 0.0).then(|| sum / weight)
    }

    /// Moves each side to the median of its rim points.
    fn settle(&mut self, rim: &[[f64; 2]]) {
        for side in 0..self.normals.len() {
            let normal = self.normals[side];
            let on = rim.iter().filter(|point| self.is_on(side, point));
            let mut along: Vec<f64> = on.map(|point| dot(&normal, point)).collect();
            if along.len() >= MIN_SIDE_RIM {
                along.sort_by(f64::total_cmp);
                self.offsets[side] = along[along.len() / 2];
            }
        }
    }

    /// Returns the corners in order: of side i, from the first to the second.
    fn corners(&self) -> Option<Vec<[f64; 2]>> {
        let count = self.normals.len();
        (0..count)
            .map(|side| {
                let before = (side + count - 1) % count;
                let (a, b) = (self.normals[before], self.normals[side]);
                let (c, d) = (self.offsets[before], self.offsets[side]);
                let determinant = a[0] * b[1] - a[1] * b[0];
                (determinant.abs() > 1e-6).then(|| {
                    [
                        (c * b[1] - d * a[1]) / determinant,
                        (a[0] * d - b[0] * c) / determinant,
                    ]
                })
            })
            .collect()
    }

    /// Returns the outline.
    pub(super) fn outline(&self) -> Option<Outline> {
        self.corners().map(Outline::Polygon)
    }

    /// Returns whether the depth image shows all sides.
    pub(super) fn is_complete(&self) -> bool {
        !self.hidden.contains(&true)
    }

    /// Moves each hidden side outwards to where the colour image has an edge along it, at most `reach` m beyond what is in
    /// sight; false if there is none. `support` tells how much of a side lies on edges.
    pub(super) fn complete(
        &mut self,
        reach: f64,
        view: &DepthView<'_>,
        support: impl Fn([[f64; 2]; 2], [f64; 2]) -> EdgeSupport,
    ) -> bool {
        for side in 0..self.normals.len() {
            if !self.hidden[side] {
                continue;
            }
            let start = self.offsets[side];
            let mut best: Option<(f64, f64)> = None;
            for step in 0..((reach + BACK) / STEP) as usize {
                self.offsets[side] = start - BACK + step as f64 * STEP;
                let Some(corners) = self.corners() else {
                    return false;
                };
                let ends = [corners[side], corners[(side + 1) % corners.len()]];
                if self.offsets[side] > start && self.free_along(ends, view) > MAX_FREE {
                    break;
                }
                let EdgeSupport {
                    share, strength, ..
                } = support(ends, self.normals[side]);
                if share >= MIN_EDGES && best.is_none_or(|(most, _)| strength > most) {
                    best = Some((strength, self.offsets[side]));
                }
            }
            match best {
                Some((_, offset)) => self.offsets[side] = offset,
                None => return false,
            }
            if !self.is_continued(side, self.offsets[side] - start, &support) {
                return false;
            }
        }
        true
    }

    /// Returns whether the two sides beside one that was moved outwards go on to it: what is in the way has edges, too, but only its own.
    fn is_continued(
        &self,
        side: usize,
        moved: f64,
        support: &impl Fn([[f64; 2]; 2], [f64; 2]) -> EdgeSupport,
    ) -> bool {
        let Some(corners) = self.corners().filter(|_| moved > MIN_MOVED) else {
            return true;
        };
        let count = corners.len();
        // Each with the corner of the moved side, and its other one.
        let beside = [
            (
                (side + count - 1) % count,
                corners[side],
                corners[(side + count - 1) % count],
            ),
            (
                (side + 1) % count,
                corners[(side + 1) % count],
                corners[(side + 2) % count],
            ),
        ];
        beside.into_iter().all(|(index, end, from)| {
            let along = [from[0] - end[0], from[1] - end[1]];
            // The normals need not be perpendicular.
            let rate = dot(&self.normals[side], &along).abs().max(1e-9);
            let part = (moved / rate).min(1.0);
            let begin = [0, 1].map(|axis| end[axis] + part * along[axis]);
            let EdgeSupport { share, open, .. } = support([begin, end], self.normals[index]);
            share >= MIN_CONTINUED * open
        })
    }

    /// Returns the share of the places along a side, without its ends, that the depth image sees to be free.
    fn free_along(&self, [a, b]: [[f64; 2]; 2], view: &DepthView<'_>) -> f64 {
        let free = (0..PLACES).filter(|place| {
            let part = 0.1 + 0.8 * (*place as f64 + 0.5) / PLACES as f64;
            let place = [0, 1].map(|axis| a[axis] + part * (b[axis] - a[axis]));
            view.at(place, self.height) == Sight::Free
        });
        free.count() as f64 / PLACES as f64
    }
}

fn dot(one: &[f64; 2], other: &[f64; 2]) -> f64 {
    one[0] * other[0] + one[1] * other[1]
}
