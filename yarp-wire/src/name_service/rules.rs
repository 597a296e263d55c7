//! Types of the rules that depend on the command alone.
//!
//! The table itself is [`Command::rules`](super::Command::rules), in `command.rs`. Access checks, the
//! store that several servers share, the probe of the holder of a name, the choice between a reply
//! of lines and of one bottle, and the replies to datagrams are all derived from it.

use super::registering::{LeaseHolder, RegisterRequest};

/// Rules that depend on the command alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rules<'a> {
    /// Effect of the command on the server.
    pub kind: Kind<'a>,
    /// Right that the roles in force must grant.
    pub needs: Needs<'a>,
    /// True if stock replies with a bottle although not asked for one.
    pub structured: bool,
}

/// Effect of a command on the server.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind<'a> {
    /// It changes nothing.
    Question {
        /// True if a server that is found by multicast also replies to it by a datagram.
        by_datagram: bool,
        /// True if the length of the reply grows with what is registered.
        lists: bool,
    },
    /// It changes what is stored, and what several servers share.
    Change {
        /// The registered port that it changes, if it is about one: each server keeps its own port
        /// to itself.
        port: Option<&'a str>,
    },
    /// The same; it takes a name, whose holder is probed first.
    Claim(&'a RegisterRequest),
    /// It says that ports are alive, which nobody stores.
    Lease {
        /// The ports.
        holders: &'a [LeaseHolder],
        /// True if the ports told another server, which passes it on.
        passed: bool,
    },
}

/// Right that the roles in force must grant. "The server" is the name server's own port.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Needs<'a> {
    /// To read from the server.
    Lookup,
    /// To administer the server.
    AdministerServer,
    /// To administer the port that is registered, whose name the server may choose.
    AdministerNew(&'a str),
    /// To administer this port.
    Administer(&'a str),
    /// To administer this port and those that it says to own.
    AdministerOwned(&'a str, &'a [String]),
    /// To administer all of these ports.
    AdministerHolders(&'a [LeaseHolder]),
    /// To connect this port or topic, which may have a carrier in front.
    Connect(&'a str),
    /// To connect both of these.
    ConnectBoth(&'a str, &'a str),
}

impl Rules<'_> {
    /// Returns whether the command may change what is stored, and what several servers share.
    pub fn changes(&self) -> bool {
        match self.kind {
            Kind::Change { .. } | Kind::Claim(_) => true,
            Kind::Question { .. } | Kind::Lease { .. } => false,
        }
    }
}
