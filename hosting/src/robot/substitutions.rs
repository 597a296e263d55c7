//! Replaces devices of a description by others, such as the boards of a robot by fakes.
//!
//! ```toml
//! omit_unknown = true                 # devices of other types that do not exist here are left out
//!
//! [[substitute]]
//! types = ["embObjMotionControl"]     # `embObj*` is any type that begins so
//! names = ["left_*"]                  # optional: only these devices
//! with = "fakeMotionControl"
//! # Parameters of the new device: those of the old one under a new name, where it has them, and constant ones.
//! copy = { "GENERAL::Joints" = "GENERAL::Joints", "LIMITS::Min" = "LIMITS::jntPosMin" }
//! params = { "GENERAL::Verbose" = 0 }
//! ```
//!
//! The first rule that matches a device applies; `types` and `names` are optional, but not both. The new device keeps name and actions of the old one.

use std::path::Path;

use toml::de::{DeTable, DeValue};
use yarp_wire::Value;
use yarp_wire::settings::Origin;

use super::action_targets::{AttachTargets, STORAGE, need};
use super::description_files::Files;
use super::device_parameters::find;
use super::toml_description::{SourceFile, SpannedValue, plain};
use super::{Action, ActionKind, DeviceEntry, Param, ParamValue, Problem, Robot, RobotError};
use crate::device_types;

/// Rules that replace devices.
#[derive(Clone, Debug, Default)]
pub struct Substitutions {
    rules: Vec<Rule>,
    omit_unknown: bool,
}

#[derive(Clone, Debug)]
struct Rule {
    /// Patterns of types and names of devices; none for any.
    types: Vec<String>,
    names: Vec<String>,
    with: String,
    /// Path of each parameter of the new device, and of that of the old one.
    copy: Vec<(String, String)>,
    /// Path and value of the constant parameters.
    params: Vec<(String, Value, Origin)>,
}

impl Substitutions {
    /// Reads rules from a file in TOML.
    ///
    /// Errors: [`RobotError`], with file and line.
    pub fn read(file: &Path) -> Result<Self, RobotError> {
        const DESCRIPTION: &str = "a file of substitutions";
        let text = Files::default().read(file, None, 0)?;
        let source = SourceFile::new(file, &text);
        let table = source.parse()?;
        let table = table.get_ref();
        source.check_keys(table, &["omit_unknown", "substitute"], DESCRIPTION)?;
        let omit_unknown = match table.get("omit_unknown") {
            None => false,
            Some(value) => {
                let truth = value.get_ref().as_bool();
                truth.ok_or_else(|| source.wrong(value, "true or false"))?
            }
        };
        let mut rules = Vec::new();
        if let Some(list) = table.get("substitute") {
            let expected = "[[substitute]], a list of tables";
            let items = list.get_ref().as_array();
            let items = items.ok_or_else(|| source.wrong(list, expected))?;
            for item in items.iter() {
                rules.push(Rule::read(&source, item)?);
            }
        }
        Ok(Self {
            rules,
            omit_unknown,
        })
    }

    fn rule(&self, device: &DeviceEntry) -> Option<&Rule> {
        self.rules.iter().find(|rule| {
            is_one_of(&device.kind, &rule.types) && is_one_of(&device.name, &rule.names)
        })
    }
}

/// Returns true if a word matches one of the patterns, whose `*` at the end stands for any rest, or if there are none.
fn is_one_of(word: &str, patterns: &[String]) -> bool {
    let matches = |pattern: &String| match pattern.strip_suffix('*') {
        Some(beginning) => word.starts_with(beginning),
        None => word == pattern,
    };
    patterns.is_empty() || patterns.iter().any(matches)
}

impl Rule {
    fn read(source: &SourceFile<'_>, value: &SpannedValue<'_>) -> Result<Self, RobotError> {
        const DESCRIPTION: &str = "[[substitute]]";
        let table = source.table(value, DESCRIPTION)?;
        let at = source.at(value);
        source.check_keys(
            table,
            &["types", "names", "with", "copy", "params"],
            DESCRIPTION,
        )?;
        let (types, names) = (source.words(table, "types")?, source.words(table, "names")?);
        if types.is_empty() && names.is_empty() {
            source.need(table, "types", &at, DESCRIPTION)?;
        }
        let with = source.need(table, "with", &at, DESCRIPTION)?;
        let name = source.text(with, "a device type")?;
        if !device_types::is_known(&name) {
            return Err(source.wrong(with, "a device type that exists here"));
        }
        let mut copy = Vec::new();
        for (key, value) in entries(source, table, "copy")? {
            let old = source.text(value, "the name of a parameter of the old device")?;
            copy.push((key, old));
        }
        let mut params = Vec::new();
        for (key, value) in entries(source, table, "params")? {
            params.push((key, plain(source, value)?, source.at(value)));
        }
        Ok(Self {
            types,
            names,
            with: name,
            copy,
            params,
        })
    }

    /// Makes a device one of the new type.
    fn apply(&self, device: &mut DeviceEntry) {
        let mut params = Vec::new();
        for (new, old) in &self.copy {
            if let Some((value, origin)) = values(&device.params, old) {
                put(&mut params, new, value.to_vec(), origin);
            }
        }
        for (new, value, origin) in &self.params {
            put(&mut params, new, vec![value.clone()], origin);
        }
        device.kind.clone_from(&self.with);
        device.params = params;
    }
}

/// Returns the entries of a table within a table; none if it is not there.
fn entries<'v, 'd>(
    source: &SourceFile<'_>,
    table: &'v DeTable<'d>,
    key: &str,
) -> Result<Vec<(String, &'v SpannedValue<'d>)>, RobotError> {
    let Some(inner) = table.get(key) else {
        return Ok(Vec::new());
    };
    let inner = match inner.get_ref() {
        DeValue::Table(inner) => inner,
        _ => return Err(source.wrong(inner, "a table of parameters")),
    };
    let entries = inner.iter();
    Ok(entries
        .map(|(key, value)| (key.get_ref().to_string(), value))
        .collect())
}

/// Returns the values of the parameter at a path such as `GENERAL::Joints`; groups may occur several times.
fn values<'p>(params: &'p [Param], path: &str) -> Option<(&'p [Value], &'p Origin)> {
    params.iter().find_map(|param| match &param.value {
        ParamValue::Values(values) => (param.name == path).then_some((&values[..], &param.origin)),
        ParamValue::Group(inner) => {
            let rest = path.strip_prefix(param.name.as_str())?.strip_prefix("::")?;
            values(inner, rest)
        }
    })
}

/// Sets the parameter at a path.
fn put(params: &mut Vec<Param>, path: &str, values: Vec<Value>, origin: &Origin) {
    let Some((group, rest)) = path.split_once("::") else {
        params.retain(|known| known.name != path);
        params.push(Param {
            name: path.to_owned(),
            value: ParamValue::Values(values),
            origin: origin.clone(),
        });
        return;
    };
    let is_group =
        |param: &Param| param.name == group && matches!(param.value, ParamValue::Group(_));
    let at = params.iter().position(is_group).unwrap_or_else(|| {
        params.push(Param {
            name: group.to_owned(),
            value: ParamValue::Group(Vec::new()),
            origin: origin.clone(),
        });
        params.len() - 1
    });
    if let ParamValue::Group(inner) = &mut params[at].value {
        put(inner, rest, values, origin);
    }
}

impl Robot {
    /// Replaces devices by those that the rules name, and leaves out unknown ones if the rules say so.
    ///
    /// Actions lose the devices that are left out, and are left out if they have no others. Returns each type that is
    /// left out once, where it occurs first.
    pub fn substitute(&mut self, rules: &Substitutions) -> Vec<Problem> {
        for device in &mut self.devices {
            if let Some(rule) = rules.rule(device) {
                rule.apply(device);
            }
        }
        if !rules.omit_unknown {
            return Vec::new();
        }
        let unknown = |device: &DeviceEntry| !device_types::is_known(&device.kind);
        let mut omitted: Vec<Problem> = Vec::new();
        let mut kinds: Vec<&str> = Vec::new();
        for device in self.devices.iter().filter(|device| unknown(device)) {
            if !kinds.contains(&device.kind.as_str()) {
                kinds.push(&device.kind);
                let same = self
                    .devices
                    .iter()
                    .filter(|other| other.kind == device.kind);
                omitted.push(Problem {
                    origin: device.origin.clone(),
                    what: format!(
                        "there is no device type {}: device {} is left out, {} of this type in total",
                        device.kind,
                        device.name,
                        same.count()
                    ),
                });
            }
        }
        self.devices.retain(|device| !unknown(device));
        let names: Vec<String> = self
            .devices
            .iter()
            .map(|device| device.name.clone())
            .collect();
        let remains = |name: &str| name == STORAGE || names.iter().any(|known| known == name);
        for device in &mut self.devices {
            device.actions.retain_mut(|action| keep(action, &remains));
        }
        omitted
    }
}

/// Removes the devices of an action that do not remain; returns false if none is left.
fn keep(action: &mut Action, remains: &impl Fn(&str) -> bool) -> bool {
    match action.kind {
        ActionKind::Calibrate | ActionKind::Park => {
            need(&action.params, "target").map_or(true, |target| remains(&target))
        }
        ActionKind::Attach => {
            let Ok(AttachTargets::Named(named)) = AttachTargets::of(&action.params) else {
                return true;
            };
            let left = named.iter().filter(|(device, _)| remains(device));
            let left: Vec<Value> = left.map(|(_, network)| network.as_str().into()).collect();
            if left.len() < named.len() && find(&action.params, "networks").is_some() {
                let networks = Value::List(left.iter().cloned().collect());
                let origin = action.origin.clone();
                put(&mut action.params, "networks", vec![networks], &origin);
            }
            !left.is_empty()
        }
        _ => true,
    }
}
