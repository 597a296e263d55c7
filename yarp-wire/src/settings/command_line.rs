//! `--key value --group::key value`.

use super::{Origin, Setting, Settings};
use crate::bottle::{Bottle, Value};

/// Maximum number of groups in a key; the rest is one name.
const MAX_GROUP_DEPTH: usize = 100;

impl Settings {
    /// Adds the arguments of a command line (`Property::fromCommand`).
    ///
    /// * `--key a b` is the entry `(key a b)`; words before the first `--key` are ignored.
    /// * `--a::b::c v` is added to group `b` of group `a`.
    /// * Other keys replace the entry of their name; so does every key if none of the words has
    ///   `::`.
    pub fn add_command_line<S: AsRef<str>>(&mut self, words: impl IntoIterator<Item = S>) {
        let mut terms: Vec<(String, Vec<Setting>)> = Vec::new();
        for word in words {
            let word = word.as_ref();
            match word.strip_prefix("--") {
                Some(key) => terms.push((key.to_owned(), vec![written(key)])),
                None => {
                    if let Some((_, values)) = terms.last_mut() {
                        // Paths of other systems have backslashes.
                        values.push(written(&word.replace('\\', "\\\\")));
                    }
                }
            }
        }
        // A lone `--` begins nothing.
        terms.retain(|(key, _)| !key.is_empty());
        let in_groups = terms.iter().any(|(key, _)| key.contains("::"));
        for (key, values) in terms {
            if in_groups {
                self.put_into_group(&key, values);
            } else {
                let name = values[0].to_plain_string();
                self.put_entry(name, values);
            }
        }
    }

    fn put_into_group(&mut self, key: &str, mut values: Vec<Setting>) {
        let mut path: Vec<&str> = key.splitn(MAX_GROUP_DEPTH, "::").collect();
        if path.len() > 1 && path.last() == Some(&"") {
            path.pop();
        }
        let first = path[0];
        values[0] = name(path[path.len() - 1]);
        let mut here = self
            .entries
            .entry(first.to_owned())
            .or_insert_with(|| vec![name(first)]);
        for step in &path[1..] {
            let there = here
                .iter()
                .position(|item| item.is_called(step) && item.items().is_some());
            let at = there.unwrap_or_else(|| {
                here.push(Setting::list(vec![name(step)], &Origin::CommandLine));
                here.len() - 1
            });
            here = here[at].items_mut().expect("it is a list");
        }
        *here = values;
    }
}

fn name(text: &str) -> Setting {
    Setting::new(text.into(), &Origin::CommandLine)
}

/// One item of a bottle if the word is one, else the word.
fn written(word: &str) -> Setting {
    let items = Bottle::parse(word).unwrap_or_default().into_items();
    let value = match <[Value; 1]>::try_from(items) {
        Ok([value]) => value,
        Err(_) => word.into(),
    };
    Setting::new(value, &Origin::CommandLine)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(before: &str, line: &str, expected: &str) {
        let mut settings = Settings::new();
        settings.add_lists(before, &Origin::Program).unwrap();
        settings.add_command_line(line.split(' '));
        assert_eq!(settings.to_string(), expected, "{line}");
    }

    /// Each line was read by stock 3.5.0.
    #[test]
    fn words_are_read_as_stock_reads_them() {
        check(
            "",
            "x --name /a --flag --n 1 -2 3.5",
            "(flag) (n 1 -2 3.5) (name \"/a\")",
        );
        check("", "--a::b 1 --a::c 2 --d 3", "(a (b 1) (c 2)) (d 3)");
        check("", "--a::b::c 1 --a::b::d 2", "(a (b (c 1) (d 2)))");
        check("(a (b 1) (c 2))", "--a::b 5", "(a (b 5) (c 2))");
        check("(a (b 1))", "--a 5", "(a 5)");
        check("", "--l (1,2)", "(l (1 2))");
    }
}
