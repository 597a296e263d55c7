//! State of the pendant's lamps, [`PuckProperty::PEN`](super::PuckProperty::PEN) (Barrett's wiki,
//! `SafetyFeaturesPrecautions`).

use std::fmt;

/// The lamps, in the order of their bits.
const NAMES: [&str; 5] = ["velocity", "torque", "voltage", "heartbeat", "other"];
/// The lamp of the supply voltage.
const VOLTAGE: usize = 2;
/// The lamp of a module that is in emergency stop.
const OTHER: usize = 4;

/// State of one of the five quantities that the safety module monitors.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub enum Lamp {
    /// Green.
    #[default]
    Safe,
    /// Yellow.
    Warning,
    /// Red.
    Fault,
}

impl Lamp {
    /// A group of three bits of which one is set; several or none count as a fault, since safety is not confirmed.
    fn of_bits(bits: u32) -> Self {
        match bits & 7 {
            0b001 => Self::Safe,
            0b010 => Self::Warning,
            _ => Self::Fault,
        }
    }

    fn bits(self) -> u32 {
        match self {
            Self::Safe => 0b001,
            Self::Warning => 0b010,
            Self::Fault => 0b100,
        }
    }
}

/// The lamps of velocity, torque, voltage, heartbeat and all else.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct Pendant {
    /// In this order.
    pub lamps: [Lamp; 5],
}

impl Pendant {
    /// Reads the lower 15 bits of the property: the first group is that of velocity.
    pub fn of_bits(bits: i32) -> Self {
        let bits = bits as u32;
        Self {
            lamps: std::array::from_fn(|lamp| Lamp::of_bits(bits >> (3 * lamp))),
        }
    }

    /// Returns the lamp of the supply voltage.
    pub fn voltage(self) -> Lamp {
        self.lamps[VOLTAGE]
    }

    /// The lower 15 bits of the property.
    pub fn bits(self) -> i32 {
        let lamps = self.lamps.iter().enumerate();
        lamps.fold(0, |bits, (index, lamp)| bits | lamp.bits() << (3 * index)) as i32
    }
}

/// The faults and the warnings, in words.
impl fmt::Display for Pendant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut between = "";
        for (name, lamp) in NAMES.iter().zip(self.lamps) {
            if lamp == Lamp::Fault {
                let name = if *name == NAMES[OTHER] {
                    "emergency stop"
                } else {
                    name
                };
                write!(f, "{between}{name}")?;
                between = ", ";
            }
        }
        if between.is_empty() {
            write!(f, "no fault")?;
        }
        for (name, lamp) in NAMES.iter().zip(self.lamps) {
            if lamp == Lamp::Warning {
                write!(f, ", warning of {name}")?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_published_example_is_all_safe() {
        let pendant = Pendant::of_bits(0x0D3F_1249);
        assert_eq!(pendant, Pendant::default());
        assert_eq!(pendant.to_string(), "no fault");
        assert_eq!(pendant.bits(), 0x1249);
    }

    #[test]
    fn faults_are_named() {
        let mut pendant = Pendant::default();
        pendant.lamps[0] = Lamp::Fault;
        pendant.lamps[4] = Lamp::Fault;
        assert_eq!(Pendant::of_bits(pendant.bits()), pendant);
        assert_eq!(pendant.to_string(), "velocity, emergency stop");
        assert_eq!(Pendant::of_bits(0).lamps, [Lamp::Fault; 5]);
        pendant.lamps = [Lamp::Safe; 5];
        pendant.lamps[2] = Lamp::Warning;
        assert_eq!(pendant.to_string(), "no fault, warning of voltage");
        assert_eq!(pendant.voltage(), Lamp::Warning);
    }
}
