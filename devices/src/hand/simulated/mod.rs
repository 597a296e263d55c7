//! A hand without the hand: firmware, motors and a serial line, real enough for a driver not to notice.
//!
//! | file | what it is about |
//! | --- | --- |
//! | `simulated_motor` | one motor: way, speed, stops, an object in its way, the clutch |
//! | `parameter_values` | the values of parameters |
//! | `firmware` | the interpreter: bytes and time in, bytes out; no line, no clock |
//! | `hand_motion` | what a command makes the motors do, and when that has ended |
//! | `line_noise` | a bad line |
//! | `pseudo_terminal` | a pseudo-terminal, to be opened as any serial line |
//! | `simulated_hand` | a thread that joins them, at the speed of the line |
//!
//! What no source tells is a choice: the factory's values of most parameters, how fast a unit of speed is, when the
//! clutch lets go, how hot motors get, and what text stands in banner and lists.

mod firmware;
mod hand_motion;
mod line_noise;
mod parameter_values;
mod pseudo_terminal;
mod simulated_hand;
mod simulated_motor;

pub use firmware::Firmware;
pub use line_noise::Noise;
pub use simulated_hand::{SimulatedHand, SimulatedHandOptions};
pub use simulated_motor::{BREAKAWAY_TORQUE, Object};
