//! Lamps, and what the camera makes of their light.

use crate::Random;

/// A lamp: a disc that shines in all directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lamp {
    /// Its middle in the arm's base frame, m.
    pub position: [f64; 3],
    /// Its radius, m: the larger, the softer its shadows.
    pub radius: f64,
    /// Irradiance of a surface 1 m away that faces it.
    pub power: f32,
}

/// The light of the room.
#[derive(Clone, Debug, PartialEq)]
pub struct Lighting {
    /// Lamps, each with shadows.
    pub lamps: Vec<Lamp>,
    /// Irradiance from everywhere.
    pub ambient: f32,
    /// Colour of all light.
    pub tint: [f32; 3],
    /// True if things cast shadows.
    pub shadows: bool,
}

/// Two ceiling lamps.
impl Default for Lighting {
    fn default() -> Self {
        Self {
            lamps: vec![
                Lamp {
                    position: [0.2, -0.7, 1.6],
                    radius: 0.15,
                    power: 1.3,
                },
                Lamp {
                    position: [1.0, 0.6, 1.8],
                    radius: 0.20,
                    power: 1.3,
                },
            ],
            ambient: 0.35,
            tint: [1.0, 0.97, 0.92],
            shadows: true,
        }
    }
}

impl Lighting {
    /// Returns light from everywhere alone: no shadows, the same brightness everywhere.
    pub fn even() -> Self {
        Self {
            lamps: Vec::new(),
            ambient: 0.9,
            tint: [1.0; 3],
            shadows: false,
        }
    }

    /// Returns lamps at other places, of other brightness and colour, with this seed.
    pub fn random(seed: u64) -> Self {
        let mut random = Random::for_purpose(seed, 0x11);
        let mut lighting = Self::default();
        for lamp in &mut lighting.lamps {
            lamp.position[0] += random.between(-0.4, 0.4);
            lamp.position[1] += random.between(-0.4, 0.4);
            lamp.position[2] += random.between(-0.2, 0.4);
            lamp.radius = random.between(0.08, 0.30);
            lamp.power *= random.between(0.5, 1.4) as f32;
        }
        lighting.ambient = random.between(0.25, 0.5) as f32;
        let warm = random.between(-0.06, 0.10) as f32;
        lighting.tint = [1.0, 1.0 - warm * 0.4, 1.0 - warm];
        lighting
    }
}

/// Effects of lens and sensor; each is switched off by its own number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effects {
    /// Rays per pixel at edges, along each side: 1 is no supersampling.
    pub supersampling: u32,
    /// Standard deviation of the blur of a lens out of focus, pixels; 0 is sharp.
    pub defocus: f32,
    /// Motion of the image while the shutter is open, pixels right and down; 0 is at rest.
    pub motion: [f32; 2],
    /// Light lost in the corners, as a share; 0 is none.
    pub vignetting: f32,
    /// Variance of noise per unit of light (photons); 0 is none. A white pixel has light 1.
    pub shot_noise: f32,
    /// Standard deviation of noise that is always there; 0 is none.
    pub read_noise: f32,
    /// Factor from light to the sensor's scale.
    pub exposure: f32,
    /// Seed of the noise.
    pub seed: u64,
}

/// A good camera, a little out of focus, with the noise of a small sensor at low gain.
impl Default for Effects {
    fn default() -> Self {
        Self {
            supersampling: 3,
            defocus: 0.6,
            motion: [0.0; 2],
            vignetting: 0.15,
            shot_noise: 1.5e-4,
            read_noise: 2.5e-3,
            exposure: 1.0,
            seed: 0,
        }
    }
}

impl Effects {
    /// Returns an ideal camera: sharp, still, without noise and vignetting.
    pub fn none() -> Self {
        Self {
            supersampling: 4,
            defocus: 0.0,
            motion: [0.0; 2],
            vignetting: 0.0,
            shot_noise: 0.0,
            read_noise: 0.0,
            exposure: 1.0,
            seed: 0,
        }
    }

    /// Returns other focus, motion, exposure and noise with this seed.
    pub fn random(seed: u64) -> Self {
        let mut random = Random::for_purpose(seed, 0x12);
        let mut effects = Self {
            defocus: random.between(0.4, 1.1) as f32,
            vignetting: random.between(0.05, 0.25) as f32,
            shot_noise: random.between(0.8e-4, 4e-4) as f32,
            read_noise: random.between(1.5e-3, 5e-3) as f32,
            exposure: random.between(0.85, 1.15) as f32,
            seed,
            ..Self::default()
        };
        if random.chance(0.2) {
            let motion = random.between(0.5, 3.0);
            let (sine, cosine) = random.between(0.0, std::f64::consts::TAU).sin_cos();
            effects.motion = [(motion * cosine) as f32, (motion * sine) as f32];
        }
        effects
    }
}
