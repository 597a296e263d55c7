//! A canvas to draw a print on: twice as fine as the texture it becomes.

use super::Texture;
use super::font;

/// Canvas pixels per texel along each side.
const FINER: usize = 2;

pub(super) type Colour = [u8; 3];

/// An image under construction; lengths are in shares of its width.
pub(super) struct Canvas {
    width: usize,
    height: usize,
    pixels: Vec<Colour>,
}

impl Canvas {
    pub(super) fn new(width: usize, height: usize, colour: Colour) -> Self {
        let (width, height) = (width * FINER, height * FINER);
        Self {
            width,
            height,
            pixels: vec![colour; width * height],
        }
    }

    /// Height in shares of the width.
    pub(super) fn height(&self) -> f64 {
        self.height as f64 / self.width as f64
    }

    /// Paints what is `inside`, within a box from (x, y) to (x, y), with this share of the colour.
    pub(super) fn paint(
        &mut self,
        from: [f64; 2],
        to: [f64; 2],
        colour: Colour,
        share: f64,
        inside: impl Fn(f64, f64) -> bool,
    ) {
        let scale = self.width as f64;
        let start = |value: f64, most: usize| ((value * scale).floor().max(0.0) as usize).min(most);
        let end = |value: f64, most: usize| ((value * scale).ceil().max(0.0) as usize).min(most);
        for y in start(from[1], self.height)..end(to[1], self.height) {
            for x in start(from[0], self.width)..end(to[0], self.width) {
                if inside((x as f64 + 0.5) / scale, (y as f64 + 0.5) / scale) {
                    let pixel = &mut self.pixels[y * self.width + x];
                    for (channel, value) in pixel.iter_mut().enumerate() {
                        let mixed =
                            f64::from(*value) * (1.0 - share) + f64::from(colour[channel]) * share;
                        *value = mixed as u8;
                    }
                }
            }
        }
    }

    pub(super) fn rectangle(&mut self, from: [f64; 2], to: [f64; 2], colour: Colour) {
        self.paint(from, to, colour, 1.0, |x, y| {
            (from[0]..to[0]).contains(&x) && (from[1]..to[1]).contains(&y)
        });
    }

    /// An ellipse, turned by an angle.
    pub(super) fn ellipse(
        &mut self,
        [x, y]: [f64; 2],
        radii: [f64; 2],
        turn: f64,
        colour: Colour,
        share: f64,
    ) {
        let most = radii[0].max(radii[1]);
        let (sine, cosine) = turn.sin_cos();
        self.paint(
            [x - most, y - most],
            [x + most, y + most],
            colour,
            share,
            |px, py| {
                let (dx, dy) = (px - x, py - y);
                let a = (dx * cosine + dy * sine) / radii[0];
                let b = (dy * cosine - dx * sine) / radii[1];
                a * a + b * b <= 1.0
            },
        );
    }

    pub(super) fn triangle(&mut self, corners: [[f64; 2]; 3], colour: Colour, share: f64) {
        let pick = |axis: usize, choose: fn(f64, f64) -> f64| {
            choose(choose(corners[0][axis], corners[1][axis]), corners[2][axis])
        };
        let side = |a: [f64; 2], b: [f64; 2], x: f64, y: f64| {
            (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])
        };
        self.paint(
            [pick(0, f64::min), pick(1, f64::min)],
            [pick(0, f64::max), pick(1, f64::max)],
            colour,
            share,
            |x, y| {
                let sides =
                    [(0, 1), (1, 2), (2, 0)].map(|(a, b)| side(corners[a], corners[b], x, y));
                sides.iter().all(|side| *side >= 0.0) || sides.iter().all(|side| *side <= 0.0)
            },
        );
    }

    /// Capital letters in cells of `size` height, from the upper left corner.
    pub(super) fn text(&mut self, words: &str, [x, y]: [f64; 2], size: f64, colour: Colour) {
        let dot = size / 7.0;
        for (index, letter) in words.chars().enumerate() {
            let left = x + index as f64 * 6.0 * dot;
            for (row, bits) in font::rows(letter).into_iter().enumerate() {
                for column in 0..5_u8 {
                    if bits >> (4 - column) & 1 == 1 {
                        let from = [left + f64::from(column) * dot, y + row as f64 * dot];
                        self.rectangle(from, [from[0] + dot, from[1] + dot], colour);
                    }
                }
            }
        }
    }

    /// The texture: each texel the mean of its pixels.
    pub(super) fn finish(self) -> Texture {
        let (width, height) = (self.width / FINER, self.height / FINER);
        let texel = |index: usize| {
            let (x, y) = (index % width * FINER, index / width * FINER);
            std::array::from_fn(|channel| {
                let sum: usize = (0..FINER * FINER)
                    .map(|part| {
                        let place = (y + part / FINER) * self.width + x + part % FINER;
                        usize::from(self.pixels[place][channel])
                    })
                    .sum();
                (sum / (FINER * FINER)) as u8
            })
        };
        Texture::new(width, height, (0..width * height).map(texel).collect())
    }
}
