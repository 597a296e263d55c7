//! The controls of cameras on IEEE 1394.

use yarp_devices::{DeviceError, FirewireControls, Window, WindowLimits};
use yarp_wire::Bottle;

use super::RemoteFrameGrabber;
use crate::frame_grabber::messages::{Answer, Firewire, Request};

type Outcome<T> = Result<T, DeviceError>;

impl RemoteFrameGrabber {
    fn wire(&self, what: Firewire, values: &[u32]) -> Outcome<Answer> {
        // Numbers beyond the signed range are sent as they are: the masks are, too.
        let values = values.iter().map(|value| *value as i32).collect();
        self.ask(Request::Firewire(what, values))
    }

    fn wire_order(&self, what: Firewire, values: &[u32]) -> Outcome<()> {
        self.wire(what, values).map(drop)
    }

    fn wire_switch(&self, what: Firewire, on: bool) -> Outcome<()> {
        self.wire_order(what, &[u32::from(on)])
    }

    fn wire_number(&self, what: Firewire, values: &[u32]) -> Outcome<u32> {
        match self.wire(what, values)? {
            Answer::Integer(number) => Ok(number as u32),
            _ => Err(self.link.unreadable(&Bottle::new())),
        }
    }

    fn wire_flag(&self, what: Firewire) -> Outcome<bool> {
        match self.wire(what, &[])? {
            Answer::Flag(flag) => Ok(flag),
            _ => Err(self.link.unreadable(&Bottle::new())),
        }
    }

    fn wire_numbers<const COUNT: usize>(&self, what: Firewire) -> Outcome<[u32; COUNT]> {
        let numbers = match self.wire(what, &[])? {
            Answer::Integers(numbers) => <[i32; COUNT]>::try_from(numbers).ok(),
            _ => None,
        };
        let numbers = numbers.ok_or_else(|| self.link.unreadable(&Bottle::new()))?;
        Ok(numbers.map(|number| number as u32))
    }
}

impl FirewireControls for RemoteFrameGrabber {
    fn video_modes(&self) -> Outcome<u32> {
        self.wire_number(Firewire::VideoModes, &[])
    }

    fn video_mode(&self) -> Outcome<u32> {
        self.wire_number(Firewire::VideoMode, &[])
    }

    fn set_video_mode(&self, mode: u32) -> Outcome<()> {
        self.wire_order(Firewire::SetVideoMode, &[mode])
    }

    fn rates(&self) -> Outcome<u32> {
        self.wire_number(Firewire::Rates, &[])
    }

    fn rate(&self) -> Outcome<u32> {
        self.wire_number(Firewire::Rate, &[])
    }

    fn set_rate(&self, rate: u32) -> Outcome<()> {
        self.wire_order(Firewire::SetRate, &[rate])
    }

    fn iso_speed(&self) -> Outcome<u32> {
        self.wire_number(Firewire::IsoSpeed, &[])
    }

    fn set_iso_speed(&self, speed: u32) -> Outcome<()> {
        self.wire_order(Firewire::SetIsoSpeed, &[speed])
    }

    fn color_codings(&self, video_mode: u32) -> Outcome<u32> {
        self.wire_number(Firewire::ColorCodings, &[video_mode])
    }

    fn color_coding(&self) -> Outcome<u32> {
        self.wire_number(Firewire::ColorCoding, &[])
    }

    fn set_color_coding(&self, coding: u32) -> Outcome<()> {
        self.wire_order(Firewire::SetColorCoding, &[coding])
    }

    fn window_limits(&self) -> Outcome<WindowLimits> {
        let [width, height, width_step, height_step, x_step, y_step] =
            self.wire_numbers(Firewire::WindowLimits)?;
        Ok(WindowLimits {
            width,
            height,
            width_step,
            height_step,
            x_step,
            y_step,
        })
    }

    fn window(&self) -> Outcome<Window> {
        let [width, height, x, y] = self.wire_numbers(Firewire::Window)?;
        Ok(Window {
            width,
            height,
            x,
            y,
        })
    }

    fn set_window(&self, window: Window) -> Outcome<()> {
        let numbers = [window.width, window.height, window.x, window.y];
        self.wire_order(Firewire::SetWindow, &numbers)
    }

    fn is_1394b(&self) -> Outcome<bool> {
        self.wire_flag(Firewire::Is1394b)
    }

    fn set_1394b(&self, is_1394b: bool) -> Outcome<()> {
        self.wire_switch(Firewire::Set1394b, is_1394b)
    }

    fn is_transmitting(&self) -> Outcome<bool> {
        self.wire_flag(Firewire::IsTransmitting)
    }

    fn set_transmission(&self, on: bool) -> Outcome<()> {
        self.wire_switch(Firewire::SetTransmission, on)
    }

    fn set_broadcast(&self, on: bool) -> Outcome<()> {
        self.wire_switch(Firewire::SetBroadcast, on)
    }

    fn set_defaults(&self) -> Outcome<()> {
        self.wire_order(Firewire::SetDefaults, &[])
    }

    fn reset(&self) -> Outcome<()> {
        self.wire_order(Firewire::Reset, &[])
    }

    fn set_power(&self, on: bool) -> Outcome<()> {
        self.wire_switch(Firewire::SetPower, on)
    }

    fn set_capture(&self, on: bool) -> Outcome<()> {
        self.wire_switch(Firewire::SetCapture, on)
    }

    fn bytes_per_packet(&self) -> Outcome<u32> {
        self.wire_number(Firewire::BytesPerPacket, &[])
    }

    fn set_bytes_per_packet(&self, bytes: u32) -> Outcome<()> {
        self.wire_order(Firewire::SetBytesPerPacket, &[bytes])
    }
}
