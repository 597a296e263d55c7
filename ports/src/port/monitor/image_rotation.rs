//! `image_rotation`: images turned by quarters, and mirrored.
//!
//! `options_rotate` is `rotate_cw` (the default), `rotate_ccw`, `rotate_180` or `rotate_none`; `options_flip`, done after it,
//! is `flip_x` (upside down), `flip_y` (left to right), `flip_xy` or `flip_none` (the default). As in stock, images of other
//! pixels than RGB and distances are stopped, and so are other messages.
//!
//! Source: `imageRotation.cpp` and `ImageUtils.cpp` of YARP 4.0.

use std::sync::Arc;

use yarp_wire::Value;
use yarp_wire::typed::{Image, PixelCode};

use super::depth_image::{image, of_image};
use super::{Made, Monitor, MonitorSetup, Passing};

/// Turns and mirrorings, which together are at most one transposition and a mirroring of each axis.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
struct Turn {
    /// Rows become columns first.
    transposed: bool,
    /// Columns are in reverse order then.
    left_right: bool,
    /// Rows are in reverse order then.
    upside_down: bool,
}

const ROTATIONS: [(&str, Turn); 4] = [
    ("rotate_cw", turn(true, true, false)),
    ("rotate_ccw", turn(true, false, true)),
    ("rotate_180", turn(false, true, true)),
    ("rotate_none", turn(false, false, false)),
];
/// Left to right, upside down.
const FLIPS: [(&str, (bool, bool)); 4] = [
    ("flip_x", (false, true)),
    ("flip_y", (true, false)),
    ("flip_xy", (true, true)),
    ("flip_none", (false, false)),
];

const fn turn(transposed: bool, left_right: bool, upside_down: bool) -> Turn {
    Turn {
        transposed,
        left_right,
        upside_down,
    }
}

/// `image_rotation`.
#[derive(Debug)]
pub(super) struct Rotation(Turn);

impl Rotation {
    pub(super) fn make(setup: &MonitorSetup) -> Made {
        let mut turn = chosen(setup, "options_rotate", &ROTATIONS)?.unwrap_or(ROTATIONS[0].1);
        let flip = chosen(setup, "options_flip", &FLIPS)?.unwrap_or_default();
        turn.left_right ^= flip.0;
        turn.upside_down ^= flip.1;
        Ok(Arc::new(Self(turn)))
    }
}

/// Returns what an option stands for, if it is given.
fn chosen<T: Copy>(
    setup: &MonitorSetup,
    option: &str,
    known: &[(&str, T)],
) -> Result<Option<T>, String> {
    let Some(asked) = setup.option(option).map(Value::to_plain_string) else {
        return Ok(None);
    };
    match known.iter().find(|(name, _)| *name == asked) {
        Some((_, meaning)) => Ok(Some(*meaning)),
        None => {
            let names: Vec<_> = known.iter().map(|(name, _)| *name).collect();
            let names = names.join(", ");
            Err(format!("{option} is {asked}, expected one of {names}"))
        }
    }
}

impl Turn {
    fn apply(self, image: &Image) -> Option<Image> {
        let (width, height) = (image.width(), image.height());
        let size = image.bytes_per_pixel();
        let rows: Vec<&[u8]> = match width {
            // A height without pixels could be long.
            0 => Vec::new(),
            _ => (0..height).filter_map(|y| image.row(y)).collect(),
        };
        let (columns, lines) = match self.transposed {
            true => (rows.len(), width),
            false => (width, rows.len()),
        };
        let mut packed = Vec::with_capacity(columns * lines * size);
        for y in 0..lines {
            let y = if self.upside_down { lines - 1 - y } else { y };
            for x in 0..columns {
                let x = if self.left_right { columns - 1 - x } else { x };
                let (column, row) = if self.transposed { (y, x) } else { (x, y) };
                packed.extend_from_slice(rows[row].get(column * size..)?.get(..size)?);
            }
        }
        Image::from_packed(image.code(), columns, lines, packed).ok()
    }
}

impl Monitor for Rotation {
    fn update(&self, message: Passing) -> Option<Passing> {
        let image = image(&message.payload)?;
        let known = [PixelCode::RGB, PixelCode::MONO_FLOAT];
        if !known.contains(&image.code()) {
            return None;
        }
        let turned = self.0.apply(&image)?;
        Some(message.with(of_image(&turned)))
    }
}

#[cfg(test)]
mod tests {
    use yarp_wire::Bottle;

    use super::super::{MonitorSide, of_bottle};
    use super::*;

    fn made(options: &str) -> Made {
        let options = Bottle::parse(options).unwrap();
        Rotation::make(&MonitorSetup::new(
            MonitorSide::Receive,
            "/w",
            "/r",
            options,
        ))
    }

    /// An image of three columns and two rows: 0 1 2, 3 4 5.
    fn sent(code: PixelCode) -> Passing {
        let size = code.bytes_per_pixel().unwrap();
        let pixels = (0..6_u8).flat_map(|number| vec![number; size]);
        let image = Image::from_packed(code, 3, 2, pixels.collect::<Vec<_>>()).unwrap();
        Passing::new(of_image(&image))
    }

    /// Worked out by hand from OpenCV's documentation of `rotate` and `flip`.
    #[test]
    fn pixels_are_where_stock_puts_them() {
        for code in [PixelCode::RGB, PixelCode::MONO_FLOAT] {
            for (options, width, expected) in [
                ("", 2, [3, 0, 4, 1, 5, 2]),
                ("(options_rotate rotate_cw)", 2, [3, 0, 4, 1, 5, 2]),
                ("(options_rotate rotate_ccw)", 2, [2, 5, 1, 4, 0, 3]),
                ("(options_rotate rotate_180)", 3, [5, 4, 3, 2, 1, 0]),
                ("(options_rotate rotate_none)", 3, [0, 1, 2, 3, 4, 5]),
                (
                    "(options_rotate rotate_none) (options_flip flip_x)",
                    3,
                    [3, 4, 5, 0, 1, 2],
                ),
                (
                    "(options_rotate rotate_none) (options_flip flip_y)",
                    3,
                    [2, 1, 0, 5, 4, 3],
                ),
                (
                    "(options_rotate rotate_none) (options_flip flip_xy)",
                    3,
                    [5, 4, 3, 2, 1, 0],
                ),
                (
                    "(options_rotate rotate_none) (options_flip flip_none)",
                    3,
                    [0, 1, 2, 3, 4, 5],
                ),
                // First the rotation, then the flip.
                (
                    "(options_rotate rotate_cw) (options_flip flip_x)",
                    2,
                    [5, 2, 4, 1, 3, 0],
                ),
                (
                    "(options_rotate rotate_cw) (options_flip flip_y)",
                    2,
                    [0, 3, 1, 4, 2, 5],
                ),
                (
                    "(options_rotate rotate_ccw) (options_flip flip_xy)",
                    2,
                    [3, 0, 4, 1, 5, 2],
                ),
            ] {
                let got = made(options).unwrap().update(sent(code)).unwrap();
                let got = image(&got.payload).unwrap();
                assert_eq!(
                    (got.code(), got.width(), got.height()),
                    (code, width, 6 / width)
                );
                let size = code.bytes_per_pixel().unwrap();
                let rows =
                    (0..got.height()).flat_map(|y| got.row(y).unwrap()[..width * size].to_vec());
                let pixels: Vec<u8> = rows.step_by(size).collect();
                assert_eq!(pixels, expected, "{options}");
            }
        }
    }

    #[test]
    fn other_messages_are_stopped_and_other_options_refused() {
        let monitor = made("").unwrap();
        assert!(monitor.update(sent(PixelCode::MONO)).is_none());
        let other = of_bottle(&Bottle::parse("1 2 {3}").unwrap());
        assert!(monitor.update(Passing::new(other)).is_none());
        for options in ["(options_rotate left)", "(options_flip x)"] {
            assert!(made(options).unwrap_err().contains("expected one of"));
        }
    }

    /// An image without columns may claim any height.
    #[test]
    fn empty_images_take_no_time() {
        let empty = Image::from_packed(PixelCode::RGB, 0, 1 << 30, Vec::new());
        if let Ok(empty) = empty {
            let message = Passing::new(of_image(&empty));
            let _ = made("").unwrap().update(message);
        }
    }
}
