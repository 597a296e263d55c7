//! The time of a clock on the network: what `YARP_CLOCK` asks for.
//!
//! | file | content |
//! | --- | --- |
//! | `clock_follower` | the port that receives the messages of a clock, and its connection |
//! | `clock_message` | a message of a clock |
//! | `stall_monitor` | reports of a clock that stands still |
//! | `process_clock` | the clock that this process follows |

mod clock_follower;
mod clock_message;
mod process_clock;
mod stall_monitor;

pub use clock_follower::{ClockError, ClockFollower, FollowOptions};
pub use process_clock::{close, follow, follow_until, sleep, sleep_until};
