//! One joint, several, or all, and the three words that stock has for nearly every call.

use yarp_devices::{Axes, AxisIndex, DeviceError};
use yarp_wire::{Bottle, Value, Vocab32};

use super::number_parsing;

/// The axes a message is about; the owned form of [`Axes`].
#[derive(Clone, Debug, Eq, PartialEq)]
pub enum Selection {
    /// A single axis, on the wire `j`.
    One(AxisIndex),
    /// These axes in this order, on the wire `n (j..)`.
    Group(Vec<AxisIndex>),
    /// Every axis; on the wire nothing.
    All,
}

impl Selection {
    /// The same for a call of a device interface.
    pub fn axes(&self) -> Axes<'_> {
        match self {
            Self::One(axis) => Axes::One(*axis),
            Self::Group(group) => Axes::Group(group),
            Self::All => Axes::All,
        }
    }

    /// The form of a word for it.
    pub(super) fn form(&self) -> Form {
        match self {
            Self::One(_) => Form::One,
            Self::Group(_) => Form::Group,
            Self::All => Form::All,
        }
    }

    /// Appends its encoding on the wire.
    pub(super) fn write(&self, message: &mut Bottle) {
        match self {
            Self::One(axis) => message.push(number_parsing::integer(axis.index())),
            Self::Group(group) => {
                message.push(number_parsing::integer(group.len()));
                let list: Bottle = group
                    .iter()
                    .map(|axis| number_parsing::integer(axis.index()))
                    .collect();
                message.push(list);
            }
            Self::All => {}
        }
    }

    /// Reads it from the front of `items`, in the form that `form` announces.
    pub(super) fn read(form: Form, items: &mut &[Value]) -> Option<Self> {
        Some(match (form, *items) {
            (Form::One, [first, rest @ ..]) => {
                let axis = number_parsing::axis(first)?;
                *items = rest;
                Self::One(axis)
            }
            (Form::Group, [count, list, rest @ ..]) => {
                let axes = list.as_list()?.iter().map(number_parsing::axis);
                let group: Vec<AxisIndex> = axes.collect::<Option<_>>()?;
                // Stock believes the count and reads joint 0 where the list is shorter.
                if number_parsing::count(count)? != group.len() {
                    return None;
                }
                *items = rest;
                Self::Group(group)
            }
            (Form::All, _) => Self::All,
            _ => return None,
        })
    }
}

impl From<Axes<'_>> for Selection {
    fn from(axes: Axes<'_>) -> Self {
        match axes {
            Axes::One(axis) => Self::One(axis),
            Axes::Group(group) => Self::Group(group.to_vec()),
            Axes::All => Self::All,
        }
    }
}

/// The form that a word announces.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Form {
    One,
    Group,
    All,
}

/// The spellings of one call: for one joint, for several, for all. Not every call has all three.
///
/// Those of 3.x are words, those of 4.0 the names of functions.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub struct Forms<T> {
    /// For a single joint.
    pub one: Option<T>,
    /// For several.
    pub group: Option<T>,
    /// For all.
    pub all: Option<T>,
}

impl<T: Copy + PartialEq> Forms<T> {
    pub(super) const NONE: Self = Self {
        one: None,
        group: None,
        all: None,
    };

    pub(super) const fn three(one: T, group: T, all: T) -> Self {
        Self {
            one: Some(one),
            group: Some(group),
            all: Some(all),
        }
    }

    pub(super) const fn two(one: T, all: T) -> Self {
        Self {
            one: Some(one),
            group: None,
            all: Some(all),
        }
    }

    pub(super) const fn only_one(one: T) -> Self {
        Self {
            one: Some(one),
            group: None,
            all: None,
        }
    }

    pub(super) const fn only_all(all: T) -> Self {
        Self {
            one: None,
            group: None,
            all: Some(all),
        }
    }

    /// The form that `spelt` announces, if it is one of these.
    pub(super) fn form(self, spelt: T) -> Option<Form> {
        let named = [
            (self.one, Form::One),
            (self.group, Form::Group),
            (self.all, Form::All),
        ];
        named
            .into_iter()
            .find(|(ours, _)| *ours == Some(spelt))
            .map(|(_, form)| form)
    }

    /// The spelling for a selection.
    pub(super) fn of(self, selection: &Selection) -> Option<T> {
        match selection {
            Selection::One(_) => self.one,
            Selection::Group(_) => self.group,
            Selection::All => self.all,
        }
    }

    /// Returns the selections that express `axes` with existing spellings: usually one.
    ///
    /// Where there is none for several joints, a group of one is sent as one joint, a group of all in order as all,
    /// and all of a board that has only spellings for one are sent one by one if `each` allows it. Otherwise it is
    /// not supported, which names `what` it was.
    pub(crate) fn sayable(
        self,
        axes: Axes<'_>,
        total: usize,
        what: &str,
        each: bool,
    ) -> Result<Vec<Selection>, DeviceError> {
        let selection = Selection::from(axes);
        if self.of(&selection).is_some() {
            return Ok(vec![selection]);
        }
        if let Axes::Group(&[axis]) = axes
            && self.one.is_some()
        {
            return Ok(vec![Selection::One(axis)]);
        }
        if axes.iter(total).eq(Axes::All.iter(total)) && self.all.is_some() {
            return Ok(vec![Selection::All]);
        }
        if each && self.one.is_some() {
            return Ok(axes.iter(total).map(Selection::One).collect());
        }
        Err(DeviceError::NotSupported {
            what: format!("to {what} several joints by one message, but not all,"),
        })
    }
}

/// The words for one call in 3.x.
pub type Words = Forms<Vocab32>;
/// The functions for one call in 4.0, without the `RPC` at the end of their names.
pub type Functions = Forms<&'static str>;
