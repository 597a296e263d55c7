//! Textured objects: SIFT features against a model database.

use std::path::Path;

use opencv::calib3d::{RANSAC, find_homography};
use opencv::core::{
    DMatch, KeyPoint, KeyPointTraitConst, Mat, MatTraitConst, Point2f, Ptr, Size, Vector, no_array,
};
use opencv::features2d::{DescriptorMatcherTrait, Feature2DTrait, FlannBasedMatcher, SIFT};
use opencv::imgproc;
use yarp_devices::image::image_file;

use crate::image_source::image_paths;
use crate::object_shape::polygon_area;
use crate::{Detection, Result, Shape, VisionError, mat};

/// Maximum number of copies of one model in an image.
const MAX_COPIES: usize = 8;

/// Parameters of the search for textured objects.
#[derive(Clone, Debug, PartialEq)]
pub struct SiftParameters {
    /// Images with longer sides are scaled down to this many pixels before features are extracted.
    pub max_side: usize,
    /// Largest ratio between the distances of the best and the second best match (Lowe 2004).
    pub ratio: f64,
    /// Smallest number of inliers of a homography.
    pub min_inliers: usize,
    /// Largest distance of an inlier from its place, pixels of the scaled image.
    pub reprojection: f64,
}

impl Default for SiftParameters {
    fn default() -> Self {
        Self {
            max_side: 800,
            ratio: 0.8,
            min_inliers: 10,
            reprojection: 4.0,
        }
    }
}

struct Model {
    name: String,
    size: [f64; 2],
    keypoints: Vector<KeyPoint>,
    descriptors: Mat,
}

/// Reference images with their features, indexed by FLANN.
#[derive(Default)]
pub struct ModelDatabase {
    models: Vec<Model>,
}

impl std::fmt::Debug for ModelDatabase {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let names = self.models.iter().map(|model| &model.name);
        f.debug_list().entries(names).finish()
    }
}

impl ModelDatabase {
    /// Returns a database without models.
    pub fn empty() -> Self {
        Self::default()
    }

    /// Reads every PNG, JPEG, PPM and PGM of a folder as a model; its name is the stem of the file's.
    ///
    /// Errors: [`VisionError::File`], [`VisionError::Device`], [`VisionError::Unsuitable`] if no file has features.
    pub fn read(folder: &Path) -> Result<Self> {
        let paths = image_paths(folder)?;
        let mut database = Self::default();
        for path in &paths {
            let name = path.file_stem().unwrap_or_default().to_string_lossy();
            database.add(&name, &image_file::read(path)?)?;
        }
        if database.models.is_empty() {
            return Err(VisionError::Unsuitable {
                what: format!("model folder {}", folder.display()),
                expected: "PNG, JPEG or PPM images with texture".to_owned(),
                actual: format!("{} images, none with features", paths.len()),
            });
        }
        Ok(database)
    }

    /// Adds a model; returns whether the image has features.
    ///
    /// Errors: [`VisionError::OpenCv`], [`VisionError::Device`].
    pub fn add(&mut self, name: &str, image: &crate::Image) -> Result<bool> {
        let grey = mat::grey_of_image(image)?;
        let (keypoints, descriptors, scale) =
            features(&grey, usize::MAX).map_err(VisionError::cv("extract features of a model"))?;
        debug_assert_eq!(scale, 1.0);
        if descriptors.rows() < 4 {
            return Ok(false);
        }
        self.models.push(Model {
            name: name.to_owned(),
            size: [image.width() as f64, image.height() as f64],
            keypoints,
            descriptors,
        });
        Ok(true)
    }

    /// Returns the models that an image shows, best first.
    pub(super) fn detect(&self, grey: &Mat, parameters: &SiftParameters) -> Result<Vec<Detection>> {
        if self.models.is_empty() {
            return Ok(Vec::new());
        }
        self.search(grey, parameters)
            .map_err(VisionError::cv("search textured objects"))
    }

    fn search(&self, grey: &Mat, parameters: &SiftParameters) -> opencv::Result<Vec<Detection>> {
        let (keypoints, descriptors, scale) = features(grey, parameters.max_side)?;
        if descriptors.rows() < 4 {
            return Ok(Vec::new());
        }
        let mut pairs: Vec<Vec<(Point2f, Point2f)>> = vec![Vec::new(); self.models.len()];
        let mut matcher = self.matcher()?;
        let mut matches: Vector<Vector<DMatch>> = Vector::new();
        matcher.knn_match_def(&descriptors, &mut matches, 2)?;
        for pair in &matches {
            if pair.len() < 2 {
                continue;
            }
            let (best, second) = (pair.get(0)?, pair.get(1)?);
            if f64::from(best.distance) > parameters.ratio * f64::from(second.distance) {
                continue;
            }
            let model = best.img_idx as usize;
            let from = self.models[model]
                .keypoints
                .get(best.train_idx as usize)?
                .pt();
            let to = keypoints.get(best.query_idx as usize)?.pt();
            pairs[model].push((from, to));
        }
        let mut found = Vec::new();
        for (model, pairs) in self.models.iter().zip(pairs) {
            found.extend(copies(model, pairs, scale, parameters)?);
        }
        found.sort_by(|one, other| other.score.total_cmp(&one.score));
        let mut kept: Vec<Detection> = Vec::new();
        super::extend(&mut kept, found);
        Ok(kept)
    }

    /// Returns an index of all descriptors.
    fn matcher(&self) -> opencv::Result<Ptr<FlannBasedMatcher>> {
        let mut matcher = FlannBasedMatcher::create()?;
        let all: Vector<Mat> = self
            .models
            .iter()
            .map(|model| model.descriptors.clone())
            .collect();
        DescriptorMatcherTrait::add(&mut matcher, &all)?;
        Ok(matcher)
    }
}

/// Returns keypoints and descriptors of an image that is scaled down to `max_side`, and the scale.
fn features(grey: &Mat, max_side: usize) -> opencv::Result<(Vector<KeyPoint>, Mat, f64)> {
    let longest = grey.cols().max(grey.rows()) as usize;
    let mut scale = 1.0;
    let mut scaled = Mat::default();
    if longest > max_side {
        scale = max_side as f64 / longest as f64;
        imgproc::resize(
            grey,
            &mut scaled,
            Size::new(0, 0),
            scale,
            scale,
            imgproc::INTER_AREA,
        )?;
    }
    let source = if scale < 1.0 { &scaled } else { grey };
    let mut sift = SIFT::create_def()?;
    let (mut keypoints, mut descriptors) = (Vector::new(), Mat::default());
    sift.detect_and_compute_def(source, &no_array(), &mut keypoints, &mut descriptors)?;
    Ok((keypoints, descriptors, scale))
}

/// Returns the copies of a model: one homography after the other, each without the inliers of those before.
fn copies(
    model: &Model,
    mut pairs: Vec<(Point2f, Point2f)>,
    scale: f64,
    parameters: &SiftParameters,
) -> opencv::Result<Vec<Detection>> {
    let mut found = Vec::new();
    for _ in 0..MAX_COPIES {
        if pairs.len() < parameters.min_inliers.max(4) {
            break;
        }
        let from: Vector<Point2f> = pairs.iter().map(|pair| pair.0).collect();
        let to: Vector<Point2f> = pairs.iter().map(|pair| pair.1).collect();
        let mut inliers = Mat::default();
        let homography =
            find_homography(&from, &to, &mut inliers, RANSAC, parameters.reprojection)?;
        if homography.rows() != 3 {
            break;
        }
        let mut matrix = [0.0; 9];
        for (index, value) in matrix.iter_mut().enumerate() {
            *value = *homography.at_2d::<f64>(index as i32 / 3, index as i32 % 3)?;
        }
        let mut flags = Vec::with_capacity(pairs.len());
        for index in 0..pairs.len() {
            flags.push(*inliers.at::<u8>(index as i32)? != 0);
        }
        let count = flags.iter().filter(|flag| **flag).count();
        if count < parameters.min_inliers {
            break;
        }
        if let Some((contour, centre)) = outline(&matrix, model.size, scale) {
            found.push(Detection {
                shape: Shape::Textured {
                    model: model.name.clone(),
                },
                centre,
                contour,
                score: count as f64,
            });
        }
        let mut flags = flags.into_iter();
        pairs.retain(|_| !flags.next().unwrap_or(true));
    }
    Ok(found)
}

/// Returns outline and centre of a model in the image, unless the homography bends it beyond what a camera sees.
fn outline(
    h: &[f64; 9],
    [width, height]: [f64; 2],
    scale: f64,
) -> Option<(Vec<[f64; 2]>, [f64; 2])> {
    let place = |x: f64, y: f64| {
        let w = h[6] * x + h[7] * y + h[8];
        let at = |row: usize| (h[row] * x + h[row + 1] * y + h[row + 2]) / w;
        // Pixel centres have whole coordinates: the scaled pixel 0 covers the first 1 / scale pixels.
        [at(0), at(3)].map(|value| (value + 0.5) / scale - 0.5)
    };
    let contour = vec![
        place(0.0, 0.0),
        place(width, 0.0),
        place(width, height),
        place(0.0, height),
    ];
    let turns = |index: usize| {
        let [a, b, c] = [0, 1, 2].map(|step| contour[(index + step) % 4]);
        (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])
    };
    let convex = (0..4).all(|index| turns(index) > 0.0);
    let side = |index: usize| {
        let (a, b) = (contour[index], contour[(index + 1) % 4]);
        (a[0] - b[0]).hypot(a[1] - b[1])
    };
    let alike = |one: f64, other: f64| one < 2.0 * other && other < 2.0 * one;
    let plausible = convex
        && alike(side(0), side(2))
        && alike(side(1), side(3))
        && polygon_area(&contour) > 400.0;
    plausible.then(|| (contour.clone(), place(width / 2.0, height / 2.0)))
}
