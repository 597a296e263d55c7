//! Selects the axes of a call: one, several, or all of them.
//!
//! The stock interfaces have three overloads of nearly every method. Here they are one method with a selector.

use std::fmt;

use crate::DeviceError;

/// The number of an axis on its device, counted from 0.
///
/// Whether the device has such an axis is checked by the call that gets it.
///
/// ```
/// use yarp_devices::AxisIndex;
///
/// let elbow = AxisIndex::from(3);
/// assert_eq!(elbow.to_string(), "3");
/// ```
#[derive(Clone, Copy, Debug, Default, Eq, Hash, Ord, PartialEq, PartialOrd)]
pub struct AxisIndex(usize);

impl AxisIndex {
    /// The axis with this number, counted from 0.
    pub const fn new(index: usize) -> Self {
        Self(index)
    }

    /// The number itself, for indexing.
    pub const fn index(self) -> usize {
        self.0
    }
}

impl From<usize> for AxisIndex {
    fn from(index: usize) -> Self {
        Self(index)
    }
}

impl fmt::Display for AxisIndex {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// The axes of a call, in the order of its values.
///
/// ```
/// use yarp_devices::{Axes, AxisIndex};
///
/// let wrist = [AxisIndex::from(4), AxisIndex::from(5)];
/// assert_eq!(Axes::Group(&wrist).len(7), 2);
/// assert_eq!(Axes::All.iter(7).count(), 7);
/// assert!(Axes::One(9.into()).check(7).is_err());
/// ```
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Axes<'a> {
    /// A single axis.
    One(AxisIndex),
    /// These axes, in this order. May be empty: such a call does nothing and succeeds.
    Group(&'a [AxisIndex]),
    /// Every axis, in ascending order.
    All,
}

impl<'a> Axes<'a> {
    /// Returns the number of values that belong to this selection on a device with `total` axes.
    pub fn len(self, total: usize) -> usize {
        match self {
            Axes::One(_) => 1,
            Axes::Group(group) => group.len(),
            Axes::All => total,
        }
    }

    /// The selected axes in the order of their values; they are not checked.
    pub fn iter(self, total: usize) -> impl Iterator<Item = AxisIndex> + 'a {
        (0..self.len(total)).map(move |place| match self {
            Axes::One(axis) => axis,
            Axes::Group(group) => group[place],
            Axes::All => AxisIndex(place),
        })
    }

    /// Checks that a device with `total` axes has each of these: sufficient for a query.
    ///
    /// An axis named twice is fine here; the answer then holds its value twice.
    ///
    /// Errors: [`DeviceError::NoSuchAxis`] for the first that is missing.
    pub fn check(self, total: usize) -> Result<(), DeviceError> {
        match self.iter(total).find(|axis| axis.0 >= total) {
            Some(asked) => Err(DeviceError::NoSuchAxis { asked, axes: total }),
            None => Ok(()),
        }
    }

    /// Checks a command: each axis exists, none is named twice, and there is one value for each.
    ///
    /// * `values`: how many values came with the command; `what`: what they are, for the error.
    /// * Errors: [`DeviceError::NoSuchAxis`], [`DeviceError::RepeatedAxis`] (two commands for one joint contradict
    ///   each other), [`DeviceError::WrongCount`].
    pub fn check_command(
        self,
        total: usize,
        what: &'static str,
        values: usize,
    ) -> Result<(), DeviceError> {
        self.check(total)?;
        if let Axes::Group(group) = self {
            // The first repeat comes after at most `total` axes, so a long group costs no more than that.
            for (place, &joint) in group.iter().enumerate() {
                if group[..place].contains(&joint) {
                    return Err(DeviceError::RepeatedAxis { joint });
                }
            }
        }
        self.check_count(total, what, values)
    }

    /// Checks the values of a command, one for each axis; `quantity`: what one is, for the error.
    ///
    /// Errors: [`DeviceError::NotFinite`].
    pub fn check_finite(
        self,
        total: usize,
        quantity: &'static str,
        values: &[f64],
    ) -> Result<(), DeviceError> {
        let mut pairs = self.iter(total).zip(values);
        match pairs.find(|(_, value)| !value.is_finite()) {
            Some((joint, &asked)) => Err(DeviceError::NotFinite {
                joint,
                quantity,
                asked,
            }),
            None => Ok(()),
        }
    }

    /// Checks that there is exactly one value, or one slot for an answer, per selected axis.
    ///
    /// Errors: [`DeviceError::WrongCount`].
    pub fn check_count(
        self,
        total: usize,
        what: &'static str,
        got: usize,
    ) -> Result<(), DeviceError> {
        let expected = self.len(total);
        if got == expected {
            Ok(())
        } else {
            Err(DeviceError::WrongCount {
                what,
                expected,
                got,
            })
        }
    }
}

impl From<AxisIndex> for Axes<'_> {
    fn from(axis: AxisIndex) -> Self {
        Axes::One(axis)
    }
}

impl<'a> From<&'a [AxisIndex]> for Axes<'a> {
    fn from(group: &'a [AxisIndex]) -> Self {
        Axes::Group(group)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn indices(numbers: &[usize]) -> Vec<AxisIndex> {
        numbers.iter().copied().map(AxisIndex::from).collect()
    }

    #[test]
    fn lists_the_axes_in_order() {
        let check = |axes: Axes<'_>, expected: &[usize]| {
            assert_eq!(axes.iter(3).collect::<Vec<_>>(), indices(expected));
            assert_eq!(axes.len(3), expected.len());
        };
        check(Axes::One(2.into()), &[2]);
        check(Axes::Group(&indices(&[2, 0])), &[2, 0]);
        check(Axes::Group(&[]), &[]);
        check(Axes::All, &[0, 1, 2]);
    }

    #[test]
    fn names_what_is_wrong_with_a_command() {
        let check = |axes: Axes<'_>, values: usize, expected: &str| {
            let outcome = axes.check_command(3, "positions", values);
            let message = outcome.map_or_else(|error| error.to_string(), |()| String::new());
            assert_eq!(message, expected);
        };
        check(Axes::All, 3, "");
        check(Axes::One(2.into()), 1, "");
        check(Axes::Group(&indices(&[2, 0])), 2, "");
        check(Axes::Group(&[]), 0, "");
        check(
            Axes::One(3.into()),
            1,
            "no joint 3: the device has 3, counted from 0",
        );
        check(
            Axes::Group(&indices(&[0, 7])),
            2,
            "no joint 7: the device has 3, counted from 0",
        );
        check(
            Axes::Group(&indices(&[1, 0, 1])),
            3,
            "joint 1 is named twice in one command",
        );
        check(Axes::All, 2, "expected 3 positions, got 2");
    }

    #[test]
    fn a_question_may_name_an_axis_twice() {
        assert!(Axes::Group(&indices(&[1, 1])).check(3).is_ok());
    }
}
