//! Devices that work by themselves once their host has started them ([`Service`](crate::Service)).
//!
//! ```text
//! host ── start, update .., stop ──▶ DeviceGroup ──▶ DevicePipe: source ──▶ sink
//! ```
//!
//! | file | content |
//! | --- | --- |
//! | `device_pipe` | [`DevicePipe`]: passes images and sound of one device on to another |
//! | `device_group` | [`DeviceGroup`]: the services of several devices as one |
//!
//! Neither has a thread or waits: both work during updates.

mod device_group;
mod device_pipe;

pub use device_group::DeviceGroup;
pub use device_pipe::{DevicePipe, PipedContent};
