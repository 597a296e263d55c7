//! What one port may make the server hold, and the words of a refusal.

/// Longest name of a port, as for the names that travel in connection headers.
pub(super) const MAX_NAME_BYTES: usize = 999;
/// Longest carrier, host, key or mode, in bytes.
pub(super) const MAX_WORD_BYTES: usize = 255;
/// All keys and values of one port together, in bytes.
pub(super) const MAX_PROPERTY_BYTES: usize = 64 << 10;
/// Registered ports.
pub(super) const MAX_PORTS: usize = 50_000;
/// PersistentConnections connections.
pub(super) const MAX_SUBSCRIPTIONS: usize = 4096;
/// Topics, and stored types.
pub(super) const MAX_TOPICS: usize = 4096;
/// Longest definition of a type or topic, in bytes.
pub(super) const MAX_DEFINITION_BYTES: usize = 16 << 10;
/// Connections that one request can start or end; a later `announce` does the rest.
pub(super) const MAX_LINKS_PER_REQUEST: usize = 4096;

/// Why the server does not do what it was asked.
///
/// Stock has no such answers: it stores anything, and exits when the numbers run out.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Refusal {
    /// A name that could not be told from others in an answer.
    #[error("{name:?} cannot be a name: {reason}")]
    Name {
        /// The beginning of the name.
        name: String,
        /// The rule that it breaks.
        reason: &'static str,
    },
    /// A carrier, host, key or mode that could not be told from others in an answer.
    #[error("{what} must be one word of 1 to {MAX_WORD_BYTES} bytes, got {found:?}")]
    Word {
        /// What the word is for.
        what: &'static str,
        /// The beginning of the word.
        found: String,
    },
    /// A number that no TCP port has.
    #[error("port number must be 1 to 65535, or 0 or -1 to have one chosen, got {found}")]
    Number {
        /// What was asked for.
        found: i64,
    },
    /// No port number left to hand out.
    #[error(
        "all port numbers from {first} to {last} are taken; unregister dead ports (yarp clean)"
    )]
    NoNumber {
        /// Start of the range.
        first: u32,
        /// End of the range.
        last: u32,
    },
    /// No multicast group left to hand out.
    #[error("all multicast groups are taken")]
    NoGroup,
    /// A name whose owner lives.
    #[error(
        "{name} belongs to a port that is there, at {host}:{port}; choose another name, or end that \
         port (by hand: yarp name unregister {name})"
    )]
    Taken {
        /// The name.
        name: String,
        /// Where its owner is.
        host: String,
        /// Where its owner is.
        port: u16,
    },
    /// A store is full.
    #[error("the server holds at most {limit} {what}")]
    Full {
        /// What there are too many of.
        what: &'static str,
        /// How many may be held.
        limit: usize,
    },
}

/// Whether `name` can stand for a port, a topic or a type.
pub(super) fn check_name(name: &str) -> Result<(), Refusal> {
    let scheme = name.split(":/").next().unwrap_or_default();
    let reason = if name.is_empty() {
        "it is empty"
    } else if name.len() > MAX_NAME_BYTES {
        "it has more than 999 bytes"
    } else if !is_word(name) {
        "it holds a blank, a quote or a control character"
    } else if scheme.len() < name.len() && !scheme.contains('/') {
        "it has a carrier in front"
    } else {
        return Ok(());
    };
    let name = beginning(name);
    Err(Refusal::Name { name, reason })
}

/// Whether `found` is one word that can stand in an answer.
pub(super) fn check_word(what: &'static str, found: &str) -> Result<(), Refusal> {
    if (1..=MAX_WORD_BYTES).contains(&found.len()) && is_word(found) {
        return Ok(());
    }
    let found = beginning(found);
    Err(Refusal::Word { what, found })
}

/// Whether `key` can be that of a property: blanks are allowed, line ends are not.
pub(super) fn check_key(key: &str) -> Result<(), Refusal> {
    if key.len() <= MAX_WORD_BYTES && !key.contains(char::is_control) {
        return Ok(());
    }
    let found = beginning(key);
    Err(Refusal::Word { what: "key", found })
}

fn is_word(text: &str) -> bool {
    let stray = |c: char| c.is_whitespace() || c.is_control() || c == '"';
    !text.contains(stray)
}

fn beginning(text: &str) -> String {
    text.chars().take(80).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_answers_can_hold() {
        for good in ["/a", "fallback", "/a/b:o", "/a=b", "/é", "/slash/", "/a:/b"] {
            assert_eq!(check_name(good), Ok(()), "{good}");
        }
        let long = "/".repeat(1000);
        for bad in ["", "/a b", "/a\r\n*", "\"/a\"", "tcp://a", "udp:/a", &long] {
            assert!(check_name(bad).is_err(), "{bad}");
        }
    }
}
