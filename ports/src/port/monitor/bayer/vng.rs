//! `vng`: a missing colour is interpolated along the directions in which the image changes least.
//!
//! Eight gradients around a pixel measure the change towards each neighbour; those below a
//! threshold select the directions. The missing colour is the pixel's own, plus the mean difference
//! of the two in these directions.
//!
//! Source: Chang, Cheung and Pang, "Color filter array recovery using a threshold-based variable
//! number of gradients", 1999. Details follow images of stock's library (libdc1394 2.2.6): colours
//! of neighbours are those of `bilinear`, means are truncated to integers, pixels next to an edge
//! are as in `bilinear`, and those at the edge count as black.

use super::{BLACK, Raw};

/// Right and down, one step each.
type Step = (isize, isize);

const DIRECTIONS: [Step; 8] = [
    (0, -1),
    (1, 0),
    (0, 1),
    (-1, 0),
    (1, -1),
    (1, 1),
    (-1, -1),
    (-1, 1),
];

/// Returns the image in colour, row by row.
pub(super) fn coloured(raw: &Raw<'_>) -> Vec<[u8; 3]> {
    let mut simple = Vec::with_capacity(raw.width * raw.height);
    for y in 0..raw.height {
        simple.extend((0..raw.width).map(|x| raw.bilinear(x, y)));
    }
    let around = Around {
        raw,
        simple: &simple,
    };
    let mut pixels = simple.clone();
    for y in 0..raw.height {
        for x in (0..raw.width).filter(|x| raw.is_inside(*x, y, 2)) {
            pixels[y * raw.width + x] = around.pixel(x, y);
        }
    }
    pixels
}

struct Around<'a> {
    raw: &'a Raw<'a>,
    /// The image as `bilinear` makes it.
    simple: &'a [[u8; 3]],
}

impl Around<'_> {
    /// Returns the value at an offset from a pixel; black at the edge.
    fn at(&self, x: usize, y: usize, (dx, dy): Step) -> i32 {
        let (x, y) = (x.wrapping_add_signed(dx), y.wrapping_add_signed(dy));
        match self.raw.is_inside(x, y, 1) {
            true => self.raw.at(x, y, (0, 0)),
            false => 0,
        }
    }

    fn simple(&self, x: usize, y: usize, (dx, dy): Step) -> [u8; 3] {
        let (x, y) = (x.wrapping_add_signed(dx), y.wrapping_add_signed(dy));
        let index = y * self.raw.width + x;
        self.simple.get(index).copied().unwrap_or(BLACK)
    }

    /// Returns the colour of a pixel that has two neighbours on each side.
    fn pixel(&self, x: usize, y: usize) -> [u8; 3] {
        let own = self.raw.has(x, y).colour();
        let is_green = own == 1;
        let gradients = DIRECTIONS.map(|direction| self.gradient(x, y, direction, is_green));
        let (least, most) = gradients
            .iter()
            .fold((i32::MAX, 0), |(least, most), gradient| {
                (least.min(*gradient), most.max(*gradient))
            });
        // 1.5 times the least, and half of the way from there to the most.
        let threshold = least + most / 2;
        let here = self.at(x, y, (0, 0));
        let (mut sums, mut count) = ([0; 3], 0);
        for (step, gradient) in DIRECTIONS.into_iter().zip(gradients) {
            if gradient > threshold {
                continue;
            }
            count += 1;
            let near = self.simple(x, y, step).map(i32::from);
            for (sum, near) in sums.iter_mut().zip(near) {
                *sum += near;
            }
            // The next pixel of the own colour is the neighbour only for green, across.
            if !(is_green && step.0 != 0 && step.1 != 0) {
                let far = self.at(x, y, (2 * step.0, 2 * step.1));
                sums[own] += (here + far) / 2 - near[own];
            }
        }
        // The direction of the least gradient is always below the threshold.
        let other = |sum: i32| (here + (sum - sums[own]) / count).clamp(0, 255) as u8;
        let mut pixel = sums.map(other);
        pixel[own] = here as u8;
        pixel
    }

    /// Returns the doubled gradient in a direction: differences of pixels of the same colour, one
    /// step apart; those beside the direction count half.
    fn gradient(&self, x: usize, y: usize, (dx, dy): Step, is_green: bool) -> i32 {
        let change = |from: Step, to: Step| (self.at(x, y, from) - self.at(x, y, to)).abs();
        let along = 2 * change((dx, dy), (-dx, -dy)) + 2 * change((2 * dx, 2 * dy), (0, 0));
        let beside = if dx == 0 || dy == 0 {
            let beside = |(px, py): Step| {
                change((dx + px, dy + py), (px - dx, py - dy))
                    + change((2 * dx + px, 2 * dy + py), (px, py))
            };
            beside((dy, dx)) + beside((-dy, -dx))
        } else if is_green {
            2 * change((2 * dx, dy), (0, -dy)) + 2 * change((dx, 2 * dy), (-dx, 0))
        } else {
            change((dx, 0), (0, -dy))
                + change((0, dy), (-dx, 0))
                + change((2 * dx, dy), (dx, 0))
                + change((dx, 2 * dy), (0, dy))
        };
        along + beside
    }
}
