//! Hosting: devices by name from configuration files, and robots made of several of them.
//!
//! * [`kinds`]: the table of devices. A new one is one line there.
//! * [`Hosted`]: a device that is open: what it offers to others, and what it can attach to.
//! * [`open`], [`open_wrapped`]: a device from its parameters, as stock's `yarpdev` opens one.
//! * [`robot`]: descriptions of robots in XML and TOML, and the phases of their lives, as stock's
//!   `yarprobotinterface` runs them.
//!
//! A parameter that is missing or wrong is an error with file and line, and says what was expected.

mod bundle;
mod error;
mod hosted;
pub mod kinds;
mod park;
pub mod robot;

pub use bundle::{open, open_wrapped};
pub use error::HostError;
pub use hosted::{Attached, Future, Hosted, Parts};
pub use park::park;
