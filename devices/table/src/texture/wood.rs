//! Wood: one grain for all tables, boards and tones by seed.

use std::sync::OnceLock;

use crate::Random;
use crate::random::hash;

/// Texels of the grain along each side, and their number per metre.
const SIDE: usize = 1024;
const DENSITY: f32 = 1600.0;

/// The wood of a table.
#[derive(Clone, Debug)]
pub(crate) struct Wood {
    dark: [f32; 3],
    light: [f32; 3],
    board: f32,
    seam: f32,
    /// Of each board: where its grain begins, and its tone.
    boards: Vec<[f32; 3]>,
}

/// Number of boards; the middle of the arm's base frame is in the middle of them.
const BOARDS: usize = 200;

/// Dark and light tones, linear reflectances: beech, oak, walnut, pine, white laminate, grey laminate.
const TONES: [([f32; 3], [f32; 3]); 6] = [
    ([0.36, 0.20, 0.10], [0.60, 0.40, 0.24]),
    ([0.28, 0.17, 0.08], [0.50, 0.34, 0.18]),
    ([0.10, 0.05, 0.03], [0.24, 0.14, 0.08]),
    ([0.52, 0.34, 0.15], [0.72, 0.54, 0.30]),
    ([0.66, 0.65, 0.62], [0.72, 0.71, 0.68]),
    ([0.26, 0.27, 0.28], [0.32, 0.33, 0.34]),
];

impl Wood {
    pub(crate) fn new(seed: u64) -> Self {
        let mut random = Random::for_purpose(seed, 0x21);
        let (dark, light) = *random.pick(&TONES);
        let board = random.between(0.09, 0.22) as f32;
        let seam = if random.chance(0.6) { 0.0007 } else { 0.0 };
        let seed = random.bits();
        let boards = (0..BOARDS as u64).map(|index| {
            let bits = hash(seed ^ index);
            let tone = ((bits >> 32 & 0xFF) as f32 / 255.0 - 0.5) * 0.25;
            [(bits & 0x3FF) as f32, (bits >> 16 & 0x3FF) as f32, tone]
        });
        Self {
            dark,
            light,
            board,
            seam,
            boards: boards.collect(),
        }
    }

    /// Returns the linear reflectance at a place of the table, m.
    pub(crate) fn colour(&self, x: f32, y: f32) -> [f32; 3] {
        let middle = (BOARDS / 2) as f32;
        let index = (x / self.board + middle) as usize;
        let [across, along, tone] = self.boards[index.min(BOARDS - 1)];
        let grain = grain().sample(x * DENSITY + across, y * DENSITY + along);
        let part = (grain + tone).clamp(0.0, 1.0);
        let into = x - (index as f32 - middle) * self.board;
        let seam = if into < self.seam { 0.55 } else { 1.0 };
        std::array::from_fn(|channel| {
            (self.dark[channel] + (self.light[channel] - self.dark[channel]) * part) * seam
        })
    }
}

/// Grey values that repeat in both directions; the grain is along the second, as are neighbours in memory: rows of the overhead
/// camera's image are.
struct Grain(Vec<u8>);

fn grain() -> &'static Grain {
    static GRAIN: OnceLock<Grain> = OnceLock::new();
    GRAIN.get_or_init(Grain::new)
}

impl Grain {
    fn new() -> Self {
        let texel = |index: usize| {
            let (x, y) = (index / SIDE, index % SIDE);
            let (u, v) = (x as f32 / SIDE as f32, y as f32 / SIDE as f32);
            let bend = noise(u, v, 3, 2, 1) * 0.35 + noise(u, v, 7, 3, 2) * 0.10;
            let rings = ((u * 6.0 + bend * 6.0) * std::f32::consts::TAU).sin() * 0.5 + 0.5;
            let fibres = noise(u, v, 256, 12, 3) * 0.6 + noise(u, v, 512, 40, 4) * 0.4;
            let clouds = noise(u, v, 4, 3, 5);
            let pores = noise(u, v, 300, 20, 6);
            let pores = if pores > 0.80 { 0.25 } else { 0.0 };
            let value = 0.30 * rings + 0.40 * fibres + 0.30 * clouds - pores;
            (value.clamp(0.0, 1.0) * 255.0) as u8
        };
        Self((0..SIDE * SIDE).map(texel).collect())
    }

    fn sample(&self, x: f32, y: f32) -> f32 {
        // Whole numbers of repetitions make both positive, so that casting rounds down.
        let (x, y) = (x + (SIDE * 8) as f32, y + (SIDE * 8) as f32);
        let (x0, y0) = (x as i32, y as i32);
        let (a, b) = (x - x0 as f32, y - y0 as f32);
        let wrap = |value: i32| value as usize % SIDE;
        let (x1, y1) = (wrap(x0 + 1), wrap(y0 + 1));
        let (x0, y0) = (wrap(x0), wrap(y0));
        let at = |x: usize, y: usize| f32::from(self.0[x * SIDE + y]);
        let upper = at(x0, y0) + (at(x1, y0) - at(x0, y0)) * a;
        let lower = at(x0, y1) + (at(x1, y1) - at(x0, y1)) * a;
        (upper + (lower - upper) * b) / 255.0
    }
}

/// Smooth noise from 0 to 1 that repeats after `across` and `along` cells.
fn noise(u: f32, v: f32, across: usize, along: usize, layer: u64) -> f32 {
    let (x, y) = (u * across as f32, v * along as f32);
    let (left, top) = (x.floor(), y.floor());
    let smooth = |part: f32| part * part * (3.0 - 2.0 * part);
    let (a, b) = (smooth(x - left), smooth(y - top));
    let value = |x: usize, y: usize| {
        let cell = ((x % across) as u64) << 32 | (y % along) as u64;
        (hash(cell ^ layer << 56) >> 40) as f32 / (1_u32 << 24) as f32
    };
    let (x0, y0) = (left as usize, top as usize);
    let upper = value(x0, y0) + (value(x0 + 1, y0) - value(x0, y0)) * a;
    let lower = value(x0, y0 + 1) + (value(x0 + 1, y0 + 1) - value(x0, y0 + 1)) * a;
    upper + (lower - upper) * b
}
