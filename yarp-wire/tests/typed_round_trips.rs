//! Any typed message survives a round trip in both wire versions and can precede other bytes; no
//! input makes a reader panic.

use std::fmt::Debug;

use bytes::{Bytes, BytesMut};
use proptest::collection::{btree_map, vec};
use proptest::prelude::*;
use yarp_wire::bottle::Text;
use yarp_wire::message::{Pieces, ReadObject, WireObject};
use yarp_wire::typed::{
    Image, Matrix, Pair, PixelCode, Property, ReadPrefix, Sound, SoundLayout, SoundMarker, VectorOf,
};
use yarp_wire::{Bottle, Stamp, WireVersion};

const DIALECTS: [WireVersion; 2] = [WireVersion::V3, WireVersion::V4];
const LAYOUTS: [SoundLayout; 4] = [
    SoundLayout::Pair,
    SoundLayout::Raw,
    SoundLayout::List,
    SoundLayout::Marked,
];

fn written(object: &dyn WireObject, wire_version: WireVersion) -> Bytes {
    let mut out = BytesMut::new();
    object.write_binary(&mut out, wire_version);
    out.freeze()
}

/// Checks that the object is decoded from its encoding, also if other bytes follow, and from no
/// part of it.
fn survives<T>(object: &T, wire_version: WireVersion) -> Result<(), TestCaseError>
where
    T: WireObject + ReadObject + ReadPrefix + PartialEq + Debug,
{
    let bytes = written(object, wire_version);
    let whole = T::read_binary(&bytes, wire_version);
    prop_assert_eq!(whole.as_ref(), Ok(object));
    for end in (0..bytes.len()).step_by(bytes.len() / 50 + 1) {
        prop_assert!(T::read_binary(&bytes.slice(..end), wire_version).is_err());
    }
    let mut longer = BytesMut::from(&bytes[..]);
    longer.extend_from_slice(b"tail");
    let mut longer = longer.freeze();
    prop_assert!(T::read_binary(&longer, wire_version).is_err());
    let front = T::take(&mut longer, wire_version);
    prop_assert_eq!(front.as_ref(), Ok(object));
    prop_assert_eq!(&longer[..], b"tail");
    Ok(())
}

fn finite() -> impl Strategy<Value = f64> {
    any::<f64>().prop_filter("equal to itself", |number| !number.is_nan())
}

fn matrix() -> impl Strategy<Value = Matrix> {
    (1usize..6, 1usize..6).prop_flat_map(|(rows, columns)| {
        vec(finite(), rows * columns)
            .prop_map(move |values| Matrix::new(rows, columns, values).unwrap())
    })
}

fn image() -> impl Strategy<Value = Image> {
    let codes: Vec<PixelCode> = PixelCode::TABLE.iter().map(|(code, _)| *code).collect();
    let code = prop_oneof![
        prop::sample::select(codes),
        (1u16..20).prop_map(PixelCode::of_bytes)
    ];
    let shape = (code, 0usize..12, 0usize..12, 1usize..70, any::<bool>());
    shape.prop_flat_map(|(code, width, height, quantum, marked)| {
        let pixel = code.stored_bytes(code.bytes_per_pixel().unwrap());
        vec(any::<u8>(), width * height * pixel).prop_map(move |pixels| {
            let image = Image::from_padded(code, width, height, 1, pixels).unwrap();
            image.with_quantum(quantum).unwrap().with_mark(marked)
        })
    })
}

fn text() -> impl Strategy<Value = Text> {
    vec(any::<u8>(), 0..8).prop_map(Text::from)
}

fn sound() -> impl Strategy<Value = Sound> {
    let marker =
        (text(), any::<i32>(), any::<i64>()).prop_map(|(label, channel, sample)| SoundMarker {
            label,
            channel,
            sample,
        });
    let markers = btree_map(text(), marker, 0..4);
    let samples = (1usize..5, 0usize..20)
        .prop_flat_map(|(channels, length)| (Just(channels), vec(any::<i16>(), channels * length)));
    (samples, any::<i32>(), markers).prop_map(|((channels, samples), frequency, markers)| {
        let mut sound = Sound::new(channels, frequency, samples).unwrap();
        sound.markers = markers;
        sound
    })
}

fn stamp() -> impl Strategy<Value = Stamp> {
    (any::<i32>(), finite()).prop_map(|(count, time)| Stamp { count, time })
}

fn property() -> impl Strategy<Value = Property> {
    btree_map("[a-z ]{0,5}", vec(any::<i64>(), 0..4), 0..5).prop_map(|entries| {
        let mut property = Property::new();
        for (name, values) in entries {
            let values = values.into_iter().map(Into::into).collect();
            property.put_all(&name, values);
        }
        property
    })
}

/// Reads `bytes` as everything there is.
fn read_all(bytes: &Bytes) {
    for wire_version in DIALECTS {
        let _ = VectorOf::<f64>::read_binary(bytes, wire_version);
        let _ = VectorOf::<f32>::read_binary(bytes, wire_version);
        let _ = VectorOf::<i32>::read_binary(bytes, wire_version);
        let _ = VectorOf::<u16>::read_binary(bytes, wire_version);
        let _ = VectorOf::<i8>::read_binary(bytes, wire_version);
        let _ = Matrix::read_binary(bytes, wire_version);
        let _ = Stamp::read_binary(bytes, wire_version);
        let _ = Property::read_binary(bytes, wire_version);
        let _ = Pair::<Bottle, Image>::read_binary(bytes, wire_version);
        let _ = Pair::<Stamp, VectorOf<f64>>::read_binary(bytes, wire_version);
        if let Ok(image) = Image::read_binary(bytes, wire_version) {
            use_image(&image, wire_version, bytes);
        }
        if let Ok(sound) = Sound::read_binary(bytes, wire_version) {
            for layout in LAYOUTS {
                written(&sound.laid_out(layout), wire_version);
            }
            assert!((0..sound.channels().min(9)).all(|n| sound.channel(n).is_some()));
        }
    }
}

/// Whatever was read as an image holds together.
fn use_image(image: &Image, wire_version: WireVersion, bytes: &Bytes) {
    let rows: usize = image.rows().map(<[u8]>::len).sum();
    assert_eq!(rows, image.packed().len());
    assert_eq!(image.flipped().pixels().len(), image.pixels().len());
    assert!(image.pixel(image.width(), 0).is_none());
    assert_eq!(written(image, wire_version).len(), bytes.len());
    let again = written(image, WireVersion::V3);
    assert_eq!(
        Image::read_binary(&again, WireVersion::V3).as_ref(),
        Ok(image)
    );
}

fn in_pieces(image: &Image) -> Vec<u8> {
    let mut pieces = Pieces::new();
    image.write_pieces(&mut pieces, WireVersion::V3);
    pieces.to_vec().concat()
}

proptest! {
    #[test]
    fn vectors(doubles in vec(finite(), 1..30), shorts in vec(any::<i16>(), 1..30), bytes in vec(any::<u8>(), 1..30)) {
        for wire_version in DIALECTS {
            survives(&VectorOf(doubles.clone()), wire_version)?;
            survives(&VectorOf(shorts.clone()), wire_version)?;
            survives(&VectorOf(bytes.clone()), wire_version)?;
        }
    }

    #[test]
    fn bottles_of_their_own(matrix in matrix(), stamp in stamp(), property in property()) {
        for wire_version in DIALECTS {
            survives(&matrix, wire_version)?;
            survives(&stamp, wire_version)?;
            survives(&property, wire_version)?;
            survives(&Pair { head: stamp, body: matrix.clone() }, wire_version)?;
        }
    }

    #[test]
    fn images(image in image()) {
        survives(&image, WireVersion::V3)?;
        survives(&image.clone().with_mark(false), WireVersion::V4)?;
        prop_assert_eq!(in_pieces(&image), written(&image, WireVersion::V3));
        prop_assert_eq!(image.flipped().flipped().packed(), image.packed());
        let packed = image.clone().with_quantum(1).unwrap();
        prop_assert_eq!(packed.pixels(), &image.packed());
        let bottle = Bottle::read_binary(&written(&image, WireVersion::V3), WireVersion::V3).unwrap();
        prop_assert_eq!(bottle.len(), 4);
    }

    #[test]
    fn sounds(sound in sound()) {
        survives(&sound, WireVersion::V4)?;
        for layout in LAYOUTS {
            let bytes = written(&sound.laid_out(layout), WireVersion::V3);
            let mut read = Sound::read_binary(&bytes, WireVersion::V3).unwrap();
            if layout != SoundLayout::Marked {
                read.markers = sound.markers.clone();
            }
            prop_assert_eq!(&read, &sound);
        }
    }

    #[test]
    fn conversions_keep_colours(pixels in vec(any::<[u8; 3]>(), 6)) {
        let rgb = Image::from_packed(PixelCode::RGB, 3, 2, pixels.concat()).unwrap();
        for code in [PixelCode::BGR, PixelCode::RGBA, PixelCode::BGRA] {
            let there = rgb.converted(code).unwrap();
            prop_assert_eq!(there.converted(PixelCode::RGB).unwrap(), rgb.clone());
            prop_assert_eq!(there.converted(PixelCode::MONO), rgb.converted(PixelCode::MONO));
        }
    }

    #[test]
    fn arbitrary_bytes(bytes in vec(any::<u8>(), 0..200)) {
        read_all(&bytes.into());
    }

    #[test]
    fn messages_with_bytes_changed(image in image(), sound in sound(), changes in vec((any::<prop::sample::Index>(), any::<u8>()), 1..4)) {
        for layout in LAYOUTS {
            for object in [&image as &dyn WireObject, &sound.laid_out(layout)] {
                let mut bytes = written(object, WireVersion::V3).to_vec();
                for (at, byte) in &changes {
                    let at = at.index(bytes.len().min(80));
                    bytes[at] = *byte;
                }
                read_all(&bytes.into());
            }
        }
    }
}
