//! Variables in lines.

/// Returns the line with `$NAME`, `${NAME}` and `$(NAME)` replaced by the result of `variable`,
/// which may be empty.
///
/// A backslash disables the meaning of the next character, and remains. Backslashes of a value are
/// doubled, since the line is parsed as a bottle afterwards.
pub(super) fn expand(line: &str, variable: impl Fn(&str) -> String) -> String {
    if !line.contains('$') {
        return line.to_owned();
    }
    let mut out = String::with_capacity(line.len());
    let mut name: Option<Name> = None;
    let mut escaped = false;
    for c in line.chars().map(Some).chain([None]) {
        if std::mem::take(&mut escaped) {
            match &mut name {
                None => {
                    out.push('\\');
                    out.extend(c);
                }
                Some(name) => name.text.extend(c),
            }
            continue;
        }
        if c == Some('\\') {
            escaped = true;
            continue;
        }
        if let Some(reading) = &mut name {
            match c {
                Some(c) if c.is_ascii_alphanumeric() || c == '_' => {
                    reading.text.push(c);
                    continue;
                }
                Some('(' | '{') if reading.text.is_empty() => {
                    reading.in_brackets = true;
                    continue;
                }
                _ => {}
            }
            out.push_str(&variable(&reading.text).replace('\\', "\\\\"));
            let closes = reading.in_brackets && matches!(c, Some(')' | '}'));
            name = None;
            if closes {
                continue;
            }
        }
        match c {
            Some('$') => name = Some(Name::default()),
            other => out.extend(other),
        }
    }
    out
}

#[derive(Default)]
struct Name {
    text: String,
    in_brackets: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variables_are_replaced() {
        let value = |name: &str| match name {
            "A" => "one".to_owned(),
            "B" => "c:\\x".to_owned(),
            _ => String::new(),
        };
        for (line, expected) in [
            ("k $A", "k one"),
            ("k ${A}b $(A)b $A/b", "k oneb oneb one/b"),
            ("k $A$A.", "k oneone."),
            ("k $B", "k c:\\\\x"),
            ("k [$NONE]", "k []"),
            ("k \\$A", "k \\$A"),
            ("k $", "k "),
        ] {
            assert_eq!(expand(line, value), expected, "{line}");
        }
    }
}
