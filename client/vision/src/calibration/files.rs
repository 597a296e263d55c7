//! Calibration files in OpenCV's XML or YAML, for this project and for any program with OpenCV.

use std::ffi::OsStr;
use std::fs;
use std::path::Path;

use nalgebra::Matrix4;
use opencv::core::{
    FileNodeTraitConst, FileStorage, FileStorage_Mode, FileStorageTrait, FileStorageTraitConst,
    Mat, MatTraitConst, MatTraitConstManual,
};
use yarp_devices::image::image_file;

use super::transforms::{intrinsic_matrix, pose_of};
use super::{CalibrationError, HandEye, Pattern, Result};
use crate::{CameraModel, Image, Intrinsics, Pose, mat};

/// Maximum size of a calibration file, in bytes.
const MAX_SIZE: u64 = 1 << 20;
/// Name of the entry with the image file of the static scene.
const SCENE: &str = "scene_image";
/// Maximum number of columns or rows of an image.
const MAX_LENGTH: i32 = 100_000;

/// Content of a calibration file.
#[derive(Clone, Debug, PartialEq)]
pub struct CalibrationFile {
    /// Intrinsic parameters.
    pub intrinsics: Intrinsics,
    /// The pattern that was used.
    pub pattern: Pattern,
    /// Root mean square of the error in the image, in pixels.
    pub image_rms: f64,
    /// Transforms from camera to world and from grid to hand; `None` for a file of intrinsic parameters alone.
    pub transforms: Option<(Pose, Pose)>,
    /// Root mean square of the back-projection error, in mm; `None` without transforms.
    pub back_projection_rms: Option<f64>,
    /// The static scene when the camera was calibrated, in a file of its own: tells whether the camera has moved since.
    pub scene: Option<Image>,
}

impl CalibrationFile {
    /// Returns the transforms with the intrinsic parameters; `None` for a file of intrinsic parameters alone.
    pub fn hand_eye(&self) -> Option<HandEye> {
        self.transforms.map(|(pose, grid_to_hand)| HandEye {
            camera: CameraModel {
                intrinsics: self.intrinsics,
                pose,
            },
            grid_to_hand,
        })
    }

    /// Returns the camera with its pose.
    ///
    /// Errors: [`CalibrationError::File`] for a file of intrinsic parameters alone; `path` names it.
    pub fn camera(&self, path: &Path) -> Result<CameraModel> {
        let found = self.hand_eye().map(|hand_eye| hand_eye.camera);
        found.ok_or_else(|| {
            let problem = "expected the pose of the camera, as `yarp calibrate --output` writes it; the file has \
                 intrinsic parameters alone";
            invalid(path, problem.to_owned())
        })
    }

    /// Writes the file, and the scene beside it as `NAME-scene.png`; `.xml` is XML, `.yml` and `.yaml` are YAML.
    ///
    /// The names are those of OpenCV's calibration sample (`camera_matrix`, `distortion_coefficients`, ...) and of the
    /// thesis (`Hcam2world`, `Hgrid2hand`); lengths are in m.
    ///
    /// Errors: [`CalibrationError::File`].
    pub fn write(&self, path: &Path) -> Result<()> {
        check_extension(path)?;
        let scene = match &self.scene {
            Some(scene) => Some(write_scene(path, scene)?),
            None => None,
        };
        self.store(path, scene.as_deref())
            .map_err(|error| failed(path, "cannot be written", &error))
    }

    fn store(&self, path: &Path, scene: Option<&str>) -> opencv::Result<()> {
        let mode = FileStorage_Mode::WRITE as i32;
        let mut file = FileStorage::new(path, mode, "")?;
        if !file.is_opened()? {
            let code = opencv::core::StsError;
            return Err(opencv::Error::new(
                code,
                "the folder does not exist or is read-only",
            ));
        }
        file.write_i32("image_width", self.intrinsics.size[0] as i32)?;
        file.write_i32("image_height", self.intrinsics.size[1] as i32)?;
        file.write_i32("board_width", self.pattern.columns() as i32)?;
        file.write_i32("board_height", self.pattern.rows() as i32)?;
        file.write_f64("square_size", self.pattern.square())?;
        let matrix = intrinsic_matrix(&self.intrinsics);
        let row = |row: usize| [matrix[(row, 0)], matrix[(row, 1)], matrix[(row, 2)]];
        let matrix = Mat::from_slice_2d(&[row(0), row(1), row(2)])?;
        file.write_mat("camera_matrix", &matrix)?;
        let distortion = Mat::from_slice_2d(&self.intrinsics.distortion.map(|term| [term]))?;
        file.write_mat("distortion_coefficients", &distortion)?;
        file.write_f64("avg_reprojection_error", self.image_rms)?;
        if let Some((camera, grid)) = &self.transforms {
            file.write_mat("Hcam2world", &homogeneous(camera)?)?;
            file.write_mat("Hgrid2hand", &homogeneous(grid)?)?;
        }
        if let Some(rms) = self.back_projection_rms {
            file.write_f64("back_projection_rms_mm", rms)?;
        }
        if let Some(name) = scene {
            file.write_str(SCENE, name)?;
        }
        file.release()
    }

    /// Reads a file of [`write`](Self::write), or of OpenCV's calibration sample.
    ///
    /// Errors: [`CalibrationError::File`] for files that are missing, larger than 1 MiB, or without valid values.
    pub fn read(path: &Path) -> Result<Self> {
        check_extension(path)?;
        let meta = fs::metadata(path).map_err(|error| failed(path, "cannot be read", &error))?;
        if !meta.is_file() || meta.len() > MAX_SIZE {
            let problem = format!("expected a file of at most {MAX_SIZE} bytes");
            return Err(invalid(path, problem));
        }
        let mode = FileStorage_Mode::READ as i32;
        let file = FileStorage::new(path, mode, "");
        let file = file.map_err(|error| failed(path, "is no OpenCV file", &error))?;
        if !file.is_opened().unwrap_or(false) {
            return Err(invalid(path, "is no OpenCV file".to_owned()));
        }
        Reader { path, file }.read()
    }
}

struct Reader<'a> {
    path: &'a Path,
    file: FileStorage,
}

impl Reader<'_> {
    fn read(&self) -> Result<CalibrationFile> {
        let length = |name: &'static str| -> Result<usize> {
            let value = self.number(name)?;
            if value.fract() == 0.0 && (1.0..=f64::from(MAX_LENGTH)).contains(&value) {
                return Ok(value as usize);
            }
            let problem = format!("{name}: expected a whole number of 1 to {MAX_LENGTH}");
            Err(invalid(self.path, problem))
        };
        let size = [length("image_width")?, length("image_height")?];
        let [columns, rows] = [length("board_width")?, length("board_height")?];
        let pattern = Pattern::new(columns as u32, rows as u32, self.number("square_size")?);
        let pattern = pattern.map_err(|error| failed(self.path, "board", &error))?;
        let matrix = self.matrix("camera_matrix", &[9])?;
        let found = self.matrix("distortion_coefficients", &[4, 5])?;
        let mut distortion = [0.0; 5];
        distortion[..found.len()].copy_from_slice(&found);
        let intrinsics = Intrinsics {
            size,
            focal: [matrix[0], matrix[4]],
            centre: [matrix[2], matrix[5]],
            distortion,
        };
        if !(intrinsics.focal[0] > 0.0 && intrinsics.focal[1] > 0.0) {
            let problem = "camera_matrix: expected focal lengths above 0".to_owned();
            return Err(invalid(self.path, problem));
        }
        let transforms = if self.has("Hcam2world")? {
            Some((self.pose("Hcam2world")?, self.pose("Hgrid2hand")?))
        } else {
            None
        };
        let optional = "back_projection_rms_mm";
        let back_projection_rms = match self.has(optional)? {
            true => Some(self.number(optional)?),
            false => None,
        };
        Ok(CalibrationFile {
            intrinsics,
            pattern,
            image_rms: self.number("avg_reprojection_error")?,
            transforms,
            back_projection_rms,
            scene: self.scene(size)?,
        })
    }

    /// Reads the image of the static scene, which is in the folder of the file.
    fn scene(&self, [width, height]: [usize; 2]) -> Result<Option<Image>> {
        if !self.has(SCENE)? {
            return Ok(None);
        }
        let node = self.file.get(SCENE);
        let name = node.and_then(|node| node.to_string());
        let name = name.map_err(|error| failed(self.path, SCENE, &error))?;
        if Path::new(&name).file_name() != Some(OsStr::new(&name)) {
            let problem =
                format!("{SCENE}: expected the name of a file in the same folder, got {name:?}");
            return Err(invalid(self.path, problem));
        }
        let beside = self.path.with_file_name(&name);
        let image = image_file::read(&beside).map_err(|error| failed(self.path, SCENE, &error))?;
        if [image.width(), image.height()] != [width, height] {
            let problem = format!(
                "{SCENE}: expected {width}x{height} pixels, {name} has {}x{}",
                image.width(),
                image.height()
            );
            return Err(invalid(self.path, problem));
        }
        Ok(Some(image))
    }

    fn has(&self, name: &str) -> Result<bool> {
        let empty = self.file.get(name).and_then(|node| node.empty());
        empty
            .map(|empty| !empty)
            .map_err(|error| failed(self.path, name, &error))
    }

    fn number(&self, name: &str) -> Result<f64> {
        let node = self
            .file
            .get(name)
            .map_err(|error| failed(self.path, name, &error))?;
        let value = match node.is_int().unwrap_or(false) || node.is_real().unwrap_or(false) {
            true => node.to_f64().unwrap_or(f64::NAN),
            false => f64::NAN,
        };
        if value.is_finite() {
            return Ok(value);
        }
        Err(invalid(self.path, format!("{name}: expected a number")))
    }

    fn matrix(&self, name: &str, lengths: &[usize]) -> Result<Vec<f64>> {
        let node = self
            .file
            .get(name)
            .map_err(|error| failed(self.path, name, &error))?;
        let wrong = || {
            let problem = format!("{name}: expected a matrix of {lengths:?} finite doubles");
            invalid(self.path, problem)
        };
        let mat = node.mat().map_err(|_| wrong())?;
        if mat.dims() != 2 || !lengths.contains(&mat.total()) {
            return Err(wrong());
        }
        let values = mat.data_typed::<f64>().map_err(|_| wrong())?.to_vec();
        if values.iter().all(|value| value.is_finite()) {
            return Ok(values);
        }
        Err(wrong())
    }

    fn pose(&self, name: &str) -> Result<Pose> {
        let values = self.matrix(name, &[16])?;
        let problem = || format!("{name}: expected a rotation and a translation");
        pose_of(&Matrix4::from_row_slice(&values)).ok_or_else(|| invalid(self.path, problem()))
    }
}

/// Writes the image of the static scene beside a calibration file; returns its name.
fn write_scene(path: &Path, scene: &Image) -> Result<String> {
    let stem = path.file_stem().and_then(OsStr::to_str).unwrap_or("camera");
    let name = format!("{stem}-scene.png");
    let beside = path.with_file_name(&name);
    let image =
        mat::of_image(scene).map_err(|error| failed(&beside, "cannot be written", &error))?;
    let written = opencv::imgcodecs::imwrite_def(&beside, &image);
    match written {
        Ok(true) => Ok(name),
        Ok(false) => Err(invalid(&beside, "cannot be written".to_owned())),
        Err(error) => Err(failed(&beside, "cannot be written", &error)),
    }
}

fn homogeneous(pose: &Pose) -> opencv::Result<Mat> {
    let matrix = pose.to_homogeneous();
    let row = |row: usize| -> [f64; 4] { std::array::from_fn(|column| matrix[(row, column)]) };
    Mat::from_slice_2d(&[row(0), row(1), row(2), row(3)])
}

fn check_extension(path: &Path) -> Result<()> {
    let extension = path.extension().and_then(|word| word.to_str());
    if matches!(extension, Some("xml" | "yml" | "yaml")) {
        return Ok(());
    }
    Err(invalid(
        path,
        "expected a name that ends in .xml, .yml or .yaml".to_owned(),
    ))
}

fn invalid(path: &Path, problem: String) -> CalibrationError {
    CalibrationError::File {
        path: path.to_owned(),
        problem,
    }
}

fn failed(path: &Path, what: &str, error: &dyn std::error::Error) -> CalibrationError {
    invalid(path, format!("{what}: {error}"))
}
