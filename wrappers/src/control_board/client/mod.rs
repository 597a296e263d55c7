//! The device at the other end.
//!
//! | file | content |
//! | --- | --- |
//! | `remote_board_options` | names, carrier and timeouts |
//! | `board_link` | the three ports, opening, calls |
//! | `latest_state` | the newest state received |
//! | `board_requests` | queries and commands for joints, in either wire version |
//! | `remote_motion_completion` | numbered moves, and waiting for their ends |
//! | `remote_interface` | generates the methods of an interface from its description |
//! | `remote_board_interfaces`, `pid_interface` | the device interfaces, and what is written by hand of them |
//! | `checked` | checks of arguments before they are sent |

#[macro_use]
mod remote_interface;

mod argument_checks;
mod board_link;
mod board_requests;
mod latest_state;
mod pid_interface;
mod remote_board_interfaces;
mod remote_board_options;
mod remote_motion_completion;

use std::collections::HashSet;

use yarp_devices::{Device, DeviceError};
use yarp_ports::{Network, blocking};
use yarp_wire::{Value, WireVersion};

use self::board_link::{BoardLink, Results};
use super::OpenError;
use super::messages::{Get, Request, Set};
use crate::device_ports::SharedLink;
pub use remote_board_options::RemoteControlBoardOptions;
pub use remote_motion_completion::RemoteMotion;

/// A control board in another program, as stock's `remote_controlboard` (3.x) and `controlBoard_nwc_yarp` (4.0) cast
/// it back. Which of the two it is is found out: a board that serves both is spoken to as 4.0.
///
/// It has the interfaces that a board of 4.0 reports, or all that 3.x has messages for; calls that the board at the
/// other end does not support or does not accept fail with [`DeviceError::Refused`].
///
/// * **Where answers come from.** Positions, speeds, accelerations, those of motors, torques, currents, duty cycles,
///   control and interaction modes are those of the newest state that the board has published; such a call waits for nothing. It fails with [`DeviceError::NoDataYet`] before the
///   first state, and with [`DeviceError::Stale`] when the newest is older than the trusted age
///   ([`RemoteControlBoardOptions::max_state_age`]). So a mode that was just set is seen one period later. A speed or
///   acceleration that the board marks invalid is NaN.
/// * **Blocking calls.** Every other query and command is a message and its reply, and waits at most
///   [`RemoteControlBoardOptions::rpc_timeout`]. Calls may come from any thread, also from one that runs async code,
///   which they then hold up. Velocities, direct positions and velocities, torques, currents and duty cycles are sent
///   without waiting: the board's refusal is not reported. (4.0 waits for a current or duty cycle of one joint.)
/// * **Missing messages.** Calls without a message in the protocol are refused with [`DeviceError::NotSupported`]: in
///   3.x the lists of available control modes and loops, in both setting the encoders of some joints by one call, in
///   4.0 setting the encoder of one joint to anything but a whole number.
/// * **Lost connections** are reconnected when the board is back, if it has the same wire version. Until then calls
///   fail.
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
/// Source: `RemoteControlBoard.cpp` of YARP 3.12, `ControlBoard_nwc_yarp.cpp` of 4.0; recorded traffic of 3.12.3 and
/// 4.0.0.
#[derive(Debug)]
pub struct RemoteControlBoard {
    link: SharedLink<BoardLink>,
    axes: usize,
    /// The interfaces of 4.0 that the board reports.
    interfaces: Option<HashSet<String>>,
}

impl RemoteControlBoard {
    /// Opens three ports of its own and connects them to the board.
    ///
    /// * Ports: `LOCAL/rpc:o` (to 4.0 `LOCAL/nwc/rpc:o`), `LOCAL/command:o`, `LOCAL/stateExt:i`.
    /// * Asks for the version of the protocol, for the number of axes and, of 4.0, for the interfaces. Does not wait for the first state.
    /// * Blocks for a few deadlines at the most.
    /// * Errors: [`OpenError::NoRemote`], [`OpenError::NameTaken`], [`OpenError::Port`], [`OpenError::Connect`],
    ///   [`OpenError::ProtocolVersion`], [`OpenError::Query`], [`OpenError::NoAxes`]; then nothing stays open.
    pub fn open(network: &Network, options: RemoteControlBoardOptions) -> Result<Self, OpenError> {
        let network = network.with_timeout(options.common.rpc_timeout);
        let opening = async move { BoardLink::open(&network, &options).await };
        let (link, about) = blocking::wait(opening)?;
        let (remote, wire_version, axes) = (link.ports.remote(), link.wire_version, about.axes);
        tracing::info!(remote, %wire_version, axes, "remote control board connected");
        Ok(Self {
            link: SharedLink::new(link),
            axes,
            interfaces: about.interfaces,
        })
    }

    /// Returns the name of the board, as it was given.
    pub fn remote(&self) -> &str {
        self.link.ports.remote()
    }

    /// The wire version of YARP that is spoken with the board.
    pub fn wire_version(&self) -> WireVersion {
        self.link.wire_version
    }

    /// Returns whether the board has the interface that 4.0 calls `name`; true for a board of 3.x, which does not
    /// tell.
    fn has(&self, name: &str) -> bool {
        self.interfaces
            .as_ref()
            .is_none_or(|there| there.contains(name))
    }

    fn call(&self, request: Request) -> Result<Results, DeviceError> {
        self.link
            .run(|link| async move { link.exchange(&request).await })
    }

    fn ask(&self, get: Get) -> Result<Answered<'_>, DeviceError> {
        let results = self.call(Request::Get(get))?;
        Ok(Answered {
            link: &self.link,
            results,
        })
    }

    fn order(&self, set: Set) -> Result<(), DeviceError> {
        self.call(Request::Set(set)).map(drop)
    }
}

/// The results of a query, with the context for an error if they are invalid.
struct Answered<'a> {
    link: &'a BoardLink,
    results: Results,
}

impl Answered<'_> {
    /// Reads the results; those of another kind than expected are an error.
    fn read<T>(self, read: impl FnOnce(&[Value]) -> Option<T>) -> Result<T, DeviceError> {
        read(&self.results.values).ok_or_else(|| self.link.unreadable(&self.results))
    }
}

/// Presents the interfaces that the board reports.
macro_rules! interfaces {
    ($($method:ident: $interface:ident, $wire:tt, $words:literal $description:tt)*) => {
        impl Device for RemoteControlBoard {
            $( interface! { $method $interface $wire $description } )*
        }
    };
}

/// An interface; what it shares with another one (an empty name) is part of that one.
macro_rules! interface {
    ($method:ident $interface:ident "" $description:tt) => {};
    ($method:ident $interface:ident $wire:tt {
        numbers { $($(#[$n_doc:meta])* $number:ident $({ $($n_kind:tt)* })?:
            $n_prefix:literal [$($n_word:literal)*] $n_functions:tt => $n_call:tt;)* }
        settings { $($(#[$s_doc:meta])* $setting:ident $({ $($s_kind:tt)* })?:
            $s_prefix:literal [$($s_word:literal)*] $s_functions:tt => $s_call:tt;)* }
        actions { $($(#[$a_doc:meta])* $action:ident $({ $($a_kind:tt)* })?:
            $a_prefix:literal [$($a_word:literal)*] $a_functions:tt => $a_call:tt;)* }
        queries { $($(#[$q_doc:meta])* $query:ident $({ $($q_kind:tt)* })? -> $result:ty:
            $q_prefix:literal [$($q_word:literal)*] $q_functions:tt => $q_call:tt;)* }
        commands { $($(#[$c_doc:meta])* $command:ident($($field:tt)*):
            $c_prefix:literal [$($c_word:literal)*] $c_functions:tt => $c_call:tt;)* }
    }) => {
        fn $method(&self) -> Option<&dyn yarp_devices::$interface> {
            let words = [
                $($($n_word,)*)* $($($s_word,)*)* $($($a_word,)*)* $($($q_word,)*)* $($($c_word,)*)*
            ];
            let old = words.iter().any(|word: &&str| !word.is_empty());
            let there = self.has($wire) && (old || self.wire_version() == WireVersion::V4);
            there.then_some(self)
        }
    };
}

yarp_devices::describe_board!(interfaces);
