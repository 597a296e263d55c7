//! What a server tells about its machine (`--sysinfo`).
//!
//! The message is no bottle, and has no length: numbers and lines in a fixed order, the same in YARP 3.x and 4.0. Lines end with
//! CR and LF. Source: `SystemInfoSerializer.cpp`, `SystemInfo.cpp` and `Run.cpp` of YARP 3.5.

use std::fmt;
use std::fs;

use bytes::{BufMut, BytesMut};
use yarp_wire::WireVersion;
use yarp_wire::message::WireObject;

/// Maximum length of a line, which stock's environment variables fill.
const MAX_LINE: usize = 1 << 20;
/// Bytes in a MB.
const MEGABYTE: u64 = 1 << 20;

/// A value of the message.
#[derive(Clone, Debug, PartialEq)]
enum Field {
    Int(i32),
    Float(f64),
    Line(String),
}

/// Kind of a value.
#[derive(Clone, Copy, Debug)]
enum Kind {
    Int,
    Float,
    Line,
}

use Kind::{Float, Int, Line};

/// Name and kind of each value, in the order of the message.
const LAYOUT: [(&str, Kind); 26] = [
    ("memory total", Int),
    ("memory free", Int),
    ("storage total", Int),
    ("storage free", Int),
    ("arch", Line),
    ("model", Line),
    ("vendor", Line),
    ("family", Int),
    ("model num", Int),
    ("cores", Int),
    ("siblings", Int),
    ("Mhz", Float),
    ("load 1", Float),
    ("load 5", Float),
    ("load 15", Float),
    ("load instant", Int),
    ("platform", Line),
    ("dist", Line),
    ("release", Line),
    ("code", Line),
    ("kernel", Line),
    ("environment", Line),
    ("user name", Line),
    ("real name", Line),
    ("home", Line),
    ("user id", Int),
];

/// Description of a machine and of the user of a server.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SystemInformation(Vec<Field>);

impl SystemInformation {
    /// Describes this machine; what cannot be found out is 0 or empty.
    ///
    /// The environment stays empty: it often contains passwords, which stock tells everybody.
    pub(super) fn of_this_machine() -> Self {
        let text = |file: &str| fs::read_to_string(file).unwrap_or_default();
        let memory = text("/proc/meminfo");
        let processor = text("/proc/cpuinfo");
        let system = text("/etc/os-release");
        let load = text("/proc/loadavg");
        let kernel = |name: &str| text(&format!("/proc/sys/kernel/{name}")).trim().to_owned();
        let id = rustix::process::getuid().as_raw();
        let user = User::of(&text("/etc/passwd"), id);
        let home = if user.home.is_empty() {
            "/home"
        } else {
            &user.home
        };
        let storage = rustix::fs::statvfs(home).ok();
        let megabytes = |blocks: u64, size: u64| {
            clamped((blocks as u128 * size as u128 / u128::from(MEGABYTE)) as u64)
        };
        let storage = storage.map(|found| {
            (
                megabytes(found.f_blocks, found.f_frsize),
                megabytes(found.f_bavail, found.f_frsize),
            )
        });
        let (total, free) = storage.unwrap_or_default();
        let of_memory = |name| {
            let kilobytes = entry(&memory, name, ':').split(' ').next();
            clamped(
                kilobytes
                    .and_then(|text| text.parse::<u64>().ok())
                    .unwrap_or(0)
                    / 1024,
            )
        };
        let of_processor = |name| entry(&processor, name, ':').to_owned();
        let number = |name| of_processor(name).parse().unwrap_or(0);
        let of_system = |name| entry(&system, name, '=').trim_matches('"').to_owned();
        let mut loads = load.split(' ').map(|word| word.parse().unwrap_or(0.0));
        let mut next_load = || loads.next().unwrap_or(0.0);
        let running = load
            .split(' ')
            .nth(3)
            .and_then(|word| word.split('/').next()?.parse().ok());
        let line = |text: String| Field::Line(text.replace(['\r', '\n'], " "));
        Self(vec![
            Field::Int(of_memory("MemTotal")),
            Field::Int(of_memory("MemFree")),
            Field::Int(total),
            Field::Int(free),
            line(std::env::consts::ARCH.to_owned()),
            line(of_processor("model name")),
            line(of_processor("vendor_id")),
            Field::Int(number("cpu family")),
            Field::Int(number("model")),
            Field::Int(number("cpu cores")),
            Field::Int(number("siblings")),
            Field::Float(of_processor("cpu MHz").parse().unwrap_or(0.0)),
            Field::Float(next_load()),
            Field::Float(next_load()),
            Field::Float(next_load()),
            // This program does not count.
            Field::Int(running.unwrap_or(1) - 1),
            line(kernel("ostype")),
            line(of_system("NAME")),
            line(of_system("VERSION_ID")),
            line(of_system("VERSION_CODENAME")),
            line(kernel("osrelease")),
            line(String::new()),
            line(user.name),
            line(user.real_name),
            line(user.home),
            Field::Int(clamped(u64::from(id))),
        ])
    }

    /// Returns the description that `bytes` begin with, and its length; `None` while bytes are missing.
    ///
    /// Errors, in words: a line that is too long.
    pub(super) fn parse(bytes: &[u8]) -> Result<Option<(Self, usize)>, String> {
        let mut fields = Vec::with_capacity(LAYOUT.len());
        let mut rest = bytes;
        for (name, kind) in LAYOUT {
            let field = match kind {
                Int => take(&mut rest).map(|bytes| Field::Int(i32::from_le_bytes(bytes))),
                Float => take(&mut rest).map(|bytes| Field::Float(f64::from_le_bytes(bytes))),
                Line => {
                    let searched = &rest[..rest.len().min(MAX_LINE)];
                    let end = searched.iter().position(|byte| *byte == b'\n');
                    if end.is_none() && rest.len() >= MAX_LINE {
                        return Err(format!("{name} has more than {MAX_LINE} bytes"));
                    }
                    end.map(|end| {
                        let line = rest[..end].strip_suffix(b"\r").unwrap_or(&rest[..end]);
                        let line = Field::Line(String::from_utf8_lossy(line).into_owned());
                        rest = &rest[end + 1..];
                        line
                    })
                }
            };
            match field {
                Some(field) => fields.push(field),
                None => return Ok(None),
            }
        }
        Ok(Some((Self(fields), bytes.len() - rest.len())))
    }

    fn field(&self, name: &str) -> &Field {
        let place = LAYOUT.iter().position(|(known, _)| *known == name);
        &self.0[place.expect("it is in the layout")]
    }
}

/// Takes bytes from the front.
fn take<const N: usize>(rest: &mut &[u8]) -> Option<[u8; N]> {
    let (taken, after) = rest.split_first_chunk::<N>()?;
    *rest = after;
    Some(*taken)
}

fn clamped(number: u64) -> i32 {
    i32::try_from(number).unwrap_or(i32::MAX)
}

/// Returns the last value of `NAME: VALUE` lines; empty if there is none.
fn entry<'t>(text: &'t str, name: &str, separator: char) -> &'t str {
    let mut values = text.lines().filter_map(|line| {
        let (known, value) = line.split_once(separator)?;
        (known.trim() == name).then_some(value.trim())
    });
    values.next_back().unwrap_or_default()
}

/// A line of `/etc/passwd`.
#[derive(Debug, Default, PartialEq)]
struct User {
    name: String,
    real_name: String,
    home: String,
}

impl User {
    fn of(passwd: &str, id: u32) -> Self {
        let fields = passwd
            .lines()
            .map(|line| line.split(':').collect::<Vec<_>>());
        let mut users = fields.filter_map(|fields| match fields[..] {
            [name, _, number, _, real_name, home, ..] if number.parse() == Ok(id) => Some(Self {
                name: name.to_owned(),
                real_name: real_name.to_owned(),
                home: home.to_owned(),
            }),
            _ => None,
        });
        users.next().unwrap_or_default()
    }
}

impl WireObject for SystemInformation {
    fn write_binary(&self, out: &mut BytesMut, _wire_version: WireVersion) {
        for field in &self.0 {
            match field {
                Field::Int(number) => out.put_i32_le(*number),
                Field::Float(number) => out.put_f64_le(*number),
                Field::Line(line) => {
                    out.put_slice(line.as_bytes());
                    out.put_slice(b"\r\n");
                }
            }
        }
    }

    /// Writes the same as in binary, as stock does.
    fn write_text(&self, out: &mut BytesMut) {
        self.write_binary(out, WireVersion::default());
    }
}

impl fmt::Display for Field {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Int(number) => write!(f, "{number}"),
            Self::Float(number) => write!(f, "{number:.2}"),
            Self::Line(line) => {
                line.chars()
                    .try_for_each(|character| match character.is_control() {
                        true => write!(f, "{}", character.escape_debug()),
                        false => write!(f, "{character}"),
                    })
            }
        }
    }
}

/// Prints the description as stock's client does.
impl fmt::Display for SystemInformation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let field = |name| self.field(name);
        writeln!(f, "Platform name    : {}", field("platform"))?;
        writeln!(f, "Platform dist    : {}", field("dist"))?;
        writeln!(f, "Platform release : {}", field("release"))?;
        writeln!(f, "Platform code    : {}", field("code"))?;
        writeln!(f, "Platform kernel  : {}\n", field("kernel"))?;
        writeln!(f, "User Id        : {}", field("user id"))?;
        writeln!(f, "User name      : {}", field("user name"))?;
        writeln!(f, "User real name : {}", field("real name"))?;
        writeln!(f, "User home dir  : {}\n", field("home"))?;
        writeln!(f, "Cpu load Ins.: {}", field("load instant"))?;
        writeln!(f, "Cpu load 1   : {}", field("load 1"))?;
        writeln!(f, "Cpu load 5   : {}", field("load 5"))?;
        writeln!(f, "Cpu load 15  : {}\n", field("load 15"))?;
        writeln!(f, "Memory total : {}M", field("memory total"))?;
        writeln!(f, "Memory free  : {}M\n", field("memory free"))?;
        writeln!(f, "Storage total : {}M", field("storage total"))?;
        writeln!(f, "Storage free  : {}M\n", field("storage free"))?;
        writeln!(f, "Processor model     : {}", field("model"))?;
        writeln!(f, "Processor model num : {}", field("model num"))?;
        writeln!(f, "Processor family    : {}", field("family"))?;
        writeln!(f, "Processor vendor    : {}", field("vendor"))?;
        writeln!(f, "Processor arch      : {}", field("arch"))?;
        writeln!(f, "Processor cores     : {}", field("cores"))?;
        writeln!(f, "Processor siblings  : {}", field("siblings"))?;
        writeln!(f, "Processor Mhz       : {}\n", field("Mhz"))?;
        writeln!(f, "Environment variables  :\n{}", field("environment"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bytes_of(information: &SystemInformation) -> Vec<u8> {
        let mut bytes = BytesMut::new();
        information.write_binary(&mut bytes, WireVersion::V3);
        bytes.to_vec()
    }

    #[test]
    fn what_is_written_is_read_once_it_is_whole() {
        let information = SystemInformation::of_this_machine();
        let mut bytes = bytes_of(&information);
        for end in 0..bytes.len() {
            assert_eq!(SystemInformation::parse(&bytes[..end]), Ok(None), "{end}");
        }
        let length = bytes.len();
        // An acknowledgement may follow.
        bytes.extend_from_slice(b"YA\0\0\0\0RP");
        let read = SystemInformation::parse(&bytes).unwrap().unwrap();
        assert_eq!(read, (information, length));
    }

    #[test]
    fn lines_are_bounded() {
        let mut bytes = vec![0; 16];
        bytes.resize(16 + MAX_LINE - 1, b'a');
        assert_eq!(SystemInformation::parse(&bytes), Ok(None));
        bytes.push(b'a');
        assert!(SystemInformation::parse(&bytes).is_err());
    }

    #[test]
    fn files_of_the_system_are_read() {
        assert_eq!(
            entry(
                "model\t: 85\nmodel name\t: Some (R)\nmodel\t: 86\n",
                "model",
                ':'
            ),
            "86"
        );
        assert_eq!(entry("A=1\n", "B", '='), "");
        let passwd = "root:x:0:0:root:/root:/bin/sh\nme:x:7:7:My Name,,,:/home/me:/bin/sh\n";
        let user = User::of(passwd, 7);
        assert_eq!(
            (
                user.name.as_str(),
                user.real_name.as_str(),
                user.home.as_str()
            ),
            ("me", "My Name,,,", "/home/me")
        );
        assert_eq!(User::of(passwd, 8), User::default());
        let text = SystemInformation::of_this_machine().to_string();
        assert!(text.contains("Platform name    : Linux\n"), "{text}");
        assert!(!text.contains("Memory total : 0M"), "{text}");
        assert!(text.ends_with("Environment variables  :\n\n"), "{text}");
    }
}
