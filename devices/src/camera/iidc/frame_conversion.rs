//! Conversion of frames of a camera to images, with every length checked.
//!
//! Sources: IIDC 1.31, 4.2.2 for the order of bytes; ITU-T T.871 for colours, luminance and chrominance from 0 to 255.

use crate::camera::hardware::{MAX_BUFFER_BYTES, MAX_PIXELS};
use crate::image::{Image, MAX_IMAGE_SIDE, PixelFormat};

/// Bits of data for each value of a camera that has two bytes for it.
const DEPTHS: std::ops::RangeInclusive<u32> = 8..=16;

/// Coding of the pixels of a frame, in the order of the list of IIDC.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Coding {
    Mono8,
    Yuv411,
    Yuv422,
    Yuv444,
    Rgb8,
    Mono16,
    Rgb16,
    Mono16Signed,
    Rgb16Signed,
    Raw8,
    Raw16,
}

impl Coding {
    /// All of them, each at the index of its number.
    pub(super) const ALL: [Self; 11] = [
        Self::Mono8,
        Self::Yuv411,
        Self::Yuv422,
        Self::Yuv444,
        Self::Rgb8,
        Self::Mono16,
        Self::Rgb16,
        Self::Mono16Signed,
        Self::Rgb16Signed,
        Self::Raw8,
        Self::Raw16,
    ];

    /// Returns the coding of a number.
    pub(super) fn of_number(number: u32) -> Option<Self> {
        Self::ALL.get(number as usize).copied()
    }

    /// Returns the bits of a pixel.
    pub(super) const fn bits(self) -> usize {
        match self {
            Self::Mono8 | Self::Raw8 => 8,
            Self::Yuv411 => 12,
            Self::Yuv422 | Self::Mono16 | Self::Mono16Signed | Self::Raw16 => 16,
            Self::Yuv444 | Self::Rgb8 => 24,
            Self::Rgb16 | Self::Rgb16Signed => 48,
        }
    }

    const fn is_signed(self) -> bool {
        matches!(self, Self::Mono16Signed | Self::Rgb16Signed)
    }

    const fn is_raw(self) -> bool {
        matches!(self, Self::Raw8 | Self::Raw16)
    }
}

/// Colours of the filter in front of a sensor, row after row from the upper left corner, in the order of the list of IIDC.
const FILTERS: [[Colour; 4]; 4] = {
    use Colour::{Blue, Green, Red};
    [
        [Red, Green, Green, Blue],
        [Green, Blue, Red, Green],
        [Green, Red, Blue, Green],
        [Blue, Green, Green, Red],
    ]
};

#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Colour {
    Red,
    Green,
    Blue,
}

/// Reasons why a frame is no image.
#[derive(Clone, Debug, thiserror::Error, PartialEq)]
pub(super) enum FrameError {
    /// The sides are outside the limits.
    #[error(
        "the camera says {width} x {height} pixels, expected sides of 1 to {MAX_IMAGE_SIDE}, together at most {MAX_PIXELS} pixels"
    )]
    Size { width: u32, height: u32 },
    /// Buffers are larger than any image.
    #[error("the camera wants {got} bytes for an image, expected 1 to {MAX_BUFFER_BYTES}")]
    Buffer { got: u64 },
    /// Signed values, or a coding that is not in the list.
    #[error("colour coding {0} is not supported; try another one, or another video mode")]
    Coding(u32),
    /// The camera tells a filter that is not in the list.
    #[error("colour filter {0} is not known, expected 0 to 3; try a coding other than RAW")]
    Filter(u32),
    /// The camera has no register of its filter.
    #[error(
        "a camera of IIDC before 1.31 does not tell its colour filter; try a coding other than RAW"
    )]
    NoFilter,
    /// The buffer ends before the image.
    #[error("{got} bytes, expected {expected}")]
    Short { got: usize, expected: usize },
    /// The library marked the frame.
    #[error("a part of the frame was lost on the bus")]
    Damaged,
}

/// Layout of a frame.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) struct FrameLayout {
    width: usize,
    height: usize,
    coding: Coding,
    filter: u32,
    /// Bits to leave out of values of two bytes.
    shift: u32,
    little_endian: bool,
}

/// Returns the size of an image, if both sides and their product are inside the limits.
pub(super) fn checked_size(width: u32, height: u32) -> Result<(usize, usize), FrameError> {
    let (across, down) = (width as usize, height as usize);
    let sides = 1..=MAX_IMAGE_SIDE;
    match sides.contains(&across) && sides.contains(&down) && across * down <= MAX_PIXELS {
        true => Ok((across, down)),
        false => Err(FrameError::Size { width, height }),
    }
}

/// Refuses buffers that are larger than any image.
pub(super) fn check_buffer(packets: u32, packet_bytes: u32) -> Result<(), FrameError> {
    let got = u64::from(packets) * u64::from(packet_bytes);
    match (1..=MAX_BUFFER_BYTES as u64).contains(&got) {
        true => Ok(()),
        false => Err(FrameError::Buffer { got }),
    }
}

impl FrameLayout {
    /// Creates a layout from what a camera says: numbers in the lists of IIDC, and the bits of data in a value.
    pub(super) fn new(
        (width, height): (u32, u32),
        coding: u32,
        filter: Option<u32>,
        depth: u32,
        little_endian: bool,
    ) -> Result<Self, FrameError> {
        let (width, height) = checked_size(width, height)?;
        let known = Coding::of_number(coding).filter(|coding| !coding.is_signed());
        let known = known.ok_or(FrameError::Coding(coding))?;
        let filter = match filter {
            None if known.is_raw() => return Err(FrameError::NoFilter),
            Some(filter) if known.is_raw() && filter as usize >= FILTERS.len() => {
                return Err(FrameError::Filter(filter));
            }
            filter => filter.unwrap_or(0),
        };
        Ok(Self {
            width,
            height,
            coding: known,
            filter,
            // Cameras that do not tell have 16.
            shift: if DEPTHS.contains(&depth) {
                depth - 8
            } else {
                8
            },
            little_endian,
        })
    }

    /// Returns the bytes of an image.
    fn bytes(&self) -> usize {
        (self.width * self.height * self.coding.bits()).div_ceil(8)
    }

    fn image_bytes<'a>(&self, bytes: &'a [u8]) -> Result<&'a [u8], FrameError> {
        let (got, expected) = (bytes.len(), self.bytes());
        bytes
            .get(..expected)
            .ok_or(FrameError::Short { got, expected })
    }

    /// Converts the bytes of a frame to an image in red, green and blue.
    pub(super) fn image(&self, bytes: &[u8]) -> Result<Image, FrameError> {
        let bytes = self.image_bytes(bytes)?;
        let count = self.width * self.height;
        let mut pixels = Vec::with_capacity(count * 3 + 12);
        match self.coding {
            Coding::Mono8 => pixels.extend(bytes.iter().flat_map(|grey| [*grey; 3])),
            Coding::Mono16 | Coding::Mono16Signed => {
                pixels.extend(self.values(bytes).flat_map(|grey| [grey; 3]));
            }
            Coding::Rgb8 => pixels.extend_from_slice(bytes),
            Coding::Rgb16 | Coding::Rgb16Signed => pixels.extend(self.values(bytes)),
            Coding::Yuv444 => {
                for pixel in bytes.chunks_exact(3) {
                    pixels.extend(rgb_of(pixel[1], pixel[0], pixel[2]));
                }
            }
            Coding::Yuv422 => {
                for pair in bytes.chunks_exact(4) {
                    for luminance in [pair[1], pair[3]] {
                        pixels.extend(rgb_of(luminance, pair[0], pair[2]));
                    }
                }
            }
            Coding::Yuv411 => {
                for four in bytes.chunks_exact(6) {
                    for luminance in [four[1], four[2], four[4], four[5]] {
                        pixels.extend(rgb_of(luminance, four[0], four[3]));
                    }
                }
            }
            Coding::Raw8 => self.demosaic(bytes, &mut pixels),
            Coding::Raw16 => {
                let values: Vec<u8> = self.values(bytes).collect();
                self.demosaic(&values, &mut pixels);
            }
        }
        // A number of pixels that is no multiple of a group of them leaves a part of the last group.
        pixels.resize(count * 3, 0);
        self.made(PixelFormat::Rgb, pixels)
    }

    /// Converts the bytes of a frame to the values of the sensor in grey, if it has one value for each pixel.
    pub(super) fn raw_image(&self, bytes: &[u8]) -> Result<Option<Image>, FrameError> {
        let bytes = self.image_bytes(bytes)?;
        let values = match self.coding {
            Coding::Mono8 | Coding::Raw8 => bytes.to_vec(),
            Coding::Mono16 | Coding::Raw16 => self.values(bytes).collect(),
            _ => return Ok(None),
        };
        self.made(PixelFormat::Mono, values).map(Some)
    }

    fn made(&self, format: PixelFormat, pixels: Vec<u8>) -> Result<Image, FrameError> {
        let (got, expected) = (pixels.len(), self.bytes());
        Image::new(format, self.width, self.height, pixels)
            .map_err(|_| FrameError::Short { got, expected })
    }

    /// Returns the upper eight bits of values of two bytes.
    fn values<'a>(&self, bytes: &'a [u8]) -> impl Iterator<Item = u8> + use<'a> {
        let (shift, little_endian) = (self.shift, self.little_endian);
        bytes.chunks_exact(2).map(move |pair| {
            let value = match little_endian {
                true => u16::from_le_bytes([pair[0], pair[1]]),
                false => u16::from_be_bytes([pair[0], pair[1]]),
            };
            u8::try_from(value >> shift).unwrap_or(u8::MAX)
        })
    }

    /// Appends the pixels behind a colour filter: each colour is the mean of its values at the pixel, or else around it.
    fn demosaic(&self, values: &[u8], pixels: &mut Vec<u8>) {
        let filter = FILTERS[self.filter as usize % FILTERS.len()];
        let colour_at = |x: usize, y: usize| filter[y % 2 * 2 + x % 2];
        for y in 0..self.height {
            for x in 0..self.width {
                let mut sums = [(0_u32, 0_u32); 3];
                let own = colour_at(x, y);
                for line in y.saturating_sub(1)..(y + 2).min(self.height) {
                    for column in x.saturating_sub(1)..(x + 2).min(self.width) {
                        let colour = colour_at(column, line);
                        if colour != own || (column, line) == (x, y) {
                            let (sum, count) = &mut sums[colour as usize];
                            *sum += u32::from(values[line * self.width + column]);
                            *count += 1;
                        }
                    }
                }
                pixels.extend(sums.map(|(sum, count)| {
                    u8::try_from((sum + count / 2) / count.max(1)).unwrap_or(u8::MAX)
                }));
            }
        }
    }
}

/// Converts luminance and chrominance, 0 to 255, to red, green and blue, in units of 1/65536.
fn rgb_of(y: u8, u: u8, v: u8) -> [u8; 3] {
    let y = (i32::from(y) << 16) + (1 << 15);
    let (u, v) = (i32::from(u) - 128, i32::from(v) - 128);
    let rgb = [y + 91_881 * v, y - 22_553 * u - 46_802 * v, y + 116_130 * u];
    rgb.map(|value| (value >> 16).clamp(0, 255) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout(size: (u32, u32), coding: Coding) -> FrameLayout {
        FrameLayout::new(size, coding as u32, Some(0), 8, false).unwrap()
    }

    /// Luminance and chrominance of ITU-R BT.601 in the full range of ITU-T T.871, by their definition.
    fn luminance_and_chrominance(rgb: [u8; 3]) -> [u8; 3] {
        let [red, green, blue] = rgb.map(f64::from);
        let y = 0.299 * red + 0.587 * green + 0.114 * blue;
        let (u, v) = ((blue - y) / 1.772 + 128.0, (red - y) / 1.402 + 128.0);
        [y, u, v].map(|value| value.round().clamp(0.0, 255.0) as u8)
    }

    const COLOURS: [[u8; 3]; 9] = [
        [255, 255, 255],
        [0, 0, 0],
        [255, 0, 0],
        [0, 255, 0],
        [0, 0, 255],
        [128, 128, 128],
        [10, 200, 120],
        [250, 130, 5],
        [90, 14, 233],
    ];

    fn check(image: &Image, x: usize, expected: [u8; 3], what: &str) {
        let got = image.pixel(x, 0).unwrap();
        for (got, expected) in got.iter().zip(expected) {
            // Two roundings of chrominance, and their factor of 1.772.
            let off = (i32::from(*got) - i32::from(expected)).abs();
            assert!(off <= 2, "{what}: {:?}, not {expected}", image.pixels());
        }
    }

    #[test]
    fn luminance_and_chrominance_become_their_colours() {
        for colour in COLOURS {
            let [y, u, v] = luminance_and_chrominance(colour);
            let what = format!("{colour:?}");
            let image = layout((1, 1), Coding::Yuv444).image(&[u, y, v]).unwrap();
            check(&image, 0, colour, &what);
            let image = layout((2, 1), Coding::Yuv422).image(&[u, y, v, y]).unwrap();
            check(&image, 0, colour, &what);
            check(&image, 1, colour, &what);
            let four = [u, y, y, v, y, y];
            let image = layout((4, 1), Coding::Yuv411).image(&four).unwrap();
            (0..4).for_each(|x| check(&image, x, colour, &what));
        }
        // The order of luminances that share a colour.
        let greys =
            |image: Image| -> Vec<u8> { image.pixels().iter().step_by(3).copied().collect() };
        let image = layout((2, 1), Coding::Yuv422)
            .image(&[128, 10, 128, 20])
            .unwrap();
        assert_eq!(greys(image), [10, 20]);
        let image = layout((4, 1), Coding::Yuv411)
            .image(&[128, 1, 2, 128, 3, 4])
            .unwrap();
        assert_eq!(greys(image), [1, 2, 3, 4]);
        // A part of the last group.
        let image = layout((3, 1), Coding::Yuv411)
            .image(&[128, 1, 2, 128, 3])
            .unwrap();
        assert_eq!(image.pixels().len(), 9);
    }

    #[test]
    fn grey_and_red_green_blue_stay() {
        let image = layout((2, 1), Coding::Rgb8)
            .image(&[1, 2, 3, 4, 5, 6])
            .unwrap();
        assert_eq!(image.pixels()[..], [1, 2, 3, 4, 5, 6]);
        let mono = layout((2, 1), Coding::Mono8);
        assert_eq!(
            mono.image(&[7, 9]).unwrap().pixels()[..],
            [7, 7, 7, 9, 9, 9]
        );
        let raw = mono.raw_image(&[7, 9]).unwrap().unwrap();
        assert_eq!(
            (raw.format(), &raw.pixels()[..]),
            (PixelFormat::Mono, &[7, 9][..])
        );
        assert_eq!(
            layout((1, 1), Coding::Rgb8).raw_image(&[1, 2, 3]).unwrap(),
            None
        );
    }

    #[test]
    fn values_of_two_bytes_keep_their_upper_bits() {
        // 12 bits of data are 0 to 4095, of which 8 bits are the sixteenth part; without a known number they are 16.
        for (depth, value, expected) in [
            (16, 0xab12, 0xab),
            (12, 0x0ab1, 0xab),
            (8, 0x00ab, 0xab),
            (12, 0xffff, 0xff),
            (7, 0xab12, 0xab),
            (17, 0xab12, 0xab),
        ] {
            let value: u16 = value;
            for (little_endian, bytes) in
                [(false, value.to_be_bytes()), (true, value.to_le_bytes())]
            {
                let mono = Coding::Mono16 as u32;
                let layout = FrameLayout::new((1, 1), mono, Some(0), depth, little_endian).unwrap();
                assert_eq!(
                    layout.image(&bytes).unwrap().pixels()[..],
                    [expected; 3],
                    "{depth}"
                );
                let raw = layout.raw_image(&bytes).unwrap().unwrap();
                assert_eq!(raw.pixels()[..], [expected]);
            }
        }
        let layout = FrameLayout::new((1, 1), Coding::Rgb16 as u32, None, 16, false).unwrap();
        assert_eq!(
            layout.image(&[1, 0, 2, 0, 3, 255]).unwrap().pixels()[..],
            [1, 2, 3]
        );
    }

    /// Colours of the upper left four pixels, as the names of the filters say (IIDC 1.31: RGGB, GBRG, GRBG, BGGR).
    const NAMES: [&[u8; 4]; 4] = [b"RGGB", b"GBRG", b"GRBG", b"BGGR"];

    fn mosaic(name: &[u8; 4], size: usize, scene: impl Fn(usize, usize) -> [u8; 3]) -> Vec<u8> {
        let mut values = Vec::new();
        for y in 0..size {
            for x in 0..size {
                let [red, green, blue] = scene(x, y);
                values.push(match name[y % 2 * 2 + x % 2] {
                    b'R' => red,
                    b'G' => green,
                    _ => blue,
                });
            }
        }
        values
    }

    #[test]
    fn colours_behind_a_filter_are_found() {
        for (filter, name) in NAMES.into_iter().enumerate() {
            let layout = |coding: Coding| {
                FrameLayout::new((6, 6), coding as u32, Some(filter as u32), 16, false)
            };
            // A surface of one colour stays one, also at its edges.
            let flat = mosaic(name, 6, |_, _| [200, 100, 30]);
            let image = layout(Coding::Raw8).unwrap().image(&flat).unwrap();
            assert_eq!(image.pixels()[..], [200, 100, 30].repeat(36), "{filter}");
            // Linear changes are kept by linear interpolation, except at the edges.
            let slope = |x: usize, y: usize| [x, 2 * y, x + y].map(|value| 20 + 10 * value as u8);
            let sloped = mosaic(name, 6, slope);
            let image = layout(Coding::Raw8).unwrap().image(&sloped).unwrap();
            for (x, y) in [(1, 1), (2, 1), (1, 2), (4, 4), (3, 2)] {
                assert_eq!(image.pixel(x, y).unwrap(), slope(x, y), "{filter}: {x} {y}");
            }
            let raw = layout(Coding::Raw8)
                .unwrap()
                .raw_image(&sloped)
                .unwrap()
                .unwrap();
            assert_eq!(raw.pixels()[..], sloped);
            let wide: Vec<u8> = sloped.iter().flat_map(|value| [*value, 99]).collect();
            assert_eq!(layout(Coding::Raw16).unwrap().image(&wide).unwrap(), image);
        }
    }

    #[test]
    fn short_frames_are_refused() {
        // Bits of a pixel, as the specification has them.
        for (coding, bits) in [
            (0, 8),
            (1, 12),
            (2, 16),
            (3, 24),
            (4, 24),
            (5, 16),
            (6, 48),
            (9, 8),
            (10, 16),
        ] {
            let layout = FrameLayout::new((8, 3), coding, Some(0), 16, false).unwrap();
            let expected = 8 * 3 * bits / 8;
            assert!(layout.image(&vec![0; expected]).is_ok());
            // Padding is left out.
            assert!(layout.image(&vec![0; expected + 5]).is_ok());
            for got in 0..expected {
                let refused = layout.image(&vec![0; got]).unwrap_err();
                assert_eq!(refused, FrameError::Short { got, expected });
                assert!(layout.raw_image(&vec![0; got]).is_err());
            }
        }
    }

    #[test]
    fn claims_of_a_camera_are_bounded() {
        let new = |size, coding, filter| FrameLayout::new(size, coding, Some(filter), 8, false);
        let side = MAX_IMAGE_SIDE as u32;
        for (width, height) in [
            (0, 1),
            (1, 0),
            (side + 1, 1),
            (1, side + 1),
            (8192, 4097),
            (u32::MAX, u32::MAX),
        ] {
            let refused = new((width, height), 0, 0).unwrap_err();
            assert_eq!(refused, FrameError::Size { width, height });
        }
        assert!(new((8192, 4096), 0, 0).is_ok());
        for coding in [7, 8, 11, u32::MAX] {
            assert_eq!(
                new((1, 1), coding, 0).unwrap_err(),
                FrameError::Coding(coding)
            );
        }
        for coding in [9, 10] {
            assert!(new((1, 1), coding, 3).is_ok());
            assert_eq!(new((1, 1), coding, 4).unwrap_err(), FrameError::Filter(4));
            let unknown = FrameLayout::new((1, 1), coding, None, 8, false);
            assert_eq!(unknown.unwrap_err(), FrameError::NoFilter);
        }
        // Only values behind a filter need one.
        assert!(new((1, 1), 0, u32::MAX).is_ok());
        let most = 1 << 27;
        assert_eq!(check_buffer(most, 1), Ok(()));
        assert_eq!(check_buffer(1, most), Ok(()));
        let got = u64::from(most) + 1;
        assert_eq!(check_buffer(most + 1, 1), Err(FrameError::Buffer { got }));
        let got = u64::from(u32::MAX) * u64::from(u32::MAX);
        assert_eq!(
            check_buffer(u32::MAX, u32::MAX),
            Err(FrameError::Buffer { got })
        );
        assert!(check_buffer(0, 1).is_err());
    }
}
