//! Grasping scripts: grasps that the object database lists with a kind of objects (section 6.3.3 of the thesis).

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use roxmltree::{Document, Node};

use super::fingers::{FINGER_STOP, SPREAD_STOP, TIP_RADIUS, reach};
use super::{Grasp, GraspOptions, PALM_DEPTH, SQUEEZE, deepest, hand_pose};
use crate::item::Item;

/// Maximum number of scripts of a kind.
const MAX_SCRIPTS: usize = 64;
/// Largest distance of the hand from the middle of an object's upper face, m.
const MAX_DISTANCE: f64 = 0.3;

/// A grasp from above, relative to the object.
#[derive(Clone, Debug, PartialEq)]
struct GraspScript {
    name: String,
    /// Place of the hand's frame from the middle of the upper face, along the axes of the object, m.
    position: [f64; 3],
    /// Direction of F3 seen from the hand, from the object's x axis towards its y axis, rad.
    turn: f64,
    spread: i32,
    open: i32,
    contact: i32,
}

/// The grasping scripts of an object database, by kind of object.
///
/// They are children of the objects in the XML file from which a detector reads sizes and prints; everything else in it is
/// ignored:
///
/// ```xml
/// <objects>
///   <object name="glass" shape="circle" radius="0.030 0.043" height="0.080 0.150">
///     <grasp name="rim" position="0 0 0.11" turn="90" spread="480" open="5200" contact="8900"/>
///   </object>
/// </objects>
/// ```
///
/// * `position`: place of the hand's frame from the middle of the upper face, m, in the frame of the object: y along its
///   longest side, z up.
/// * `turn`: direction of F3 seen from the middle of the hand, degrees from x towards y. The palm looks down.
/// * `spread`, `open`, `contact`: positions of the motors in counts: of F1 and F2 about the palm, of the fingers before the
///   grasp, and where they touch the object.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GraspScripts(HashMap<String, Vec<GraspScript>>);

/// An error of an object database with grasping scripts.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ScriptError {
    /// The file could not be read.
    #[error("cannot read the object database {path}: {source}", path = path.display())]
    File {
        /// Path of the file.
        path: PathBuf,
        /// Reason.
        source: std::io::Error,
    },
    /// The text is no XML.
    #[error("object database {file}: {source}")]
    Xml {
        /// Name of the file.
        file: String,
        /// Reason, with the line.
        source: Box<roxmltree::Error>,
    },
    /// A script is not complete or out of range.
    #[error("object database {file}, line {line}: {problem}")]
    Form {
        /// Name of the file.
        file: String,
        /// Line of the element.
        line: u32,
        /// Problem of the element, with what is expected.
        problem: String,
    },
}

impl GraspScripts {
    /// Reads the scripts of an object database.
    ///
    /// Errors: [`ScriptError`].
    pub fn read(path: &Path) -> Result<Self, ScriptError> {
        let text = std::fs::read_to_string(path).map_err(|source| ScriptError::File {
            path: path.to_owned(),
            source,
        })?;
        Self::parse(&text, &path.display().to_string())
    }

    /// Reads the scripts from text; `file` names it in errors.
    ///
    /// Errors: [`ScriptError::Xml`], [`ScriptError::Form`].
    pub fn parse(text: &str, file: &str) -> Result<Self, ScriptError> {
        let document = Document::parse(text).map_err(|source| ScriptError::Xml {
            file: file.to_owned(),
            source: Box::new(source),
        })?;
        let mut scripts = Self::default();
        let named = |node: &Node<'_, '_>, name: &str| node.is_element() && node.has_tag_name(name);
        let objects = document.root_element().children();
        for object in objects.filter(|node| named(node, "object")) {
            for node in object.children().filter(|node| named(node, "grasp")) {
                let form = |problem: String| ScriptError::Form {
                    file: file.to_owned(),
                    line: document.text_pos_at(node.range().start).row,
                    problem,
                };
                let kind = object.attribute("name");
                let kind = kind.ok_or_else(|| form("the <object> has no name".to_owned()))?;
                let script = script(&node).map_err(form)?;
                let all = scripts.0.entry(kind.to_owned()).or_default();
                if all.len() == MAX_SCRIPTS {
                    return Err(form(format!("{kind} has more than {MAX_SCRIPTS} grasps")));
                }
                all.push(script);
            }
        }
        Ok(scripts)
    }

    /// Returns true if there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Returns the grasps that are listed for an object's label and fit this one, in the order of the file.
    ///
    /// A script does not fit if the fingertips would come too near to the table or close above the object, or if the palm
    /// would touch it: the heights of a kind may differ.
    pub fn grasps(&self, item: &Item, options: &GraspOptions) -> Vec<Grasp> {
        let listed = self.0.get(&item.label).into_iter().flatten();
        listed
            .filter_map(|script| {
                let grasp = script.grasp(item, options);
                if grasp.is_none() {
                    let (script, item) = (&script.name, &item.label);
                    tracing::info!(script, item, "a grasping script does not fit this object");
                }
                grasp
            })
            .collect()
    }
}

impl GraspScript {
    fn grasp(&self, item: &Item, options: &GraspOptions) -> Option<Grasp> {
        let (yaw, top) = (item.yaw(), item.top());
        let [x, y, z] = self.position;
        let (sine, cosine) = yaw.sin_cos();
        let middle = item.pose.translation.vector;
        let place = Vector3::new(
            middle.x + x * cosine - y * sine,
            middle.y + x * sine + y * cosine,
            top + z,
        );
        let depth = deepest(self.open, self.contact + SQUEEZE) + TIP_RADIUS;
        let is_clear = place.z - depth >= options.surface + options.table_clearance;
        let touches = place.z - reach(f64::from(self.contact)).depth <= top;
        let palm_is_above = place.z - PALM_DEPTH >= top;
        let fits = is_clear && touches && palm_is_above;
        fits.then(|| Grasp {
            hand: hand_pose(place, yaw + self.turn),
            spread: self.spread,
            open: self.open,
            contact: self.contact,
            depth,
        })
    }
}

fn script(node: &Node<'_, '_>) -> Result<GraspScript, String> {
    let text = |name: &str| {
        let found = node.attribute(name);
        found.ok_or_else(|| format!("<grasp> has no attribute {name}"))
    };
    let numbers = |name: &str| -> Result<Vec<f64>, String> {
        let words = text(name)?.split_whitespace();
        let parsed: Result<Vec<f64>, _> = words.map(str::parse).collect();
        let parsed = parsed
            .ok()
            .filter(|all| all.iter().all(|one| one.is_finite()));
        parsed.ok_or_else(|| format!("{name}=\"{}\" are no numbers", text(name).unwrap_or("")))
    };
    let position = numbers("position")?;
    let position = <[f64; 3]>::try_from(position.as_slice())
        .ok()
        .filter(|place| Vector3::from(*place).norm() <= MAX_DISTANCE)
        .ok_or_else(|| {
            format!(
                "position: expected three numbers, at most {MAX_DISTANCE} m from the upper face"
            )
        })?;
    let [turn] = numbers("turn")?[..] else {
        return Err("turn: expected one number, degrees".to_owned());
    };
    let counts = |name: &str, most: i32| {
        let text = text(name)?;
        let found = text
            .parse()
            .ok()
            .filter(|counts| (0..=most).contains(counts));
        found.ok_or_else(|| format!("{name}=\"{text}\": expected 0 to {most} counts"))
    };
    let script = GraspScript {
        name: text("name")?.to_owned(),
        position,
        turn: turn.to_radians(),
        spread: counts("spread", SPREAD_STOP)?,
        open: counts("open", FINGER_STOP)?,
        contact: counts("contact", FINGER_STOP)?,
    };
    if script.open >= script.contact {
        return Err("the fingers close from open to contact: open must be less".to_owned());
    }
    Ok(script)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Rotation3, Translation3};
    use yarp_devices::kinematics::Pose;

    use super::*;
    use crate::grasp::grasps;
    use crate::item::{Class, ItemShape};

    const SIZE: [f64; 3] = [0.06, 0.09, 0.08];

    fn item(label: &str, yaw: f64, height: f64) -> Item {
        let size = [SIZE[0], SIZE[1], height];
        let place = Translation3::new(0.5, 0.1, -0.05 + height / 2.0);
        Item {
            id: 1,
            label: label.to_owned(),
            class: Class::Polygon,
            shape: ItemShape::Cuboid { size },
            pose: Pose::from_parts(place, Rotation3::from_euler_angles(0.0, 0.0, yaw)),
        }
    }

    /// The database of a kind with one script.
    fn database(attributes: &str) -> String {
        format!(
            "<objects><object name=\"tea\">\n<grasp name=\"g\" {attributes}/></object></objects>"
        )
    }

    fn parsed(attributes: &str) -> Result<GraspScripts, ScriptError> {
        GraspScripts::parse(&database(attributes), "test.xml")
    }

    #[test]
    fn a_script_with_the_numbers_of_a_grasp_is_that_grasp() {
        let options = GraspOptions::default();
        let straight = item("tea", 0.0, SIZE[2]);
        let known = grasps(&straight, &options)[0].clone();
        let away = known.hand.translation.vector - straight.pose.translation.vector;
        let attributes = format!(
            "position=\"{} {} {}\" turn=\"0\" spread=\"{}\" open=\"{}\" contact=\"{}\"",
            away.x,
            away.y,
            known.hand.translation.z - straight.top(),
            known.spread,
            known.open,
            known.contact
        );
        let scripts = parsed(&attributes).expect("it is complete");
        for yaw in [0.0, 0.7, -2.0] {
            let item = item("tea", yaw, SIZE[2]);
            let [found] = &scripts.grasps(&item, &options)[..] else {
                panic!("one script fits")
            };
            let expected = &grasps(&item, &options)[0];
            assert!((found.hand.to_homogeneous() - expected.hand.to_homogeneous()).norm() < 1e-9);
            assert_eq!(
                (found.open, found.contact),
                (expected.open, expected.contact)
            );
            assert!((found.depth - expected.depth).abs() < 1e-9);
        }
        assert!(
            scripts
                .grasps(&item("coffee", 0.0, SIZE[2]), &options)
                .is_empty()
        );
    }

    #[test]
    fn place_and_turn_are_relative_to_the_object() {
        let scripts = parsed(
            "position=\"0.01 0.02 0.1\" turn=\"90\" spread=\"100\" open=\"4000\" contact=\"8000\"",
        );
        // Turned by 90 degrees, its x axis is the world's y axis.
        let item = item("tea", std::f64::consts::FRAC_PI_2, 0.12);
        let found = &scripts
            .expect("it is complete")
            .grasps(&item, &GraspOptions::default())[0];
        let place = found.hand.translation.vector;
        assert!(
            (place - Vector3::new(0.48, 0.11, 0.17)).norm() < 1e-9,
            "{place}"
        );
        // F3 is at the hand's y: 180 degrees from the world's x axis.
        let finger = found.hand.rotation * Vector3::y();
        assert!((finger + Vector3::x()).norm() < 1e-9, "{finger}");
        let palm = found.hand.rotation * Vector3::z();
        assert!((palm + Vector3::z()).norm() < 1e-9, "{palm}");
        assert_eq!(found.spread, 100);
    }

    /// Each alone: the tips too near to the table, the palm on the object, the fingers closed above it.
    #[test]
    fn a_script_that_does_not_fit_this_object_is_left_out() {
        let check = |height: f64, z: f64, is_fitting: bool| {
            let attributes = format!(
                "position=\"0 0 {z}\" turn=\"0\" spread=\"0\" open=\"4000\" contact=\"8000\""
            );
            let scripts = parsed(&attributes).expect("it is complete");
            let found = scripts.grasps(&item("tea", 0.0, height), &GraspOptions::default());
            assert_eq!(found.len(), usize::from(is_fitting), "{height} {z}");
        };
        check(0.12, 0.10, true);
        check(0.05, 0.08, false);
        check(0.20, 0.10, true);
        check(0.20, 0.07, false);
        check(0.12, 0.20, false);
    }

    #[test]
    fn scripts_that_are_not_complete_are_refused_with_their_line() {
        let good = "position=\"0 0 0.1\" turn=\"0\" spread=\"0\" open=\"4000\" contact=\"8000\"";
        assert!(parsed(good).is_ok());
        for (from, to, expected) in [
            ("0 0 0.1", "0 0", "position: expected three numbers"),
            ("0 0 0.1", "0 0 0.4", "at most 0.3 m"),
            ("0 0 0.1", "0 0 inf", "are no numbers"),
            ("turn=\"0\"", "turn=\"0 1\"", "turn: expected one number"),
            ("turn=\"0\"", "", "no attribute turn"),
            ("spread=\"0\"", "spread=\"3151\"", "expected 0 to 3150"),
            ("open=\"4000\"", "open=\"-1\"", "expected 0 to 17500"),
            (
                "contact=\"8000\"",
                "contact=\"17501\"",
                "expected 0 to 17500",
            ),
            ("contact=\"8000\"", "contact=\"4000\"", "open must be less"),
        ] {
            let error = parsed(&good.replace(from, to)).unwrap_err().to_string();
            assert!(
                error.contains("test.xml, line 2") && error.contains(expected),
                "{error}"
            );
        }
        let error = GraspScripts::parse("<objects>", "x.xml").unwrap_err();
        assert!(matches!(error, ScriptError::Xml { .. }), "{error}");
        let many = format!("<grasp name=\"g\" {good}/>").repeat(MAX_SCRIPTS + 1);
        let many = format!("<objects><object name=\"tea\">{many}</object></objects>");
        let error = GraspScripts::parse(&many, "x.xml").unwrap_err().to_string();
        assert!(error.contains("more than 64 grasps"), "{error}");
        // The rest of a database is of no concern.
        let other = "<objects><print/><object name=\"a\" shape=\"circle\"/></objects>";
        assert!(
            GraspScripts::parse(other, "x.xml")
                .expect("it is XML")
                .is_empty()
        );
    }
}
