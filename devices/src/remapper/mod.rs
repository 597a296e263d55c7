//! Several devices combined into one control board: some or all of their joints, in any order.
//!
//! | file | content |
//! | --- | --- |
//! | `axis_mapping` | maps joints to devices, and splits a call into one per device |
//! | `fan_out` | queries and commands to the devices, and the errors when one of them refuses |
//! | `range_checks` | predicts refusals of devices |
//! | `motion_interfaces`, `motor_interfaces` | the interfaces |
//! | `remapped_stop`, `remapped_variables` | software stop and variables of several devices |
//!
//! A call goes to each device once, with the joints that are its own. Before a command reaches any device, the
//! selection is checked whole, and each device has to have the interface. Devices check the values themselves; those
//! that will probably refuse are called first, so that a refusal leaves the others as they were wherever that can be
//! predicted. Otherwise the error names the devices that executed the command and those that did not
//! ([`DeviceError::PartRefused`]). Those that executed it continue: to stop them would be a second command that no
//! caller gave, and would cancel an older one too; stock leaves them as well, without naming them. A caller for whom
//! half a command is worse than none should stop the board after this error. Commands that stop joints go to every
//! device, even if others refuse.
//!
//! Source: the behaviour of stock's `ControlBoardRemapper.cpp` of YARP 3.5.

#[macro_use]
mod remapped_interface;

mod axis_mapping;
mod fan_out;
mod motion_interfaces;
mod motor_interfaces;
mod range_checks;
mod remapped_stop;
mod remapped_variables;

use std::sync::Arc;

use crate::{AxisIndex, AxisInfo, Device, DeviceError};

use self::axis_mapping::{DeviceAxis, RemappedDevice};
use self::fan_out::Interface;
use self::range_checks::Ranges;

/// A device and its name.
pub type Named = (String, Arc<dyn Device>);

/// Several devices as one control board.
///
/// It offers each interface of a control board that any of them has; for a joint of one that lacks it, a call is refused
/// with [`DeviceError::PartLacks`]. Errors number joints as this board does. Readings keep the times of their devices.
///
/// ```
/// use std::sync::Arc;
/// use yarp_devices::remapper::Remapper;
/// use yarp_devices::wam::SimulatedWam;
/// use yarp_devices::{Axes, Device};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let arms: Vec<(String, Arc<dyn Device>)> = vec![
///     ("left".into(), Arc::new(SimulatedWam::new())),
///     ("right".into(), Arc::new(SimulatedWam::new())),
/// ];
/// // The elbows of both.
/// let elbows = Remapper::of_joints(arms, &[(0, 3.into()), (1, 3.into())])?;
/// elbows.position_control().unwrap().position_move(Axes::All, &[170.0, 160.0])?;
/// assert_eq!(elbows.position_control().unwrap().target_positions(Axes::All)?, [170.0, 160.0]);
/// # Ok(())
/// # }
/// ```
pub struct Remapper {
    parts: Vec<RemappedDevice>,
    axes: Vec<DeviceAxis>,
    names: Vec<String>,
    known: Ranges,
}

/// Reasons why devices could not be combined into one board.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RemapError {
    /// A board without joints is none.
    #[error("expected one joint at least, got none")]
    NoAxes,
    /// A device has no joints.
    #[error("{part} has no joints")]
    NoJoints {
        /// The device.
        part: String,
    },
    /// Two devices are called the same.
    #[error("two devices are called {part}, expected a name of its own for each")]
    SameName {
        /// Their name.
        part: String,
    },
    /// No device has a joint of this name.
    #[error("no device has a joint {name}; there is {known}")]
    NoSuchName {
        /// The name.
        name: String,
        /// The joints that there are.
        known: String,
    },
    /// Several devices have a joint of this name.
    #[error("{first} and {second} both have a joint {name}; name joints by networks instead")]
    Ambiguous {
        /// The name.
        name: String,
        /// A device.
        first: String,
        /// Another one, or the same one again.
        second: String,
    },
    /// A device does not have so many joints.
    #[error("{part} has no joint {asked}, it has {axes}, counted from 0")]
    NoSuchJoint {
        /// The device.
        part: String,
        /// The joint.
        asked: AxisIndex,
        /// The number of its axes.
        axes: usize,
    },
    /// A joint would have two numbers.
    #[error("joint {joint} of {part} is named twice")]
    Twice {
        /// The joint, as its device counts.
        joint: AxisIndex,
        /// The device.
        part: String,
    },
    /// A device did not return the names of its joints.
    #[error("{part} does not report the name of its joint {joint}")]
    Untold {
        /// The joint, as its device counts.
        joint: AxisIndex,
        /// The device.
        part: String,
        /// The cause.
        #[source]
        source: Box<DeviceError>,
    },
}

impl Remapper {
    /// The joints with these names, in this order; each is found on the device that has it.
    ///
    /// Asks every device for the names of its joints, which takes its time behind a network.
    /// Errors: [`RemapError`].
    pub fn of_names(devices: Vec<Named>, names: &[String]) -> Result<Self, RemapError> {
        let theirs = axis_mapping::names_of(&devices)?;
        let joints = axis_mapping::find(&devices, &theirs, names)?;
        Self::of_joints(devices, &joints)
    }

    /// These joints, in this order: the number of the device in `devices`, and the joint in the device's numbering.
    ///
    /// Joints whose names are not distinct get the name of their device and `_` as prefix. A device without a joint
    /// here is left alone. Errors: [`RemapError`]; a number of a device that is not there counts as a device without
    /// joints.
    pub fn of_joints(
        devices: Vec<Named>,
        joints: &[(usize, AxisIndex)],
    ) -> Result<Self, RemapError> {
        let (parts, axes) = axis_mapping::arrange(devices, joints)?;
        let names = axis_mapping::distinct_names(&parts, &axes)?;
        Ok(Self {
            parts,
            axes,
            names,
            known: Ranges::default(),
        })
    }
}

/// Presents every interface that a device has, from the descriptions in `iface/`.
macro_rules! interfaces {
    ($($method:ident: $interface:ident, $wire:tt, $words:tt $description:tt)*) => {
        impl Device for Remapper {
            $( interface! { $method $interface $wire } )*

            fn software_stop(&self) -> Option<&dyn crate::SoftwareStop> {
                self.can_stop().then_some(self as _)
            }
        }

        impl Interface {$(
            #[allow(dead_code, reason = "what is written by hand uses some of them")]
            const fn $method() -> Self {
                Self {
                    words: $words,
                    has: |device| device.$method().is_some(),
                }
            }
        )*}
    };
}

/// An interface of the remapper; one without a name of its own is part of others.
macro_rules! interface {
    (axis_info AxisInfo $wire:tt) => {
        fn axis_info(&self) -> Option<&dyn AxisInfo> {
            Some(self)
        }
    };
    ($method:ident $interface:ident "") => {};
    ($method:ident $interface:ident $wire:tt) => {
        fn $method(&self) -> Option<&dyn crate::$interface> {
            self.any_has(Interface::$method()).then_some(self as _)
        }
    };
}

crate::describe_board!(interfaces);
