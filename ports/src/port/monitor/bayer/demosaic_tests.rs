//! Tests of the two methods that use more than the nearest neighbours.

use super::{METHODS, Method, ORDERS, Order, Raw};

const WIDTH: usize = 64;
const HEIGHT: usize = 48;

fn named(name: &str) -> (Method, Order) {
    let (method, order) = name.split_once(' ').unwrap();
    let method = METHODS
        .iter()
        .find(|(known, _)| *known == method)
        .unwrap()
        .1;
    let order = ORDERS.iter().find(|(known, _)| *known == order).unwrap().1;
    (method, order)
}

fn coloured(pixels: &[u8], width: usize, height: usize, name: &str) -> Vec<u8> {
    let (method, order) = named(name);
    let raw = Raw {
        pixels,
        width,
        height,
        order,
    };
    let (new_width, new_height, colours) = raw.coloured(method);
    assert_eq!((new_width, new_height), (width, height));
    assert_eq!(colours.len(), 3 * width * height);
    colours
}

/// Returns the raw image in which each pixel keeps one colour.
fn mosaic(picture: &[u8], order: Order) -> Vec<u8> {
    let raw = Raw {
        pixels: &[],
        width: WIDTH,
        height: HEIGHT,
        order,
    };
    let pixel = |index: usize| {
        let colour = raw.has(index % WIDTH, index / WIDTH).colour();
        picture[3 * index + colour]
    };
    (0..WIDTH * HEIGHT).map(pixel).collect()
}

/// Peak signal to noise ratio, in decibels, of all but the edges.
fn quality(picture: &[u8], made: &[u8]) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for (index, (one, other)) in picture.iter().zip(made).enumerate() {
        let (x, y) = (index / 3 % WIDTH, index / 3 / WIDTH);
        if (5..WIDTH - 5).contains(&x) && (5..HEIGHT - 5).contains(&y) {
            sum += (f64::from(*one) - f64::from(*other)).powi(2);
            count += 1;
        }
    }
    10.0 * (255.0 * 255.0 / (sum / f64::from(count))).log10()
}

/// Each pixel by its place.
fn picture(colour: impl Fn(f64, f64) -> [f64; 3]) -> Vec<u8> {
    let pixels = (0..WIDTH * HEIGHT)
        .flat_map(|index| colour((index % WIDTH) as f64, (index / WIDTH) as f64));
    pixels.map(|value| value.clamp(0.0, 255.0) as u8).collect()
}

#[test]
fn pictures_are_those_of_stocks_library() {
    let mut seed = 1u32;
    let noise: Vec<u8> = (0..40 * 31)
        .map(|_| {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 24) as u8
        })
        .collect();
    // FNV-1a of what libdc1394 2.2.6 made of it.
    for (name, expected) in [
        ("vng grbg", 0xcebb_81a1_f927_8950),
        ("vng gbrg", 0xc7f5_3818_0738_eb60),
        ("vng rggb", 0x1361_33ed_b92f_f893),
        ("vng bggr", 0x74c1_c220_4c2d_da97),
        ("ahd grbg", 0x9792_20c8_795e_5d61),
        ("ahd gbrg", 0x1c6a_9fba_f53f_f987),
        ("ahd rggb", 0xeef8_7b4c_5bae_f24f),
        ("ahd bggr", 0x0d78_70d0_1425_c508),
    ] {
        let made = coloured(&noise, 40, 31, name);
        let hash = made.iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
            (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3)
        });
        assert_eq!(hash, expected, "{name}");
    }
}

#[test]
fn a_flat_field_stays_flat() {
    for value in [0, 1, 100, 255] {
        let flat = vec![value; WIDTH * HEIGHT];
        for (name, edge) in [
            ("vng rggb", 1),
            ("vng grbg", 1),
            ("ahd gbrg", 0),
            ("ahd bggr", 0),
        ] {
            let made = coloured(&flat, WIDTH, HEIGHT, name);
            for (index, colour) in made.iter().enumerate() {
                let (x, y) = (index / 3 % WIDTH, index / 3 / WIDTH);
                let inside =
                    (edge..WIDTH - edge).contains(&x) && (edge..HEIGHT - edge).contains(&y);
                assert_eq!(
                    *colour,
                    if inside { value } else { 0 },
                    "{name} {value} at {x}, {y}"
                );
            }
        }
    }
}

#[test]
fn smooth_images_are_restored_better_than_by_bilinear() {
    let waves = picture(|x, y| {
        let light = 60.0 * (0.9 * x + 0.2 * y).sin() + 120.0;
        [light + 30.0, light, light - 40.0]
    });
    let edges = picture(|x, y| {
        let light = if (x - 0.4 * y) % 16.0 < 8.0 {
            180.0
        } else {
            50.0
        };
        [light + 20.0, light, light + 40.0]
    });
    for (what, picture) in [("waves", waves), ("edges", edges)] {
        for (order, chosen) in ORDERS {
            let raw = mosaic(&picture, chosen);
            let made = |method| {
                let colours = coloured(&raw, WIDTH, HEIGHT, &format!("{method} {order}"));
                quality(&picture, &colours)
            };
            let (plain, vng, ahd) = (made("bilinear"), made("vng"), made("ahd"));
            println!("{what} {order}: bilinear {plain:.1} dB, vng {vng:.1} dB, ahd {ahd:.1} dB");
            assert!(
                vng > plain + 3.0 && ahd > plain + 3.0,
                "{what} {order}: {plain} {vng} {ahd}"
            );
        }
    }
}

#[test]
fn images_of_any_size_are_taken() {
    for name in ["vng rggb", "vng gbrg", "ahd grbg", "ahd bggr"] {
        for width in [0, 1, 2, 3, 7, 8, 9, 16, 24] {
            for height in [0, 1, 2, 3, 4, 5, 6, 7, 11] {
                let noise: Vec<u8> = (0..width * height).map(|n| (n * 97) as u8).collect();
                coloured(&noise, width, height, name);
            }
        }
    }
}
