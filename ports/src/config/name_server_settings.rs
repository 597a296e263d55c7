//! The file with the address of a name server.

use std::fmt;
use std::path::Path;

use super::ConfigError;

/// The address of a name server: the content of `yarp.conf`.
///
/// Two forms are read, one is written:
///
/// ```text
/// 192.0.2.2 10000 yarp        the usual form; the last word may be missing
/// ```
/// ```text
/// [name]
/// host 192.0.2.2
/// port 10000
/// mode yarp
/// ```
///
/// Further lines of the usual form are further addresses of the same names (`yarp server --store`);
/// stock ignores all but the first line (3.5.0, checked).
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct NameServer {
    /// Address or host name.
    pub host: String,
    /// TCP port.
    pub port: u16,
    /// The kind of server.
    pub mode: Mode,
    /// Host and TCP port of other servers of the same names.
    pub others: Vec<(String, u16)>,
}

/// The kind of server that a configuration names.
#[derive(Clone, Debug, Default, Eq, PartialEq)]
pub enum Mode {
    /// A YARP name server.
    #[default]
    Yarp,
    /// None: names are known inside the process only.
    Local,
    /// Another word: kept, and used like `yarp`, as stock does.
    Other(String),
}

const SHORT: &str = "`HOST PORT [MODE]`";

impl NameServer {
    /// A YARP name server.
    pub fn at(host: &str, port: u16) -> Self {
        Self {
            host: host.to_owned(),
            port,
            mode: Mode::Yarp,
            others: Vec::new(),
        }
    }

    /// Reads the text of `file`; `None` if it is empty.
    ///
    /// Stricter than stock, which takes `localhost` alone for no configuration and a port that is
    /// no number for 0; kinder to blank lines in front.
    pub fn parse(file: &Path, text: &str) -> Result<Option<Self>, ConfigError> {
        let mut lines = (1..).zip(text.lines().map(str::trim));
        let Some((number, line)) = lines.find(|(_, line)| !line.is_empty()) else {
            return Ok(None);
        };
        let wrong = |line, expected, found: &str| ConfigError::Line {
            file: file.to_owned(),
            line,
            expected,
            found: found.to_owned(),
        };
        if line.starts_with('[') {
            if line != "[name]" {
                return Err(wrong(number, "`[name]` or `HOST PORT [MODE]`", line));
            }
            return Self::parse_properties(lines, wrong).map(Some);
        }
        let mut words = line.split_whitespace();
        let (Some(host), Some(port)) = (words.next(), words.next()) else {
            return Err(wrong(number, SHORT, line));
        };
        let port = parse_port(port).ok_or_else(|| wrong(number, SHORT, line))?;
        Ok(Some(Self {
            host: host.to_owned(),
            port,
            mode: words.next().map_or(Mode::Yarp, Mode::from),
            others: lines.filter_map(|(_, line)| parse_other(line)).collect(),
        }))
    }

    fn parse_properties<'a>(
        lines: impl Iterator<Item = (usize, &'a str)>,
        wrong: impl Fn(usize, &'static str, &str) -> ConfigError,
    ) -> Result<Self, ConfigError> {
        let (mut host, mut port, mut mode) = (None, None, Mode::Yarp);
        let mut last = 1;
        for (number, line) in lines {
            last = number;
            if line.starts_with('[') {
                break;
            }
            let (key, value) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
            match (key, value.trim()) {
                // One word: anything else could not be written in the plain form.
                ("host", value)
                    if !value.is_empty()
                        && !value.starts_with('[')
                        && !value.contains(|c: char| c.is_whitespace() || c.is_control()) =>
                {
                    host = Some(value.to_owned());
                }
                ("host", _) => return Err(wrong(number, "`host HOST`", line)),
                ("port", value) => {
                    let value = parse_port(value);
                    port = Some(value.ok_or_else(|| wrong(number, "`port NUMBER`", line))?);
                }
                ("mode", value) if !value.is_empty() => mode = Mode::from(value),
                // Remarks and keys of others.
                _ => {}
            }
        }
        let missing = |expected| wrong(last, expected, "the end of the section");
        Ok(Self {
            host: host.ok_or_else(|| missing("`host HOST` below `[name]`"))?,
            port: port.ok_or_else(|| missing("`port NUMBER` below `[name]`"))?,
            mode,
            others: Vec::new(),
        })
    }
}

/// Parses `HOST PORT yarp`; other words belong to other kinds of server, and stock does not read
/// them either.
fn parse_other(line: &str) -> Option<(String, u16)> {
    let mut words = line.split_whitespace();
    let (host, port) = (words.next()?, parse_port(words.next()?)?);
    matches!(words.next(), Some("yarp")).then(|| (host.to_owned(), port))
}

fn parse_port(text: &str) -> Option<u16> {
    text.parse().ok().filter(|port| *port > 0)
}

impl From<&str> for Mode {
    fn from(word: &str) -> Self {
        match word {
            "yarp" => Self::Yarp,
            "local" => Self::Local,
            other => Self::Other(other.to_owned()),
        }
    }
}

impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Yarp => "yarp",
            Self::Local => "local",
            Self::Other(word) => word,
        })
    }
}

/// The content of the file, as stock writes it.
impl fmt::Display for NameServer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} {} {}", self.host, self.port, self.mode)?;
        for (host, port) in &self.others {
            writeln!(f, "{host} {port} yarp")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(text: &str, expected: &str) {
        let held = NameServer::parse(Path::new("f"), text).unwrap();
        let held = held.map(|server| server.to_string());
        assert_eq!(
            held.as_deref().unwrap_or_default().trim_end(),
            expected,
            "{text:?}"
        );
    }

    #[test]
    fn both_forms_are_read() {
        check("127.0.0.1 10310 yarp\n", "127.0.0.1 10310 yarp");
        check("127.0.0.1 10310", "127.0.0.1 10310 yarp");
        check(
            "  127.0.0.1\t10310  local extra\r\nmore",
            "127.0.0.1 10310 local",
        );
        check("robot 10310 ros", "robot 10310 ros");
        check("", "");
        check(" \n\n", "");
        check("[name]\nhost a\nport 5\nmode local\n", "a 5 local");
        check(
            "[name]\r\n\r\nport 5\r\n// host b\r\nhost a\r\n",
            "a 5 yarp",
        );
        check("[name]\nhost a\nport 5\n[other]\nhost b\n", "a 5 yarp");
    }

    #[test]
    fn further_lines_say_where_else_the_names_are_served() {
        let text = "a 10000 yarp\nb 10000 yarp\n\n# remark\nc 0 yarp\nd 7 local\nc 5 yarp\n";
        let held = NameServer::parse(Path::new("f"), text).unwrap().unwrap();
        let others = [("b".to_owned(), 10000), ("c".to_owned(), 5)];
        assert_eq!((held.host.as_str(), &held.others[..]), ("a", &others[..]));
        let again = NameServer::parse(Path::new("f"), &held.to_string());
        assert_eq!(again.unwrap(), Some(held));
    }

    #[track_caller]
    fn check_error(text: &str, expected: &str) {
        let error = NameServer::parse(Path::new("f"), text).unwrap_err();
        assert_eq!(error.to_string(), expected, "{text:?}");
    }

    #[test]
    fn errors_say_what_was_expected() {
        check_error("host", "f:1: expected `HOST PORT [MODE]`, got \"host\"");
        for line in ["a b yarp", "a 0", "a 65536", "a -4"] {
            check_error(
                line,
                &format!("f:1: expected `HOST PORT [MODE]`, got {line:?}"),
            );
        }
        check_error(
            "[yarp]\nhost a\nport 5\n",
            "f:1: expected `[name]` or `HOST PORT [MODE]`, got \"[yarp]\"",
        );
        check_error(
            "[name]\nhost a\n",
            "f:2: expected `port NUMBER` below `[name]`, got \"the end of the section\"",
        );
        check_error(
            "[name]\nport x\n",
            "f:2: expected `port NUMBER`, got \"port x\"",
        );
    }
}
