//! A line that spoils bytes.

use crate::pseudo_random::Random;

/// Noise of a line, in each direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Probability that a byte is changed, lost, or followed by another, 0 to 1.
    pub spoiled: f64,
    /// The same seed spoils the same bytes.
    pub seed: u64,
}

#[derive(Clone, Debug)]
pub(super) struct NoisyLine {
    spoiled: f64,
    random: Random,
}

impl NoisyLine {
    pub(super) fn new(noise: Noise) -> Self {
        Self {
            spoiled: noise.spoiled.clamp(0.0, 1.0),
            random: Random::new(noise.seed),
        }
    }

    /// Returns the bytes that arrive for one byte.
    pub(super) fn pass(&mut self, byte: u8) -> impl Iterator<Item = u8> + use<> {
        let spoiled = self.random.unit() < self.spoiled;
        let kind = if spoiled { self.byte() % 3 } else { 3 };
        let other = self.byte();
        let arrives = match kind {
            0 => [Some(byte ^ (1 << (other % 8))), None],
            1 => [None, None],
            2 => [Some(byte), Some(other)],
            _ => [Some(byte), None],
        };
        arrives.into_iter().flatten()
    }

    /// Any byte.
    pub(super) fn byte(&mut self) -> u8 {
        self.random.between(0.0, 256.0) as u8
    }
}
