//! The byte layouts of sounds, version by version.

use bytes::{BufMut, Bytes, BytesMut};

use super::element::collect;
use super::pixel::PixelCode;
use super::prefix_reader::{Front, ReadPrefix};
use super::sound::{Sound, SoundMarker};
use super::typed_image::Image;
use crate::bottle::{Bottle, DecodeError, Text};
use crate::message::WireObject;
use crate::wire_version::WireVersion;

/// The four layouts of a sound. No stock version reads the layout of another; this implementation
/// reads all.
///
/// | layout | versions | bytes |
/// | --- | --- | --- |
/// | `Pair` | up to 3.8 | `256 2`, an [`Image`], the bottle `(frequency)` |
/// | `Raw` | 3.9 | `256 4`, `0 samples`, `1 channels`, `1 2`, `1 frequency`, int16s; not a bottle |
/// | `List` | 3.10 to 3.12 | `256 5`, `1 samples`, `1 channels`, `1 2`, `1 frequency`, `320 n` int16s |
/// | `Marked` | 4.0 | `256 6` and on as `List`, `256 m` and m markers |
///
/// The image of a `Pair` has `mo16` pixels, quantum 2, a row per channel. A marker is
/// `256 4`, key, label (each a length and bytes), int32 channel, int64 sample, without codes, so
/// that a sound with markers is not a bottle and prints as an empty line on a text connection.
/// The second number distinguishes the layouts, independent of the wire version.
///
/// Source: `Pair` from bytes written and read by 3.5.0; the others from `sig/Sound.cpp` of 3.9.0,
/// 3.12.3 and 4.0.0.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[non_exhaustive]
pub enum SoundLayout {
    /// Up to 3.8. Drops markers.
    Pair,
    /// 3.9. Drops markers.
    Raw,
    /// 3.10 to 3.12. Drops markers.
    List,
    /// 4.0.
    Marked,
}

impl SoundLayout {
    /// Returns the layout that the newest stock version of a wire version reads.
    pub const fn newest(wire_version: WireVersion) -> Self {
        match wire_version {
            WireVersion::V3 => Self::List,
            WireVersion::V4 => Self::Marked,
        }
    }
}

/// A sound to be sent in one layout, for any reader.
#[derive(Clone, Copy, Debug)]
pub struct SoundMessage<'a> {
    sound: &'a Sound,
    layout: SoundLayout,
}

impl Sound {
    /// Returns the sound as readers of other versions want it.
    pub fn laid_out(&self, layout: SoundLayout) -> SoundMessage<'_> {
        SoundMessage {
            sound: self,
            layout,
        }
    }
}

impl WireObject for SoundMessage<'_> {
    fn write_binary(&self, out: &mut BytesMut, wire_version: WireVersion) {
        let sound = self.sound;
        let (items, first_code) = match self.layout {
            SoundLayout::Pair => return put_pair(out, sound, wire_version),
            // That version writes its first number where the code belongs, then over it.
            SoundLayout::Raw => (4, 0),
            SoundLayout::List => (5, 1),
            SoundLayout::Marked => (6, 1),
        };
        let (length, channels) = (sound.length as i32, sound.channels as i32);
        let head = [256, items, first_code, length, 1, channels];
        put_words(out, &head);
        put_words(out, &[1, BYTES_PER_SAMPLE, 1, sound.frequency]);
        if self.layout != SoundLayout::Raw {
            put_words(out, &[INT16_LIST, sound.samples.len() as i32]);
        }
        for sample in &sound.samples {
            out.put_i16_le(*sample);
        }
        if self.layout == SoundLayout::Marked {
            put_markers(out, sound);
        }
    }
}

const BYTES_PER_SAMPLE: i32 = 2;
const INT16_LIST: i32 = 256 + 64;
const SAMPLE: usize = 2;

fn put_words(out: &mut BytesMut, words: &[i32]) {
    for word in words {
        out.put_i32_le(*word);
    }
}

fn put_pair(out: &mut BytesMut, sound: &Sound, wire_version: WireVersion) {
    let mut samples = BytesMut::with_capacity(SAMPLE * sound.samples.len());
    for sample in &sound.samples {
        samples.put_i16_le(*sample);
    }
    let code = PixelCode::MONO16;
    let image = Image::from_padded(code, sound.length, sound.channels, SAMPLE, samples.freeze())
        .expect("a row of samples per channel, less than 2 GiB");
    put_words(out, &[256, 2]);
    image.write_binary(out, wire_version);
    Bottle::of(sound.frequency).encode_into(out, wire_version);
}

fn put_markers(out: &mut BytesMut, sound: &Sound) {
    put_words(out, &[256, sound.markers.len() as i32]);
    for (key, marker) in &sound.markers {
        put_words(out, &[256, 4]);
        for text in [key, &marker.label] {
            out.put_i32_le(text.as_bytes().len() as i32);
            out.put_slice(text.as_bytes());
        }
        out.put_i32_le(marker.channel);
        out.put_i64_le(marker.sample);
    }
}

impl ReadPrefix for Sound {
    fn take(bytes: &mut Bytes, wire_version: WireVersion) -> Result<Self, DecodeError> {
        let mut front = Front::new(bytes, "a sound of 16-bit samples");
        front.words(&[256])?;
        match front.i32()? {
            2 => take_pair(&mut front, wire_version),
            4 => take_flat(&mut front, SoundLayout::Raw),
            5 => take_flat(&mut front, SoundLayout::List),
            6 => take_flat(&mut front, SoundLayout::Marked),
            _ => Err(front.shape()),
        }
    }
}

fn take_pair(front: &mut Front<'_>, wire_version: WireVersion) -> Result<Sound, DecodeError> {
    let image = Image::take(front.rest(), wire_version)?;
    let frequency = Bottle::take(front.rest(), wire_version)?;
    let frequency = frequency.get(0).and_then(|frequency| frequency.as_i32());
    let (PixelCode::MONO16, Some(frequency)) = (image.code(), frequency) else {
        return Err(front.shape());
    };
    Ok(Sound {
        channels: image.height(),
        length: image.width(),
        frequency,
        samples: collect(&image.packed()),
        markers: Default::default(),
    })
}

fn take_flat(front: &mut Front<'_>, layout: SoundLayout) -> Result<Sound, DecodeError> {
    front.words(&[if layout == SoundLayout::Raw { 0 } else { 1 }])?;
    let length = front.count()?;
    front.words(&[1])?;
    let channels = front.count()?;
    front.words(&[1, BYTES_PER_SAMPLE, 1])?;
    let frequency = front.i32()?;
    let claimed = channels.checked_mul(length);
    let count = match layout {
        SoundLayout::Raw => claimed.ok_or_else(|| front.shape())?,
        _ => {
            front.words(&[INT16_LIST])?;
            let count = front.count()?;
            if claimed != Some(count) {
                return Err(front.shape());
            }
            count
        }
    };
    let samples = collect(&front.run(count, SAMPLE)?);
    let mut sound = Sound {
        channels,
        length,
        frequency,
        samples,
        markers: Default::default(),
    };
    if layout == SoundLayout::Marked {
        front.words(&[256])?;
        for _ in 0..front.count()? {
            let (key, marker) = take_marker(front)?;
            sound.markers.insert(key, marker);
        }
    }
    Ok(sound)
}

fn take_marker(front: &mut Front<'_>) -> Result<(Text, SoundMarker), DecodeError> {
    front.words(&[256, 4])?;
    let length = front.count()?;
    let key = front.run(length, 1)?.into();
    let length = front.count()?;
    let label = front.run(length, 1)?.into();
    let channel = front.i32()?;
    let sample = i64::from_le_bytes(front.array()?);
    let marker = SoundMarker {
        label,
        channel,
        sample,
    };
    Ok((key, marker))
}
