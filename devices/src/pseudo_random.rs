//! Random numbers that are the same for the same seed on every machine.

use std::f64::consts::TAU;

/// SplitMix64 (Steele, Lea, Flood 2014): small, fast, without allocation.
///
/// ```
/// use yarp_devices::pseudo_random::Random;
///
/// let (mut one, mut two) = (Random::new(7), Random::new(7));
/// assert_eq!(one.unit(), two.unit());
/// ```
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// Creates a generator whose numbers depend only on the seed.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Creates a generator for one purpose: other purposes with the same seed do not disturb its numbers.
    pub fn for_purpose(seed: u64, purpose: u64) -> Self {
        let mut mixed = Self(seed ^ purpose.wrapping_mul(0xD1B5_4A32_D192_ED03));
        let start = mixed.bits();
        Self(start)
    }

    /// Returns 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ (mixed >> 31)
    }

    /// Returns a number from 0 up to, but not including, 1.
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Returns a number from `min` up to, but not including, `max`.
    pub fn between(&mut self, min: f64, max: f64) -> f64 {
        min + self.unit() * (max - min)
    }

    /// Returns an integer below `count`; 0 if `count` is 0.
    pub fn below(&mut self, count: usize) -> usize {
        (self.unit() * count as f64) as usize
    }

    /// Returns true with this probability.
    pub fn chance(&mut self, probability: f64) -> bool {
        self.unit() < probability
    }

    /// Returns one element, each as likely as the others.
    ///
    /// Panics if there is none.
    pub fn pick<'a, T>(&mut self, from: &'a [T]) -> &'a T {
        &from[self.below(from.len())]
    }

    /// Returns a normally distributed number with mean 0 and standard deviation 1 (Box and Muller 1958).
    pub fn gaussian(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        radius * (TAU * self.unit()).cos()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaussian_numbers_have_mean_0_and_deviation_1() {
        let mut random = Random::new(3);
        let numbers: Vec<f64> = (0..20_000).map(|_| random.gaussian()).collect();
        let mean = numbers.iter().sum::<f64>() / numbers.len() as f64;
        let variance = numbers.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 20_000.0;
        assert!(mean.abs() < 0.03, "{mean}");
        assert!((variance - 1.0).abs() < 0.04, "{variance}");
    }

    #[test]
    fn purposes_do_not_share_numbers() {
        let mut one = Random::for_purpose(5, 1);
        let mut two = Random::for_purpose(5, 2);
        assert_ne!(one.bits(), two.bits());
        assert_eq!(
            Random::for_purpose(5, 1).bits(),
            Random::for_purpose(5, 1).bits()
        );
    }

    #[test]
    fn numbers_are_spread_evenly_and_repeat_with_the_seed() {
        let draw = |seed| {
            let mut random = Random::new(seed);
            [(); 10_000].map(|()| random.unit())
        };
        let numbers = draw(7);
        assert!(numbers.iter().all(|number| (0.0..1.0).contains(number)));
        for tenth in 0..10 {
            let low = f64::from(tenth) / 10.0;
            let inside = numbers
                .iter()
                .filter(|number| (low..low + 0.1).contains(*number))
                .count();
            assert!((800..1200).contains(&inside), "{inside} from {low}");
        }
        assert_eq!(numbers, draw(7));
        assert_ne!(numbers, draw(8));
    }
}
