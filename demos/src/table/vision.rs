//! A detector that looks through the table's cameras, over the network.

use std::panic::resume_unwind;
use std::time::{Duration, Instant};

use nalgebra::{Rotation3, Translation3, Vector3};
use yarp_client::{Camera, Network};
use yarp_devices::kinematics::Pose;
use yarp_manipulation::{Class, DetectError, Detector, Item, ItemShape};
use yarp_table::{DEPTH_FROM, DEPTH_STEP};
use yarp_vision::calibration::{CalibrationError, CalibrationFile, CameraWatch};
use yarp_vision::image_source::{ImageSource, RemoteImages};
use yarp_vision::simulated::{table_database, table_setup};
use yarp_vision::{
    DepthImage, DetectorParameters, DetectorSetup, FoundObject, Frame, Image, ObjectDatabase,
    Shape, VisionError,
};

use super::{TableDemoError, TableFiles};

/// Name in reports.
const NAME: &str = "vision";
/// Maximum wait for images that are newer than a request.
const IMAGE_TIMEOUT: Duration = Duration::from_secs(20);
/// Maximum time without any image: a simulated camera on a busy machine needs seconds.
const STREAM_TIMEOUT: Duration = Duration::from_secs(15);
/// Images of each camera that a request waits for: when it came, one may have been on its way here and the next one being taken.
const NEW_IMAGES: u64 = 3;
/// Interval between two looks for a new image.
const POLL_INTERVAL: Duration = Duration::from_millis(5);
/// Largest distance of an object from where it was in the detection before, m.
const SAME_PLACE: f64 = 0.03;

/// State of the check whether the camera has moved.
#[derive(Debug)]
enum Watch {
    /// The first image will be the reference.
    Begins,
    Goes(CameraWatch),
    /// The scene has nothing to recognise it by.
    Impossible,
}

impl Watch {
    /// Refuses an image of a camera that has moved, or whose lens is covered.
    fn check(
        &mut self,
        image: &Image,
        setup: &DetectorSetup,
        camera: &str,
    ) -> Result<(), DetectError> {
        match self {
            Self::Impossible => Ok(()),
            Self::Goes(watch) => {
                let seen = watch.check(image, &setup.camera, setup.surface);
                tracing::debug!(?seen, "displacement of the camera");
                seen.map(drop).map_err(|error| match error {
                    CalibrationError::CameraMoved { pixels, .. } => {
                        DetectError::CameraMoved { pixels }
                    }
                    other => failed(other),
                })
            }
            Self::Begins => {
                *self = match CameraWatch::new(image) {
                    Ok(watch) => Self::Goes(watch),
                    Err(error @ CalibrationError::SceneNotRecognised { .. }) => {
                        tracing::warn!(camera, %error, "nobody will notice if the camera moves");
                        Self::Impossible
                    }
                    Err(error) => return Err(failed(error)),
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
    colour: RemoteImages,
    depth: RemoteImages,
    names: [String; 2],
    setup: DetectorSetup,
    watch: Watch,
    detector: yarp_vision::Detector,
    /// Objects of the detection before, and the number of the next new one.
    known: Vec<Item>,
    next: u32,
}

impl RemoteVision {
    /// Connects to the cameras of these names.
    ///
    /// Without a file its part of the setup is that of the simulated table.
    ///
    /// Errors: those of [`Camera::connect_on`], of the files, and of the detector's prints.
    pub fn connect(
        network: &Network,
        names: [String; 2],
        files: &TableFiles,
    ) -> Result<Self, TableDemoError> {
        let images = |name: &str| -> Result<RemoteImages, VisionError> {
            let camera = Camera::connect_on(network, name)?;
            Ok(RemoteImages::new(camera, STREAM_TIMEOUT))
        };
        let mut setup = table_setup();
        let mut watch = Watch::Begins;
        if let Some(path) = &files.calibration {
            let file = CalibrationFile::read(path)?;
            setup.camera = file.camera(path)?;
            if let Some(scene) = &file.scene {
                watch = Watch::Goes(CameraWatch::new(scene)?);
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
            colour: images(&names[0])?,
            depth: images(&names[1])?,
            detector: yarp_vision::Detector::new(database, setup.clone(), parameters)?,
            names,
            setup,
            watch,
            known: Vec::new(),
            next: 0,
        })
    }

    fn look(&mut self) -> Result<Vec<FoundObject>, DetectError> {
        // Both before either is waited for: they are taken at the same time.
        let colour = self.colour.latest().map_err(failed)?;
        let depth = self.depth.latest().map_err(failed)?;
        let colour = newer(&mut self.colour, &self.names[0], &colour, IMAGE_TIMEOUT)?;
        let depth = newer(&mut self.depth, &self.names[1], &depth, IMAGE_TIMEOUT)?;
        let depth = depth.to_mono().map_err(failed)?.image;
        let depth = DepthImage::from_grey(&depth, f64::from(DEPTH_FROM), f64::from(DEPTH_STEP));
        let depth = depth.map_err(failed)?;
        let image = &colour.image;
        let (watch, detector) = (&mut self.watch, &mut self.detector);
        let (setup, camera) = (&self.setup, &self.names[0]);
        // Side by side: each takes about a tenth of a second, during which the robot may wait.
        let (checked, found) = std::thread::scope(|scope| {
            let check = scope.spawn(move || watch.check(image, setup, camera));
            let found = detector.detect(image, Some(&depth)).map_err(failed);
            let checked = check.join().unwrap_or_else(|panic| resume_unwind(panic));
            (checked, found)
        });
        checked.and(found)
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

/// Waits for an image that was taken after `seen` had come.
///
/// A camera that repeats an image pixel by pixel is frozen: in a new one at least the noise is another.
fn newer(
    images: &mut dyn ImageSource,
    name: &str,
    seen: &Frame,
    timeout: Duration,
) -> Result<Frame, DetectError> {
    let start = Instant::now();
    loop {
        let frame = images.latest().map_err(failed)?;
        let is_new = frame.number >= seen.number + NEW_IMAGES;
        if is_new && frame.image != seen.image {
            return Ok(frame);
        }
        if start.elapsed() >= timeout {
            let (detector, peer) = (NAME, name.to_owned());
            let seconds = timeout.as_secs_f64();
            return Err(match is_new {
                true => DetectError::Frozen {
                    detector,
                    peer,
                    seconds,
                },
                false => DetectError::Stale {
                    detector,
                    peer,
                    seconds,
                },
            });
        }
        std::thread::sleep(POLL_INTERVAL);
    }
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
    use yarp_devices::image::{Image, PixelFormat};

    use super::*;

    /// A camera whose images get new numbers, and another content from a number on.
    struct Repeating {
        number: u64,
        changes_at: u64,
    }

    impl ImageSource for Repeating {
        fn latest(&mut self) -> Result<Frame, VisionError> {
            self.number += 1;
            let value = u8::from(self.number >= self.changes_at);
            let image = Image::new(PixelFormat::Mono, 1, 1, vec![value]);
            Ok(Frame {
                image: image.expect("the size fits"),
                number: self.number,
                time: 0.0,
            })
        }
    }

    fn look(changes_at: u64) -> Result<Frame, DetectError> {
        let mut camera = Repeating {
            number: 0,
            changes_at,
        };
        let seen = camera.latest().expect("it has an image");
        newer(&mut camera, "/camera", &seen, Duration::from_millis(200))
    }

    /// Objects were picked where they had been when the camera froze.
    #[test]
    fn a_camera_that_repeats_its_image_is_frozen() {
        match look(u64::MAX) {
            Err(DetectError::Frozen { peer, .. }) => assert_eq!(peer, "/camera"),
            other => panic!("{other:?}"),
        }
        assert_eq!(look(5).expect("a new image comes").number, 5);
    }

    #[test]
    fn an_image_that_was_under_way_is_not_new() {
        assert_eq!(look(2).expect("a new image comes").number, 1 + NEW_IMAGES);
    }
}
