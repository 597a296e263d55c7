//! A detector that looks through the table's cameras, over the network.

use std::panic::resume_unwind;
use std::time::Duration;

use nalgebra::{Rotation3, Translation3, Vector3};
use yarp_client::{Camera, Network};
use yarp_devices::kinematics::Pose;
use yarp_manipulation::{Class, DetectError, Detector, Item, ItemShape, Surroundings};
use yarp_table::{DEPTH_FROM, DEPTH_STEP};
use yarp_vision::calibration::{CalibrationError, CalibrationFile, CameraWatch};
use yarp_vision::simulated::{table_database, table_setup};
use yarp_vision::{
    DepthImage, DetectorParameters, DetectorSetup, FoundObject, Frame, Image, ObjectDatabase,
    Shape, VisionError,
};

use super::fresh_image::{NoImage, connect_resting, fresh_images};
use super::{TableDemoError, TableFiles};

/// Name in reports.
const NAME: &str = "vision";
/// Maximum wait for images that are newer than a request.
const IMAGE_TIMEOUT: Duration = Duration::from_secs(20);
/// Largest distance of an object from where it was in the detection before, m.
const SAME_PLACE: f64 = 0.03;

/// State of the check whether the camera has moved.
#[derive(Debug)]
enum Watch {
    /// The first image will be the reference.
    Begins,
    Goes(Box<CameraWatch>),
    /// The scene has nothing to recognise it by.
    Impossible,
}

impl Watch {
    /// Refuses an image of a camera that has moved, and one that cannot be compared, such as with a covered lens.
    fn check(
        &mut self,
        image: &Image,
        setup: &DetectorSetup,
        camera: &str,
    ) -> Result<(), CalibrationError> {
        match self {
            Self::Impossible => Ok(()),
            Self::Goes(watch) => {
                let seen = watch.check(image, &setup.camera, setup.surface);
                tracing::debug!("displacement of the camera: {seen:?}");
                seen.map(drop)
            }
            Self::Begins => {
                *self = match CameraWatch::new(image) {
                    Ok(watch) => Self::Goes(Box::new(watch)),
                    Err(error @ CalibrationError::SceneNotRecognised { .. }) => {
                        tracing::warn!(camera, %error, "nobody will notice if the camera moves");
                        Self::Impossible
                    }
                    Err(error) => return Err(error),
                };
                Ok(())
            }
        }
    }
}

/// A detector that uses the colour camera and the depth sensor of a table.
///
/// Before an image counts it checks that the camera still stands where it was calibrated: by the scene in the calibration
/// file, or else by the first image.
#[derive(Debug)]
pub struct RemoteVision {
    colour: Camera,
    depth: Camera,
    setup: DetectorSetup,
    watch: Watch,
    detector: yarp_vision::Detector,
    /// Objects of the detection before, and the number of the next new one.
    known: Vec<Item>,
    next: u32,
}

impl RemoteVision {
    /// Connects to the colour camera `PREFIX/camera` and the depth sensor `PREFIX/depth`.
    ///
    /// Without a file its part of the setup is that of the simulated table.
    ///
    /// Errors: those of [`Camera::connect_on`], of the files, and of the detector's prints.
    pub fn connect(
        network: &Network,
        prefix: &str,
        files: &TableFiles,
    ) -> Result<Self, TableDemoError> {
        let camera = |name| connect_resting(network, &format!("{prefix}/{name}"));
        let mut setup = table_setup();
        let mut watch = Watch::Begins;
        if let Some(path) = &files.calibration {
            let file = CalibrationFile::read(path)?;
            setup.camera = file.camera(path)?;
            if let Some(scene) = &file.scene {
                watch = Watch::Goes(Box::new(CameraWatch::new(scene)?));
            }
        }
        if let Some(path) = &files.depth_calibration {
            setup.depth = Some(CalibrationFile::read(path)?.camera(path)?);
        }
        let database = match &files.database {
            Some(path) => ObjectDatabase::read(path)?,
            None => table_database(),
        };
        let parameters = DetectorParameters {
            // The camera sees less of the table than the arm reaches.
            beyond_image: true,
            ..DetectorParameters::default()
        };
        Ok(Self {
            colour: camera("camera")?,
            depth: camera("depth")?,
            detector: yarp_vision::Detector::new(database, setup.clone(), parameters)?,
            setup,
            watch,
            known: Vec::new(),
            next: 0,
        })
    }

    fn look(&mut self) -> Result<Vec<FoundObject>, DetectError> {
        let cameras = [&self.colour, &self.depth];
        let [colour, depth] = fresh_images(cameras, IMAGE_TIMEOUT);
        let colour = judged(colour, &self.colour)?;
        let depth = judged(depth, &self.depth)?;
        let depth = depth.to_mono().map_err(failed)?.image;
        let depth = DepthImage::from_grey(&depth, f64::from(DEPTH_FROM), f64::from(DEPTH_STEP));
        let depth = depth.map_err(failed)?;
        let image = &colour.image;
        let (watch, detector) = (&mut self.watch, &mut self.detector);
        let (setup, camera) = (&self.setup, self.colour.remote());
        // Side by side: each takes about a tenth of a second, during which the robot may wait.
        let (checked, found) = std::thread::scope(|scope| {
            let check = scope.spawn(move || watch.check(image, setup, camera));
            let found = detector.detect(image, Some(&depth));
            let checked = check.join().unwrap_or_else(|panic| resume_unwind(panic));
            (checked, found)
        });
        let Surroundings {
            table_x, table_y, ..
        } = Surroundings::default();
        let [low, high] = [0, 1].map(|end: usize| [table_x[end], table_y[end]]);
        judged_by(checked, found, || {
            self.detector.is_table_empty(&depth, low, high)
        })
    }

    fn item(&mut self, found: &FoundObject) -> Option<Item> {
        let (class, shape, pose) = described(found, &self.setup)?;
        let place = pose.translation.vector;
        let same = self.known.iter().find(|item| {
            let gap = (item.pose.translation.vector - place).xy().norm();
            item.class == class && gap < SAME_PLACE
        });
        let id = same.map_or(self.next, |item| item.id);
        self.next = self.next.max(id + 1);
        Some(Item {
            id,
            label: found.kind.clone(),
            class,
            shape,
            pose,
        })
    }
}

impl Detector for RemoteVision {
    fn name(&self) -> &'static str {
        NAME
    }

    fn detect(&mut self) -> Result<Vec<Item>, DetectError> {
        let found = self.look()?;
        let items: Vec<Item> = found.iter().filter_map(|found| self.item(found)).collect();
        self.known.clone_from(&items);
        Ok(items)
    }
}

/// Returns what was found, unless the check of the camera forbids to rely on it.
///
/// An empty table may be as uniform as a covered lens; the depth sensor tells them apart, and nothing will be moved.
fn judged_by(
    checked: Result<(), CalibrationError>,
    found: Result<Vec<FoundObject>, VisionError>,
    is_table_empty: impl Fn() -> Result<bool, VisionError>,
) -> Result<Vec<FoundObject>, DetectError> {
    if let Err(CalibrationError::CameraMoved { pixels, .. }) = checked {
        return Err(DetectError::CameraMoved { pixels });
    }
    let is_uniform = matches!(
        checked,
        Err(CalibrationError::Covered { .. } | CalibrationError::SceneNotRecognised { .. })
    );
    let may_be_empty = match &found {
        Ok(found) => is_uniform && found.is_empty(),
        Err(VisionError::NoContrast { .. }) => is_uniform || checked.is_ok(),
        Err(_) => false,
    };
    if may_be_empty && is_table_empty().map_err(failed)? {
        return Ok(Vec::new());
    }
    checked.map_err(failed)?;
    found.map_err(failed)
}

/// Returns the image of a camera, or the reason why there is none.
fn judged(image: Result<Frame, NoImage>, camera: &Camera) -> Result<Frame, DetectError> {
    let (detector, seconds) = (NAME, IMAGE_TIMEOUT.as_secs_f64());
    let peer = camera.remote().to_owned();
    image.map_err(|why| match why {
        NoImage::Stale => DetectError::Stale {
            detector,
            peer,
            seconds,
        },
        NoImage::Frozen => DetectError::Frozen {
            detector,
            peer,
            seconds,
        },
        NoImage::Failed(error) => failed(error),
    })
}

fn failed(error: impl std::error::Error + Send + Sync + 'static) -> DetectError {
    DetectError::Failed {
        detector: NAME,
        source: Box::new(error),
    }
}

/// Returns class, shape and pose of an object that stands on the table.
fn described(found: &FoundObject, setup: &DetectorSetup) -> Option<(Class, ItemShape, Pose)> {
    let (pose, height, [longer, shorter]) = (found.pose?, found.height?, found.size?);
    let top = pose.position;
    let yaw = pose.yaw.unwrap_or(0.0);
    let (class, shape, turn) = match &found.detection.shape {
        Shape::Cylinder { .. } => {
            let radius = longer / 2.0;
            let class = match found.kind.as_str() {
                "plate" => Class::Plate,
                _ => Class::Glass,
            };
            (class, ItemShape::Cylinder { radius, height }, 0.0)
        }
        _ if found.detection.contour.len() == 3 => {
            // One side is along y, at negative x: x points from its middle to the third corner.
            let corner = |index: usize| {
                let pixel = found.detection.contour[index];
                setup.camera.on_plane(pixel, top.z)
            };
            let apex = corner(2)? - top;
            let side = longer;
            let turn = apex.y.atan2(apex.x);
            (Class::Polygon, ItemShape::Prism { side, height }, turn)
        }
        _ => {
            // y is along the longest side.
            let size = [shorter, longer, height];
            let turn = yaw - std::f64::consts::FRAC_PI_2;
            (Class::Polygon, ItemShape::Cuboid { size }, turn)
        }
    };
    let place = Translation3::new(top.x, top.y, top.z - height / 2.0);
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), turn);
    Some((class, shape, Pose::from_parts(place, turn)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_an_empty_table_may_be_unrecognisable() {
        let covered = || CalibrationError::Covered {
            image: "the image".to_owned(),
            mean: 145.0,
            contrast: 3.6,
        };
        let unrecognised = || CalibrationError::SceneNotRecognised {
            matches: 3,
            expected: 12,
        };
        let moved = || CalibrationError::CameraMoved {
            pixels: 5.0,
            millimetres: 4.0,
            tolerance: 2.0,
        };
        let dark = || VisionError::NoContrast {
            mean: 145.0,
            deviation: 3.6,
        };
        let case = |number: usize| match number {
            0 => (Err(covered()), Ok(vec![])),
            1 => (Err(unrecognised()), Ok(vec![])),
            _ => (Ok(()), Err(dark())),
        };
        for number in 0..3 {
            let judged = |is_table_empty: &dyn Fn() -> Result<bool, VisionError>| {
                let (checked, found) = case(number);
                judged_by(checked, found, is_table_empty)
            };
            assert_eq!(judged(&|| Ok(true)).unwrap(), []);
            assert!(judged(&|| Ok(false)).is_err());
            let error = judged(&|| Err(VisionError::NoTable { share: 0.0 })).unwrap_err();
            assert!(error.to_string().contains("no table"), "{error}");
        }
        assert_eq!(judged_by(Ok(()), Ok(vec![]), || Ok(false)).unwrap(), []);
        // Something was found beside the table that the depth sensor shows to be empty.
        let found = || {
            FoundObject::without_pose(yarp_vision::Detection {
                shape: Shape::Cylinder { radius: 5.0 },
                centre: [10.0, 10.0],
                contour: Vec::new(),
                score: 1.0,
            })
        };
        assert!(judged_by(Err(covered()), Ok(vec![found()]), || Ok(true)).is_err());
        // Other errors are none of an empty table.
        let other = VisionError::NoImageYet {
            source_name: "depth".to_owned(),
        };
        assert!(judged_by(Err(covered()), Err(other), || Ok(true)).is_err());
        let error = judged_by(Err(moved()), Ok(vec![]), || Ok(true)).unwrap_err();
        assert!(matches!(error, DetectError::CameraMoved { .. }), "{error}");
    }
}
