//! Errors of calibration.

use std::path::PathBuf;

/// The result of a step of calibration.
pub type Result<T, E = CalibrationError> = std::result::Result<T, E>;

/// An error of calibration. Nothing has been written, and no arm moves because of it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// A pattern has too few corners, or squares of no size.
    #[error(
        "pattern {text:?}: expected COLUMNSxROWS inner corners, 3 to 64 each, such as 9x6, and a square larger than 0"
    )]
    Pattern {
        /// The pattern as given.
        text: String,
    },
    /// An image cannot be converted.
    #[error("{image} cannot be read")]
    Image {
        /// File or origin of the image.
        image: String,
        /// Reason.
        #[source]
        source: Box<crate::VisionError>,
    },
    /// The image shows no complete pattern.
    #[error(
        "no chessboard with {columns}x{rows} inner corners in {image}; the whole pattern with a white border must be in sight, sharp and lit evenly"
    )]
    NoPattern {
        /// File or origin of the image.
        image: String,
        /// Inner corners of a row.
        columns: u32,
        /// Inner corners of a column.
        rows: u32,
    },
    /// The image is dark or uniform everywhere.
    #[error(
        "{image} is almost uniform (mean {mean:.0}, contrast {contrast:.1} of 255): the lens is covered or there is no light; uncover it and repeat"
    )]
    Covered {
        /// File or origin of the image.
        image: String,
        /// Mean brightness, 0 to 255.
        mean: f64,
        /// Standard deviation of the brightness.
        contrast: f64,
    },
    /// The camera is not where it was when it was calibrated.
    #[error(
        "the camera has moved: {pixels:.1} pixels, about {millimetres:.1} mm on the table, more than {tolerance:.1} pixels; recalibrate with `yarp calibrate`"
    )]
    CameraMoved {
        /// Largest displacement of the static scene, in pixels.
        pixels: f64,
        /// The same on the table, in mm.
        millimetres: f64,
        /// Tolerance, in pixels.
        tolerance: f64,
    },
    /// Too little of the static scene was found again.
    #[error(
        "only {matches} points of the reference image were found again, {expected} are necessary: the view is blocked or the camera has moved far; clear the table or recalibrate with `yarp calibrate`"
    )]
    SceneNotRecognised {
        /// Points found.
        matches: usize,
        /// Points necessary.
        expected: usize,
    },
    /// Too few usable images.
    #[error(
        "{usable} of {given} images are usable, {expected} are necessary; the pattern was not found or the error was too large in the others"
    )]
    TooFewImages {
        /// Images with a pattern and an error that is not too large.
        usable: usize,
        /// All images.
        given: usize,
        /// Minimum.
        expected: usize,
    },
    /// The images have different sizes.
    #[error(
        "{image} has {width}x{height} pixels, the first image {expected_width}x{expected_height}; images of one camera have one size"
    )]
    Size {
        /// File or origin of the image.
        image: String,
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// Columns of the first image.
        expected_width: usize,
        /// Rows of the first image.
        expected_height: usize,
    },
    /// The motions between the images do not determine the transforms.
    #[error(
        "the hand turned by {degrees:.1} degrees about {axes}: hand-eye calibration needs turns of {expected:.1} degrees (RMS) about two different axes"
    )]
    Degenerate {
        /// `a second axis` or `any axis`.
        axes: &'static str,
        /// RMS of the turns about it, in degrees.
        degrees: f64,
        /// Minimum, in degrees.
        expected: f64,
    },
    /// The optimisation found no minimum.
    #[error("the joint refinement did not converge within {iterations} iterations")]
    NotConverged {
        /// Iterations.
        iterations: usize,
    },
    /// Too few postures show the pattern to the camera.
    #[error(
        "{found} of {wanted} postures found that show the pattern to the camera: {unreachable} of {tried} poses are out of reach, {singular} singular, {colliding} collide, {hidden} are hidden; check the guesses of the camera's and the pattern's pose"
    )]
    NoPostures {
        /// Postures found.
        found: usize,
        /// Postures necessary.
        wanted: usize,
        /// Poses tried.
        tried: usize,
        /// Without inverse kinematics.
        unreachable: usize,
        /// Near a singular posture.
        singular: usize,
        /// In collision.
        colliding: usize,
        /// Not visible to the camera.
        hidden: usize,
    },
    /// A given posture is near a singular one.
    #[error(
        "posture {posture} is singular (smallest singular value of the Jacobian {value:.4}, {expected:.4} is necessary); it was not approached"
    )]
    Singular {
        /// Number of the posture.
        posture: usize,
        /// Smallest singular value.
        value: f64,
        /// Minimum.
        expected: f64,
    },
    /// No motion to a posture was found.
    #[error("posture {posture} cannot be reached, and the arm holds its position")]
    Unreachable {
        /// Number of the posture.
        posture: usize,
        /// Reason given by the planner.
        #[source]
        source: Box<yarp_planning::PlanError>,
    },
    /// The arm did not arrive.
    #[error(
        "the arm did not reach posture {posture} within {seconds:.0} s, joint {joint} is {degrees:.1} degrees away; it was stopped"
    )]
    NotArrived {
        /// Number of the posture.
        posture: usize,
        /// Timeout, in seconds.
        seconds: f64,
        /// Joint with the largest distance, counted from 0.
        joint: usize,
        /// Its distance, in degrees.
        degrees: f64,
    },
    /// The camera delivers no images any more.
    #[error(
        "{camera} delivered no new image within {seconds:.0} s; the arm was stopped and holds its position; check the camera and repeat"
    )]
    CameraStopped {
        /// Name of the camera's port.
        camera: String,
        /// Timeout, in seconds.
        seconds: f64,
    },
    /// A remote device failed.
    #[error("{step} failed; the arm was told to stop")]
    Device {
        /// Step that failed.
        step: &'static str,
        /// Reason.
        #[source]
        source: Box<yarp_devices::DeviceError>,
    },
    /// A device could not be reached.
    #[error("{step} failed")]
    Client {
        /// Step that failed.
        step: &'static str,
        /// Reason.
        #[source]
        source: Box<yarp_client::Error>,
    },
    /// A file could not be read or written.
    #[error("{}: {problem}", path.display())]
    File {
        /// File.
        path: PathBuf,
        /// Text of the problem.
        problem: String,
    },
    /// OpenCV failed.
    #[error("{step} failed in OpenCV")]
    OpenCv {
        /// Step that failed.
        step: &'static str,
        /// OpenCV's message.
        #[source]
        source: opencv::Error,
    },
}

/// Adds the step to an error of OpenCV.
pub(super) fn at(step: &'static str) -> impl FnOnce(opencv::Error) -> CalibrationError {
    move |source| CalibrationError::OpenCv { step, source }
}
