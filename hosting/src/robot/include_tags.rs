//! Tags that select included files, as in 4.0.

use yarp_wire::Bottle;
use yarp_wire::settings::Settings;

/// Returns true if a file is included: with `enabled_by` only if one of the tags is given with
/// `--enable_tags` (or all are, with `enable_all`), and never if one of `disabled_by` is given with
/// `--disable_tags`.
pub(super) fn enabled(enabled_by: &[String], disabled_by: &[String], given: &Settings) -> bool {
    let (on, off) = (tags(given, "enable_tags"), tags(given, "disable_tags"));
    let all = on.iter().any(|tag| tag == "enable_all");
    let wanted = enabled_by.is_empty() || all || enabled_by.iter().any(|tag| on.contains(tag));
    wanted && !disabled_by.iter().any(|tag| off.contains(tag))
}

/// Returns the words of `cams` or `(cams arm)`.
pub(super) fn words(text: &str) -> Vec<String> {
    let items = Bottle::parse(text).unwrap_or_default();
    items.iter().map(|item| item.to_plain_string()).collect()
}

fn tags(given: &Settings, name: &str) -> Vec<String> {
    let tags = given.get(name).map(|tags| tags.to_plain_string());
    words(&tags.unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tags_switch_files_on_and_off() {
        let check = |by: &str, not_by: &str, line: &str, expected: bool| {
            let mut given = Settings::new();
            given.add_command_line(line.split(';'));
            let found = enabled(&words(by), &words(not_by), &given);
            assert_eq!(found, expected, "{by} {not_by} {line}");
        };
        check("", "", "", true);
        check("cams", "", "", false);
        check("cams arm", "", "--enable_tags;(legs arm)", true);
        check("cams", "", "--enable_tags;enable_all", true);
        check("", "nocams", "--disable_tags;(nocams)", false);
        check(
            "cams",
            "nocams",
            "--enable_tags;cams;--disable_tags;nocams",
            false,
        );
    }
}
