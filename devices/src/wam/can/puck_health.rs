//! Temperatures, errors and states of the pucks, and what follows from them.
//!
//! | puck | consequence |
//! | --- | --- |
//! | 5 °C below its limit | a warning, once until it has cooled |
//! | at its limit | every joint comes to rest and holds; commands are refused until the puck is 10 °C below its limit |
//! | 10 °C above its limit | the safety module brakes the arm too, as often as somebody activates it |
//! | `STAT` is error | the safety module brakes the arm, which counts as lost; the driver connects again when the puck is ready |
//! | `ERROR` is not 0 | a warning, once for each value: what the values mean is not published |
//!
//! The limit is the puck's own `OTEMP`: 60 °C for every motor of the arm in the defaults of btclient (`btutil/main.h`) and
//! of owd (`btutil_paramDefaults.h`). 10 °C more is the end of the range that Barrett gives for the arm (wiki: 0 to 70 °C,
//! pucks usually from 40 °C). The distances of 5 and of 10 °C below the limit are **assumptions**: nobody publishes any.
//!
//! A value counts when it is read twice in a row, so that a frame of somebody else stops nothing.

use tracing::{info, warn};

use super::CanErrorKind;
use crate::can::puck::{Node, PuckProperty, status};

/// Limit of a puck that does not tell its own, °C (btclient, owd).
pub(super) const DEFAULT_LIMIT: i32 = 60;
/// Limits that a puck may tell, °C; others count as none.
const PLAUSIBLE_LIMITS: std::ops::RangeInclusive<i32> = 20..=120;
/// Temperatures that a puck may have, °C; others are ignored.
const PLAUSIBLE: std::ops::RangeInclusive<i32> = -40..=150;
/// Distance below the limit at which a puck is warned of, °C. Assumed.
const WARNING_DISTANCE: i32 = 5;
/// Distance below the limit to which a puck has to cool until commands are accepted again, °C. Assumed.
const COOLING_DISTANCE: i32 = 10;
/// Distance above the limit at which the arm is braked, °C (Barrett's wiki: 70 °C at most).
const BRAKING_DISTANCE: i32 = 10;
/// Maximum number of queries that confirm a value.
const MAX_CONFIRMATIONS: u32 = 10;
/// Properties that are queried, each of one puck after the other.
const WATCHED: [PuckProperty; 3] = [PuckProperty::TEMP, PuckProperty::STAT, PuckProperty::ERROR];

/// Heat of a puck.
#[derive(Clone, Copy, Debug, Default, Eq, Ord, PartialEq, PartialOrd)]
enum Heat {
    #[default]
    Usual,
    Warned,
    /// Until it has cooled.
    Hot,
    /// The arm is braked.
    Burning,
}

/// The health of the pucks of all motors.
#[derive(Clone, Debug)]
pub(super) struct PuckHealth<const N: usize> {
    /// °C.
    limits: [i32; N],
    temperatures: [Option<i32>; N],
    heat: [Heat; N],
    errors: [i32; N],
    /// Number of the next query.
    next: usize,
    /// A property whose value has consequences if it is read again.
    doubt: Option<Doubt>,
}

/// A property of a motor's puck that has been read once.
#[derive(Clone, Copy, Debug)]
struct Doubt {
    motor: usize,
    property: PuckProperty,
    /// Number of queries left until it is forgotten.
    left: u32,
}

/// Returns the temperature limit that a puck tells, °C, or the default.
pub(super) fn puck_limit(told: Option<i32>) -> i32 {
    told.filter(|told| PLAUSIBLE_LIMITS.contains(told))
        .unwrap_or(DEFAULT_LIMIT)
}

impl<const N: usize> PuckHealth<N> {
    /// Pucks of which nothing is known, with these limits, °C.
    pub(super) fn new(limits: [i32; N]) -> Self {
        Self {
            limits,
            temperatures: [None; N],
            heat: [Heat::Usual; N],
            errors: [0; N],
            next: 0,
            doubt: None,
        }
    }

    /// Returns the next query: each property of each puck in turn, and a doubtful value again.
    pub(super) fn question(&mut self) -> (Node, PuckProperty) {
        if let Some(doubt) = &mut self.doubt {
            let asked = (Node::of_motor(doubt.motor), doubt.property);
            doubt.left -= 1;
            self.doubt.take_if(|doubt| doubt.left == 0);
            return asked;
        }
        let (motor, property) = (self.next % N, self.next / N % WATCHED.len());
        self.next += 1;
        (Node::of_motor(motor), WATCHED[property])
    }

    /// Returns whether a value waits for its confirmation.
    pub(super) fn is_in_doubt(&self) -> bool {
        self.doubt.is_some()
    }

    /// Returns the last temperatures, °C.
    pub(super) fn temperatures(&self) -> [Option<i32>; N] {
        self.temperatures
    }

    /// Handles the value of a property.
    ///
    /// Errors: [`CanErrorKind::PuckError`] if the puck is in its error state.
    pub(super) fn note(
        &mut self,
        motor: usize,
        property: PuckProperty,
        value: i32,
    ) -> Result<(), CanErrorKind> {
        let matters = match property {
            PuckProperty::TEMP if PLAUSIBLE.contains(&value) => {
                self.heat_at(motor, value) != self.heat[motor]
            }
            PuckProperty::STAT => value == status::ERROR,
            PuckProperty::ERROR => value != self.errors[motor],
            _ => return Ok(()),
        };
        let same = |doubt: &mut Doubt| (doubt.motor, doubt.property) == (motor, property);
        let is_again = self.doubt.take_if(same).is_some();
        if matters && !is_again {
            self.doubt = Some(Doubt {
                motor,
                property,
                left: MAX_CONFIRMATIONS,
            });
            return Ok(());
        }
        let node = Node::of_motor(motor);
        match property {
            PuckProperty::TEMP => self.warm(motor, value),
            PuckProperty::STAT if matters => {
                let code = self.errors[motor];
                return Err(CanErrorKind::PuckError { node, code });
            }
            PuckProperty::ERROR if matters => {
                self.errors[motor] = value;
                match value {
                    0 => info!(%node, "the puck has no error any more"),
                    code => warn!(%node, code, "the puck reports an error"),
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// Returns the heat of a puck at a temperature; one that was hot stays so until it has cooled.
    fn heat_at(&self, motor: usize, temperature: i32) -> Heat {
        let over = temperature - self.limits[motor];
        let now = match over {
            BRAKING_DISTANCE.. => Heat::Burning,
            0.. => Heat::Hot,
            over if over >= -WARNING_DISTANCE => Heat::Warned,
            _ => Heat::Usual,
        };
        match self.heat[motor] {
            Heat::Hot | Heat::Burning if over > -COOLING_DISTANCE => now.max(Heat::Hot),
            Heat::Warned if over > -COOLING_DISTANCE => now.max(Heat::Warned),
            _ => now,
        }
    }

    fn warm(&mut self, motor: usize, temperature: i32) {
        self.temperatures[motor] = Some(temperature);
        let now = self.heat_at(motor, temperature);
        let before = std::mem::replace(&mut self.heat[motor], now);
        let (node, limit) = (Node::of_motor(motor), self.limits[motor]);
        if now > before {
            let effect = match now {
                Heat::Burning => "the arm is braked",
                Heat::Hot => "the arm stops and holds",
                _ => "it is warm",
            };
            warn!(%node, temperature, limit, "a puck is close to or above its limit: {effect}");
        } else if now < before && now < Heat::Hot {
            info!(%node, temperature, limit, "the puck has cooled");
        }
    }

    /// Returns whether joints have to hold because a puck is too hot.
    pub(super) fn is_too_hot(&self) -> bool {
        self.heat.iter().any(|heat| *heat >= Heat::Hot)
    }

    /// Returns why joints hold and commands are refused, in words; `None` if no puck is too hot.
    pub(super) fn too_hot(&self) -> Option<String> {
        let hottest = (0..N).max_by_key(|&motor| self.heat[motor])?;
        if self.heat[hottest] < Heat::Hot {
            return None;
        }
        let (node, limit) = (Node::of_motor(hottest), self.limits[hottest]);
        let temperature = self.temperatures[hottest].unwrap_or(limit);
        let cool = limit - COOLING_DISTANCE;
        Some(format!(
            "{node} has {temperature} °C, its limit is {limit} °C, and it has to cool to {cool} °C"
        ))
    }

    /// Returns whether a puck is so hot that the arm has to be braked.
    pub(super) fn brakes(&self) -> bool {
        self.heat.contains(&Heat::Burning)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wam::AXES;

    /// Reads a temperature twice, as the driver does.
    fn read(health: &mut PuckHealth<AXES>, temperature: i32) {
        for _ in 0..2 {
            health.note(3, PuckProperty::TEMP, temperature).unwrap();
        }
    }

    #[test]
    fn a_hot_puck_stops_the_arm_until_it_has_cooled() {
        let mut health = PuckHealth::new([60; AXES]);
        for (temperature, heat) in [
            (54, Heat::Usual),
            (55, Heat::Warned),
            (52, Heat::Warned),
            (59, Heat::Warned),
            (60, Heat::Hot),
            (51, Heat::Hot),
            (69, Heat::Hot),
            (70, Heat::Burning),
            (69, Heat::Hot),
            (51, Heat::Hot),
            (50, Heat::Usual),
            (60, Heat::Hot),
        ] {
            read(&mut health, temperature);
            assert_eq!(health.heat[3], heat, "{temperature}");
            assert_eq!(health.too_hot().is_some(), heat >= Heat::Hot);
            assert_eq!(health.brakes(), heat == Heat::Burning);
        }
        assert_eq!(
            health.too_hot().unwrap(),
            "puck 4 has 60 °C, its limit is 60 °C, and it has to cool to 50 °C"
        );
    }

    #[test]
    fn one_reading_changes_nothing() {
        let mut health = PuckHealth::new([60; AXES]);
        for (property, value) in [
            (PuckProperty::TEMP, 80),
            (PuckProperty::STAT, status::ERROR),
        ] {
            health.note(2, property, value).unwrap();
            assert!(health.is_in_doubt() && health.too_hot().is_none());
            assert_eq!(health.question(), (Node::of_motor(2), property));
            let usual = if property == PuckProperty::TEMP {
                40
            } else {
                status::READY
            };
            health.note(2, property, usual).unwrap();
            assert!(!health.is_in_doubt() && health.too_hot().is_none());
        }
        // A puck that does not answer again does not keep the others from being asked.
        health.note(2, PuckProperty::TEMP, 80).unwrap();
        for _ in 0..MAX_CONFIRMATIONS {
            assert_eq!(health.question(), (Node::of_motor(2), PuckProperty::TEMP));
        }
        assert!(!health.is_in_doubt());
        for nonsense in [-300, 151, 30_000] {
            read(&mut health, nonsense);
            assert!(health.too_hot().is_none());
        }
    }

    #[test]
    fn an_error_state_names_the_puck_and_its_code() {
        let mut health = PuckHealth::new([60; AXES]);
        for _ in 0..2 {
            health.note(6, PuckProperty::ERROR, 17).unwrap();
        }
        health.note(6, PuckProperty::STAT, status::ERROR).unwrap();
        let (node, code) = (Node::of_motor(6), 17);
        assert_eq!(
            health.note(6, PuckProperty::STAT, status::ERROR),
            Err(CanErrorKind::PuckError { node, code })
        );
    }

    #[test]
    fn every_property_of_every_puck_is_asked_in_turn() {
        let mut health = PuckHealth::new([60; AXES]);
        let asked: std::collections::HashSet<_> = (0..AXES * WATCHED.len())
            .map(|_| health.question())
            .collect();
        assert_eq!(asked.len(), AXES * WATCHED.len());
    }

    #[test]
    fn a_limit_that_no_puck_has_is_not_believed() {
        let limits = [Some(55), Some(0), Some(-1), Some(5000), None].map(puck_limit);
        assert_eq!(limits, [55, 60, 60, 60, 60]);
    }
}
