//! Controls of cameras on IEEE 1394, beside the features.

use crate::DeviceError;

/// A part of the sensor, in pixels.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct Window {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Distance from the left of the sensor.
    pub x: u32,
    /// Distance from the top.
    pub y: u32,
}

/// Limits of windows, in pixels.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct WindowLimits {
    /// The widest: the width of the sensor.
    pub width: u32,
    /// The highest.
    pub height: u32,
    /// Widths are multiples of this.
    pub width_step: u32,
    /// Heights are multiples of this.
    pub height_step: u32,
    /// Beginnings from the left are multiples of this.
    pub x_step: u32,
    /// Beginnings from the top are multiples of this.
    pub y_step: u32,
}

/// Controls of cameras on IEEE 1394, beside the features (stock: `IFrameGrabberControlsDC1394`).
///
/// Modes, rates, speeds and codings are numbers: places in the lists of the IIDC specification, as libdc1394 counts
/// them, from 0. A mask has the bit `1 << NUMBER` for each that there is. Source of that: iCub's driver of such
/// cameras, `FirewireCameraDC1394-DR2_2.cpp` in `icub-main`; stock's interface does not specify it.
///
/// | list | numbers |
/// | --- | --- |
/// | video modes | 0: 160 x 120, 1: 320 x 240, 2 to 6: 640 x 480, and so on; 24 to 31: format 7, with a selectable window |
/// | rates | 0: 1.875 images a second, and each twice the previous one |
/// | bus speeds | 0: 100 Mbit/s, and each twice the previous one |
/// | colour codings | 0: grey, 1 to 3: YUV 4:1:1, 4:2:2, 4:4:4, 4: RGB, and so on |
///
/// Errors: [`DeviceError::Unsuitable`] for values that the camera does not have, which change nothing;
/// [`DeviceError::NotSupported`] for settings that it cannot change at all.
pub trait FirewireControls: Send + Sync {
    /// Returns the supported video modes, a mask (`getVideoModeMaskDC1394`).
    fn video_modes(&self) -> Result<u32, DeviceError>;

    /// The video mode (`getVideoModeDC1394`).
    fn video_mode(&self) -> Result<u32, DeviceError>;

    /// Sets the video mode, and so the size of the images (`setVideoModeDC1394`).
    fn set_video_mode(&self, mode: u32) -> Result<(), DeviceError>;

    /// The rates there are, a mask (`getFPSMaskDC1394`).
    fn rates(&self) -> Result<u32, DeviceError>;

    /// The rate (`getFPSDC1394`).
    fn rate(&self) -> Result<u32, DeviceError>;

    /// Sets how many images a second there are (`setFPSDC1394`).
    fn set_rate(&self, rate: u32) -> Result<(), DeviceError>;

    /// The speed of the bus (`getISOSpeedDC1394`).
    fn iso_speed(&self) -> Result<u32, DeviceError>;

    /// Sets the speed of the bus (`setISOSpeedDC1394`).
    fn set_iso_speed(&self, speed: u32) -> Result<(), DeviceError>;

    /// The colour codings that a video mode has, a mask (`getColorCodingMaskDC1394`).
    fn color_codings(&self, video_mode: u32) -> Result<u32, DeviceError>;

    /// The colour coding on the bus (`getColorCodingDC1394`).
    fn color_coding(&self) -> Result<u32, DeviceError>;

    /// Sets the colour coding on the bus (`setColorCodingDC1394`).
    fn set_color_coding(&self, coding: u32) -> Result<(), DeviceError>;

    /// Returns the limits of windows of the sensor (`getFormat7MaxWindowDC1394`).
    fn window_limits(&self) -> Result<WindowLimits, DeviceError>;

    /// The part of the sensor that images show (`getFormat7WindowDC1394`).
    fn window(&self) -> Result<Window, DeviceError>;

    /// Sets the part of the sensor that images show; in format 7 only (`setFormat7WindowDC1394`).
    fn set_window(&self, window: Window) -> Result<(), DeviceError>;

    /// Returns whether the bus runs in IEEE 1394b mode (`getOperationModeDC1394`).
    fn is_1394b(&self) -> Result<bool, DeviceError>;

    /// Sets whether the bus is driven as IEEE 1394b has it (`setOperationModeDC1394`).
    fn set_1394b(&self, is_1394b: bool) -> Result<(), DeviceError>;

    /// Returns whether images are sent (`getTransmissionDC1394`).
    fn is_transmitting(&self) -> Result<bool, DeviceError>;

    /// Starts or stops sending images (`setTransmissionDC1394`).
    fn set_transmission(&self, on: bool) -> Result<(), DeviceError>;

    /// Sets whether commands to this camera are sent to all cameras on its bus (`setBroadcastDC1394`).
    fn set_broadcast(&self, on: bool) -> Result<(), DeviceError>;

    /// Restores the initial settings (`setDefaultsDC1394`).
    fn set_defaults(&self) -> Result<(), DeviceError>;

    /// Starts the camera anew (`setResetDC1394`).
    fn reset(&self) -> Result<(), DeviceError>;

    /// Switches the camera on or off (`setPowerDC1394`).
    fn set_power(&self, on: bool) -> Result<(), DeviceError>;

    /// Starts or stops taking images (`setCaptureDC1394`).
    fn set_capture(&self, on: bool) -> Result<(), DeviceError>;

    /// Returns the bytes of an image in each packet on the bus (`getBytesPerPacketDC1394`).
    fn bytes_per_packet(&self) -> Result<u32, DeviceError>;

    /// Sets how much of an image is in a packet on the bus, bytes (`setBytesPerPacketDC1394`).
    fn set_bytes_per_packet(&self, bytes: u32) -> Result<(), DeviceError>;
}
