//! Doubles and ints, little-endian.

/// Appends each number.
pub(super) fn put(numbers: &[f64], out: &mut Vec<u8>) {
    for number in numbers {
        out.extend_from_slice(&number.to_le_bytes());
    }
}

/// Iterates over the numbers in these bytes; an incomplete number at the end is ignored.
pub(super) fn take(bytes: &[u8]) -> impl Iterator<Item = f64> + '_ {
    bytes
        .as_chunks::<8>()
        .0
        .iter()
        .map(|bytes| f64::from_le_bytes(*bytes))
}

/// Reads a pose with [`take`].
pub(super) fn pose(bytes: &[u8]) -> [f64; super::POSE] {
    let mut pose = [0.0; super::POSE];
    for (slot, number) in pose.iter_mut().zip(take(bytes)) {
        *slot = number;
    }
    pose
}
