//! Options of the driver on its bus.

use std::time::Duration;

use crate::simulation::SafetyLimits;
use crate::wam::AXES;

/// Options of an arm on CAN.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CanOptions {
    /// From one torque to the next; 2 ms or less.
    pub period: Duration,
    /// Timeout of the positions of a period; later replies are ignored. Seven of them take 0.6 ms on the wire.
    pub reply_timeout: Duration,
    /// Maximum number of consecutive periods without a reply of a puck.
    pub max_missed_replies: u32,
    /// Timeout of the reply to a query, which is sent three times.
    pub property_timeout: Duration,
    /// Time for which each of the 31 nodes is listened for when pucks are searched.
    pub scan_interval: Duration,
    /// Maximum time that pucks take to wake, after a first second in which the driver sends nothing.
    pub wake_timeout: Duration,
    /// Interval between attempts after a failure.
    pub retry_interval: Duration,
    /// Value of [`MECH`](crate::can::puck::PuckProperty::MECH) of each puck when the arm is exactly at home: then it
    /// may be folded by hand to within half a turn of its rotors. Without it, the folded pose is assumed to be exact.
    ///
    /// These are not the numbers of libbarrett's `zerocal.conf`: its `zeroangle` is the angle of the rotor with the
    /// joint at zero, not at home.
    pub home_marks: Option<[i32; AXES]>,
    /// Confirms that the arm is folded in its home pose at the start of the driver, as
    /// [`CanWam::confirm_home`](super::CanWam::confirm_home) does later. Without it and without
    /// [`home_marks`](Self::home_marks) the driver starts, but the arm stays unreachable until somebody confirms. Not
    /// for a program that is restarted automatically: nobody looks at the arm then.
    pub home_confirmed: bool,
    /// Limits of the safety module; its heartbeat cannot be set.
    pub limits: SafetyLimits,
}

/// 500 Hz as libbarrett, and the limits that the safety module has at power-up.
impl Default for CanOptions {
    fn default() -> Self {
        Self {
            period: Duration::from_millis(2),
            reply_timeout: Duration::from_micros(1500),
            max_missed_replies: 10,
            property_timeout: Duration::from_millis(50),
            scan_interval: Duration::from_millis(2),
            wake_timeout: Duration::from_secs(2),
            retry_interval: Duration::from_millis(500),
            home_marks: None,
            home_confirmed: false,
            limits: SafetyLimits::default(),
        }
    }
}
