//! Parts that the drivers of cameras share.
//!
//! | file | content |
//! | --- | --- |
//! | `capture_state` | images and failures that the capture thread hands to callers; its start and end |
//! | `feature_range` | features from 0 to 1 over the range of a camera |
//! | `common_options` | options of any camera: mirror, lens, features |
//! | `mirror` | left and right swapped |

mod capture_state;
mod common_options;
mod feature_range;
mod mirror;

#[cfg(test)]
pub(super) use capture_state::CLOSE_TIMEOUT;
pub(super) use capture_state::{CaptureHandle, CaptureState, Failure, REOPEN_INTERVAL};
pub(super) use common_options::{
    CommonOptions, FeatureValue, Lens, check_rate, common_option_methods,
};
pub(super) use feature_range::{ControlRange, check_fraction, check_mirror};
pub(super) use mirror::mirrored;

/// Maximum number of pixels of an image, which holds 8K video (7680 x 4320).
pub(super) const MAX_PIXELS: usize = 1 << 25;

/// Maximum size of one of a driver's buffers, bytes: four for each pixel.
pub(super) const MAX_BUFFER_BYTES: usize = 4 * MAX_PIXELS;
