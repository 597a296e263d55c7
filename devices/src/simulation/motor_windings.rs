//! Windings of motors: they heat up, and limit the current of a motor that turns.
//!
//! The current heats a winding with its resistance, which grows with the temperature as that of copper does, and it gives the heat off
//! in proportion to its temperature: `T' = (T₀ + R_th R(T) I² - T) / τ`. The magnets are taken to be as warm as the winding, and lose
//! strength as ferrite does; in truth they lag behind. A puck controls the current, so that a warm motor has less torque for
//! the same command. The supply drives a current against resistance and back EMF: `|R I + k ω| <= V`.

use super::{ArmEffects, Winding};
use crate::Limits;

/// Temperature of the surroundings, at which resistances and torques are given, °C.
const REFERENCE_TEMPERATURE: f64 = 25.0;
/// Change of the resistance of copper, 1/°C.
const COPPER: f64 = 0.00393;
/// Change of the strength of ferrite magnets, 1/°C. The magnets of the arm are ceramic (D1001, appendix C).
const FERRITE: f64 = -0.002;

/// The windings of `N` motors.
#[derive(Clone, Debug)]
pub(super) struct MotorWindings<const N: usize> {
    windings: Option<[Winding; N]>,
    temperatures: [f64; N],
}

impl<const N: usize> MotorWindings<N> {
    /// Motors that have rested for long.
    pub(super) fn at_rest(effects: &ArmEffects) -> Self {
        Self {
            windings: effects.windings.map(|table| {
                std::array::from_fn(|motor| table.get(motor).copied().unwrap_or_default())
            }),
            temperatures: [REFERENCE_TEMPERATURE; N],
        }
    }

    /// Lets time pass with these currents, A.
    pub(super) fn advance(&mut self, currents: impl Fn(usize) -> f64, seconds: f64) {
        let Some(windings) = &self.windings else {
            return;
        };
        for (motor, winding) in windings.iter().enumerate() {
            if winding.time_constant <= 0.0 {
                continue;
            }
            let now = &mut self.temperatures[motor];
            let power = resistance(winding, *now) * currents(motor).powi(2);
            let end = REFERENCE_TEMPERATURE + winding.thermal_resistance * power;
            *now += (end - *now) * -(-seconds / winding.time_constant).exp_m1();
        }
    }

    /// Returns the torque of a motor as a share of that of a cold one.
    pub(super) fn strength(&self, motor: usize) -> f64 {
        1.0 + FERRITE * (self.temperatures[motor] - REFERENCE_TEMPERATURE)
    }

    /// Returns the currents that a supply, V, drives through a motor at a speed, A; `None` without a limit.
    pub(super) fn current_range(&self, motor: usize, speed: f64, supply: f64) -> Option<Limits> {
        let winding = self.windings.as_ref()?[motor];
        if supply <= 0.0 || winding.resistance <= 0.0 {
            return None;
        }
        let resistance = resistance(&winding, self.temperatures[motor]);
        let back = winding.back_emf * speed;
        Some(Limits::new(
            (-supply - back) / resistance,
            (supply - back) / resistance,
        ))
    }

    /// °C.
    pub(super) fn temperatures(&self) -> [f64; N] {
        self.temperatures
    }
}

/// Returns the resistance of a winding at a temperature, ohm.
fn resistance(winding: &Winding, temperature: f64) -> f64 {
    winding.resistance * (1.0 + COPPER * (temperature - REFERENCE_TEMPERATURE))
}
