//! Reads descriptions of robots in TOML.
//!
//! ```toml
//! [robot]
//! name = "wam"
//! portprefix = "/wam"
//!
//! [[device]]
//! name = "arm"
//! type = "fakeMotionControl"
//! [device.params]
//! GENERAL = { Joints = 3 }                 # a table is a group
//! [[device]]
//! name = "arm_nws"
//! type = "controlBoard_nws_yarp"
//! params = { name = "${portprefix}/arm", period = 0.02 }
//! extern = { name = "arm_port" }           # `--arm_port /x` replaces parameter `name`
//! action = [{ phase = "startup", level = 5, type = "attach", params = { device = "arm" } }]
//! ```
//!
//! `include = ["arm.toml", { file = "cams.toml", enabled_by = ["cams"], disabled_by = ["dark"] }]`
//! at the top adds the devices and `[params]` of other files in the same folder.

use std::path::Path;
use std::sync::Arc;

use toml::Spanned;
use toml::de::{DeTable, DeValue};
use yarp_wire::Value;
use yarp_wire::settings::{Origin, Settings};

use super::description_files::Files;
use super::{
    Action, ActionKind, DeviceEntry, Param, ParamValue, Phase, ReadOptions, Robot, RobotError,
    include_tags,
};

pub(super) fn read(file: &Path, options: &ReadOptions) -> Result<Robot, RobotError> {
    let mut reader = Reader {
        given: &options.given,
        robot: None,
        params: Vec::new(),
        devices: Vec::new(),
        files: Files::default(),
    };
    reader.file(file, None, 0)?;
    let Some(robot) = reader.robot else {
        let origin = Origin::line(file.display().to_string(), 1);
        return Err(RobotError::expected(&origin, "a table [robot]", "none"));
    };
    Ok(Robot {
        params: reader.params,
        devices: reader.devices,
        ..robot
    })
}

struct Reader<'a> {
    given: &'a Settings,
    robot: Option<Robot>,
    params: Vec<Param>,
    devices: Vec<DeviceEntry>,
    files: Files,
}

/// A source file, which converts offsets to lines.
pub(super) struct SourceFile<'a> {
    file: Arc<str>,
    text: &'a str,
}

pub(super) type SpannedValue<'a> = Spanned<DeValue<'a>>;

impl<'a> SourceFile<'a> {
    pub(super) fn new(file: &Path, text: &'a str) -> Self {
        Self {
            file: file.display().to_string().into(),
            text,
        }
    }

    /// Parses the text.
    pub(super) fn parse(&self) -> Result<Spanned<DeTable<'a>>, RobotError> {
        DeTable::parse(self.text).map_err(|error| RobotError::Syntax {
            origin: self.origin(error.span().unwrap_or_default()),
            what: error.message().to_owned(),
        })
    }

    fn origin(&self, span: std::ops::Range<usize>) -> Origin {
        let before = self.text.get(..span.start).unwrap_or_default();
        Origin::line(self.file.clone(), before.matches('\n').count() + 1)
    }

    pub(super) fn at(&self, value: &SpannedValue<'_>) -> Origin {
        self.origin(value.span())
    }

    pub(super) fn wrong(&self, value: &SpannedValue<'_>, expected: &str) -> RobotError {
        let found = match value.get_ref() {
            DeValue::String(text) => format!("\"{text}\""),
            other => format!("a value of type {}", other.type_str()),
        };
        RobotError::expected(&self.at(value), expected, found)
    }

    pub(super) fn text(
        &self,
        value: &SpannedValue<'_>,
        expected: &str,
    ) -> Result<String, RobotError> {
        let text = value.get_ref().as_str().map(str::to_owned);
        text.ok_or_else(|| self.wrong(value, expected))
    }

    pub(super) fn table<'v, 'd>(
        &self,
        value: &'v SpannedValue<'d>,
        expected: &str,
    ) -> Result<&'v DeTable<'d>, RobotError> {
        let table = value.get_ref().as_table();
        table.ok_or_else(|| self.wrong(value, expected))
    }

    pub(super) fn need<'v, 'd>(
        &self,
        table: &'v DeTable<'d>,
        key: &str,
        at: &Origin,
        what: &str,
    ) -> Result<&'v SpannedValue<'d>, RobotError> {
        table
            .get(key)
            .ok_or_else(|| RobotError::expected(at, format!("key {key} in {what}"), "none"))
    }

    /// Rejects unknown keys, which are typing errors.
    pub(super) fn check_keys(
        &self,
        table: &DeTable<'_>,
        known: &[&str],
        what: &str,
    ) -> Result<(), RobotError> {
        for key in table.keys() {
            if !known.contains(&key.get_ref().as_ref()) {
                let expected = format!("one of {} in {what}", known.join(", "));
                let found = key.get_ref().to_string();
                return Err(RobotError::expected(
                    &self.origin(key.span()),
                    expected,
                    found,
                ));
            }
        }
        Ok(())
    }

    fn whole_number(&self, value: &SpannedValue<'_>, expected: &str) -> Result<u32, RobotError> {
        let number = value.get_ref().as_integer();
        let number =
            number.and_then(|number| u32::from_str_radix(number.as_str(), number.radix()).ok());
        number.ok_or_else(|| self.wrong(value, expected))
    }

    pub(super) fn words(&self, table: &DeTable<'_>, key: &str) -> Result<Vec<String>, RobotError> {
        let Some(value) = table.get(key) else {
            return Ok(Vec::new());
        };
        match value.get_ref().as_array() {
            Some(items) => items.iter().map(|item| self.text(item, "a word")).collect(),
            None => Ok(include_tags::words(
                &self.text(value, "a word, or a list of words")?,
            )),
        }
    }
}

impl Reader<'_> {
    fn file(&mut self, file: &Path, by: Option<&Origin>, depth: usize) -> Result<(), RobotError> {
        let text = self.files.read(file, by, depth)?;
        let source = SourceFile::new(file, &text);
        let table = source.parse()?;
        let table = table.get_ref();
        source.check_keys(
            table,
            &["include", "robot", "params", "device"],
            "the description of a robot",
        )?;
        if let Some(robot) = table.get("robot") {
            let read = read_robot(&source, robot)?;
            if by.is_some() {
                return Err(source.wrong(robot, "no table [robot] in a file that is included"));
            }
            self.robot = Some(read);
        }
        if let Some(params) = table.get("params") {
            let params = self.params(&source, params, None)?;
            self.params.extend(params);
        }
        if let Some(include) = table.get("include") {
            let expected = "a list of files";
            let files = include
                .get_ref()
                .as_array()
                .ok_or_else(|| source.wrong(include, expected))?;
            for included in files.iter() {
                self.include(&source, file, included, depth)?;
            }
        }
        if let Some(devices) = table.get("device") {
            let expected = "[[device]], a list of tables";
            let list = devices
                .get_ref()
                .as_array()
                .ok_or_else(|| source.wrong(devices, expected))?;
            for device in list.iter() {
                let device = self.device(&source, device)?;
                self.devices.push(device);
            }
        }
        Ok(())
    }

    fn include(
        &mut self,
        source: &SourceFile<'_>,
        file: &Path,
        asked: &SpannedValue<'_>,
        depth: usize,
    ) -> Result<(), RobotError> {
        let at = source.at(asked);
        let name = match asked.get_ref() {
            DeValue::Table(table) => {
                source.check_keys(table, &["file", "enabled_by", "disabled_by"], "an include")?;
                let (on, off) = (
                    source.words(table, "enabled_by")?,
                    source.words(table, "disabled_by")?,
                );
                if !include_tags::enabled(&on, &off, self.given) {
                    return Ok(());
                }
                source.text(
                    source.need(table, "file", &at, "an include")?,
                    "the name of a file",
                )?
            }
            _ => source.text(asked, "the name of a file")?,
        };
        let folder = file.parent().unwrap_or(Path::new(""));
        self.file(&folder.join(name), Some(&at), depth + 1)
    }

    fn device(
        &self,
        source: &SourceFile<'_>,
        value: &SpannedValue<'_>,
    ) -> Result<DeviceEntry, RobotError> {
        const DESCRIPTION: &str = "[[device]]";
        let table = source.table(value, DESCRIPTION)?;
        let origin = source.at(value);
        source.check_keys(
            table,
            &["name", "type", "params", "extern", "action"],
            DESCRIPTION,
        )?;
        let text =
            |key, expected| source.text(source.need(table, key, &origin, DESCRIPTION)?, expected);
        let name = text("name", "the name of the device")?;
        let kind = text("type", "the kind of the device")?;
        let outside = match table.get("extern") {
            Some(outside) => Some(source.table(outside, "a table of option names")?),
            None => None,
        };
        let mut params = match table.get("params") {
            Some(params) => self.params(source, params, outside)?,
            None => Vec::new(),
        };
        // The parameter may be given on the command line only.
        for (key, option) in outside.into_iter().flat_map(|table| table.iter()) {
            let name = key.get_ref().to_string();
            let option = source.text(option, "the name of an option")?;
            if let Some(given) = self.given.get(&option)
                && !params.iter().any(|param| param.name == name)
            {
                params.push(Param::given(name, given));
            }
        }
        let mut actions = Vec::new();
        if let Some(list) = table.get("action") {
            let expected = "a list of actions";
            let list = list
                .get_ref()
                .as_array()
                .ok_or_else(|| source.wrong(list, expected))?;
            for action in list.iter() {
                actions.push(self.action(source, action)?);
            }
        }
        Ok(DeviceEntry {
            name,
            kind,
            params,
            actions,
            origin,
        })
    }

    fn action(
        &self,
        source: &SourceFile<'_>,
        value: &SpannedValue<'_>,
    ) -> Result<Action, RobotError> {
        const DESCRIPTION: &str = "an action";
        let table = source.table(value, DESCRIPTION)?;
        let origin = source.at(value);
        source.check_keys(table, &["phase", "level", "type", "params"], DESCRIPTION)?;
        let params = match table.get("params") {
            Some(params) => self.params(source, params, None)?,
            None => Vec::new(),
        };
        let level = source.need(table, "level", &origin, DESCRIPTION)?;
        Ok(Action {
            phase: word(
                source,
                source.need(table, "phase", &origin, DESCRIPTION)?,
                Phase::WORDS,
                Phase::of,
            )?,
            kind: word(
                source,
                source.need(table, "type", &origin, DESCRIPTION)?,
                ActionKind::WORDS,
                ActionKind::of,
            )?,
            level: source.whole_number(level, "a whole number from 0 as level")?,
            params,
            origin,
        })
    }

    fn params(
        &self,
        source: &SourceFile<'_>,
        value: &SpannedValue<'_>,
        outside: Option<&DeTable<'_>>,
    ) -> Result<Vec<Param>, RobotError> {
        let table = source.table(value, "a table of parameters")?;
        let mut params = Vec::new();
        for (key, value) in table.iter() {
            let name = key.get_ref().to_string();
            let option = outside.and_then(|table| {
                let option = table.get(name.as_str())?;
                Some(source.text(option, "the name of an option"))
            });
            if let Some(given) = option
                .transpose()?
                .and_then(|option| self.given.get(&option))
            {
                params.push(Param::given(name, given));
                continue;
            }
            let inner = match value.get_ref() {
                DeValue::Table(_) => ParamValue::Group(self.params(source, value, None)?),
                _ => ParamValue::Values(vec![plain(source, value)?]),
            };
            params.push(Param {
                name,
                value: inner,
                origin: source.origin(key.span()),
            });
        }
        Ok(params)
    }
}

fn read_robot(source: &SourceFile<'_>, value: &SpannedValue<'_>) -> Result<Robot, RobotError> {
    const DESCRIPTION: &str = "[robot]";
    let table = source.table(value, DESCRIPTION)?;
    let known = [
        "name",
        "build",
        "portprefix",
        "reverse-shutdown-action-order",
    ];
    source.check_keys(table, &known, DESCRIPTION)?;
    let at = source.at(value);
    let name = source.text(
        source.need(table, "name", &at, DESCRIPTION)?,
        "the name of the robot",
    )?;
    let build = table.get("build");
    let build = build.map(|build| source.whole_number(build, "a whole number from 0 as build"));
    let prefix = table
        .get("portprefix")
        .map(|prefix| source.text(prefix, "a prefix of port names"));
    let reversed = table.get("reverse-shutdown-action-order").map(|value| {
        let expected = "true or false";
        value
            .get_ref()
            .as_bool()
            .ok_or_else(|| source.wrong(value, expected))
    });
    Ok(Robot {
        build: build.transpose()?.unwrap_or(0),
        port_prefix: prefix.transpose()?.unwrap_or_else(|| format!("/{name}")),
        reversed: reversed.transpose()?.unwrap_or(false),
        name,
        params: Vec::new(),
        shares_params: true,
        devices: Vec::new(),
    })
}

/// Converts a value that is no table.
pub(super) fn plain(
    source: &SourceFile<'_>,
    value: &SpannedValue<'_>,
) -> Result<Value, RobotError> {
    let number = |text: &str| {
        let text = text.replace('_', "");
        text.parse::<f64>()
            .map_err(|_| source.wrong(value, "a number"))
    };
    Ok(match value.get_ref() {
        DeValue::String(text) => text.as_ref().into(),
        DeValue::Boolean(truth) => Value::bool(*truth),
        DeValue::Float(float) => number(float.as_str())?.into(),
        DeValue::Integer(integer) => {
            let whole = i64::from_str_radix(integer.as_str(), integer.radix());
            let whole = whole.map_err(|_| source.wrong(value, "a whole number of 64 bits"))?;
            match i32::try_from(whole) {
                Ok(small) => small.into(),
                Err(_) => whole.into(),
            }
        }
        DeValue::Array(items) => {
            let items: Result<Vec<_>, _> = items.iter().map(|item| plain(source, item)).collect();
            Value::List(items?.into_iter().collect())
        }
        _ => return Err(source.wrong(value, "a word, a number, a truth value or a list")),
    })
}

fn word<T>(
    source: &SourceFile<'_>,
    value: &SpannedValue<'_>,
    words: &[(&str, T)],
    of: impl Fn(&str) -> Option<T>,
) -> Result<T, RobotError> {
    let words: Vec<_> = words.iter().map(|(word, _)| *word).collect();
    let expected = format!("one of {}", words.join(", "));
    let found = source.text(value, &expected)?;
    of(&found).ok_or_else(|| source.wrong(value, &expected))
}
