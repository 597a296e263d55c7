//! Object recognition: Algorithm 1 of the thesis (section 6.4.2).
//!
//! | file | content |
//! | --- | --- |
//! | `mod` | [`Recogniser`]: the three methods in order of reliability |
//! | `sift` | textured objects against a model database |
//! | `edges` | gradients, and how much of an outline lies on edges |
//! | `circles` | Hough transform with verified outlines |
//! | `polygons` | polygonal approximation of contours |

mod circles;
mod edges;
mod polygons;
mod sift;

pub use circles::CircleParameters;
pub use polygons::PolygonParameters;
pub use sift::{ModelDatabase, SiftParameters};

use crate::{Detection, Image, Result, VisionError, mat};
pub(crate) use edges::Edges;

/// Smallest standard deviation of the grey values of an image that shows something.
const MIN_CONTRAST: f64 = 4.0;

/// Parameters of all three methods.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecogniserParameters {
    /// Textured objects.
    pub sift: SiftParameters,
    /// Round objects.
    pub circles: CircleParameters,
    /// Objects with straight sides.
    pub polygons: PolygonParameters,
}

/// Finds the objects of an image.
#[derive(Debug)]
pub struct Recogniser {
    parameters: RecogniserParameters,
    models: ModelDatabase,
}

impl Recogniser {
    /// Creates a recogniser with a model database, which may be empty.
    pub fn new(models: ModelDatabase, parameters: RecogniserParameters) -> Self {
        Self { parameters, models }
    }

    /// Returns the objects of an image: textured ones, then circles whose centre is in none of them, then valid polygons
    /// whose centre is in none of both (Algorithm 1 of the thesis).
    ///
    /// Errors: [`VisionError::NoContrast`] if the lens is covered or there is no light, [`VisionError::OpenCv`].
    pub fn detect(&mut self, image: &Image) -> Result<Vec<Detection>> {
        let colour = mat::of_image(image)?;
        let grey = mat::grey_of_image(image)?;
        check_contrast(&grey)?;
        let mut objects = self.models.detect(&grey, &self.parameters.sift)?;
        let edges = Edges::new(&colour)?;
        let circles = circles::detect(&grey, &edges, &self.parameters.circles)?;
        extend(&mut objects, circles);
        let polygons = polygons::detect(&edges, &self.parameters.polygons)?;
        extend(&mut objects, polygons);
        Ok(objects)
    }
}

/// Appends each detection whose centre is within none of the objects that are there.
fn extend(objects: &mut Vec<Detection>, found: Vec<Detection>) {
    for detection in found {
        if !objects
            .iter()
            .any(|object| object.contains(detection.centre))
        {
            objects.push(detection);
        }
    }
}

/// Fails if an image shows nothing.
pub(crate) fn check_contrast(grey: &impl opencv::core::ToInputArray) -> Result<()> {
    let (mut mean, mut deviation) = (opencv::core::Mat::default(), opencv::core::Mat::default());
    opencv::core::mean_std_dev_def(grey, &mut mean, &mut deviation)
        .map_err(VisionError::cv("measure contrast"))?;
    let value = |mat: &opencv::core::Mat| {
        opencv::core::MatTraitConst::at::<f64>(mat, 0)
            .copied()
            .map_err(VisionError::cv("measure contrast"))
    };
    let deviation = value(&deviation)?;
    if deviation < MIN_CONTRAST {
        return Err(VisionError::NoContrast {
            deviation,
            mean: value(&mean)?,
        });
    }
    Ok(())
}
