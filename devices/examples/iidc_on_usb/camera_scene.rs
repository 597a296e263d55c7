//! The scene in front of the simulated camera: colour bars that move, under a row of marks with the number of the frame.

use yarp_devices::pseudo_random::Random;

/// Number of marks in the upper row: bits of the frame's number, the lowest first.
pub(crate) const MARKS: usize = 12;
/// Height of the row of marks, pixels.
pub(crate) const MARK_ROWS: usize = 8;
/// Width of a mark, pixels.
pub(crate) const MARK_WIDTH: usize = 8;
/// Width of a bar, pixels. Bars move by whole groups of pixels that share their colour.
const BAR_WIDTH: usize = 16;
const STEP: usize = 8;
const BARS: [[u8; 3]; 8] = [
    [235, 235, 235],
    [200, 200, 30],
    [30, 190, 190],
    [40, 180, 40],
    [180, 40, 180],
    [210, 30, 30],
    [40, 40, 220],
    [20, 20, 20],
];

/// Returns the colour of a pixel of a frame.
pub(crate) fn colour(number: u32, x: usize, y: usize) -> [u8; 3] {
    if y < MARK_ROWS {
        let mark = x / MARK_WIDTH;
        let is_white = mark < MARKS && number >> mark & 1 == 1;
        return if is_white { [240; 3] } else { [16; 3] };
    }
    BARS[(x + number as usize * STEP) / BAR_WIDTH % BARS.len()]
}

/// Returns whether all pixels around one have its colour.
pub(crate) fn is_inside(number: u32, x: usize, y: usize) -> bool {
    let own = colour(number, x, y);
    let lines = y.saturating_sub(1)..=y + 1;
    lines
        .flat_map(|line| [x.saturating_sub(1), x, x + 1].map(|column| (column, line)))
        .all(|(column, line)| colour(number, column, line) == own)
}

/// Noise of the sensor, in steps of the light.
pub(crate) struct Noise(Random);

impl Noise {
    pub(crate) fn new(seed: u64) -> Self {
        Self(Random::new(seed))
    }

    fn next(&mut self) -> i32 {
        self.0.below(5) as i32 - 2
    }
}

/// Returns a frame in one of the codings of IIDC, which are numbered in its list, with noise.
pub(crate) fn frame(
    number: u32,
    coding: u32,
    (left, top): (usize, usize),
    (width, height): (usize, usize),
    brightness: i32,
    noise: &mut Noise,
) -> Vec<u8> {
    let mut bytes = Vec::new();
    for y in 0..height {
        let seen = |x: usize| colour(number, left + x, top + y);
        let mut light =
            |value: f64| (value.round() as i32 + noise.next() + brightness).clamp(0, 255) as u8;
        for x in 0..width {
            let [red, green, blue] = seen(x).map(f64::from);
            let luminance = 0.299 * red + 0.587 * green + 0.114 * blue;
            let of_blue = ((blue - luminance) / 1.772 + 128.0).round() as u8;
            let of_red = ((red - luminance) / 1.402 + 128.0).round() as u8;
            match coding {
                // Grey in 8 and in 16 bits.
                0 => bytes.push(light(luminance)),
                5 => {
                    // Twelve bits of data.
                    let value = u16::from(light(luminance)) << 4 | 0x7;
                    bytes.extend([(value >> 8) as u8, value as u8]);
                }
                // U (Y Y V Y Y): four pixels share their colour.
                1 => match x % 4 {
                    0 => bytes.extend([of_blue, light(luminance)]),
                    2 => bytes.extend([of_red, light(luminance)]),
                    _ => bytes.push(light(luminance)),
                },
                // U Y V Y: two pixels.
                2 => bytes.extend([if x % 2 == 0 { of_blue } else { of_red }, light(luminance)]),
                // U Y V.
                3 => bytes.extend([of_blue, light(luminance), of_red]),
                4 => bytes.extend([light(red), light(green), light(blue)]),
                // Behind a filter whose rows are green blue and red green.
                9 => bytes.push(match ((left + x) % 2, (top + y) % 2) {
                    (1, 0) => light(blue),
                    (0, 1) => light(red),
                    _ => light(green),
                }),
                other => panic!("the simulated camera has no coding {other}"),
            }
        }
    }
    bytes
}
