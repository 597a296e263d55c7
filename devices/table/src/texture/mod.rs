//! Textures: wood for tables, print for cartons.
//!
//! All are made by rules from seeds, once, when they are first needed.

mod canvas;
mod font;
mod printed_texture;
mod wood;

use std::sync::OnceLock;

use yarp_devices::image::{Image, PixelFormat};

use crate::bricks::{BrickKind, Face};

pub(crate) use wood::Wood;

/// Texels per metre of the print on cartons.
pub(crate) const PRINT_DENSITY: f64 = 3000.0;

/// An image with its smaller copies, each half as large, sRGB.
#[derive(Debug)]
pub(crate) struct Texture {
    levels: Vec<Level>,
}

#[derive(Debug)]
struct Level {
    width: usize,
    height: usize,
    texels: Vec<[u8; 3]>,
}

/// Returns linear light of each sRGB value.
pub(crate) fn linear() -> &'static [f32; 256] {
    static TABLE: OnceLock<[f32; 256]> = OnceLock::new();
    TABLE.get_or_init(|| {
        std::array::from_fn(|value| {
            let value = value as f32 / 255.0;
            if value <= 0.04045 {
                value / 12.92
            } else {
                ((value + 0.055) / 1.055).powf(2.4)
            }
        })
    })
}

/// Returns the sRGB value of linear light.
pub(crate) fn encode(light: f32) -> u8 {
    let light = light.clamp(0.0, 1.0);
    let value = if light <= 0.003_130_8 {
        light * 12.92
    } else {
        1.055 * light.powf(1.0 / 2.4) - 0.055
    };
    (value * 255.0 + 0.5) as u8
}

impl Texture {
    pub(crate) fn new(width: usize, height: usize, texels: Vec<[u8; 3]>) -> Self {
        let mut levels = vec![Level {
            width,
            height,
            texels,
        }];
        while let Some(last) = levels.last()
            && last.width > 4
            && last.height > 4
        {
            let next = last.halved();
            levels.push(next);
        }
        Self { levels }
    }

    pub(crate) fn width(&self) -> usize {
        self.levels[0].width
    }

    pub(crate) fn height(&self) -> usize {
        self.levels[0].height
    }

    /// Returns linear light at a place, both from 0 to 1, seen so that a pixel covers `footprint` texels.
    pub(crate) fn sample(&self, u: f32, v: f32, footprint: f32) -> [f32; 3] {
        let level = footprint.max(1.0).log2();
        let below = (level as usize).min(self.levels.len() - 1);
        let above = (below + 1).min(self.levels.len() - 1);
        let part = (level - below as f32).clamp(0.0, 1.0);
        let one = self.levels[below].sample(u, v);
        let other = self.levels[above].sample(u, v);
        std::array::from_fn(|channel| one[channel] + (other[channel] - one[channel]) * part)
    }

    fn image(&self) -> Image {
        let bytes: Vec<u8> = self.levels[0].texels.iter().flatten().copied().collect();
        Image::new(PixelFormat::Rgb, self.width(), self.height(), bytes)
            .expect("a texture has as many texels as its size says")
    }
}

impl Level {
    fn halved(&self) -> Self {
        let (width, height) = (self.width / 2, self.height / 2);
        let light = linear();
        let texel = |x: usize, y: usize| {
            std::array::from_fn(|channel| {
                let at = |x: usize, y: usize| {
                    light[usize::from(self.texels[y * self.width + x][channel])]
                };
                let sum = at(2 * x, 2 * y)
                    + at(2 * x + 1, 2 * y)
                    + at(2 * x, 2 * y + 1)
                    + at(2 * x + 1, 2 * y + 1);
                encode(sum / 4.0)
            })
        };
        let texels = (0..width * height)
            .map(|index| texel(index % width, index / width))
            .collect();
        Self {
            width,
            height,
            texels,
        }
    }

    fn sample(&self, u: f32, v: f32) -> [f32; 3] {
        let light = linear();
        let x = (u * self.width as f32 - 0.5).clamp(0.0, (self.width - 1) as f32);
        let y = (v * self.height as f32 - 0.5).clamp(0.0, (self.height - 1) as f32);
        let (left, top) = (x as usize, y as usize);
        let right = (left + 1).min(self.width - 1);
        let bottom = (top + 1).min(self.height - 1);
        let (a, b) = (x - left as f32, y - top as f32);
        let rows = [
            [
                self.texels[top * self.width + left],
                self.texels[top * self.width + right],
            ],
            [
                self.texels[bottom * self.width + left],
                self.texels[bottom * self.width + right],
            ],
        ];
        std::array::from_fn(|channel| {
            let at = |texel: [u8; 3]| light[usize::from(texel[channel])];
            let mix = |[one, other]: [[u8; 3]; 2]| at(one) + (at(other) - at(one)) * a;
            let (upper, lower) = (mix(rows[0]), mix(rows[1]));
            upper + (lower - upper) * b
        })
    }
}

/// Returns the textures of a carton, in the order of [`Face::ALL`].
pub(crate) fn brick(kind: BrickKind) -> &'static [Texture; 6] {
    static ALL: OnceLock<Vec<OnceLock<[Texture; 6]>>> = OnceLock::new();
    let all = ALL.get_or_init(|| BrickKind::all().map(|_| OnceLock::new()).collect());
    all[kind.index()].get_or_init(|| Face::ALL.map(|face| printed_texture::face(kind, face)))
}

/// Returns the print of one face of a carton as a flat image, sRGB, 3 pixels per mm: for a recogniser's database.
pub fn brick_face(kind: BrickKind, face: Face) -> Image {
    let index = Face::ALL.iter().position(|other| *other == face);
    brick(kind)[index.unwrap_or_default()].image()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_survives_encoding() {
        for value in 0..=255_u8 {
            assert_eq!(encode(linear()[usize::from(value)]), value);
        }
    }

    #[test]
    fn kinds_look_different_and_always_the_same() {
        let kinds: Vec<_> = BrickKind::all().collect();
        let one = brick_face(kinds[0], Face::Front);
        assert_eq!((one.width(), one.height()), (285, 495));
        let again = printed_texture::face(kinds[0], Face::Front);
        assert_eq!(one.pixels(), again.image().pixels());
        let other = brick_face(kinds[1], Face::Front);
        let different = one
            .pixels()
            .iter()
            .zip(other.pixels().iter())
            .filter(|(a, b)| a.abs_diff(**b) > 30)
            .count();
        assert!(different > one.pixels().len() / 4, "{different}");
    }

    #[test]
    fn distant_textures_are_averages() {
        let checker: Vec<[u8; 3]> = (0..64 * 64)
            .map(|index| {
                [if (index + index / 64) % 2 == 0 {
                    255
                } else {
                    0
                }; 3]
            })
            .collect();
        let texture = Texture::new(64, 64, checker);
        let far = texture.sample(0.4, 0.6, 4.0);
        assert!((far[0] - 0.5).abs() < 0.01, "{far:?}");
    }
}
