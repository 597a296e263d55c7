//! Reads descriptions of robots in XML.
//!
//! ```xml
//! <robot name="wam" build="0" portprefix="wam" xmlns:xi="http://www.w3.org/2001/XInclude">
//!   <devices>
//!     <device name="arm" type="simulatedWam"/>
//!     <device name="arm_nws" type="controlBoard_nws_yarp">
//!       <param name="name" extern-name="arm_port">/wam</param>
//!       <action phase="startup" level="5" type="attach"><param name="device">arm</param></action>
//!       <action phase="shutdown" level="5" type="detach"/>
//!     </device>
//!     <xi:include href="more.xml" enabled_by="cams"/>
//!   </devices>
//! </robot>
//! ```
//!
//! Format 3 includes files with `xi:include`, format 1 (only with `allow-deprecated-dtd`) with `file="more.xml"` in
//! `devices`, `params` and `actions`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use roxmltree::{Document, Node, ParsingOptions};
use yarp_wire::Value;
use yarp_wire::settings::{Origin, Settings};

use super::description_files::Files;
use super::{
    Action, ActionKind, DeviceEntry, Param, ParamValue, Phase, ReadOptions, Robot, RobotError,
    include_tags,
};

/// Maximum number of elements of a file.
const MAX_ELEMENTS: u32 = 1_000_000;
/// Maximum depth of nested elements.
const MAX_ELEMENT_DEPTH: usize = 100;

pub(super) fn read(file: &Path, options: &ReadOptions) -> Result<Robot, RobotError> {
    let mut reader = Reader {
        given: &options.given,
        old: false,
        files: Files::default(),
    };
    let root = reader.load(file, None, 0)?;
    reader.robot(&root)
}

/// An element with everything it includes.
#[derive(Debug)]
struct Element {
    name: String,
    attributes: Vec<(String, String)>,
    text: Option<String>,
    children: Vec<Element>,
    origin: Origin,
}

impl Element {
    fn attribute(&self, name: &str) -> Option<&str> {
        let found = self.attributes.iter().find(|(known, _)| known == name);
        found.map(|(_, value)| value.as_str())
    }

    fn need(&self, attribute: &str) -> Result<&str, RobotError> {
        self.attribute(attribute).ok_or_else(|| {
            let expected = format!("attribute {attribute} in <{}>", self.name);
            RobotError::expected(&self.origin, expected, "none")
        })
    }

    fn whole_number(&self, attribute: &str) -> Result<u32, RobotError> {
        let text = self.need(attribute)?;
        text.trim().parse().map_err(|_| {
            let expected = format!("a whole number from 0 as {attribute} of <{}>", self.name);
            RobotError::expected(&self.origin, expected, text)
        })
    }

    fn value(&self) -> Result<&str, RobotError> {
        self.text.as_deref().ok_or_else(|| {
            let name = self.attribute("name").unwrap_or_default();
            let expected = format!("a value in <{} name=\"{name}\">", self.name);
            RobotError::expected(&self.origin, expected, "nothing")
        })
    }

    fn unexpected(&self, expected: &str) -> RobotError {
        RobotError::expected(&self.origin, expected, format!("<{}>", self.name))
    }
}

struct Reader<'a> {
    given: &'a Settings,
    /// True for format 1.
    old: bool,
    files: Files,
}

impl Reader<'_> {
    fn load(
        &mut self,
        file: &Path,
        by: Option<&Origin>,
        depth: usize,
    ) -> Result<Element, RobotError> {
        let text = self.files.read(file, by, depth)?;
        let name: Arc<str> = file.display().to_string().into();
        if by.is_none() {
            self.old = self.is_old(&text, &name)?;
        }
        let options = ParsingOptions {
            allow_dtd: true,
            nodes_limit: MAX_ELEMENTS,
            ..ParsingOptions::default()
        };
        let document = Document::parse_with_options(&text, options).map_err(|error| {
            let what = error.to_string();
            // The message ends with the position, which the error contains already.
            let what = what
                .rsplit_once(" at ")
                .map_or(what.as_str(), |(what, _)| what);
            RobotError::Syntax {
                origin: Origin::line(name.clone(), error.pos().row as usize),
                what: what.to_owned(),
            }
        })?;
        let folder = file.parent().unwrap_or(Path::new(""));
        self.element(document.root_element(), &name, folder, depth, 0)
    }

    /// Returns true if the document type names format 1; without one the format is 3.
    fn is_old(&self, text: &str, file: &Arc<str>) -> Result<bool, RobotError> {
        const BEFORE: &str = "http://www.yarp.it/DTD/yarprobotinterfaceV";
        let Some(at) = text.find(BEFORE) else {
            return Ok(false);
        };
        let line = text[..at].matches('\n').count() + 1;
        let version = text[at + BEFORE.len()..]
            .split('.')
            .next()
            .unwrap_or_default();
        let allowed = self.given.has("allow-deprecated-dtd");
        match version {
            "3" => Ok(false),
            "1" if allowed => Ok(true),
            other => Err(RobotError::expected(
                &Origin::line(file.clone(), line),
                "format 3 (or 1, with --allow-deprecated-dtd)",
                format!("format {other}"),
            )),
        }
    }

    fn element(
        &mut self,
        node: Node<'_, '_>,
        file: &Arc<str>,
        folder: &Path,
        depth: usize,
        nested: usize,
    ) -> Result<Element, RobotError> {
        let position = node.document().text_pos_at(node.range().start);
        let origin = Origin::line(file.clone(), position.row as usize);
        if nested > MAX_ELEMENT_DEPTH {
            return Err(RobotError::TooDeep {
                origin,
                limit: MAX_ELEMENT_DEPTH,
            });
        }
        let attributes = node.attributes();
        let attributes = attributes.map(|held| (held.name().to_owned(), held.value().to_owned()));
        let mut element = Element {
            name: node.tag_name().name().to_owned(),
            attributes: attributes.collect(),
            text: node
                .text()
                .map(str::trim)
                .filter(|text| !text.is_empty())
                .map(str::to_owned),
            children: Vec::new(),
            origin,
        };
        for child in node.children().filter(Node::is_element) {
            let child = self.element(child, file, folder, depth, nested + 1)?;
            if child.name != "include" {
                element.children.push(child);
                continue;
            }
            let by = |name| include_tags::words(child.attribute(name).unwrap_or_default());
            if include_tags::enabled(&by("enabled_by"), &by("disabled_by"), self.given) {
                let included = folder.join(child.need("href")?.replace('\\', "/"));
                let included = self.load(&included, Some(&child.origin), depth + 1)?;
                element.children.push(included);
            }
        }
        let lists = matches!(element.name.as_str(), "devices" | "params" | "actions");
        if let Some(included) = element.attribute("file").filter(|_| lists) {
            if !self.old {
                let found = format!("file=\"{included}\"");
                return Err(RobotError::expected(
                    &element.origin,
                    "<xi:include href=..>",
                    found,
                ));
            }
            let included: PathBuf = folder.join(included);
            return self.load(&included, Some(&element.origin), depth + 1);
        }
        Ok(element)
    }

    fn robot(&self, element: &Element) -> Result<Robot, RobotError> {
        if element.name != "robot" {
            return Err(element.unexpected("<robot>"));
        }
        let name = element.need("name")?.to_owned();
        let build = match element.attribute("build") {
            Some(_) => element.whole_number("build")?,
            None => 0,
        };
        let prefix = element.attribute("portprefix").unwrap_or_else(|| {
            let at = &element.origin;
            tracing::warn!("{at}: no attribute portprefix in <robot>, its name is used");
            &name
        });
        let reversed = match element.attribute("reverse-shutdown-action-order") {
            None => false,
            Some("true" | "1" | "yes") => true,
            Some("false" | "0" | "no") => false,
            Some(other) => {
                let expected = "true or false as reverse-shutdown-action-order";
                return Err(RobotError::expected(&element.origin, expected, other));
            }
        };
        let mut robot = Robot {
            port_prefix: prefix.to_owned(),
            name,
            build,
            reversed,
            params: Vec::new(),
            devices: Vec::new(),
        };
        for child in &element.children {
            match child.name.as_str() {
                "device" | "devices" => self.devices(child, &mut robot.devices)?,
                _ => self.params(child, &mut robot.params)?,
            }
        }
        Ok(robot)
    }

    fn devices(&self, element: &Element, into: &mut Vec<DeviceEntry>) -> Result<(), RobotError> {
        match element.name.as_str() {
            "devices" => element
                .children
                .iter()
                .try_for_each(|child| self.devices(child, into)),
            "device" => {
                let mut device = DeviceEntry {
                    name: element.need("name")?.to_owned(),
                    kind: element.need("type")?.to_owned(),
                    params: Vec::new(),
                    actions: Vec::new(),
                    origin: element.origin.clone(),
                };
                for child in &element.children {
                    match child.name.as_str() {
                        "action" | "actions" => self.actions(child, &mut device.actions)?,
                        _ => self.params(child, &mut device.params)?,
                    }
                }
                into.push(device);
                Ok(())
            }
            _ => Err(element.unexpected("<device> or <devices>")),
        }
    }

    fn params(&self, element: &Element, into: &mut Vec<Param>) -> Result<(), RobotError> {
        let origin = element.origin.clone();
        match element.name.as_str() {
            "params" => element
                .children
                .iter()
                .try_for_each(|child| self.params(child, into))?,
            "param" => {
                let name = element.need("name")?.to_owned();
                let outside = element.attribute("extern-name").filter(|_| !self.old);
                let given = outside.and_then(|name| self.given.get(name));
                into.push(match given {
                    Some(given) => Param::given(name, given),
                    None => Param::from_text(name, element.value()?, origin)?,
                });
            }
            "group" => {
                let name = element.need("name")?.to_owned();
                let mut inner = Vec::new();
                element
                    .children
                    .iter()
                    .try_for_each(|child| self.params(child, &mut inner))?;
                if inner.is_empty() {
                    let expected = format!("parameters in <group name=\"{name}\">");
                    return Err(RobotError::expected(&origin, expected, "none"));
                }
                let value = ParamValue::Group(inner);
                into.push(Param {
                    name,
                    value,
                    origin,
                });
            }
            "paramlist" => self.paramlist(element, into)?,
            "subdevice" => {
                let kind = element.need("type")?.to_owned();
                into.push(Param {
                    name: "subdevice".to_owned(),
                    value: ParamValue::Values(vec![kind.into()]),
                    origin,
                });
                element
                    .children
                    .iter()
                    .try_for_each(|child| self.params(child, into))?;
            }
            _ => {
                return Err(
                    element.unexpected("<param>, <group>, <paramlist>, <subdevice> or <params>")
                );
            }
        }
        Ok(())
    }

    /// Reads a list of names, and an element for each name.
    fn paramlist(&self, element: &Element, into: &mut Vec<Param>) -> Result<(), RobotError> {
        let name = element.need("name")?.to_owned();
        let mut names: Vec<Value> = Vec::new();
        let mut elements = Vec::new();
        for child in &element.children {
            if child.name != "elem" {
                return Err(child.unexpected("<elem>"));
            }
            let name = child.need("name")?;
            names.push(name.into());
            elements.push(Param::from_text(
                name.to_owned(),
                child.value()?,
                child.origin.clone(),
            )?);
        }
        into.push(Param {
            name,
            value: ParamValue::Values(vec![Value::List(names.into_iter().collect())]),
            origin: element.origin.clone(),
        });
        into.extend(elements);
        Ok(())
    }

    fn actions(&self, element: &Element, into: &mut Vec<Action>) -> Result<(), RobotError> {
        match element.name.as_str() {
            "actions" => element
                .children
                .iter()
                .try_for_each(|child| self.actions(child, into)),
            "action" => {
                let mut params = Vec::new();
                element
                    .children
                    .iter()
                    .try_for_each(|child| self.params(child, &mut params))?;
                into.push(Action {
                    phase: word(element, "phase", Phase::WORDS, Phase::of)?,
                    kind: word(element, "type", ActionKind::WORDS, ActionKind::of)?,
                    level: element.whole_number("level")?,
                    params,
                    origin: element.origin.clone(),
                });
                Ok(())
            }
            _ => Err(element.unexpected("<action> or <actions>")),
        }
    }
}

/// Parses an attribute that is one of several words.
fn word<T>(
    element: &Element,
    attribute: &str,
    words: &[(&str, T)],
    of: impl Fn(&str) -> Option<T>,
) -> Result<T, RobotError> {
    let found = element.need(attribute)?;
    of(found).ok_or_else(|| {
        let words: Vec<_> = words.iter().map(|(word, _)| *word).collect();
        let expected = format!(
            "{attribute} of <{}> to be one of {}",
            element.name,
            words.join(", ")
        );
        RobotError::expected(&element.origin, expected, found)
    })
}
