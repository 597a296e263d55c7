//! Printed faces: SIFT features of a rectified face against those of the prints of one size.

use nalgebra::Point3;
use opencv::calib3d::{RANSAC, estimate_affine_partial_2d, find_homography};
use opencv::core::{
    self, DMatch, KeyPoint, KeyPointTraitConst, Mat, MatTraitConst, Point2f, Ptr, Scalar, Size,
    Vector, no_array,
};
use opencv::features2d::{DescriptorMatcherTrait, Feature2DTrait, FlannBasedMatcher, SIFT};
use opencv::imgproc;
use opencv::prelude::*;

use crate::{CameraModel, Image, Result, VisionError, mat};

/// Pixels per m of rectified faces and of prints when features are extracted: about the camera's.
const DENSITY: f64 = 1700.0;
/// Margin around a face that is rectified, m.
const MARGIN: f64 = 0.006;
/// Largest distance of an inlier of the homography, pixels of the rectified face.
const REPROJECTION: f64 = 3.0;
/// Largest distance of the corner of a print from the corner of its face, m.
const MAX_CORNER_ERROR: f64 = 0.012;

/// Largest deviation of the size of a print that is looked for, as a share.
const MAX_SCALE_ERROR: f64 = 0.03;
/// Largest number of pairs of features from which the place of a print is computed.
const MAX_TRIALS: usize = 2000;

/// Features of a print, indexed by FLANN.
pub(super) struct Print {
    size: [f64; 2],
    keypoints: Vector<KeyPoint>,
    descriptors: Mat,
    matcher: Ptr<FlannBasedMatcher>,
}

impl Print {
    /// Extracts the features of a print whose shorter and longer side are `sides` m; `None` without texture.
    pub(super) fn new(image: &Image, sides: [f64; 2]) -> Result<Option<Self>> {
        let grey = mat::grey_of_image(image)?;
        Self::of(&grey, sides).map_err(VisionError::cv("extract features of a print"))
    }

    fn of(grey: &Mat, sides: [f64; 2]) -> opencv::Result<Option<Self>> {
        let scale = sides[1] * DENSITY / f64::from(grey.cols().max(grey.rows()));
        let mut scaled = Mat::default();
        let size = Size::new(0, 0);
        imgproc::resize(grey, &mut scaled, size, scale, scale, imgproc::INTER_AREA)?;
        let (keypoints, descriptors) = features(&scaled)?;
        if descriptors.rows() < 8 {
            return Ok(None);
        }
        let mut matcher = FlannBasedMatcher::create()?;
        let mut all: Vector<Mat> = Vector::new();
        all.push(descriptors.clone());
        DescriptorMatcherTrait::add(&mut matcher, &all)?;
        DescriptorMatcherTrait::train(&mut matcher)?;
        Ok(Some(Self {
            size: [f64::from(scaled.cols()), f64::from(scaled.rows())],
            keypoints,
            descriptors,
            matcher,
        }))
    }
}

/// A face turned so that it fills an image.
pub(super) struct RectifiedFace {
    keypoints: Vector<KeyPoint>,
    descriptors: Mat,
    /// Corners of the face in the rectified image, in order.
    corners: [[f64; 2]; 4],
}

impl RectifiedFace {
    /// Rectifies the face with these corners in pixels, in order, and these sides in m: from the first corner to the
    /// second, and from the second to the third.
    pub(super) fn new(image: &Mat, pixels: &[[f64; 2]], sides: [f64; 2]) -> Result<Self> {
        Self::of(image, pixels, sides).map_err(VisionError::cv("extract features of a face"))
    }

    fn of(image: &Mat, pixels: &[[f64; 2]], sides: [f64; 2]) -> opencv::Result<Self> {
        let margin = MARGIN * DENSITY;
        let [width, height] = sides.map(|side| side * DENSITY);
        // In the order of the pixels; a clockwise order would mirror the print.
        let turns = |index: usize| pixels[(index + 1) % 4];
        let area: f64 = (0..4)
            .map(|index| pixels[index][0] * turns(index)[1] - pixels[index][1] * turns(index)[0])
            .sum();
        let corners = [[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]];
        let corners = corners.map(|[x, y]| {
            let x = if area >= 0.0 { x } else { width - x };
            [x + margin, y + margin]
        });
        let points = |all: &[[f64; 2]]| -> Vector<Point2f> {
            let point = |[x, y]: &[f64; 2]| Point2f::new(*x as f32, *y as f32);
            all.iter().map(point).collect()
        };
        let from = Mat::from_exact_iter(points(pixels).into_iter())?;
        let to = Mat::from_exact_iter(points(&corners).into_iter())?;
        let transform = imgproc::get_perspective_transform_def(&from, &to)?;
        let size = Size::new(
            (width + 2.0 * margin).ceil() as i32,
            (height + 2.0 * margin).ceil() as i32,
        );
        let mut turned = Mat::default();
        imgproc::warp_perspective(
            image,
            &mut turned,
            &transform,
            size,
            imgproc::INTER_LINEAR,
            core::BORDER_REPLICATE,
            Scalar::default(),
        )?;
        let (keypoints, descriptors) = features(&grey_of(turned)?)?;
        Ok(Self {
            keypoints,
            descriptors,
            corners,
        })
    }

    /// Returns the number of features that agree on one homography which puts the print onto the face; 0 if none does.
    pub(super) fn inliers(&self, print: &mut Print, ratio: f64) -> Result<usize> {
        self.agreeing(print, ratio)
            .map_err(VisionError::cv("compare a face with a print"))
    }

    fn agreeing(&self, print: &mut Print, ratio: f64) -> opencv::Result<usize> {
        let (from, to) = matches(&self.keypoints, &self.descriptors, print, ratio)?;
        if from.len() < 4 {
            return Ok(0);
        }
        let mut inliers = Mat::default();
        let homography = find_homography(&from, &to, &mut inliers, RANSAC, REPROJECTION)?;
        if homography.rows() != 3 || !self.covers(&homography, print.size)? {
            return Ok(0);
        }
        Ok(core::count_non_zero(&inliers)? as usize)
    }

    /// Returns whether a homography puts each corner of a print near a corner of the face.
    fn covers(&self, homography: &Mat, [width, height]: [f64; 2]) -> opencv::Result<bool> {
        let mut h = [0.0; 9];
        for (index, value) in h.iter_mut().enumerate() {
            *value = *homography.at_2d::<f64>(index as i32 / 3, index as i32 % 3)?;
        }
        let corners = [[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]];
        Ok(corners.iter().all(|[x, y]| {
            let w = h[6] * x + h[7] * y + h[8];
            let [u, v] = [0, 3].map(|row| (h[row] * x + h[row + 1] * y + h[row + 2]) / w);
            let near = |corner: &[f64; 2]| {
                (corner[0] - u).hypot(corner[1] - v) < MAX_CORNER_ERROR * DENSITY
            };
            self.corners.iter().any(near)
        }))
    }
}

/// A part of a plane above the table as the camera sees it, turned to the axes of the arm's base frame.
pub(super) struct PlanePart {
    keypoints: Vector<KeyPoint>,
    descriptors: Mat,
    /// Largest x and y, m: the upper left corner, for x is up and y is left.
    corner: [f64; 2],
}

impl PlanePart {
    /// Rectifies the part between two corners at a height of the arm's base frame, m.
    pub(super) fn new(
        image: &Mat,
        camera: &CameraModel,
        [low, high]: [[f64; 2]; 2],
        height: f64,
    ) -> Result<Self> {
        Self::of(image, camera, [low, high], height)
            .map_err(VisionError::cv("extract features of a part of the table"))
    }

    fn of(
        image: &Mat,
        camera: &CameraModel,
        [low, high]: [[f64; 2]; 2],
        height: f64,
    ) -> opencv::Result<Self> {
        let pixels = |axis: usize| ((high[axis] - low[axis]) * DENSITY).ceil().max(1.0) as i32;
        let (rows, columns) = (pixels(0), pixels(1));
        let outside = Scalar::all(-1.0);
        let mut across = Mat::new_rows_cols_with_default(rows, columns, core::CV_32FC1, outside)?;
        let mut down = across.try_clone()?;
        for row in 0..rows {
            let x = high[0] - f64::from(row) / DENSITY;
            let across = across.at_row_mut::<f32>(row)?;
            let down = down.at_row_mut::<f32>(row)?;
            for (column, (u, v)) in across.iter_mut().zip(down).enumerate() {
                let y = high[1] - column as f64 / DENSITY;
                if let Some(pixel) = camera.project(&Point3::new(x, y, height)) {
                    [*u, *v] = pixel.map(|value| value as f32);
                }
            }
        }
        let mut turned = Mat::default();
        let (linear, border) = (imgproc::INTER_LINEAR, core::BORDER_CONSTANT);
        let black = Scalar::default();
        imgproc::remap(image, &mut turned, &across, &down, linear, border, black)?;
        let (keypoints, descriptors) = features(&grey_of(turned)?)?;
        Ok(Self {
            keypoints,
            descriptors,
            corner: high,
        })
    }

    /// Returns the corners of a print in this part, x and y in m, with the number of features that agree on them; `None` if
    /// no place of the print in its own size explains several features.
    pub(super) fn place(
        &self,
        print: &mut Print,
        ratio: f64,
    ) -> Result<Option<([[f64; 2]; 4], usize)>> {
        self.placed(print, ratio)
            .map_err(VisionError::cv("look for a print"))
    }

    fn placed(
        &self,
        print: &mut Print,
        ratio: f64,
    ) -> opencv::Result<Option<([[f64; 2]; 4], usize)>> {
        let (from, to) = matches(&self.keypoints, &self.descriptors, print, ratio)?;
        if from.len() < 4 {
            return Ok(None);
        }
        let mut inliers = Mat::default();
        let turn = estimate_affine_partial_2d(
            &from,
            &to,
            &mut inliers,
            RANSAC,
            REPROJECTION,
            MAX_TRIALS,
            0.995,
            10,
        )?;
        if turn.rows() != 2 {
            return Ok(None);
        }
        let mut t = [0.0; 6];
        for (index, value) in t.iter_mut().enumerate() {
            *value = *turn.at_2d::<f64>(index as i32 / 3, index as i32 % 3)?;
        }
        if (t[0].hypot(t[3]) - 1.0).abs() > MAX_SCALE_ERROR {
            return Ok(None);
        }
        let [width, height] = print.size;
        let corners = [[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]];
        let corners = corners.map(|[x, y]| {
            let column = t[0] * x + t[1] * y + t[2];
            let row = t[3] * x + t[4] * y + t[5];
            [
                self.corner[0] - row / DENSITY,
                self.corner[1] - column / DENSITY,
            ]
        });
        Ok(Some((corners, core::count_non_zero(&inliers)? as usize)))
    }
}

fn grey_of(image: Mat) -> opencv::Result<Mat> {
    if image.channels() == 1 {
        return Ok(image);
    }
    let mut grey = Mat::default();
    imgproc::cvt_color_def(&image, &mut grey, imgproc::COLOR_RGB2GRAY)?;
    Ok(grey)
}

/// Returns the places of the features of a print and of those of an image that match them (Lowe's ratio test).
fn matches(
    keypoints: &Vector<KeyPoint>,
    descriptors: &Mat,
    print: &mut Print,
    ratio: f64,
) -> opencv::Result<(Vector<Point2f>, Vector<Point2f>)> {
    let (mut from, mut to): (Vector<Point2f>, Vector<Point2f>) = Default::default();
    if descriptors.rows() < 4 || print.descriptors.rows() < 4 {
        return Ok((from, to));
    }
    let mut pairs: Vector<Vector<DMatch>> = Vector::new();
    print.matcher.knn_match_def(descriptors, &mut pairs, 2)?;
    for pair in &pairs {
        if pair.len() < 2 {
            continue;
        }
        let (best, second) = (pair.get(0)?, pair.get(1)?);
        if f64::from(best.distance) <= ratio * f64::from(second.distance) {
            from.push(print.keypoints.get(best.train_idx as usize)?.pt());
            to.push(keypoints.get(best.query_idx as usize)?.pt());
        }
    }
    Ok((from, to))
}

fn features(grey: &Mat) -> opencv::Result<(Vector<KeyPoint>, Mat)> {
    let mut sift = SIFT::create_def()?;
    let (mut keypoints, mut descriptors) = (Vector::new(), Mat::default());
    sift.detect_and_compute_def(grey, &no_array(), &mut keypoints, &mut descriptors)?;
    Ok((keypoints, descriptors))
}
