//! Properties of a puck that can be read and set, by number.

use std::fmt;

/// A property of a puck or of the safety module, by its number of 7 bits.
///
/// The numbers are those of libbarrett's `property_list.cpp` for the firmware of today; which of them take 32 bits is from btclient's
/// `btcan_peakesd.c`. MotorSet and safety module use the same numbers for different things.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub struct PuckProperty(u8);

impl PuckProperty {
    /// Version of the firmware.
    pub const VERS: Self = Self(0);
    /// Role of the puck, see [`role`].
    pub const ROLE: Self = Self(1);
    /// Error of the puck; what its values mean is not published. 0 is none.
    pub const ERROR: Self = Self(4);
    /// State of the puck, see [`status`].
    pub const STAT: Self = Self(5);
    /// Mode of the puck, see [`mode`].
    pub const MODE: Self = Self(8);
    /// Temperature of the puck, °C.
    pub const TEMP: Self = Self(9);
    /// Maximum temperature of the puck, °C.
    pub const OTEMP: Self = Self(11);
    /// The voltage that feeds it, V.
    pub const VBUS: Self = Self(21);
    /// Its group for torques.
    pub const GRPB: Self = Self(27);
    /// Its group for properties.
    pub const GRPC: Self = Self(28);
    /// Torque.
    pub const T: Self = Self(42);
    /// Largest torque it follows.
    pub const MT: Self = Self(43);
    /// Position, counts.
    pub const P: Self = Self(48);
    /// Position of the rotor inside its turn, counts; from firmware 118 on.
    pub const MECH: Self = Self(66);
    /// Counts per turn.
    pub const CTS: Self = Self(68);
    /// Its slot in frames of torques, from 1.
    pub const PIDX: Self = Self(70);
    /// Units of torque per Nm.
    pub const IPNM: Self = Self(86);

    /// Safety module: whether positions are true.
    pub const ZERO: Self = Self(42);
    /// Safety module: state of the pendant.
    pub const PEN: Self = Self(43);
    /// Safety module: velocity that it warns of, m/s / 4096.
    pub const VL1: Self = Self(45);
    /// Safety module: velocity that is a fault, m/s / 4096.
    pub const VL2: Self = Self(46);
    /// Safety module: torque that it warns of.
    pub const TL1: Self = Self(47);
    /// Safety module: torque that is a fault.
    pub const TL2: Self = Self(48);
    /// Safety module: supply voltage below which it warns, V.
    pub const VOLTL1: Self = Self(49);
    /// Safety module: supply voltage below which there is a fault, V.
    pub const VOLTL2: Self = Self(50);
    /// Safety module: supply voltage above which it warns, V.
    pub const VOLTH1: Self = Self(51);
    /// Safety module: supply voltage above which there is a fault, V.
    pub const VOLTH2: Self = Self(52);
    /// Safety module: how many velocity faults to ignore.
    pub const IFAULT: Self = Self(55);

    /// A property by its number; the eighth bit is ignored.
    pub const fn new(number: u8) -> Self {
        Self(number & 0x7F)
    }

    /// Its number.
    pub fn number(self) -> u8 {
        self.0
    }

    /// Returns whether a motor's property of this number takes 32 bits.
    pub fn is_wide(self) -> bool {
        matches!(
            self.0,
            48 | 50 | 52 | 54 | 56 | 58 | 66 | 68 | 74 | 88 | 94 | 96 | 98
        )
    }
}

impl fmt::Display for PuckProperty {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "property {}", self.0)
    }
}

/// Values of [`PuckProperty::STAT`].
pub mod status {
    /// Just switched on: only `VERS` and `STAT` are answered.
    pub const MONITOR: i32 = 0;
    /// Something is wrong with it.
    pub const ERROR: i32 = 1;
    /// The firmware runs.
    pub const READY: i32 = 2;
}

/// Values of [`PuckProperty::MODE`].
pub mod mode {
    /// Motor: windings shorted, brakes. Safety module: emergency stop.
    pub const IDLE_OR_STOPPED: i32 = 0;
    /// Safety module: idle.
    pub const SAFETY_IDLE: i32 = 1;
    /// Motor: follows torques. Safety module: active.
    pub const TORQUE_OR_ACTIVE: i32 = 2;
}

/// The low 5 bits of [`PuckProperty::ROLE`].
pub mod role {
    /// The bits.
    pub const MASK: i32 = 0x1F;
    /// The flag of an absolute encoder, on a serial line.
    pub const ABSOLUTE_ENCODER: i32 = 0x0100;
    /// A motor of the arm.
    pub const MOTOR: i32 = 0;
    /// The safety module.
    pub const SAFETY: i32 = 2;
}
