//! Parses options that stock accepts anywhere among the words of a command.

use yarp_wire::Value;
use yarp_wire::settings::{Group, Settings};

use crate::listen_addresses::BindArgs;

/// Removes `option` from the words; returns true if it was there.
pub(super) fn take_flag(words: &mut Vec<String>, option: &str) -> bool {
    let before = words.len();
    words.retain(|word| word != option);
    words.len() < before
}

/// Removes `option` and the word after it; returns that word.
pub(super) fn take_value(words: &mut Vec<String>, option: &str) -> Option<String> {
    let index = words.iter().position(|word| word == option)?;
    words.remove(index);
    (index < words.len()).then(|| words.remove(index))
}

/// Options such as `--rate 50`, parsed like stock's `Property`.
pub(super) struct Options(Settings);

impl Options {
    pub(super) fn parse(words: &[String]) -> Self {
        let mut settings = Settings::new();
        settings.add_command_line(words);
        Self(settings)
    }

    /// Returns true if the option is present.
    pub(super) fn has(&self, name: &str) -> bool {
        self.0.has(name)
    }

    /// Returns the value of an option as text, if present.
    pub(super) fn text(&self, name: &str) -> Option<String> {
        self.value(name).map(|value| value.to_plain_string())
    }

    /// Returns the value of an option as a number, if present; 0 if it is no number, as in stock.
    pub(super) fn number(&self, name: &str) -> Option<f64> {
        self.value(name).map(|value| value.as_f64().unwrap_or(0.0))
    }

    /// Returns the value of an option, if present; an empty text if it has no value.
    pub(super) fn value(&self, name: &str) -> Option<Value> {
        let value = self.0.get(name).map(|setting| setting.value());
        value.or_else(|| self.has(name).then(|| "".into()))
    }

    /// Returns where ports are to listen.
    pub(super) fn bind(&self) -> Result<BindArgs, String> {
        BindArgs::from_settings(&self.0)
    }

    /// Returns all options as text.
    pub(super) fn described(&self) -> String {
        self.0.to_string()
    }

    /// Returns an option with all its values, if present.
    pub(super) fn group(&self, name: &str) -> Option<Group<'_>> {
        self.0.group(name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_parsed_by_type() {
        let words = [
            "/p", "--rate", "50", "--show", "--to", "/a", "/b", "--number", "x",
        ];
        let words = words.map(str::to_owned);
        let options = Options::parse(&words);
        assert_eq!(options.number("rate"), Some(50.0));
        assert_eq!(options.number("number"), Some(0.0));
        assert_eq!(options.number("nothing"), None);
        assert_eq!(options.text("to").as_deref(), Some("/a"));
        assert_eq!(options.text("show").as_deref(), Some(""));
        assert!(options.has("show") && !options.has("nothing"));
        assert_eq!(options.group("to").unwrap().values().len(), 2);
    }

    #[test]
    fn options_are_found_anywhere() {
        let mut words: Vec<String> = ["/w", "--type", "T", "/r", "--wait-connect"]
            .map(String::from)
            .into();
        assert!(take_flag(&mut words, "--wait-connect"));
        assert!(!take_flag(&mut words, "verbatim"));
        assert_eq!(take_value(&mut words, "--type").as_deref(), Some("T"));
        assert_eq!(take_value(&mut words, "--type"), None);
        assert_eq!(words, ["/w", "/r"]);
        let mut last = vec!["--type".to_owned()];
        assert_eq!(take_value(&mut last, "--type"), None);
        assert!(last.is_empty());
    }
}
