//! Options that stock takes anywhere among the words of a command.

/// Takes `option` out of the words; tells whether it was there.
pub(super) fn take_flag(words: &mut Vec<String>, option: &str) -> bool {
    let before = words.len();
    words.retain(|word| word != option);
    words.len() < before
}

/// Takes `option` and the word after it out of the words; gives that word.
pub(super) fn take_value(words: &mut Vec<String>, option: &str) -> Option<String> {
    let index = words.iter().position(|word| word == option)?;
    words.remove(index);
    (index < words.len()).then(|| words.remove(index))
}

#[cfg(test)]
mod tests {
    use super::*;

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
