//! The frames of pucks: identifiers, groups, properties, positions, torques.
//!
//! After Barrett's support wiki (`WAM/CANbusSpecifications`), the user's manual D1001 (pages 47 and 48) and
//! libbarrett (`products/puck.h`, `detail/puck-inl.h`, `puck_group.h`, `property_list.cpp`).
//!
//! * [`Address`], [`Node`], [`Group`]: who speaks to whom, in the identifier.
//! * [`Property`]: what can be asked and set, by number.
//! * [`Message`]: what a frame says; [`Message::read`] takes any bytes.
//! * [`pack_torques`], [`pack_position`]: numbers of 14 and 22 bits.
//! * [`Pendant`]: what the display of the safety module shows.

mod address;
mod message;
mod packed;
mod pendant;
mod property;

pub use address::{Address, Group, Node, Target};
pub use message::{BadFrame, Message};
pub use packed::{pack_position, pack_torques, unpack_position, unpack_torques};
pub use pendant::{Lamp, Pendant};
pub use property::{Property, mode, role, status};
