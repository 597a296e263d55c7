//! Requests to a control board, in either wire version.
//!
//! `vocab_requests` encodes them for 3.x, `thrift_calls` for 4.0.

use yarp_devices::{
    Axes, AxisIndex, CalibrationParameters, Impedance, Interaction, Limits, Mode,
    MotorTorqueParameters, Pid, PidKind, VariableValue,
};
use yarp_wire::Vocab32;

use super::axis_selection::{Forms, Functions, Selection, Words};
use super::quantity::{Quantity, Setting, Spelling};
use super::vocabulary as word;

/// A request to a control board.
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    /// Usage for people (3.x: `help more`, 4.0: `help`).
    Help,
    /// The version of the protocol (3.x: `[get] [prot]`, 4.0: `getRemoteProtocolVersion`).
    ProtocolVersion,
    /// The supported interfaces (4.0).
    Interfaces,
    /// A query.
    Get(Get),
    /// A command.
    Set(Set),
}

/// A query.
#[derive(Clone, Debug, PartialEq)]
pub enum Get {
    /// A number for each joint.
    Values(Quantity, Selection),
    /// Anything else about joints. Queries of the whole board use [`Selection::All`].
    About(Query, Selection),
    /// The value of a variable.
    Variable(String),
}

/// Queries other than for one number per joint.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Query {
    /// Number of axes.
    Axes,
    /// Name of an axis.
    Name,
    /// Kind of an axis.
    Type,
    /// True if the joints are at rest.
    MotionDone,
    /// Smallest and largest.
    Range(Range),
    /// Control modes (3.x; in 4.0 they are in the state only).
    ControlModes,
    /// The modes an axis can be set to (4.0).
    AvailableModes,
    /// Interaction modes.
    Interactions,
    /// Positions and when they were measured (4.0).
    TimedPositions,
    /// Positions of motors and when they were measured (4.0).
    TimedMotorPositions,
    /// Number of motors.
    Motors,
    /// Number of motor encoders.
    MotorEncoders,
    /// States of amplifiers.
    AmplifierStatus,
    /// Stiffness and damping of an axis.
    Impedance,
    /// Ranges of stiffness and damping.
    ImpedanceLimits,
    /// Motor parameters of the torque loop.
    MotorParameters,
    /// Gains of control loops.
    Pids(PidKind),
    /// True if a loop is closed.
    PidEnabled(PidKind),
    /// Meaning of the numbers of a loop (4.0).
    PidInfo(PidKind),
    /// The loops of an axis (4.0).
    AvailablePids,
    /// True if an axis is calibrated.
    CalibrationDone,
    /// True if there is a calibrator.
    CalibratorPresent,
    /// The names of the variables.
    Variables,
    /// The last fault of an axis.
    Fault,
    /// True if an axis is braked (4.0).
    Braked,
    /// True if its brake is applied automatically (4.0).
    AutoBrake,
}

/// Quantities with a minimum and a maximum.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Range {
    /// Positions.
    Position,
    /// Velocities.
    Velocity,
    /// Torques.
    Torque,
    /// Currents.
    Current,
}

/// A command. Values are degrees or metres, per second, per second squared.
#[derive(Clone, Debug, PartialEq)]
pub enum Set {
    /// A number for each joint.
    Values(Setting, Selection, Vec<f64>),
    /// Something without values. Commands to the whole board use [`Selection::All`].
    Act(Action, Selection),
    /// Position or velocity limits of an axis.
    Limits(Range, AxisIndex, Limits),
    /// Control modes.
    ControlModes(Selection, Vec<Mode>),
    /// Interaction modes.
    Interactions(Selection, Vec<Interaction>),
    /// Gains of control loops.
    Pids(PidKind, Selection, Vec<Pid>),
    /// Stiffness and damping of an axis.
    Impedance(AxisIndex, Impedance),
    /// Motor parameters of the torque loop, and the number of them that are sent: up to 3.6 the first four.
    MotorParameters(AxisIndex, MotorTorqueParameters, usize),
    /// Start to calibrate an axis.
    CalibrateAxis(AxisIndex, u32, [f64; 3]),
    /// Calibration parameters of an axis.
    CalibrationParameters(AxisIndex, CalibrationParameters),
    /// The value of a variable.
    Variable(String, Vec<VariableValue>),
    /// The brake of an axis (4.0).
    ManualBrake(AxisIndex, bool),
    /// Automatic braking (4.0).
    AutoBrake(AxisIndex, bool),
}

/// A command without values.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Action {
    /// Come to rest.
    Stop,
    /// Call the present positions 0.
    ResetEncoders,
    /// Call the present positions of the motors 0.
    ResetMotorEncoders,
    /// Switch amplifiers on.
    EnableAmplifiers,
    /// Switch amplifiers off.
    DisableAmplifiers,
    /// Forget the integrals of loops.
    ResetPids(PidKind),
    /// Close loops.
    EnablePids(PidKind),
    /// Open loops.
    DisablePids(PidKind),
    /// All joints to torque mode (3.x).
    TorqueMode,
    /// Calibrate by the calibrator.
    Calibrate,
    /// Go home by the calibrator.
    Home,
    /// Park by the calibrator.
    Park,
    /// End a calibration by the calibrator.
    QuitCalibration,
    /// End parking by the calibrator.
    QuitPark,
    /// Calibrate by the board.
    CalibrateRobot,
    /// Park by the board.
    ParkRobot,
    /// End a calibration by the board.
    AbortCalibration,
    /// End parking by the board.
    AbortPark,
}

/// Reasons why a message is not a request.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Malformed {
    /// Fewer than two items: stock 3.x does not even look at it.
    #[error("expected two items or more")]
    TooShort,
    /// A word that is none of the protocol, or not in this place.
    #[error("unknown word [{0}]")]
    UnknownWord(Vocab32),
    /// Values are missing, too many, or of another kind.
    #[error("wrong number or kind of values for [{0}]")]
    Values(Vocab32),
    /// A function that is none of the protocol.
    #[error("unknown function {0}")]
    UnknownFunction(String),
    /// Arguments are missing, too many, or of another kind.
    #[error("wrong number or kind of arguments for {0}")]
    Arguments(String),
}

impl Set {
    /// Returns the axes that it addresses; all of them for requests of the whole board.
    pub fn axes(&self) -> Axes<'_> {
        match self {
            Self::Values(_, selection, _)
            | Self::Act(_, selection)
            | Self::ControlModes(selection, _)
            | Self::Interactions(selection, _)
            | Self::Pids(_, selection, _) => selection.axes(),
            Self::Limits(_, axis, _)
            | Self::Impedance(axis, _)
            | Self::MotorParameters(axis, ..)
            | Self::CalibrateAxis(axis, ..)
            | Self::CalibrationParameters(axis, _)
            | Self::ManualBrake(axis, _)
            | Self::AutoBrake(axis, _) => Axes::One(*axis),
            Self::Variable(..) => Axes::All,
        }
    }
}

impl Query {
    /// Every query; those of control loops for positions, in the place of all kinds.
    pub(super) const ALL: [Self; 29] = {
        use PidKind::Position;
        [
            Self::Axes,
            Self::Name,
            Self::Type,
            Self::MotionDone,
            Self::Range(Range::Position),
            Self::Range(Range::Velocity),
            Self::Range(Range::Torque),
            Self::Range(Range::Current),
            Self::ControlModes,
            Self::AvailableModes,
            Self::Interactions,
            Self::TimedPositions,
            Self::TimedMotorPositions,
            Self::Motors,
            Self::MotorEncoders,
            Self::AmplifierStatus,
            Self::Impedance,
            Self::ImpedanceLimits,
            Self::MotorParameters,
            Self::Pids(Position),
            Self::PidEnabled(Position),
            Self::PidInfo(Position),
            Self::AvailablePids,
            Self::CalibrationDone,
            Self::CalibratorPresent,
            Self::Variables,
            Self::Fault,
            Self::Braked,
            Self::AutoBrake,
        ]
    };

    /// Returns the spelling of the query.
    pub(crate) fn spelling(self) -> Spelling {
        use Spelling as S;
        let one = Words::only_one;
        let whole = Words::only_all;
        let one_call = Functions::only_one;
        let whole_call = Functions::only_all;
        match self {
            Self::Axes => S::plain(whole(word::AXES), whole_call("getAxes")),
            Self::Name => S::plain(one(word::NAME), one_call("getAxisName")),
            Self::Type => S::plain(one(word::TYPE), one_call("getJointType")),
            Self::MotionDone => S::plain(
                Words::three(word::DONE, word::DONE_GROUP, word::DONES),
                Functions::three(
                    "checkMotionDoneOne",
                    "checkMotionDoneGroup",
                    "checkMotionDoneAll",
                ),
            ),
            Self::Range(Range::Position) => {
                S::plain(one(word::POSITION_LIMITS), one_call("getPosLimits"))
            }
            Self::Range(Range::Velocity) => {
                S::plain(one(word::VELOCITY_LIMITS), one_call("getVelLimits"))
            }
            Self::Range(Range::Torque) => S::of(
                word::TORQUE_INTERFACE,
                Words::two(word::RANGE, word::RANGES),
                Functions::two("getTorqueRangeOne", "getTorqueRangeAll"),
            ),
            Self::Range(Range::Current) => S::of(
                word::CURRENT_INTERFACE,
                Words::two(word::RANGE, word::RANGES),
                Functions::two("getCurrentRangeOne", "getCurrentRangeAll"),
            ),
            Self::ControlModes => S::of(word::CONTROL_MODE_INTERFACE, MODES, Forms::NONE),
            Self::AvailableModes => S::plain(Forms::NONE, one_call("getAvailableControlModes")),
            Self::Interactions => S::of(
                word::INTERACTION_MODE_INTERFACE,
                INTERACTIONS,
                Functions::three(
                    "getInteractionModeOne",
                    "getInteractionModesGroup",
                    "getInteractionModesAll",
                ),
            ),
            Self::TimedPositions => S::plain(
                Forms::NONE,
                Functions::two("getEncoderTimedOne", "getEncoderTimedAll"),
            ),
            Self::TimedMotorPositions => S::plain(
                Forms::NONE,
                Functions::two("getMotorEncoderTimedOne", "getMotorEncodersTimedAll"),
            ),
            Self::Motors => S::plain(whole(word::MOTORS), whole_call("getNumberOfMotors")),
            Self::MotorEncoders => S::plain(
                whole(word::MOTOR_ENCODER_COUNT),
                whole_call("getNumberOfMotorEncoders"),
            ),
            Self::AmplifierStatus => S::plain(
                Words::two(word::AMPLIFIER_STATUS, word::AMPLIFIER_STATUSES),
                Functions::two("getAmpStatusOne", "getAmpStatusAll"),
            ),
            Self::Impedance => S::of(
                word::IMPEDANCE_INTERFACE,
                one(word::IMPEDANCE),
                one_call("getImpedance"),
            ),
            Self::ImpedanceLimits => S::of(
                word::IMPEDANCE_INTERFACE,
                one(word::POSITION_LIMITS),
                one_call("getCurrentImpedanceLimit"),
            ),
            Self::MotorParameters => S::of(
                word::TORQUE_INTERFACE,
                one(word::MOTOR_PARAMETERS),
                one_call("getMotorTorqueParams"),
            ),
            Self::Pids(_) => S::of(
                word::PID_INTERFACE,
                Words::two(word::PID, word::PIDS),
                Functions::two("getPid", "getPids"),
            ),
            Self::PidEnabled(_) => S::of(
                word::PID_INTERFACE,
                one(word::ENABLE),
                one_call("isPidEnabled"),
            ),
            Self::PidInfo(_) => S::plain(
                Forms::NONE,
                Functions::two("getPidExtraInfo", "getPidExtraInfos"),
            ),
            Self::AvailablePids => S::plain(Forms::NONE, one_call("getAvailablePids")),
            Self::CalibrationDone => S::plain(Forms::NONE, one_call("calibrationDone")),
            Self::CalibratorPresent => S::of(
                word::REMOTE_CALIBRATOR_INTERFACE,
                whole(word::IS_CALIBRATOR),
                whole_call("isCalibratorDevicePresent"),
            ),
            Self::Variables => S::of(
                word::REMOTE_VARIABLES_INTERFACE,
                whole(word::VARIABLES),
                whole_call("getRemoteVariablesList"),
            ),
            Self::Fault => S::of(
                word::FAULT_INTERFACE,
                one(word::FAULT),
                one_call("getLastJointFault"),
            ),
            Self::Braked => S::plain(Forms::NONE, one_call("isJointBraked")),
            Self::AutoBrake => S::plain(Forms::NONE, one_call("getAutoBrakeEnabled")),
        }
    }

    /// The kind of control loop it is about.
    pub(super) fn kind(self) -> Option<PidKind> {
        match self {
            Self::Pids(kind) | Self::PidEnabled(kind) | Self::PidInfo(kind) => Some(kind),
            _ => None,
        }
    }

    /// The same of another kind of control loop.
    pub(super) fn of_kind(self, other: PidKind) -> Self {
        match self {
            Self::Pids(_) => Self::Pids(other),
            Self::PidEnabled(_) => Self::PidEnabled(other),
            Self::PidInfo(_) => Self::PidInfo(other),
            plain => plain,
        }
    }
}

/// The words behind the interface of control modes.
pub(super) const MODES: Words = Words::three(
    word::CONTROL_MODE,
    word::CONTROL_MODE_GROUP,
    word::CONTROL_MODES,
);
/// The words behind the interface of interaction modes.
pub(super) const INTERACTIONS: Words = Words::three(
    word::INTERACTION,
    word::INTERACTION_GROUP,
    word::INTERACTIONS,
);

impl Action {
    /// Every action; those on control loops for positions, in the place of all kinds.
    pub(super) const ALL: [Self; 18] = {
        use PidKind::Position;
        [
            Self::Stop,
            Self::ResetEncoders,
            Self::ResetMotorEncoders,
            Self::EnableAmplifiers,
            Self::DisableAmplifiers,
            Self::ResetPids(Position),
            Self::EnablePids(Position),
            Self::DisablePids(Position),
            Self::TorqueMode,
            Self::Calibrate,
            Self::Home,
            Self::Park,
            Self::QuitCalibration,
            Self::QuitPark,
            Self::CalibrateRobot,
            Self::ParkRobot,
            Self::AbortCalibration,
            Self::AbortPark,
        ]
    };

    /// Returns the spelling of the command. The words for the board's own calibration are in the first place of a
    /// message.
    pub(crate) fn spelling(self) -> Spelling {
        use Spelling as S;
        let loops = |word, function| {
            S::of(
                word::PID_INTERFACE,
                Words::only_one(word),
                Functions::only_one(function),
            )
        };
        let calibrator =
            |words, functions| S::of(word::REMOTE_CALIBRATOR_INTERFACE, words, functions);
        let board = |function| S::plain(Forms::NONE, Functions::only_all(function));
        match self {
            Self::Stop => S::plain(
                Words::three(word::STOP, word::STOP_GROUP, word::STOPS),
                Functions::three("stopOne", "stopGroup", "stopAll"),
            ),
            Self::ResetEncoders => S::plain(
                Words::two(word::RESET_ENCODER, word::RESET_ENCODERS),
                Functions::two("resetEncoderOne", "resetEncoderAll"),
            ),
            Self::ResetMotorEncoders => S::plain(
                Words::two(word::RESET_MOTOR_ENCODER, word::RESET_MOTOR_ENCODERS),
                Functions::two("resetMotorEncoder", "resetMotorEncoders"),
            ),
            Self::EnableAmplifiers => S::plain(
                Words::only_one(word::ENABLE_AMPLIFIER),
                Functions::only_one("enableAmp"),
            ),
            Self::DisableAmplifiers => S::plain(
                Words::only_one(word::DISABLE_AMPLIFIER),
                Functions::only_one("disableAmp"),
            ),
            Self::ResetPids(_) => loops(word::RESET, "resetPid"),
            Self::EnablePids(_) => loops(word::ENABLE, "enablePid"),
            Self::DisablePids(_) => loops(word::DISABLE, "disablePid"),
            Self::TorqueMode => S::of(
                word::TORQUE_INTERFACE,
                Words::only_all(word::ALL_TORQUE),
                Forms::NONE,
            ),
            Self::Calibrate => calibrator(
                Words::two(word::CALIBRATE, word::CALIBRATE_ALL),
                Functions::two("calibrateSingleJoint", "calibrateWholePart"),
            ),
            Self::Home => calibrator(
                Words::two(word::HOME, word::HOME_ALL),
                Functions::two("homingSingleJoint", "homingWholePart"),
            ),
            Self::Park => calibrator(
                Words::two(word::PARK_JOINT, word::PARK_ALL),
                Functions::two("parkSingleJoint", "parkWholePart"),
            ),
            Self::QuitCalibration => calibrator(
                Words::only_all(word::QUIT_CALIBRATION),
                Functions::only_all("quitCalibrate"),
            ),
            Self::QuitPark => calibrator(
                Words::only_all(word::QUIT_PARK),
                Functions::only_all("quitPark"),
            ),
            Self::CalibrateRobot => board("calibrateRobot"),
            Self::ParkRobot => board("park"),
            Self::AbortCalibration => board("abortCalibration"),
            Self::AbortPark => board("abortPark"),
        }
    }

    /// The kind of control loop it is about.
    pub(super) fn kind(self) -> Option<PidKind> {
        match self {
            Self::ResetPids(kind) | Self::EnablePids(kind) | Self::DisablePids(kind) => Some(kind),
            _ => None,
        }
    }

    /// The same on another kind of control loop.
    pub(super) fn of_kind(self, other: PidKind) -> Self {
        match self {
            Self::ResetPids(_) => Self::ResetPids(other),
            Self::EnablePids(_) => Self::EnablePids(other),
            Self::DisablePids(_) => Self::DisablePids(other),
            plain => plain,
        }
    }
}
