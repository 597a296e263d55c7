//! Executes the requests of cameras on IEEE 1394 on the device.

use yarp_devices::{DeviceError, FirewireControls, Window};

use crate::frame_grabber::messages::{Answer, Firewire};

/// Executes a query or a command. `values` are as many as the request has; a value below 0 is a number that no camera
/// has.
pub(super) fn perform(
    device: &dyn FirewireControls,
    what: Firewire,
    values: &[i32],
) -> Result<Answer, DeviceError> {
    use Firewire as F;
    let number = |place: usize| values.get(place).map_or(0, |value| *value as u32);
    let is_on = number(0) != 0;
    let one = |number: u32| Answer::Integer(number as i32);
    let done = |()| Answer::Done;
    match what {
        F::VideoModes => device.video_modes().map(one),
        F::VideoMode => device.video_mode().map(one),
        F::SetVideoMode => device.set_video_mode(number(0)).map(done),
        F::Rates => device.rates().map(one),
        F::Rate => device.rate().map(one),
        F::SetRate => device.set_rate(number(0)).map(done),
        F::IsoSpeed => device.iso_speed().map(one),
        F::SetIsoSpeed => device.set_iso_speed(number(0)).map(done),
        F::ColorCodings => device.color_codings(number(0)).map(one),
        F::ColorCoding => device.color_coding().map(one),
        F::SetColorCoding => device.set_color_coding(number(0)).map(done),
        F::WindowLimits => device.window_limits().map(|most| {
            let sides = [most.width, most.height, most.width_step, most.height_step];
            let places = [most.x_step, most.y_step];
            integers(sides.into_iter().chain(places))
        }),
        F::Window => device
            .window()
            .map(|now| integers([now.width, now.height, now.x, now.y])),
        F::SetWindow => {
            let window = Window {
                width: number(0),
                height: number(1),
                x: number(2),
                y: number(3),
            };
            device.set_window(window).map(done)
        }
        F::Set1394b => device.set_1394b(is_on).map(done),
        F::Is1394b => device.is_1394b().map(Answer::Flag),
        F::SetTransmission => device.set_transmission(is_on).map(done),
        F::IsTransmitting => device.is_transmitting().map(Answer::Flag),
        F::SetBroadcast => device.set_broadcast(is_on).map(done),
        F::SetDefaults => device.set_defaults().map(done),
        F::Reset => device.reset().map(done),
        F::SetPower => device.set_power(is_on).map(done),
        F::SetCapture => device.set_capture(is_on).map(done),
        F::BytesPerPacket => device.bytes_per_packet().map(one),
        F::SetBytesPerPacket => device.set_bytes_per_packet(number(0)).map(done),
    }
}

fn integers(numbers: impl IntoIterator<Item = u32>) -> Answer {
    Answer::Integers(numbers.into_iter().map(|number| number as i32).collect())
}
