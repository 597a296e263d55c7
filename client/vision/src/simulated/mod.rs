//! Evaluation on the simulated table: random scenes with truth, and detections matched to it.
//!
//! | file | content |
//! | --- | --- |
//! | `mod` | scenes, cameras and database of the table |
//! | `score` | [`Evaluation`]: counts, position errors, times |
//! | `servo_trials` | [`servo_trial`]: visual servoing against open loop |
//! | `parameter_selection` | parameters selected by ROC curves on training scenes |

mod parameter_selection;
mod score;
mod servo_trials;

pub use parameter_selection::{ParameterCurve, Selection, select, write_roc};
pub use score::{Evaluation, MATCH_DISTANCE, MIN_VISIBLE, ObjectClass, Row, Targets};
pub use servo_trials::{ServoTrial, ServoTrialOptions, servo_trial};

use yarp_table::{
    BrickKind, Camera, Class, Dataset, DatasetOptions, DepthNoise, Face, GroundTruth, NoRoom,
    Placement, Renderer, Scene, brick_face, objects_xml,
};

use crate::{
    CameraModel, DepthImage, DetectorSetup, Image, Intrinsics, ObjectDatabase, VisionError,
};

/// First and last seed of training scenes: parameters are selected on them, and no result on them counts.
pub const TRAINING_SEEDS: [u64; 2] = [9000, 9099];

/// Objects of the scenes.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum SceneSet {
    /// Objects of all classes.
    All,
    /// Printed cartons alone.
    Sift,
    /// Glasses and plates alone.
    Circles,
    /// Boxes and prisms alone.
    Polygons,
}

impl SceneSet {
    /// Returns the set of this word: all, sift, circles or polygons.
    pub fn from_word(word: &str) -> Option<Self> {
        match word {
            "all" => Some(Self::All),
            "sift" => Some(Self::Sift),
            "circles" => Some(Self::Circles),
            "polygons" => Some(Self::Polygons),
            _ => None,
        }
    }

    fn classes(self) -> &'static [Class] {
        match self {
            Self::All => &[
                Class::Glass,
                Class::Plate,
                Class::Box,
                Class::Prism,
                Class::Brick,
            ],
            Self::Sift => &[Class::Brick],
            Self::Circles => &[Class::Glass, Class::Plate],
            Self::Polygons => &[Class::Box, Class::Prism],
        }
    }
}

/// A scene as the two sensors see it, with its truth.
#[derive(Clone, Debug)]
pub struct SimulatedScene {
    /// Colour image.
    pub image: Image,
    /// Depth image.
    pub depth: DepthImage,
    /// Truth about the colour image.
    pub truth: GroundTruth,
}

/// Random scenes of one seed: 3 to 10 objects, up to 4 things that nobody looks for, the arm above 3 of 10 tables.
#[derive(Debug)]
pub struct SimulatedScenes {
    dataset: Dataset,
    renderer: Renderer,
}

impl SimulatedScenes {
    /// Describes the scenes of a seed; none is rendered yet.
    pub fn new(seed: u64, set: SceneSet) -> Self {
        let mut options = DatasetOptions::default();
        options.placement = Placement::default()
            .with_count(10)
            .with_clutter(4)
            .with_classes(set.classes());
        options.fewest = 3;
        options.with_arm = 0.3;
        Self {
            dataset: Dataset::new(seed, options),
            renderer: Renderer::new(),
        }
    }

    /// Renders scene number `index`.
    ///
    /// Errors: [`NoRoom`] if the objects that were drawn do not fit on the table.
    pub fn scene(&self, index: u64) -> Result<SimulatedScene, NoRoom> {
        let (scene, effects) = self.dataset.scene(index)?;
        let shot = self.renderer.render(&scene, &scene.camera(), &effects);
        let noise = DepthNoise {
            seed: effects.seed,
            ..DepthNoise::default()
        };
        let depth = self.renderer.depth(&scene, &scene.depth_camera(), &noise);
        let depth = DepthImage::new(depth.width, depth.height, depth.metres)
            .expect("the renderer makes a value per pixel");
        Ok(SimulatedScene {
            image: shot.image,
            depth,
            truth: shot.truth,
        })
    }
}

/// Returns the model of a simulated camera.
pub fn camera_model(camera: &Camera) -> CameraModel {
    let lens = &camera.lens;
    CameraModel {
        intrinsics: Intrinsics {
            size: [lens.width, lens.height],
            focal: lens.focal,
            centre: lens.centre,
            distortion: lens.distortion,
        },
        pose: camera.pose,
    }
}

/// Returns cameras and surface of the simulated table.
pub fn table_setup() -> DetectorSetup {
    let scene = Scene::empty();
    DetectorSetup {
        camera: camera_model(&scene.camera()),
        depth: Some(camera_model(&scene.depth_camera())),
        surface: scene.table.surface,
    }
}

/// Returns the object database of the simulated table, which `yarp table render --models` writes as `objects.xml`.
pub fn table_database() -> ObjectDatabase {
    let print = |name: &str| {
        let mut words = name.trim_end_matches(".png").split('-');
        let (kind, face) = (words.next(), words.next());
        let kind = kind.and_then(BrickKind::from_name);
        let face = Face::ALL
            .into_iter()
            .find(|other| Some(other.word()) == face);
        let (Some(kind), Some(face)) = (kind, face) else {
            return Err(VisionError::Unsuitable {
                what: "print of a carton".to_owned(),
                expected: "KIND-FACE.png".to_owned(),
                actual: name.to_owned(),
            });
        };
        Ok(brick_face(kind, face))
    };
    ObjectDatabase::parse(&objects_xml(), "of the simulated table", print)
        .expect("the table writes a valid database of its own kinds")
}
