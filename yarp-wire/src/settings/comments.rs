//! Comments after `//` and `#`.

/// Returns the line up to `//` anywhere, or to `#` at its start or after a blank, outside quotes.
///
/// Source: the same lines read by YARP 3.5.
pub fn strip_comment(line: &str) -> &str {
    let (mut quoted, mut before) = (false, ' ');
    for (at, c) in line.char_indices() {
        match c {
            '"' => quoted = !quoted,
            '/' if !quoted && before == '/' => return &line[..at - 1],
            '#' if !quoted && matches!(before, ' ' | '\t') => return &line[..at],
            _ => {}
        }
        before = c;
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_end_lines() {
        for (line, expected) in [
            ("a 1 // b", "a 1 "),
            ("a 1 # b", "a 1 "),
            ("# b", ""),
            ("a#b /c", "a#b /c"),
            ("\"a // b # c\" // d", "\"a // b # c\" "),
            ("//", ""),
        ] {
            assert_eq!(strip_comment(line), expected, "{line}");
        }
    }
}
