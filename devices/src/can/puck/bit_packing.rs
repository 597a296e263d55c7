//! Numbers of 14 and 22 bits: torques to pucks, positions from them.

/// Bits of a torque, and of a position.
const TORQUE_BITS: u32 = 14;
const POSITION_BITS: u32 = 22;

/// Packs four torques into the 56 bits behind the property number: big-endian, no padding. Values that do not fit
/// into 14 bits are clipped to -8192 or 8191.
pub fn pack_torques(torques: [i16; 4]) -> [u8; 7] {
    let most = (1 << (TORQUE_BITS - 1)) - 1;
    let bits = torques.iter().fold(0_u64, |bits, &torque| {
        let torque = i64::from(torque).clamp(-most - 1, most);
        bits << TORQUE_BITS | (torque as u64 & ((1 << TORQUE_BITS) - 1))
    });
    let bytes = bits.to_be_bytes();
    std::array::from_fn(|index| bytes[index + 1])
}

/// The four torques of 56 bits.
pub fn unpack_torques(bytes: [u8; 7]) -> [i16; 4] {
    let bits = bytes
        .iter()
        .fold(0_u64, |bits, &byte| bits << 8 | u64::from(byte));
    std::array::from_fn(|index| {
        let shift = TORQUE_BITS * (3 - index as u32);
        sign_extended((bits >> shift) as u32, TORQUE_BITS) as i16
    })
}

/// A position as three bytes, big-endian; the upper two bits of the first are 0. Counts that do not fit wrap around,
/// as a puck's do.
pub fn pack_position(counts: i32) -> [u8; 3] {
    let [_, high, middle, low] = (counts as u32 & ((1 << POSITION_BITS) - 1)).to_be_bytes();
    [high, middle, low]
}

/// Reads a position of three bytes; the upper two bits of the first are unused.
pub fn unpack_position([high, middle, low]: [u8; 3]) -> i32 {
    sign_extended(u32::from_be_bytes([0, high, middle, low]), POSITION_BITS)
}

fn sign_extended(value: u32, bits: u32) -> i32 {
    let unused = u32::BITS - bits;
    ((value << unused) as i32) >> unused
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn torques_are_packed_as_libbarrett_packs_them() {
        let check = |torques: [i16; 4], bytes: [u8; 7]| {
            assert_eq!(pack_torques(torques), bytes);
            assert_eq!(unpack_torques(bytes), torques);
        };
        check([1, 2, 3, 4], [0x00, 0x04, 0x00, 0x20, 0x00, 0xC0, 0x04]);
        check(
            [8191, -8192, 0, -8191],
            [0x7F, 0xFE, 0x00, 0x00, 0x00, 0x20, 0x01],
        );
        check(
            [1000, -1000, 500, -1],
            [0x0F, 0xA3, 0xC1, 0x80, 0x7D, 0x3F, 0xFF],
        );
        assert_eq!(
            unpack_torques(pack_torques([i16::MAX, i16::MIN, 0, 0])),
            [8191, -8192, 0, 0]
        );
    }

    #[test]
    fn positions_are_packed_as_libbarrett_packs_them() {
        for (counts, bytes) in [
            (2, [0x00, 0x00, 0x02]),
            (-2, [0x3F, 0xFF, 0xFE]),
            (100_000, [0x01, 0x86, 0xA0]),
            (-100_000, [0x3E, 0x79, 0x60]),
        ] {
            assert_eq!(pack_position(counts), bytes);
            assert_eq!(unpack_position(bytes), counts);
        }
        assert_eq!(unpack_position([0xFF, 0xFF, 0xFE]), -2);
    }
}
