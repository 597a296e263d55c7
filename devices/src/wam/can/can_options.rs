//! Options of the driver on its bus.

use std::path::PathBuf;
use std::time::Duration;

#[cfg(target_os = "linux")]
use crate::real_time::RealTime;
use crate::simulation::SafetyLimits;
use crate::wam::AXES;

/// Options of an arm on CAN.
#[derive(Clone, Debug, PartialEq)]
pub struct CanOptions<const N: usize = AXES> {
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
    /// Marks refine a confirmed home pose and do not replace the confirmation: a rotor has the same angle once per turn.
    /// Ignored for pucks without an absolute encoder or with firmware older than 118.
    pub home_marks: Option<[i32; N]>,
    /// Angles of the rotors with the joints at zero, rad: `zeroangle` of libbarrett's `zerocal.conf`, see
    /// [`ZeroCalibration`](super::ZeroCalibration). [`home_marks`](Self::home_marks) take precedence.
    pub zero_angles: Option<[f64; N]>,
    /// File for the last known position. With it, a driver that starts again believes pucks that have kept their power
    /// and their positions, without a confirmation; without it, each start needs one.
    pub position_file: Option<PathBuf>,
    /// Confirms that the arm is folded in its home pose at the start of the driver, as
    /// [`CanWam::confirm_home`](super::CanWam::confirm_home) does later. Without it, and without a record of the position
    /// that the pucks confirm, the driver starts, but the arm stays unreachable until somebody confirms. Refused when the
    /// pucks have kept a position that is not home. Not for a program that is restarted automatically: nobody looks at
    /// the arm then.
    pub home_confirmed: bool,
    /// Limits of the safety module; its heartbeat cannot be set.
    pub limits: SafetyLimits,
    /// Real-time settings of the control thread, as far as the system permits them.
    #[cfg(target_os = "linux")]
    pub real_time: RealTime,
}

/// 500 Hz as libbarrett, and the limits that the safety module has at power-up.
impl<const N: usize> Default for CanOptions<N> {
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
            zero_angles: None,
            position_file: None,
            home_confirmed: false,
            limits: SafetyLimits::default(),
            #[cfg(target_os = "linux")]
            real_time: RealTime::default(),
        }
    }
}
