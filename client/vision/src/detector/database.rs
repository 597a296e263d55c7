//! The object database: kinds of objects with their sizes and printed faces, in XML (section 6.5.2 of the thesis).

use std::path::Path;

use roxmltree::{Document, Node};
use yarp_devices::image::image_file;

use crate::{Image, Result, VisionError};

/// Maximum number of kinds in a file.
const MAX_KINDS: usize = 1000;
/// Maximum number of printed faces of a kind.
const MAX_FACES: usize = 6;
/// Largest difference between a measured and a listed height, m.
pub(super) const HEIGHT_TOLERANCE: f64 = 0.004;

/// Upper face of a kind of objects, m; ranges are smallest and largest.
#[derive(Clone, Debug, PartialEq)]
pub enum KindFace {
    /// A disc or ring.
    Circle {
        /// Range of radii.
        radius: [f64; 2],
    },
    /// A rectangle without a known print.
    Rectangle {
        /// Range of both sides.
        sides: [f64; 2],
    },
    /// An equilateral triangle.
    Triangle {
        /// Range of the sides.
        sides: [f64; 2],
    },
    /// A rectangle with a known print.
    Printed {
        /// Shorter and longer side.
        sides: [f64; 2],
        /// Prints that the upper face may show, each as large as the face.
        prints: Vec<Image>,
    },
}

/// A kind of objects.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectKind {
    /// Name, unique in the database.
    pub name: String,
    /// Upper face.
    pub face: KindFace,
    /// Smallest and largest height, m.
    pub height: [f64; 2],
}

impl ObjectKind {
    /// Returns whether objects of this kind may have a measured height, m.
    pub fn has_height(&self, height: f64) -> bool {
        let [low, high] = self.height;
        (low - HEIGHT_TOLERANCE..=high + HEIGHT_TOLERANCE).contains(&height)
    }
}

/// Kinds of objects that a detector knows.
///
/// ```xml
/// <objects>
///   <object name="glass" shape="circle" radius="0.030 0.043" height="0.080 0.150"/>
///   <object name="box" shape="rectangle" sides="0.040 0.160" height="0.030 0.120"/>
///   <object name="prism" shape="triangle" sides="0.060 0.120" height="0.040 0.100"/>
///   <object name="milk" shape="printed" sides="0.095 0.165" height="0.063 0.063">
///     <print image="milk-front.png"/>
///   </object>
/// </objects>
/// ```
///
/// Lengths are m. Images are relative to the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ObjectDatabase {
    /// Kinds; of several that fit, printed ones come first, then in this order.
    pub kinds: Vec<ObjectKind>,
}

impl ObjectDatabase {
    /// Reads a database and the images that it names.
    ///
    /// Errors: [`VisionError::File`], [`VisionError::Unsuitable`], [`VisionError::Device`] for an image.
    pub fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path)
            .map_err(VisionError::file("read the object database", path))?;
        let folder = path.parent().unwrap_or(Path::new("."));
        Self::parse(&text, &path.display().to_string(), |image| {
            Ok(image_file::read(&folder.join(image))?)
        })
    }

    /// Reads a database from text; `image` returns the image of a name.
    ///
    /// Errors: as [`Self::read`]; `source` names the text in them.
    pub fn parse(
        text: &str,
        source: &str,
        mut image: impl FnMut(&str) -> Result<Image>,
    ) -> Result<Self> {
        let unsuitable = |actual: String| VisionError::Unsuitable {
            what: format!("object database {source}"),
            expected: "<objects> with <object name shape height ...> elements".to_owned(),
            actual,
        };
        let document = Document::parse(text).map_err(|error| unsuitable(error.to_string()))?;
        let root = document.root_element();
        if root.tag_name().name() != "objects" {
            return Err(unsuitable(format!("<{}>", root.tag_name().name())));
        }
        let mut database = Self::default();
        for node in root.children().filter(Node::is_element) {
            let line = document.text_pos_at(node.range().start).row;
            let failed = |why: String| unsuitable(format!("line {line}: {why}"));
            if database.kinds.len() == MAX_KINDS {
                return Err(failed(format!("more than {MAX_KINDS} objects")));
            }
            let kind = kind(&node, &mut image).map_err(|error| match error {
                KindError::Form(why) => failed(why),
                KindError::Image(error) => error,
            })?;
            if database.kinds.iter().any(|other| other.name == kind.name) {
                return Err(failed(format!("second object named {}", kind.name)));
            }
            database.kinds.push(kind);
        }
        Ok(database)
    }
}

enum KindError {
    Form(String),
    Image(VisionError),
}

fn kind(
    node: &Node<'_, '_>,
    image: &mut impl FnMut(&str) -> Result<Image>,
) -> Result<ObjectKind, KindError> {
    let text = |name: &str| {
        let missing = || KindError::Form(format!("no attribute {name}"));
        node.attribute(name).ok_or_else(missing)
    };
    let range = |name: &str| {
        let text = text(name)?;
        let values: Vec<f64> = text.split_whitespace().flat_map(str::parse).collect();
        match values[..] {
            [low, high] if low > 0.0 && high >= low && high < 10.0 => Ok([low, high]),
            _ => Err(KindError::Form(format!(
                "{name}=\"{text}\" is not a smallest and a largest length in m"
            ))),
        }
    };
    let face = match text("shape")? {
        "circle" => KindFace::Circle {
            radius: range("radius")?,
        },
        "rectangle" => KindFace::Rectangle {
            sides: range("sides")?,
        },
        "triangle" => KindFace::Triangle {
            sides: range("sides")?,
        },
        "printed" => {
            let mut prints = Vec::new();
            for print in node.children().filter(|node| node.has_tag_name("print")) {
                let no_image = || KindError::Form("<print> without image".to_owned());
                let name = print.attribute("image").ok_or_else(no_image)?;
                prints.push(image(name).map_err(KindError::Image)?);
            }
            if prints.is_empty() || prints.len() > MAX_FACES {
                return Err(KindError::Form(format!(
                    "{} <print> elements, 1 to {MAX_FACES} are expected",
                    prints.len()
                )));
            }
            KindFace::Printed {
                sides: range("sides")?,
                prints,
            }
        }
        other => {
            return Err(KindError::Form(format!(
                "shape=\"{other}\" is none of circle, rectangle, triangle, printed"
            )));
        }
    };
    Ok(ObjectKind {
        name: text("name")?.to_owned(),
        face,
        height: range("height")?,
    })
}
