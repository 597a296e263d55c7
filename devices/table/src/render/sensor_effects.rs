//! From light to bytes: vignetting, defocus, motion, noise, and the curve of the display.

use std::sync::{Mutex, OnceLock};

use super::{THREADS, next, work};
use crate::lighting::Effects;
use crate::random::{Random, hash};
use crate::texture::encode;

/// Entries of the table from light to sRGB, for light 0 to 1.
const LEVELS: usize = 4096;
/// Rows that a thread takes at a time.
const BAND: usize = 16;
/// Numbers from which the noise is drawn: 14 random bits each.
const GAUSSIANS: usize = 1 << 14;

type Light = [f32; 3];

/// Turns linear light into sRGB bytes.
pub(super) fn develop(mut light: Vec<Light>, width: usize, effects: &Effects) -> Vec<u8> {
    let height = light.len() / width;
    if effects.motion != [0.0; 2] {
        light = moved(&light, width, effects.motion);
    }
    let kernel = kernel(effects.defocus);
    if kernel.len() > 1 {
        blur_rows(&mut light, width, &kernel);
    }
    let mut bytes = vec![0; light.len() * 3];
    let bands = Mutex::new(bytes.chunks_mut(width * 3 * BAND).enumerate());
    work(THREADS, || {
        let mut row_light = vec![[0.0; 3]; width];
        while let Some((number, bytes)) = next(&bands) {
            for (offset, bytes) in bytes.chunks_mut(width * 3).enumerate() {
                let row = number * BAND + offset;
                blur_column(&light, width, height, row, &kernel, &mut row_light);
                expose(&mut row_light, row, [width, height], effects, bytes);
            }
        }
    });
    bytes
}

/// Half of a Gaussian, its middle first; the middle alone if there is nothing to blur.
fn kernel(deviation: f32) -> Vec<f32> {
    if deviation < 0.05 {
        return vec![1.0];
    }
    let reach = (3.0 * deviation).ceil() as usize;
    let weight = |step: usize| (-0.5 * (step as f32 / deviation).powi(2)).exp();
    let half: Vec<f32> = (0..=reach).map(weight).collect();
    let sum = 2.0 * half.iter().sum::<f32>() - half[0];
    half.into_iter().map(|weight| weight / sum).collect()
}

fn blur_rows(light: &mut [Light], width: usize, kernel: &[f32]) {
    let reach = kernel.len() - 1;
    let rows = Mutex::new(light.chunks_mut(width * BAND));
    work(THREADS, || {
        // The row with its ends repeated.
        let mut wide = vec![[0.0; 3]; width + 2 * reach];
        while let Some(band) = next(&rows) {
            for row in band.chunks_mut(width) {
                wide[..reach].fill(row[0]);
                wide[reach..reach + width].copy_from_slice(row);
                wide[reach + width..].fill(row[width - 1]);
                let to = row.as_flattened_mut();
                for value in to.iter_mut() {
                    *value *= kernel[0];
                }
                for (step, weight) in kernel.iter().enumerate().skip(1) {
                    let left = wide[reach - step..reach - step + width].as_flattened();
                    let right = wide[reach + step..reach + step + width].as_flattened();
                    add_pair(to, left, right, *weight);
                }
            }
        }
    });
}

/// Adds the weighted sum of two rows, one step to either side, to a row.
fn add_pair(to: &mut [f32], one: &[f32], other: &[f32], weight: f32) {
    for (value, (one, other)) in to.iter_mut().zip(one.iter().zip(other)) {
        *value += weight * (one + other);
    }
}

fn blur_column(
    light: &[Light],
    width: usize,
    height: usize,
    row: usize,
    kernel: &[f32],
    out: &mut [Light],
) {
    let at = |row: usize| light[row * width..(row + 1) * width].as_flattened();
    let out = out.as_flattened_mut();
    for (value, light) in out.iter_mut().zip(at(row)) {
        *value = light * kernel[0];
    }
    for (step, weight) in kernel.iter().enumerate().skip(1) {
        let above = at(row.saturating_sub(step));
        let below = at((row + step).min(height - 1));
        add_pair(out, above, below, *weight);
    }
}

/// The mean of images shifted along the motion.
fn moved(light: &[Light], width: usize, motion: [f32; 2]) -> Vec<Light> {
    let height = light.len() / width;
    let kernel = motion_kernel(motion);
    let mut all = vec![[0.0; 3]; light.len()];
    let rows = Mutex::new(all.chunks_mut(width).enumerate());
    work(THREADS, || {
        while let Some((row, out)) = next(&rows) {
            for &([right, down], weight) in &kernel {
                let row = (row as i64 + down).clamp(0, height as i64 - 1) as usize;
                add_shifted(&light[row * width..(row + 1) * width], right, weight, out);
            }
        }
    });
    all
}

/// Returns the pixels to the right and below whose light a moving pixel collects, with their weights: the bilinear weights
/// of all positions during the motion, added up once for the whole image.
fn motion_kernel(motion: [f32; 2]) -> Vec<([i64; 2], f32)> {
    let length = motion[0].hypot(motion[1]);
    let taps = (length.ceil() as usize * 2 + 1).min(33);
    let mut kernel: Vec<([i64; 2], f32)> = Vec::new();
    for tap in 0..taps {
        let part = tap as f32 / (taps - 1).max(1) as f32 - 0.5;
        let from = motion.map(|along| -along * part);
        let whole = from.map(f32::floor);
        let [a, b] = [from[0] - whole[0], from[1] - whole[1]];
        let corners = [
            ([0, 0], (1.0 - a) * (1.0 - b)),
            ([1, 0], a * (1.0 - b)),
            ([0, 1], (1.0 - a) * b),
            ([1, 1], a * b),
        ];
        for (corner, weight) in corners {
            let offset = [0, 1].map(|axis| whole[axis] as i64 + corner[axis]);
            let weight = weight / taps as f32;
            match kernel.iter_mut().find(|(other, _)| *other == offset) {
                Some((_, sum)) => *sum += weight,
                None => kernel.push((offset, weight)),
            }
        }
    }
    kernel.retain(|(_, weight)| *weight > 0.0);
    kernel
}

/// Adds a weighted row, shifted to the left by `right` pixels, to a row; the ends are repeated.
fn add_shifted(from: &[Light], right: i64, weight: f32, out: &mut [Light]) {
    let width = from.len() as i64;
    let first = (-right).clamp(0, width);
    let last = (width - right).clamp(first, width);
    let source = (first + right).clamp(0, width) as usize;
    let (first, last) = (first as usize, last as usize);
    let source = &from[source..source + (last - first)];
    let middle = out[first..last].as_flattened_mut().iter_mut();
    for (value, light) in middle.zip(source.as_flattened()) {
        *value += light * weight;
    }
    let mut repeat = |range: std::ops::Range<usize>, end: Light| {
        for value in &mut out[range] {
            for (value, light) in value.iter_mut().zip(end) {
                *value += light * weight;
            }
        }
    };
    repeat(0..first, from[0]);
    repeat(last..from.len(), from[from.len() - 1]);
}

fn expose(
    light: &mut [Light],
    row: usize,
    [width, height]: [usize; 2],
    effects: &Effects,
    bytes: &mut [u8],
) {
    let table = curve();
    let corner = (width * width + height * height) as f32 / 4.0;
    let down = row as f32 - (height as f32 - 1.0) / 2.0;
    for (column, light) in light.iter_mut().enumerate() {
        let right = column as f32 - (width as f32 - 1.0) / 2.0;
        let share = (right * right + down * down) / corner;
        let factor = effects.exposure * (1.0 - effects.vignetting * share);
        *light = light.map(|value| value * factor);
    }
    if effects.shot_noise > 0.0 || effects.read_noise > 0.0 {
        add_noise(light, row, effects);
    }
    for (value, byte) in light.as_flattened().iter().zip(bytes) {
        let level = (value.clamp(0.0, 1.0) * (LEVELS - 1) as f32 + 0.5) as usize;
        *byte = table[level.min(LEVELS - 1)];
    }
}

/// Adds the noise of a row: one generator per row, so that rows can be computed in any order.
fn add_noise(light: &mut [Light], row: usize, effects: &Effects) {
    let table = gaussians();
    let mut random = Random::for_purpose(effects.seed, hash(row as u64));
    let read = effects.read_noise * effects.read_noise;
    for light in light {
        let bits = random.bits();
        for (channel, value) in light.iter_mut().enumerate() {
            let noise = table[(bits >> (20 * channel)) as usize % GAUSSIANS];
            *value += (effects.shot_noise * *value + read).max(0.0).sqrt() * noise;
        }
    }
}

/// Numbers of mean 0 and deviation 1.
fn gaussians() -> &'static [f32] {
    static NUMBERS: OnceLock<Vec<f32>> = OnceLock::new();
    NUMBERS.get_or_init(|| {
        let mut random = Random::for_purpose(0, 0x51);
        let half = (0..GAUSSIANS / 2).map(|_| random.gaussian() as f32);
        // Each with its opposite: their mean is 0.
        let mut all: Vec<f32> = half.flat_map(|value| [value, -value]).collect();
        let square = all.iter().map(|value| value * value).sum::<f32>() / all.len() as f32;
        for value in &mut all {
            *value /= square.sqrt();
        }
        all
    })
}

fn curve() -> &'static [u8; LEVELS] {
    static CURVE: OnceLock<[u8; LEVELS]> = OnceLock::new();
    CURVE.get_or_init(|| std::array::from_fn(|level| encode(level as f32 / (LEVELS - 1) as f32)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(value: f32, effects: &Effects) -> Vec<u8> {
        develop(vec![[value; 3]; 64 * 64], 64, effects)
    }

    #[test]
    fn noise_is_as_strong_as_it_is_told() {
        let effects = Effects {
            read_noise: 0.01,
            ..Effects::none()
        };
        assert!(
            grey(0.5, &Effects::none())
                .iter()
                .all(|b| *b == encode(0.5))
        );
        let noisy = grey(0.5, &effects);
        let mean = noisy.iter().map(|b| f64::from(*b)).sum::<f64>() / noisy.len() as f64;
        let deviation = (noisy
            .iter()
            .map(|b| (f64::from(*b) - mean).powi(2))
            .sum::<f64>()
            / noisy.len() as f64)
            .sqrt();
        // The slope of the curve at 0.5 is 0.6 of 255 levels.
        assert!((deviation - 1.6).abs() < 0.25, "{deviation}");
    }

    #[test]
    fn blur_and_motion_keep_the_light() {
        let mut light = vec![[0.0; 3]; 64 * 64];
        light[32 * 64 + 32] = [1.0; 3];
        let mut blurred = light.clone();
        blur_rows(&mut blurred, 64, &kernel(1.0));
        let sum = |light: &[Light]| light.iter().map(|l| l[0]).sum::<f32>();
        assert!((sum(&blurred) - 1.0).abs() < 1e-4);
        let streak = moved(&light, 64, [4.0, 0.0]);
        assert!((sum(&streak) - 1.0).abs() < 1e-4);
        assert!(streak[32 * 64 + 34][0] > 0.05 && streak[34 * 64 + 32][0] < 1e-6);
    }

    #[test]
    fn a_shift_moves_light_and_repeats_the_ends() {
        let row = [[1.0; 3], [2.0; 3], [4.0; 3]];
        for (right, expected) in [
            (0, [1.0, 2.0, 4.0]),
            (1, [2.0, 4.0, 4.0]),
            (-2, [1.0, 1.0, 1.0]),
            (9, [4.0, 4.0, 4.0]),
        ] {
            let mut out = [[0.0; 3]; 3];
            add_shifted(&row, right, 1.0, &mut out);
            assert_eq!(out.map(|light| light[0]), expected, "{right}");
        }
        let sum: f32 = motion_kernel([2.3, -1.4]).iter().map(|(_, w)| w).sum();
        assert!((sum - 1.0).abs() < 1e-5, "{sum}");
    }

    #[test]
    fn noise_is_another_in_each_row_and_channel() {
        let effects = Effects {
            read_noise: 0.02,
            ..Effects::none()
        };
        let bytes = grey(0.5, &effects);
        let deviation = |row: usize, channel: usize| -> Vec<i32> {
            let pixels = (0..64).map(|column| bytes[(row * 64 + column) * 3 + channel]);
            pixels.map(|byte| i32::from(byte) - 188).collect()
        };
        let product =
            |one: &[i32], other: &[i32]| -> i32 { one.iter().zip(other).map(|(a, b)| a * b).sum() };
        let first = deviation(0, 0);
        for other in [
            deviation(1, 0),
            deviation(0, 1),
            deviation(0, 2),
            deviation(5, 2),
        ] {
            assert!(product(&first, &other).abs() * 2 < product(&first, &first));
        }
    }

    #[test]
    fn corners_are_darker_with_vignetting() {
        let effects = Effects {
            vignetting: 0.5,
            ..Effects::none()
        };
        let bytes = grey(0.5, &effects);
        assert!(bytes[0] < encode(0.27) && bytes[(32 * 64 + 32) * 3] >= encode(0.49));
    }
}
