//! A part of an image.

use super::Image;
use crate::DeviceError;

/// A part of an image (stock: `cropType_id_t` and its vertices). Places are column and row from 0.
#[derive(Clone, Debug, Eq, PartialEq)]
pub enum Crop {
    /// The rectangle between two corners, both in it.
    Rectangle((i32, i32), (i32, i32)),
    /// Single pixels, in a row.
    Pixels(Vec<(i32, i32)>),
}

impl Crop {
    /// The part of `image`.
    ///
    /// Errors: [`DeviceError::Unsuitable`] for parts outside the image.
    pub fn of(&self, image: &Image) -> Result<Image, DeviceError> {
        match self {
            Self::Rectangle(one, other) => {
                let (one, other) = (place(image, *one)?, place(image, *other)?);
                let (left, right) = (one.0.min(other.0), one.0.max(other.0));
                let (top, bottom) = (one.1.min(other.1), one.1.max(other.1));
                let bytes = image.format().bytes().unwrap_or(0);
                let mut pixels =
                    Vec::with_capacity((right - left + 1) * (bottom - top + 1) * bytes);
                for y in top..=bottom {
                    let row = y * image.width();
                    let part = (row + left) * bytes..(row + right + 1) * bytes;
                    pixels.extend_from_slice(&image.pixels()[part]);
                }
                Image::new(image.format(), right - left + 1, bottom - top + 1, pixels)
            }
            Self::Pixels(places) => {
                let mut pixels = Vec::new();
                for asked in places {
                    let (x, y) = place(image, *asked)?;
                    pixels.extend_from_slice(image.pixel(x, y).unwrap_or_default());
                }
                Image::new(image.format(), places.len(), 1, pixels)
            }
        }
    }
}

/// The place, if the image has it.
fn place(image: &Image, (x, y): (i32, i32)) -> Result<(usize, usize), DeviceError> {
    let inside = |at: i32, size: usize| usize::try_from(at).ok().filter(|at| *at < size);
    inside(x, image.width())
        .zip(inside(y, image.height()))
        .ok_or_else(|| DeviceError::Unsuitable {
            what: "a place in the image:",
            asked: format!("({x} {y})"),
            expected: format!("less than ({} {})", image.width(), image.height()),
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::PixelFormat;

    fn image() -> Image {
        Image::new(PixelFormat::Mono, 4, 3, (0..12).collect::<Vec<u8>>()).unwrap()
    }

    #[test]
    fn a_rectangle_has_both_corners_in_any_order() {
        let part = Crop::Rectangle((2, 2), (1, 1)).of(&image()).unwrap();
        assert_eq!((part.width(), part.height()), (2, 2));
        assert_eq!(part.pixels()[..], [5, 6, 9, 10]);
        let one = Crop::Rectangle((3, 0), (3, 0)).of(&image()).unwrap();
        assert_eq!(one.pixels()[..], [3]);
    }

    #[test]
    fn single_pixels_come_in_a_row() {
        let part = Crop::Pixels(vec![(0, 0), (3, 2), (0, 0)])
            .of(&image())
            .unwrap();
        assert_eq!((part.width(), part.height()), (3, 1));
        assert_eq!(part.pixels()[..], [0, 11, 0]);
        assert!(
            Crop::Pixels(Vec::new())
                .of(&image())
                .unwrap()
                .pixels()
                .is_empty()
        );
    }

    #[test]
    fn places_outside_are_refused() {
        for (x, y) in [(-1, 0), (4, 0), (0, 3), (i32::MIN, i32::MAX)] {
            assert!(Crop::Rectangle((0, 0), (x, y)).of(&image()).is_err());
            assert!(Crop::Pixels(vec![(x, y)]).of(&image()).is_err());
        }
    }
}
