//! Test patterns.

use crate::pseudo_random::Random;

/// Test patterns of a camera without a scene: the modes of stock's `fakeFrameGrabber` (but for `time` and `size`).
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub enum Pattern {
    /// A red line on black that goes down by a row per image (`line`).
    #[default]
    Line,
    /// A ball on black that strolls about the middle (`ball`).
    Ball,
    /// Red grows to the right, green downwards; a blue line goes down by a row per image (`grid`).
    Grid,
    /// Noise (`rand`).
    Noise,
    /// Black (`none`).
    Black,
}

/// Each with the word that stock has for it.
const PATTERN_NAMES: [(&str, Pattern); 5] = [
    ("line", Pattern::Line),
    ("ball", Pattern::Ball),
    ("grid", Pattern::Grid),
    ("rand", Pattern::Noise),
    ("none", Pattern::Black),
];

impl Pattern {
    /// The pattern of one of stock's words.
    pub fn from_word(word: &str) -> Option<Self> {
        let found = PATTERN_NAMES.iter().find(|(known, _)| *known == word);
        found.map(|(_, pattern)| *pattern)
    }

    /// The words there are.
    pub fn words() -> impl Iterator<Item = &'static str> {
        PATTERN_NAMES.iter().map(|(word, _)| *word)
    }
}

/// Radii of the ball and of its middle, pixels.
const BALL_RADII: (i64, i64) = (15, 8);

/// Draws a pattern, image after image.
#[derive(Debug)]
pub(super) struct Painter {
    pattern: Pattern,
    /// The row of the line.
    row: usize,
    /// Position of the ball, from the middle.
    ball: (i64, i64),
    random: Random,
}

impl Painter {
    pub(super) fn new(pattern: Pattern) -> Self {
        Self {
            pattern,
            row: 0,
            ball: (0, 0),
            random: Random::new(1),
        }
    }

    /// The next image: pixels of red, green, blue.
    pub(super) fn paint(&mut self, width: usize, height: usize) -> Vec<u8> {
        let mut pixels = vec![0; width * height * 3];
        self.row %= height.max(1);
        match self.pattern {
            Pattern::Line => {
                let row = &mut pixels[self.row * width * 3..(self.row + 1) * width * 3];
                row.iter_mut().step_by(3).for_each(|red| *red = 255);
            }
            Pattern::Ball => self.paint_ball(&mut pixels, width, height),
            Pattern::Grid => {
                let share =
                    |at: usize, size: usize| (at * 255 + (size - 1) / 2) / (size - 1).max(1);
                for (at, pixel) in pixels.chunks_exact_mut(3).enumerate() {
                    let (x, y) = (at % width, at / width);
                    pixel[0] = share(x, width) as u8;
                    pixel[1] = share(y, height) as u8;
                    pixel[2] = if y == self.row { 255 } else { 0 };
                }
            }
            Pattern::Noise => {
                for byte in &mut pixels {
                    *byte = (self.random.unit() * 256.0) as u8;
                }
            }
            Pattern::Black => {}
        }
        self.row += 1;
        pixels
    }

    /// Draws the ball and lets it stroll: mostly anywhere, every fifth time towards the middle.
    fn paint_ball(&mut self, pixels: &mut [u8], width: usize, height: usize) {
        let middle = (
            width as i64 / 2 + self.ball.0,
            height as i64 / 2 + self.ball.1,
        );
        let (outer, inner) = BALL_RADII;
        for y in (middle.1 - outer).max(0)..(middle.1 + outer + 1).min(height as i64) {
            for x in (middle.0 - outer).max(0)..(middle.0 + outer + 1).min(width as i64) {
                let distance = (x - middle.0).pow(2) + (y - middle.1).pow(2);
                if distance <= outer * outer {
                    let at = (y as usize * width + x as usize) * 3;
                    let blue = if distance <= inner * inner { 255 } else { 0 };
                    pixels[at..at + 3].copy_from_slice(&[0, 255, blue]);
                }
            }
        }
        if self.row.is_multiple_of(5) {
            self.ball = (
                self.ball.0 - self.ball.0.signum(),
                self.ball.1 - self.ball.1.signum(),
            );
        } else {
            let mut step = || self.random.between(-2.0, 3.0).floor() as i64;
            let bound = |at: i64, size: usize| at.clamp(-(size as i64) / 2, size as i64 / 2 - 1);
            self.ball = (
                bound(self.ball.0 + step(), width.max(2)),
                bound(self.ball.1 + step(), height.max(2)),
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_goes_down_and_begins_again() {
        let mut painter = Painter::new(Pattern::Line);
        for image in 0..7 {
            let pixels = painter.paint(4, 3);
            for (at, pixel) in pixels.chunks_exact(3).enumerate() {
                let red = if at / 4 == image % 3 { 255 } else { 0 };
                assert_eq!(pixel, [red, 0, 0], "image {image}, pixel {at}");
            }
        }
    }

    #[test]
    fn the_grid_tells_where_each_pixel_is() {
        let pixels = Painter::new(Pattern::Grid).paint(256, 256);
        for (at, pixel) in pixels.chunks_exact(3).enumerate() {
            assert_eq!(pixel[..2], [(at % 256) as u8, (at / 256) as u8]);
        }
    }

    #[test]
    fn the_ball_stays_in_the_image_and_moves() {
        let mut painter = Painter::new(Pattern::Ball);
        let first = painter.paint(64, 48);
        let mut moved = false;
        for _ in 0..2_000 {
            let pixels = painter.paint(64, 48);
            assert!(
                pixels.chunks_exact(3).any(|pixel| pixel[1] == 255),
                "the ball is gone"
            );
            moved |= pixels != first;
        }
        assert!(moved);
    }

    #[test]
    fn every_pattern_fits_every_size() {
        for word in Pattern::words() {
            let mut painter = Painter::new(Pattern::from_word(word).unwrap());
            for (width, height) in [(1, 1), (1, 5), (5, 1), (320, 240), (2, 2)] {
                let pixels = painter.paint(width, height);
                assert_eq!(pixels.len(), width * height * 3, "{word}");
            }
        }
        assert_eq!(Pattern::from_word("size"), None);
    }

    #[test]
    fn noise_is_noise() {
        let pixels = Painter::new(Pattern::Noise).paint(64, 64);
        let mean = pixels.iter().map(|byte| f64::from(*byte)).sum::<f64>() / pixels.len() as f64;
        assert!((118.0..137.0).contains(&mean), "{mean}");
    }
}
