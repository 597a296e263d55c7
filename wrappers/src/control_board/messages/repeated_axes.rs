//! Commands that name an axis twice.
//!
//! Stock's server passes them on, and devices execute them in order. Programs rely on that by accident: roboticslab's
//! `exampleRemoteControlboardModule` moves axes `(1 1)` to `(-3 -3)`.

use std::borrow::Cow;
use std::collections::HashMap;
use std::collections::hash_map::Entry;

use yarp_devices::AxisIndex;

use super::axis_selection::Selection;
use super::request_table::{Set, Setting};

impl Set {
    /// Returns the command without repetitions: an axis with a value that it already has in the same command.
    ///
    /// A command with two different values for an axis is returned as it is, for the device to refuse; so is a
    /// relative move, whose distances would add up.
    pub fn without_repetitions(&self) -> Cow<'_, Self> {
        let shorter = match self {
            Self::Values(Setting::Distance, ..) => None,
            Self::Values(setting, Selection::Group(axes), values) => distinct(axes, values)
                .map(|(axes, values)| Self::Values(*setting, Selection::Group(axes), values)),
            Self::ControlModes(Selection::Group(axes), modes) => distinct(axes, modes)
                .map(|(axes, modes)| Self::ControlModes(Selection::Group(axes), modes)),
            Self::Interactions(Selection::Group(axes), interactions) => {
                distinct(axes, interactions).map(|(axes, interactions)| {
                    Self::Interactions(Selection::Group(axes), interactions)
                })
            }
            _ => None,
        };
        shorter.map_or(Cow::Borrowed(self), Cow::Owned)
    }
}

/// Returns the axes and values without repetitions; `None` if nothing can be left out.
fn distinct<T: Clone + PartialEq>(
    axes: &[AxisIndex],
    values: &[T],
) -> Option<(Vec<AxisIndex>, Vec<T>)> {
    if axes.len() != values.len() {
        return None;
    }
    let mut first = HashMap::with_capacity(axes.len());
    let mut kept = (Vec::new(), Vec::new());
    for (axis, value) in axes.iter().zip(values) {
        match first.entry(*axis) {
            Entry::Vacant(entry) => {
                entry.insert(value);
                kept.0.push(*axis);
                kept.1.push(value.clone());
            }
            Entry::Occupied(entry) if *entry.get() == value => {}
            Entry::Occupied(_) => return None,
        }
    }
    (kept.0.len() < axes.len()).then_some(kept)
}

#[cfg(test)]
mod tests {
    use yarp_devices::Mode;

    use super::*;

    fn group(axes: &[usize]) -> Selection {
        Selection::Group(axes.iter().copied().map(AxisIndex::from).collect())
    }

    #[test]
    fn an_axis_keeps_its_first_mention() {
        let values = |setting, axes: &[usize], values: &[f64]| {
            Set::Values(setting, group(axes), values.to_vec())
        };
        let check = |set: &Set, expected: Set| assert_eq!(*set.without_repetitions(), expected);
        check(
            &values(Setting::Position, &[1, 1], &[-3.0, -3.0]),
            values(Setting::Position, &[1], &[-3.0]),
        );
        check(
            &values(
                Setting::Velocity,
                &[2, 0, 2, 1, 0],
                &[5.0, 6.0, 5.0, 5.0, 6.0],
            ),
            values(Setting::Velocity, &[2, 0, 1], &[5.0, 6.0, 5.0]),
        );
        check(
            &Set::ControlModes(group(&[1, 1]), vec![Mode::Velocity; 2]),
            Set::ControlModes(group(&[1]), vec![Mode::Velocity]),
        );
        let stiff = yarp_devices::Interaction::Stiff;
        check(
            &Set::Interactions(group(&[1, 0, 1]), vec![stiff; 3]),
            Set::Interactions(group(&[1, 0]), vec![stiff; 2]),
        );
    }

    #[test]
    fn what_contradicts_itself_or_adds_up_stays() {
        let unchanged = |set: Set| {
            assert!(
                matches!(set.without_repetitions(), Cow::Borrowed(_)),
                "{set:?}"
            );
        };
        let values = |setting, axes: &[usize], values: &[f64]| {
            Set::Values(setting, group(axes), values.to_vec())
        };
        unchanged(values(Setting::Position, &[1, 1], &[-3.0, 3.0]));
        unchanged(values(Setting::Position, &[1, 1, 1], &[-3.0, -3.0, 3.0]));
        unchanged(values(Setting::Position, &[1, 1], &[f64::NAN; 2]));
        unchanged(values(Setting::Position, &[1, 1], &[-3.0]));
        unchanged(values(Setting::Position, &[1, 0], &[-3.0, -3.0]));
        unchanged(values(Setting::Distance, &[1, 1], &[-3.0, -3.0]));
        unchanged(Set::ControlModes(
            group(&[1, 1]),
            vec![Mode::Velocity, Mode::Position],
        ));
        unchanged(Set::Values(Setting::Position, Selection::All, vec![1.0; 2]));
    }
}
