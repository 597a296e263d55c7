//! How the driver treats its bus.

use std::time::Duration;

use crate::simulation::SafetyLimits;
use crate::wam::AXES;

/// How an arm is driven over CAN.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CanOptions {
    /// From one torque to the next; 2 ms or less.
    pub period: Duration,
    /// How long positions of a period are waited for; what comes later is left out. Seven of them take
    /// 0.6 ms on the wire.
    pub reply_timeout: Duration,
    /// How many periods in a row a puck may leave out.
    pub max_missed_replies: u32,
    /// How long an answer to a question takes at most, which is asked three times.
    pub property_timeout: Duration,
    /// How long each of the 31 nodes is listened for when pucks are looked for.
    pub scan_interval: Duration,
    /// How soon it is tried again after a failure.
    pub retry_interval: Duration,
    /// What [`MECH`](crate::can::puck::PuckProperty::MECH) of each puck is when the arm stands exactly at home: then it may be
    /// folded by hand to within half a turn of its rotors, as with libbarrett's `zerocal.conf`. Without
    /// it, how it was folded is taken for exact.
    pub home_marks: Option<[i32; AXES]>,
    /// What the safety module shall allow; its heartbeat cannot be set.
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
            retry_interval: Duration::from_millis(500),
            home_marks: None,
            limits: SafetyLimits::default(),
        }
    }
}
