//! Limits of the registry, and the texts of refusals.

/// Maximum length of a port name, in bytes, as for the names in connection headers.
pub(super) const MAX_NAME_BYTES: usize = 999;
/// Maximum length of a carrier, host, key or mode, in bytes.
pub(super) const MAX_WORD_BYTES: usize = 255;
/// Maximum size of all keys and values of one port, in bytes.
pub(super) const MAX_PROPERTY_BYTES: usize = 64 << 10;
/// Longest name whose number is remembered after its port has gone, in bytes.
pub(super) const MAX_REMEMBERED_NAME: usize = 128;
/// Maximum number of persistent connections.
pub(super) const MAX_SUBSCRIPTIONS: usize = 4096;
/// Maximum number of topics, and of stored types.
pub(super) const MAX_TOPICS: usize = 4096;
/// Maximum length of the definition of a type or topic, in bytes.
pub(super) const MAX_DEFINITION_BYTES: usize = 16 << 10;
/// Maximum number of connections that one request starts or ends; a later `announce` does the rest.
pub(super) const MAX_LINKS_PER_REQUEST: usize = 4096;

/// Capacity of a name server for the data of clients. Each limit is a field of
/// [`ServerOptions::capacity`](crate::ServerOptions::capacity).
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub struct Capacity {
    /// Registered ports.
    pub names: usize,
    /// Registered ports that one address has registered.
    pub names_per_address: usize,
    /// Bytes of all names, properties, topics, types and persistent connections together.
    ///
    /// A server that shares its names with others holds them twice.
    pub memory: usize,
    /// Bytes of those that one address has asked for.
    pub memory_per_address: usize,
}

impl Capacity {
    /// So many names in so many bytes, half of either from one address.
    pub fn of(names: usize, memory: usize) -> Self {
        Self {
            names,
            names_per_address: names.div_ceil(2),
            memory,
            memory_per_address: memory.div_ceil(2),
        }
    }
}

impl Default for Capacity {
    /// 50 000 names in 64 MiB, half of either from one address.
    fn default() -> Self {
        Self::of(50_000, 64 << 20)
    }
}

/// Reason why the server refuses a request.
///
/// Stock has no such answers: it stores anything, and exits when the numbers run out.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Refusal {
    /// The name would be ambiguous in an answer.
    #[error("{name:?} cannot be a name: {reason}")]
    Name {
        /// Beginning of the name.
        name: String,
        /// Rule that the name breaks.
        reason: &'static str,
    },
    /// A carrier, host, key or mode would be ambiguous in an answer.
    #[error("{what} must be one word of 1 to {MAX_WORD_BYTES} bytes, got {found:?}")]
    Word {
        /// Meaning of the word.
        what: &'static str,
        /// Beginning of the word.
        found: String,
    },
    /// The number is no TCP port number.
    #[error("port number must be 1 to 65535, or 0 or -1 to have one chosen, got {found}")]
    Number {
        /// Number in the request.
        found: i64,
    },
    /// All port numbers are in use.
    #[error(
        "all port numbers from {first} to {last} are taken; unregister dead ports (yarp clean)"
    )]
    NoNumber {
        /// First number of the range.
        first: u32,
        /// Last number of the range.
        last: u32,
    },
    /// All multicast groups are in use.
    #[error("all multicast groups are taken")]
    NoGroup,
    /// The owner of the name is alive.
    #[error(
        "{name} belongs to a port that is there, at {host}:{port}; choose another name, or end that \
         port (by hand: yarp name unregister {name})"
    )]
    Taken {
        /// Name.
        name: String,
        /// Host of the owner.
        host: String,
        /// TCP port of the owner.
        port: u16,
    },
    /// A property that only the owner of a living port may change.
    #[error(
        "only {name} itself, at {host}:{port}, may change its property {key} while it lives; ask it \
         from there, or unregister it first"
    )]
    NotOwner {
        /// Name.
        name: String,
        /// Host of the owner.
        host: String,
        /// TCP port of the owner.
        port: u16,
        /// The property.
        key: String,
    },
    /// A carrier that would take the owner from a name, or give it one.
    #[error(
        "{name} is registered over {registered}, which {carrier} cannot replace; unregister it first"
    )]
    Ownership {
        /// Name.
        name: String,
        /// The carrier that it has.
        registered: String,
        /// The carrier that was asked for.
        carrier: String,
    },
    /// A limit is reached.
    #[error("the server holds at most {limit} {what}")]
    Full {
        /// Kind of entry.
        what: &'static str,
        /// Limit.
        limit: usize,
    },
}

/// Checks that `name` can be the name of a port, a topic or a type.
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

/// Checks that `found` is one word that can be part of an answer.
pub(super) fn check_word(what: &'static str, found: &str) -> Result<(), Refusal> {
    if (1..=MAX_WORD_BYTES).contains(&found.len()) && is_word(found) {
        return Ok(());
    }
    let found = beginning(found);
    Err(Refusal::Word { what, found })
}

/// Checks that `key` can be a property key: blanks are allowed, line ends are not.
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
