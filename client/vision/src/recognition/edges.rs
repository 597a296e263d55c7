//! Gradients of an image, and how much of an outline lies on edges.

use opencv::core::{self, CV_16S, Mat, Size, Vector};
use opencv::imgproc;
use opencv::prelude::*;

use crate::{Result, VisionError};

/// Standard deviation of the blur against noise, pixels.
const SIGMA: f64 = 1.4;

/// The strongest gradient of the colours at each pixel.
pub(crate) struct Edges {
    pub(super) width: usize,
    pub(super) height: usize,
    /// Gradient to the right and down, grey values per pixel times 8 (Sobel), row after row.
    gradients: Vec<[i16; 2]>,
}

impl Edges {
    pub(crate) fn new(image: &Mat) -> Result<Self> {
        Self::of(image).map_err(VisionError::cv("find edges"))
    }

    fn of(image: &Mat) -> opencv::Result<Self> {
        let mut soft = Mat::default();
        imgproc::gaussian_blur(
            image,
            &mut soft,
            Size::new(0, 0),
            SIGMA,
            SIGMA,
            core::BORDER_REPLICATE,
        )?;
        let mut channels: Vector<Mat> = Vector::new();
        core::split(&soft, &mut channels)?;
        let (width, height) = (image.cols() as usize, image.rows() as usize);
        let mut gradients = vec![[0_i16; 2]; width * height];
        for channel in &channels {
            let (mut right, mut down) = (Mat::default(), Mat::default());
            imgproc::sobel(
                &channel,
                &mut right,
                CV_16S,
                1,
                0,
                3,
                1.0,
                0.0,
                core::BORDER_REPLICATE,
            )?;
            imgproc::sobel(
                &channel,
                &mut down,
                CV_16S,
                0,
                1,
                3,
                1.0,
                0.0,
                core::BORDER_REPLICATE,
            )?;
            let (right, down) = (right.data_typed::<i16>()?, down.data_typed::<i16>()?);
            for (kept, (dx, dy)) in gradients.iter_mut().zip(right.iter().zip(down)) {
                if square(*dx, *dy) > square(kept[0], kept[1]) {
                    *kept = [*dx, *dy];
                }
            }
        }
        Ok(Self {
            width,
            height,
            gradients,
        })
    }

    /// Returns 255 where no gradient reaches `threshold` grey values per pixel, otherwise 0.
    pub(super) fn smooth_areas(&self, threshold: f64) -> opencv::Result<Mat> {
        let limit = ((threshold * 8.0) * (threshold * 8.0)) as i32;
        let flags: Vec<u8> = self
            .gradients
            .iter()
            .map(|[dx, dy]| if square(*dx, *dy) < limit { 255 } else { 0 })
            .collect();
        Mat::from_slice(&flags)?
            .reshape(1, self.height as i32)?
            .try_clone()
    }

    /// Returns the place along `normal` within `reach` pixels of `point` with the strongest gradient across the outline,
    /// and its strength in grey values per pixel.
    pub(crate) fn strongest(
        &self,
        point: [f64; 2],
        normal: [f64; 2],
        reach: f64,
    ) -> Option<(f64, f64)> {
        let steps = (reach * 2.0).round() as i32;
        let values: Vec<f64> = (-steps..=steps)
            .map(|step| self.across(point, normal, f64::from(step) / 2.0))
            .collect::<Option<_>>()?;
        let best = (0..values.len()).max_by(|a, b| values[*a].total_cmp(&values[*b]))?;
        let mut offset = best as f64;
        if best > 0 && best + 1 < values.len() {
            let (left, here, right) = (values[best - 1], values[best], values[best + 1]);
            let bend = left - 2.0 * here + right;
            if bend < 0.0 {
                offset += 0.5 * (left - right) / bend;
            }
        }
        Some(((offset - f64::from(steps)) / 2.0, values[best] / 8.0))
    }

    /// Returns the part of sample points along a straight side that lie on an edge of `threshold`.
    pub(super) fn side_support(&self, a: [f64; 2], b: [f64; 2], reach: f64, threshold: f64) -> f64 {
        const SAMPLES: usize = 24;
        let length = (b[0] - a[0]).hypot(b[1] - a[1]).max(1e-9);
        let normal = [(b[1] - a[1]) / length, (a[0] - b[0]) / length];
        let supported = (0..SAMPLES).filter(|index| {
            let part = (*index as f64 + 0.5) / SAMPLES as f64;
            let point = [0, 1].map(|axis| a[axis] + part * (b[axis] - a[axis]));
            self.strongest(point, normal, reach)
                .is_some_and(|(_, strength)| strength >= threshold)
        });
        supported.count() as f64 / SAMPLES as f64
    }

    /// Returns the size of the gradient across an outline at a point, times 8, if the gradient is about along the normal.
    fn across(&self, point: [f64; 2], normal: [f64; 2], offset: f64) -> Option<f64> {
        let x = (point[0] + offset * normal[0]).round();
        let y = (point[1] + offset * normal[1]).round();
        if x < 0.0 || y < 0.0 || x >= self.width as f64 || y >= self.height as f64 {
            return None;
        }
        let [dx, dy] = self.gradients[y as usize * self.width + x as usize].map(f64::from);
        let along = (dx * normal[0] + dy * normal[1]).abs();
        Some(if along > 0.85 * dx.hypot(dy) {
            along
        } else {
            0.0
        })
    }
}

fn square(dx: i16, dy: i16) -> i32 {
    i32::from(dx) * i32::from(dx) + i32::from(dy) * i32::from(dy)
}
