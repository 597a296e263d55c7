//! Permissions of peers on ports: `roles.conf`.
//!
//! ```text
//! [operators]                        # any word; it shows up in nothing but this file
//! ports   /wam /wam/*                # which ports this is about
//! from    /operator/* /joystick      # names that peers give themselves; missing: any
//! at      local 10.0.0.*             # addresses that they come from; missing: any
//! rights  read write connect administer
//!
//! [everybody]
//! ports   /wam/*
//! rights  read
//! ```
//!
//! | right | allows a peer to |
//! | --- | --- |
//! | `read` | receive the messages of the port |
//! | `write` | send messages and requests to the port |
//! | `connect` | make the port open and close connections |
//! | `administer` | change properties of the port, and its registration at the name server |
//!
//! `all` and `none` have their literal meaning. A `*` in a pattern matches any text, including
//! none; `local` matches any address of this machine. The rights of all matching roles add up. **A
//! port that no role names is open to every peer, and so are all ports without the file**, as in
//! stock; a named port is closed to peers without a matching role. Queries for the version and
//! connections of a port are always allowed.
//!
//! At a name server, queries need `read` on its own port (`/root`); registering, announcing or
//! unregistering a name or setting its properties needs `administer` on that name; `subscribe` and
//! topics need `connect` on the writer or the topic.
//!
//! The file is searched for like `auth.conf` ([`Directories::resources`]), and is reloaded when a
//! connection is accepted and the file has changed. Existing connections apply it from their next
//! message on; existing readers continue to receive. Connections that the owner of a port makes are
//! not restricted. If the file becomes invalid, or is removed, the previous roles remain in force,
//! and this is logged.
//!
//! The name is the peer's claim: with a key ([`crate::config`]) the peer holds at least the key,
//! without one it may be any host. Addresses are those of the connection.
//!
//! [`Directories::resources`]: crate::config::Directories::resources

mod name_pattern;
mod role_table;
mod roles_file;

use std::fmt;
use std::net::IpAddr;

pub use role_table::RoleTable;
pub use roles_file::Roles;

/// The name of the file.
pub(crate) const FILE: &str = "roles.conf";

/// Something that a peer may be allowed to do.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Right {
    /// To receive the messages of the port.
    Read,
    /// To send messages and requests.
    Write,
    /// To have the port make and end connections.
    Connect,
    /// To change properties and registration.
    Administer,
}

impl Right {
    const ALL: [Self; 4] = [Self::Read, Self::Write, Self::Connect, Self::Administer];

    fn word(self) -> &'static str {
        match self {
            Self::Read => "read",
            Self::Write => "write",
            Self::Connect => "connect",
            Self::Administer => "administer",
        }
    }
}

impl fmt::Display for Right {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

/// The rights of a peer.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct Rights(u8);

impl Rights {
    /// Everything.
    pub const ALL: Self = Self(0b1111);
    /// No rights.
    pub const NONE: Self = Self(0);

    /// Returns whether `right` is among them.
    pub fn has(self, right: Right) -> bool {
        self.0 & 1 << right as u8 != 0
    }

    /// Both together.
    pub(crate) fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl From<Right> for Rights {
    fn from(right: Right) -> Self {
        Self(1 << right as u8)
    }
}

/// A peer that sends requests.
#[derive(Clone, Copy, Debug)]
pub struct Peer<'a> {
    /// The name it claims.
    pub name: &'a str,
    /// Its address.
    pub address: IpAddr,
}

impl fmt::Display for Peer<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?} at {}", self.name, self.address)
    }
}

/// Returns the refusal for a peer without this right.
pub(crate) fn refusal(port: &str, peer: Peer<'_>, right: Right) -> String {
    format!("not allowed: {FILE} gives {peer} no right to {right} on {port}")
}
