//! Messages for a view, as `docs/live-view.md` describes them.
//!
//! Senders are other programs: everything is bounded, and what does not fit the description is left out.

use serde_json::{Map, Value as Json, json};
use yarp_devices::kinematics::Joints;
use yarp_devices::wam::WamModel;
use yarp_wire::{Bottle, Value};

use crate::log_lines::LogLevel;

/// Maximum number of objects, of detections and of baskets that are shown.
const MAX_OBJECTS: usize = 200;
/// Maximum number of corners of an outline.
const MAX_CORNERS: usize = 64;
/// Maximum number of postures of a plan.
const MAX_POSTURES: usize = 500;
/// Maximum number of characters of a text.
const MAX_TEXT: usize = 300;

/// A message that a view understands.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum ViewMessage {
    /// Objects in the image of the camera.
    Detections(Json),
    /// Present step of a program, and its path.
    Plan(Json),
    /// Table and objects.
    Scene(Json),
    /// A line for the log: level, source and text.
    Log(LogLevel, String, String),
}

impl ViewMessage {
    /// Returns the message in a bottle; `None` if its first word is unknown.
    pub(crate) fn from_bottle(bottle: &Bottle) -> Option<Self> {
        match bottle.get(0)?.as_str()? {
            "detections" => Some(Self::Detections(detections(bottle))),
            "plan" => Some(Self::Plan(plan(bottle))),
            "scene" => Some(Self::Scene(scene(bottle))),
            "log" => {
                let word = |index| bottle.get(index).map(text).unwrap_or_default();
                Some(Self::Log(LogLevel::from_word(&word(1)), word(2), word(3)))
            }
            _ => None,
        }
    }
}

fn text(value: &Value) -> String {
    value.to_plain_string().chars().take(MAX_TEXT).collect()
}

/// Returns the finite numbers of a list, at most `most`.
fn numbers(list: &Bottle, most: usize) -> Vec<f64> {
    let finite = list
        .iter()
        .filter_map(Value::as_f64)
        .filter(|number| number.is_finite());
    finite.take(most).collect()
}

/// Returns the groups with this first word.
fn groups<'a>(bottle: &'a Bottle, key: &'a str) -> impl Iterator<Item = &'a Bottle> {
    let lists = bottle.iter().filter_map(Value::as_list);
    lists.filter(move |list| list.get(0).and_then(Value::as_str) == Some(key))
}

/// Returns the numbers of the first group with this key, if there are exactly `count`.
fn group_numbers(bottle: &Bottle, key: &str, count: usize) -> Option<Vec<f64>> {
    let found = numbers(groups(bottle, key).next()?, count + 1);
    (found.len() == count).then_some(found)
}

fn identity(object: &Bottle) -> (Json, String) {
    let id = object.get(1).and_then(Value::as_i64);
    (json!(id), object.get(2).map(text).unwrap_or_default())
}

fn detections(bottle: &Bottle) -> Json {
    let objects = groups(bottle, "object").take(MAX_OBJECTS).map(|object| {
        let (id, class) = identity(object);
        let outline = groups(object, "polygon").next();
        let corners = outline.into_iter().flat_map(|outline| {
            let corners = outline.iter().filter_map(Value::as_list);
            corners
                .map(|corner| numbers(corner, 2))
                .filter(|corner| corner.len() == 2)
        });
        json!({
            "id": id,
            "class": class,
            "confidence": object.get(3).and_then(Value::as_f64).filter(|value| value.is_finite()),
            "polygon": corners.take(MAX_CORNERS).collect::<Vec<_>>(),
            "pose": group_numbers(object, "pose", 4),
        })
    });
    json!({
        "image": group_numbers(bottle, "image", 2),
        "objects": objects.collect::<Vec<_>>(),
    })
}

fn plan(bottle: &Bottle) -> Json {
    let word = |key: &str| bottle.find(key).map(text);
    let postures = groups(bottle, "joints")
        .next()
        .into_iter()
        .flat_map(|joints| {
            let postures = joints.iter().filter_map(Value::as_list);
            postures
                .map(|posture| numbers(posture, 8))
                .filter(|posture| posture.len() == 7)
        });
    let postures: Vec<_> = postures.take(MAX_POSTURES).collect();
    json!({
        "phase": word("phase"),
        "text": word("text"),
        "target": bottle.find("target").and_then(Value::as_i64),
        "progress": group_numbers(bottle, "progress", 2),
        "path": tool_path(&postures),
    })
}

/// Returns the places of the tool plate for postures in degrees, m.
pub(crate) fn tool_path(postures: &[Vec<f64>]) -> Vec<[f64; 3]> {
    let chain = WamModel::<7>::new().chain;
    let place = |posture: &Vec<f64>| {
        let joints = Joints::<7>::from_iterator(posture.iter().map(|angle| angle.to_radians()));
        let [x, y, z]: [f64; 3] = chain.forward(&joints).translation.vector.into();
        // A tenth of a millimetre is enough for a drawing.
        [x, y, z].map(|value| (value * 1e4).round() / 1e4)
    };
    postures.iter().map(place).collect()
}

fn scene(bottle: &Bottle) -> Json {
    let baskets = groups(bottle, "basket")
        .take(MAX_OBJECTS)
        .map(|basket| numbers(basket, 6));
    let objects = groups(bottle, "object")
        .take(MAX_OBJECTS)
        .filter_map(|object| {
            let (id, class) = identity(object);
            let mut told = Map::new();
            told.insert("id".to_owned(), id);
            told.insert("class".to_owned(), json!(class));
            told.insert("shape".to_owned(), json!(object.get(3).map(text)?));
            told.insert(
                "size".to_owned(),
                json!(numbers(object.get(4)?.as_list()?, 3)),
            );
            told.insert("pose".to_owned(), json!(group_numbers(object, "pose", 7)?));
            told.insert(
                "colour".to_owned(),
                json!(group_numbers(object, "colour", 4)),
            );
            Some(Json::Object(told))
        });
    json!({
        "table": group_numbers(bottle, "table", 5),
        "baskets": baskets.filter(|basket| basket.len() == 6).collect::<Vec<_>>(),
        "objects": objects.collect::<Vec<_>>(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Option<ViewMessage> {
        ViewMessage::from_bottle(&Bottle::parse(text).unwrap())
    }

    #[test]
    fn the_documented_examples_are_read() {
        let Some(ViewMessage::Detections(found)) = read(
            "detections (image 1288 964) (object 3 glass 0.97 (polygon (612.0 380.5) (640.2 381.0) (1)) (pose 0.52 -0.08 -0.05 0.0))",
        ) else {
            panic!("no detections");
        };
        assert_eq!(found["image"], json!([1288.0, 964.0]));
        assert_eq!(
            found["objects"][0]["polygon"],
            json!([[612.0, 380.5], [640.2, 381.0]])
        );
        assert_eq!(found["objects"][0]["pose"][1], -0.08);
        let Some(ViewMessage::Plan(found)) = read(
            "plan (phase grasp) (text \"glass 3\") (target 3) (progress 4 12) (joints (0 0 0 0 0 0 0) (0 0 0 90 0 0 0) (1 2))",
        ) else {
            panic!("no plan");
        };
        assert_eq!(found["phase"], "grasp");
        let path = found["path"].as_array().unwrap();
        assert_eq!(path.len(), 2, "a posture of two joints is left out");
        // The upright arm: 0.55 + 0.3 + 0.0609 m.
        assert_eq!(path[0], json!([0.0, 0.0, 0.9109]));
        let log = read("log warning tidy \"the grasp slipped\"");
        let expected =
            ViewMessage::Log(LogLevel::Warning, "tidy".into(), "the grasp slipped".into());
        assert_eq!(log, Some(expected));
        let Some(ViewMessage::Scene(found)) = read(
            "scene (table -0.05 0.2 0.9 -0.4 0.4) (basket 1 2 3 4 5 6) (object 3 glass cylinder (0.03 0.1) (pose 0 0 0 1 0 0 0) (colour 1 0 0 1))",
        ) else {
            panic!("no scene");
        };
        assert_eq!(found["objects"][0]["size"], json!([0.03, 0.1]));
        assert_eq!(found["baskets"].as_array().unwrap().len(), 1);
        assert_eq!(read("greetings"), None);
        assert_eq!(read("(detections)"), None);
    }

    #[test]
    fn hostile_messages_are_bounded() {
        let many = "(object 1 x 0.5 (polygon) (pose 0 0 0 0)) ".repeat(MAX_OBJECTS + 7);
        let Some(ViewMessage::Detections(found)) = read(&format!("detections {many}")) else {
            panic!("no detections");
        };
        assert_eq!(found["objects"].as_array().unwrap().len(), MAX_OBJECTS);
        let corners = "(1 2) ".repeat(MAX_CORNERS + 7);
        let Some(ViewMessage::Detections(found)) =
            read(&format!("detections (object 1 x 1 (polygon {corners}))"))
        else {
            panic!("no detections");
        };
        assert_eq!(
            found["objects"][0]["polygon"].as_array().unwrap().len(),
            MAX_CORNERS
        );
        let postures = "(0 0 0 0 0 0 0) ".repeat(MAX_POSTURES + 7);
        let Some(ViewMessage::Plan(found)) = read(&format!("plan (joints {postures})")) else {
            panic!("no plan");
        };
        assert_eq!(found["path"].as_array().unwrap().len(), MAX_POSTURES);
        let Some(ViewMessage::Plan(found)) =
            read(&format!("plan (text \"{}\")", "é".repeat(MAX_TEXT + 7)))
        else {
            panic!("no plan");
        };
        assert_eq!(found["text"].as_str().unwrap().chars().count(), MAX_TEXT);
    }
}
