//! The truth as XML.

use std::fmt::Write;

use super::{GroundTruth, ObjectTruth, rotation_rows};
use crate::object::{Object, Shape};
use crate::{Camera, Pose};

impl GroundTruth {
    /// Returns the truth as XML; [`from_xml`](Self::from_xml) reads it back to the last digit.
    ///
    /// `docs/table-simulation.md` describes the elements.
    pub fn to_xml(&self) -> String {
        let mut xml = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<table");
        if let Some(seed) = self.seed {
            let _ = write!(xml, " seed=\"{seed}\"");
        }
        let _ = writeln!(xml, " surface=\"{}\">", self.surface);
        camera(&mut xml, &self.camera);
        if let Some(joints) = &self.joints {
            let _ = write!(xml, "  <robot joints=\"{}\"", numbers(joints));
            if let Some(hand) = &self.hand {
                let _ = write!(xml, " hand=\"{}\"", numbers(hand));
            }
            xml.push_str("/>\n");
        }
        for object in &self.objects {
            object_truth(&mut xml, object);
        }
        xml.push_str("</table>\n");
        xml
    }
}

fn numbers<T: ToString>(values: &[T]) -> String {
    let words: Vec<String> = values.iter().map(T::to_string).collect();
    words.join(" ")
}

fn pose(xml: &mut String, indent: &str, pose: &Pose) {
    let _ = writeln!(
        xml,
        "{indent}<pose position=\"{}\" rotation=\"{}\"/>",
        numbers(pose.translation.vector.as_slice()),
        numbers(&rotation_rows(pose)),
    );
}

fn camera(xml: &mut String, camera: &Camera) {
    let lens = &camera.lens;
    let _ = writeln!(
        xml,
        "  <camera width=\"{}\" height=\"{}\" focal=\"{}\" centre=\"{}\" distortion=\"{}\">",
        lens.width,
        lens.height,
        numbers(&lens.focal),
        numbers(&lens.centre),
        numbers(&lens.distortion),
    );
    pose(xml, "    ", &camera.pose);
    xml.push_str("  </camera>\n");
}

fn object_truth(xml: &mut String, truth: &ObjectTruth) {
    open_object(xml, &truth.object);
    let _ = write!(
        xml,
        "    <seen visible=\"{}\" truncated=\"{}\" pixels=\"{}\"",
        truth.visible,
        truth.truncated,
        truth.mask.area()
    );
    if let Some(top) = &truth.top {
        let _ = write!(xml, " top=\"{}\"", numbers(top));
    }
    let runs: Vec<u32> = truth
        .mask
        .runs()
        .iter()
        .flat_map(|(a, b)| [*a, *b])
        .collect();
    let _ = writeln!(xml, ">{}</seen>\n  </object>", numbers(&runs));
}

/// Everything of an object but the end of its element.
fn open_object(xml: &mut String, object: &Object) {
    let _ = write!(
        xml,
        "  <object id=\"{}\" class=\"{}\" mass=\"{}\" friction=\"{}\"",
        object.id,
        object.class(),
        object.mass,
        object.friction
    );
    let _ = match object.shape {
        Shape::Glass {
            radius,
            height,
            wall,
        } => write!(
            xml,
            " radius=\"{radius}\" height=\"{height}\" wall=\"{wall}\""
        ),
        Shape::Plate { radius, height } => write!(xml, " radius=\"{radius}\" height=\"{height}\""),
        Shape::Box { size } | Shape::Clutter { size } => {
            write!(xml, " size=\"{}\"", numbers(&size))
        }
        Shape::Prism { side, height } => write!(xml, " side=\"{side}\" height=\"{height}\""),
        Shape::Brick { kind } => write!(
            xml,
            " brick=\"{}\" size=\"{}\"",
            kind.name(),
            numbers(&kind.size())
        ),
        Shape::Board {
            columns,
            rows,
            square,
        } => write!(
            xml,
            " columns=\"{columns}\" rows=\"{rows}\" square=\"{square}\""
        ),
    };
    let finish = &object.finish;
    let _ = writeln!(
        xml,
        ">\n    <finish colour=\"{}\" accent=\"{}\" gloss=\"{}\" opacity=\"{}\" seed=\"{}\"/>",
        numbers(&finish.colour),
        numbers(&finish.accent),
        finish.gloss,
        finish.opacity,
        finish.seed
    );
    pose(xml, "    ", &object.pose);
}
