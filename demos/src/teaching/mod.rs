//! Teach and play: poses and grasps as editable text, played at any speed within the limits of the arm.
//!
//! `yarp teach` stores what the arm was guided to, `yarp play` plays it; `docs/teach-and-play.md` has the file format.

mod motion_file;
mod player;

pub use motion_file::{MotionFile, MotionFileError, Step};
pub use player::{Boards, PlayError, Player};
