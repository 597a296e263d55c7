//! One program of all tests of this crate, one file per behaviour: it is compiled and linked once, and its tests run side by side.
//! A test that needs a process of its own has an entry in `Cargo.toml` instead.

mod rendering;

mod back_projection;
mod beyond_image;
mod calibration_files;
mod calibration_images;
mod calibration_session;
mod detector_limits;
mod hand_eye_calibration;
mod hidden_objects;
mod image_sources;
mod real_photographs;
mod remote_images;
mod servoing;
mod simulated_tables;
