//! Calibration files in OpenCV's XML or YAML, for this project and for any program with OpenCV.

use std::fs;
use std::path::Path;

use nalgebra::Matrix4;
use opencv::core::{
    FileNodeTraitConst, FileStorage, FileStorage_Mode, FileStorageTrait, FileStorageTraitConst,
    Mat, MatTraitConst, MatTraitConstManual,
};

use super::transforms::{intrinsic_matrix, pose_of};
use super::{CalibrationError, HandEye, Pattern, Result};
use crate::{CameraModel, Intrinsics, Pose};

/// Maximum size of a calibration file, in bytes.
const MAX_SIZE: u64 = 1 << 20;
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

    /// Writes the file; `.xml` is XML, `.yml` and `.yaml` are YAML.
    ///
    /// The names are those of OpenCV's calibration sample (`camera_matrix`, `distortion_coefficients`, ...) and of the
    /// thesis (`Hcam2world`, `Hgrid2hand`); lengths are in m.
    ///
    /// Errors: [`CalibrationError::File`].
    pub fn write(&self, path: &Path) -> Result<()> {
        check_extension(path)?;
        self.store(path)
            .map_err(|error| failed(path, "cannot be written", &error))
    }

    fn store(&self, path: &Path) -> opencv::Result<()> {
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
        })
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
