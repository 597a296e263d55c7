//! Images with truth, any number of them, from a seed.

use std::fs;
use std::path::Path;

use yarp_devices::kinematics::Joints;

use crate::png_files::{OutputError, write_image};
use crate::random::hash;
use crate::simulated_robot::{HandPosture, RobotPosture, frames};
use crate::{
    BrickKind, Effects, Face, NoRoom, Placement, Random, Renderer, Scene, Shot, arm_model,
    brick_face,
};

/// Postures tried before an image goes without the arm.
const TRIES: usize = 50;
/// Height of the tool plate above the table in images with the arm, m: the hand does not touch anything.
const PLATE_HEIGHT: f64 = 0.32;

/// Content of the images of a [`Dataset`].
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct DatasetOptions {
    /// Objects and where they lie.
    pub placement: Placement,
    /// Fewest objects on an image; `placement.count` is the most.
    pub fewest: usize,
    /// Part of the images with the arm above the table.
    pub with_arm: f64,
}

impl Default for DatasetOptions {
    fn default() -> Self {
        Self {
            placement: Placement {
                count: 10,
                clutter: 2,
                ..Placement::default()
            },
            fewest: 3,
            with_arm: 0.2,
        }
    }
}

/// A set of images with truth.
///
/// ```
/// use yarp_table::{Dataset, DatasetOptions};
///
/// let dataset = Dataset::new(1, DatasetOptions::default());
/// let (scene, effects) = dataset.scene(17).unwrap();
/// assert!(scene.objects.len() >= 3 && effects.defocus > 0.0);
/// ```
#[derive(Debug)]
pub struct Dataset {
    seed: u64,
    options: DatasetOptions,
    renderer: Renderer,
}

impl Dataset {
    /// Describes a set; no image is rendered yet.
    pub fn new(seed: u64, options: DatasetOptions) -> Self {
        Self {
            seed,
            options,
            renderer: Renderer::new(),
        }
    }

    /// Returns scene and camera effects of an image.
    ///
    /// Errors: [`NoRoom`] when the options ask for more than fits on the table.
    pub fn scene(&self, index: u64) -> Result<(Scene, Effects), NoRoom> {
        let seed = self.seed_of(index);
        let mut random = Random::for_purpose(seed, 0x41);
        let mut placement = self.options.placement.clone();
        let fewest = self.options.fewest.min(placement.count);
        placement.count = fewest + random.below(placement.count - fewest + 1);
        placement.clutter = random.below(placement.clutter + 1);
        let mut scene = Scene::random(seed, &placement)?;
        if random.chance(self.options.with_arm) {
            scene.robot = hovering(&mut random);
        }
        Ok((scene, Effects::random(seed)))
    }

    /// Renders an image.
    ///
    /// Errors: [`NoRoom`].
    pub fn shot(&self, index: u64) -> Result<Shot, NoRoom> {
        let (scene, effects) = self.scene(index)?;
        let mut shot = self.renderer.render(&scene, &scene.camera(), &effects);
        shot.truth.seed = Some(self.seed_of(index));
        Ok(shot)
    }

    fn seed_of(&self, index: u64) -> u64 {
        hash(self.seed ^ hash(index))
    }
}

/// Writes image and truth into a folder, as `NAME.png` and `NAME.xml`.
///
/// Errors: [`OutputError`].
pub fn write_shot(directory: &Path, name: &str, shot: &Shot) -> Result<(), OutputError> {
    write_image(&directory.join(format!("{name}.png")), &shot.image)?;
    let path = directory.join(format!("{name}.xml"));
    fs::write(&path, shot.truth.to_xml()).map_err(OutputError::file(&path))
}

/// Writes the print of each carton into a folder, as `KIND-FACE.png`: models for a recogniser, 3 pixels per mm; and
/// [`objects_xml`] as `objects.xml`.
///
/// Errors: [`OutputError`].
pub fn write_models(directory: &Path) -> Result<(), OutputError> {
    for kind in BrickKind::all() {
        for face in Face::ALL {
            let name = format!("{}-{}.png", kind.name(), face.word());
            write_image(&directory.join(name), &brick_face(kind, face))?;
        }
    }
    let path = directory.join("objects.xml");
    fs::write(&path, objects_xml()).map_err(OutputError::file(&path))
}

/// Returns the object database of the table for a recogniser: kinds with the ranges of their sizes, and the prints that lie
/// up as the image files of [`write_models`].
pub fn objects_xml() -> String {
    let mut text = String::from("<objects>\n");
    for kind in BrickKind::all() {
        let [width, length, height] = kind.size();
        let name = kind.name();
        text += &format!(
            "  <object name=\"{name}\" shape=\"printed\" sides=\"{width} {length}\" height=\"{height} {height}\">\n    \
             <print image=\"{name}-front.png\"/>\n    <print image=\"{name}-back.png\"/>\n  </object>\n"
        );
    }
    text += r#"  <object name="glass" shape="circle" radius="0.030 0.0425" height="0.080 0.150"/>
  <object name="plate" shape="circle" radius="0.090 0.100" height="0.015 0.025"/>
  <object name="box" shape="rectangle" sides="0.040 0.160" height="0.030 0.120"/>
  <object name="prism" shape="triangle" sides="0.060 0.120" height="0.040 0.100"/>
</objects>
"#;
    text
}

/// Arm and hand at some place above the table.
fn hovering(random: &mut Random) -> Option<RobotPosture> {
    let chain = arm_model().chain;
    (0..TRIES).find_map(|_| {
        let mut between = |min: f64, max: f64| random.between(min, max);
        let posture = RobotPosture {
            joints: Joints::<7>::from([
                between(-0.7, 0.7),
                between(0.1, 0.9),
                between(-0.3, 0.3),
                between(1.4, 2.3),
                between(-0.5, 0.5),
                between(-0.2, 0.9),
                between(-1.5, 1.5),
            ]),
            hand: Some(HandPosture {
                spread: between(0.0, 1.5),
                ..HandPosture::default()
            }),
        };
        let plate = frames(&chain, &posture)[crate::simulated_robot::PALM];
        let high = plate.translation.z > crate::SURFACE + PLATE_HEIGHT;
        let in_sight = (0.35..0.75).contains(&plate.translation.x)
            && plate.translation.y.abs() < 0.35
            && plate.translation.z < 0.5;
        (high && in_sight).then_some(posture)
    })
}
