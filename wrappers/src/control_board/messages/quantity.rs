//! The numbers that can be asked for and set, and the words for them.

use super::selection::Words;
use super::vocabulary as word;

/// A number that can be asked for.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Quantity {
    /// Where the joint was last told to go.
    TargetPosition,
    /// How fast point-to-point moves may become.
    ReferenceSpeed,
    /// How hard the joint accelerates.
    ReferenceAcceleration,
    /// The velocity last asked for.
    ReferenceVelocity,
    /// Measured position.
    Position,
    /// Measured speed.
    Speed,
    /// Measured acceleration.
    Acceleration,
}

/// A number that can be set.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Setting {
    /// Go there.
    Position,
    /// Go so far.
    Distance,
    /// How fast point-to-point moves may become.
    ReferenceSpeed,
    /// How hard the joint accelerates.
    ReferenceAcceleration,
    /// Move at this velocity.
    Velocity,
    /// Call the present position this.
    Encoder,
}

pub(super) const QUANTITIES: [Quantity; 7] = [
    Quantity::TargetPosition,
    Quantity::ReferenceSpeed,
    Quantity::ReferenceAcceleration,
    Quantity::ReferenceVelocity,
    Quantity::Position,
    Quantity::Speed,
    Quantity::Acceleration,
];

pub(super) const SETTINGS: [Setting; 6] = [
    Setting::Position,
    Setting::Distance,
    Setting::ReferenceSpeed,
    Setting::ReferenceAcceleration,
    Setting::Velocity,
    Setting::Encoder,
];

const POSITION: Words = Words::three(word::POSITION, word::POSITION_GROUP, word::POSITIONS);
const DISTANCE: Words = Words::three(word::RELATIVE, word::RELATIVE_GROUP, word::RELATIVES);
const SPEED: Words = Words::three(word::SPEED, word::SPEED_GROUP, word::SPEEDS);
const ACCELERATION: Words = Words::three(
    word::ACCELERATION,
    word::ACCELERATION_GROUP,
    word::ACCELERATIONS,
);
pub(super) const VELOCITY: Words =
    Words::three(word::VELOCITY, word::VELOCITY_GROUP, word::VELOCITIES);
pub(super) const DONE: Words = Words::three(word::DONE, word::DONE_GROUP, word::DONES);
pub(super) const STOP: Words = Words::three(word::STOP, word::STOP_GROUP, word::STOPS);
const ENCODER: Words = Words::two(word::ENCODER, word::ENCODERS);
pub(super) const RESET: Words = Words::two(word::RESET_ENCODER, word::RESET_ENCODERS);
pub(super) const MODE: Words = Words::three(
    word::CONTROL_MODE,
    word::CONTROL_MODE_GROUP,
    word::CONTROL_MODES,
);

impl Quantity {
    /// The words that ask for it.
    pub const fn words(self) -> Words {
        match self {
            Self::TargetPosition => POSITION,
            Self::ReferenceSpeed => SPEED,
            Self::ReferenceAcceleration => ACCELERATION,
            Self::ReferenceVelocity => VELOCITY,
            Self::Position => ENCODER,
            Self::Speed => Words::two(word::ENCODER_SPEED, word::ENCODER_SPEEDS),
            Self::Acceleration => {
                Words::two(word::ENCODER_ACCELERATION, word::ENCODER_ACCELERATIONS)
            }
        }
    }
}

impl Setting {
    /// The words that set it.
    pub const fn words(self) -> Words {
        match self {
            Self::Position => POSITION,
            Self::Distance => DISTANCE,
            Self::ReferenceSpeed => SPEED,
            Self::ReferenceAcceleration => ACCELERATION,
            // Stock takes the others on `command:i` only, and answers `[fail]` here.
            Self::Velocity => Words::only_all(word::VELOCITIES),
            Self::Encoder => ENCODER,
        }
    }
}
