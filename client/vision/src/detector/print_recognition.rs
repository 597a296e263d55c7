//! Printed faces: SIFT features of a rectified face against those of the prints of one size.

use opencv::calib3d::{RANSAC, find_homography};
use opencv::core::{
    self, DMatch, KeyPoint, KeyPointTraitConst, Mat, MatTraitConst, Point2f, Ptr, Scalar, Size,
    Vector, no_array,
};
use opencv::features2d::{DescriptorMatcherTrait, Feature2DTrait, FlannBasedMatcher, SIFT};
use opencv::imgproc;

use crate::{Image, Result, VisionError, mat};

/// Pixels per m of rectified faces and of prints when features are extracted: about the camera's.
const DENSITY: f64 = 1700.0;
/// Margin around a face that is rectified, m.
const MARGIN: f64 = 0.006;
/// Largest distance of an inlier of the homography, pixels of the rectified face.
const REPROJECTION: f64 = 3.0;
/// Largest distance of the corner of a print from the corner of its face, m.
const MAX_CORNER_ERROR: f64 = 0.012;

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
        let mut grey = Mat::default();
        if turned.channels() == 1 {
            grey = turned;
        } else {
            imgproc::cvt_color_def(&turned, &mut grey, imgproc::COLOR_RGB2GRAY)?;
        }
        let (keypoints, descriptors) = features(&grey)?;
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
        if self.descriptors.rows() < 4 || print.descriptors.rows() < 4 {
            return Ok(0);
        }
        let mut matches: Vector<Vector<DMatch>> = Vector::new();
        print
            .matcher
            .knn_match_def(&self.descriptors, &mut matches, 2)?;
        let (mut from, mut to): (Vector<Point2f>, Vector<Point2f>) = Default::default();
        for pair in &matches {
            if pair.len() < 2 {
                continue;
            }
            let (best, second) = (pair.get(0)?, pair.get(1)?);
            if f64::from(best.distance) <= ratio * f64::from(second.distance) {
                from.push(print.keypoints.get(best.train_idx as usize)?.pt());
                to.push(self.keypoints.get(best.query_idx as usize)?.pt());
            }
        }
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

fn features(grey: &Mat) -> opencv::Result<(Vector<KeyPoint>, Mat)> {
    let mut sift = SIFT::create_def()?;
    let (mut keypoints, mut descriptors) = (Vector::new(), Mat::default());
    sift.detect_and_compute_def(grey, &no_array(), &mut keypoints, &mut descriptors)?;
    Ok((keypoints, descriptors))
}
