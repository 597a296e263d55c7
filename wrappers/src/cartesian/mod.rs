//! Tools that move in space, on the ports of iCub's cartesian controller.
//!
//! | folder | what it is about |
//! | --- | --- |
//! | `messages` | what is said |
//! | `server` | a controller on ports |
//! | `client` | a controller in another program |
//! | `version` | what the two say which protocol this is |
//!
//! **Invariant:** a malformed message is answered `[nack]`, or dropped where nobody waits for an answer, and never moves
//! anything.

mod client;
pub mod messages;
mod server;
mod version;

pub use client::{RemoteCartesianControl, RemoteCartesianOptions};
pub use server::{CartesianServer, CartesianServerOptions};
pub use version::CartesianVersion;
