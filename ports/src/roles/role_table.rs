//! The content of a `roles.conf`.

use std::path::Path;

use yarp_wire::Value;

use super::name_pattern::Pattern;
use super::{Peer, Right, Rights};
use crate::addresses;
use crate::config::ConfigError;
use crate::config::section::{self, Entry, Section};

/// All roles of a file. Without any, everything is open.
#[derive(Clone, Debug, Default)]
pub struct RoleTable {
    roles: Vec<Role>,
}

#[derive(Clone, Debug)]
struct Role {
    ports: Vec<Pattern>,
    /// Names; none is any.
    from: Option<Vec<Pattern>>,
    /// Addresses; none is any.
    at: Option<Vec<Pattern>>,
    rights: Rights,
}

/// The addresses of this machine.
const LOCAL: &str = "local";

impl RoleTable {
    /// Reads the text of `file`.
    pub fn parse(file: &Path, text: &str) -> Result<Self, ConfigError> {
        let sections = section::parse(file, text)?;
        let roles = sections.iter().map(|section| role(file, section));
        let roles = roles.collect::<Result<_, _>>()?;
        Ok(Self { roles })
    }

    /// Returns whether there is no role in it.
    pub fn is_empty(&self) -> bool {
        self.roles.is_empty()
    }

    /// Returns whether a role names `port`.
    pub fn names(&self, port: &str) -> bool {
        let names = |role: &Role| role.ports.iter().any(|pattern| pattern.matches(port));
        self.roles.iter().any(names)
    }

    /// Returns what `peer` may have `port` itself do: as [`RoleTable::rights`], but with roles of which none names the
    /// port, peers of other machines may neither connect nor administer it.
    pub(crate) fn rights_at_port(&self, port: &str, peer: Peer<'_>) -> Rights {
        let open = self.is_empty() || self.names(port) || addresses::is_local(peer.address);
        match open {
            true => self.rights(port, peer),
            false => Rights::from(Right::Read).and(Right::Write.into()),
        }
    }

    /// Returns the rights of `peer` on `port`.
    pub fn rights(&self, port: &str, peer: Peer<'_>) -> Rights {
        let mut named = false;
        let mut rights = Rights::NONE;
        for role in &self.roles {
            if role.ports.iter().any(|pattern| pattern.matches(port)) {
                named = true;
                if role.is_for(peer) {
                    rights = rights.and(role.rights);
                }
            }
        }
        if named { rights } else { Rights::ALL }
    }
}

impl Role {
    fn is_for(&self, peer: Peer<'_>) -> bool {
        let from = |patterns: &Vec<Pattern>| patterns.iter().any(|name| name.matches(peer.name));
        let address = peer.address.to_canonical();
        let text = address.to_string();
        let at = |patterns: &Vec<Pattern>| {
            patterns.iter().any(|pattern| match pattern.as_str() {
                LOCAL => addresses::is_local(address),
                _ => pattern.matches(&text),
            })
        };
        self.from.as_ref().is_none_or(from) && self.at.as_ref().is_none_or(at)
    }
}

fn role(file: &Path, section: &Section) -> Result<Role, ConfigError> {
    let wrong = |entry: &Entry, expected| ConfigError::Line {
        file: file.to_owned(),
        line: entry.line,
        expected,
        found: entry.text.clone(),
    };
    let (mut ports, mut from, mut at, mut rights) = (None, None, None, None);
    for entry in &section.entries {
        let patterns = |slot: &mut Option<Vec<Pattern>>, expected| {
            let words = words(entry).ok_or_else(|| wrong(entry, expected))?;
            if words.is_empty() || slot.is_some() {
                return Err(wrong(entry, expected));
            }
            *slot = Some(words.iter().map(|word| Pattern::new(word)).collect());
            Ok(())
        };
        match entry.key.as_str() {
            "ports" => patterns(&mut ports, "`ports NAME…`, once in a section")?,
            "from" => patterns(&mut from, "`from NAME…`, once in a section")?,
            "at" => patterns(&mut at, "`at ADDRESS…`, once in a section")?,
            "rights" if rights.is_none() => {
                let known = words(entry).and_then(|words| parse_rights(&words));
                let expected = "`rights` and some of `read write connect administer all none`";
                rights = Some(known.ok_or_else(|| wrong(entry, expected))?);
            }
            _ => return Err(wrong(entry, "`ports`, `from`, `at` or `rights`, each once")),
        }
    }
    let missing = |expected| ConfigError::Line {
        file: file.to_owned(),
        line: section.line,
        expected,
        found: format!("section [{}] without it", section.name),
    };
    Ok(Role {
        ports: ports.ok_or_else(|| missing("`ports NAME…` in the section"))?,
        from,
        at,
        rights: rights.ok_or_else(|| missing("`rights RIGHT…` in the section"))?,
    })
}

/// Returns the values of a line as words; addresses read as numbers, too.
fn words(entry: &Entry) -> Option<Vec<String>> {
    let word = |value: &Value| match value {
        Value::List(_) | Value::Dictionary(_) => None,
        value => Some(value.to_plain_string()),
    };
    entry.values.iter().map(word).collect()
}

fn parse_rights(words: &[String]) -> Option<Rights> {
    let right = |word: &String| match word.as_str() {
        "all" => Some(Rights::ALL),
        "none" => Some(Rights::NONE),
        word => {
            let known = Right::ALL.into_iter().find(|right| right.word() == word);
            known.map(Rights::from)
        }
    };
    let rights: Option<Vec<_>> = words.iter().map(right).collect();
    rights?.into_iter().reduce(Rights::and)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "
        # The arm.
[operators]
ports /wam /wam/*
from \"/operator/*\" /joystick
at 10.0.0.* 192.0.2.7
rights read write connect administer
[watchers]
ports /wam/*
rights read
[closed]
ports /secret
rights none
[here]
ports /here
at local
rights all
";

    fn shown(rights: Rights) -> String {
        let held = Right::ALL.into_iter().filter(|right| rights.has(*right));
        held.map(|right| &right.word()[..1]).collect()
    }

    #[test]
    fn rights_of_all_matching_roles_add_up() {
        let table = RoleTable::parse(Path::new("f"), TEXT).unwrap();
        for (port, name, address, expected) in [
            ("/wam/rpc:i", "/operator/1", "10.0.0.3", "rwca"),
            ("/wam/rpc:i", "/joystick", "192.0.2.7", "rwca"),
            ("/wam/rpc:i", "/joystick", "::ffff:192.0.2.7", "rwca"),
            ("/wam/rpc:i", "/joystick", "192.0.2.8", "r"),
            ("/wam/rpc:i", "/joystick2", "192.0.2.7", "r"),
            ("/wam", "/joystick2", "192.0.2.7", ""),
            ("/secret", "/operator/1", "10.0.0.3", ""),
            ("/other", "", "::1", "rwca"),
            ("/here", "admin", "127.0.0.1", "rwca"),
            ("/here", "admin", "::1", "rwca"),
            ("/here", "admin", "203.0.113.9", ""),
        ] {
            let address = address.parse().unwrap();
            let rights = table.rights(port, Peer { name, address });
            assert_eq!(shown(rights), expected, "{port} {name} {address}");
        }
    }

    #[test]
    fn without_roles_all_is_open() {
        for text in ["", "\n# nothing\n"] {
            let table = RoleTable::parse(Path::new("f"), text).unwrap();
            let peer = Peer {
                name: "/x",
                address: [203, 0, 113, 9].into(),
            };
            assert_eq!(table.rights("/wam", peer), Rights::ALL);
        }
    }

    #[test]
    fn ports_without_roles_are_connected_and_administered_from_here() {
        let table = RoleTable::parse(Path::new("f"), TEXT).unwrap();
        let none = RoleTable::default();
        for (port, address, expected) in [
            ("/other", "203.0.113.9", "rw"),
            ("/other", "127.0.0.1", "rwca"),
            ("/wam/rpc:i", "10.0.0.3", "rwca"),
            ("/secret", "127.0.0.1", ""),
        ] {
            let peer = Peer {
                name: "/joystick",
                address: address.parse().unwrap(),
            };
            assert_eq!(shown(table.rights_at_port(port, peer)), expected, "{port}");
            assert_eq!(none.rights_at_port(port, peer), Rights::ALL);
        }
        assert!(table.names("/wam/x") && !table.names("/other") && !none.names("/wam"));
    }

    #[test]
    fn errors_say_what_was_expected() {
        for (text, expected) in [
            (
                "[a]\nports /x",
                "f:1: expected `rights RIGHT…` in the section",
            ),
            (
                "[a]\nrights all",
                "f:1: expected `ports NAME…` in the section",
            ),
            (
                "[a]\nports\nrights all",
                "f:2: expected `ports NAME…`, once",
            ),
            (
                "[a]\nports /x\nports /y\nrights all",
                "f:3: expected `ports NAME…`, once",
            ),
            (
                "[a]\nports (/x)\nrights all",
                "f:2: expected `ports NAME…`, once",
            ),
            (
                "[a]\nports /x\nrights",
                "f:3: expected `rights` and some of",
            ),
            (
                "[a]\nports /x\nrights reed",
                "f:3: expected `rights` and some of",
            ),
            (
                "[a]\nports /x\nrights all\nrights none",
                "f:4: expected `ports`, `from`",
            ),
            ("[a]\nports /x\nright all", "f:3: expected `ports`, `from`"),
        ] {
            let error = RoleTable::parse(Path::new("f"), text).unwrap_err();
            assert!(error.to_string().starts_with(expected), "{error}");
        }
    }
}
