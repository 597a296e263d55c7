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
//! `devices`, `params` and `actions`. The syntax is what TinyXML accepts; see `tolerant_xml`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use yarp_wire::Value;
use yarp_wire::settings::{Origin, Settings};

use super::description_files::Files;
use super::{
    Action, ActionKind, DeviceEntry, Param, ParamValue, Phase, ReadOptions, Robot, RobotError,
    include_tags, lints::Lints,
};
use crate::tolerant_xml::{self, XmlDocument, XmlElement};

/// Maximum number of elements of all files of a robot.
const MAX_ELEMENTS: usize = 1_000_000;
/// Namespace of the document types that stock knows.
const DOCUMENT_TYPE: &str = "http://www.yarp.it/DTD/yarprobotinterfaceV";

pub(super) fn read(
    file: &Path,
    options: &ReadOptions,
    lints: &mut Lints,
) -> Result<Robot, RobotError> {
    let mut reader = Reader {
        given: &options.given,
        old: false,
        files: Files::default(),
        budget: MAX_ELEMENTS,
        lints,
    };
    let root = reader.load(file, None, 0)?;
    reader.lints.of_element(&root, reader.old);
    reader.robot(&root)
}

/// An element with everything it includes.
#[derive(Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) attributes: Vec<(String, String)>,
    pub(super) text: Option<String>,
    pub(super) children: Vec<Element>,
    pub(super) origin: Origin,
}

impl Element {
    pub(super) fn attribute(&self, name: &str) -> Option<&str> {
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
    /// Number of elements that may still be read.
    budget: usize,
    lints: &'a mut Lints,
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
        let document = tolerant_xml::parse(&text, &mut self.budget);
        let document = document.map_err(|error| {
            let included = by.map_or(String::new(), |by| format!(" (included by {by})"));
            RobotError::Syntax {
                origin: Origin::line(name.clone(), error.line),
                what: error.what + &included,
            }
        })?;
        self.lints.of_document(&document, &name);
        if by.is_none() {
            self.old = self.is_old(&document, &name)?;
        }
        let folder = file.parent().unwrap_or(Path::new(""));
        self.element(document.root, &name, folder, depth)
    }

    /// Returns true if the document type names format 1. Without one the format is 1 too if that is
    /// allowed, as in stock, else 3.
    fn is_old(&self, document: &XmlDocument, file: &Arc<str>) -> Result<bool, RobotError> {
        let allowed = self.given.has("allow-deprecated-dtd");
        let mut tags = document.unknown.iter();
        let found = tags.find_map(|(line, tag)| {
            let (_, version) = tag.split_once(DOCUMENT_TYPE)?;
            Some((*line, version.split('.').next().unwrap_or_default()))
        });
        match found {
            None => Ok(allowed),
            Some((_, "3")) => Ok(false),
            Some((_, "1")) if allowed => Ok(true),
            Some((line, other)) => Err(RobotError::expected(
                &Origin::line(file.clone(), line),
                "format 3 (or 1, with --allow-deprecated-dtd)",
                format!("format {other}"),
            )),
        }
    }

    /// Returns an element with everything it includes.
    fn element(
        &mut self,
        read: XmlElement,
        file: &Arc<str>,
        folder: &Path,
        depth: usize,
    ) -> Result<Element, RobotError> {
        let mut element = Element {
            name: read.name,
            attributes: read.attributes,
            text: read.text.filter(|text| !text.trim().is_empty()),
            children: Vec::new(),
            origin: Origin::line(file.clone(), read.line),
        };
        for child in read.children {
            let child = self.element(child, file, folder, depth)?;
            if child.name != "include" && !child.name.ends_with(":include") {
                element.children.push(child);
                continue;
            }
            let by = |name| include_tags::words(child.attribute(name).unwrap_or_default());
            if include_tags::enabled(&by("enabled_by"), &by("disabled_by"), self.given) {
                let included = included_file(folder, child.need("href")?);
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
        let build = element.attribute("build").map_or(0, |text| {
            text.trim().parse().unwrap_or_else(|_| {
                let at = &element.origin;
                tracing::warn!(
                    "{at}: expected a whole number from 0 as build, got {text}: 0 is used"
                );
                0
            })
        });
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
            shares_params: false,
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
            "devices" => self.device_list(element, into),
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

    /// Reads the devices of a list; parameters beside them are given to each, before its own.
    fn device_list(
        &self,
        element: &Element,
        into: &mut Vec<DeviceEntry>,
    ) -> Result<(), RobotError> {
        let mut devices = Vec::new();
        let mut shared = Vec::new();
        for child in &element.children {
            match child.name.as_str() {
                "param" | "group" | "paramlist" | "params" => self.params(child, &mut shared)?,
                _ => self.devices(child, &mut devices)?,
            }
        }
        for device in &mut devices {
            let own = &device.params;
            let missing = shared.iter().filter(|shared| {
                let is_group = matches!(shared.value, ParamValue::Group(_));
                is_group || !own.iter().any(|own| own.name == shared.name)
            });
            let missing: Vec<Param> = missing.cloned().collect();
            device.params.splice(0..0, missing);
        }
        into.append(&mut devices);
        Ok(())
    }

    fn params(&self, element: &Element, into: &mut Vec<Param>) -> Result<(), RobotError> {
        let origin = element.origin.clone();
        match element.name.as_str() {
            "params" => element
                .children
                .iter()
                .try_for_each(|child| self.params(child, into))?,
            "param" => {
                let name = name_of(element)?;
                let outside = element.attribute("extern-name").filter(|_| !self.old);
                let given = outside.and_then(|name| self.given.get(name));
                into.extend(match given {
                    Some(given) => Some(Param::given(name, given)),
                    None => Param::from_text(name, element.value()?, origin)?,
                });
            }
            "group" => {
                let name = name_of(element)?;
                let mut inner = Vec::new();
                element
                    .children
                    .iter()
                    .try_for_each(|child| self.params(child, &mut inner))?;
                // A parameter may be lost, with a warning.
                let is_param = |child: &Element| child.name == "param";
                if inner.is_empty() && !element.children.iter().any(is_param) {
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
        let name = name_of(element)?;
        let mut names: Vec<Value> = Vec::new();
        let mut elements = Vec::new();
        for child in &element.children {
            if child.name != "elem" {
                return Err(child.unexpected("<elem>"));
            }
            let name = name_of(child)?;
            names.push(name.as_str().into());
            let origin = child.origin.clone();
            elements.extend(Param::from_text(name, child.value()?, origin)?);
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
                let Some(phase) = Phase::of(element.need("phase")?) else {
                    let words: Vec<_> = Phase::WORDS.iter().map(|(word, _)| *word).collect();
                    tracing::warn!(
                        "{}: expected phase of <action> to be one of {}, got {}: the action never runs",
                        element.origin,
                        words.join(", "),
                        element.need("phase")?
                    );
                    return Ok(());
                };
                into.push(Action {
                    phase,
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

/// Returns the name of a parameter or group, without white space around, and one blank for each run inside.
fn name_of(element: &Element) -> Result<String, RobotError> {
    let words: Vec<_> = element.need("name")?.split_whitespace().collect();
    Ok(words.join(" "))
}

/// Returns the file of `href`, relative to the folder of the including file even with a `/` in front, as in stock;
/// if that does not exist, an absolute `href` is an absolute path.
fn included_file(folder: &Path, href: &str) -> PathBuf {
    let href = href.replace('\\', "/");
    let relative = folder.join(href.trim_start_matches('/'));
    match relative.exists() {
        true => relative,
        false => folder.join(href),
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
