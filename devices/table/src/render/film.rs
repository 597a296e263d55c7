//! From light to bytes: vignetting, defocus, motion, noise, and the curve of the display.

use std::sync::{Mutex, OnceLock};

use super::{THREADS, next, work};
use crate::lighting::Effects;
use crate::random::hash;
use crate::texture::encode;

/// Entries of the table from light to sRGB, for light 0 to 1.
const LEVELS: usize = 4096;
/// Rows that a thread takes at a time.
const BAND: usize = 16;

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
                expose(&row_light, row, [width, height], effects, bytes);
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
                let from = wide.as_flattened();
                let to = row.as_flattened_mut();
                for (index, value) in to.iter_mut().enumerate() {
                    let middle = index + 3 * reach;
                    let mut sum = from[middle] * kernel[0];
                    for (step, weight) in kernel.iter().enumerate().skip(1) {
                        sum += weight * (from[middle - 3 * step] + from[middle + 3 * step]);
                    }
                    *value = sum;
                }
            }
        }
    });
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
        for (value, (above, below)) in out.iter_mut().zip(above.iter().zip(below)) {
            *value += weight * (above + below);
        }
    }
}

/// The mean of images shifted along the motion.
fn moved(light: &[Light], width: usize, motion: [f32; 2]) -> Vec<Light> {
    let height = light.len() / width;
    let length = motion[0].hypot(motion[1]);
    let taps = (length.ceil() as usize * 2 + 1).min(33);
    let shifts: Vec<[f32; 2]> = (0..taps)
        .map(|tap| tap as f32 / (taps - 1).max(1) as f32 - 0.5)
        .map(|part| [motion[0] * part, motion[1] * part])
        .collect();
    let mut all = vec![[0.0; 3]; light.len()];
    let rows = Mutex::new(all.chunks_mut(width).enumerate());
    work(THREADS, || {
        while let Some((row, out)) = next(&rows) {
            for shift in &shifts {
                add_shifted(light, [width, height], row, *shift, out);
            }
            for value in out.as_flattened_mut() {
                *value /= taps as f32;
            }
        }
    });
    all
}

fn add_shifted(
    light: &[Light],
    [width, height]: [usize; 2],
    row: usize,
    [right, down]: [f32; 2],
    out: &mut [Light],
) {
    let y = (row as f32 - down).clamp(0.0, (height - 1) as f32);
    let upper = y as usize;
    let lower = (upper + 1).min(height - 1);
    let b = y - upper as f32;
    let whole = (-right).floor();
    let a = -right - whole;
    let column = |column: usize, more: i64| {
        (column as i64 + whole as i64 + more).clamp(0, width as i64 - 1) as usize
    };
    for (index, value) in out.iter_mut().enumerate() {
        let (x0, x1) = (column(index, 0), column(index, 1));
        let corner = |x: usize, y: usize| light[y * width + x];
        let corners = [
            (corner(x0, upper), (1.0 - a) * (1.0 - b)),
            (corner(x1, upper), a * (1.0 - b)),
            (corner(x0, lower), (1.0 - a) * b),
            (corner(x1, lower), a * b),
        ];
        for (light, weight) in corners {
            for (value, light) in value.iter_mut().zip(light) {
                *value += light * weight;
            }
        }
    }
}

fn expose(
    light: &[Light],
    row: usize,
    [width, height]: [usize; 2],
    effects: &Effects,
    bytes: &mut [u8],
) {
    let table = curve();
    let corner = (width * width + height * height) as f32 / 4.0;
    let down = row as f32 - (height as f32 - 1.0) / 2.0;
    let noisy = effects.shot_noise > 0.0 || effects.read_noise > 0.0;
    for (column, (light, bytes)) in light.iter().zip(bytes.chunks_exact_mut(3)).enumerate() {
        let right = column as f32 - (width as f32 - 1.0) / 2.0;
        let share = (right * right + down * down) / corner;
        let factor = effects.exposure * (1.0 - effects.vignetting * share);
        let noise = if noisy {
            let pixel = (row * width + column) as u64;
            gaussians(
                hash(effects.seed ^ pixel << 20),
                hash(effects.seed ^ !pixel << 20),
            )
        } else {
            [0.0; 3]
        };
        for channel in 0..3 {
            let mut value = light[channel] * factor;
            if noisy {
                let variance = effects.shot_noise * value + effects.read_noise * effects.read_noise;
                value += variance.max(0.0).sqrt() * noise[channel];
            }
            let level = (value.clamp(0.0, 1.0) * (LEVELS - 1) as f32 + 0.5) as usize;
            bytes[channel] = table[level];
        }
    }
}

/// Three numbers of mean 0 and deviation 1: sums of five uniform bytes each.
fn gaussians(one: u64, other: u64) -> [f32; 3] {
    /// Deviation of the sum of five numbers, each from 0 to 255: sqrt(5 (256² - 1) / 12).
    const DEVIATION: f32 = 165.24;
    let bytes = [one.to_le_bytes(), other.to_le_bytes()];
    let all = bytes.as_flattened();
    std::array::from_fn(|channel| {
        let sum: u32 = all[channel * 5..channel * 5 + 5]
            .iter()
            .map(|b| u32::from(*b))
            .sum();
        (sum as f32 - 637.5) / DEVIATION
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
    fn corners_are_darker_with_vignetting() {
        let effects = Effects {
            vignetting: 0.5,
            ..Effects::none()
        };
        let bytes = grey(0.5, &effects);
        assert!(bytes[0] < encode(0.27) && bytes[(32 * 64 + 32) * 3] >= encode(0.49));
    }
}
