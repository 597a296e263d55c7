//! Control modes of the joints.

use std::fmt;

use crate::{Axes, AxisIndex, AxisInfo, DeviceError};

/// Reads and sets the kind of command that each joint follows (stock: `IControlMode`).
pub trait ControlMode: AxisInfo {
    /// The modes a joint can be set to (4.0: `getAvailableControlModes`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn available_control_modes(&self, axis: AxisIndex) -> Result<Vec<Mode>, DeviceError>;

    /// Fills `out` with the mode of each selected axis, without allocating (`getControlMode(s)`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`], [`DeviceError::WrongCount`] when `out` does not have one slot per axis;
    /// for a device behind a network also [`DeviceError::NoDataYet`] and [`DeviceError::Stale`].
    fn read_control_modes(&self, axes: Axes<'_>, out: &mut [Mode]) -> Result<(), DeviceError>;

    /// The mode of each selected axis, in a new vector.
    ///
    /// Errors: as [`read_control_modes`](Self::read_control_modes).
    fn control_modes(&self, axes: Axes<'_>) -> Result<Vec<Mode>, DeviceError> {
        axes.check(self.axes())?;
        let mut out = vec![Mode::UNKNOWN; axes.len(self.axes())];
        self.read_control_modes(axes, &mut out)?;
        Ok(out)
    }

    /// Sets the mode of each selected axis (`setControlMode(s)`).
    ///
    /// A joint that changes its mode comes to rest first, smoothly; one already in that mode continues.
    ///
    /// Errors: [`DeviceError::NoSuchMode`], or an error of the selection; then no mode changes.
    fn set_control_modes(&self, axes: Axes<'_>, modes: &[Mode]) -> Result<(), DeviceError>;
}

/// Control mode of a joint.
///
/// On the wire a mode is a 32-bit word of up to four characters, the first in the lowest byte. A word we do not
/// know is kept in [`Mode::Unknown`], to be shown and forwarded.
///
/// ```
/// use yarp_devices::Mode;
///
/// assert_eq!(u32::from(Mode::Position), 7565168); // [pos]
/// assert_eq!(Mode::from(7565168), Mode::Position);
/// assert_eq!(Mode::from(0x6f706d69).to_string(), "unknown [impo]");
/// ```
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[non_exhaustive]
pub enum Mode {
    /// `[idl]`: accepts no commands, the drive is off or holds.
    Idle,
    /// `[torq]`: follows torques.
    Torque,
    /// `[pos]`: moves from point to point on its own path.
    Position,
    /// `[posd]`: follows streamed positions of the caller.
    PositionDirect,
    /// `[vel]`: follows velocities.
    Velocity,
    /// `[veld]`: follows streamed velocities of the caller (4.0).
    VelocityDirect,
    /// `[icur]`: follows motor currents.
    Current,
    /// `[ipwm]`: follows motor duty cycles.
    Pwm,
    /// `[mix]`: follows positions and velocities together.
    Mixed,
    /// `[fidl]`: goes idle, also out of a hardware fault. Can be set, is never reported.
    ForceIdle,
    /// `[hwfa]`: the hardware reports a fault. Reported only.
    HardwareFault,
    /// `[cal]`: is being calibrated. Reported only.
    Calibrating,
    /// `[cald]`: has just been calibrated. Reported only.
    CalibrationDone,
    /// `[cfgn]`: is not configured. Reported only.
    NotConfigured,
    /// `[cfgy]`: is configured and not yet calibrated. Reported only.
    Configured,
    /// Any other word, as received; among them `[unkw]`, see [`Mode::UNKNOWN`].
    Unknown(u32),
}

/// Every mode with a name: the word on the wire and the name for people.
///
/// Source: `ControlBoardVocabs.h` of YARP 3.5 to 4.0.
const NAMED: [(Mode, u32, &str); 15] = [
    (Mode::Idle, code(b"idl"), "idle"),
    (Mode::Torque, code(b"torq"), "torque"),
    (Mode::Position, code(b"pos"), "position"),
    (Mode::PositionDirect, code(b"posd"), "position direct"),
    (Mode::Velocity, code(b"vel"), "velocity"),
    (Mode::VelocityDirect, code(b"veld"), "velocity direct"),
    (Mode::Current, code(b"icur"), "current"),
    (Mode::Pwm, code(b"ipwm"), "pwm"),
    (Mode::Mixed, code(b"mix"), "mixed"),
    (Mode::ForceIdle, code(b"fidl"), "force idle"),
    (Mode::HardwareFault, code(b"hwfa"), "hardware fault"),
    (Mode::Calibrating, code(b"cal"), "calibrating"),
    (Mode::CalibrationDone, code(b"cald"), "calibration done"),
    (Mode::NotConfigured, code(b"cfgn"), "not configured"),
    (Mode::Configured, code(b"cfgy"), "configured"),
];

/// Up to four characters in one word, the first in the lowest byte.
const fn code(word: &[u8]) -> u32 {
    let mut bytes = [0; 4];
    let mut place = 0;
    while place < word.len() {
        bytes[place] = word[place];
        place += 1;
    }
    u32::from_le_bytes(bytes)
}

impl Mode {
    /// `[unkw]`: the device itself does not know.
    pub const UNKNOWN: Mode = Mode::Unknown(code(b"unkw"));
}

impl From<u32> for Mode {
    fn from(code: u32) -> Self {
        NAMED
            .iter()
            .find(|named| named.1 == code)
            .map_or(Mode::Unknown(code), |named| named.0)
    }
}

impl From<Mode> for u32 {
    fn from(mode: Mode) -> Self {
        match mode {
            Mode::Unknown(code) => code,
            named => row(named).1,
        }
    }
}

/// Formats the mode as in `position`; an unknown word as in `unknown [impo]`.
impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Mode::Unknown(code) => {
                let bytes = code.to_le_bytes();
                let end = bytes.iter().position(|&byte| byte == 0).unwrap_or(4);
                let (word, rest) = bytes.split_at(end);
                let readable = !word.is_empty()
                    && word.iter().all(u8::is_ascii_graphic)
                    && rest.iter().all(|&byte| byte == 0);
                if readable {
                    write!(f, "unknown [{}]", word.escape_ascii())
                } else {
                    write!(f, "unknown {code:#010x}")
                }
            }
            named => f.write_str(row(*named).2),
        }
    }
}

fn row(mode: Mode) -> (Mode, u32, &'static str) {
    *NAMED
        .iter()
        .find(|named| named.0 == mode)
        .expect("every mode but `Unknown` has a row, which a test checks")
}

/// Describes the requests about control modes; the columns are explained in [`iface`](crate::iface).
#[doc(hidden)]
#[macro_export]
macro_rules! describe_control_mode {
    ($then:ident, [$($rest:ident)*] $($described:tt)*) => {
        $crate::describe_board! {
            @next $then, [$($rest)*] $($described)*
            control_mode: ControlMode, "iControlMode", "control modes" {
                numbers {}
                settings {}
                actions {
                    /// All joints to torque mode (3.x).
                    TorqueMode: "torq" ["" "" "trqd"] ["" "" ""]
                        => (by |modes, axes| modes.set_control_modes(axes, &vec![Mode::Torque; modes.axes()]));
                }
                queries {
                    /// Control modes (3.x; in 4.0 they are in the state only).
                    ControlModes -> Vec<Mode>: "icmd" ["cmod" "cmog" "cmds"] ["" "" ""] => (by |modes, axes| modes.control_modes(axes));
                    /// The modes an axis can be set to (4.0).
                    AvailableModes -> Choices<Mode>: "" ["" "" ""] ["getAvailableControlModes" "" ""]
                        => (of_axis |modes, axis| modes.available_control_modes(axis).map(Choices));
                }
                commands {
                    /// Control modes.
                    ControlModes(selection: Selection, modes: Vec<Mode>): "icmd" ["cmod" "cmog" "cmds"]
                        ["setControlModeOne" "setControlModeGroup" "setControlModeAll"]
                        => (by |control| control.set_control_modes(selection.axes(), modes));
                }
            }
        }
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_match_the_recorded_numbers() {
        let check = |mode: Mode, code: u32, name: &str| {
            assert_eq!(u32::from(mode), code);
            assert_eq!(Mode::from(code), mode);
            assert_eq!(mode.to_string(), name);
        };
        check(Mode::Position, 7565168, "position");
        check(Mode::Velocity, 7103862, "velocity");
        check(Mode::Idle, 7103593, "idle");
        check(Mode::Torque, 1903325044, "torque");
        check(Mode::PositionDirect, 1685286768, "position direct");
        check(Mode::VelocityDirect, 1684825462, "velocity direct");
        check(Mode::Current, 1920295785, "current");
        check(Mode::Pwm, 1836544105, "pwm");
        check(Mode::Mixed, 7891309, "mixed");
        check(Mode::HardwareFault, 1634105192, "hardware fault");
        check(Mode::ForceIdle, 1818519910, "force idle");
        check(Mode::Calibrating, code(b"cal"), "calibrating");
        check(Mode::CalibrationDone, code(b"cald"), "calibration done");
        check(Mode::NotConfigured, code(b"cfgn"), "not configured");
        check(Mode::Configured, code(b"cfgy"), "configured");
        check(Mode::UNKNOWN, code(b"unkw"), "unknown [unkw]");
        check(
            Mode::Unknown(code(b"imve")),
            code(b"imve"),
            "unknown [imve]",
        );
        check(Mode::Unknown(0), 0, "unknown 0x00000000");
        check(
            Mode::Unknown(0x0100_6161),
            0x0100_6161,
            "unknown 0x01006161",
        );
    }
}
