//! Names with stars in them.

/// A text in which `*` stands for any text, also for none.
#[derive(Clone, Debug, Eq, PartialEq)]
pub(super) struct Pattern(String);

impl Pattern {
    pub(super) fn new(text: &str) -> Self {
        Self(text.to_owned())
    }

    pub(super) fn as_str(&self) -> &str {
        &self.0
    }

    /// Returns whether it matches `text`. Takes time proportional to the text and the pattern.
    pub(super) fn matches(&self, text: &str) -> bool {
        let mut parts = self.0.split('*');
        let first = parts.next().unwrap_or_default();
        let Some(mut rest) = text.strip_prefix(first) else {
            return false;
        };
        let Some(last) = parts.next_back() else {
            return rest.is_empty();
        };
        for part in parts {
            // The earliest match leaves the most text for the rest.
            let Some(at) = rest.find(part) else {
                return false;
            };
            rest = &rest[at + part.len()..];
        }
        rest.ends_with(last)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stars_stand_for_any_text() {
        for (pattern, yes, no) in [
            ("/wam", &["/wam"][..], &["/wam/", "/wa", "/x/wam", ""][..]),
            ("*", &["", "/a", "10.0.0.1"], &[]),
            ("/wam/*", &["/wam/", "/wam/a/b"], &["/wam", "x/wam/"]),
            ("*/rpc:i", &["/rpc:i", "/a/rpc:i"], &["/rpc:o", "/rpc:i/"]),
            (
                "/a*b*c",
                &["/abc", "/axbxbxc", "/abcc"],
                &["/ab", "/acb", "/bc"],
            ),
            ("/a*a", &["/aa", "/aba"], &["/a"]),
            ("**", &["", "x"], &[]),
            ("10.0.*", &["10.0.0.1"], &["110.0.0.1", "10.1.0.0"]),
            ("é*", &["éa"], &["e"]),
        ] {
            let pattern = Pattern::new(pattern);
            for text in yes {
                assert!(pattern.matches(text), "{pattern:?} is {text:?}");
            }
            for text in no {
                assert!(!pattern.matches(text), "{pattern:?} is not {text:?}");
            }
        }
    }

    /// Patterns that some matchers take forever over.
    #[test]
    fn many_stars_are_no_trouble() {
        let pattern = Pattern::new(&format!("{}b", "a*".repeat(1000)));
        assert!(!pattern.matches(&"a".repeat(10_000)));
    }
}
