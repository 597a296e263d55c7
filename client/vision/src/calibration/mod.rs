//! Calibration of a camera and of its pose relative to the arm (sections 6.3.1 and 6.4.1 of the thesis).
//!
//! The camera stands still, and the hand carries a chessboard. `docs/calibration.md` explains method and measurements.
//!
//! | file | content |
//! | --- | --- |
//! | `pattern`, `chessboard` | [`Pattern`], [`detect`]: corners in a unique order |
//! | `intrinsic_calibration` | [`calibrate_intrinsics`]: Zhang's method, rejection of bad images |
//! | `hand_eye` | [`Method`], [`solve`]: five closed forms |
//! | `refinement`, `levenberg_marquardt` | [`refine`]: all parameters at once, errors of the arm included |
//! | `solve` | [`calibrate`]: all of it, with rejection of bad views |
//! | `transforms` | [`HandEye`]: equations 5 to 12 |
//! | `calibration_report`, `error_figure` | [`ErrorReport`]: Tables 7 and 8, Figure 33 |
//! | `files` | [`CalibrationFile`]: OpenCV's XML and YAML |
//! | `camera_check`, `camera_watch` | [`CameraReference`], [`CameraWatch`]: detect a camera that has moved |
//! | `static_scene` | [`StaticScene`]: the scene without the arm, from the images of a session |
//! | `postures`, `session` | postures that show the pattern; [`Session`]: moves the arm and takes the images |

mod calibration_error;
mod calibration_report;
mod camera_check;
mod camera_watch;
mod chessboard;
mod error_figure;
mod files;
mod hand_eye;
mod intrinsic_calibration;
mod levenberg_marquardt;
mod pattern;
mod postures;
mod refinement;
mod session;
mod solve;
mod static_scene;
mod transforms;

pub use calibration_error::{CalibrationError, Result};
pub use calibration_report::{
    ErrorReport, PoseErrors, Spread, ViewErrors, location_error, measure,
};
pub use camera_check::{CameraReference, Displacement};
pub use camera_watch::{CameraWatch, TOLERANCE};
pub use chessboard::{Detection, detect};
pub use error_figure::write_figure;
pub use files::CalibrationFile;
pub use hand_eye::{MIN_VIEWS, Method, solve};
pub use intrinsic_calibration::{
    IntrinsicsEstimate, MIN_IMAGES, calibrate_intrinsics, pattern_pose,
};
pub use pattern::Pattern;
pub use postures::{MIN_SINGULAR_VALUE, PostureChoice};
pub use refinement::{Accuracy, View, refine};
pub use session::{Session, SessionOptions, Taken, table_obstacle};
pub use solve::{Calibration, MethodErrors, SolveOptions, calibrate, grids};
pub use static_scene::StaticScene;
pub use transforms::{HandEye, back_project, intrinsic_matrix};
