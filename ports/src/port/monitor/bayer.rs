//! `recv.bayer`: raw Bayer images of cameras, converted to `rgb` images.
//!
//! | option | values |
//! | --- | --- |
//! | `order` | the first four pixels, row by row: `grbg` (usual), `gbrg`, `rggb`, `bggr` |
//! | `method` | `bilinear` (usual), `nearest`, `simple`, `hqlinear`, `edgesense`, `vng`, `ahd`, `downsample` |
//! | `size` | `half`: a pixel for each four; as `downsample` |
//!
//! As in stock, images with a row length that is not a multiple of 8 are always interpolated from
//! the available neighbours, and the other methods leave a black edge where neighbours are missing.
//! `vng` and `ahd` take several times as long as the others. Stock's `edgesense` has done nothing
//! since its library removed it because of a patent, and returns uninitialised memory; here it
//! works as named. Messages that are not images are stopped.
//!
//! Source: images produced by 3.5.0, byte for byte; `hqlinear` is by Malvar, He and Cutler,
//! "High-quality linear interpolation for demosaicing of Bayer-patterned color images", 2004;
//! `edgesense` by Hibbard, US patent 5,382,976 of 1995 (expired), as described by Ramanath, Snyder,
//! Bilbro and Sander in "Demosaicking methods for Bayer color arrays", 2002: green is the mean
//! along the direction in which it changes less, and the differences of the other colours from
//! green are the means of those of their neighbours. Means are rounded, halves up. [`vng`] and
//! [`ahd`] name their sources.

mod ahd;
#[cfg(test)]
mod demosaic_tests;
mod vng;

use std::cmp::Ordering;
use std::sync::Arc;

use yarp_wire::Value;
use yarp_wire::message::Payload;
use yarp_wire::typed::{Image, PixelCode};

use super::depth_image::{image, of_image};
use super::{Made, Monitor, MonitorSetup, Passing};

/// The method of interpolating missing colours.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Method {
    Bilinear,
    Nearest,
    Simple,
    HighQuality,
    EdgeSensing,
    VariableGradients,
    Homogeneity,
    Half,
}

const METHODS: [(&str, Method); 8] = [
    ("bilinear", Method::Bilinear),
    ("nearest", Method::Nearest),
    ("simple", Method::Simple),
    ("hqlinear", Method::HighQuality),
    ("edgesense", Method::EdgeSensing),
    ("vng", Method::VariableGradients),
    ("ahd", Method::Homogeneity),
    ("downsample", Method::Half),
];

/// The position of the first red pixel.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
struct Order {
    red_x: usize,
    red_y: usize,
}

const ORDERS: [(&str, Order); 4] = [
    ("grbg", Order { red_x: 1, red_y: 0 }),
    ("gbrg", Order { red_x: 0, red_y: 1 }),
    ("rggb", Order { red_x: 0, red_y: 0 }),
    ("bggr", Order { red_x: 1, red_y: 1 }),
];

#[derive(Debug)]
pub(super) struct Bayer {
    method: Method,
    order: Order,
}

/// Looks up the value of an option in a table; the first entry by default.
fn choice<T: Copy>(setup: &MonitorSetup, name: &str, table: &[(&str, T)]) -> Result<T, String> {
    let Some(wanted) = setup.option(name).map(Value::to_plain_string) else {
        return Ok(table[0].1);
    };
    let found = table.iter().find(|(known, _)| *known == wanted);
    found.map(|(_, value)| *value).ok_or_else(|| {
        let known: Vec<_> = table.iter().map(|(known, _)| *known).collect();
        format!("{name} is {wanted:?}, known are {}", known.join(", "))
    })
}

impl Bayer {
    pub(super) fn make(setup: &MonitorSetup) -> Made {
        let order = choice(setup, "order", &ORDERS)?;
        let mut method = choice(setup, "method", &METHODS)?;
        if choice(setup, "size", &[("full", false), ("half", true)])? {
            method = Method::Half;
        }
        Ok(Arc::new(Self { method, order }))
    }

    /// Returns the image in colour; `None` if the message is no image of raw pixels.
    fn coloured(&self, payload: &Payload) -> Option<Image> {
        let image = image(payload)?;
        let raw = match image.code() {
            PixelCode::MONO
            | PixelCode::BAYER_GRBG8
            | PixelCode::BAYER_GBRG8
            | PixelCode::BAYER_RGGB8
            | PixelCode::BAYER_BGGR8 => image,
            _ => image.converted(PixelCode::MONO).ok()?,
        };
        let packed = raw.packed();
        let raw = Raw {
            pixels: &packed,
            width: raw.width(),
            height: raw.height(),
            order: self.order,
        };
        let (width, height, pixels) = raw.coloured(self.method);
        Image::from_padded(PixelCode::RGB, width, height, 1, pixels).ok()
    }
}

impl Monitor for Bayer {
    fn update(&self, message: Passing) -> Option<Passing> {
        let image = self.coloured(&message.payload)?;
        Some(message.with(of_image(&image)))
    }
}

/// An image of which each pixel has one colour.
struct Raw<'a> {
    pixels: &'a [u8],
    width: usize,
    height: usize,
    order: Order,
}

/// The colour of a pixel in the raw image.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Has {
    Red,
    Blue,
    /// Green, with red to its left and right.
    GreenByRed,
    /// Green, with blue to its left and right.
    GreenByBlue,
}

impl Has {
    /// Returns its place among red, green and blue.
    fn colour(self) -> usize {
        match self {
            Self::Red => 0,
            Self::GreenByRed | Self::GreenByBlue => 1,
            Self::Blue => 2,
        }
    }
}

const BLACK: [u8; 3] = [0; 3];

impl Raw<'_> {
    fn coloured(&self, method: Method) -> (usize, usize, Vec<u8>) {
        let plain = !self.width.is_multiple_of(8);
        let (width, height) = match method {
            Method::Half => (self.width / 2, self.height / 2),
            _ => (self.width, self.height),
        };
        let whole = match method {
            Method::VariableGradients if !plain && width > 0 => Some(vng::coloured(self)),
            Method::Homogeneity if !plain && width > 0 => Some(ahd::coloured(self)),
            _ => None,
        };
        if let Some(pixels) = whole {
            return (width, height, pixels.into_flattened());
        }
        let mut pixels = Vec::with_capacity(width * height * 3);
        // A height without pixels could be long.
        let rows = if width == 0 { 0 } else { height };
        for y in 0..rows {
            for x in 0..width {
                pixels.extend(match method {
                    Method::Half => self.half(2 * x, 2 * y, plain),
                    _ if plain => self.plain(x, y),
                    Method::Bilinear => self.bilinear(x, y),
                    Method::Nearest => self.nearest(x, y),
                    Method::Simple => self.simple(x, y),
                    Method::HighQuality => self.high_quality(x, y),
                    Method::EdgeSensing => self.edge_sensing(x, y),
                    // Made whole above.
                    Method::VariableGradients | Method::Homogeneity => self.plain(x, y),
                });
            }
        }
        (width, height, pixels)
    }

    fn has(&self, x: usize, y: usize) -> Has {
        match ((x + self.order.red_x) % 2, (y + self.order.red_y) % 2) {
            (0, 0) => Has::Red,
            (1, 1) => Has::Blue,
            (_, 0) => Has::GreenByRed,
            _ => Has::GreenByBlue,
        }
    }

    /// Returns the pixel that is so far to the right and down; it must exist.
    fn at(&self, x: usize, y: usize, (dx, dy): (isize, isize)) -> i32 {
        let (x, y) = (x.wrapping_add_signed(dx), y.wrapping_add_signed(dy));
        i32::from(self.pixels[y * self.width + x])
    }

    /// Returns whether the pixel has this many neighbours on each side.
    fn is_inside(&self, x: usize, y: usize, edge: usize) -> bool {
        x >= edge && y >= edge && x + edge < self.width && y + edge < self.height
    }

    /// Returns the mean of those of four or two neighbours that there are, rounded down.
    fn mean(&self, x: usize, y: usize, offsets: &[(isize, isize)]) -> u8 {
        let (mut sum, mut count) = (0, 0);
        for offset in offsets {
            let (Some(nx), Some(ny)) = (
                x.checked_add_signed(offset.0),
                y.checked_add_signed(offset.1),
            ) else {
                continue;
            };
            if nx < self.width && ny < self.height {
                sum += self.at(nx, ny, (0, 0));
                count += 1;
            }
        }
        if count == 0 { 0 } else { (sum / count) as u8 }
    }

    /// Red, green and blue out of the pixel's own colour and those of its neighbours.
    fn by_neighbours(
        &self,
        x: usize,
        y: usize,
        around: impl Fn(&[(isize, isize)]) -> u8,
    ) -> [u8; 3] {
        let own = self.at(x, y, (0, 0)) as u8;
        match self.has(x, y) {
            Has::Red => [own, around(&CROSS), around(&CORNERS)],
            Has::Blue => [around(&CORNERS), around(&CROSS), own],
            Has::GreenByRed => [around(&BESIDE), own, around(&ABOVE)],
            Has::GreenByBlue => [around(&ABOVE), own, around(&BESIDE)],
        }
    }

    fn plain(&self, x: usize, y: usize) -> [u8; 3] {
        self.by_neighbours(x, y, |offsets| self.mean(x, y, offsets))
    }

    fn bilinear(&self, x: usize, y: usize) -> [u8; 3] {
        if !self.is_inside(x, y, 1) {
            return BLACK;
        }
        self.by_neighbours(x, y, |offsets| {
            let sum: i32 = offsets.iter().map(|offset| self.at(x, y, *offset)).sum();
            let count = offsets.len() as i32;
            ((sum + count / 2) / count) as u8
        })
    }

    /// Returns the colours of the square that the pixel begins; `None` at the right and lower edge.
    fn square(&self, x: usize, y: usize) -> Option<[i32; 4]> {
        let inside = x + 1 < self.width && y + 1 < self.height;
        inside.then(|| [(0, 0), (1, 0), (0, 1), (1, 1)].map(|offset| self.at(x, y, offset)))
    }

    /// Out of a square, red and blue, and green as chosen out of the two that there are.
    fn of_square(&self, x: usize, y: usize, green: impl Fn(bool, i32, i32) -> i32) -> [u8; 3] {
        let Some([own, right, below, across]) = self.square(x, y) else {
            return BLACK;
        };
        let (red, green, blue) = match self.has(x, y) {
            Has::Red => (own, green(false, right, below), across),
            Has::Blue => (across, green(false, right, below), own),
            Has::GreenByRed => (right, green(true, own, across), below),
            Has::GreenByBlue => (below, green(true, own, across), right),
        };
        [red as u8, green as u8, blue as u8]
    }

    fn nearest(&self, x: usize, y: usize) -> [u8; 3] {
        self.of_square(x, y, |own, first, second| if own { second } else { first })
    }

    fn simple(&self, x: usize, y: usize) -> [u8; 3] {
        self.of_square(x, y, |_, first, second| (first + second + 1) >> 1)
    }

    fn half(&self, x: usize, y: usize, plain: bool) -> [u8; 3] {
        // Stock leaves out the last square of rows that are no multiple of 8.
        if plain && (x + 2 >= self.width || y + 2 >= self.height) {
            return BLACK;
        }
        self.of_square(x, y, |_, first, second| (first + second) >> 1)
    }

    fn edge_sensing(&self, x: usize, y: usize) -> [u8; 3] {
        if !self.is_inside(x, y, 2) {
            return BLACK;
        }
        let green = self.green_along_edges(x, y);
        self.by_neighbours(x, y, |offsets| {
            if offsets == CROSS {
                return green as u8;
            }
            let difference = |offset: &(isize, isize)| {
                let (x, y) = (
                    x.wrapping_add_signed(offset.0),
                    y.wrapping_add_signed(offset.1),
                );
                self.at(x, y, (0, 0)) - self.green_along_edges(x, y)
            };
            let sum: i32 = offsets.iter().map(difference).sum();
            let count = offsets.len() as i32;
            (green + (sum + count / 2).div_euclid(count)).clamp(0, 255) as u8
        })
    }

    /// Returns the green of a pixel that has a neighbour on each side.
    fn green_along_edges(&self, x: usize, y: usize) -> i32 {
        if matches!(self.has(x, y), Has::GreenByRed | Has::GreenByBlue) {
            return self.at(x, y, (0, 0));
        }
        let [left, right, above, below] = CROSS.map(|offset| self.at(x, y, offset));
        match (left - right).abs().cmp(&(above - below).abs()) {
            Ordering::Less => (left + right + 1) >> 1,
            Ordering::Greater => (above + below + 1) >> 1,
            Ordering::Equal => (left + right + above + below + 2) >> 2,
        }
    }

    fn high_quality(&self, x: usize, y: usize) -> [u8; 3] {
        if !self.is_inside(x, y, 2) {
            return BLACK;
        }
        let at = |offset| self.at(x, y, offset);
        let sum = |offsets: &[(isize, isize)]| -> i32 { offsets.iter().map(|o| at(*o)).sum() };
        let round = |eighths: i32| ((eighths + 4) >> 3).clamp(0, 255) as u8;
        let own = at((0, 0));
        let (corners, far_beside, far_above) = (sum(&CORNERS), sum(&FAR_BESIDE), sum(&FAR_ABOVE));
        let far = far_beside + far_above;
        // For a green pixel: the colours beside it, and above and below it.
        let beside = || {
            let across = (far_above + 1) >> 1;
            round(5 * own + 4 * sum(&BESIDE) - far_beside - corners + across)
        };
        let above = || {
            let across = (far_beside + 1) >> 1;
            round(5 * own + 4 * sum(&ABOVE) - far_above - corners + across)
        };
        // For the others: green, and the colour at the corners.
        let green = || round(4 * own + 2 * sum(&CROSS) - far);
        let other = || round(6 * own + 2 * corners - ((3 * far + 1) >> 1));
        match self.has(x, y) {
            Has::Red => [own as u8, green(), other()],
            Has::Blue => [other(), green(), own as u8],
            Has::GreenByRed => [beside(), own as u8, above()],
            Has::GreenByBlue => [above(), own as u8, beside()],
        }
    }
}

const BESIDE: [(isize, isize); 2] = [(-1, 0), (1, 0)];
const ABOVE: [(isize, isize); 2] = [(0, -1), (0, 1)];
const CROSS: [(isize, isize); 4] = [(-1, 0), (1, 0), (0, -1), (0, 1)];
const CORNERS: [(isize, isize); 4] = [(-1, -1), (1, -1), (-1, 1), (1, 1)];
const FAR_BESIDE: [(isize, isize); 2] = [(-2, 0), (2, 0)];
const FAR_ABOVE: [(isize, isize); 2] = [(0, -2), (0, 2)];
