//! Ground truth of an image: camera, objects, poses, masks; and its XML.

mod object_mask;
mod truth_reader;
mod truth_writer;

use crate::object::{Object, Shape};
use crate::simulated_robot::{self, PALM};
use crate::{Camera, Pose, Scene};
use nalgebra::Point3;
use yarp_devices::wam::WamModel;

pub use object_mask::Mask;
pub use truth_reader::TruthError;

/// Number of a board on the tool plate in the truth.
const MOUNTED: u32 = u32::MAX;

/// The truth about an image.
#[derive(Clone, Debug, PartialEq)]
pub struct GroundTruth {
    /// Seed of the scene, if it was made from one.
    pub seed: Option<u64>,
    /// The camera.
    pub camera: CameraTruth,
    /// Joint angles of the arm, rad, if it is there.
    pub joints: Option<[f64; 7]>,
    /// Spread, then inner and outer joint of F1, F2, F3, rad, if there is a hand.
    pub hand: Option<[f64; 7]>,
    /// Height of the table's surface in the arm's base frame, m.
    pub surface: f64,
    /// Every object of the scene in its order, whether in sight or not; a board on the tool plate last, with number
    /// 4294967295.
    pub objects: Vec<ObjectTruth>,
}

/// The camera of an image.
pub type CameraTruth = Camera;

/// The truth about an object.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectTruth {
    /// The object.
    pub object: Object,
    /// Pixel of the middle of its upper face; `None` behind the camera.
    pub top: Option<[f64; 2]>,
    /// Part of the pixels that it would have in the image alone, that show it: 0 to 1, and 0 outside the image.
    pub visible: f64,
    /// True if it reaches beyond the image.
    pub truncated: bool,
    /// The pixels that show it.
    pub mask: Mask,
}

/// Output of a renderer.
pub(crate) struct Seen<'a> {
    /// Key of each pixel: pixels with the same key show the same surface.
    pub(crate) keys: &'a [u32],
    /// Owner of what a key stands for.
    pub(crate) owner_of: &'a dyn Fn(u32) -> Option<usize>,
    /// Pixels that each would have alone.
    pub(crate) whole: &'a [usize],
}

/// Collects the truth about an image.
pub(crate) fn of_picture(
    scene: &Scene,
    camera: &Camera,
    owners: usize,
    seen: &Seen<'_>,
) -> GroundTruth {
    let mut objects = scene.objects.clone();
    if let (Some(posture), Some(board)) = (&scene.robot, &scene.board) {
        let plate = simulated_robot::frames(&WamModel::<7>::new().chain, posture)[PALM];
        objects.push(Object::new(MOUNTED, board.shape, plate * board.pose));
    }
    let width = camera.lens.width;
    let masks = object_mask::of_owners(seen, owners, width, camera.lens.height);
    let objects = objects
        .into_iter()
        .zip(masks)
        .enumerate()
        .map(|(index, (object, mask))| ObjectTruth {
            top: camera.project(&top_of(&object)),
            visible: match seen.whole[index] {
                0 => 0.0,
                whole => mask.area() as f64 / whole as f64,
            },
            truncated: reaches_beyond(&object, camera),
            mask,
            object,
        })
        .collect();
    let hand = scene.robot.and_then(|robot| robot.hand).map(|hand| {
        let [one, two, three] = hand.fingers;
        [
            hand.spread,
            one.inner,
            one.outer,
            two.inner,
            two.outer,
            three.inner,
            three.outer,
        ]
    });
    GroundTruth {
        seed: None,
        camera: *camera,
        joints: scene.robot.map(|robot| robot.joints.into()),
        hand,
        surface: scene.table.surface,
        objects,
    }
}

/// The middle of the upper face while an object lies as usual.
fn top_of(object: &Object) -> Point3<f64> {
    object.pose * Point3::new(0.0, 0.0, object.shape.half_height())
}

fn reaches_beyond(object: &Object, camera: &Camera) -> bool {
    let half = object.shape.extent().map(|edge| edge / 2.0);
    let lens = &camera.lens;
    (0..8).any(|index| {
        let sign = |bit: usize| if index >> bit & 1 == 1 { 1.0 } else { -1.0 };
        let corner = Point3::new(sign(0) * half[0], sign(1) * half[1], sign(2) * half[2]);
        match camera.project(&(object.pose * corner)) {
            None => true,
            Some([u, v]) => {
                u < 0.0 || v < 0.0 || u > lens.width as f64 - 1.0 || v > lens.height as f64 - 1.0
            }
        }
    })
}

impl Shape {
    /// Returns the inner corners of a calibration board in its frame, m: column by column along y, then row by row along
    /// x; none for other shapes.
    pub fn board_corners(&self) -> Vec<Point3<f64>> {
        let Self::Board {
            columns,
            rows,
            square,
        } = *self
        else {
            return Vec::new();
        };
        let place =
            |index: u32, count: u32| (f64::from(index) - (f64::from(count) - 1.0) / 2.0) * square;
        (0..rows)
            .flat_map(|row| (0..columns).map(move |column| (row, column)))
            .map(|(row, column)| {
                Point3::new(place(row, rows), place(column, columns), self.half_height())
            })
            .collect()
    }
}

/// Returns the nine numbers of a rotation, row by row.
fn rotation_rows(pose: &Pose) -> [f64; 9] {
    let matrix = pose.rotation.matrix();
    std::array::from_fn(|index| matrix[(index / 3, index % 3)])
}
