//! Cameras: the server `frameGrabber_nws_yarp` of stock, and its client `frameGrabber_nwc_yarp`.
//!
//! ```text
//!   client                                          server, named /grabber
//!   /local             ◀── images, with stamps ──   /grabber        every period, if there is a new one
//!   /local/rpc_client  ── questions, orders ─────▶  /grabber/rpc    of 3.x and of 4.0, answered one by one
//!                                                   /grabber        takes questions, too, as in stock
//!                                                   /grabber2       sound, on request, as stock's `grabber` of 3.5
//! ```
//!
//! | folder | content |
//! | --- | --- |
//! | [`messages`] | the words and bytes, shared by both sides |
//! | `server` | [`FrameGrabberServer`]: a camera on ports |
//! | `client` | [`RemoteFrameGrabber`]: the remote camera |

mod client;
pub mod messages;
mod server;

pub use client::{RemoteFrameGrabber, RemoteFrameGrabberOptions};
pub use server::{Capability, FrameGrabberOptions, FrameGrabberServer, SoundPort};
