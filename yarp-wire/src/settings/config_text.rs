//! Files of lines, groups and includes.
//!
//! ```text
//! key value "another value"        // a remark
//! key = value                      # another
//! [group]                          the following lines are lists in (group ..)
//! [list name]                      opens the group name, and adds name to (list ..)
//! []                               closes the group
//! [include "FILE"]                 the lines of the file, or of all *.ini in a directory
//! [include GROUP "FILE"]           the same, as a group
//! [include LIST GROUP "FILE"]      the same, and adds GROUP to (LIST ..)
//! [import CONTEXT FILE]            the lines of a file of a context
//! ```
//!
//! A line with an open bracket or quote continues in the next one, and so does one with a backslash
//! at its end.

use std::sync::Arc;

use super::comments::strip_comment;
use super::variable_expansion::expand;
use super::{Origin, Setting, Settings, Source, all, bottle};
use crate::bottle::{Bottle, BracketBalance, Value};

/// Maximum depth of nested includes.
const MAX_INCLUDE_DEPTH: usize = 16;
/// Maximum number of files that one file may include altogether.
const MAX_INCLUDED_FILES: usize = 1000;

/// Something that was passed over while a file was read.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct Problem {
    /// The position in the file.
    pub origin: Origin,
    /// Description of the problem.
    pub text: String,
}

impl std::fmt::Display for Problem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {}", self.origin, self.text)
    }
}

impl Settings {
    /// Adds the lines of a file or of all `*.ini` in a directory, and of the files they include.
    ///
    /// `None` if there is no such file; otherwise the ignored problems. Existing groups are
    /// extended; other names are replaced.
    pub fn read_file(&mut self, file: &str, source: &dyn Source) -> Option<Vec<Problem>> {
        let mut reader = Reader::new(source);
        let found = reader.file(self, file, "", 0);
        found.then_some(reader.problems)
    }

    /// Reads a text as [`read_file`](Self::read_file) does; errors refer to it as `file`.
    pub fn read_text(&mut self, file: &str, text: &str, source: &dyn Source) -> Vec<Problem> {
        let mut reader = Reader::new(source);
        let text = Text::of(vec![(file.into(), text.to_owned())]);
        reader.text(self, &text, "", 0);
        reader.problems
    }
}

struct Reader<'a> {
    source: &'a dyn Source,
    problems: Vec<Problem>,
    files: usize,
}

/// The group that lines belong to at the moment.
#[derive(Default)]
struct Open {
    name: String,
    items: Vec<Setting>,
}

impl<'a> Reader<'a> {
    fn new(source: &'a dyn Source) -> Self {
        Self {
            source,
            problems: Vec::new(),
            files: 0,
        }
    }

    /// `search` has the directories of the files that led here, separated by `;`.
    fn file(&mut self, into: &mut Settings, file: &str, search: &str, depth: usize) -> bool {
        let mut prefix = String::new();
        let mut found = self.load(file);
        if found.is_none() {
            for place in search.split(';').filter(|place| !place.is_empty()) {
                found = self.load(&format!("{place}/{file}"));
                if found.is_some() {
                    prefix = format!("{place}/");
                    break;
                }
            }
        }
        let Some(text) = found else {
            return false;
        };
        let directory = file.rfind('/').or_else(|| file.rfind('\\'));
        let mut search = search.to_owned();
        if let Some(directory) = directory
            .map(|at| &file[..at])
            .filter(|dir| !dir.is_empty())
        {
            if !search.is_empty() {
                search.push(';');
            }
            search.push_str(&prefix);
            search.push_str(directory);
        }
        self.text(into, &text, &search, depth);
        true
    }

    fn load(&self, file: &str) -> Option<Text> {
        if let Some(mut names) = self.source.list(file) {
            names.retain(|name| name.ends_with(".ini"));
            names.sort();
            let mut pieces = Vec::new();
            for name in names {
                let file = format!("{file}/{name}");
                let mut text = self.source.read(&file)?;
                text.push_str("\n[]\n");
                pieces.push((file.into(), text));
            }
            return Some(Text::of(pieces));
        }
        let text = self.source.read(file)?;
        Some(Text::of(vec![(file.into(), text)]))
    }

    fn text(&mut self, into: &mut Settings, text: &Text, search: &str, depth: usize) {
        let mut open = Open::default();
        let mut rest = Lines::of(&text.text);
        loop {
            let at = text.origin(rest.line);
            let (line, last) = rest.whole_line();
            if last {
                self.line(into, &mut open, &line, &at);
                close(into, &mut open);
                return;
            }
            let line = expand(strip_comment(&line), |name| {
                self.variable(name, search, into)
            });
            let Some((head, _)) = line.strip_prefix('[').and_then(|head| head.split_once(']'))
            else {
                self.line(into, &mut open, &line, &at);
                continue;
            };
            let words = match head.contains(' ') {
                true => Bottle::parse(head).unwrap_or_default().into_items(),
                false => Vec::new(),
            };
            let words: Vec<_> = words.iter().map(Value::to_plain_string).collect();
            let words: Vec<_> = words.iter().map(String::as_str).collect();
            match words[..] {
                ["include" | "import", _, ..] => {
                    close(into, &mut open);
                    if !self.include(into, &words, search, &at, depth) {
                        return;
                    }
                }
                [list, name] => {
                    add_to_list(into, list, name, &at);
                    begin(into, &mut open, name, &at);
                }
                _ => begin(into, &mut open, head, &at),
            }
        }
    }

    /// A line that is no head: an entry of its own, or of the group that is open.
    fn line(&mut self, into: &mut Settings, open: &mut Open, line: &str, at: &Origin) {
        let mut items = match Bottle::parse(line) {
            Ok(items) => all(items, at),
            Err(error) => return self.problem(at, error.to_string()),
        };
        if items.is_empty() {
            return;
        }
        drop_equals(&mut items);
        if open.name.is_empty() {
            into.put_entry(items[0].to_plain_string(), items);
        } else {
            open.items.push(Setting::list(items, at));
        }
    }

    /// Executes a head with `include` or `import`; returns whether the lines after it count.
    fn include(
        &mut self,
        into: &mut Settings,
        words: &[&str],
        search: &str,
        at: &Origin,
        depth: usize,
    ) -> bool {
        self.files += 1;
        if depth >= MAX_INCLUDE_DEPTH || self.files > MAX_INCLUDED_FILES {
            self.problem(
                at,
                format!(
                    "more than {MAX_INCLUDE_DEPTH} files deep, or {MAX_INCLUDED_FILES} altogether"
                ),
            );
            return false;
        }
        let (group, file) = match *words {
            ["import", context, ref rest @ ..] => {
                let file = rest.first().copied().unwrap_or_default();
                let found = self.source.resource(context, file);
                (None, found.unwrap_or_else(|| file.to_owned()))
            }
            [_, file] => (None, file.to_owned()),
            [_, group, file] => (Some(group), file.to_owned()),
            [_, list, group, file] => {
                add_to_list(into, list, group, at);
                (Some(group), file.to_owned())
            }
            _ => {
                self.problem(at, "bad include".to_owned());
                return false;
            }
        };
        let Some(group) = group else {
            if !self.file(into, &file, search, depth + 1) {
                self.problem(at, format!("cannot read from {file}"));
            }
            return true;
        };
        // As if the group were a file of its own that is read first.
        let mut inner = Settings::new();
        for item in into.entries.get(group).into_iter().flatten().skip(1) {
            if let Some(items) = item.items() {
                let name = items.first().map(Setting::to_plain_string);
                inner.put_entry(name.unwrap_or_default(), reread(items));
            }
        }
        if !self.file(&mut inner, &file, search, depth + 1) {
            self.problem(at, format!("cannot read from {file}"));
        }
        if !inner.entries.is_empty() && !group.is_empty() {
            let mut items = vec![Setting::new(group.into(), at)];
            let lists = inner.entries.into_values();
            items.extend(lists.map(|items| {
                let at = items.first().map_or(at, Setting::origin).clone();
                Setting::list(reread(&items), &at)
            }));
            into.put_entry(group.to_owned(), items);
        }
        true
    }

    fn variable(&self, name: &str, search: &str, settings: &Settings) -> String {
        let outside = self.source.variable(name).filter(|value| !value.is_empty());
        let set = || match name {
            "CONFIG_PATH" if !search.is_empty() => Some(search.to_owned()),
            _ => Some(settings.get(name)?.to_plain_string()).filter(|value| !value.is_empty()),
        };
        let known = || (name == "__YARP__").then(|| "1".to_owned());
        outside.or_else(set).or_else(known).unwrap_or_default()
    }

    fn problem(&mut self, origin: &Origin, text: String) {
        let origin = origin.clone();
        self.problems.push(Problem { origin, text });
    }
}

/// `key = value` is `key value`.
fn drop_equals(items: &mut Vec<Setting>) {
    let second = items.get(1).map(Setting::value);
    if second.as_ref().and_then(Value::as_str) == Some("=") {
        items.remove(1);
    }
}

fn add_to_list(into: &mut Settings, list: &str, name: &str, at: &Origin) {
    let entry = into.entries.entry(list.to_owned());
    entry
        .or_insert_with(|| vec![Setting::new(list.into(), at)])
        .push(Setting::new(name.into(), at));
}

fn begin(into: &mut Settings, open: &mut Open, name: &str, at: &Origin) {
    close(into, open);
    open.name = name.to_owned();
    open.items = vec![Setting::new(name.into(), at)];
    let before = into.entries.get(name).into_iter().flatten().skip(1);
    open.items.extend(before.cloned());
}

fn close(into: &mut Settings, open: &mut Open) {
    let Open { name, mut items } = std::mem::take(open);
    if !name.is_empty() {
        drop_equals(&mut items);
        into.put_entry(name, items);
    }
}

/// Returns the items as stock has them after printing and parsing: words that look like numbers
/// become numbers.
fn reread(items: &[Setting]) -> Vec<Setting> {
    let again = |item: &Setting| match item.items() {
        Some(items) => Setting::list(reread(items), &item.origin),
        None => {
            let printed = bottle(std::slice::from_ref(item)).to_string();
            let read = Bottle::parse(&printed).unwrap_or_default().into_items();
            let value = read.into_iter().next();
            Setting::new(value.unwrap_or_else(|| item.value()), &item.origin)
        }
    };
    items.iter().map(again).collect()
}

/// Files one after the other.
struct Text {
    text: String,
    /// Each with the line of the whole at which it begins, from 0.
    files: Vec<(usize, Arc<str>)>,
}

impl Text {
    fn of(pieces: Vec<(Arc<str>, String)>) -> Self {
        let mut whole = Self {
            text: String::new(),
            files: Vec::new(),
        };
        let mut line = 0;
        for (file, text) in pieces {
            whole.files.push((line, file));
            line += text.matches('\n').count();
            whole.text.push_str(&text);
        }
        whole.text.push('\n');
        whole
    }

    fn origin(&self, line: usize) -> Origin {
        match self.files.iter().rfind(|(first, _)| *first <= line) {
            Some((first, file)) => Origin::line(file.clone(), line - first + 1),
            None => Origin::Program,
        }
    }
}

/// The lines of a text.
struct Lines<'a> {
    rest: std::str::Chars<'a>,
    line: usize,
}

impl<'a> Lines<'a> {
    fn of(text: &'a str) -> Self {
        Self {
            rest: text.chars(),
            line: 0,
        }
    }

    /// Returns the next lines up to one without open bracket or quote, and whether the text ends
    /// before that.
    fn whole_line(&mut self) -> (String, bool) {
        let mut whole = String::new();
        let mut balance = BracketBalance::default();
        loop {
            let Some(line) = self.next_line() else {
                return (whole, true);
            };
            balance.extend(line.as_bytes());
            whole.push_str(&line);
            let mut ended = balance;
            ended.extend(b" ");
            if ended.is_balanced() {
                return (whole, false);
            }
        }
    }

    /// Returns the next line; a backslash at its end continues it.
    fn next_line(&mut self) -> Option<String> {
        let mut line = String::new();
        let mut backslash = false;
        loop {
            match self.rest.next()? {
                '\n' => {
                    self.line += 1;
                    if !std::mem::take(&mut backslash) {
                        return Some(line);
                    }
                }
                '\r' | '\0' => {}
                '\\' if !backslash => backslash = true,
                c => {
                    if std::mem::take(&mut backslash) {
                        line.push('\\');
                    }
                    line.push(c);
                }
            }
        }
    }
}
