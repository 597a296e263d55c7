//! Doubles and ints, little-endian.

/// Appends each number.
pub(super) fn put(numbers: &[f64], out: &mut Vec<u8>) {
    for number in numbers {
        out.extend_from_slice(&number.to_le_bytes());
    }
}

/// The numbers that fill these bytes; a rest that is no whole number is left out.
pub(super) fn take(bytes: &[u8]) -> impl Iterator<Item = f64> + '_ {
    bytes
        .as_chunks::<8>()
        .0
        .iter()
        .map(|bytes| f64::from_le_bytes(*bytes))
}

/// As [`take`], for a pose.
pub(super) fn pose(bytes: &[u8]) -> [f64; super::POSE] {
    let mut pose = [0.0; super::POSE];
    for (slot, number) in pose.iter_mut().zip(take(bytes)) {
        *slot = number;
    }
    pose
}
