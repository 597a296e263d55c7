//! The numbers that can be read and set, one for each joint, and their spelling in each wire version.

use yarp_devices::{AmplifierLimit, Axes, DeviceError, PidKind, PidValue};
use yarp_wire::{Vocab32, WireVersion};

use super::axis_selection::{Forms, Functions, Selection, Words};
use super::vocabulary as word;

/// A number that can be read.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Quantity {
    /// The last target of the joint.
    TargetPosition,
    /// Speed of point-to-point moves.
    ReferenceSpeed,
    /// Acceleration of the joint.
    ReferenceAcceleration,
    /// The last commanded velocity.
    ReferenceVelocity,
    /// Measured position.
    Position,
    /// Measured speed.
    Speed,
    /// Measured acceleration.
    Acceleration,
    /// The position last sent step by step.
    DirectPosition,
    /// The velocity last sent step by step.
    DirectVelocity,
    /// Measured position of the motor.
    MotorPosition,
    /// Measured speed of the motor.
    MotorSpeed,
    /// Measured acceleration of the motor.
    MotorAcceleration,
    /// Counts of the motor's encoder per turn.
    MotorCounts,
    /// Temperature of the motor.
    Temperature,
    /// Maximum temperature of the motor.
    TemperatureLimit,
    /// Turns of the motor per turn of the joint.
    GearboxRatio,
    /// Measured current.
    Current,
    /// A limit of the amplifier.
    Amplifier(AmplifierLimit),
    /// Duty cycle of the amplifier.
    AmplifierDutyCycle,
    /// Supply voltage of the amplifier.
    SupplyVoltage,
    /// Measured torque.
    Torque,
    /// The last commanded torque.
    ReferenceTorque,
    /// The last commanded current.
    ReferenceCurrent,
    /// The last commanded duty cycle.
    ReferenceDutyCycle,
    /// Duty cycle of the motor.
    DutyCycle,
    /// Torque added to that of the spring.
    ImpedanceOffset,
    /// A number of a control loop.
    Pid(PidKind, PidValue),
}

/// A number that can be set.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Setting {
    /// Go there.
    Position,
    /// Go so far.
    Distance,
    /// Speed of point-to-point moves.
    ReferenceSpeed,
    /// Acceleration of the joint.
    ReferenceAcceleration,
    /// Move at this velocity.
    Velocity,
    /// Call the present position this.
    Encoder,
    /// Be there now.
    DirectPosition,
    /// Have this velocity now.
    DirectVelocity,
    /// Push with this torque.
    Torque,
    /// Feed the motor this current.
    Current,
    /// Give the motor this duty cycle.
    DutyCycle,
    /// Call the present position of the motor this.
    MotorEncoder,
    /// Counts of the motor's encoder per turn.
    MotorCounts,
    /// Maximum temperature of the motor.
    TemperatureLimit,
    /// Turns of the motor per turn of the joint.
    GearboxRatio,
    /// A limit of the amplifier.
    Amplifier(AmplifierLimit),
    /// Torque added to that of the spring.
    ImpedanceOffset,
    /// A number of a control loop.
    Pid(PidKind, PidValue),
}

/// Spelling of a call.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spelling {
    /// In 3.x the word in front of the others, if there is one.
    pub(crate) interface: Option<Vocab32>,
    pub(crate) words: Words,
    pub(crate) functions: Functions,
}

impl Spelling {
    /// The selections that mean these joints to a board of this wire version, see [`Forms::sayable`].
    pub(crate) fn sayable(
        self,
        wire_version: WireVersion,
        axes: Axes<'_>,
        total: usize,
        what: &str,
        each: bool,
    ) -> Result<Vec<Selection>, DeviceError> {
        match wire_version {
            WireVersion::V3 => self.words.sayable(axes, total, what, each),
            WireVersion::V4 => self.functions.sayable(axes, total, what, each),
        }
    }

    pub(super) const fn plain(words: Words, functions: Functions) -> Self {
        Self {
            interface: None,
            words,
            functions,
        }
    }

    pub(super) const fn of(interface: Vocab32, words: Words, functions: Functions) -> Self {
        Self {
            interface: Some(interface),
            words,
            functions,
        }
    }
}

const POSITION: Words = Words::three(word::POSITION, word::POSITION_GROUP, word::POSITIONS);
const DISTANCE: Words = Words::three(word::RELATIVE, word::RELATIVE_GROUP, word::RELATIVES);
const SPEED: Words = Words::three(word::SPEED, word::SPEED_GROUP, word::SPEEDS);
const ACCELERATION: Words = Words::three(
    word::ACCELERATION,
    word::ACCELERATION_GROUP,
    word::ACCELERATIONS,
);
const VELOCITY: Words = Words::three(word::VELOCITY, word::VELOCITY_GROUP, word::VELOCITIES);
const DIRECT: Words = Words::three(
    word::DIRECT_POSITION,
    word::DIRECT_POSITION_GROUP,
    word::DIRECT_POSITIONS,
);
const ENCODER: Words = Words::two(word::ENCODER, word::ENCODERS);
const MOTOR: Words = Words::two(word::MOTOR_ENCODER, word::MOTOR_ENCODERS);
const REFERENCE: Words = Words::two(word::REFERENCE, word::REFERENCES);

/// The limits of amplifiers: their word, and their functions to read and to set.
const AMPLIFIERS: [(AmplifierLimit, Vocab32, &str, &str); 4] = [
    (
        AmplifierLimit::MaxCurrent,
        word::MAX_CURRENT,
        "getMaxCurrent",
        "setMaxCurrent",
    ),
    (
        AmplifierLimit::NominalCurrent,
        word::NOMINAL_CURRENT,
        "getNominalCurrent",
        "setNominalCurrent",
    ),
    (
        AmplifierLimit::PeakCurrent,
        word::PEAK_CURRENT,
        "getPeakCurrent",
        "setPeakCurrent",
    ),
    (
        AmplifierLimit::DutyCycle,
        word::DUTY_CYCLE_LIMIT,
        "getPWMLimit",
        "setPWMLimit",
    ),
];

fn amplifier(limit: AmplifierLimit) -> (Vocab32, &'static str, &'static str) {
    let (_, word, get, set) = AMPLIFIERS[limit as usize];
    (word, get, set)
}

impl Quantity {
    /// Every quantity; those of control loops for positions, in the place of all kinds.
    pub(super) fn all() -> impl Iterator<Item = Self> {
        let plain = [
            Self::TargetPosition,
            Self::ReferenceSpeed,
            Self::ReferenceAcceleration,
            Self::ReferenceVelocity,
            Self::Position,
            Self::Speed,
            Self::Acceleration,
            Self::DirectPosition,
            Self::DirectVelocity,
            Self::MotorPosition,
            Self::MotorSpeed,
            Self::MotorAcceleration,
            Self::MotorCounts,
            Self::Temperature,
            Self::TemperatureLimit,
            Self::GearboxRatio,
            Self::Current,
            Self::AmplifierDutyCycle,
            Self::SupplyVoltage,
            Self::Torque,
            Self::ReferenceTorque,
            Self::ReferenceCurrent,
            Self::ReferenceDutyCycle,
            Self::DutyCycle,
            Self::ImpedanceOffset,
        ];
        let amplifiers = AMPLIFIERS.map(|(limit, ..)| Self::Amplifier(limit));
        let loops = PID_VALUES.map(|value| Self::Pid(PidKind::Position, value));
        plain.into_iter().chain(amplifiers).chain(loops)
    }

    /// The kind of control loop it is about.
    pub(super) fn kind(self) -> Option<PidKind> {
        match self {
            Self::Pid(kind, _) => Some(kind),
            _ => None,
        }
    }

    /// The same of another kind of control loop.
    pub(super) fn of_kind(self, other: PidKind) -> Self {
        match self {
            Self::Pid(_, value) => Self::Pid(other, value),
            plain => plain,
        }
    }

    /// Returns the spelling of the query.
    pub(crate) fn spelling(self) -> Spelling {
        use Spelling as S;
        let three = Functions::three;
        let two = Functions::two;
        let one = Functions::only_one;
        match self {
            Self::TargetPosition => S::plain(
                POSITION,
                three(
                    "getTargetPositionOne",
                    "getTargetPositionGroup",
                    "getTargetPositionAll",
                ),
            ),
            Self::ReferenceSpeed => S::plain(
                SPEED,
                three("getTrajSpeedOne", "getTrajSpeedsGroup", "getTrajSpeedsAll"),
            ),
            Self::ReferenceAcceleration => S::plain(
                ACCELERATION,
                three(
                    "getTrajAccelerationOne",
                    "getTrajAccelerationGroup",
                    "getTrajAccelerationAll",
                ),
            ),
            Self::ReferenceVelocity => S::plain(
                VELOCITY,
                three(
                    "getTargetVelocityOne",
                    "getTargetVelocityGroup",
                    "getTargetVelocityAll",
                ),
            ),
            Self::Position => S::plain(ENCODER, two("getEncoderOne", "getEncoderAll")),
            Self::Speed => S::plain(
                Words::two(word::ENCODER_SPEED, word::ENCODER_SPEEDS),
                two("getEncoderSpeedOne", "getEncoderSpeedAll"),
            ),
            Self::Acceleration => S::plain(
                Words::two(word::ENCODER_ACCELERATION, word::ENCODER_ACCELERATIONS),
                two("getEncoderAccelerationOne", "getEncoderAccelerationAll"),
            ),
            Self::DirectPosition => S::plain(
                DIRECT,
                three(
                    "getRefPositionOne",
                    "getRefPositionGroup",
                    "getRefPositionAll",
                ),
            ),
            Self::DirectVelocity => S::plain(
                Forms::NONE,
                three(
                    "getRefVelocityOne",
                    "getRefVelocityGroup",
                    "getRefVelocityAll",
                ),
            ),
            Self::MotorPosition => S::plain(MOTOR, two("getMotorEncoderOne", "getMotorEncoderAll")),
            Self::MotorSpeed => S::plain(
                Words::two(word::MOTOR_SPEED, word::MOTOR_SPEEDS),
                two("getMotorEncoderSpeedOne", "getMotorEncoderSpeedAll"),
            ),
            Self::MotorAcceleration => S::plain(
                Words::two(word::MOTOR_ACCELERATION, word::MOTOR_ACCELERATIONS),
                two(
                    "getMotorEncoderAccelerationOne",
                    "getMotorEncoderAccelerationAll",
                ),
            ),
            Self::MotorCounts => S::plain(
                Words::only_one(word::MOTOR_COUNTS),
                one("getMotorEncoderCountsPerRevolution"),
            ),
            Self::Temperature => S::plain(
                Words::two(word::TEMPERATURE, word::TEMPERATURES),
                two("getTemperatureOne", "getTemperatureAll"),
            ),
            Self::TemperatureLimit => S::plain(
                Words::only_one(word::TEMPERATURE_LIMIT),
                one("getTemperatureLimit"),
            ),
            Self::GearboxRatio => {
                S::plain(Words::only_one(word::GEARBOX_RATIO), one("getGearboxRatio"))
            }
            Self::Current => S::plain(
                Words::two(word::AMPLIFIER_CURRENT, word::AMPLIFIER_CURRENTS),
                two("getCurrentOne", "getCurrentAll"),
            ),
            Self::Amplifier(limit) => {
                let (word, get, _) = amplifier(limit);
                S::plain(Words::only_one(word), one(get))
            }
            Self::AmplifierDutyCycle => S::plain(Words::only_one(word::DUTY_CYCLE), one("getPWM")),
            Self::SupplyVoltage => S::plain(
                Words::only_one(word::SUPPLY_VOLTAGE),
                one("getPowerSupplyVoltage"),
            ),
            Self::Torque => S::of(
                word::TORQUE_INTERFACE,
                Words::two(word::TORQUE, word::TORQUES),
                Forms::NONE,
            ),
            Self::ReferenceTorque => S::of(
                word::TORQUE_INTERFACE,
                REFERENCE,
                three("getRefTorqueOne", "getRefTorqueGroup", "getRefTorqueAll"),
            ),
            Self::ReferenceCurrent => S::of(
                word::CURRENT_INTERFACE,
                REFERENCE,
                two("getRefCurrentOne", "getRefCurrentAll"),
            ),
            Self::ReferenceDutyCycle => S::of(
                word::PWM_INTERFACE,
                REFERENCE,
                two("getRefDutyCycleOne", "getRefDutyCycleAll"),
            ),
            Self::DutyCycle => S::of(
                word::PWM_INTERFACE,
                Words::two(word::DUTY_CYCLE, word::DUTY_CYCLES),
                two("getDutyCycleOne", "getDutyCycleAll"),
            ),
            Self::ImpedanceOffset => S::of(
                word::IMPEDANCE_INTERFACE,
                Words::only_one(word::IMPEDANCE_OFFSET),
                one("getImpedanceOffset"),
            ),
            Self::Pid(_, value) => {
                let functions = match value {
                    PidValue::Reference => two("getPidReference", "getPidReferences"),
                    PidValue::ErrorLimit => two("getPidErrorLimit", "getPidErrorLimits"),
                    PidValue::Error => two("getPidError", "getPidErrors"),
                    PidValue::Output => two("getPidOutput", "getPidOutputs"),
                    PidValue::Offset => one("getPidOffset"),
                    PidValue::Feedforward => one("getPidFeedforward"),
                };
                let words = match value {
                    // Can be set, not read.
                    PidValue::Offset => Forms::NONE,
                    other => loop_words(other),
                };
                S::of(word::PID_INTERFACE, words, functions)
            }
        }
    }
}

const PID_VALUES: [PidValue; 6] = [
    PidValue::Reference,
    PidValue::ErrorLimit,
    PidValue::Error,
    PidValue::Output,
    PidValue::Offset,
    PidValue::Feedforward,
];

fn loop_words(value: PidValue) -> Words {
    match value {
        PidValue::Reference => REFERENCE,
        PidValue::ErrorLimit => Words::two(word::ERROR_LIMIT, word::ERROR_LIMITS),
        PidValue::Error => Words::two(word::ERROR, word::ERRORS),
        PidValue::Output => Words::two(word::OUTPUT, word::OUTPUTS),
        PidValue::Offset => Words::only_one(word::OFFSET),
        PidValue::Feedforward => Forms::NONE,
    }
}

impl Setting {
    /// Every setting; those of control loops for positions, in the place of all kinds.
    pub(super) fn all() -> impl Iterator<Item = Self> {
        let plain = [
            Self::Position,
            Self::Distance,
            Self::ReferenceSpeed,
            Self::ReferenceAcceleration,
            Self::Velocity,
            Self::Encoder,
            Self::DirectPosition,
            Self::DirectVelocity,
            Self::Torque,
            Self::Current,
            Self::DutyCycle,
            Self::MotorEncoder,
            Self::MotorCounts,
            Self::TemperatureLimit,
            Self::GearboxRatio,
            Self::ImpedanceOffset,
        ];
        let amplifiers = AMPLIFIERS.map(|(limit, ..)| Self::Amplifier(limit));
        let loops = PID_VALUES.into_iter().filter_map(|value| match value {
            PidValue::Error | PidValue::Output => None,
            value => Some(Self::Pid(PidKind::Position, value)),
        });
        plain.into_iter().chain(amplifiers).chain(loops)
    }

    /// The kind of control loop it is about.
    pub(super) fn kind(self) -> Option<PidKind> {
        match self {
            Self::Pid(kind, _) => Some(kind),
            _ => None,
        }
    }

    /// The same of another kind of control loop.
    pub(super) fn of_kind(self, other: PidKind) -> Self {
        match self {
            Self::Pid(_, value) => Self::Pid(other, value),
            plain => plain,
        }
    }

    /// Returns the spelling of the command that is answered. Stock 3.x takes what has no words here on `command:i`
    /// only.
    pub(crate) fn spelling(self) -> Spelling {
        use Spelling as S;
        let three = Functions::three;
        let two = Functions::two;
        let one = Functions::only_one;
        match self {
            Self::Position => S::plain(
                POSITION,
                three("positionMoveOne", "positionMoveGroup", "positionMoveAll"),
            ),
            Self::Distance => S::plain(
                DISTANCE,
                three("relativeMoveOne", "relativeMoveGroup", "relativeMoveAll"),
            ),
            Self::ReferenceSpeed => S::plain(
                SPEED,
                three("setTrajSpeedOne", "setTrajSpeedGroup", "setTrajSpeedAll"),
            ),
            Self::ReferenceAcceleration => S::plain(
                ACCELERATION,
                three(
                    "setTrajAccelerationOne",
                    "setTrajAccelerationsGroup",
                    "setTrajAccelerationsAll",
                ),
            ),
            Self::Velocity => S::plain(
                // Stock answers `[fail]` to the others here.
                Words::only_all(word::VELOCITIES),
                three("velocityMoveOne", "velocityMoveGroup", "velocityMoveAll"),
            ),
            Self::Encoder => S::plain(ENCODER, two("setEncoderOne", "setEncoderAll")),
            Self::DirectPosition => S::plain(
                Forms::NONE,
                three(
                    "setRefPositionOne",
                    "setRefPositionGroup",
                    "setRefPositionAll",
                ),
            ),
            Self::DirectVelocity => S::plain(
                Forms::NONE,
                three(
                    "setRefVelocityOne",
                    "setRefVelocityGroup",
                    "setRefVelocityAll",
                ),
            ),
            Self::Torque => S::of(
                word::TORQUE_INTERFACE,
                REFERENCE,
                three("setRefTorqueOne", "setRefTorqueGroup", "setRefTorqueAll"),
            ),
            Self::Current => S::plain(
                Forms::NONE,
                three("setRefCurrentOne", "setRefCurrentGroup", "setRefCurrentAll"),
            ),
            Self::DutyCycle => S::plain(
                Forms::NONE,
                three(
                    "setRefDutyCycleOne",
                    "setRefDutyCycleGroup",
                    "setRefDutyCycleAll",
                ),
            ),
            Self::MotorEncoder => S::plain(MOTOR, two("setMotorEncoder", "setMotorEncodersAll")),
            Self::MotorCounts => S::plain(
                Words::only_one(word::MOTOR_COUNTS),
                one("setMotorEncoderCountsPerRevolution"),
            ),
            Self::TemperatureLimit => S::plain(
                Words::only_one(word::TEMPERATURE_LIMIT),
                one("setTemperatureLimit"),
            ),
            Self::GearboxRatio => {
                S::plain(Words::only_one(word::GEARBOX_RATIO), one("setGearboxRatio"))
            }
            Self::Amplifier(limit) => {
                let (word, _, set) = amplifier(limit);
                S::plain(Words::only_one(word), one(set))
            }
            Self::ImpedanceOffset => S::of(
                word::IMPEDANCE_INTERFACE,
                Words::only_one(word::IMPEDANCE_OFFSET),
                one("setImpedanceOffset"),
            ),
            Self::Pid(_, value) => {
                let functions = match value {
                    PidValue::Reference => two("setPidReference", "setPidReferences"),
                    PidValue::ErrorLimit => two("setPidErrorLimit", "setPidErrorLimits"),
                    PidValue::Offset => one("setPidOffsetOne"),
                    PidValue::Feedforward => one("setPidFeedforwardOne"),
                    PidValue::Error | PidValue::Output => Forms::NONE,
                };
                let words = match value {
                    PidValue::Error | PidValue::Output => Forms::NONE,
                    other => loop_words(other),
                };
                S::of(word::PID_INTERFACE, words, functions)
            }
        }
    }
}
