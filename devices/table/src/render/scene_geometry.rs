//! From a scene to solids.

use nalgebra::{Matrix3, Point3, Rotation3, Unit, Vector3};
use yarp_devices::wam::WamModel;

use super::hit::Vector;
use super::material::Material;
use super::primitive::{Primitive, Solid};
use crate::object::{Object, Shape};
use crate::simulated_robot::{self, RobotPosture};
use crate::{Camera, MountedBoard, Pose, Scene};

/// Linear reflectances of the arm's covers, of its joints, of fingers and of the baskets.
const COVER: [f32; 3] = [0.62, 0.62, 0.60];
const JOINT: [f32; 3] = [0.10, 0.10, 0.11];
const FINGER: [f32; 3] = [0.33, 0.34, 0.36];
const RUBBER: [f32; 3] = [0.04, 0.04, 0.04];
const BASKET: [f32; 3] = [0.45, 0.30, 0.15];

/// One of three boxes has a label.
const LABELLED: u64 = 3;

/// All solids of a scene, relative to a camera. Objects own theirs in their order; a mounted board comes after them.
pub(super) fn primitives(scene: &Scene, camera: &Camera) -> Vec<Primitive> {
    let eye = camera.pose.translation.vector;
    let mut all = Vec::new();
    for (index, object) in scene.objects.iter().enumerate() {
        all.push(object_primitive(object, index, &eye));
    }
    if let Some(posture) = &scene.robot {
        add_robot(&mut all, posture, scene.board.as_ref(), scene, &eye);
    }
    for basket in &scene.baskets {
        for (middle, edges) in basket.walls() {
            let half = Vector3::from(edges) / 2.0;
            all.push(Primitive::new(
                Solid::Box(half.cast()),
                &Pose::translation(middle[0], middle[1], middle[2]),
                &eye,
                Material::Plain(BASKET, 0.02),
            ));
        }
    }
    all
}

impl Primitive {
    fn new(solid: Solid, pose: &Pose, eye: &Vector3<f64>, material: Material) -> Self {
        let rotation: Matrix3<f32> = pose.rotation.matrix().cast();
        let centre: Vector = (pose.translation.vector - eye).cast();
        Self {
            solid,
            rotation,
            centre,
            eye: rotation.tr_mul(&-centre),
            radius: solid.half_extent().norm(),
            owner: None,
            material,
            opacity: 1.0,
        }
    }
}

fn object_primitive(object: &Object, owner: usize, eye: &Vector3<f64>) -> Primitive {
    let finish = object.finish;
    let half = Vector3::from(object.shape.extent().map(|edge| edge / 2.0));
    let half: Vector = half.cast();
    let (solid, material) = match object.shape {
        Shape::Glass {
            radius,
            height,
            wall,
        } => {
            let inner = (radius - wall) as f32;
            let solid = Solid::Cup(radius as f32, inner, height as f32 / 2.0, wall as f32);
            let rim = finish.colour.map(|value| (value * 1.15 + 0.05).min(0.95));
            (solid, Material::Cup(finish.colour, rim, finish.gloss))
        }
        Shape::Plate { radius, height } => (
            Solid::Cylinder(radius as f32, height as f32 / 2.0),
            Material::Plate(finish.colour, finish.accent, radius as f32, finish.gloss),
        ),
        Shape::Box { .. } if finish.seed % LABELLED == 1 => {
            let label = [half.x * 0.55, half.y * 0.5];
            let material = Material::Label(finish.colour, finish.accent, label, finish.gloss);
            (Solid::Box(half), material)
        }
        Shape::Box { .. } | Shape::Clutter { .. } => (
            Solid::Box(half),
            Material::Plain(finish.colour, finish.gloss),
        ),
        Shape::Prism { side, height } => (
            Solid::Prism(side as f32, height as f32 / 2.0),
            Material::Plain(finish.colour, finish.gloss),
        ),
        Shape::Brick { kind } => (Solid::Box(half), Material::Brick(kind)),
        Shape::Board {
            columns,
            rows,
            square,
        } => (
            Solid::Box(half),
            Material::Board(columns, rows, square as f32),
        ),
    };
    Primitive {
        owner: Some(owner),
        opacity: finish.opacity,
        ..Primitive::new(solid, &object.pose, eye, material)
    }
}

fn add_robot(
    all: &mut Vec<Primitive>,
    posture: &RobotPosture,
    board: Option<&MountedBoard>,
    scene: &Scene,
    eye: &Vector3<f64>,
) {
    let chain = WamModel::<7>::new().chain;
    let frames = simulated_robot::frames(&chain, posture);
    for solid in simulated_robot::solids(posture.hand.is_some()) {
        let frame = &frames[solid.part];
        let pose = frame * along(&solid.from, &solid.to);
        let half = (solid.to - solid.from).norm() / 2.0;
        let material = match simulated_robot::finger_of(solid.part) {
            Some((_, 2)) => Material::Plain(RUBBER, 0.05),
            Some(_) => Material::Plain(FINGER, 0.4),
            None if solid.radius > 0.05 => Material::Plain(COVER, 0.2),
            None => Material::Plain(JOINT, 0.2),
        };
        let capsule = Solid::Capsule(solid.radius as f32, half as f32);
        all.push(Primitive::new(capsule, &pose, eye, material));
    }
    if let Some(board) = board {
        let object = Object::new(
            u32::MAX,
            board.shape,
            frames[simulated_robot::PALM] * board.pose,
        );
        all.push(object_primitive(&object, scene.objects.len(), eye));
    }
}

/// A frame in the middle between two points, with z from one to the other.
fn along(from: &Point3<f64>, to: &Point3<f64>) -> Pose {
    let middle = nalgebra::center(from, to);
    let direction = Unit::try_new(to - from, 1e-9).unwrap_or(Vector3::z_axis());
    let turn = Rotation3::rotation_between(&Vector3::z(), &direction);
    // Opposite to z there is no one way to turn.
    let turn = turn
        .unwrap_or_else(|| Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
    Pose::from_parts(middle.coords.into(), turn)
}
