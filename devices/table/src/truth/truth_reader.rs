//! The truth from XML, and scenes from files of the same form.

use std::str::FromStr;

use nalgebra::{Matrix3, Rotation3, Translation3};
use roxmltree::{Document, Node};

use super::{GroundTruth, Mask, ObjectTruth};
use crate::bricks::BrickKind;
use crate::object::{Class, Finish, Object, Shape};
use crate::{Camera, Lens, Pose, Scene};

/// Longest side of an image and largest number of squares of a board that files may name.
const MAX_IMAGE_SIDE: usize = 16_384;
const MOST_CORNERS: u32 = 100;

/// An error of reading ground truth or a scene.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TruthError {
    /// No XML.
    #[error("expected XML: {0}")]
    Xml(#[from] roxmltree::Error),
    /// An element is missing or unknown.
    #[error("line {line}: expected element <{expected}> in <{inside}>")]
    Element {
        /// Line, from 1.
        line: u32,
        /// Expected element.
        expected: &'static str,
        /// In which element.
        inside: String,
    },
    /// An attribute is missing or has no such value.
    #[error("line {line}: attribute {name} of <{element}> must be {expected}, found {found:?}")]
    Attribute {
        /// Line, from 1.
        line: u32,
        /// Of which element.
        element: String,
        /// Its name.
        name: &'static str,
        /// Expected value.
        expected: &'static str,
        /// Found value.
        found: Option<String>,
    },
}

type Result<T> = std::result::Result<T, TruthError>;

impl GroundTruth {
    /// Reads what [`to_xml`](Self::to_xml) wrote.
    ///
    /// Errors: [`TruthError`], which names line, element and attribute.
    pub fn from_xml(xml: &str) -> Result<Self> {
        let document = Document::parse(xml)?;
        let root = table(&document)?;
        let camera = camera(root)?;
        let robot = children(root, "robot").next();
        let joints = robot.map(|robot| list(robot, "joints")).transpose()?;
        let hand = match robot {
            Some(robot) if robot.attribute("hand").is_some() => Some(list(robot, "hand")?),
            _ => None,
        };
        let objects = children(root, "object")
            .map(|node| object_truth(node, &camera.lens))
            .collect::<Result<_>>()?;
        Ok(Self {
            seed: optional(root, "seed", "a whole number")?,
            surface: number(root, "surface")?,
            camera,
            joints,
            hand,
            objects,
        })
    }
}

impl Scene {
    /// Reads a scene: `<table>` with an `<object>` for each object, as in the truth about an image. All that says how an
    /// image looked is ignored, and may be absent.
    ///
    /// An object without `<pose>` lies on the table at `x` and `y`, turned by `yaw` (rad).
    ///
    /// ```
    /// let scene = yarp_table::Scene::from_xml(
    ///     r#"<table><object id="3" class="glass" radius="0.03" height="0.1" x="0.5" y="0.1"/></table>"#,
    /// ).unwrap();
    /// assert_eq!(scene.objects[0].pose.translation.z, 0.0);
    /// ```
    ///
    /// Errors: [`TruthError`].
    pub fn from_xml(xml: &str) -> Result<Self> {
        let document = Document::parse(xml)?;
        let root = table(&document)?;
        let mut scene = Self::empty();
        if let Some(surface) = optional(root, "surface", "a number")? {
            scene.table.surface = surface;
        }
        if let Some(seed) = optional(root, "seed", "a whole number")? {
            scene.table.seed = seed;
        }
        for node in children(root, "object") {
            let object = object(node, &scene)?;
            if scene.object(object.id).is_some() {
                return Err(wrong(node, "id", "a number that no other object has"));
            }
            scene.objects.push(object);
        }
        Ok(scene)
    }
}

fn table<'a>(document: &'a Document<'_>) -> Result<Node<'a, 'a>> {
    let root = document.root_element();
    if root.has_tag_name("table") {
        Ok(root)
    } else {
        Err(missing(root, "table"))
    }
}

fn children<'a>(node: Node<'a, 'a>, name: &'static str) -> impl Iterator<Item = Node<'a, 'a>> {
    node.children()
        .filter(move |child| child.has_tag_name(name))
}

fn line(node: Node<'_, '_>) -> u32 {
    node.document().text_pos_at(node.range().start).row
}

fn missing(node: Node<'_, '_>, expected: &'static str) -> TruthError {
    TruthError::Element {
        line: line(node),
        expected,
        inside: node.tag_name().name().to_owned(),
    }
}

fn wrong(node: Node<'_, '_>, name: &'static str, expected: &'static str) -> TruthError {
    TruthError::Attribute {
        line: line(node),
        element: node.tag_name().name().to_owned(),
        name,
        expected,
        found: node.attribute(name).map(str::to_owned),
    }
}

fn value<T: FromStr>(node: Node<'_, '_>, name: &'static str, expected: &'static str) -> Result<T> {
    let parsed = node
        .attribute(name)
        .and_then(|text| text.trim().parse().ok());
    parsed.ok_or_else(|| wrong(node, name, expected))
}

fn optional<T: FromStr>(
    node: Node<'_, '_>,
    name: &'static str,
    expected: &'static str,
) -> Result<Option<T>> {
    match node.attribute(name) {
        None => Ok(None),
        Some(_) => value(node, name, expected).map(Some),
    }
}

fn number(node: Node<'_, '_>, name: &'static str) -> Result<f64> {
    let number: f64 = value(node, name, "a number")?;
    if number.is_finite() {
        Ok(number)
    } else {
        Err(wrong(node, name, "a finite number"))
    }
}

/// A length, mass or the like.
fn positive(node: Node<'_, '_>, name: &'static str) -> Result<f64> {
    let number = number(node, name)?;
    if (1e-4..=100.0).contains(&number) {
        Ok(number)
    } else {
        Err(wrong(node, name, "a number from 0.0001 to 100"))
    }
}

fn list<const N: usize>(node: Node<'_, '_>, name: &'static str) -> Result<[f64; N]> {
    let expected = "a list of as many finite numbers as it has parts";
    let text = node
        .attribute(name)
        .ok_or_else(|| wrong(node, name, expected))?;
    let numbers: Vec<f64> = text
        .split_whitespace()
        .take(N + 1)
        .map(str::parse)
        .collect::<std::result::Result<_, _>>()
        .map_err(|_| wrong(node, name, expected))?;
    let all = <[f64; N]>::try_from(numbers).map_err(|_| wrong(node, name, expected))?;
    if all.iter().all(|number| number.is_finite()) {
        Ok(all)
    } else {
        Err(wrong(node, name, expected))
    }
}

fn pose(node: Node<'_, '_>) -> Result<Pose> {
    let position: [f64; 3] = list(node, "position")?;
    let rows: [f64; 9] = list(node, "rotation")?;
    let matrix = Matrix3::from_row_slice(&rows);
    let is_rotation = (matrix * matrix.transpose() - Matrix3::identity()).amax() < 1e-6
        && matrix.determinant() > 0.0;
    if !is_rotation {
        return Err(wrong(node, "rotation", "the rows of a rotation matrix"));
    }
    Ok(Pose::from_parts(
        Translation3::from(position),
        Rotation3::from_matrix_unchecked(matrix),
    ))
}

fn camera(root: Node<'_, '_>) -> Result<Camera> {
    let node = children(root, "camera").next();
    let node = node.ok_or_else(|| missing(root, "camera"))?;
    let side = |name| {
        let pixels: usize = value(node, name, "a number of pixels")?;
        if (1..=MAX_IMAGE_SIDE).contains(&pixels) {
            Ok(pixels)
        } else {
            Err(wrong(node, name, "a number of pixels from 1 to 16384"))
        }
    };
    let lens = Lens {
        width: side("width")?,
        height: side("height")?,
        focal: list(node, "focal")?,
        centre: list(node, "centre")?,
        distortion: list(node, "distortion")?,
    };
    let place = children(node, "pose").next();
    Ok(Camera {
        lens,
        pose: pose(place.ok_or_else(|| missing(node, "pose"))?)?,
    })
}

fn object_truth(node: Node<'_, '_>, lens: &Lens) -> Result<ObjectTruth> {
    let object = object(node, &Scene::empty())?;
    let seen = children(node, "seen").next();
    let seen = seen.ok_or_else(|| missing(node, "seen"))?;
    let top = match seen.attribute("top") {
        Some(_) => Some(list(seen, "top")?),
        None => None,
    };
    let numbers: Vec<u32> = seen
        .text()
        .unwrap_or_default()
        .split_whitespace()
        .map(str::parse)
        .collect::<std::result::Result<_, _>>()
        .map_err(|_| wrong(seen, "pixels", "followed by pairs of whole numbers"))?;
    let pairs = numbers.chunks_exact(2);
    let whole = pairs.remainder().is_empty();
    let runs: Vec<(u32, u32)> = pairs.map(|pair| (pair[0], pair[1])).collect();
    let mask = Mask::from_runs(lens.width, lens.height, runs)
        .filter(|mask| whole && value::<usize>(seen, "pixels", "").is_ok_and(|n| n == mask.area()));
    Ok(ObjectTruth {
        object,
        top,
        visible: number(seen, "visible")?,
        truncated: value(seen, "truncated", "true or false")?,
        mask: mask.ok_or_else(|| {
            wrong(
                seen,
                "pixels",
                "the number of pixels of the runs that follow it",
            )
        })?,
    })
}

fn object(node: Node<'_, '_>, scene: &Scene) -> Result<Object> {
    let id = value(node, "id", "a whole number")?;
    let shape = shape(node)?;
    let place = match children(node, "pose").next() {
        Some(place) => pose(place)?,
        None => {
            let yaw = optional(node, "yaw", "an angle in rad")?.unwrap_or(0.0);
            scene.lying(&shape, number(node, "x")?, number(node, "y")?, yaw)
        }
    };
    let mut object = Object::new(id, shape, place);
    if node.attribute("mass").is_some() {
        object.mass = positive(node, "mass")?;
    }
    if node.attribute("friction").is_some() {
        let friction = number(node, "friction")?;
        if !(0.0..=10.0).contains(&friction) {
            return Err(wrong(node, "friction", "a number from 0 to 10"));
        }
        object.friction = friction;
    }
    if let Some(looks) = children(node, "finish").next() {
        let colour = |name| -> Result<[f32; 3]> {
            let all: [f64; 3] = list(looks, name)?;
            Ok(all.map(|value| value as f32))
        };
        object.finish = Finish {
            colour: colour("colour")?,
            accent: colour("accent")?,
            gloss: value(looks, "gloss", "a number")?,
            opacity: value(looks, "opacity", "a number")?,
            seed: value(looks, "seed", "a whole number")?,
        };
    }
    Ok(object)
}

fn shape(node: Node<'_, '_>) -> Result<Shape> {
    let class = node.attribute("class").and_then(Class::from_word);
    let size = || -> Result<[f64; 3]> {
        let size: [f64; 3] = list(node, "size")?;
        if size.iter().all(|edge| (1e-4..=10.0).contains(edge)) {
            Ok(size)
        } else {
            Err(wrong(node, "size", "three edges from 0.0001 to 10 m"))
        }
    };
    let corners = |name| {
        let count: u32 = value(node, name, "a number of inner corners")?;
        if (1..=MOST_CORNERS).contains(&count) {
            Ok(count)
        } else {
            Err(wrong(node, name, "a number of inner corners from 1 to 100"))
        }
    };
    Ok(match class {
        Some(Class::Glass) => {
            let radius = positive(node, "radius")?;
            let wall = match node.attribute("wall") {
                Some(_) => positive(node, "wall")?,
                None => 0.003,
            };
            if wall >= radius {
                return Err(wrong(node, "wall", "less than the radius"));
            }
            Shape::Glass {
                radius,
                height: positive(node, "height")?,
                wall,
            }
        }
        Some(Class::Plate) => Shape::Plate {
            radius: positive(node, "radius")?,
            height: positive(node, "height")?,
        },
        Some(Class::Box) => Shape::Box { size: size()? },
        Some(Class::Clutter) => Shape::Clutter { size: size()? },
        Some(Class::Prism) => Shape::Prism {
            side: positive(node, "side")?,
            height: positive(node, "height")?,
        },
        Some(Class::Brick) => {
            let kind = node.attribute("brick").and_then(BrickKind::from_name);
            Shape::Brick {
                kind: kind.ok_or_else(|| wrong(node, "brick", "a kind of the catalogue"))?,
            }
        }
        Some(Class::Board) => Shape::Board {
            columns: corners("columns")?,
            rows: corners("rows")?,
            square: positive(node, "square")?,
        },
        None => return Err(wrong(node, "class", "a class of objects")),
    })
}
