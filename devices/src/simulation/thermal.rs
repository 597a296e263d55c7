//! Temperatures of the pucks of simulated motors, and their supply.
//!
//! Each puck with its motor is one body: what flows in the windings heats it with the square of the current, and it gives
//! the heat off in proportion to how warm it is, `T' = (T₀ + R I² - T) / τ`. Of this Barrett publishes `T₀` alone. `R` and
//! `τ` are **assumptions**: the shoulder of an arm that is held stretched out for long, with 1.2 A, comes
//! near what a puck complains about, and it takes minutes. Nothing else depends on it: motors are weaker by the temperature of their
//! windings, in `motor_windings.rs`.

/// Temperature of a puck whose motor is at rest, °C (Barrett's wiki: usually from 40 °C).
pub(crate) const REST_TEMPERATURE: f64 = 40.0;
/// Maximum temperature of a puck, °C (btclient).
pub(crate) const MAX_TEMPERATURE: i32 = 60;
/// Of the bus, V.
pub(crate) const SUPPLY_VOLTAGE: i32 = 48;
/// Steady-state temperature rise of a current, °C/A². Assumed.
const CELSIUS_PER_AMPERE_SQUARED: f64 = 10.0;
/// Time after which 63 % of a change is reached, s. Assumed.
const TIME_CONSTANT: f64 = 300.0;

/// The temperatures of `N` pucks.
#[derive(Clone, Debug)]
pub(super) struct ThermalModel<const N: usize>([f64; N]);

impl<const N: usize> ThermalModel<N> {
    /// Of motors that have rested for long.
    pub(super) fn at_rest() -> Self {
        Self([REST_TEMPERATURE; N])
    }

    /// Lets time pass with these currents, A.
    pub(super) fn advance(&mut self, currents: impl Fn(usize) -> f64, seconds: f64) {
        let share = -(-seconds / TIME_CONSTANT).exp_m1();
        for (motor, now) in self.0.iter_mut().enumerate() {
            let end = REST_TEMPERATURE + CELSIUS_PER_AMPERE_SQUARED * currents(motor).powi(2);
            *now += (end - *now) * share;
        }
    }

    /// °C.
    pub(super) fn temperatures(&self) -> [f64; N] {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_current_warms_its_own_puck_and_rest_cools_it() {
        let mut motors = ThermalModel::<2>::at_rest();
        assert_eq!(
            motors.temperatures(),
            [40.0; 2],
            "at rest, by Barrett's wiki"
        );
        let current = |motor| if motor == 0 { -2.0 } else { 0.0 };
        for _ in 0..(TIME_CONSTANT / 0.1) as usize {
            motors.advance(current, 0.1);
        }
        let [warm, cool] = motors.temperatures();
        assert!(
            (warm - (REST_TEMPERATURE + 4.0 * CELSIUS_PER_AMPERE_SQUARED * 0.632)).abs() < 0.05,
            "{warm}"
        );
        assert_eq!(cool, REST_TEMPERATURE);
        // In steps of any length, and never beyond the end.
        motors.advance(current, 1e9);
        assert_eq!(
            motors.temperatures(),
            [
                REST_TEMPERATURE + 4.0 * CELSIUS_PER_AMPERE_SQUARED,
                REST_TEMPERATURE
            ]
        );
        motors.advance(|_| 0.0, 1e9);
        assert_eq!(motors.temperatures(), [REST_TEMPERATURE; 2]);
    }
}
