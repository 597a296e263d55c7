//! Sound, as the interfaces for it speak of it.

/// A piece of sound: samples of 16 bits, the channels of one moment side by side.
#[derive(Clone, Debug, Default, Eq, PartialEq)]
pub struct Audio {
    /// How many channels there are.
    pub channels: usize,
    /// Moments a second.
    pub rate: u32,
    /// Channel after channel, moment after moment.
    pub samples: Vec<i16>,
}

impl Audio {
    /// How many moments there are.
    pub fn len(&self) -> usize {
        self.samples.len().checked_div(self.channels).unwrap_or(0)
    }

    /// Whether there is nothing to hear.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// How much sound a buffer holds (stock: `AudioBufferSize`).
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct AudioBufferSize {
    /// Moments.
    pub samples: usize,
    /// Channels of each.
    pub channels: usize,
}
