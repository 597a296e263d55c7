//! Predicts refusals of devices, as far as that is possible beforehand.
//!
//! It never refuses: it only decides which device is called first. The knowledge may be outdated, since others can
//! change limits too; it is discarded after every refusal.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

use super::Remapper;
use super::axis_mapping::{DeviceAxis, DeviceShare};
use crate::{Device, Limits, Mode};

/// The quantity of values.
#[derive(Clone, Copy, Eq, Hash, PartialEq)]
pub(super) enum Quantity {
    Position,
    /// Of either sign.
    Velocity,
    Torque,
    Current,
    DutyCycle,
    /// Anything above zero.
    Positive,
    /// Any number.
    Finite,
}

/// The ranges that devices reported; `None` from one that does not report it.
#[derive(Default)]
pub(super) struct Ranges(Mutex<HashMap<(Quantity, DeviceAxis), Option<Limits>>>);

impl Ranges {
    /// Forgets all.
    pub(super) fn forget(&self) {
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clear();
    }
}

impl Remapper {
    /// Returns whether a device has reason to refuse one of these values.
    pub(super) fn beyond(
        &self,
        quantity: Quantity,
        share: &DeviceShare<'_>,
        values: &[f64],
    ) -> bool {
        share.theirs.iter().zip(values).any(|(axis, value)| {
            let place = DeviceAxis {
                part: share.number,
                axis: *axis,
            };
            let range = self.range(quantity, place, share.part.device.as_ref());
            !value.is_finite() || range.is_some_and(|range| !range.contains(*value))
        })
    }

    fn range(&self, quantity: Quantity, place: DeviceAxis, device: &dyn Device) -> Option<Limits> {
        let axis = place.axis;
        let ask = || match quantity {
            Quantity::Position => device.control_limits()?.position_limits(axis).ok(),
            Quantity::Velocity => {
                let most = device.control_limits()?.velocity_limits(axis).ok()?.max;
                Some(Limits::new(-most, most))
            }
            Quantity::Torque => {
                let ranges = device.torque_control()?.torque_ranges(axis.into()).ok()?;
                ranges.first().copied()
            }
            Quantity::Current => {
                let ranges = device.current_control()?.current_ranges(axis.into()).ok()?;
                ranges.first().copied()
            }
            Quantity::DutyCycle => Some(Limits::new(-100.0, 100.0)),
            Quantity::Positive => Some(Limits::new(f64::MIN_POSITIVE, f64::MAX)),
            Quantity::Finite => None,
        };
        let lock = || self.known.0.lock().unwrap_or_else(PoisonError::into_inner);
        let known = lock().get(&(quantity, place)).copied();
        known.unwrap_or_else(|| {
            // Without the lock: a device behind a network takes its time.
            let range = ask();
            lock().insert((quantity, place), range);
            range
        })
    }

    /// Returns whether one of the joints was last seen in another mode.
    pub(super) fn in_other_mode(&self, share: &DeviceShare<'_>, needed: Mode) -> bool {
        let Some(modes) = share.part.device.control_mode() else {
            return false;
        };
        let now = modes.control_modes(share.axes());
        now.is_ok_and(|now| now.iter().any(|mode| *mode != needed))
    }

    /// Returns whether a device does not list one of the modes for its joint.
    pub(super) fn lacks_modes(&self, share: &DeviceShare<'_>, modes: &[Mode]) -> bool {
        let Some(control) = share.part.device.control_mode() else {
            return false;
        };
        share.theirs.iter().zip(modes).any(|(axis, mode)| {
            let available = control.available_control_modes(*axis);
            *mode != Mode::ForceIdle && available.is_ok_and(|available| !available.contains(mode))
        })
    }

    /// The places that relative moves lead to; none if they are not known.
    pub(super) fn arrivals(&self, share: &DeviceShare<'_>, distances: &[f64]) -> Vec<f64> {
        let encoders = share.part.device.encoders();
        let here = encoders.and_then(|encoders| encoders.encoder_readings(share.axes()).ok());
        let here = here.unwrap_or_default();
        let pairs = here.iter().zip(distances);
        pairs
            .map(|(here, distance)| here.position + distance)
            .collect()
    }
}

/// The modes in which joints are at rest.
pub(super) fn are_rest(modes: &[Mode]) -> bool {
    let rest = [Mode::Idle, Mode::ForceIdle];
    modes.iter().all(|mode| rest.contains(mode))
}
