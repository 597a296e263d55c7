//! Variables in the texts of an application.

use std::collections::HashMap;

/// Maximum number of variables that are replaced in one text: a variable may contain itself.
const MAX_REPLACEMENTS: usize = 1000;
/// Maximum number of bytes of all texts of a file in which variables were replaced.
const MAX_REPLACED_BYTES: usize = 8 << 20;
/// Maximum number of characters of a name in a message.
const MAX_SHOWN_NAME: usize = 80;

/// Variables of a file, and those of the environment.
pub(super) struct TextVariables<'e> {
    values: HashMap<String, String>,
    environment: &'e dyn Fn(&str) -> Option<String>,
    /// Number of bytes that may still be made.
    left: usize,
}

/// A text whose variables are replaced, and what is wrong with it.
#[derive(Debug, PartialEq)]
pub(super) struct Replaced {
    pub(super) text: String,
    pub(super) problem: Option<String>,
}

impl Replaced {
    fn nothing(problem: &str) -> Self {
        Self {
            text: String::new(),
            problem: Some(format!("{problem}: the text is left empty")),
        }
    }
}

impl<'e> TextVariables<'e> {
    pub(super) fn new(environment: &'e dyn Fn(&str) -> Option<String>) -> Self {
        Self {
            values: HashMap::new(),
            environment,
            left: MAX_REPLACED_BYTES,
        }
    }

    pub(super) fn set(&mut self, name: &str, value: String) {
        self.values.insert(name.to_owned(), value);
    }

    /// Replaces variables, those of the environment first; also in what they stand for. One that nothing sets is empty.
    pub(super) fn replace(&mut self, text: &str) -> Replaced {
        let mut text = text.to_owned();
        let mut problem = None;
        for _ in 0..=MAX_REPLACEMENTS {
            let Some((start, name, end, is_environment)) = next_variable(&text) else {
                if text.contains('$') {
                    let what = "a `$` that begins no ${NAME} and no $ENV{NAME}";
                    problem = problem.or(Some(what.to_owned()));
                }
                return Replaced { text, problem };
            };
            let name = &text[name..end];
            let value = match is_environment {
                true => (self.environment)(name),
                false => self.values.get(name).cloned(),
            };
            if value.is_none() {
                let name: String = name.chars().take(MAX_SHOWN_NAME).collect();
                let what = match is_environment {
                    true => format!("the environment variable {name} is not set: it is empty"),
                    false => format!("no <var name=\"{name}\"> before: it is empty"),
                };
                problem = problem.or(Some(what));
            }
            let value = value.unwrap_or_default();
            let made = text.len() + value.len();
            let Some(left) = self.left.checked_sub(made) else {
                self.left = 0;
                return Replaced::nothing(
                    "the texts of the file become too long by their variables",
                );
            };
            self.left = left;
            text.replace_range(start..=end, &value);
        }
        Replaced::nothing("too many variables in one text, or one that contains itself")
    }
}

/// Returns begin, name and end of the next variable, and whether it is one of the environment.
fn next_variable(text: &str) -> Option<(usize, usize, usize, bool)> {
    let found = |(opening, is_environment): (&str, bool)| {
        let start = text.find(opening)?;
        let end = start + text[start..].find('}')?;
        Some((start, start + opening.len(), end, is_environment))
    };
    [("$ENV{", true), ("${", false)].into_iter().find_map(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn environment(name: &str) -> Option<String> {
        (name == "HOME").then(|| "/home/${user}".to_owned())
    }

    #[test]
    fn variables_are_replaced_also_in_what_they_stand_for() {
        let mut variables = TextVariables::new(&environment);
        variables.set("user", "icub".to_owned());
        let replaced = variables.replace("$ENV{HOME}/${user}/x}");
        assert_eq!(replaced.text, "/home/icub/icub/x}");
        assert_eq!(replaced.problem, None);
    }

    #[test]
    fn what_nothing_sets_is_empty_and_reported() {
        let mut variables = TextVariables::new(&environment);
        for (text, expected, problem) in [
            ("a${none}b", "ab", "no <var name=\"none\">"),
            ("a$ENV{NONE}b", "ab", "variable NONE is not set"),
            ("5 $", "5 $", "begins no ${NAME}"),
            ("a${open", "a${open", "begins no ${NAME}"),
        ] {
            let replaced = variables.replace(text);
            assert_eq!(replaced.text, expected);
            let found = replaced.problem.expect("it is reported");
            assert!(found.contains(problem), "{text}: {found}");
        }
        let long = format!("${{{}}}", "n".repeat(10_000));
        let found = variables.replace(&long).problem.expect("it is reported");
        assert!(found.len() < 200, "{found}");
    }

    /// Stock never returns from such a text.
    #[test]
    fn a_variable_that_contains_itself_ends() {
        let mut variables = TextVariables::new(&environment);
        variables.set("a", "${a}".to_owned());
        let replaced = variables.replace("${a}");
        assert_eq!(replaced.text, "");
        assert!(
            replaced
                .problem
                .is_some_and(|what| what.contains("contains itself"))
        );
        variables.set("x", "x".to_owned());
        let as_many = "${x}".repeat(MAX_REPLACEMENTS);
        assert_eq!(
            variables.replace(&as_many).text,
            "x".repeat(MAX_REPLACEMENTS)
        );
    }

    #[test]
    fn the_texts_of_a_file_are_bounded_together() {
        let mut variables = TextVariables::new(&environment);
        variables.set("long", "y".repeat(MAX_REPLACED_BYTES / 3));
        for _ in 0..2 {
            assert!(variables.replace("${long}").problem.is_none());
        }
        let replaced = variables.replace("${long}");
        assert_eq!(replaced.text, "");
        assert!(
            replaced
                .problem
                .is_some_and(|what| what.contains("too long"))
        );
        assert_eq!(variables.replace("plain").text, "plain");
    }
}
