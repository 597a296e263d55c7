//! Tools that move in space, on the ports of iCub's cartesian controller.
//!
//! | folder | content |
//! | --- | --- |
//! | `messages` | messages |
//! | `server` | a controller on ports |
//! | `client` | a controller in another program |
//! | `cartesian_version` | the protocol versions |
//!
//! **Invariant:** a malformed message is answered `[nack]`, or dropped where nobody waits for an answer, and never moves
//! anything.

mod cartesian_version;
mod client;
pub mod messages;
mod server;

pub use cartesian_version::CartesianVersion;
pub use client::{RemoteCartesianControl, RemoteCartesianOptions};
pub use server::{CartesianServer, CartesianServerOptions};
