//! Configuration: names with values and groups, each with its origin.
//!
//! | file | content |
//! | --- | --- |
//! | `config_text` | files of lines, groups and includes, as `Property::fromConfigFile` |
//! | `command_line` | `--key value --group::key value`, as `Property::fromCommand` |
//! | `variable_expansion` | `$VARIABLE`, `${VARIABLE}` and `$(VARIABLE)` |
//! | `comments` | comments after `//` and `#` |
//! | [`typed_parameters`] | typed access to single values, with errors that name the expected type
//! |
//!
//! Nothing here opens a file or reads the environment: a [`Source`] does.
//!
//! Source: `Property.cpp` of YARP 3.5 and its answers to the same texts.

mod command_line;
mod comments;
mod config_text;
mod origin;
pub mod typed_parameters;
mod variable_expansion;

use std::collections::BTreeMap;
use std::fmt;

pub use comments::strip_comment;
pub use config_text::Problem;
pub use origin::Origin;
pub use typed_parameters::{Expected, ParameterError, Parameters};

use crate::bottle::{Bottle, TextError, Value};

/// The source of the texts and variables that a configuration refers to.
pub trait Source {
    /// Returns the text of a file; `None` if there is no such file.
    fn read(&self, file: &str) -> Option<String>;

    /// Returns the names of the files in a directory; `None` if there is no such directory.
    fn list(&self, directory: &str) -> Option<Vec<String>>;

    /// Returns a variable of the environment.
    fn variable(&self, name: &str) -> Option<String>;

    /// Returns the path of a file of a context (`[import CONTEXT FILE]`).
    fn resource(&self, context: &str, file: &str) -> Option<String>;
}

/// No files and no variables.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoSource;

impl Source for NoSource {
    fn read(&self, _: &str) -> Option<String> {
        None
    }

    fn list(&self, _: &str) -> Option<Vec<String>> {
        None
    }

    fn variable(&self, _: &str) -> Option<String> {
        None
    }

    fn resource(&self, _: &str, _: &str) -> Option<String> {
        None
    }
}

/// A value, and where it was written.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    content: Content,
    origin: Origin,
}

#[derive(Clone, Debug, PartialEq)]
enum Content {
    One(Value),
    List(Vec<Setting>),
}

impl Setting {
    /// Creates a value that was written at `origin`.
    pub fn new(value: Value, origin: &Origin) -> Self {
        let content = match value {
            Value::List(list) | Value::Dictionary(list) => Content::List(all(list, origin)),
            value => Content::One(value),
        };
        Self {
            content,
            origin: origin.clone(),
        }
    }

    /// Creates a list that was written at `origin`; that of an entry or a group begins with its name.
    pub fn list(items: Vec<Setting>, origin: &Origin) -> Self {
        Self {
            content: Content::List(items),
            origin: origin.clone(),
        }
    }

    /// Returns its origin.
    pub fn origin(&self) -> &Origin {
        &self.origin
    }

    /// Returns the value alone.
    pub fn value(&self) -> Value {
        match &self.content {
            Content::One(value) => value.clone(),
            Content::List(items) => Value::List(bottle(items)),
        }
    }

    /// Returns the items, if it is a list.
    pub fn items(&self) -> Option<&[Setting]> {
        match &self.content {
            Content::One(_) => None,
            Content::List(items) => Some(items),
        }
    }

    fn items_mut(&mut self) -> Option<&mut Vec<Setting>> {
        match &mut self.content {
            Content::One(_) => None,
            Content::List(items) => Some(items),
        }
    }

    /// Returns the text without quotes, as stock's `toString`.
    pub fn to_plain_string(&self) -> String {
        self.value().to_plain_string()
    }

    /// Returns whether it is this word, or a list that begins with it.
    fn is_called(&self, name: &str) -> bool {
        let first = match &self.content {
            Content::One(_) => Some(self),
            Content::List(items) => items.first(),
        };
        // An empty list has an empty name.
        first.map_or(name.is_empty(), |first| first.to_plain_string() == name)
    }
}

fn all(bottle: Bottle, origin: &Origin) -> Vec<Setting> {
    bottle
        .into_items()
        .into_iter()
        .map(|value| Setting::new(value, origin))
        .collect()
}

fn bottle(items: &[Setting]) -> Bottle {
    items.iter().map(Setting::value).collect()
}

/// Names with values, stock's `Property`, as configuration.
///
/// Each entry is a list that begins with its name. A group is an entry with lists in it.
///
/// ```
/// use yarp_wire::settings::{NoSource, Settings};
/// let mut settings = Settings::new();
/// settings.read_text("arm.ini", "name /arm\n[GENERAL]\nJoints 3 // as built\n", &NoSource);
/// assert_eq!(settings.to_string(), "(GENERAL (Joints 3)) (name \"/arm\")");
/// let joints = settings.group("GENERAL").unwrap().get("Joints").unwrap();
/// assert_eq!(joints.origin().to_string(), "arm.ini:3");
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Settings {
    entries: BTreeMap<String, Vec<Setting>>,
}

impl Settings {
    /// No names.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds the lists of a text such as `(name /arm) (GENERAL (Joints 3))`; each replaces the entry
    /// of its name (`Property::fromString`).
    pub fn add_lists(&mut self, text: &str, origin: &Origin) -> Result<(), TextError> {
        for setting in all(Bottle::parse(text)?, origin) {
            if let Content::List(items) = setting.content {
                let name = items.first().map(Setting::to_plain_string);
                self.put_entry(name.unwrap_or_default(), items);
            }
        }
        Ok(())
    }

    /// Sets `name` to one value, replacing an existing entry.
    pub fn put(&mut self, name: &str, value: impl Into<Value>, origin: &Origin) {
        let items = vec![
            Setting::new(name.into(), origin),
            Setting::new(value.into(), origin),
        ];
        self.put_entry(name.to_owned(), items);
    }

    /// Takes `name` out.
    pub fn remove(&mut self, name: &str) {
        self.entries.remove(name);
    }

    /// Moves all entries of `others` into these settings, replacing those of the same names.
    pub fn extend(&mut self, others: Settings) {
        self.entries.extend(others.entries);
    }

    /// Returns whether there is such a name.
    pub fn has(&self, name: &str) -> bool {
        self.entries.contains_key(name)
    }

    /// Returns the first value of `name`.
    pub fn get(&self, name: &str) -> Option<&Setting> {
        self.entries.get(name)?.get(1)
    }

    /// Returns the whole entry of `name`, as a group.
    pub fn group(&self, name: &str) -> Option<Group<'_>> {
        self.entries.get(name).map(|items| Group(items))
    }

    /// Returns the names, sorted.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.entries.keys().map(String::as_str)
    }

    /// Returns the position where `name` was first written.
    pub fn origin(&self, name: &str) -> Option<&Origin> {
        self.entries.get(name)?.first().map(Setting::origin)
    }

    /// Returns the entries as a bottle of lists, sorted by name.
    pub fn to_bottle(&self) -> Bottle {
        let lists = self.entries.values().map(|items| bottle(items));
        lists.map(Value::List).collect()
    }

    /// Sets an entry, replacing that of the same name; `items` begin with the name.
    pub fn put_entry(&mut self, name: String, items: Vec<Setting>) {
        self.entries.insert(name, items);
    }
}

impl fmt::Display for Settings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.to_bottle().fmt(f)
    }
}

/// An entry: its name, its values, and the lists in it that begin with a name of their own.
#[derive(Clone, Copy, Debug)]
pub struct Group<'a>(&'a [Setting]);

impl<'a> Group<'a> {
    /// Returns the items behind the name.
    pub fn values(self) -> &'a [Setting] {
        self.0.get(1..).unwrap_or_default()
    }

    /// Returns the value of `name`: the first value of the list that begins with it, or the item
    /// that follows it.
    pub fn get(self, name: &str) -> Option<&'a Setting> {
        let at = self.find(name)?;
        match &self.0[at].content {
            Content::List(items) => items.get(1),
            Content::One(_) => self.0.get(at + 1),
        }
    }

    /// Returns the list that begins with `name`.
    pub fn group(self, name: &str) -> Option<Group<'a>> {
        let items = self.0[self.find(name)?].items()?;
        Some(Group(items))
    }

    /// Returns the position where it was first written.
    pub fn origin(self) -> Option<&'a Origin> {
        self.0.first().map(Setting::origin)
    }

    fn find(self, name: &str) -> Option<usize> {
        self.0.iter().position(|item| item.is_called(name))
    }
}
