//! Images, masks and depth of a scene: ray casting on two threads.
//!
//! | file | what it is about |
//! | --- | --- |
//! | `scene_geometry` | from a scene to solids |
//! | `primitive`, `hit` | where a ray meets a solid |
//! | `material` | what a surface looks like there |
//! | `light` | lamps and shadows |
//! | `cast` | a ray through each pixel, more where a face ends |
//! | `tile` | which solids a square of the image may show, and which may cast shadows there |
//! | `film` | what lens and sensor add |

mod cast;
mod hit;
mod light;
mod material;
mod primitive;
mod scene_geometry;
mod sensor_effects;
mod tile;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;

use yarp_devices::image::{Image, PixelFormat};

use crate::truth::{self, GroundTruth};
use crate::{Camera, Effects, Lens, Random, Scene};
use cast::{Caster, Picture, Rays};
use light::Light;

/// Threads that render.
const THREADS: usize = 2;
/// Lenses whose rays are kept.
const KEPT: usize = 4;

/// An image and the truth about it.
#[derive(Clone, Debug)]
pub struct Shot {
    /// In red, green and blue.
    pub image: Image,
    /// Ground truth, as a camera without blur and noise would see it.
    pub truth: GroundTruth,
}

/// A depth image.
#[derive(Clone, Debug, PartialEq)]
pub struct Depth {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Depth along the optical axis, m, row after row; 0 where nothing was measured.
    pub metres: Vec<f32>,
}

/// Errors of a depth sensor; values usual for structured light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthNoise {
    /// Standard deviation at 1 m, m; grows with the square of the depth.
    pub deviation: f64,
    /// Smallest step at 1 m, m; grows with the square of the depth.
    pub step: f64,
    /// Part of the pixels at edges without a value.
    pub lost_at_edges: f64,
    /// Seed.
    pub seed: u64,
}

impl Default for DepthNoise {
    fn default() -> Self {
        Self {
            deviation: 0.0014,
            step: 0.0028,
            lost_at_edges: 0.5,
            seed: 0,
        }
    }
}

impl DepthNoise {
    /// Returns an ideal sensor.
    pub fn none() -> Self {
        Self {
            deviation: 0.0,
            step: 0.0,
            lost_at_edges: 0.0,
            seed: 0,
        }
    }
}

/// Renders scenes; keeps what depends on the lens alone.
#[derive(Default)]
pub struct Renderer {
    rays: Mutex<Vec<Arc<Rays>>>,
}

impl std::fmt::Debug for Renderer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Renderer").finish_non_exhaustive()
    }
}

impl Renderer {
    /// Creates a renderer; its first image of each lens takes longer.
    pub fn new() -> Self {
        Self::default()
    }

    /// Returns what the camera sees, and the truth about it.
    ///
    /// The same scene, camera and effects give the same bytes.
    pub fn render(&self, scene: &Scene, camera: &Camera, effects: &Effects) -> Shot {
        let rays = self.rays(camera.lens);
        let all = scene_geometry::primitives(scene, camera);
        let light = Light::new(scene, &camera.pose.translation.vector, &all);
        let owners = owners(scene);
        let caster = Caster::new(scene, camera, &all, &rays, Some(&light), owners);
        let mut picture = caster.cast();
        caster.smooth(&mut picture, effects.supersampling as usize);
        let owner_of = |key| Picture::solid(key).and_then(|index| all[index].owner);
        let seen = truth::Seen {
            keys: &picture.keys,
            owner_of: &owner_of,
            whole: &picture.whole,
        };
        let truth = truth::of_picture(scene, camera, owners, &seen);
        let bytes = sensor_effects::develop(picture.light, camera.lens.width, effects);
        let image = Image::new(
            PixelFormat::Rgb,
            camera.lens.width,
            camera.lens.height,
            bytes,
        )
        .expect("as many bytes were made as the lens has pixels");
        Shot { image, truth }
    }

    /// Returns what a depth sensor at this place measures.
    pub fn depth(&self, scene: &Scene, camera: &Camera, noise: &DepthNoise) -> Depth {
        let rays = self.rays(camera.lens);
        let all = scene_geometry::primitives(scene, camera);
        let caster = Caster::new(scene, camera, &all, &rays, None, owners(scene));
        let picture = caster.cast();
        let (width, height) = (camera.lens.width, camera.lens.height);
        let metres = measured(&picture.depth, width, noise);
        Depth {
            width,
            height,
            metres,
        }
    }

    fn rays(&self, lens: Lens) -> Arc<Rays> {
        let mut kept = lock(&self.rays);
        if let Some(rays) = kept.iter().find(|rays| rays.lens == lens) {
            return Arc::clone(rays);
        }
        let rays = Arc::new(Rays::new(lens));
        if kept.len() == KEPT {
            kept.remove(0);
        }
        kept.push(Arc::clone(&rays));
        rays
    }
}

/// Returns how many things the truth lists: the objects, and a board on the tool plate of a robot that is there.
fn owners(scene: &Scene) -> usize {
    scene.objects.len() + usize::from(scene.board.is_some() && scene.robot.is_some())
}

fn measured(depth: &[f32], width: usize, noise: &DepthNoise) -> Vec<f32> {
    /// A step in depth larger than this is an edge, m.
    const EDGE: f32 = 0.01;
    let mut random = Random::for_purpose(noise.seed, 0x31);
    (0..depth.len())
        .map(|index| {
            let here = f64::from(depth[index]);
            let beside = |other: usize| {
                depth
                    .get(other)
                    .is_some_and(|other| (other - depth[index]).abs() > EDGE)
            };
            let edge = beside(index + 1) || beside(index.wrapping_sub(1)) || beside(index + width);
            if edge && random.chance(noise.lost_at_edges) {
                return 0.0;
            }
            let square = here * here;
            let mut value = here;
            if noise.deviation > 0.0 {
                value += noise.deviation * square * random.gaussian();
            }
            let step = noise.step * square;
            if step > 0.0 {
                value = (value / step).round() * step;
            }
            value as f32
        })
        .collect()
}

/// Runs the same closure on several threads, which share out the work among themselves.
fn work(threads: usize, job: impl Fn() + Sync) {
    thread::scope(|scope| {
        for _ in 1..threads {
            scope.spawn(&job);
        }
        job();
    });
}

/// The next piece of work, if there is one left.
fn next<I: Iterator>(pieces: &Mutex<I>) -> Option<I::Item> {
    lock(pieces).next()
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
