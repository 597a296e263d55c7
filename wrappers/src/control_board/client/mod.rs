//! The device at the other end.
//!
//! | file | what it is about |
//! | --- | --- |
//! | `options` | whom to call, as whom, and how long to wait |
//! | `link` | the three ports, the conversation at opening, calls |
//! | `latest` | the newest state that has come |
//! | `interfaces`, `motion` | the device interfaces, said in messages |

mod interfaces;
mod latest;
mod link;
mod motion;
mod options;

use std::sync::Arc;

use yarp_devices::{
    AxisInfo, ControlLimits, ControlMode, Device, DeviceError, Encoders, PositionControl,
    VelocityControl,
};
use yarp_ports::{Network, blocking};
use yarp_wire::Bottle;

use self::link::Link;
use super::OpenError;
use super::messages::{Get, Reply, Request, Set};
pub use options::RemoteControlBoardOptions;

/// A control board in another program, as stock's `remote_controlboard` casts it back.
///
/// It has all interfaces of a control board; what the board at the other end cannot do, or does not want to, it
/// refuses with [`DeviceError::Refused`].
///
/// * **Where answers come from.** Positions, speeds, accelerations and control modes are those of the newest state
///   that the board has published; such a call waits for nothing. It fails with [`DeviceError::NoDataYet`] before the
///   first state, and with [`DeviceError::Stale`] when the newest is older than the trusted age
///   ([`RemoteControlBoardOptions::timeout`]). So a mode that was just set is seen one period later. A speed or
///   acceleration that the board marks invalid is NaN.
/// * **What blocks.** Every other question and order is a message and its answer, and waits for it at most until
///   [`RemoteControlBoardOptions::deadline`]. Calls may come from any thread, also from one that runs async code,
///   which they then hold up. `velocity_move` is sent and not waited for: the board's refusal is not heard.
/// * **What the protocol has no message for** is refused with [`DeviceError::NotSupported`]: the list of available
///   control modes, and setting the encoders of some joints by one call.
/// * A connection that is lost is not made again: open another one.
///
/// Dropping it closes its ports and unregisters their names; that takes a few seconds at the most.
///
/// ```no_run
/// # fn example() -> Result<(), Box<dyn std::error::Error>> {
/// use yarp_devices::{Axes, PositionControl};
/// use yarp_ports::Network;
/// use yarp_wrappers::{RemoteControlBoard, RemoteControlBoardOptions};
///
/// let network = Network::from_process()?;
/// let arm = RemoteControlBoard::open(&network, RemoteControlBoardOptions::new("/wam", "/me"))?;
/// arm.position_move(Axes::One(3.into()), &[120.0])?;
/// # Ok(()) }
/// ```
///
/// Source: `RemoteControlBoard.cpp` of YARP 3.12; recorded traffic of 3.12.3.
#[derive(Debug)]
pub struct RemoteControlBoard {
    /// Taken only on drop.
    link: Option<Arc<Link>>,
    axes: usize,
}

impl RemoteControlBoard {
    /// Opens three ports of its own and connects them to the board.
    ///
    /// * Ports: `LOCAL/rpc:o`, `LOCAL/command:o`, `LOCAL/stateExt:i`.
    /// * Asks for the version of the protocol and for the number of axes. Does not wait for the first state.
    /// * Blocks for a few deadlines at the most.
    /// * Errors: [`OpenError::NoRemote`], [`OpenError::NameTaken`], [`OpenError::Port`], [`OpenError::Connect`],
    ///   [`OpenError::ProtocolVersion`], [`OpenError::Question`], [`OpenError::NoAxes`]; then nothing stays open.
    pub fn open(network: &Network, options: RemoteControlBoardOptions) -> Result<Self, OpenError> {
        let network = network.with_deadline(options.deadline);
        let opening = async move { Link::open(&network, &options).await };
        let (link, axes) = blocking::wait(opening)?;
        tracing::info!(remote = %link.remote(), axes, "remote control board connected");
        Ok(Self {
            link: Some(Arc::new(link)),
            axes,
        })
    }

    /// The name of the board, as it was asked for.
    pub fn remote(&self) -> &str {
        self.link().remote()
    }

    fn link(&self) -> &Arc<Link> {
        self.link.as_ref().expect("taken only on drop")
    }

    fn ask(&self, get: Get) -> Result<Answered<'_>, DeviceError> {
        let (reply, request) = self.link().call(Request::Get(get))?;
        Ok(Answered {
            link: self.link(),
            reply,
            request,
        })
    }

    fn order(&self, set: Set) -> Result<(), DeviceError> {
        let (reply, request) = self.link().call(Request::Set(set))?;
        if reply.is_ok() {
            Ok(())
        } else {
            Err(self.link().unreadable(&request, reply))
        }
    }
}

/// The answer to a question, with what is needed to say that it makes no sense.
struct Answered<'a> {
    link: &'a Link,
    reply: Reply,
    request: Bottle,
}

impl Answered<'_> {
    /// Reads the answer; one of another kind than expected is an error.
    fn read<T>(self, read: impl FnOnce(&Reply) -> Option<T>) -> Result<T, DeviceError> {
        read(&self.reply).ok_or_else(|| self.link.unreadable(&self.request, self.reply))
    }
}

impl Drop for RemoteControlBoard {
    fn drop(&mut self) {
        // Calls borrow the board, so none is under way.
        if let Some(link) = self.link.take().and_then(Arc::into_inner) {
            blocking::wait(link.close());
        }
    }
}

impl Device for RemoteControlBoard {
    fn axis_info(&self) -> Option<&dyn AxisInfo> {
        Some(self)
    }

    fn position_control(&self) -> Option<&dyn PositionControl> {
        Some(self)
    }

    fn velocity_control(&self) -> Option<&dyn VelocityControl> {
        Some(self)
    }

    fn encoders(&self) -> Option<&dyn Encoders> {
        Some(self)
    }

    fn control_mode(&self) -> Option<&dyn ControlMode> {
        Some(self)
    }

    fn control_limits(&self) -> Option<&dyn ControlLimits> {
        Some(self)
    }
}
