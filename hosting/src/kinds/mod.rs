//! The table of devices.
//!
//! A device is one line in [`ALL`]: its name, the names that stock has for it, what it is, the wrapper that `yarp dev`
//! serves it with, and how it is opened.

mod calibrator;
mod fake_motion_control;
mod remote;
mod server;
mod simulated;

use yarp_ports::Network;
use yarp_wire::settings::{Origin, Parameters};

use crate::{Future, HostError, Hosted};

/// What a device is opened with.
#[derive(Clone, Copy)]
pub struct Opening<'a> {
    /// Where its ports are opened.
    pub network: &'a Network,
    /// Its parameters; whatever it has no use for is reported.
    pub parameters: &'a Parameters,
}

type Outcome = Result<Box<dyn Hosted>, HostError>;
type Open = for<'a> fn(Opening<'a>) -> Future<'a, Outcome>;

/// A kind of device.
pub struct Kind {
    /// Its name.
    pub name: &'static str,
    /// Other names of it.
    pub aliases: &'static [&'static str],
    /// What it is, on one line.
    pub about: &'static str,
    /// The kind that serves it on the network if nothing else is said.
    pub wrapper: Option<&'static str>,
    open: Open,
}

const SERVER: &str = "controlBoard_nws_yarp";

/// The device that is two; see [`open`](crate::open).
pub const BUNDLER: &str = "deviceBundler";

/// Every kind of device.
#[rustfmt::skip]
pub const ALL: &[Kind] = &[
    kind("controlBoard_nws_yarp", &[], "serves joints on ports; name, period in seconds", None, |opening| Box::pin(server::open(opening))),
    kind("controlboardwrapper2", &[], "the same with stock's old parameters; name, period in milliseconds", None, |opening| Box::pin(server::open_old(opening))),
    kind("boardCalibrator", &[], "has boards calibrate and park themselves, in actions of a robot", None, |opening| Box::pin(calibrator::open(opening))),
    kind("dynamicWam", &[], "a simulated WAM arm with masses, friction and control", Some(SERVER), |opening| Box::pin(simulated::dynamic(opening))),
    kind("fakeMotionControl", &[], "simulated joints of any number; GENERAL::Joints, GENERAL::AxisName, GENERAL::AxisType, LIMITS::Min, LIMITS::Max", Some(SERVER), |opening| Box::pin(fake_motion_control::open(opening))),
    kind("remote_controlboard", &["controlBoard_nwc_yarp"], "joints served by another program; remote, local, carrier, timeout", None, |opening| Box::pin(remote::open(opening))),
    kind("simulatedWam", &[], "a simulated WAM arm that moves exactly as it is told", Some(SERVER), |opening| Box::pin(simulated::ideal(opening))),
];

const fn kind(
    name: &'static str,
    aliases: &'static [&'static str],
    about: &'static str,
    wrapper: Option<&'static str>,
    open: Open,
) -> Kind {
    Kind {
        name,
        aliases,
        about,
        wrapper,
        open,
    }
}

impl Kind {
    /// Opens a device of this kind.
    pub fn open<'a>(&self, opening: Opening<'a>) -> Future<'a, Outcome> {
        (self.open)(opening)
    }

    fn names(&self) -> impl Iterator<Item = &'static str> {
        std::iter::once(self.name).chain(self.aliases.iter().copied())
    }
}

/// The kind called `name`, which stands in the parameter `asked`.
pub fn find<'a>(name: &str, parameters: &Parameters, asked: &str) -> Result<&'a Kind, HostError> {
    let called = |kind: &&Kind| kind.names().any(|known| known == name);
    ALL.iter().find(called).ok_or_else(|| {
        let same = |known: &&str| known.eq_ignore_ascii_case(name);
        let close = ALL.iter().flat_map(Kind::names).find(same);
        let origin = parameters.settings().origin(asked);
        let origin = origin.filter(|origin| **origin != Origin::Program);
        HostError::UnknownKind {
            origin: origin.unwrap_or(parameters.origin()).clone(),
            device: parameters.device().to_owned(),
            kind: name.to_owned(),
            hint: close.map_or(String::new(), |close| format!(", but there is {close}")),
        }
    })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn every_name_means_one_kind() {
        let names: Vec<_> = ALL.iter().flat_map(Kind::names).collect();
        let distinct: BTreeSet<_> = names.iter().collect();
        assert_eq!(distinct.len(), names.len());
        assert!(!names.contains(&BUNDLER));
        for wrapper in ALL.iter().filter_map(|kind| kind.wrapper) {
            assert!(names.contains(&wrapper));
        }
    }
}
