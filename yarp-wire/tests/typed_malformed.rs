//! A header that lies about sizes is refused, and costs no more memory than was really sent.

mod counting;

use bytes::Bytes;
use counting::most_held;
use yarp_wire::WireVersion;
use yarp_wire::message::ReadObject;
use yarp_wire::typed::{Image, ImageError, Matrix, Pair, PixelCode, Sound, VectorOf};

/// Bytes that a reader may allocate beyond its input.
const SLACK: usize = 4 * 1024;

fn bytes(words: &[i32], rest: usize) -> Bytes {
    let words = words.iter().flat_map(|word| word.to_le_bytes());
    words.chain(std::iter::repeat_n(0, rest)).collect()
}

/// Checks that no wire version reads the message, and that trying costs nothing.
#[track_caller]
fn refused<T: ReadObject>(message: &Bytes) {
    for wire_version in [WireVersion::V3, WireVersion::V4] {
        let (result, held) = most_held(|| T::read_binary(message, wire_version).is_err());
        assert!(result, "it reads");
        assert!(
            held <= message.len() + SLACK,
            "held {held} for {}",
            message.len()
        );
    }
}

const LIES: [i32; 6] = [-1, i32::MIN, 1000, 1 << 20, 1 << 30, i32::MAX];

/// Returns a header of mono pixels: depth, size, quantum, width, height, size of the blob.
fn image(code: &str, numbers: [i32; 6], rest: usize) -> Bytes {
    let code = PixelCode::new(code).code();
    let [depth, size, quantum, width, height, blob] = numbers;
    let mat = PixelCode::new("mat").code();
    let head = [256, 4, 9, mat, 9, code, 257, 5];
    let tail = [depth, size, quantum, width, height, 12, blob];
    bytes(&[&head[..], &tail[..]].concat(), rest)
}

#[test]
fn an_image_header_agrees_with_itself() {
    let right = [1, 16, 8, 3, 2, 16];
    let good = image("mono", right, 16);
    assert!(Image::read_binary(&good, WireVersion::V3).is_ok());
    for at in 0..6 {
        for lie in [0, 2, 5, 9].into_iter().chain(LIES) {
            let mut wrong = right;
            wrong[at] = lie;
            // Some numbers can be another without a contradiction.
            let also_right = match at {
                2 => lie == 0,
                3 => lie == 2 || lie == 5,
                4 => lie == 2,
                _ => false,
            };
            if !also_right {
                refused::<Image>(&image("mono", wrong, 16));
            }
        }
    }
    for rest in [0, 15, 17] {
        refused::<Image>(&image("mono", right, rest));
    }
}

#[test]
fn an_image_larger_than_any_message_is_refused() {
    for code in ["mono", "rgbi", "xxxx"] {
        for depth in [1, 12, 1 << 16, i32::MAX] {
            for side in [1 << 15, 1 << 16, 1 << 20, i32::MAX] {
                for size in [0, 16, i32::MAX] {
                    refused::<Image>(&image(code, [depth, size, 8, side, side, size], 16));
                }
            }
        }
    }
    // Numbers that agree, for bytes that never came.
    refused::<Image>(&image(
        "mono",
        [1, 1 << 30, 8, 1 << 15, 1 << 15, 1 << 30],
        16,
    ));
}

#[test]
fn a_quantum_that_fits_no_header_is_refused() {
    for quantum in [-1, -8, 0x8000, 0x2_0008, 0x7fff_0008, i32::MIN] {
        refused::<Image>(&image("mono", [1, 16, quantum, 3, 2, 16], 16));
    }
}

#[test]
fn a_high_image_without_width_costs_nothing() {
    let flat = image("mono", [1, 0, 8, 0, i32::MAX, 0], 0);
    let (rows, held) = most_held(|| {
        let image = Image::read_binary(&flat, WireVersion::V3).unwrap();
        image.flipped().rows().count() + image.packed().len()
    });
    assert_eq!(rows, 0);
    assert!(held < SLACK);
}

#[test]
fn images_that_cannot_be_are_not_made() {
    let huge = Image::new(PixelCode::RGB, usize::MAX, 2);
    assert!(matches!(huge, Err(ImageError::TooLarge { .. })));
    let large = Image::new(PixelCode::RGB, 1 << 16, 1 << 16);
    assert!(matches!(large, Err(ImageError::TooLarge { .. })));
    let unknown = Image::new(PixelCode::new("xxxx"), 1, 1);
    assert!(matches!(unknown, Err(ImageError::UnknownPixel { .. })));
    let invalid = Image::new(PixelCode::INVALID, 1, 1);
    assert!(matches!(invalid, Err(ImageError::UnknownPixel { .. })));
    let short = Image::from_packed(PixelCode::RGB, 2, 2, vec![0; 11]);
    assert_eq!(
        short.unwrap_err().to_string(),
        "the pixels take 12 bytes, got 11"
    );
    for quantum in [0, 0x8000, usize::MAX] {
        let image = Image::from_padded(PixelCode::MONO, 1, 1, quantum, vec![0; 8]);
        assert!(matches!(image, Err(ImageError::Quantum { .. })));
    }
}

#[test]
fn counts_of_vectors_and_matrices() {
    for lie in LIES {
        for code in [256 + 10, 256 + 20, 256 + 1, 256 + 32] {
            refused::<VectorOf<f64>>(&bytes(&[code, lie], 16));
            refused::<VectorOf<i32>>(&bytes(&[code, lie], 16));
            refused::<VectorOf<u8>>(&bytes(&[code, lie], 16));
            refused::<Matrix>(&bytes(&[256, 3, 1, 1, 1, 2, code, lie], 16));
            refused::<Matrix>(&bytes(&[256, 3, 1, lie, 1, lie, code, 2], 16));
            refused::<Matrix>(&bytes(&[256, 3, 1, lie, 1, 1, code, lie], 16));
        }
    }
}

#[test]
fn counts_of_sounds() {
    let head = |items, length, channels| {
        let code = if items == 4 { 0 } else { 1 };
        vec![256, items, code, length, 1, channels, 1, 2, 1, 8000]
    };
    for lie in LIES {
        for items in [4, 5, 6] {
            refused::<Sound>(&bytes(&head(items, lie, 1), 16));
            refused::<Sound>(&bytes(&head(items, lie, lie), 16));
            let list = [&head(items, lie, 1)[..], &[320, lie]].concat();
            refused::<Sound>(&bytes(&list, 16));
            let list = [&head(items, 8, 1)[..], &[320, lie]].concat();
            refused::<Sound>(&bytes(&list, 16));
        }
        let markers = [&head(6, 0, 1)[..], &[320, 0, 256, lie]].concat();
        refused::<Sound>(&bytes(&markers, 16));
        let key = [&head(6, 0, 1)[..], &[320, 0, 256, 1, 256, 4, lie]].concat();
        refused::<Sound>(&bytes(&key, 16));
    }
    // Samples of one byte: no stock version sends the announced length.
    refused::<Sound>(&bytes(&[256, 5, 1, 4, 1, 1, 1, 1, 1, 8000, 320, 4], 8));
    refused::<Sound>(&bytes(&[256, 3], 0));
}

#[test]
fn pairs_of_what_is_not_there() {
    refused::<Pair<Image, Image>>(&bytes(&[256, 2], 0));
    refused::<Pair<Image, Image>>(&image("mono", [1, 16, 8, 3, 2, 16], 16));
}
