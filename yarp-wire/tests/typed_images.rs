//! Images are the very bytes of stock, both ways.
//!
//! Bytes marked 3.5 were written by stock YARP 3.5.0; images of 3.12.3 and 4.0.0 were recorded.

use crate::typed_common;

use bytes::Bytes;
use typed_common::{bytes, check, refused, text, written};
use yarp_wire::WireVersion;
use yarp_wire::message::{Form, Payload, Pieces, ReadObject, WireObject};
use yarp_wire::typed::{IMAGE_HEADER, Image, PixelCode};

/// Header of a 2 x 1 rgb image.
const RED_GREEN: &str = "00010000 04000000 09000000 6d617400 09000000 72676200 01010000 05000000
    03000000 08000000 08000000 02000000 01000000 0c000000 08000000 ff0000 00ff00 0000";

#[test]
fn images() {
    let image = Image::from_packed(PixelCode::RGB, 2, 1, vec![255, 0, 0, 0, 255, 0]).unwrap();
    // 3.5; the form in 4.0 is the same.
    check(&image, WireVersion::V3, RED_GREEN);
    check(&image, WireVersion::V4, RED_GREEN);
    assert_eq!(
        text(&image),
        "[mat] [rgb] (3 8 8 2 1) {255 0 0 0 255 0 0 0}\n"
    );
    assert_eq!(image.pixel(1, 0), Some(&[0, 255, 0][..]));
    assert_eq!(image.pixel(2, 0), None);
    assert_eq!(image.row(1), None);
    let mut pieces = Pieces::new();
    image.write_pieces(&mut pieces, WireVersion::V3);
    assert_eq!(pieces.to_vec().concat(), bytes(RED_GREEN));
}

#[test]
fn an_image_is_read_from_text() {
    let text = Bytes::from_static(b"[mat] [mono] (1 8 8 2 1) {1 2 3 4 5 6 7 8}");
    let image = Image::read(&Payload::new(text, Form::Text)).unwrap();
    assert_eq!(image.row(0), Some(&[1, 2][..]));
}

#[test]
fn a_bottom_up_image_has_a_mark() {
    // 3.5: setTopIsLowIndex(false), quantum 1, row 0 is 1 2 3, row 1 is 4 5 6.
    let hex = "00010000 04000000 09000000 6d617400 09000000 72676200 01010000 05000000
        03000000 06000000 0100 0100 01000000 02000000 0c000000 06000000 040506 010203";
    let image = Image::from_padded(PixelCode::RGB, 1, 2, 1, vec![4, 5, 6, 1, 2, 3]).unwrap();
    let image = image.with_mark(true);
    check(&image, WireVersion::V3, hex);
    assert_eq!(image.flipped().packed(), [1, 2, 3, 4, 5, 6].as_slice());
    assert!(!image.flipped().is_marked());
    // A 4.0 reader would take the mark for a quantum of 65537.
    let plain = hex.replace("0100 0100", "0100 0000");
    assert_eq!(written(&image, WireVersion::V4), bytes(&plain));
    assert_eq!(Image::read_binary(&bytes(hex), WireVersion::V4), Ok(image));
}

#[test]
fn images_without_pixels() {
    // 3.5: ImageOf<PixelRgb> as made, FlexImage as made, and resized to 0 x 5.
    for (hex, width, height) in [
        (
            "72676200 01010000 05000000 03000000 00000000 00000000 00000000 00000000",
            0,
            0,
        ),
        (
            "00000000 01010000 05000000 00000000 00000000 00000000 00000000 00000000",
            0,
            0,
        ),
        (
            "72676200 01010000 05000000 03000000 00000000 08000000 00000000 05000000",
            0,
            5,
        ),
    ] {
        let hex = format!("00010000 04000000 09000000 6d617400 09000000 {hex} 0c000000 00000000");
        let image = Image::read_binary(&bytes(&hex), WireVersion::V3).unwrap();
        assert_eq!((image.width(), image.height()), (width, height));
        assert_eq!(image.rows().count(), 0);
        assert_eq!(written(&image, WireVersion::V3), bytes(&hex));
        assert_eq!(written(&image.flipped(), WireVersion::V3), bytes(&hex));
    }
}

/// Bytes per pixel and per row of five pixels, as 3.5 keeps images of each code.
#[test]
fn pixels_of_every_code() {
    let rows = |word, stated, row| {
        let image = Image::new(PixelCode::new(word), 5, 2).unwrap();
        assert_eq!(image.bytes_per_pixel(), stated, "{word}");
        assert_eq!(image.stride(), row, "{word}");
        assert_eq!(image.code().to_string(), word);
    };
    for word in [
        "mono", "sign", "grbg", "bggr", "gbrg", "rggb", "yuva", "yuvb", "yuvd",
    ] {
        rows(word, 1, 8);
    }
    rows("yuvc", 1, 16);
    for word in ["mo16", "gr16", "bg16", "gb16", "rg16"] {
        rows(word, 2, 16);
    }
    for word in ["rgb", "bgr", "hsv", "rgb-"] {
        rows(word, 3, 16);
    }
    for word in ["rgba", "bgra", "int", "dec"] {
        rows(word, 4, 24);
    }
    for word in ["rgbi", "rgb.", "hsv."] {
        rows(word, 12, 64);
    }
    assert_eq!(PixelCode::TABLE.len(), 26);
    let unnamed = Image::new(PixelCode::of_bytes(2), 3, 2).unwrap();
    assert_eq!((unnamed.stride(), unnamed.code().code()), (8, -2));
}

#[test]
fn a_known_code_has_pixels_of_its_size() {
    refused::<Image>(WireVersion::V3, &RED_GREEN.replace("72676200", "72676261"));
}

#[test]
fn an_unknown_pixel_code_is_kept() {
    let hex = RED_GREEN.replace("72676200", "78787878");
    let image = Image::read_binary(&bytes(&hex), WireVersion::V3).unwrap();
    assert_eq!(image.code().to_string(), "xxxx");
    assert_eq!(image.pixel(1, 0), Some(&[0, 255, 0][..]));
    assert_eq!(written(&image, WireVersion::V3), bytes(&hex));
}

#[test]
fn pixels_are_shared_with_the_message() {
    let message = bytes(RED_GREEN);
    let image = Image::read_binary(&message, WireVersion::V3).unwrap();
    let at = message[IMAGE_HEADER..].as_ptr();
    assert_eq!(image.pixels().as_ptr(), at);
    let even = Image::from_packed(PixelCode::MONO, 8, 1, vec![7; 8]).unwrap();
    assert_eq!(even.packed().as_ptr(), even.pixels().as_ptr());
}

/// The image that `fakeFrameGrabber` sent, 32 x 24, in recordings of 3.12.3 and of 4.0.0: runs of
/// black (k), green and cyan (c) pixels, row by row.
const RECORDED_ROWS: &str =
    "k4g19k9 k3g21k8 k2g23k7 k1g25k6 k1g12c1g12k6 g10c7g10k5 g8c11g8k5 g7c13g8k4
    g7c13g8k4 g6c15g7k4 g6c15g7k4 g6c15g7k4 g5c17g7k3 g6c15g7k4 g6c15g7k4 g6c15g7k4 g7c13g8k4
    g7c13g8k4 g8c11g8k5 g10c7g10k5 k1g12c1g12k6 k1g25k6 k2g23k7 k3g21k8";
/// FNV-1a of the recorded pixels.
const RECORDED_HASH: u64 = 0x719a_4305_bb63_701a;

fn recorded_pixels() -> Vec<u8> {
    let mut pixels = Vec::new();
    for mut row in RECORDED_ROWS.split_whitespace() {
        while let Some(letter) = row.chars().next() {
            let digits = row[1..].find(char::is_alphabetic).unwrap_or(row.len() - 1);
            let (run, rest) = row.split_at(1 + digits);
            let colour = match letter {
                'k' => [0; 3],
                'g' => [0, 255, 0],
                _ => [0, 255, 255],
            };
            pixels.extend(colour.repeat(run[1..].parse().unwrap()));
            row = rest;
        }
    }
    let hash = pixels.iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3)
    });
    assert_eq!((pixels.len(), hash), (2304, RECORDED_HASH));
    pixels
}

#[test]
fn recorded_images_of_both_wire_versions() {
    let header = |quantum| {
        format!(
            "00010000 04000000 09000000 6d617400 09000000 72676200 01010000 05000000
             03000000 00090000 {quantum} 20000000 18000000 0c000000 00090000"
        )
    };
    let pixels = Bytes::from(recorded_pixels());
    for (wire_version, quantum, marked) in [
        (WireVersion::V3, "0800 0100", true),
        (WireVersion::V4, "08000000", false),
    ] {
        let message = Bytes::from([bytes(&header(quantum)), pixels.clone()].concat());
        let image = Image::read_binary(&message, wire_version).unwrap();
        assert_eq!((image.width(), image.height()), (32, 24));
        assert_eq!((image.quantum(), image.stride()), (8, 96));
        // 3.12 marks every image, though its rows come from the top as in 4.0.
        assert_eq!(image.is_marked(), marked);
        assert_eq!(image.pixels(), &pixels);
        assert_eq!(image.pixel(4, 0), Some(&[0, 255, 0][..]));
        assert_eq!(written(&image, wire_version), message);
        // An image does not reveal the wire version, so either must decode it.
        assert_eq!(
            Image::read_binary(&message, wire_version.other()),
            Ok(image)
        );
    }
}

#[test]
fn images_are_converted_as_in_stock() {
    let rgb = Image::from_packed(PixelCode::RGB, 2, 1, vec![1, 2, 4, 255, 254, 255]).unwrap();
    let check = |code, packed: &[u8]| {
        assert_eq!(rgb.converted(code).unwrap().packed(), packed, "{code}");
    };
    check(PixelCode::MONO, &[2, 254]);
    check(PixelCode::BGR, &[4, 2, 1, 255, 254, 255]);
    check(PixelCode::RGBA, &[1, 2, 4, 255, 255, 254, 255, 255]);
    check(PixelCode::BGRA, &[4, 2, 1, 255, 255, 254, 255, 255]);
    assert!(rgb.converted(PixelCode::HSV).is_err());
    let depth = Image::from_packed(PixelCode::MONO_FLOAT, 1, 1, 1.5f32.to_le_bytes().to_vec());
    let depth = depth.unwrap();
    assert_eq!(depth.row_of::<f32>(0).unwrap().collect::<Vec<_>>(), [1.5]);
    assert!(depth.row_of::<f64>(0).is_none());
}
