//! Sounds.

use std::collections::BTreeMap;

use bytes::{Bytes, BytesMut};

use super::prefix_reader::read_whole;
use super::sound_layout::SoundLayout;
use crate::bottle::{DecodeError, Text};
use crate::message::{ReadObject, WireObject};
use crate::wire_version::WireVersion;

/// Samples of one or more microphones, stock's `yarp::sig::Sound`.
///
/// A sample is an i16; the channels are sent one after the other. Stock has announced sounds of
/// 8-bit samples since 3.9, but their length is then wrong, so only 16-bit samples are read. The
/// layout of the bytes depends on the version, see [`SoundLayout`]: all layouts are read, and the
/// newest of the reader's wire version is written unless [`Sound::laid_out`] names another.
///
/// ```
/// use yarp_wire::typed::Sound;
/// let stereo = Sound::new(2, 16_000, vec![1, 2, 3, -1, -2, -3])?;
/// assert_eq!(stereo.channel(1), Some(&[-1, -2, -3][..]));
/// # Ok::<(), yarp_wire::typed::SoundError>(())
/// ```
#[derive(Clone, Debug, Default, Eq, PartialEq)]
pub struct Sound {
    pub(super) channels: usize,
    /// Samples of each channel.
    pub(super) length: usize,
    pub(super) frequency: i32,
    pub(super) samples: Vec<i16>,
    /// Places in the sound by name; only the layout of 4.0 carries them.
    pub markers: BTreeMap<Text, SoundMarker>,
}

/// A place in a sound that has a name.
#[derive(Clone, Debug, Default, Eq, PartialEq)]
pub struct SoundMarker {
    /// The label.
    pub label: Text,
    /// The channel it is about.
    pub channel: i32,
    /// The sample, counted from the start of the channel.
    pub sample: i64,
}

/// Maximum that the headers of all layouts can state: 2 GiB.
const MOST_SAMPLES: usize = i32::MAX as usize / 2;

/// Samples that do not fill their channels, or take more than 2 GiB.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
#[error("{samples} samples do not make {channels} channels of equal length, 2 GiB at most")]
pub struct SoundError {
    /// Samples given.
    pub samples: usize,
    /// Channels asked for.
    pub channels: usize,
}

impl Sound {
    /// Returns a sound of `samples`, channel after channel, at `frequency` samples a second.
    pub fn new(channels: usize, frequency: i32, samples: Vec<i16>) -> Result<Self, SoundError> {
        let uneven = channels == 0 || !samples.len().is_multiple_of(channels);
        if uneven || samples.len() > MOST_SAMPLES {
            let samples = samples.len();
            return Err(SoundError { samples, channels });
        }
        Ok(Self {
            channels,
            length: samples.len() / channels,
            frequency,
            samples,
            markers: BTreeMap::new(),
        })
    }

    /// Returns the number of channels.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Samples of each channel.
    pub fn len(&self) -> usize {
        self.length
    }

    /// Returns whether there are no samples.
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    /// Samples a second.
    pub fn frequency(&self) -> i32 {
        self.frequency
    }

    /// Returns the samples of one channel.
    pub fn channel(&self, channel: usize) -> Option<&[i16]> {
        let start = channel * self.length;
        (channel < self.channels).then(|| &self.samples[start..start + self.length])
    }

    /// All samples, channel after channel.
    pub fn samples(&self) -> &[i16] {
        &self.samples
    }
}

impl WireObject for Sound {
    /// Writes [`SoundLayout::newest`] of the wire version.
    fn write_binary(&self, out: &mut BytesMut, wire_version: WireVersion) {
        self.laid_out(SoundLayout::newest(wire_version))
            .write_binary(out, wire_version);
    }
}

impl ReadObject for Sound {
    fn read_binary(bytes: &Bytes, wire_version: WireVersion) -> Result<Self, DecodeError> {
        read_whole(bytes, wire_version)
    }
}
