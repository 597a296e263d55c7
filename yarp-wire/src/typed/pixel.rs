//! Kinds of pixels.

use std::fmt;

use crate::vocab::Vocab32;

/// The code of a kind of pixel, stock's `YarpVocabPixelTypesEnum`.
///
/// A positive code is a word; a negative code -n states only that a pixel has n bytes; 0 is the
/// code of an image without pixels. Codes outside the table are kept unchanged.
///
/// | word | a pixel | word | a pixel |
/// | --- | --- | --- | --- |
/// | `mono` | u8 | `rgb` `bgr` `hsv` | 3 x u8 |
/// | `mo16` | u16 | `rgb-` | 3 x i8 |
/// | `int` | i32 | `rgba` `bgra` | 4 x u8 |
/// | `sign` | i8 | `rgbi` | 3 x i32 |
/// | `dec` | f32 | `rgb.` `hsv.` | 3 x f32 |
/// | `grbg` `bggr` `gbrg` `rggb` | u8 behind a Bayer filter | `gr16` `bg16` `gb16` `rg16` | u16 behind a Bayer filter |
/// | `yuva` `yuvb` `yuvd` | u8, YUV 420, 444, 411 | `yuvc` | YUV 422, see [`PixelCode::stored_bytes`] |
///
/// Stock keeps no images of `rgb-`, `hsv.`, other words, or -n other than -2 and -4: a reader that
/// receives one crashes. The table does not define the bytes of YUV, and neither does stock.
///
/// Source: images written by 3.5.0, one of each code.
#[derive(Clone, Copy, Debug, Default, Eq, Hash, PartialEq)]
pub struct PixelCode(i32);

macro_rules! codes {
    ($($(#[$doc:meta])* $name:ident = $word:literal, $bytes:literal;)*) => {
        impl PixelCode {
            $($(#[$doc])* pub const $name: Self = Self::new($word);)*

            /// Every code of the table, and the bytes of a pixel.
            pub const TABLE: &'static [(Self, usize)] = &[$((Self::$name, $bytes)),*];
        }
    };
}

codes! {
    /// Grey, u8.
    MONO = "mono", 1;
    /// Grey, u16.
    MONO16 = "mo16", 2;
    /// Red, green, blue, u8 each.
    RGB = "rgb", 3;
    /// Red, green, blue, opacity, u8 each.
    RGBA = "rgba", 4;
    /// Blue, green, red, opacity, u8 each.
    BGRA = "bgra", 4;
    /// Grey, i32.
    INT = "int", 4;
    /// Hue, saturation, value, u8 each.
    HSV = "hsv", 3;
    /// Blue, green, red, u8 each.
    BGR = "bgr", 3;
    /// Grey, i8.
    MONO_SIGNED = "sign", 1;
    /// Red, green, blue, i8 each.
    RGB_SIGNED = "rgb-", 3;
    /// Red, green, blue, i32 each.
    RGB_INT = "rgbi", 12;
    /// Grey or depth, f32.
    MONO_FLOAT = "dec", 4;
    /// Red, green, blue, f32 each.
    RGB_FLOAT = "rgb.", 12;
    /// Hue, saturation, value, f32 each.
    HSV_FLOAT = "hsv.", 12;
    /// Bayer, rows of green red and blue green, u8.
    BAYER_GRBG8 = "grbg", 1;
    /// Bayer, rows of green red and blue green, u16.
    BAYER_GRBG16 = "gr16", 2;
    /// Bayer, rows of blue green and green red, u8.
    BAYER_BGGR8 = "bggr", 1;
    /// Bayer, rows of blue green and green red, u16.
    BAYER_BGGR16 = "bg16", 2;
    /// Bayer, rows of green blue and red green, u8.
    BAYER_GBRG8 = "gbrg", 1;
    /// Bayer, rows of green blue and red green, u16.
    BAYER_GBRG16 = "gb16", 2;
    /// Bayer, rows of red green and green blue, u8.
    BAYER_RGGB8 = "rggb", 1;
    /// Bayer, rows of red green and green blue, u16.
    BAYER_RGGB16 = "rg16", 2;
    /// YUV 4:2:0.
    YUV_420 = "yuva", 1;
    /// YUV 4:4:4.
    YUV_444 = "yuvb", 1;
    /// YUV 4:2:2.
    YUV_422 = "yuvc", 1;
    /// YUV 4:1:1.
    YUV_411 = "yuvd", 1;
}

impl PixelCode {
    /// The code of an image that was never given any.
    pub const INVALID: Self = Self(0);

    /// The code of a word of up to four characters.
    pub const fn new(word: &str) -> Self {
        Self(Vocab32::new(word).code() as i32)
    }

    /// The code as it stands in a header.
    pub const fn from_code(code: i32) -> Self {
        Self(code)
    }

    /// Creates a code for pixels of this many bytes and no known meaning.
    pub const fn of_bytes(bytes: u16) -> Self {
        Self(-(bytes as i32))
    }

    /// Returns the code as it stands in a header.
    pub const fn code(self) -> i32 {
        self.0
    }

    /// Bytes of a pixel as headers state them; `None` for a word that is not in the table.
    pub fn bytes_per_pixel(self) -> Option<usize> {
        if self.0 <= 0 {
            return Some(self.0.unsigned_abs() as usize);
        }
        let known = Self::TABLE.iter().find(|(code, _)| *code == self);
        known.map(|(_, bytes)| *bytes)
    }

    /// Returns the bytes that a pixel takes in a row, given the number that the header states.
    ///
    /// They are equal, except for `yuvc`: stock states 1 byte and makes its rows as long as for 2.
    pub fn stored_bytes(self, stated: usize) -> usize {
        match self {
            Self::YUV_422 => stated.saturating_mul(2),
            _ => stated,
        }
    }
}

/// The word, or the number of a code that is none.
impl fmt::Display for PixelCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            code @ ..=0 => write!(f, "{code}"),
            code => Vocab32::from_code(code as u32).fmt(f),
        }
    }
}
