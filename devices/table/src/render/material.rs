//! Appearance of a surface at the point where a ray meets it.

use super::hit::{Hit, Vector};
use crate::bricks::{BrickKind, Face};
use crate::texture::{self, PRINT_DENSITY};

/// Looks of a solid.
#[derive(Clone, Debug)]
pub(super) enum Material {
    /// One colour.
    Plain([f32; 3], f32),
    /// A box with a label on its top: colours, half edges of the label, gloss.
    Label([f32; 3], [f32; 3], [f32; 2], f32),
    /// China: colour, colour of two rings, radius, gloss.
    Plate([f32; 3], [f32; 3], f32, f32),
    /// A cup: colour, colour of its rim, gloss.
    Cup([f32; 3], [f32; 3], f32),
    /// A printed carton.
    Brick(BrickKind),
    /// A calibration board: inner corners along y and x, side of a square, m.
    Board(u32, u32, f32),
}

/// A surface where a ray meets it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Surface {
    pub(super) colour: [f32; 3],
    pub(super) gloss: f32,
    /// In the frame of the solid; may lean away from the true one.
    pub(super) normal: Vector,
}

impl Material {
    /// `pixel`: what a pixel covers there, m.
    pub(super) fn at(&self, hit: &Hit, half: &Vector, pixel: f32) -> Surface {
        let surface = |colour, gloss| Surface {
            colour,
            gloss,
            normal: hit.normal,
        };
        match self {
            Self::Plain(colour, gloss) => surface(*colour, *gloss),
            Self::Label(colour, label, size, gloss) => {
                let inside = hit.normal.z > 0.5
                    && hit.place.x.abs() < size[0]
                    && hit.place.y.abs() < size[1];
                surface(if inside { *label } else { *colour }, *gloss)
            }
            Self::Plate(colour, rings, radius, gloss) => {
                plate(hit, *colour, *rings, *radius, *gloss)
            }
            Self::Cup(colour, rim, gloss) => {
                // The floor inside gets little light.
                let colour = match hit.face {
                    1 => *rim,
                    4 => colour.map(|value| value * 0.75),
                    _ => *colour,
                };
                surface(colour, *gloss)
            }
            Self::Brick(kind) => surface(print(*kind, hit, half, pixel), 0.15),
            Self::Board(columns, rows, square) => {
                surface(squares(hit, *columns, *rows, *square, pixel), 0.02)
            }
        }
    }
}

/// A rim that rises outward, a well that is flat, and two rings of colour.
fn plate(hit: &Hit, colour: [f32; 3], rings: [f32; 3], radius: f32, gloss: f32) -> Surface {
    let mut normal = hit.normal;
    let mut shown = colour;
    if hit.normal.z > 0.5 {
        let distance = hit.place.xy().norm() / radius;
        let lean = match distance {
            d if d > 0.97 => 0.5,
            d if d > 0.68 => -0.22,
            d if d > 0.60 => -0.45,
            _ => 0.0,
        };
        let outward = hit.place.xy() / (distance * radius).max(1e-6);
        normal = Vector::new(outward.x * lean, outward.y * lean, 1.0).normalize();
        if (0.90..0.94).contains(&distance) || (0.85..0.865).contains(&distance) {
            shown = rings;
        }
    }
    Surface {
        colour: shown,
        gloss,
        normal,
    }
}

fn print(kind: BrickKind, hit: &Hit, half: &Vector, pixel: f32) -> [f32; 3] {
    // The faces of a cuboid count +x, -x, +y, -y, +z, -z.
    const ORDER: [Face; 6] = [
        Face::Right,
        Face::Left,
        Face::Top,
        Face::Bottom,
        Face::Front,
        Face::Back,
    ];
    let face = ORDER[usize::from(hit.face).min(5)];
    let index = Face::ALL.iter().position(|other| *other == face);
    let [columns, rows, _] = face.axes().map(|axis| Vector::from(axis.map(|a| a as f32)));
    let share = |axis: Vector| {
        let reach = axis.abs().dot(half);
        axis.dot(&hit.place) / (2.0 * reach) + 0.5
    };
    texture::brick(kind)[index.unwrap_or_default()].sample(
        share(columns),
        share(rows),
        pixel * PRINT_DENSITY as f32,
    )
}

/// Black and white squares, averaged over a pixel, with a white border.
fn squares(hit: &Hit, columns: u32, rows: u32, square: f32, pixel: f32) -> [f32; 3] {
    const BLACK: f32 = 0.03;
    const WHITE: f32 = 0.85;
    if hit.normal.z < 0.5 {
        return [0.5; 3];
    }
    // From the corner of the outermost square.
    let along = |value: f32, corners: u32| value / square + (corners + 1) as f32 / 2.0;
    let (u, v) = (along(hit.place.y, columns), along(hit.place.x, rows));
    let inside = |value: f32, corners: u32| value > 0.0 && value < (corners + 1) as f32;
    if !(inside(u, columns) && inside(v, rows)) {
        return [WHITE; 3];
    }
    let wide = pixel / square;
    let part = 0.5 - 0.5 * wave(u, wide) * wave(v, wide);
    [BLACK + (WHITE - BLACK) * part; 3]
}

/// +1 in even cells and -1 in odd ones, averaged over a width below 1.
fn wave(value: f32, wide: f32) -> f32 {
    let cell = value.floor();
    let into = value - cell;
    let sign = if (cell as i32).rem_euclid(2) == 0 {
        1.0
    } else {
        -1.0
    };
    let half = (wide / 2.0).clamp(1e-6, 0.5);
    let soft = if into < half {
        into / half
    } else if into > 1.0 - half {
        (1.0 - into) / half
    } else {
        1.0
    };
    sign * soft
}
