//! Spelling of a request in both wire versions.

use yarp_devices::{Axes, DeviceError};
use yarp_wire::{Vocab32, WireVersion};

use super::axis_selection::{Forms, Functions, Selection, Words};

/// Prefix in the table of a request whose word is the first item of its message.
pub(super) const FIRST: &str = "*";

/// Spelling of a request.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spelling {
    /// In 3.x the word in front of the others, if there is one.
    pub(crate) interface: Option<Vocab32>,
    /// True if the word is the first item of the message in 3.x.
    pub(crate) first: bool,
    pub(crate) words: Words,
    pub(crate) functions: Functions,
}

impl Spelling {
    /// Reads the columns of a row: `""` stands for a missing form or prefix.
    pub(super) const fn of_row(
        prefix: &'static str,
        [one, group, all]: [&'static str; 3],
        functions: [&'static str; 3],
    ) -> Self {
        let first = prefix.len() == 1 && prefix.as_bytes()[0] == FIRST.as_bytes()[0];
        Self {
            interface: if first { None } else { word(prefix) },
            first,
            words: Forms {
                one: word(one),
                group: word(group),
                all: word(all),
            },
            functions: Forms {
                one: function(functions[0]),
                group: function(functions[1]),
                all: function(functions[2]),
            },
        }
    }

    /// The selections that mean these joints to a board of this wire version, see [`Forms::sayable`].
    pub(crate) fn sayable(
        self,
        wire_version: WireVersion,
        axes: Axes<'_>,
        total: usize,
        what: &str,
        each: bool,
    ) -> Result<Vec<Selection>, DeviceError> {
        match wire_version {
            WireVersion::V3 => self.words.sayable(axes, total, what, each),
            WireVersion::V4 => self.functions.sayable(axes, total, what, each),
        }
    }
}

const fn word(text: &'static str) -> Option<Vocab32> {
    if text.is_empty() {
        None
    } else {
        Some(Vocab32::new(text))
    }
}

const fn function(name: &'static str) -> Option<&'static str> {
    if name.is_empty() { None } else { Some(name) }
}
