//! Errors of devices.

use std::error::Error;
use std::io;
use std::time::Duration;

use crate::{AxisIndex, Mode};

/// Reasons why a device did not execute a command or did not answer a query.
///
/// A refused command leaves every joint unchanged. Joints are counted from 0, as on the wire.
///
/// ```
/// use yarp_devices::DeviceError;
///
/// let error = DeviceError::OutOfRange {
///     joint: 3.into(),
///     quantity: "position",
///     asked: 200.0,
///     min: -51.5,
///     max: 179.0,
///     unit: "deg",
/// };
/// assert_eq!(error.to_string(), "joint 3 asked for position 200 deg, allowed -51.5 to 179 deg");
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DeviceError {
    /// A value lies outside its limits.
    #[error("joint {joint} asked for {quantity} {asked} {unit}, allowed {min} to {max} {unit}")]
    OutOfRange {
        /// The joint.
        joint: AxisIndex,
        /// The quantity, for instance `position`.
        quantity: &'static str,
        /// The value refused.
        asked: f64,
        /// The smallest value allowed.
        min: f64,
        /// The largest value allowed.
        max: f64,
        /// The unit of the three numbers.
        unit: &'static str,
    },
    /// A value is NaN or infinite.
    #[error("joint {joint} asked for {quantity} {asked}, expected a finite number")]
    NotFinite {
        /// The joint.
        joint: AxisIndex,
        /// The quantity, for instance `position`.
        quantity: &'static str,
        /// The value refused.
        asked: f64,
    },
    /// The device has no such axis.
    #[error("no joint {asked}: the device has {axes}, counted from 0")]
    NoSuchAxis {
        /// The axis.
        asked: AxisIndex,
        /// The number of axes.
        axes: usize,
    },
    /// One command names a joint twice.
    #[error("joint {joint} is named twice in one command")]
    RepeatedAxis {
        /// The joint named twice.
        joint: AxisIndex,
    },
    /// The number of values is not the number of selected axes.
    #[error("expected {expected} {what}, got {got}")]
    WrongCount {
        /// The kind of values, for instance `positions`.
        what: &'static str,
        /// The number of selected axes.
        expected: usize,
        /// The number of values.
        got: usize,
    },
    /// The joint is in a control mode that does not take this command.
    #[error("joint {joint} is in {mode} mode, {command} needs {needed} mode")]
    WrongMode {
        /// The joint.
        joint: AxisIndex,
        /// The command refused, for instance `position move`.
        command: &'static str,
        /// The mode it is in.
        mode: Mode,
        /// The mode it must be in.
        needed: Mode,
    },
    /// The device does not have this control mode, or it cannot be commanded.
    #[error("joint {joint} cannot be set to {mode} mode")]
    NoSuchMode {
        /// The joint.
        joint: AxisIndex,
        /// The mode refused.
        mode: Mode,
    },
    /// Something holds the joint.
    #[error("joint {joint} is held by {by}; {remedy}")]
    Held {
        /// The joint.
        joint: AxisIndex,
        /// The cause that holds it, for instance `its brake`.
        by: &'static str,
        /// Advice on what to try next.
        remedy: &'static str,
    },
    /// The joint moves, and this may only be done at rest.
    #[error("joint {joint} is moving, stop it to {what}")]
    Moving {
        /// The joint.
        joint: AxisIndex,
        /// The action that needs it at rest, for instance `change its limits`.
        what: &'static str,
    },
    /// The device cannot do this at all.
    #[error("{what} is not supported by this device")]
    NotSupported {
        /// The call or feature, in words.
        what: String,
    },
    /// The newest state is too old to be trusted.
    #[error("{what} is {age:?} old, the maximum is {limit:?}")]
    Stale {
        /// The kind of state, for instance `encoder reading`.
        what: &'static str,
        /// The age of the newest one.
        age: Duration,
        /// The maximum age.
        limit: Duration,
    },
    /// No state has come yet.
    #[error("no {what} received yet")]
    NoDataYet {
        /// The kind of state, for instance `encoder reading`.
        what: &'static str,
    },
    /// The device at the other end of a connection refused without a reason.
    #[error("{peer} refused {step}; try {advice}")]
    Refused {
        /// The peer that refused, for instance the name of a port.
        peer: String,
        /// The request.
        step: String,
        /// Advice on what to try next.
        advice: String,
    },
    /// The device at the other end of a connection could not be reached or understood.
    #[error("{step} with {peer} failed; try {advice}")]
    Remote {
        /// The peer that should have answered, for instance the name of a port.
        peer: String,
        /// The step that failed.
        step: String,
        /// Advice on what to try next.
        advice: String,
        /// The failure underneath, if there is one.
        #[source]
        source: Option<Box<dyn Error + Send + Sync>>,
    },
    /// A guard in front of the device refuses the command.
    #[error("the {guard} of the guard forbid it: {source}")]
    Guarded {
        /// The guard, for instance `joint limits`.
        guard: &'static str,
        /// The requested and the allowed value.
        source: Box<DeviceError>,
    },
    /// Of several devices in one board, the one of this joint lacks the interface.
    #[error("joint {joint} ({name}) belongs to {part}, which has no {what}")]
    PartLacks {
        /// The joint, as the board counts.
        joint: AxisIndex,
        /// Its name.
        name: String,
        /// Its device.
        part: String,
        /// The interface, in words.
        what: &'static str,
    },
    /// One of several devices in one board refused, or did not answer.
    #[error("{part} did not do it: {}{}", chain(why.as_ref()), what_of_the_others(done, undone))]
    PartRefused {
        /// The device.
        part: String,
        /// The refusal; joints are numbered as the board counts.
        why: Box<DeviceError>,
        /// The devices that did their share.
        done: Vec<String>,
        /// The other devices that did not.
        undone: Vec<String>,
    },
    /// A value that belongs to no joint is not one the device takes.
    #[error("{what} {asked} is refused, expected {expected}")]
    Unsuitable {
        /// The kind of value, for instance `resolution`.
        what: &'static str,
        /// The value refused.
        asked: String,
        /// The values that are allowed.
        expected: String,
    },
    /// A file or folder could not be used.
    #[error("cannot {step} {path}")]
    File {
        /// The operation, for instance `read an image from`.
        step: &'static str,
        /// Its path.
        path: String,
        /// The cause.
        #[source]
        source: Box<dyn Error + Send + Sync>,
    },
    /// A resource of the machine, such as a thread or a bus, was not available.
    #[error("could not start {what}")]
    Start {
        /// The resource.
        what: &'static str,
        /// The cause.
        #[source]
        source: io::Error,
    },
}

impl DeviceError {
    /// The same error with other numbers for the joints.
    pub(crate) fn renumbered(mut self, number: &dyn Fn(AxisIndex) -> AxisIndex) -> Self {
        match &mut self {
            Self::OutOfRange { joint, .. }
            | Self::NotFinite { joint, .. }
            | Self::RepeatedAxis { joint }
            | Self::WrongMode { joint, .. }
            | Self::NoSuchMode { joint, .. }
            | Self::Held { joint, .. }
            | Self::Moving { joint, .. }
            | Self::PartLacks { joint, .. } => *joint = number(*joint),
            Self::Guarded { source: inner, .. } | Self::PartRefused { why: inner, .. } => {
                let error = Self::NoDataYet { what: "error" };
                **inner = std::mem::replace(&mut **inner, error).renumbered(number);
            }
            _ => {}
        }
        self
    }
}

/// Returns an error and its sources, on one line.
pub(crate) fn chain(error: &dyn Error) -> String {
    match error.source() {
        Some(source) => format!("{error}: {}", chain(source)),
        None => error.to_string(),
    }
}

/// Describes on one line which parts of a command were executed.
fn what_of_the_others(done: &[String], undone: &[String]) -> String {
    match (done, undone) {
        ([], []) => String::new(),
        (done, []) => format!("; done by {}", done.join(", ")),
        ([], undone) => format!("; not done by {} either", undone.join(", ")),
        (done, undone) => {
            let (done, undone) = (done.join(", "), undone.join(", "));
            format!("; done by {done}, not done by {undone} either")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_name_the_joint_the_value_and_the_limit() {
        let check = |error: DeviceError, expected: &str| assert_eq!(error.to_string(), expected);
        check(
            DeviceError::WrongMode {
                joint: 2.into(),
                command: "position move",
                mode: Mode::Velocity,
                needed: Mode::Position,
            },
            "joint 2 is in velocity mode, position move needs position mode",
        );
        check(
            DeviceError::NotFinite {
                joint: 0.into(),
                quantity: "velocity",
                asked: f64::NAN,
            },
            "joint 0 asked for velocity NaN, expected a finite number",
        );
        check(
            DeviceError::NoSuchMode {
                joint: 1.into(),
                mode: Mode::Torque,
            },
            "joint 1 cannot be set to torque mode",
        );
        check(
            DeviceError::Moving {
                joint: 1.into(),
                what: "change its limits",
            },
            "joint 1 is moving, stop it to change its limits",
        );
        check(
            DeviceError::Remote {
                peer: "/wam/rpc:i".into(),
                step: "asking for the number of axes".into(),
                advice: "whether the server runs".into(),
                source: None,
            },
            "asking for the number of axes with /wam/rpc:i failed; try whether the server runs",
        );
    }
}
