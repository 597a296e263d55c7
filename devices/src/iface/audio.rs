//! Sound, as used by the audio interfaces.

/// A chunk of sound: samples of 16 bits, the channels of one moment side by side.
#[derive(Clone, Debug, Default, Eq, PartialEq)]
pub struct Audio {
    /// Number of channels.
    pub channels: usize,
    /// Moments a second.
    pub rate: u32,
    /// Channel after channel, moment after moment.
    pub samples: Vec<i16>,
}

impl Audio {
    /// Returns the number of samples per channel.
    pub fn len(&self) -> usize {
        self.samples.len().checked_div(self.channels).unwrap_or(0)
    }

    /// Returns whether there are no samples.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Size of a sound buffer (stock: `AudioBufferSize`).
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct AudioBufferSize {
    /// Moments.
    pub samples: usize,
    /// Channels of each.
    pub channels: usize,
}
