//! Cameras of the machine, through the kernel's interface for video devices (V4L2).
//!
//! ```text
//! linux_driver ──▶ capture_thread ──▶ buffer_conversion ──▶ LatestValue ──▶ whoever asks
//! the kernel       waits, takes,       lengths checked,
//!                  opens again         red, green, blue
//! ```
//!
//! | file | content |
//! | --- | --- |
//! | `v4l2_camera` | [`V4l2Camera`]: the device interfaces |
//! | `v4l2_options` | [`V4l2Options`] |
//! | `capture_thread` | takes images, and opens an unplugged camera again |
//! | `mode_selection` | choice of size, encoding and rate |
//! | `buffer_conversion` | buffers to images; [`Encoding`] |
//! | `camera_controls` | features as controls of the driver |
//! | `video_driver` | the driver as traits, so that all this is tested without one |
//! | `linux_driver`, `kernel_controls` | the driver of the kernel |
//!
//! `make test-camera` runs it with the kernel's virtual camera `vivid`.

mod buffer_conversion;
mod camera_controls;
mod capture_thread;
#[cfg(test)]
mod fake_driver;
mod kernel_controls;
mod linux_driver;
mod mode_selection;
mod v4l2_camera;
mod v4l2_options;
mod video_driver;

pub use buffer_conversion::Encoding;
pub use v4l2_camera::V4l2Camera;
pub use v4l2_options::V4l2Options;
