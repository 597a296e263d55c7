//! The buttons of the pendant, and the power switch of the arm.

use std::fmt;
use std::str::FromStr;

/// A thing that a person does with the pendant of an arm or its power switch.
///
/// ```
/// use yarp_devices::wam::PendantButton;
///
/// assert_eq!("activate".parse(), Ok(PendantButton::Activate));
/// assert_eq!(PendantButton::PowerOff.to_string(), "power-off");
/// ```
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum PendantButton {
    /// Shift and Idle: out of the emergency stop too.
    Idle,
    /// Shift and Activate.
    Activate,
    /// The red button, which cuts the power of the motors' pucks.
    Stop,
    /// Switches the whole arm off.
    PowerOff,
    /// Switches it on again: its pucks monitor, and know no position.
    PowerOn,
}

/// Words for the buttons.
const WORDS: [(&str, PendantButton); 5] = [
    ("idle", PendantButton::Idle),
    ("activate", PendantButton::Activate),
    ("stop", PendantButton::Stop),
    ("power-off", PendantButton::PowerOff),
    ("power-on", PendantButton::PowerOn),
];

impl PendantButton {
    /// Returns what is expected in place of a word that is none of a button.
    pub(super) fn expected() -> String {
        format!("one of {}", WORDS.map(|(word, _)| word).join(", "))
    }
}

impl FromStr for PendantButton {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = WORDS.iter().find(|(word, _)| *word == text);
        found.map(|(_, button)| *button).ok_or_else(Self::expected)
    }
}

impl fmt::Display for PendantButton {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let named = WORDS.iter().find(|(_, button)| button == self);
        f.write_str(named.map_or("", |(word, _)| word))
    }
}
