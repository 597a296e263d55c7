//! Whatever comes over the bus is read or refused, and what is written is read as the same.

use proptest::prelude::*;
use yarp_devices::can::CanFrame;
use yarp_devices::can::puck::{
    Address, Group, Node, Pendant, PuckMessage, PuckProperty, Target, pack_position, pack_torques,
    unpack_position, unpack_torques,
};

fn address() -> impl Strategy<Value = Address> {
    (0_u16..0x800).prop_map(Address::of_id)
}

/// Messages to such a receiver.
fn said() -> impl Strategy<Value = (Address, PuckMessage)> {
    let torque = -8192_i16..8192;
    let message = prop_oneof![
        any::<u8>().prop_map(|number| PuckMessage::Get(PuckProperty::new(number))),
        (any::<u8>(), any::<i32>()).prop_map(|(number, value)| PuckMessage::Value {
            property: PuckProperty::new(number),
            value,
        }),
        (
            -0x20_0000..0x20_0000_i32,
            prop::option::of(-0x20_0000..0x20_0000_i32)
        )
            .prop_map(|(motor, joint)| PuckMessage::Position { motor, joint }),
        [torque.clone(), torque.clone(), torque.clone(), torque].prop_map(PuckMessage::Torques),
    ];
    (address(), message).prop_map(|(address, message)| {
        let positions = Target::Group(Group::POSITIONS);
        let to = match message {
            PuckMessage::Position { .. } => positions,
            PuckMessage::Torques(_) => Target::Group(Group::LOWER_TORQUES),
            _ if address.to == positions => Target::Node(Node::SAFETY),
            _ => address.to,
        };
        (Address { to, ..address }, message)
    })
}

proptest! {
    #[test]
    fn any_bytes_are_read_or_refused(
        id in 0_u16..0x800,
        bytes in prop::collection::vec(any::<u8>(), 0..9),
    ) {
        let frame = CanFrame::new(id, &bytes).expect("it fits");
        if let Ok((address, message)) = PuckMessage::read(&frame) {
            prop_assert_eq!(PuckMessage::read(&message.frame(address)), Ok((address, message)));
        }
    }

    #[test]
    fn what_is_said_is_understood((address, message) in said()) {
        prop_assert_eq!(PuckMessage::read(&message.frame(address)), Ok((address, message)));
    }

    #[test]
    fn packed_numbers_come_back(torques in any::<[i16; 4]>(), counts in any::<i32>()) {
        let cut = torques.map(|torque| torque.clamp(-8192, 8191));
        prop_assert_eq!(unpack_torques(pack_torques(torques)), cut);
        prop_assert_eq!(unpack_position(pack_position(counts)), counts << 10 >> 10);
    }

    #[test]
    fn lamps_come_back(bits in any::<i32>()) {
        let pendant = Pendant::of_bits(bits);
        prop_assert_eq!(Pendant::of_bits(pendant.bits()), pendant);
    }
}
