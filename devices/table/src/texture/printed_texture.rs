//! The print of a carton: title, pictures, small print and a bar code, different on each face of each kind.

use std::f64::consts::TAU;

use super::canvas::{Canvas, Colour};
use super::{PRINT_DENSITY, Texture};
use crate::Random;
use crate::bricks::{BrickKind, Face};

/// Returns the print of one face.
pub(super) fn face(kind: BrickKind, face: Face) -> Texture {
    let [width, height] = face
        .size(kind.size())
        .map(|metres| (metres * PRINT_DENSITY).round() as usize);
    let purpose = 1000 + kind.index() as u64 * 10 + face as u64;
    let mut random = Random::for_purpose(0x7E7A, purpose);
    let colours = kind.colours();
    let mut canvas = Canvas::new(width, height, colours[0]);
    background(&mut canvas, colours, &mut random);
    match face {
        Face::Front | Face::Back => {
            picture(&mut canvas, colours, &mut random);
            title(&mut canvas, kind, colours, &mut random);
            small_print(&mut canvas, colours, &mut random, 0.86, 4);
        }
        Face::Right | Face::Left => {
            title(&mut canvas, kind, colours, &mut random);
            small_print(&mut canvas, colours, &mut random, 0.40, 12);
            bar_code(&mut canvas, &mut random);
            fruit(&mut canvas, colours, &mut random, 10);
        }
        Face::Top | Face::Bottom => {
            fruit(&mut canvas, colours, &mut random, 8);
            title(&mut canvas, kind, colours, &mut random);
        }
    }
    canvas.finish()
}

fn between(random: &mut Random, one: Colour, other: Colour) -> Colour {
    let part = random.unit();
    std::array::from_fn(|channel| {
        let value = f64::from(one[channel]) * (1.0 - part) + f64::from(other[channel]) * part;
        value as u8
    })
}

/// A gradient of bands and a few slanting stripes.
fn background(canvas: &mut Canvas, colours: [Colour; 4], random: &mut Random) {
    let height = canvas.height();
    let slope = random.between(-0.6, 0.6);
    let wave = random.between(0.03, 0.09);
    let edge = random.between(0.35, 0.65) * height;
    let phase = random.between(0.0, TAU);
    canvas.paint([0.0, 0.0], [1.0, height], colours[1], 0.85, |x, y| {
        y > edge + slope * (x - 0.5) + wave * (x * TAU + phase).sin()
    });
    for _ in 0..5 {
        let place = random.between(-0.5, height + 0.5);
        let (slope, wide) = (random.between(-1.0, 1.0), random.between(0.01, 0.05));
        let colour = between(random, colours[1], colours[3]);
        canvas.paint([0.0, 0.0], [1.0, height], colour, 0.5, |x, y| {
            (y - place - slope * x).abs() < wide
        });
    }
}

/// Round and angular shapes, as of fruit, leaves and splashes.
fn fruit(canvas: &mut Canvas, colours: [Colour; 4], random: &mut Random, count: usize) {
    let height = canvas.height();
    for _ in 0..count {
        let place = [random.unit(), random.unit() * height];
        let size = random.between(0.02, 0.13) * height.min(1.5).sqrt();
        let target = *random.pick(&colours);
        let colour = between(random, target, colours[2]);
        if random.chance(0.5) {
            let radii = [size, size * random.between(0.4, 1.0)];
            let turn = random.between(0.0, TAU);
            canvas.ellipse(place, radii, turn, colour, 0.9);
            // A highlight and a core.
            let light = [place[0] - size * 0.3, place[1] - size * 0.3];
            canvas.ellipse(
                light,
                [size * 0.25, size * 0.18],
                turn,
                [255, 255, 250],
                0.7,
            );
            canvas.ellipse(place, [size * 0.2, size * 0.12], turn, colours[3], 0.8);
        } else {
            let corner = |random: &mut Random| {
                let angle = random.between(0.0, TAU);
                [place[0] + size * angle.cos(), place[1] + size * angle.sin()]
            };
            let corners = [corner(random), corner(random), corner(random)];
            canvas.triangle(corners, colour, 0.9);
        }
    }
}

/// The picture in the middle: a plate with fruit around and on it.
fn picture(canvas: &mut Canvas, colours: [Colour; 4], random: &mut Random) {
    let height = canvas.height();
    fruit(canvas, colours, random, 22);
    let middle = [
        random.between(0.35, 0.65),
        height * random.between(0.45, 0.6),
    ];
    let size = random.between(0.20, 0.30);
    canvas.ellipse(middle, [size, size * 0.9], 0.0, colours[2], 1.0);
    canvas.ellipse(middle, [size * 0.85, size * 0.76], 0.0, colours[0], 1.0);
    for spoke in 0..9 {
        let angle = TAU * f64::from(spoke) / 9.0 + random.between(-0.2, 0.2);
        let far = [
            middle[0] + size * 0.7 * angle.cos(),
            middle[1] + size * 0.65 * angle.sin(),
        ];
        let wide = random.between(0.02, 0.05);
        let near = [
            middle[0] + wide * angle.sin(),
            middle[1] - wide * angle.cos(),
        ];
        let colour = between(random, colours[1], colours[3]);
        canvas.triangle([middle, near, far], colour, 1.0);
        canvas.ellipse(far, [wide * 0.7, wide * 0.6], 0.0, colours[2], 1.0);
    }
}

fn title(canvas: &mut Canvas, kind: BrickKind, colours: [Colour; 4], random: &mut Random) {
    let words = kind.title();
    let height = canvas.height();
    let size = (0.88 / (words.len() as f64 * 6.0 / 7.0)).min(height * 0.22);
    let top = height * random.between(0.06, 0.14);
    let shadow = size * 0.06;
    canvas.rectangle(
        [0.0, top - size * 0.25],
        [1.0, top + size * 1.25],
        colours[2],
    );
    let left = 0.5 - words.len() as f64 * size * 3.0 / 7.0;
    canvas.text(words, [left + shadow, top + shadow], size, colours[3]);
    canvas.text(words, [left, top], size, [255, 255, 250]);
}

/// Lines of random letters.
fn small_print(
    canvas: &mut Canvas,
    colours: [Colour; 4],
    random: &mut Random,
    from: f64,
    lines: usize,
) {
    let height = canvas.height();
    let size = 0.035;
    for line in 0..lines {
        let top = height * from + line as f64 * size * 1.35;
        let letters = 12 + random.below(12);
        let words: String = (0..letters)
            .map(|_| match random.below(7) {
                0 => ' ',
                _ => char::from(b'A' + random.below(26) as u8),
            })
            .collect();
        canvas.text(&words, [0.08, top], size, colours[3]);
    }
}

fn bar_code(canvas: &mut Canvas, random: &mut Random) {
    let bottom = canvas.height() - 0.06;
    let top = bottom - 0.22;
    canvas.rectangle([0.25, top - 0.02], [0.75, bottom + 0.02], [250, 250, 250]);
    let mut x = 0.28;
    while x < 0.72 {
        let wide = 0.006 * (1.0 + random.below(3) as f64);
        canvas.rectangle([x, top], [(x + wide).min(0.72), bottom], [10, 10, 10]);
        x += wide + 0.006 * (1.0 + random.below(3) as f64);
    }
}
