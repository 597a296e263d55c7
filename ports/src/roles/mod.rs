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
//! | `read` | be sent what the port writes |
//! | `write` | send messages and requests to the port |
//! | `connect` | have the port make and end connections |
//! | `administer` | change properties of the port, and its registration at the name server |
//!
//! With roles in force, a port that no role names makes and ends connections, and is administered, for programs of its own
//! machine alone; and it sends nobody copies of what it receives (`log.in`), since these come from its own address.
//! **`at local` trusts every port of this machine**: whoever may send to one of them that forwards what it gets, or may
//! connect one of them, acts from a local address. Name the sender (`from`), or give the port a key, where that matters.
//! `[atch]`, `[dtch]` and the scheduling of the process are for programs of the port's own machine unless a role names the
//! port, and never for pages.
//!
//! `all` and `none` stand for themselves. A `*` in a pattern is any text, also none; `local` is any
//! address of this machine. What all matching roles give adds up. **A port that no role names is open
//! to everybody, and so are all without the file**, as in stock; one that is named is closed to
//! whom no role lets in. Asking a port what it is, and who is connected, is always allowed.
//!
//! At a name server, looking up needs `read` on its own port (`/root`); to register, announce or
//! forget a name or to set its properties needs `administer` on that name; `subscribe` and topics
//! need `connect` on the writer or the topic.
//!
//! The file is looked for where `auth.conf` is ([`Directories::resources`]), and is read again when a
//! connection comes in and the file has changed. Connections that are there heed it from their next
//! message on; who reads already goes on reading. What the owner of a port connects itself is its own
//! decision. A file that is wrong, or gone, leaves what was last in force and says so in the log.
//!
//! A name is only what the peer says: with a key ([`crate::config`]) it is at least somebody who holds
//! the key, without one it is anybody. Addresses are those of the connection.
//!
//! [`Directories::resources`]: crate::config::Directories::resources

mod name_pattern;
mod role_table;
mod roles_file;

use std::fmt;
use std::net::IpAddr;

use crate::log_text::printable;

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
        write!(f, "\"{}\" at {}", printable(self.name), self.address)
    }
}

/// Returns the refusal for a peer without this right.
pub(crate) fn refusal(port: &str, peer: Peer<'_>, right: Right) -> String {
    format!("not allowed: {FILE} gives {peer} no right to {right} on {port}")
}
