//! Monitors: what happens to the messages of a connection on their way.
//!
//! A carrier string asks for them: `tcp+send.portmonitor+type.dll+file.NAME` for what the writer
//! sends, `recv.` for what the reader takes in. Here they are built in, under the names of stock's
//! plugins where stock has one. The admin requests `[atch]` and `[dtch]` put one monitor on
//! everything that a port writes or reads.
//!
//! | `file.` | stock's | what it does | parameters |
//! | --- | --- | --- | --- |
//! | `bottle_compression_zlib` | yes | compresses at the writer, expands at the reader | |
//! | `depthimage_compression_zlib` | yes | the same for images of `dec` pixels | |
//! | `depthimage_to_mono`, `depthimage_to_rgb` | yes | depths of 0.2 to 10 m as grey or colour | |
//! | `depthimage` | in older ones | the older name of `depthimage_to_mono` | |
//! | `image_rotation` | from 3.8 | turns and mirrors images | `options_rotate`, `rotate_cw`; `options_flip`, `flip_none` |
//! | `soundfilter_resample` | from 3.6 | selects a channel, amplifies, resamples | `channel`, `gain_percent`, `frequency` |
//! | `throttleDown` | yes | lets one message through per period | `period_ms`, 1000 |
//! | `simulated_network_delay` | yes | holds each message back | `delay_ms`, 0 |
//! | `stats_monitor`, `statistics` | by name | counts; `[get]` tells | |
//! | `image_compression_jpeg` | no | images as JPEG between two of our ports | |
//! | `image_to_mono` | no | images in grey | |
//!
//! | modifier | side | what it does | parameters |
//! | --- | --- | --- | --- |
//! | `portmonitor` | both | the monitors above | `type`, `file`; more with `type1`, `file1` and so on |
//! | `bayer` | `recv` | raw images of cameras in colour ([`bayer`]) | `order`, `method`, `size` |
//! | `priority` | `recv` | which of several writers is heard ([`priority`]) | `tc`, `tr`, `st`, `bs`, `ex`, `virtual` |
//!
//! Options after `send.` are for the writer and those after `recv.` for the reader, as in 4.0; if
//! they name no `file`, all options of the carrier string count, as in 3.x; so do `type` and `context` of an end
//! that has none.
//!
//! A monitor runs on the task of its connection and holds no lock while it works; a message of
//! more than a few kilobytes is worked on where tasks may block, and so is one that is expanded. What messages and pictures
//! are expanded to counts against a budget of the process ([`limits`](crate::port_limits)). Where there are roles, who asks for
//! `recv.portmonitor` needs `administer` on the reader, except for monitors of the owner's own. A connection without monitors
//! pays nothing for them.
//!
//! Source: the sources of 3.5.0 and 4.0.0; the names marked `yes` were checked against stock's
//! plugins of 4.0.0 in a port of 3.5.0.

mod bayer;
mod delay;
#[cfg(feature = "zlib")]
mod depth_compression;
mod depth_image;
mod grey_image;
#[cfg(feature = "jpeg")]
mod image_compression;
mod image_rotation;
mod message_statistics;
mod monitor_chain;
mod monitor_task;
mod priority_arbiter;
mod sound_resample;
mod throttle;
#[cfg(feature = "zlib")]
mod zlib;

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use yarp_wire::message::Payload;
use yarp_wire::{Bottle, Value};

pub(super) use monitor_chain::{Attached, Chain, ChainBuilder, Outgoing};
pub(super) use monitor_task::run as stage;
pub(super) use priority_arbiter::Arbiter;

/// A monitor inspects the messages of a connection, changes them, or stops them.
///
/// Called for each message in order; [`get`](Self::get) and [`set`](Self::set) may be called
/// concurrently. Must not block: use [`Passing::delay`] instead.
pub trait Monitor: Send + Sync {
    /// Returns the message to pass on in place of `message`; `None` stops it.
    fn update(&self, message: Passing) -> Option<Passing>;

    /// Returns the reply to pass on in place of `reply`, at the port that sent the request.
    fn reply(&self, reply: Payload) -> Payload {
        reply
    }

    /// Sets parameters, given as lists of a name and a value; unknown ones are passed over.
    fn set(&self, _parameters: &Bottle) {}

    /// Returns the parameters, as lists of a name and a value.
    fn get(&self) -> Bottle {
        Bottle::new()
    }
}

/// A message on its way.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Passing {
    /// The content.
    pub payload: Payload,
    /// Delay of this message, which also delays the following ones.
    pub delay: Duration,
}

impl Passing {
    /// Creates a message that is not held back.
    pub fn new(payload: Payload) -> Self {
        let delay = Duration::ZERO;
        Self { payload, delay }
    }

    /// The same with another content.
    pub fn with(mut self, payload: Payload) -> Self {
        self.payload = payload;
        self
    }
}

/// The end of a connection that a monitor is at.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum MonitorSide {
    /// The writer's.
    Send,
    /// The reader's.
    Receive,
}

impl MonitorSide {
    /// Returns the key in carrier strings.
    pub(super) const fn key(self) -> &'static str {
        match self {
            Self::Send => "send",
            Self::Receive => "recv",
        }
    }
}

/// The parameters for creating a monitor.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct MonitorSetup {
    /// The end of the connection.
    pub side: MonitorSide,
    /// The writer; empty for a monitor on all that a port reads.
    pub from: String,
    /// The reader; empty for a monitor on all that a port writes.
    pub to: String,
    /// The options in the carrier string or the request, as lists of a name and a value.
    pub options: Bottle,
    arbiter: Arc<Arbiter>,
}

impl MonitorSetup {
    /// Creates the parameters for a connection from one port to another.
    pub fn new(side: MonitorSide, from: &str, to: &str, options: Bottle) -> Self {
        Self {
            side,
            from: from.to_owned(),
            to: to.to_owned(),
            options,
            arbiter: Arc::default(),
        }
    }

    /// Returns the value of an option.
    pub fn option(&self, name: &str) -> Option<&Value> {
        self.options.find_group(name)?.get(1)
    }

    /// Returns the number that an option is, if it is given.
    pub fn number(&self, name: &str) -> Result<Option<f64>, String> {
        match self.option(name) {
            None => Ok(None),
            Some(value) => match value.as_f64() {
                Some(number) if number.is_finite() => Ok(Some(number)),
                _ => Err(format!("{name} is {value}, expected a number")),
            },
        }
    }
}

/// Creates a monitor for a connection, or returns the reason for refusing its options.
pub type MonitorFactory =
    Arc<dyn Fn(&MonitorSetup) -> Result<Arc<dyn Monitor>, String> + Send + Sync>;

/// A monitor of an owner's own.
#[derive(Clone)]
pub(super) struct OwnMonitor {
    pub(super) name: String,
    pub(super) factory: MonitorFactory,
}

/// The reason why a connection does not get the requested modifier or monitor.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MonitorError {
    /// There is no such modifier here.
    #[error("there is no modifier {name:?} for `{side}`; known are {known}")]
    NoModifier {
        /// The requested name.
        name: String,
        /// `send` or `recv`.
        side: &'static str,
        /// The known names.
        known: String,
    },
    /// A modifier where a carrier belongs.
    #[error("{name} is no carrier; a carrier such as `tcp+recv.{name}` may have it")]
    NoCarrier {
        /// The modifier.
        name: String,
    },
    /// Monitors are built in.
    #[error("there are no monitors of type {name:?} here; known is `type.dll`, with {known}")]
    NoType {
        /// The requested type.
        name: String,
        /// The monitors there are.
        known: String,
    },
    /// There is no such monitor here.
    #[error("there is no monitor {name:?}; known are {known}")]
    NoMonitor {
        /// The requested name.
        name: String,
        /// The known names.
        known: String,
    },
    /// The peer may not have monitors here.
    #[error("{text}")]
    NotAllowed {
        /// Missing right and its holder.
        text: String,
    },
    /// The options do not do.
    #[error("{name} cannot be used: {reason}")]
    Options {
        /// The modifier or monitor.
        name: String,
        /// The reason.
        reason: String,
    },
}

type Made = Result<Arc<dyn Monitor>, String>;

/// A name, and what makes the monitor.
type Entry = (&'static str, fn(&MonitorSetup) -> Made);

/// The monitors of this build: the one table.
const MONITORS: &[Entry] = &[
    #[cfg(feature = "zlib")]
    ("bottle_compression_zlib", zlib::BottleZlib::make),
    #[cfg(feature = "zlib")]
    (
        "depthimage_compression_zlib",
        depth_compression::DepthZlib::make,
    ),
    ("depthimage", depth_image::ToMono::make),
    ("depthimage_to_mono", depth_image::ToMono::make),
    ("depthimage_to_rgb", depth_image::ToRgb::make),
    #[cfg(feature = "jpeg")]
    ("image_compression_jpeg", image_compression::Jpeg::make),
    ("image_rotation", image_rotation::Rotation::make),
    ("image_to_mono", grey_image::ToMono::make),
    ("simulated_network_delay", delay::Delay::make),
    ("soundfilter_resample", sound_resample::Resample::make),
    ("statistics", message_statistics::Statistics::make),
    ("stats_monitor", message_statistics::Statistics::make),
    ("throttleDown", throttle::Throttle::make),
];

/// The modifiers of readers beside `portmonitor`: the one table.
const RECEIVERS: [Entry; 2] = [
    ("bayer", bayer::Bayer::make),
    ("priority", priority_arbiter::Priority::make),
];

/// The modifier that stands for the monitors.
const PORTMONITOR: &str = "portmonitor";

impl fmt::Debug for dyn Monitor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Monitor")
    }
}

/// Returns a monitor, or modifier of readers, that is built in; connections make their own.
pub fn built_in(name: &str, setup: &MonitorSetup) -> Result<Arc<dyn Monitor>, MonitorError> {
    let receivers = match setup.side {
        MonitorSide::Send => &RECEIVERS[..0],
        MonitorSide::Receive => &RECEIVERS[..],
    };
    let mut all = MONITORS.iter().chain(receivers);
    let Some((name, make)) = all.find(|(known, _)| *known == name) else {
        return Err(MonitorError::NoMonitor {
            name: name.to_owned(),
            known: built_in_names().collect::<Vec<_>>().join(", "),
        });
    };
    make(setup).map_err(|reason| MonitorError::Options {
        name: (*name).to_owned(),
        reason,
    })
}

/// Returns the names of the monitors that are built in.
pub fn built_in_names() -> impl Iterator<Item = &'static str> {
    MONITORS.iter().map(|(name, _)| *name)
}

/// Returns the names of the modifiers of connections: `portmonitor` and those that readers may have.
pub fn modifier_names() -> impl Iterator<Item = &'static str> {
    std::iter::once(PORTMONITOR).chain(RECEIVERS.iter().map(|(name, _)| *name))
}

/// Returns whether a name in place of a carrier is a modifier.
pub(super) fn is_modifier(name: &str) -> bool {
    modifier_names().any(|known| known == name)
}

/// Returns a message that holds a bottle.
#[cfg(any(feature = "jpeg", feature = "zlib"))]
pub(super) fn of_bottle(bottle: &Bottle) -> Payload {
    let wire_version = yarp_wire::WireVersion::default();
    let form = yarp_wire::message::Form::Binary(wire_version);
    Payload::new(bottle.encode(wire_version), form)
}

/// `(NAME VALUE)`
fn parameter(name: &str, value: impl Into<Value>) -> Value {
    Bottle::from_iter([name.into(), value.into()]).into()
}

/// Returns the number that a parameter is to be set to.
fn wanted(parameters: &Bottle, name: &str) -> Option<f64> {
    let value = parameters.find_group(name)?.get(1)?.as_f64()?;
    value.is_finite().then_some(value)
}
