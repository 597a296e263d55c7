//! The detector of a table: a colour image and, if there is one, a depth image to objects with poses.
//!
//! | file | content |
//! | --- | --- |
//! | `mod` | [`Detector`]: faces by height, outline, edges, print |
//! | `database` | [`ObjectDatabase`]: kinds, sizes and prints, in XML |
//! | `face_to_object` | from a face to a named object |
//! | `height_map` | heights above the table, connected faces |
//! | `outline` | circle, rectangle or triangle through the points of a face |
//! | `partial_faces` | from a face of which something hides a part to a named object |
//! | `partial_polygon` | rectangles and triangles of which something hides a part |
//! | `visibility` | places that the depth sensor sees free, or does not see |
//! | `refine` | outlines moved onto the edges of the colour image |
//! | `print_recognition` | SIFT features of a face against prints |

mod database;
mod face_to_object;
mod height_map;
mod outline;
mod partial_faces;
mod partial_polygon;
mod print_recognition;
mod refine;
mod visibility;

use std::sync::{Mutex, OnceLock};

use serde::{Deserialize, Serialize};

pub use database::{KindFace, ObjectDatabase, ObjectKind};

use crate::{
    CameraModel, DepthImage, Detection, Image, ModelDatabase, ObjectPose, Recogniser,
    RecogniserParameters, Result, Shape, VisionError, mat, recognition,
};
use database::HEIGHT_TOLERANCE;
use face_to_object::Examiner;
use height_map::{Cloud, DepthRays, Face, FaceLimits, HeightMap};
use print_recognition::Print;
use visibility::DepthView;

/// Cameras and table of a [`Detector`].
#[derive(Clone, Debug, PartialEq)]
pub struct DetectorSetup {
    /// Colour camera.
    pub camera: CameraModel,
    /// Depth sensor, if there is one.
    pub depth: Option<CameraModel>,
    /// Height of the table's surface in the arm's base frame, m.
    pub surface: f64,
}

/// Parameters of a [`Detector`], selected on the training seeds by `yarp vision select`.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct DetectorParameters {
    /// Smallest height of an object above the table, m.
    pub min_height: f64,
    /// Largest difference in height of neighbouring cells of one face, m.
    pub face_step: f64,
    /// Largest distance of a point from its face, m.
    pub face_thickness: f64,
    /// Fewest depth points of a face.
    pub min_points: usize,
    /// Smallest part of its outline that a face fills, or that lies on its circle, 0 to 1.
    pub min_fill: f64,
    /// Smallest gradient of an edge, grey values per pixel.
    pub gradient: f64,
    /// Largest distance of an edge from where the depth image has it, pixels.
    pub reach: f64,
    /// Smallest part of the outline that lies on edges of the colour image, 0 to 1.
    pub min_support: f64,
    /// Largest ratio between the distances of the best and the second best match (Lowe 2004).
    pub ratio: f64,
    /// Fewest features of a print that agree on one homography.
    pub min_inliers: usize,
    /// True if objects that leave the colour image, or that edges would move out of it, are found by the depth image alone: less exact, and cartons by their
    /// size; false by default.
    pub beyond_image: bool,
}

impl Default for DetectorParameters {
    fn default() -> Self {
        Self {
            min_height: 0.0125,
            face_step: 0.008,
            face_thickness: 0.005,
            min_points: 60,
            min_fill: 0.85,
            gradient: 2.0,
            reach: 4.0,
            min_support: 0.3,
            ratio: 0.8,
            min_inliers: 6,
            beyond_image: false,
        }
    }
}

/// An object that a [`Detector`] found.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundObject {
    /// Name of its kind in the database; without depth the word of its shape.
    pub kind: String,
    /// Outline in the image.
    pub detection: Detection,
    /// Centre and direction of its upper face; `None` without depth.
    pub pose: Option<ObjectPose>,
    /// Height above the table, m; `None` without depth.
    pub height: Option<f64>,
    /// Longer and shorter side or twice the diameter, m; `None` without depth.
    pub size: Option<[f64; 2]>,
}

impl FoundObject {
    /// Wraps what an image without depth shows.
    pub fn without_pose(detection: Detection) -> Self {
        Self {
            kind: detection.shape.label().to_owned(),
            detection,
            pose: None,
            height: None,
            size: None,
        }
    }
}

/// Finds the objects of a table.
///
/// With a depth image, faces of one height are separated first; each is a circle, rectangle or triangle of a listed size,
/// is moved onto edges of the colour image, and compared with the prints of its size. Without one, it is Algorithm 1 of
/// the thesis ([`Recogniser`]).
pub struct Detector {
    setup: DetectorSetup,
    parameters: DetectorParameters,
    database: ObjectDatabase,
    prints: Vec<Vec<Mutex<Print>>>,
    rays: Option<DepthRays>,
    recogniser: Recogniser,
}

/// Smallest share of a depth image that shows nothing above the highest object: less is a cover in front of the sensor.
const MIN_BELOW: f64 = 0.1;
/// Smallest share of an empty table that is in sight.
const MIN_VISIBLE: f64 = 0.5;
/// Smallest share of what nothing hides that shows the table: sensors lose single measurements.
const MIN_FREE_TABLE: f64 = 0.9;

/// Points of a depth image and the faces among them.
struct TableView<'a> {
    rays: &'a DepthRays,
    points: Cloud,
    faces: Vec<Face>,
}

impl std::fmt::Debug for Detector {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Detector")
            .field("setup", &self.setup)
            .field("parameters", &self.parameters)
            .finish_non_exhaustive()
    }
}

impl Detector {
    /// Creates a detector; extracts the features of all prints of the database.
    ///
    /// Errors: [`VisionError::OpenCv`], [`VisionError::Unsuitable`] for a print without texture.
    pub fn new(
        database: ObjectDatabase,
        setup: DetectorSetup,
        parameters: DetectorParameters,
    ) -> Result<Self> {
        let mut prints = Vec::new();
        let mut models = ModelDatabase::empty();
        for kind in &database.kinds {
            let mut of_kind = Vec::new();
            if let KindFace::Printed {
                sides,
                prints: images,
            } = &kind.face
            {
                for image in images {
                    models.add(&kind.name, image)?;
                    of_kind.extend(Print::new(image, *sides)?.map(Mutex::new));
                }
                if of_kind.is_empty() {
                    return Err(VisionError::Unsuitable {
                        what: format!("prints of {}", kind.name),
                        expected: "images with texture".to_owned(),
                        actual: "no features".to_owned(),
                    });
                }
            }
            prints.push(of_kind);
        }
        let recogniser = Recogniser::new(models, RecogniserParameters::default());
        Ok(Self {
            rays: setup.depth.map(DepthRays::new),
            setup,
            parameters,
            database,
            prints,
            recogniser,
        })
    }

    /// Replaces the parameters.
    pub fn set_parameters(&mut self, parameters: DetectorParameters) {
        self.parameters = parameters;
    }

    /// Returns the parameters.
    pub fn parameters(&self) -> &DetectorParameters {
        &self.parameters
    }

    /// Returns the objects of an image, and of the depth image of the same moment.
    ///
    /// Without a face in the depth image there is no object, whatever the colour image shows.
    ///
    /// Errors: [`VisionError::NoContrast`] if the lens is covered, [`VisionError::NoTable`] if the depth image shows neither
    /// objects nor what is below them, [`VisionError::Unsuitable`] for images of other sizes than the cameras' or a depth image without a
    /// sensor, [`VisionError::OpenCv`].
    pub fn detect(
        &mut self,
        image: &Image,
        depth: Option<&DepthImage>,
    ) -> Result<Vec<FoundObject>> {
        let Some(depth) = depth else {
            return self.detect_by_colour(image);
        };
        let size = self.setup.camera.intrinsics.size;
        if [image.width(), image.height()] != size {
            return Err(VisionError::Unsuitable {
                what: "image".to_owned(),
                expected: format!(
                    "{} x {} pixels, as the camera's intrinsics",
                    size[0], size[1]
                ),
                actual: format!("{} x {}", image.width(), image.height()),
            });
        }
        let view = self.look_by_depth(depth)?;
        if view.faces.is_empty() {
            return Ok(Vec::new());
        }
        let pixels = mat::in_order(image)?;
        recognition::check_contrast(&pixels)?;
        let TableView {
            rays,
            points,
            faces,
        } = view;
        let examiner = Examiner {
            setup: &self.setup,
            parameters: &self.parameters,
            database: &self.database,
            prints: &self.prints,
            view: DepthView {
                camera: rays.camera(),
                cloud: &points,
                colour: &self.setup.camera,
                surface: self.setup.surface,
                cover: OnceLock::new(),
            },
        };
        let mut found = examiner.examine_all(&pixels, &faces)?;
        // Algorithm 1: printed objects, then circles, then polygons; none has its centre in an earlier one.
        found.sort_by_key(|object| match object.detection.shape {
            Shape::Textured { .. } => 0,
            Shape::Cylinder { .. } => 1,
            Shape::Polygon(_) => 2,
        });
        let mut kept: Vec<FoundObject> = Vec::new();
        for object in found {
            let centre = object.detection.centre;
            if !kept.iter().any(|other| other.detection.contains(centre)) {
                kept.push(object);
            }
        }
        Ok(kept)
    }

    /// Returns whether a depth image shows the table and nothing between these corners of it, m. An arm may hide less than half of it.
    ///
    /// Errors: [`VisionError::NoTable`], [`VisionError::Unsuitable`] as [`detect`](Self::detect).
    pub fn is_table_empty(
        &self,
        depth: &DepthImage,
        low: [f64; 2],
        high: [f64; 2],
    ) -> Result<bool> {
        let view = self.look_by_depth(depth)?;
        let (mut all, mut table, mut above) = (0.0, 0.0, 0.0);
        for pixel in view.rays.pixels_of_table(self.setup.surface, low, high) {
            let height = view.points.height(pixel).map(f64::from);
            all += 1.0;
            if height.is_some_and(|height| height.abs() <= self.parameters.min_height) {
                table += 1.0;
            }
            if height.is_some_and(|height| height > self.highest()) {
                above += 1.0;
            }
        }
        tracing::debug!(all, table, above, "pixels of the table in the depth image");
        let inside =
            |[x, y]: &[f64; 2]| (low[0]..=high[0]).contains(x) && (low[1]..=high[1]).contains(y);
        let has_faces = view.faces.iter().any(|face| face.points.iter().any(inside));
        let is_seen =
            all > 0.0 && table >= MIN_VISIBLE * all && table >= MIN_FREE_TABLE * (all - above);
        Ok(is_seen && !has_faces)
    }

    /// Returns the height above the table that no object reaches, m.
    fn highest(&self) -> f64 {
        let highest = self.database.kinds.iter().map(|kind| kind.height[1]);
        highest.fold(0.0, f64::max) + 2.0 * HEIGHT_TOLERANCE
    }

    /// Finds faces in a depth image.
    fn look_by_depth(&self, depth: &DepthImage) -> Result<TableView<'_>> {
        let Some(rays) = &self.rays else {
            return Err(VisionError::Unsuitable {
                what: "depth image".to_owned(),
                expected: "a depth sensor in the setup of the detector".to_owned(),
                actual: "none".to_owned(),
            });
        };
        let camera = match self.parameters.beyond_image {
            true => rays.camera(),
            false => &self.setup.camera,
        };
        let (low, high) = field_of_view(camera, self.setup.surface);
        let points = rays.points(depth, self.setup.surface)?;
        let limits = FaceLimits {
            height: [self.parameters.min_height, self.highest()],
            step: self.parameters.face_step,
            thickness: self.parameters.face_thickness,
            min_points: self.parameters.min_points,
        };
        let faces = HeightMap::new(&points, low, high).faces(&points, &limits);
        if faces.is_empty() {
            let share = points.share_below(self.highest());
            if share < MIN_BELOW {
                return Err(VisionError::NoTable { share });
            }
        }
        Ok(TableView {
            rays,
            points,
            faces,
        })
    }

    /// Returns the objects of an image without depth: labels and outlines alone.
    fn detect_by_colour(&mut self, image: &Image) -> Result<Vec<FoundObject>> {
        let found = self.recogniser.detect(image)?;
        Ok(found.into_iter().map(FoundObject::without_pose).collect())
    }
}

/// Returns the smallest and largest x and y of the table that a camera sees.
fn field_of_view(camera: &CameraModel, surface: f64) -> ([f64; 2], [f64; 2]) {
    let [width, height] = camera.intrinsics.size.map(|size| size as f64 - 1.0);
    let corners = [[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]];
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for point in corners
        .iter()
        .filter_map(|corner| camera.on_plane(*corner, surface))
    {
        for (axis, value) in [point.x, point.y].into_iter().enumerate() {
            low[axis] = low[axis].min(value);
            high[axis] = high[axis].max(value);
        }
    }
    (low, high)
}
