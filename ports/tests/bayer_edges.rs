//! `recv.bayer+method.edgesense` follows edges: pixel for pixel the result of an independent
//! calculation of the same definition, plane by plane and in fractions.

use crate::common;

use common::{at, open, within};
use yarp_ports::{PortOptions, Queue};
use yarp_wire::typed::{Image, PixelCode};

const WIDTH: usize = 24;
const HEIGHT: usize = 15;

/// A plane of numbers; `None` where the value is unknown.
type Plane = Vec<Vec<Option<f64>>>;

fn rounded(value: f64) -> f64 {
    (value + 0.5).floor()
}

/// Returns the mean of a plane at these positions, if all are known.
fn mean(plane: &Plane, places: &[(i32, i32)]) -> Option<f64> {
    let at = |&(x, y): &(i32, i32)| {
        let row = plane.get(usize::try_from(y).ok()?)?;
        *row.get(usize::try_from(x).ok()?)?
    };
    let values: Vec<f64> = places.iter().map(at).collect::<Option<_>>()?;
    Some(values.iter().sum::<f64>() / values.len() as f64)
}

/// Each place of a plane.
fn each(fill: impl Fn(i32, i32) -> Option<f64>) -> Plane {
    let row = |y| (0..WIDTH as i32).map(|x| fill(x, y)).collect();
    (0..HEIGHT as i32).map(row).collect()
}

/// Returns the image in colour; `letters` are the first four pixels, row by row.
fn expected(raw: &[u8], letters: &str) -> Vec<u8> {
    let letter = |x: i32, y: i32| letters.as_bytes()[(y % 2 * 2 + x % 2) as usize];
    let pixel = |x: i32, y: i32| f64::from(raw[y as usize * WIDTH + x as usize]);
    let only = |wanted: u8| each(|x, y| (letter(x, y) == wanted).then(|| pixel(x, y)));
    let known = only(b'g');
    let green = each(|x, y| {
        if let Some(green) = known[y as usize][x as usize] {
            return Some(green);
        }
        let beside = [(x - 1, y), (x + 1, y)];
        let above = [(x, y - 1), (x, y + 1)];
        let change = |[from, to]: [(i32, i32); 2]| {
            Some((mean(&known, &[from])? - mean(&known, &[to])?).abs())
        };
        let (across, along) = (change(beside)?, change(above)?);
        let mean = if across < along {
            mean(&known, &beside)
        } else if across > along {
            mean(&known, &above)
        } else {
            mean(&known, &[beside, above].concat())
        };
        mean.map(rounded)
    });
    let colour = |wanted: u8| -> Plane {
        let differences = each(|x, y| {
            let own = (letter(x, y) == wanted).then(|| pixel(x, y))?;
            Some(own - green[y as usize][x as usize]?)
        });
        each(|x, y| {
            if letter(x, y) == wanted {
                return Some(pixel(x, y));
            }
            let ways = [
                vec![(x - 1, y), (x + 1, y)],
                vec![(x, y - 1), (x, y + 1)],
                vec![
                    (x - 1, y - 1),
                    (x + 1, y - 1),
                    (x - 1, y + 1),
                    (x + 1, y + 1),
                ],
            ];
            // Only one of these leads to pixels of the colour.
            let mean = ways.iter().find_map(|way| mean(&differences, way))?;
            Some(rounded(green[y as usize][x as usize]? + mean).clamp(0.0, 255.0))
        })
    };
    let planes = [colour(b'r'), green.clone(), colour(b'b')];
    let mut pixels = Vec::new();
    for y in 0..HEIGHT {
        for x in 0..WIDTH {
            let inside = (2..WIDTH - 2).contains(&x) && (2..HEIGHT - 2).contains(&y);
            let of_plane = |plane: &Plane| plane[y][x].filter(|_| inside).unwrap_or(0.0) as u8;
            pixels.extend(planes.iter().map(of_plane));
        }
    }
    pixels
}

/// Noise, steps and even areas.
fn raw_pixels() -> Vec<u8> {
    let mut seed = 1u32;
    let pixels = (0..WIDTH * HEIGHT).map(|index| {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let (x, y) = (index % WIDTH, index / WIDTH);
        match (x / 8, y / 5) {
            (0, _) => (seed >> 24) as u8,
            (1, 0) => 255 * u8::from(x + y > 14),
            (1, _) => 77,
            _ => (seed >> 30) as u8 * 85,
        }
    });
    pixels.collect()
}

#[tokio::test]
async fn edges_are_followed() {
    let reader = open("/r", PortOptions::new().queue(Queue::Wait(10))).await;
    let writer = open("/w", PortOptions::new()).await;
    let pixels = raw_pixels();
    let raw = Image::from_packed(PixelCode::MONO, WIDTH, HEIGHT, pixels.clone()).unwrap();
    for order in ["grbg", "gbrg", "rggb", "bggr"] {
        let carrier = format!("tcp+recv.bayer+method.edgesense+order.{order}");
        within(writer.connect(&at(&reader, &carrier)))
            .await
            .unwrap();
        assert_eq!(within(writer.write(&raw)).await, 1);
        let read: Image = within(reader.read()).await.unwrap().read().unwrap();
        let colours = expected(&pixels, order);
        // There is something to see, in more than one colour.
        assert!(colours.chunks(3).any(|pixel| pixel[0] != pixel[2]));
        assert_eq!(read.packed().to_vec(), colours, "{order}");
    }
}
