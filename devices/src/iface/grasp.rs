//! Grasping.

use std::fmt;

use crate::DeviceError;

/// Grasps by name, and whether something was grasped (tables 3 and 19 of the thesis; no stock interface is like it).
///
/// Calls block until the motion has ended; [`Hand::abort`](crate::Hand::abort) ends them at once.
pub trait Grasp: Send + Sync {
    /// Opens the fingers, not the spread (`gopen`).
    ///
    /// Errors: [`DeviceError::Remote`], as of all calls here, with the hand's own complaint as its source.
    fn open_fingers(&self) -> Result<(), DeviceError>;

    /// Closes the fingers until they are blocked (`gclose`).
    fn close_fingers(&self) -> Result<(), DeviceError>;

    /// Closes the fingers and ends with controlled torque where they are blocked (`torquegclose`).
    fn close_fingers_with_torque(&self) -> Result<(), DeviceError>;

    /// Goes through the motions of a grasp.
    fn grasp(&self, kind: GraspKind) -> Result<(), DeviceError>;

    /// Returns the distance of each motor from its expected position, degrees; 0 for a motor without expectation
    /// (`checkGrasp`).
    ///
    /// A finger that holds something stays behind: its difference is negative.
    fn check_grasp(&self, expected: [Option<f64>; 4]) -> Result<[f64; 4], DeviceError>;
}

/// A grasp with a name.
///
/// ```
/// use yarp_devices::GraspKind;
///
/// assert_eq!("peg_close".parse(), Ok(GraspKind::PegClose));
/// assert_eq!(GraspKind::OpenWide.to_string(), "open_wide");
/// ```
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[non_exhaustive]
pub enum GraspKind {
    /// Opens fingers and spread.
    OpenWide,
    /// Puts the fingers equally far from each other.
    Isometric,
    /// Puts fingers 1 and 2 at a right angle to finger 3.
    Rectangular,
    /// Puts all fingers on one side, against the palm.
    Palm,
    /// Brings finger 3 opposite to fingers 1 and 2, almost closed.
    Needle,
    /// Brings finger 1 opposite to finger 2, almost closed.
    Peg,
    /// Closes fingers 1 and 2.
    PegClose,
}

impl GraspKind {
    /// All of them.
    pub const ALL: [GraspKind; 7] = [
        GraspKind::OpenWide,
        GraspKind::Isometric,
        GraspKind::Rectangular,
        GraspKind::Palm,
        GraspKind::Needle,
        GraspKind::Peg,
        GraspKind::PegClose,
    ];

    /// Its name on the network.
    pub const fn name(self) -> &'static str {
        match self {
            GraspKind::OpenWide => "open_wide",
            GraspKind::Isometric => "isometric",
            GraspKind::Rectangular => "rectangular",
            GraspKind::Palm => "palm",
            GraspKind::Needle => "needle",
            GraspKind::Peg => "peg",
            GraspKind::PegClose => "peg_close",
        }
    }
}

impl fmt::Display for GraspKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl std::str::FromStr for GraspKind {
    type Err = UnknownGrasp;

    fn from_str(name: &str) -> Result<Self, UnknownGrasp> {
        GraspKind::ALL
            .into_iter()
            .find(|kind| kind.name() == name)
            .ok_or(UnknownGrasp)
    }
}

/// No grasp has this name.
#[derive(Clone, Copy, Debug, Eq, PartialEq, thiserror::Error)]
#[error("no such grasp; there are open_wide, isometric, rectangular, palm, needle, peg, peg_close")]
pub struct UnknownGrasp;
