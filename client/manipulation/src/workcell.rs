//! The calls of arm and hand that the steps of a manipulation need.

use nalgebra::Point3;
use yarp_client::ports::error_chain;
use yarp_devices::DeviceError;
use yarp_devices::hand::gcl::Status;
use yarp_devices::kinematics::Joints;

/// An error of a call.
#[derive(Debug, thiserror::Error)]
#[error("{device}: cannot {action}: {source}")]
pub struct WorkcellError {
    /// Name of the device on the network.
    pub device: String,
    /// The call, such as `command a posture`.
    pub action: &'static str,
    /// Reason.
    pub source: Box<DeviceError>,
}

impl WorkcellError {
    /// Returns whether a hand refused a command because its motors are hot; it takes commands again when they have cooled.
    pub fn is_overheated(&self) -> bool {
        let hot = Status::OVER_TEMPERATURE.to_string();
        // Without its number, which is that of several errors at once.
        let word = hot.split(" (").next().unwrap_or_default();
        error_chain(&*self.source).contains(word)
    }
}

/// An arm with a hand: set points at a fixed interval, commands of the hand, and time.
///
/// Time is that of the robot: [`wait`](Self::wait) lets it pass.
pub trait Workcell {
    /// Prepares arm and hand: the arm follows set points from now on, from where it is.
    fn prepare(&mut self) -> Result<(), WorkcellError>;

    /// Lets the arm follow set points again after it refused one because it had stopped itself.
    ///
    /// Errors: the arm is idle or reports a fault. Who pressed an emergency stop, or what failed, is not to be overruled: only
    /// a person makes that arm move again, and a program that is started then.
    fn resume(&mut self) -> Result<(), WorkcellError>;

    /// Returns the measured joint angles, rad.
    fn joints(&mut self) -> Result<Joints<7>, WorkcellError>;

    /// Sends the arm a set point, rad; it holds the last one.
    ///
    /// Errors: it takes no set points, because it stopped itself or somebody stopped it; see [`resume`](Self::resume).
    fn command(&mut self, joints: &Joints<7>) -> Result<(), WorkcellError>;

    /// Lets this many seconds pass, and returns how many did: more if this machine or the network was late.
    fn wait(&mut self, seconds: f64) -> Result<f64, WorkcellError>;

    /// Sends the hand a command in its own language (`GO`, `SM 1500`), waits for its end and returns the reply.
    ///
    /// A motion that something blocked is no error: that is how a grasp ends.
    fn command_hand(&mut self, line: &str) -> Result<String, WorkcellError>;

    /// Starts commands of the hand, one after the other, and returns while it carries them out; what was started before must have
    /// ended.
    ///
    /// One that fails ends them; [`finish_hand`](Self::finish_hand) has its error.
    fn start_hand(&mut self, lines: &[String]) -> Result<(), WorkcellError>;

    /// Waits for the end of what [`start_hand`](Self::start_hand) started; returns at once if nothing was.
    fn finish_hand(&mut self) -> Result<(), WorkcellError>;

    /// Returns the positions of the motors of F1, F2, F3 and the spread, counts.
    ///
    /// Errors: the hand is carrying out what [`start_hand`](Self::start_hand) started.
    fn fingers(&mut self) -> Result<[f64; 4], WorkcellError>;

    /// Returns points on the surfaces that depth sensors above the containers see now, in the arm's base frame, m.
    ///
    /// Empty without such sensors: then the heights in the containers are estimates.
    fn look_into_containers(&mut self) -> Result<Vec<Point3<f64>>, WorkcellError> {
        Ok(Vec::new())
    }

    /// Holds the arm where it is; the hand keeps its grip.
    fn hold(&mut self) -> Result<(), WorkcellError>;
}
