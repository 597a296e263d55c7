//! One joint, several, or all, and the three words that stock has for nearly every call.

use yarp_devices::{Axes, AxisIndex, DeviceError};
use yarp_wire::{Bottle, Value, Vocab32};

use super::number;

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

    /// Appends what stands for it on the wire.
    pub(super) fn write(&self, message: &mut Bottle) {
        match self {
            Self::One(axis) => message.push(number::integer(axis.index())),
            Self::Group(group) => {
                message.push(number::integer(group.len()));
                let list: Bottle = group
                    .iter()
                    .map(|axis| number::integer(axis.index()))
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
                let axis = number::axis(first)?;
                *items = rest;
                Self::One(axis)
            }
            (Form::Group, [count, list, rest @ ..]) => {
                let axes = list.as_list()?.iter().map(number::axis);
                let group: Vec<AxisIndex> = axes.collect::<Option<_>>()?;
                // Stock believes the count and reads joint 0 where the list is shorter.
                if number::count(count)? != group.len() {
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

/// Which of the three forms a word announces.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Form {
    One,
    Group,
    All,
}

/// The words for one call: for one joint, for several, for all. Not every call has all three.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub struct Words {
    /// For a single joint.
    pub one: Option<Vocab32>,
    /// For several.
    pub group: Option<Vocab32>,
    /// For all.
    pub all: Option<Vocab32>,
}

impl Words {
    pub(super) const fn three(one: Vocab32, group: Vocab32, all: Vocab32) -> Self {
        Self {
            one: Some(one),
            group: Some(group),
            all: Some(all),
        }
    }

    pub(super) const fn two(one: Vocab32, all: Vocab32) -> Self {
        Self {
            one: Some(one),
            group: None,
            all: Some(all),
        }
    }

    pub(super) const fn only_all(all: Vocab32) -> Self {
        Self {
            one: None,
            group: None,
            all: Some(all),
        }
    }

    /// The form that `word` announces, if it is one of these.
    pub(super) fn form(self, word: Vocab32) -> Option<Form> {
        let named = [
            (self.one, Form::One),
            (self.group, Form::Group),
            (self.all, Form::All),
        ];
        named
            .into_iter()
            .find(|(ours, _)| *ours == Some(word))
            .map(|(_, form)| form)
    }

    /// The word for a selection.
    pub(super) fn word(self, selection: &Selection) -> Option<Vocab32> {
        match selection {
            Selection::One(_) => self.one,
            Selection::Group(_) => self.group,
            Selection::All => self.all,
        }
    }

    /// The selection that says the same with a word that exists, or why there is none.
    ///
    /// Where stock has no word for several joints, a group of one is said as one joint and a group of all in order
    /// as all.
    pub(crate) fn sayable(
        self,
        axes: Axes<'_>,
        total: usize,
        what: &str,
    ) -> Result<Selection, DeviceError> {
        let selection = Selection::from(axes);
        if self.word(&selection).is_some() {
            return Ok(selection);
        }
        if let Axes::Group(&[axis]) = axes
            && self.one.is_some()
        {
            return Ok(Selection::One(axis));
        }
        if axes.iter(total).eq(Axes::All.iter(total)) && self.all.is_some() {
            return Ok(Selection::All);
        }
        Err(DeviceError::NotSupported {
            what: format!("to {what} several joints by one message, but not all,"),
        })
    }
}
