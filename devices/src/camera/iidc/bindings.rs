//! Structures, numbers and functions of libdc1394.
//!
//! Source: the headers `dc1394/*.h` of libdc1394 2.2.6. Lists begin at numbers of their own there; [`FirewireControls`](crate::FirewireControls)
//! counts each from 0. `make test-iidc` compares what is read through them with what a simulated camera has.

#![allow(unsafe_code, reason = "the types of functions in C are promises")]

use std::ffi::{c_char, c_int, c_void};

/// Number of the first video mode (`DC1394_VIDEO_MODE_MIN`).
pub(super) const FIRST_MODE: i32 = 64;
/// Number of the first rate (`DC1394_FRAMERATE_MIN`).
pub(super) const FIRST_RATE: i32 = 32;
/// Number of the first colour coding (`DC1394_COLOR_CODING_MIN`).
pub(super) const FIRST_CODING: i32 = 352;
/// Number of the first colour filter (`DC1394_COLOR_FILTER_MIN`).
pub(super) const FIRST_FILTER: i32 = 512;
/// Number of the first feature (`DC1394_FEATURE_MIN`).
pub(super) const FIRST_FEATURE: i32 = 416;
/// Operation mode of IEEE 1394a (`DC1394_OPERATION_MODE_LEGACY`); the next one is IEEE 1394b.
pub(super) const OPERATION_MODE_LEGACY: i32 = 480;
/// Speed of the bus of 400 Mbit/s (`DC1394_ISO_SPEED_400`).
pub(super) const ISO_SPEED_400: i32 = 2;
/// First version of IIDC with a register of the colour filter (`DC1394_IIDC_VERSION_1_31`).
pub(super) const IIDC_1_31: c_int = 548;
/// Control by callers (`DC1394_FEATURE_MODE_MANUAL`).
pub(super) const MODE_MANUAL: i32 = 736;
/// Control by the camera (`DC1394_FEATURE_MODE_AUTO`).
pub(super) const MODE_AUTO: i32 = 737;
/// Control by the camera once (`DC1394_FEATURE_MODE_ONE_PUSH_AUTO`).
pub(super) const MODE_ONE_PUSH: i32 = 738;
/// Takes a frame if there is one (`DC1394_CAPTURE_POLICY_POLL`).
pub(super) const POLICY_POLL: c_int = 673;
/// Allocates channel and bandwidth (`DC1394_CAPTURE_FLAGS_DEFAULT`).
pub(super) const CAPTURE_DEFAULT: u32 = 4;
/// Packet size that the camera recommends (`DC1394_USE_RECOMMENDED`).
pub(super) const RECOMMENDED: i32 = -3;
/// Error of functions that a camera or its bus does not have (`DC1394_FUNCTION_NOT_SUPPORTED`).
pub(super) const FUNCTION_NOT_SUPPORTED: c_int = -3;
/// Kinds of messages: error, warning, debug (`DC1394_LOG_ERROR` and so on).
pub(super) const LOG_KINDS: [c_int; 3] = [768, 769, 770];
/// Length of lists of video modes (`DC1394_VIDEO_MODE_NUM`).
const MODE_COUNT: usize = 32;
/// Length of lists of rates (`DC1394_FRAMERATE_NUM`).
const RATE_COUNT: usize = 8;
/// Length of lists of colour codings (`DC1394_COLOR_CODING_NUM`).
const CODING_COUNT: usize = 11;
/// Length of lists of modes of a feature (`DC1394_FEATURE_MODE_NUM`).
const FEATURE_MODE_COUNT: usize = 3;

/// Returns a number of the library as an index of its list, which begins at `first`.
pub(super) fn index(number: i32, first: i32) -> u32 {
    u32::try_from(number.wrapping_sub(first)).unwrap_or(u32::MAX)
}

/// A list, of which the first `count` items are set (`dc1394video_modes_t` and so on).
#[repr(C)]
#[derive(Debug)]
pub(super) struct List<const LENGTH: usize> {
    count: u32,
    items: [i32; LENGTH],
}

pub(super) type Modes = List<MODE_COUNT>;
pub(super) type Rates = List<RATE_COUNT>;
pub(super) type Codings = List<CODING_COUNT>;
pub(super) type FeatureModes = List<FEATURE_MODE_COUNT>;

impl<const LENGTH: usize> Default for List<LENGTH> {
    fn default() -> Self {
        Self {
            count: 0,
            items: [0; LENGTH],
        }
    }
}

impl<const LENGTH: usize> List<LENGTH> {
    /// Returns the items, no more than there is room for.
    pub(super) fn items(&self) -> &[i32] {
        &self.items[..LENGTH.min(self.count as usize)]
    }

    /// Returns the items as a mask, counted from `first`.
    pub(super) fn mask(&self, first: i32) -> u32 {
        let indices = self.items().iter().map(|item| index(*item, first));
        indices
            .filter(|index| *index < u32::BITS)
            .fold(0, |mask, index| mask | 1 << index)
    }
}

/// The library's own state (`dc1394_t`).
#[repr(C)]
pub(super) struct Context {
    _private: [u8; 0],
}

/// Name of a camera (`dc1394camera_id_t`).
#[repr(C)]
pub(super) struct CameraId {
    pub(super) unit: u16,
    pub(super) guid: u64,
}

/// Cameras on all buses (`dc1394camera_list_t`).
#[repr(C)]
pub(super) struct CameraList {
    pub(super) count: u32,
    pub(super) ids: *mut CameraId,
}

/// A camera (`dc1394camera_t`), which the library makes.
#[repr(C)]
pub(super) struct CameraInfo {
    pub(super) guid: u64,
    unit: c_int,
    unit_spec_id: u32,
    unit_sw_version: u32,
    unit_sub_sw_version: u32,
    command_registers_base: u32,
    unit_directory: u32,
    unit_dependent_directory: u32,
    advanced_features_csr: u64,
    pio_control_csr: u64,
    sio_control_csr: u64,
    strobe_control_csr: u64,
    format7_csr: [u64; 8],
    pub(super) iidc_version: c_int,
    pub(super) vendor: *const c_char,
    pub(super) model: *const c_char,
    vendor_id: u32,
    model_id: u32,
    bmode_capable: c_int,
    one_shot_capable: c_int,
    multi_shot_capable: c_int,
    pub(super) can_switch_on_off: c_int,
}

/// A frame in one of the library's buffers (`dc1394video_frame_t`).
#[repr(C)]
pub(super) struct VideoFrame {
    pub(super) image: *const u8,
    pub(super) size: [u32; 2],
    position: [u32; 2],
    pub(super) color_coding: c_int,
    pub(super) color_filter: c_int,
    yuv_byte_order: u32,
    pub(super) data_depth: u32,
    stride: u32,
    video_mode: c_int,
    pub(super) total_bytes: u64,
    image_bytes: u32,
    padding_bytes: u32,
    pub(super) packet_size: u32,
    packets_per_frame: u32,
    timestamp: u64,
    frames_behind: u32,
    camera: *mut CameraInfo,
    id: u32,
    allocated_image_bytes: u64,
    pub(super) little_endian: c_int,
    data_in_padding: c_int,
}

/// Declares the functions of the library, and how they are found in it.
macro_rules! functions {
    ($($name:ident($($argument:ty),*) $(-> $result:ty)?;)*) => {
        /// Functions of the library, each without the prefix `dc1394_`.
        pub(super) struct Functions {
            $(pub(super) $name: unsafe extern "C" fn($($argument),*) $(-> $result)?,)*
        }

        impl Functions {
            /// Looks the functions up; those of a library that is never unloaded.
            ///
            /// # Safety
            ///
            /// The library must be libdc1394 2.2, and stay loaded.
            pub(super) unsafe fn find(library: &libloading::Library) -> Result<Self, libloading::Error> {
                // SAFETY: the types are those of the headers of libdc1394 2.2, which the caller promises it is.
                Ok(unsafe { Self {
                    $($name: *library.get(concat!("dc1394_", stringify!($name), "\0").as_bytes())?,)*
                } })
            }
        }
    };
}

type Camera = *mut CameraInfo;
pub(super) type LogHandler = unsafe extern "C" fn(c_int, *const c_char, *mut c_void);

functions! {
    new() -> *mut Context;
    free(*mut Context);
    log_register_handler(c_int, Option<LogHandler>, *mut c_void) -> c_int;
    error_get_string(c_int) -> *const c_char;
    camera_enumerate(*mut Context, *mut *mut CameraList) -> c_int;
    camera_free_list(*mut CameraList);
    camera_new(*mut Context, u64) -> Camera;
    camera_free(Camera);
    camera_get_platform_string(Camera, *mut *const c_char) -> c_int;
    camera_reset(Camera) -> c_int;
    camera_set_power(Camera, c_int) -> c_int;
    camera_set_broadcast(Camera, c_int) -> c_int;
    memory_load(Camera, u32) -> c_int;
    video_get_supported_modes(Camera, *mut Modes) -> c_int;
    video_get_supported_framerates(Camera, c_int, *mut Rates) -> c_int;
    video_get_mode(Camera, *mut i32) -> c_int;
    video_set_mode(Camera, c_int) -> c_int;
    video_get_framerate(Camera, *mut i32) -> c_int;
    video_set_framerate(Camera, c_int) -> c_int;
    video_get_operation_mode(Camera, *mut i32) -> c_int;
    video_set_operation_mode(Camera, c_int) -> c_int;
    video_get_iso_speed(Camera, *mut i32) -> c_int;
    video_set_iso_speed(Camera, c_int) -> c_int;
    video_get_transmission(Camera, *mut i32) -> c_int;
    video_set_transmission(Camera, c_int) -> c_int;
    format7_get_max_image_size(Camera, c_int, *mut u32, *mut u32) -> c_int;
    format7_get_unit_size(Camera, c_int, *mut u32, *mut u32) -> c_int;
    format7_get_unit_position(Camera, c_int, *mut u32, *mut u32) -> c_int;
    format7_get_image_size(Camera, c_int, *mut u32, *mut u32) -> c_int;
    format7_get_image_position(Camera, c_int, *mut u32, *mut u32) -> c_int;
    format7_get_color_coding(Camera, c_int, *mut i32) -> c_int;
    format7_get_color_codings(Camera, c_int, *mut Codings) -> c_int;
    format7_get_packet_parameters(Camera, c_int, *mut u32, *mut u32) -> c_int;
    format7_get_packet_size(Camera, c_int, *mut u32) -> c_int;
    format7_get_packets_per_frame(Camera, c_int, *mut u32) -> c_int;
    format7_set_roi(Camera, c_int, c_int, i32, i32, i32, i32, i32) -> c_int;
    feature_is_present(Camera, c_int, *mut i32) -> c_int;
    feature_get_boundaries(Camera, c_int, *mut u32, *mut u32) -> c_int;
    feature_get_value(Camera, c_int, *mut u32) -> c_int;
    feature_set_value(Camera, c_int, u32) -> c_int;
    feature_whitebalance_get_value(Camera, *mut u32, *mut u32) -> c_int;
    feature_whitebalance_set_value(Camera, u32, u32) -> c_int;
    feature_is_switchable(Camera, c_int, *mut i32) -> c_int;
    feature_get_power(Camera, c_int, *mut i32) -> c_int;
    feature_set_power(Camera, c_int, c_int) -> c_int;
    feature_get_modes(Camera, c_int, *mut FeatureModes) -> c_int;
    feature_get_mode(Camera, c_int, *mut i32) -> c_int;
    feature_set_mode(Camera, c_int, c_int) -> c_int;
    feature_get_absolute_control(Camera, c_int, *mut i32) -> c_int;
    feature_set_absolute_control(Camera, c_int, c_int) -> c_int;
    capture_setup(Camera, u32, u32) -> c_int;
    capture_stop(Camera) -> c_int;
    capture_get_fileno(Camera) -> c_int;
    capture_dequeue(Camera, c_int, *mut *mut VideoFrame) -> c_int;
    capture_enqueue(Camera, *mut VideoFrame) -> c_int;
    capture_is_frame_corrupt(Camera, *mut VideoFrame) -> c_int;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_are_no_longer_than_their_room() {
        let mut list = Rates {
            count: 3,
            items: [32, 34, 39, 33, 0, 0, 0, 0],
        };
        assert_eq!(list.mask(FIRST_RATE), 0b1000_0101);
        list.count = u32::MAX;
        assert_eq!(list.items().len(), 8);
        // Numbers of other lists are no places in this one.
        assert_eq!(list.mask(FIRST_RATE), 0b1000_0111);
    }
}
