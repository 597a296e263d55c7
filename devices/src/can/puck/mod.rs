//! The frames of pucks: identifiers, groups, properties, positions, torques.
//!
//! After Barrett's support wiki (`WAM/CANbusSpecifications`), the user's manual D1001 (pages 47 and 48) and
//! libbarrett (`products/puck.h`, `detail/puck-inl.h`, `puck_group.h`, `property_list.cpp`).
//!
//! * [`Address`], [`Node`], [`Group`]: sender and receiver, in the identifier.
//! * [`PuckProperty`]: properties that can be read and set, by number.
//! * [`PuckMessage`]: the content of a frame; [`PuckMessage::read`] takes any bytes.
//! * [`pack_torques`], [`pack_position`]: numbers of 14 and 22 bits.
//! * [`Pendant`]: state of the display of the safety module.

mod bit_packing;
mod pendant_lamps;
mod puck_address;
mod puck_message;
mod puck_property;

pub use bit_packing::{pack_position, pack_torques, unpack_position, unpack_torques};
pub use pendant_lamps::{Lamp, Pendant};
pub use puck_address::{Address, Group, Node, Target};
pub use puck_message::{InvalidFrame, PuckMessage};
pub use puck_property::{PuckProperty, mode, role, status};
