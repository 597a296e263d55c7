//! `ahd`: the image is interpolated twice, with green along rows and along columns, and each pixel
//! is taken from the more homogeneous result.
//!
//! Homogeneous means that neighbours differ little in lightness and in colour, both as perceived
//! (CIELab); the threshold is determined at each pixel.
//!
//! Source: Hirakawa and Parks, "Adaptive homogeneity-directed demosaicing algorithm", 2005, without
//! the final filter. Details follow images of stock's library (libdc1394 2.2.6): green stays
//! between its two neighbours, equally homogeneous results are averaged, three pixels along the
//! edges are interpolated from the available neighbours, and colours are so dark on the scale of
//! CIELab that only the straight part of its curve matters.

use super::Raw;

type Colour = [u8; 3];
/// Lightness and two measures of colour, in 64ths.
type Lab = [i32; 3];
type Step = (isize, isize);

/// Along rows, along columns.
const DIRECTIONS: [Step; 2] = [(1, 0), (0, 1)];
const NEIGHBOURS: [Step; 4] = [(-1, 0), (1, 0), (0, -1), (0, 1)];
/// Pixels along the edges that are made otherwise.
const EDGE: usize = 3;

/// Returns the image in colour, row by row.
pub(super) fn coloured(raw: &Raw<'_>) -> Vec<Colour> {
    let candidates = DIRECTIONS.map(|way| Candidate::new(raw, way));
    let even = evenness(raw, &candidates);
    let mut pixels = Vec::with_capacity(raw.width * raw.height);
    for y in 0..raw.height {
        pixels.extend((0..raw.width).map(|x| {
            if !raw.is_inside(x, y, EDGE) {
                return raw.plain(x, y);
            }
            let [across, along] = even.each_ref().map(|even| around(raw, even, x, y));
            let index = y * raw.width + x;
            let [first, second] = candidates.each_ref().map(|picture| picture.colours[index]);
            match across.cmp(&along) {
                std::cmp::Ordering::Greater => first,
                std::cmp::Ordering::Less => second,
                std::cmp::Ordering::Equal => {
                    std::array::from_fn(|colour| first[colour].midpoint(second[colour]))
                }
            }
        }));
    }
    pixels
}

/// Returns the sum of a measure over a pixel and those around it.
fn around(raw: &Raw<'_>, even: &[u8], x: usize, y: usize) -> u32 {
    let rows = (y - 1..=y + 1).map(|y| &even[y * raw.width + x - 1..=y * raw.width + x + 1]);
    rows.flatten().map(|even| u32::from(*even)).sum()
}

/// The image interpolated in one direction.
struct Candidate {
    colours: Vec<Colour>,
    labs: Vec<Lab>,
}

impl Candidate {
    fn new(raw: &Raw<'_>, way: Step) -> Self {
        let count = raw.width * raw.height;
        let mut green = Vec::with_capacity(count);
        for y in 0..raw.height {
            green.extend((0..raw.width).map(|x| green_along(raw, x, y, way)));
        }
        let mut picture = Self {
            colours: vec![[0; 3]; count],
            labs: vec![[0; 3]; count],
        };
        for y in 0..raw.height {
            for x in (0..raw.width).filter(|x| raw.is_inside(*x, y, 1)) {
                let colour = colour(raw, &green, x, y);
                picture.colours[y * raw.width + x] = colour;
                picture.labs[y * raw.width + x] = lab(colour);
            }
        }
        picture
    }
}

/// Returns the green of a pixel: its own, or that of its neighbours in the given direction,
/// corrected by the difference of the pixel's own colour from the next ones. Values beyond the edge
/// are 0.
fn green_along(raw: &Raw<'_>, x: usize, y: usize, (dx, dy): Step) -> i32 {
    let at = |steps: isize| raw.at(x, y, (steps * dx, steps * dy));
    if raw.has(x, y).colour() == 1 {
        return at(0);
    }
    if !raw.is_inside(x, y, 2) {
        return 0;
    }
    let (before, behind) = (at(-1), at(1));
    let found = (2 * (before + at(0) + behind) - at(-2) - at(2)) >> 2;
    found.clamp(before.min(behind), before.max(behind))
}

/// Red and blue differ from green as they do, on the mean, at the neighbours that have them.
fn colour(raw: &Raw<'_>, green: &[i32], x: usize, y: usize) -> Colour {
    let difference = |(dx, dy): &Step| {
        let (x, y) = (x.wrapping_add_signed(*dx), y.wrapping_add_signed(*dy));
        raw.at(x, y, (0, 0)) - green[y * raw.width + x]
    };
    let own_green = green[y * raw.width + x];
    raw.by_neighbours(x, y, |offsets| {
        // By its four direct neighbours a pixel finds green.
        if offsets == super::CROSS {
            return own_green as u8;
        }
        let sum: i32 = offsets.iter().map(difference).sum();
        let mean = match offsets.len() {
            4 => (sum + 1) >> 2,
            _ => sum >> 1,
        };
        (own_green + mean).clamp(0, 255) as u8
    })
}

/// From red, green and blue with the white of daylight (D65), as in ITU-R BT.709, to CIE's X, Y, Z in
/// parts of that white.
const TO_XYZ: [[f64; 3]; 3] = [
    [
        0.412_453 / 0.950_456,
        0.357_580 / 0.950_456,
        0.180_423 / 0.950_456,
    ],
    [0.212_671, 0.715_160, 0.072_169],
    [
        0.019_334 / 1.088_754,
        0.119_193 / 1.088_754,
        0.950_227 / 1.088_754,
    ],
];
/// The slope of CIELab's curve near black, on a scale of 16 bits, in 64ths.
const SLOPE: f64 = 64.0 * 7.787 / 65_535.0;

fn lab(colour: Colour) -> Lab {
    let [x, y, z] = TO_XYZ.map(|row| {
        let parts = row.iter().zip(colour);
        let sum: f64 = parts.map(|(part, colour)| part * f64::from(colour)).sum();
        f64::from((sum + 0.5) as u8)
    });
    let cut = |factor: f64, value: f64| (factor * SLOPE * value) as i32;
    [cut(116.0, y), cut(500.0, x - y), cut(200.0, y - z)]
}

/// Returns the number of similar neighbours of each pixel, in each result.
fn evenness(raw: &Raw<'_>, candidates: &[Candidate; 2]) -> [Vec<u8>; 2] {
    let mut even = [(); 2].map(|()| vec![0; raw.width * raw.height]);
    for y in 0..raw.height {
        for x in (0..raw.width).filter(|x| raw.is_inside(*x, y, 2)) {
            let index = y * raw.width + x;
            // Differences in lightness and in colour, to each neighbour, in each result.
            let differences = candidates.each_ref().map(|picture| {
                let here = picture.labs[index];
                NEIGHBOURS.map(|(dx, dy)| {
                    let (x, y) = (x.wrapping_add_signed(dx), y.wrapping_add_signed(dy));
                    let there = picture.labs[y * raw.width + x];
                    let [light, a, b] = std::array::from_fn(|part| here[part] - there[part]);
                    (light.abs(), a * a + b * b)
                })
            });
            // The difference along rows in the row result, or along columns in the other one.
            let [across, along] = [&differences[0][..2], &differences[1][2..]].map(|pair| {
                let (first, second) = (pair[0], pair[1]);
                (first.0.max(second.0), first.1.max(second.1))
            });
            let most = (across.0.min(along.0), across.1.min(along.1));
            for (even, differences) in even.iter_mut().zip(differences) {
                let alike = |(light, colour): &(i32, i32)| *light <= most.0 && *colour <= most.1;
                even[index] = differences.iter().filter(|one| alike(one)).count() as u8;
            }
        }
    }
    even
}
