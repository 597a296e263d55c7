//! A hand without the hand: firmware, motors and a serial line, real enough for a driver not to notice.
//!
//! | file | content |
//! | --- | --- |
//! | `simulated_motor` | one motor: range, speed, stops, an object that blocks it, the clutch |
//! | `parameter_values` | the values of parameters |
//! | `firmware` | the interpreter: bytes and time in, bytes out; no serial line, no clock |
//! | `hand_motion` | motions of the motors for a command, and their ends |
//! | `line_noise` | noise on the line |
//! | `pseudo_terminal` | a pseudo-terminal, to be opened as any serial line |
//! | `simulated_hand` | the thread that runs them, at the baud rate of the line |
//!
//! Values without a source are choices: the factory's values of most parameters, the unit of speed, the release of
//! the clutch, the temperatures of motors, and the texts of banner and lists.

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
pub use simulated_motor::{BREAKAWAY_TORQUE, Load, Object, STALL_TORQUE};
