//! Finds what stock reads without a word in a description and a lab wants to know: syntax that only TinyXML accepts, words
//! that nothing reads, and entries that hide others.

use std::collections::HashMap;
use std::sync::Arc;

use yarp_wire::settings::Origin;

use super::action_targets::AttachTargets;
use super::device_parameters::is_balanced;
use super::xml_description::Element;
use super::{Action, ActionKind, DeviceEntry, Param, ParamValue, Phase, Problem, Robot};
use crate::tolerant_xml::{XmlDocument, XmlElement};

/// Maximum number of lints of a robot; later ones are not listed.
const MAX_LINTS: usize = 1000;
/// Attributes that are read, for each element.
const ATTRIBUTES: [(&str, &[&str]); 11] = [
    (
        "robot",
        &[
            "name",
            "build",
            "portprefix",
            "reverse-shutdown-action-order",
        ],
    ),
    ("devices", &["file", "robot", "build"]),
    ("params", &["file", "robot", "build"]),
    ("actions", &["file", "robot", "build"]),
    ("device", &["name", "type"]),
    ("subdevice", &["name", "type"]),
    ("param", &["name", "extern-name"]),
    ("group", &["name"]),
    ("paramlist", &["name"]),
    ("elem", &["name"]),
    ("action", &["phase", "level", "type"]),
];
/// Elements whose text is their value.
const WITH_TEXT: [&str; 2] = ["param", "elem"];

/// Lints of a robot, in the order in which they are found.
#[derive(Debug, Default)]
pub(super) struct Lints {
    found: Vec<Problem>,
}

impl Lints {
    pub(super) fn into_problems(self) -> Vec<Problem> {
        self.found
    }

    fn add(&mut self, origin: &Origin, what: impl Into<String>) {
        if self.found.len() < MAX_LINTS {
            let (origin, what) = (origin.clone(), what.into());
            self.found.push(Problem { origin, what });
        }
    }

    /// Adds those of the syntax of a file.
    pub(super) fn of_document(&mut self, document: &XmlDocument, file: &Arc<str>) {
        for (line, what) in &document.lints {
            self.add(&Origin::line(file.clone(), *line), what.clone());
        }
        let mut prefixes = Prefixes {
            declared: vec!["xml", "xmlns"],
            reported: Vec::new(),
            file,
            lints: self,
        };
        prefixes.check(&document.root);
    }

    /// Adds those of a tree of elements.
    pub(super) fn of_element(&mut self, element: &Element, old: bool) {
        let name = element.name.as_str();
        if let Some((_, known)) = ATTRIBUTES.iter().find(|(known, _)| *known == name) {
            for (attribute, _) in &element.attributes {
                let is_namespace = attribute == "xmlns" || attribute.contains(':');
                // Formats before 3 have no names for the command line.
                let is_read =
                    known.contains(&attribute.as_str()) && !(old && attribute == "extern-name");
                if !is_namespace && !is_read {
                    let what = format!(
                        "attribute {attribute} of <{name}> is not read, expected {}",
                        known.join(", ")
                    );
                    self.add(&element.origin, what);
                }
            }
        }
        if element.text.is_some() && !WITH_TEXT.contains(&name) {
            self.add(&element.origin, format!("the text in <{name}> is not read"));
        }
        match name {
            "robot" => self.of_robot_element(element),
            "param" | "elem" => self.of_value(element),
            "action" => {
                let phase = element.attribute("phase").unwrap_or_default();
                if Phase::of(phase).is_none() {
                    let what = format!("there is no phase {phase}: the action never runs");
                    self.add(&element.origin, what);
                }
            }
            _ => {}
        }
        for child in &element.children {
            self.of_element(child, old);
        }
    }

    fn of_robot_element(&mut self, element: &Element) {
        if element.attribute("portprefix").is_none() {
            let what = "no attribute portprefix in <robot>: its name is used";
            self.add(&element.origin, what);
        }
        if let Some(build) = element
            .attribute("build")
            .filter(|text| text.trim().parse::<u32>().is_err())
        {
            let what = format!("expected a whole number from 0 as build, got {build}: 0 is used");
            self.add(&element.origin, what);
        }
    }

    fn of_value(&mut self, element: &Element) {
        let name = element.attribute("name").unwrap_or_default();
        if element
            .text
            .as_deref()
            .is_some_and(|text| !is_balanced(text))
        {
            let what = format!("brackets or quotes of parameter {name} do not close: it is lost");
            self.add(&element.origin, what);
        }
        if !element.children.is_empty() {
            let what = format!(
                "elements in <{} name=\"{name}\"> are not read",
                element.name
            );
            self.add(&element.origin, what);
        }
    }

    /// Adds names that are given twice, and devices that attach to themselves.
    pub(super) fn of_robot(&mut self, robot: &Robot) {
        self.of_params("the robot", &robot.params);
        let mut known: HashMap<&str, &Origin> = HashMap::new();
        for device in &robot.devices {
            let DeviceEntry { name, origin, .. } = device;
            match known.get(name.as_str()) {
                None => drop(known.insert(name, origin)),
                Some(first) => {
                    let what = format!(
                        "device {name} is defined already, at {first}: actions find the first"
                    );
                    self.add(origin, what);
                }
            }
            self.of_params(&format!("device {name}"), &device.params);
            for action in &device.actions {
                self.of_params(&format!("an action of device {name}"), &action.params);
                if attaches_to(action, name) {
                    let what = format!("device {name} attaches to itself");
                    self.add(&action.origin, what);
                }
            }
        }
    }

    /// Adds parameters that are given twice on one level; groups of one name are merged.
    fn of_params(&mut self, owner: &str, params: &[Param]) {
        let mut known: HashMap<&str, &Param> = HashMap::new();
        for param in params {
            if let ParamValue::Group(inner) = &param.value {
                self.of_params(&format!("group {} of {owner}", param.name), inner);
            }
            let Some(first) = known.get(param.name.as_str()) else {
                known.insert(&param.name, param);
                continue;
            };
            let groups =
                [&first.value, &param.value].map(|value| matches!(value, ParamValue::Group(_)));
            // The shared parameters of a list of devices are copied to each.
            if groups != [true, true] && first.origin != param.origin {
                let what = format!(
                    "parameter {} of {owner} is given already, at {}",
                    param.name, first.origin
                );
                self.add(&param.origin, what);
            }
        }
    }
}

fn attaches_to(action: &Action, device: &str) -> bool {
    action.kind == ActionKind::Attach
        && matches!(AttachTargets::of(&action.params), Ok(AttachTargets::Named(named)) if named.iter().any(|(name, _)| name == device))
}

/// Reports prefixes of names that no enclosing element of the file declares, each once for a file.
struct Prefixes<'d, 'l> {
    declared: Vec<&'d str>,
    reported: Vec<&'d str>,
    file: &'d Arc<str>,
    lints: &'l mut Lints,
}

impl<'d> Prefixes<'d, '_> {
    /// Checks an element and those inside; their depth is bounded by the parser.
    fn check(&mut self, element: &'d XmlElement) {
        let outside = self.declared.len();
        let attributes = element.attributes.iter().map(|(name, _)| name.as_str());
        self.declared.extend(
            attributes
                .clone()
                .filter_map(|name| name.strip_prefix("xmlns:")),
        );
        for name in std::iter::once(element.name.as_str()).chain(attributes) {
            let Some((prefix, _)) = name.split_once(':') else {
                continue;
            };
            if !self.declared.contains(&prefix) && !self.reported.contains(&prefix) {
                self.reported.push(prefix);
                let what = format!(
                    "prefix {prefix} of {name} is not declared, expected xmlns:{prefix}=\"...\""
                );
                self.lints
                    .add(&Origin::line(self.file.clone(), element.line), what);
            }
        }
        element.children.iter().for_each(|child| self.check(child));
        self.declared.truncate(outside);
    }
}
