//! The control loops of the joints.

use crate::{Axes, AxisIndex, AxisInfo, DeviceError};

/// Gains, references and errors of the control loops (stock: `IPidControl`).
///
/// A joint has a loop for each [`PidKind`] it is available for; another kind is
/// [`DeviceError::NotSupported`].
pub trait PidControl: AxisInfo {
    /// The loops that a joint has (4.0: `getAvailablePids`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn available_pids(&self, axis: AxisIndex) -> Result<Vec<PidKind>, DeviceError>;

    /// The gains (`getPid(s)`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`], [`DeviceError::NotSupported`].
    fn pids(&self, kind: PidKind, axes: Axes<'_>) -> Result<Vec<Pid>, DeviceError>;

    /// Returns the meaning of the gains, in words for people (4.0: `getPidExtraInfo(s)`; 3.x has no message for it).
    ///
    /// Errors: as [`pids`](Self::pids).
    fn pid_info(&self, kind: PidKind, axes: Axes<'_>) -> Result<Vec<PidInfo>, DeviceError>;

    /// Sets the gains (`setPid(s)`).
    ///
    /// Errors: [`DeviceError::NotSupported`], [`DeviceError::NotFinite`], or an error of the selection; then none
    /// changes.
    fn set_pids(&self, kind: PidKind, axes: Axes<'_>, pids: &[Pid]) -> Result<(), DeviceError>;

    /// A number of each loop, in the unit of the loop (`getPidReference(s)`, `getPidErrorLimit(s)`, `getPidError(s)`,
    /// `getPidOutput(s)`, `getPidOffset`, `getPidFeedforward`).
    ///
    /// Errors: as [`pids`](Self::pids).
    fn pid_values(
        &self,
        kind: PidKind,
        value: PidValue,
        axes: Axes<'_>,
    ) -> Result<Vec<f64>, DeviceError>;

    /// Sets a number of each loop (`setPidReference(s)`, `setPidErrorLimit(s)`, `setPidOffset`, `setPidFeedforward`).
    ///
    /// Errors: as [`set_pids`](Self::set_pids); errors and outputs cannot be set.
    fn set_pid_values(
        &self,
        kind: PidKind,
        value: PidValue,
        axes: Axes<'_>,
        values: &[f64],
    ) -> Result<(), DeviceError>;

    /// Returns whether the loops are closed (`isPidEnabled`).
    ///
    /// Errors: as [`pids`](Self::pids).
    fn pids_enabled(&self, kind: PidKind, axes: Axes<'_>) -> Result<Vec<bool>, DeviceError>;

    /// Closes or opens the loops (`enablePid`, `disablePid`).
    ///
    /// Errors: as [`pids`](Self::pids).
    fn enable_pids(&self, kind: PidKind, axes: Axes<'_>, enabled: bool) -> Result<(), DeviceError>;

    /// Forgets the integrals of the loops (`resetPid`).
    ///
    /// Errors: as [`pids`](Self::pids).
    fn reset_pids(&self, kind: PidKind, axes: Axes<'_>) -> Result<(), DeviceError>;
}

/// The quantity that a loop controls (stock: `PidControlTypeEnum`).
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub enum PidKind {
    /// `[pos]`, in 4.0 `[pos1]`.
    Position,
    /// `[vel]`, in 4.0 `[vel1]`.
    Velocity,
    /// `[trq]`, in 4.0 `[trq1]`.
    Torque,
    /// `[cur]`, in 4.0 `[cur1]`.
    Current,
    /// Any other word, as received: the second and third loops of 4.0.
    Other(u32),
}

/// A number of a loop.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub enum PidValue {
    /// The reference.
    Reference,
    /// The maximum error.
    ErrorLimit,
    /// Reference minus measurement. Read only.
    Error,
    /// The output. Read only.
    Output,
    /// The offset of the output.
    Offset,
    /// The feedforward term of the output, set by the caller.
    Feedforward,
}

/// The gains of a loop, in its own units (stock: `Pid`).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pid {
    /// Proportional gain.
    pub kp: f64,
    /// Derivative gain.
    pub kd: f64,
    /// Integral gain.
    pub ki: f64,
    /// The largest integral.
    pub max_integral: f64,
    /// Scale of the output.
    pub scale: f64,
    /// The largest output.
    pub max_output: f64,
    /// Offset of the output.
    pub offset: f64,
    /// Friction overcome when moving up.
    pub stiction_up: f64,
    /// Friction overcome when moving down.
    pub stiction_down: f64,
    /// Gain of the feed-forward term.
    pub kff: f64,
}

/// Description of a loop and the units of its gains, in words for people (4.0: `PidExtraInfo`).
#[derive(Clone, Debug, Default, Eq, PartialEq)]
pub struct PidInfo {
    /// Description of the loop.
    pub description: String,
    /// The measured quantity.
    pub input: String,
    /// The output quantity.
    pub output: String,
    /// Units of the gains. Those of parameters that the loop does not have are empty.
    pub units: PidUnits,
}

/// The units of the gains of a [`Pid`], one for each (4.0: `PidUnits`).
#[derive(Clone, Debug, Default, Eq, PartialEq)]
pub struct PidUnits {
    /// Of the proportional gain.
    pub kp: String,
    /// Of the derivative gain.
    pub kd: String,
    /// Of the integral gain.
    pub ki: String,
    /// Of the largest integral.
    pub max_integral: String,
    /// Of the scale.
    pub scale: String,
    /// Of the largest output.
    pub max_output: String,
    /// Of the offset of the output.
    pub offset: String,
    /// Of the friction when moving up.
    pub stiction_up: String,
    /// Of the friction when moving down.
    pub stiction_down: String,
    /// Of the gain of the feed-forward term.
    pub kff: String,
}

impl PidUnits {
    /// Returns the units of a plain loop, from those of its input and of its output.
    ///
    /// Scale factors have no unit. Friction, offset and feed-forward, which not every loop has, are empty.
    pub fn plain(input: &str, output: &str) -> Self {
        let input = match input.contains('/') {
            true => format!("({input})"),
            false => input.to_owned(),
        };
        Self {
            kp: format!("{output}/{input}"),
            kd: format!("{output} s/{input}"),
            ki: format!("{output}/({input} s)"),
            max_integral: output.to_owned(),
            max_output: output.to_owned(),
            ..Self::default()
        }
    }
}

/// Describes the requests about control loops; the columns are explained in [`iface`](crate::iface).
#[doc(hidden)]
#[macro_export]
macro_rules! describe_pid_control {
    ($then:ident, [$($rest:ident)*] $($described:tt)*) => {
        $crate::describe_board! {
            @next $then, [$($rest)*] $($described)*
            pid_control: PidControl, "iPidControl", "control loops" {
                numbers {
                    /// The reference of a control loop.
                    PidReference { kind: PidKind }: "pid" ["ref" "" "refs"] ["getPidReference" "" "getPidReferences"]
                        => (by |pids, axes| pids.pid_values(kind, PidValue::Reference, axes));
                    /// The maximum error of a control loop.
                    PidErrorLimit { kind: PidKind }: "pid" ["lim" "" "lims"] ["getPidErrorLimit" "" "getPidErrorLimits"]
                        => (by |pids, axes| pids.pid_values(kind, PidValue::ErrorLimit, axes));
                    /// The error of a control loop.
                    PidError { kind: PidKind }: "pid" ["err" "" "errs"] ["getPidError" "" "getPidErrors"]
                        => (by |pids, axes| pids.pid_values(kind, PidValue::Error, axes));
                    /// The output of a control loop.
                    PidOutput { kind: PidKind }: "pid" ["out" "" "outs"] ["getPidOutput" "" "getPidOutputs"]
                        => (by |pids, axes| pids.pid_values(kind, PidValue::Output, axes));
                    /// The offset of the output of a control loop. 3.x can set it, not read it.
                    PidOffset { kind: PidKind }: "pid" ["" "" ""] ["getPidOffset" "" ""]
                        => (by |pids, axes| pids.pid_values(kind, PidValue::Offset, axes));
                    /// The feedforward term of a control loop.
                    PidFeedforward { kind: PidKind }: "pid" ["" "" ""] ["getPidFeedforward" "" ""]
                        => (by |pids, axes| pids.pid_values(kind, PidValue::Feedforward, axes));
                }
                settings {
                    /// The reference of a control loop.
                    PidReference { kind: PidKind }: "pid" ["ref" "" "refs"] ["setPidReference" "" "setPidReferences"]
                        => (by |pids, axes, values| pids.set_pid_values(kind, PidValue::Reference, axes, values));
                    /// The maximum error of a control loop.
                    PidErrorLimit { kind: PidKind }: "pid" ["lim" "" "lims"] ["setPidErrorLimit" "" "setPidErrorLimits"]
                        => (by |pids, axes, values| pids.set_pid_values(kind, PidValue::ErrorLimit, axes, values));
                    /// The offset of the output of a control loop.
                    PidOffset { kind: PidKind }: "pid" ["off" "" ""] ["setPidOffsetOne" "" ""]
                        => (by |pids, axes, values| pids.set_pid_values(kind, PidValue::Offset, axes, values));
                    /// The feedforward term of a control loop.
                    PidFeedforward { kind: PidKind }: "pid" ["" "" ""] ["setPidFeedforwardOne" "" ""]
                        => (by |pids, axes, values| pids.set_pid_values(kind, PidValue::Feedforward, axes, values));
                }
                actions {
                    /// Forget the integrals of loops.
                    ResetPids { kind: PidKind }: "pid" ["res" "" ""] ["resetPid" "" ""] => (by |pids, axes| pids.reset_pids(kind, axes));
                    /// Close loops.
                    EnablePids { kind: PidKind }: "pid" ["ena" "" ""] ["enablePid" "" ""]
                        => (by |pids, axes| pids.enable_pids(kind, axes, true));
                    /// Open loops.
                    DisablePids { kind: PidKind }: "pid" ["dis" "" ""] ["disablePid" "" ""]
                        => (by |pids, axes| pids.enable_pids(kind, axes, false));
                }
                queries {
                    /// Gains of control loops.
                    Pids { kind: PidKind } -> Vec<Pid>: "pid" ["pid" "" "pids"] ["getPid" "" "getPids"]
                        => (by |pids, axes| pids.pids(kind, axes));
                    /// True if a loop is closed.
                    PidEnabled { kind: PidKind } -> bool: "pid" ["ena" "" ""] ["isPidEnabled" "" ""]
                        => (by |pids, axes| Ok(pids.pids_enabled(kind, axes)?.into_iter().all(|one| one)));
                    /// Meaning of the numbers of a loop (4.0).
                    PidInfo { kind: PidKind } -> Vec<PidInfo>: "" ["" "" ""] ["getPidExtraInfo" "" "getPidExtraInfos"]
                        => (by |pids, axes| pids.pid_info(kind, axes));
                    /// The loops of an axis (4.0).
                    AvailablePids -> Choices<PidKind>: "" ["" "" ""] ["getAvailablePids" "" ""]
                        => (of_axis |pids, axis| pids.available_pids(axis).map(Choices));
                }
                commands {
                    /// Gains of control loops.
                    Pids(kind: PidKind, selection: Selection, pids: Vec<Pid>): "pid" ["pid" "" "pids"] ["setPid" "" "setPids"]
                        => (by |loops| loops.set_pids(*kind, selection.axes(), pids));
                }
            }
        }
    };
}
