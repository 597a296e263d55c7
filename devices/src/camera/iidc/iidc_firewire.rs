//! The controls of a camera on IEEE 1394.

use super::IidcCamera;
use crate::{DeviceError, FirewireControls, Window, WindowLimits};

/// Implements the trait by the methods of `Session`, each executed by the thread of the camera.
macro_rules! controls {
    ($($name:ident = $method:ident($($argument:ident: $kind:ty)?) -> $result:ty;)*) => {
        /// Cameras on USB have the registers of the bus, but no broadcast.
        impl FirewireControls for IidcCamera {
            $(fn $name(&self $(, $argument: $kind)?) -> Result<$result, DeviceError> {
                self.run(move |session| session.$method($($argument)?))
            })*
        }
    };
}

controls! {
    video_modes = modes() -> u32;
    video_mode = mode() -> u32;
    set_video_mode = set_mode(mode: u32) -> ();
    rates = rates() -> u32;
    rate = rate() -> u32;
    set_rate = set_rate(rate: u32) -> ();
    iso_speed = iso_speed() -> u32;
    set_iso_speed = set_iso_speed(speed: u32) -> ();
    color_codings = codings(video_mode: u32) -> u32;
    color_coding = coding() -> u32;
    set_color_coding = set_coding(coding: u32) -> ();
    window_limits = window_limits() -> WindowLimits;
    window = window() -> Window;
    set_window = set_window(window: Window) -> ();
    is_1394b = is_1394b() -> bool;
    set_1394b = set_1394b(is_1394b: bool) -> ();
    is_transmitting = is_transmitting() -> bool;
    set_transmission = set_transmission(on: bool) -> ();
    set_broadcast = set_broadcast(on: bool) -> ();
    set_defaults = set_defaults() -> ();
    reset = reset() -> ();
    set_power = set_power(on: bool) -> ();
    set_capture = set_capture(on: bool) -> ();
    bytes_per_packet = packet_bytes() -> u32;
    set_bytes_per_packet = set_packet_bytes(bytes: u32) -> ();
}
