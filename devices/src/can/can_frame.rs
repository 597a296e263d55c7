//! One message on a bus.

use std::fmt;

/// The largest identifier of 11 bits.
const MAX_ID: u16 = 0x7FF;

/// A data frame with an identifier of 11 bits and up to 8 bytes.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct CanFrame {
    id: u16,
    length: u8,
    data: [u8; 8],
}

impl CanFrame {
    /// A frame; `None` if the identifier has more than 11 bits or there are more than 8 bytes.
    pub fn new(id: u16, bytes: &[u8]) -> Option<Self> {
        let mut data = [0; 8];
        data.get_mut(..bytes.len())?.copy_from_slice(bytes);
        (id <= MAX_ID).then_some(Self {
            id,
            length: bytes.len() as u8,
            data,
        })
    }

    /// The identifier, 0 to 7FF.
    pub fn id(&self) -> u16 {
        self.id
    }

    /// The bytes.
    pub fn bytes(&self) -> &[u8] {
        &self.data[..usize::from(self.length)]
    }
}

/// Formats the frame as fact sheets and tools write it: `426: 85 00 02 00`.
impl fmt::Display for CanFrame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:03X}:", self.id)?;
        self.bytes()
            .iter()
            .try_for_each(|byte| write!(f, " {byte:02X}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_is_no_longer_than_a_frame() {
        assert_eq!(CanFrame::new(0x800, &[]), None);
        assert_eq!(CanFrame::new(1, &[0; 9]), None);
        let frame = CanFrame::new(0x426, &[0x85, 0, 2, 0]).expect("it fits");
        assert_eq!(frame.to_string(), "426: 85 00 02 00");
    }
}
