//! An open camera: the calls of the library, each with its error.

#![allow(unsafe_code, reason = "a library in C has no safe interface")]

use std::ffi::c_int;
use std::os::fd::BorrowedFd;
use std::ptr::NonNull;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::IidcChoice;
use super::bindings::{
    CAPTURE_DEFAULT, CameraInfo, CameraList, Context, FUNCTION_NOT_SUPPORTED, Functions, IIDC_1_31,
    POLICY_POLL, VideoFrame,
};
use super::library::{load, text};
use crate::camera::hardware::MAX_BUFFER_BYTES;
use crate::{Bus, CameraDescription, DeviceError};

/// Number of buffers of the library, as in stock's driver.
const BUFFER_COUNT: u32 = 4;
/// Maximum number of cameras among which one is looked for: the addresses of a bus of IEEE 1394.
const MAX_CAMERAS: usize = 63;
/// Maximum number of attempts to end the transmission of a camera that is closed.
const STOP_ATTEMPTS: usize = 3;
/// Maximum number of lost cameras of which objects of the library stay behind in the process: about 8 file descriptors each, of
/// usually 1024.
const MAX_LEFT_BEHIND: usize = 16;
const OFF: c_int = 0;
const ADVICE: &str = "whether the camera is plugged in, and another value or video mode";

/// Number of lost cameras of which objects of the library have stayed behind in the process.
static LEFT_BEHIND: AtomicUsize = AtomicUsize::new(0);

/// A getter of one value.
pub(super) type Get<T> = unsafe extern "C" fn(*mut CameraInfo, *mut T) -> c_int;
/// A getter of one value of an item, such as a video mode or a feature.
pub(super) type GetOf<T> = unsafe extern "C" fn(*mut CameraInfo, c_int, *mut T) -> c_int;
/// A getter of two values of an item.
pub(super) type GetPair = unsafe extern "C" fn(*mut CameraInfo, c_int, *mut u32, *mut u32) -> c_int;

/// A frame that the camera has sent.
pub(super) struct FrameView<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) size: (u32, u32),
    pub(super) coding: i32,
    /// Colour filter; `None` if the camera has no register of it.
    pub(super) filter: Option<i32>,
    pub(super) depth: u32,
    pub(super) little_endian: bool,
    pub(super) packet_bytes: u32,
    /// True if a part of it was lost.
    pub(super) damaged: bool,
}

/// A camera that is open. It is closed when this is dropped, and sends nothing then.
pub(super) struct OpenedCamera {
    api: &'static Functions,
    context: NonNull<Context>,
    camera: NonNull<CameraInfo>,
    peer: String,
    capturing: bool,
    /// True for cameras on USB.
    is_usb: bool,
}

/// The library's state, until a camera is open.
struct OpenContext(&'static Functions, NonNull<Context>);

impl Drop for OpenContext {
    fn drop(&mut self) {
        // SAFETY: the context is the library's, and no camera of it is open.
        unsafe { (self.0.free)(self.1.as_ptr()) };
    }
}

impl OpenedCamera {
    /// Opens a camera. All buses are looked at each time.
    pub(super) fn open(choice: IidcChoice) -> Result<Self, DeviceError> {
        check_left_behind(LEFT_BEHIND.load(Ordering::Relaxed), choice)?;
        let api = load()?;
        let failed = |step: &str, advice: &str| DeviceError::Remote {
            peer: choice.to_string(),
            step: step.to_owned(),
            advice: advice.to_owned(),
            source: None,
        };
        // SAFETY: it takes nothing.
        let context = NonNull::new(unsafe { (api.new)() });
        let context = context.ok_or_else(|| {
            let advice = "whether the kernel has IEEE 1394 or USB (ls /dev/fw* /dev/bus/usb)";
            failed("looking for buses", advice)
        })?;
        let context = OpenContext(api, context);
        let guids = guids(api, context.1);
        let wanted = match choice {
            IidcChoice::First => guids.first(),
            IidcChoice::Index(index) => guids.get(index),
            IidcChoice::Guid(guid) => guids.iter().find(|one| **one == guid),
        };
        let Some(guid) = wanted.copied() else {
            let found: Vec<_> = guids.iter().map(|guid| format!("{guid:016X}")).collect();
            let advice = match found.is_empty() {
                true => "whether it is plugged in, and the rights to /dev/fw* or /dev/bus/usb"
                    .to_owned(),
                false => format!("one of those that are plugged in: {}", found.join(", ")),
            };
            return Err(failed("finding the camera", &advice));
        };
        // SAFETY: the context is the library's.
        let camera = NonNull::new(unsafe { (api.camera_new)(context.1.as_ptr(), guid) });
        let camera = camera.ok_or_else(|| {
            let advice = "after closing other programs that use the camera, or as a user with the rights to it";
            failed("opening the camera", advice)
        })?;
        let mut opened = Self {
            api,
            context: context.1,
            camera,
            peer: format!("{choice} ({guid:016X})"),
            capturing: false,
            is_usb: false,
        };
        std::mem::forget(context);
        opened.is_usb = opened.platform() == "usb";
        Ok(opened)
    }

    /// Returns the functions of the library.
    pub(super) fn api(&self) -> &'static Functions {
        self.api
    }

    fn raw(&self) -> *mut CameraInfo {
        self.camera.as_ptr()
    }

    /// Turns a result of the library into an error.
    pub(super) fn check(&self, step: &str, code: c_int) -> Result<(), DeviceError> {
        if code == 0 {
            return Ok(());
        }
        if code == FUNCTION_NOT_SUPPORTED {
            return Err(DeviceError::NotSupported {
                what: step.to_owned(),
            });
        }
        // SAFETY: it returns a constant text for any number in its list; others are not asked for.
        let words = match (-39..0).contains(&code) {
            true => unsafe { text((self.api.error_get_string)(code)) },
            false => format!("error {code}"),
        };
        Err(DeviceError::Remote {
            peer: self.peer.clone(),
            step: step.to_owned(),
            advice: ADVICE.to_owned(),
            source: Some(words.into()),
        })
    }

    /// Reads a value.
    pub(super) fn get<T: Default>(&self, step: &str, get: Get<T>) -> Result<T, DeviceError> {
        let mut value = T::default();
        // SAFETY: the camera is open, and the function writes one value of its type.
        self.check(step, unsafe { get(self.raw(), &mut value) })?;
        Ok(value)
    }

    /// Reads a value of an item.
    pub(super) fn get_of<T: Default>(
        &self,
        step: &str,
        item: c_int,
        get: GetOf<T>,
    ) -> Result<T, DeviceError> {
        let mut value = T::default();
        // SAFETY: the camera is open, and the function writes one value of its type.
        self.check(step, unsafe { get(self.raw(), item, &mut value) })?;
        Ok(value)
    }

    /// Reads two values of an item.
    pub(super) fn get_pair(
        &self,
        step: &str,
        item: c_int,
        get: GetPair,
    ) -> Result<(u32, u32), DeviceError> {
        let (mut first, mut second) = (0, 0);
        // SAFETY: the camera is open, and the function writes two values.
        self.check(step, unsafe {
            get(self.raw(), item, &mut first, &mut second)
        })?;
        Ok((first, second))
    }

    /// Sets a value.
    pub(super) fn set(
        &self,
        step: &str,
        value: c_int,
        set: unsafe extern "C" fn(*mut CameraInfo, c_int) -> c_int,
    ) -> Result<(), DeviceError> {
        // SAFETY: the camera is open.
        self.check(step, unsafe { set(self.raw(), value) })
    }

    /// Sets a value of an item.
    pub(super) fn set_of<T>(
        &self,
        step: &str,
        item: c_int,
        value: T,
        set: unsafe extern "C" fn(*mut CameraInfo, c_int, T) -> c_int,
    ) -> Result<(), DeviceError> {
        // SAFETY: the camera is open.
        self.check(step, unsafe { set(self.raw(), item, value) })
    }

    /// Reads the white balance: blue and red.
    pub(super) fn white_balance(&self) -> Result<(u32, u32), DeviceError> {
        let (mut blue, mut red) = (0, 0);
        let get = self.api.feature_whitebalance_get_value;
        // SAFETY: the camera is open, and the function writes two values.
        self.check("reading WhiteBalance", unsafe {
            get(self.raw(), &mut blue, &mut red)
        })?;
        Ok((blue, red))
    }

    /// Sets the white balance.
    pub(super) fn set_white_balance(&self, (blue, red): (u32, u32)) -> Result<(), DeviceError> {
        let set = self.api.feature_whitebalance_set_value;
        // SAFETY: the camera is open.
        self.check("setting WhiteBalance", unsafe {
            set(self.raw(), blue, red)
        })
    }

    /// Sets coding, bytes in a packet and window of a mode of format 7.
    pub(super) fn set_region(
        &self,
        mode: c_int,
        coding: c_int,
        packet: i32,
        [x, y, width, height]: [i32; 4],
    ) -> Result<(), DeviceError> {
        let set = self.api.format7_set_roi;
        // SAFETY: the camera is open.
        self.check("setting window, coding and packet size", unsafe {
            set(self.raw(), mode, coding, packet, x, y, width, height)
        })
    }

    /// Resets the camera.
    pub(super) fn reset(&self) -> Result<(), DeviceError> {
        // SAFETY: the camera is open.
        self.check("resetting the camera", unsafe {
            (self.api.camera_reset)(self.raw())
        })
    }

    /// Loads settings that the camera has stored.
    pub(super) fn load_memory(&self, channel: u32) -> Result<(), DeviceError> {
        // SAFETY: the camera is open.
        self.check("loading the factory settings", unsafe {
            (self.api.memory_load)(self.raw(), channel)
        })
    }

    /// Returns true if the camera can be switched off.
    pub(super) fn has_power_switch(&self) -> bool {
        // SAFETY: the camera is open.
        unsafe { self.camera.as_ref() }.can_switch_on_off != OFF
    }

    /// Returns the library's name of the bus.
    fn platform(&self) -> String {
        let mut name = std::ptr::null();
        // SAFETY: the camera is open, and the function writes the address of a constant text.
        let code = unsafe { (self.api.camera_get_platform_string)(self.raw(), &mut name) };
        // SAFETY: the text is a constant of the library.
        if code == 0 {
            unsafe { text(name) }
        } else {
            String::new()
        }
    }

    /// Returns the GUID of the camera.
    pub(super) fn guid(&self) -> u64 {
        // SAFETY: the camera is open.
        unsafe { self.camera.as_ref() }.guid
    }

    /// Returns make, model and GUID of the camera.
    pub(super) fn description(&self) -> CameraDescription {
        // SAFETY: the camera is open.
        let info = unsafe { self.camera.as_ref() };
        // SAFETY: the texts are those of the open camera.
        let (vendor, model) = unsafe { (text(info.vendor), text(info.model)) };
        CameraDescription {
            bus: if self.is_usb { Bus::Usb } else { Bus::Firewire },
            description: format!("{vendor} {model} ({:016X})", info.guid),
        }
    }

    /// Starts the transfer of frames.
    pub(super) fn start_capture(&mut self) -> Result<(), DeviceError> {
        if self.capturing {
            return Ok(());
        }
        // SAFETY: the camera is open.
        self.check("starting the capture", unsafe {
            (self.api.capture_setup)(self.raw(), BUFFER_COUNT, CAPTURE_DEFAULT)
        })?;
        self.capturing = true;
        Ok(())
    }

    /// Ends transmission and transfer of frames.
    pub(super) fn stop_capture(&mut self) -> Result<(), DeviceError> {
        self.end_transmission()?;
        if self.capturing && self.is_usb && !self.submit_requests() {
            return Err(DeviceError::Remote {
                peer: self.peer.clone(),
                step: "giving the buffers back".to_owned(),
                advice: "whether the camera is plugged in".to_owned(),
                source: None,
            });
        }
        self.end_capture()
    }

    fn end_transmission(&self) -> Result<(), DeviceError> {
        let set = self.api.video_set_transmission;
        self.set("ending the transmission", OFF, set)
    }

    fn end_capture(&mut self) -> Result<(), DeviceError> {
        if !self.capturing {
            return Ok(());
        }
        self.capturing = false;
        // SAFETY: the camera is open, and no frame of it is used any more.
        self.check("stopping the capture", unsafe {
            (self.api.capture_stop)(self.raw())
        })
    }

    /// Submits the requests for frames that were answered again; returns false if the camera takes none.
    ///
    /// The library closes the device and then frees its requests. Closing clears the handle of those that wait only; one that was
    /// answered would keep the address of a freed handle. libusb 1.0.26 does not read it; this is for other versions.
    fn submit_requests(&mut self) -> bool {
        for _ in 0..2 * BUFFER_COUNT {
            let (code, frame) = self.dequeue();
            match NonNull::new(frame) {
                None => return code == 0,
                Some(frame) if self.give_back(frame) != 0 => return false,
                Some(_) => {}
            }
        }
        true
    }

    /// Takes a frame from the library: its result, and the frame if there is one. A request that failed has both.
    fn dequeue(&mut self) -> (c_int, *mut VideoFrame) {
        let mut frame: *mut VideoFrame = std::ptr::null_mut();
        // SAFETY: the camera is open, and captures wherever this is called.
        let code = unsafe { (self.api.capture_dequeue)(self.raw(), POLICY_POLL, &mut frame) };
        (code, frame)
    }

    /// Gives a frame back to the library, which is not used after that. Frames are given back in the order in which they were taken: the
    /// library hands them out in this order.
    fn give_back(&mut self, frame: NonNull<VideoFrame>) -> c_int {
        // SAFETY: the frame is one that the library handed out.
        unsafe { (self.api.capture_enqueue)(self.raw(), frame.as_ptr()) }
    }

    /// Returns true if the camera is on no bus.
    fn is_gone(&self) -> bool {
        // SAFETY: it takes nothing.
        let Some(context) = NonNull::new(unsafe { (self.api.new)() }) else {
            return true;
        };
        let context = OpenContext(self.api, context);
        !guids(self.api, context.1).contains(&self.guid())
    }

    /// Returns the file that can be read when there is a frame, while frames are captured.
    pub(super) fn file(&self) -> Option<BorrowedFd<'_>> {
        if !self.capturing {
            return None;
        }
        // SAFETY: the camera is open.
        let file = unsafe { (self.api.capture_get_fileno)(self.raw()) };
        // SAFETY: the library keeps the file open until the capture is stopped, for which the camera is borrowed mutably.
        (file >= 0).then(|| unsafe { BorrowedFd::borrow_raw(file) })
    }

    /// Hands the newest frame to `use_frame`, if there is one, and gives it back to the library, with those before it. Does not wait.
    pub(super) fn take<T>(
        &mut self,
        use_frame: impl FnOnce(&FrameView<'_>) -> T,
    ) -> Result<Option<T>, DeviceError> {
        if !self.capturing {
            return Ok(None);
        }
        let mut newest = None;
        for _ in 0..BUFFER_COUNT {
            let (code, frame) = self.dequeue();
            let newer = NonNull::new(frame);
            if code != 0 {
                for frame in newest.into_iter().chain(newer) {
                    // A camera that is gone does not take it.
                    self.give_back(frame);
                }
                self.check("taking an image", code)?;
            }
            if newer.is_none() {
                break;
            }
            if let Some(older) = std::mem::replace(&mut newest, newer) {
                let code = self.give_back(older);
                self.check("giving a buffer back", code)?;
            }
        }
        let Some(pointer) = newest else {
            return Ok(None);
        };
        // SAFETY: the frame is the library's, and stays as it is until it is given back.
        let (frame, damaged) = unsafe {
            let damaged = (self.api.capture_is_frame_corrupt)(self.raw(), pointer.as_ptr());
            (pointer.as_ref(), damaged != 0)
        };
        // The capture was started only for buffers within the limit.
        let length = usize::try_from(frame.total_bytes).unwrap_or(0);
        let bytes = match frame.image.is_null() {
            true => &[],
            // SAFETY: the buffer of a frame has `total_bytes`, and the library writes to it only after it is given back.
            false => unsafe {
                std::slice::from_raw_parts(frame.image, length.min(MAX_BUFFER_BYTES))
            },
        };
        // The library leaves it uninitialised for older cameras in format 7.
        // SAFETY: the camera is open.
        let has_filter = unsafe { self.camera.as_ref() }.iidc_version >= IIDC_1_31;
        let used = use_frame(&FrameView {
            bytes,
            size: (frame.size[0], frame.size[1]),
            coding: frame.color_coding,
            filter: has_filter.then_some(frame.color_filter),
            depth: frame.data_depth,
            little_endian: frame.little_endian != 0,
            packet_bytes: frame.packet_size,
            damaged,
        });
        let code = self.give_back(pointer);
        self.check("giving a buffer back", code)?;
        Ok(Some(used))
    }
}

impl Drop for OpenedCamera {
    fn drop(&mut self) {
        let mut outcome = self.end_transmission();
        let mut is_gone = false;
        for attempt in 1..=STOP_ATTEMPTS {
            let Err(error) = &outcome else {
                break;
            };
            tracing::debug!("{}: {error}", self.peer);
            is_gone = self.is_gone();
            if is_gone || attempt == STOP_ATTEMPTS {
                break;
            }
            outcome = self.end_transmission();
        }
        if self.capturing && self.is_usb && (is_gone || !self.submit_requests()) {
            // All its requests for frames have failed. libusb 1.0.26 crashes when the library closes such a camera.
            let count = LEFT_BEHIND.fetch_add(1, Ordering::Relaxed) + 1;
            tracing::warn!(
                "{}: the camera is gone; about 8 file descriptors, {BUFFER_COUNT} buffers and a thread of libdc1394 stay behind, \
                 time {count} of at most {MAX_LEFT_BEHIND} until the program is restarted",
                self.peer
            );
            return;
        }
        if let Err(error) = self.end_capture() {
            // On IEEE 1394 the library keeps buffers and a file of a camera that is gone.
            tracing::debug!("{}: {error}", self.peer);
        }
        // SAFETY: camera and context are the library's, and are not used any more.
        unsafe {
            (self.api.camera_free)(self.raw());
            (self.api.free)(self.context.as_ptr());
        }
    }
}

/// Refuses to open a camera when too many lost ones have left objects of the library behind.
fn check_left_behind(count: usize, choice: IidcChoice) -> Result<(), DeviceError> {
    if count < MAX_LEFT_BEHIND {
        return Ok(());
    }
    Err(DeviceError::Remote {
        peer: choice.to_string(),
        step: "opening the camera".to_owned(),
        advice: "restarting the program".to_owned(),
        source: Some(
            format!(
                "objects of libdc1394 have stayed behind for {count} unplugged cameras, the maximum"
            )
            .into(),
        ),
    })
}

/// Returns the GUIDs of the cameras that are plugged in.
fn guids(api: &Functions, context: NonNull<Context>) -> Vec<u64> {
    let mut list: *mut CameraList = std::ptr::null_mut();
    // SAFETY: the context is the library's; it makes a list, which is freed below.
    unsafe {
        if (api.camera_enumerate)(context.as_ptr(), &mut list) != 0 || list.is_null() {
            return Vec::new();
        }
        let count = if (*list).ids.is_null() {
            0
        } else {
            (*list).count as usize
        };
        let ids = (0..count.min(MAX_CAMERAS)).map(|place| (*(*list).ids.add(place)).guid);
        let guids = ids.collect();
        (api.camera_free_list)(list);
        guids
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn too_many_lost_cameras_are_refused() {
        assert!(check_left_behind(MAX_LEFT_BEHIND - 1, IidcChoice::First).is_ok());
        let refused = check_left_behind(MAX_LEFT_BEHIND, IidcChoice::First).unwrap_err();
        let words = crate::error::chain(&refused);
        assert!(
            words.contains("restarting the program") && words.contains("16 unplugged"),
            "{words}"
        );
    }
}
