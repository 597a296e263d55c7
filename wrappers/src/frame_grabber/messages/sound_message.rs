//! Sound of devices as messages.

use yarp_devices::Audio;
use yarp_wire::message::WireObject;
use yarp_wire::typed::{Pair, Sound, SoundError, SoundLayout};
use yarp_wire::{WireVersion, typed};

/// Sound as stock's `grabber` sends it: in the layout of 3.5, which readers of 3.x up to 3.8 read. Readers of 4.0 get their own layout.
#[derive(Clone, Debug, Default, Eq, PartialEq)]
pub struct GrabberSound(pub Sound);

/// An image with its sound, in one message (stock: `ImageRgbSound`).
pub type ImageWithSound = Pair<typed::Image, GrabberSound>;

impl WireObject for GrabberSound {
    fn write_binary(&self, out: &mut bytes::BytesMut, wire_version: WireVersion) {
        let layout = match wire_version {
            WireVersion::V3 => SoundLayout::Pair,
            WireVersion::V4 => SoundLayout::newest(wire_version),
        };
        self.0.laid_out(layout).write_binary(out, wire_version);
    }
}

/// The message of a sound, which may be empty.
pub fn to_wire(sound: &Audio) -> Result<GrabberSound, SoundError> {
    let rate = i32::try_from(sound.rate).unwrap_or(i32::MAX);
    let channels = sound.channels.max(1);
    let samples = (0..channels).flat_map(|channel| {
        let of_channel = sound.samples.iter().skip(channel).step_by(channels);
        of_channel.copied()
    });
    Sound::new(channels, rate, samples.collect()).map(GrabberSound)
}

#[cfg(test)]
mod tests {
    use bytes::BytesMut;
    use yarp_wire::message::ReadObject;

    use super::*;

    #[test]
    fn channels_follow_one_another_and_empty_sound_is_sent() {
        let audio = Audio {
            channels: 2,
            rate: 8_000,
            samples: vec![1, -1, 2, -2, 3, -3],
        };
        let sound = to_wire(&audio).unwrap().0;
        assert_eq!(
            (sound.channels(), sound.len(), sound.frequency()),
            (2, 3, 8_000)
        );
        assert_eq!(sound.samples(), [1, 2, 3, -1, -2, -3]);
        assert!(to_wire(&Audio::default()).unwrap().0.is_empty());
        let uneven = Audio {
            samples: vec![1],
            ..audio
        };
        assert!(to_wire(&uneven).is_err());
    }

    #[test]
    fn readers_of_3_get_the_layout_of_3_5() {
        let sound = GrabberSound(Sound::new(1, 8_000, vec![7, 8]).unwrap());
        let image = typed::Image::from_packed(
            typed::PixelCode::RGB,
            1,
            1,
            bytes::Bytes::from_static(&[1, 2, 3]),
        );
        let message = ImageWithSound {
            head: image.unwrap(),
            body: sound.clone(),
        };
        for (wire_version, layout) in [
            (WireVersion::V3, SoundLayout::Pair),
            (WireVersion::V4, SoundLayout::Marked),
        ] {
            let (mut head, mut body, mut whole) =
                (BytesMut::new(), BytesMut::new(), BytesMut::new());
            message.head.write_binary(&mut head, wire_version);
            sound
                .0
                .laid_out(layout)
                .write_binary(&mut body, wire_version);
            message.write_binary(&mut whole, wire_version);
            let expected = [&[0, 1, 0, 0, 2, 0, 0, 0][..], &head, &body].concat();
            assert_eq!(whole, expected);
            let read = Pair::<typed::Image, Sound>::read_binary(&whole.freeze(), wire_version);
            assert_eq!(read.unwrap().body, sound.0);
        }
    }
}
