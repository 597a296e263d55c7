//! A hand without the hand: firmware, motors and a serial line, real enough for a driver not to notice.
//!
//! | file | what it is about |
//! | --- | --- |
//! | `motor` | one motor: way, speed, stops, an object in its way, the clutch |
//! | `settings` | the values of parameters |
//! | `firmware` | the interpreter: bytes and time in, bytes out; no line, no clock |
//! | `motion` | what a command makes the motors do, and when that has ended |
//! | `noise` | a bad line |
//! | `terminal` | a pseudo-terminal, to be opened as any serial line |
//! | `hand` | a thread that joins them, at the speed of the line |
//!
//! What no source tells is a choice: the factory's values of most parameters, how fast a unit of speed is, when the
//! clutch lets go, how hot motors get, and what text stands in banner and lists.

mod firmware;
mod hand;
mod motion;
mod motor;
mod noise;
mod settings;
mod terminal;

pub use firmware::Firmware;
pub use hand::{SimulatedHand, SimulatedHandOptions};
pub use motor::{BREAKAWAY_TORQUE, Object};
pub use noise::Noise;
