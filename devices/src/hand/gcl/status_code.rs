//! Status codes of the hand.

use std::error::Error;
use std::fmt;

/// The sum of bits that follows `ERR`: several errors at once.
///
/// Bits without a meaning are kept and printed.
///
/// ```
/// use yarp_devices::hand::gcl::Status;
///
/// let status = Status::new(16 + 8192);
/// assert!(status.has(Status::NOT_REACHED) && !status.has(Status::ABORTED));
/// assert_eq!(status.to_string(), "position not reached, over-temperature (8208)");
/// ```
///
/// Source: table 23 of the thesis, chapter 5.1.3 of the manual.
#[derive(Clone, Copy, Debug, Default, Eq, Hash, PartialEq)]
pub struct Status(StatusBits);

/// Bits of a status code; the hand prints them as one decimal number.
pub type StatusBits = u16;

/// Every bit with a meaning.
const MEANINGS: [(Status, &str); 13] = [
    (Status::NO_BOARD, "no motor board found"),
    (Status::NO_MOTOR, "no motor found"),
    (Status::NOT_INITIALISED, "motor not initialised"),
    (Status::NOT_REACHED, "position not reached"),
    (Status::UNKNOWN_COMMAND, "unknown command"),
    (Status::UNKNOWN_PARAMETER, "unknown parameter"),
    (Status::INVALID_VALUE, "invalid value"),
    (Status::READ_ONLY, "parameter is read-only"),
    (Status::TOO_MANY_ARGUMENTS, "too many arguments"),
    (Status::BAD_HEADER, "invalid RealTime control header"),
    (Status::NO_PREFIX_ALLOWED, "command takes no motor prefix"),
    (Status::OVER_TEMPERATURE, "over-temperature"),
    (Status::ABORTED, "aborted by ^C"),
];

impl Status {
    /// Nothing is wrong.
    pub const FINE: Status = Status(0);
    /// No motor board found.
    pub const NO_BOARD: Status = Status(1);
    /// No motor found.
    pub const NO_MOTOR: Status = Status(2);
    /// A motor that was never initialised, or not since the last reset.
    pub const NOT_INITIALISED: Status = Status(4);
    /// A move ended farther from its target than allowed.
    pub const NOT_REACHED: Status = Status(16);
    /// Unknown command.
    pub const UNKNOWN_COMMAND: Status = Status(32);
    /// Unknown name of a parameter.
    pub const UNKNOWN_PARAMETER: Status = Status(64);
    /// A value that is no number, out of range, or missing.
    pub const INVALID_VALUE: Status = Status(128);
    /// Something that can only be read was set.
    pub const READ_ONLY: Status = Status(256);
    /// Too many arguments for this command.
    pub const TOO_MANY_ARGUMENTS: Status = Status(1024);
    /// A RealTime block began with an unknown letter.
    pub const BAD_HEADER: Status = Status(2048);
    /// The command is about the whole hand.
    pub const NO_PREFIX_ALLOWED: Status = Status(4096);
    /// The hand is too hot.
    pub const OVER_TEMPERATURE: Status = Status(8192);
    /// ^C came.
    pub const ABORTED: Status = Status(16384);

    /// The status with these bits.
    pub const fn new(bits: StatusBits) -> Self {
        Self(bits)
    }

    /// The bits as the hand prints them.
    pub const fn bits(self) -> StatusBits {
        self.0
    }

    /// Returns whether no error is set.
    pub const fn is_fine(self) -> bool {
        self.0 == 0
    }

    /// Returns whether all bits of `other` are set.
    pub const fn has(self, other: Status) -> bool {
        self.0 & other.0 == other.0
    }

    /// Both complaints.
    pub const fn and(self, other: Status) -> Status {
        Status(self.0 | other.0)
    }

    /// Returns advice on what to try next.
    pub fn advice(self) -> &'static str {
        let advices = [
            (Status::ABORTED, "nothing: somebody stopped the hand"),
            (Status::OVER_TEMPERATURE, "to let the hand cool down"),
            (Status::NOT_INITIALISED, "to initialise the hand"),
            (Status::NOT_REACHED, "to see what blocks the fingers"),
            (Status::NO_BOARD, "the supply and the cable of the hand"),
            (Status::NO_MOTOR, "the supply and the cable of the hand"),
        ];
        advices
            .into_iter()
            .find(|(bits, _)| self.has(*bits))
            .map_or("another command", |(_, advice)| advice)
    }
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_fine() {
            return f.write_str("fine (0)");
        }
        let mut rest = self.0;
        let mut separator = "";
        for (bit, meaning) in MEANINGS {
            if self.has(bit) {
                write!(f, "{separator}{meaning}")?;
                separator = ", ";
                rest &= !bit.0;
            }
        }
        if rest != 0 {
            write!(f, "{separator}unknown bits {rest:#06x}")?;
        }
        write!(f, " ({})", self.0)
    }
}

impl Error for Status {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_bit_of_table_23_has_its_words() {
        let known: u16 = MEANINGS.iter().map(|(bit, _)| bit.bits()).sum();
        // 8 and 512 are not used.
        assert_eq!(known, 0x7fff & !(8 | 512));
        assert_eq!(
            Status::new(4 + 8).to_string(),
            "motor not initialised, unknown bits 0x0008 (12)"
        );
        assert_eq!(Status::FINE.to_string(), "fine (0)");
    }
}
