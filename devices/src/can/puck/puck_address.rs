//! Sender and receiver of a frame: the identifier, `G FFFFF TTTTT`.

use std::fmt;

/// The bit of an identifier that marks the receiver as a group.
const GROUP: u16 = 1 << 10;
/// Nodes and groups have 5 bits.
const MASK: u16 = 0x1F;

/// A participant, 0 to 31.
#[derive(Clone, Copy, Debug, Eq, Hash, Ord, PartialEq, PartialOrd)]
pub struct Node(u8);

impl Node {
    /// The computer that controls the arm.
    pub const HOST: Self = Self(0);
    /// The safety module.
    pub const SAFETY: Self = Self(10);

    /// A node by its number; `None` above 31.
    pub const fn new(number: u8) -> Option<Self> {
        if number <= MASK as u8 {
            Some(Self(number))
        } else {
            None
        }
    }

    /// The puck of a motor of the arm, counted from 0: nodes 1 and on.
    ///
    /// MotorSet that no arm has share the last node.
    pub fn of_motor(motor: usize) -> Self {
        Self(motor.saturating_add(1).min(usize::from(MASK)) as u8)
    }

    /// Its number.
    pub fn number(self) -> u8 {
        self.0
    }

    /// Returns the motor of the arm that it drives, counted from 0, if the arm has so many.
    pub fn motor(self, motors: usize) -> Option<usize> {
        usize::from(self.0)
            .checked_sub(1)
            .filter(|&motor| motor < motors)
    }
}

/// In words, for messages.
impl fmt::Display for Node {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::HOST => write!(f, "the host"),
            Self::SAFETY => write!(f, "the safety module (node 10)"),
            Self(number) => write!(f, "puck {number}"),
        }
    }
}

/// Several listeners, 0 to 31.
#[derive(Clone, Copy, Debug, Eq, Hash, Ord, PartialEq, PartialOrd)]
pub struct Group(u8);

impl Group {
    /// Every puck.
    pub const ALL: Self = Self(0);
    /// Torques for pucks 1 to 4.
    pub const LOWER_TORQUES: Self = Self(1);
    /// Torques for pucks 5 to 7.
    pub const UPPER_TORQUES: Self = Self(2);
    /// Positions, to the host.
    pub const POSITIONS: Self = Self(3);
    /// All pucks of the arm; those of pucks 1 to 4 after older documents.
    pub const ARM: Self = Self(4);
    /// Replies to queries for properties, to the host.
    pub const REPLIES: Self = Self(6);

    /// A group by its number; `None` above 31.
    pub const fn new(number: u8) -> Option<Self> {
        if number <= MASK as u8 {
            Some(Self(number))
        } else {
            None
        }
    }

    /// Its number.
    pub fn number(self) -> u8 {
        self.0
    }
}

/// The receiver of a frame.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub enum Target {
    /// One participant.
    Node(Node),
    /// All members of a group.
    Group(Group),
}

impl From<Node> for Target {
    fn from(node: Node) -> Self {
        Self::Node(node)
    }
}

impl From<Group> for Target {
    fn from(group: Group) -> Self {
        Self::Group(group)
    }
}

/// Sender and receiver of a frame.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub struct Address {
    /// The sender.
    pub from: Node,
    /// The receiver.
    pub to: Target,
}

impl Address {
    /// From the host to a receiver.
    pub fn from_host(to: impl Into<Target>) -> Self {
        Self {
            from: Node::HOST,
            to: to.into(),
        }
    }

    /// Returns whether this node is the sender, or the only receiver.
    pub fn concerns(self, node: Node) -> bool {
        self.from == node || self.to == Target::Node(node)
    }

    /// The identifier of a frame with this address.
    pub fn id(self) -> u16 {
        let from = u16::from(self.from.0) << 5;
        match self.to {
            Target::Node(node) => from | u16::from(node.0),
            Target::Group(group) => GROUP | from | u16::from(group.0),
        }
    }

    /// Parses an identifier; bits above the eleventh are ignored.
    pub fn of_id(id: u16) -> Self {
        let low = (id & MASK) as u8;
        Self {
            from: Node(((id >> 5) & MASK) as u8),
            to: if id & GROUP == 0 {
                Target::Node(Node(low))
            } else {
                Target::Group(Group(low))
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identifiers_are_those_of_the_documents() {
        let reply = |node: u8| Address {
            from: Node(node),
            to: Group::REPLIES.into(),
        };
        assert_eq!(reply(1).id(), 0x426);
        assert_eq!(reply(7).id(), 0x4E6);
        assert_eq!(reply(10).id(), 0x546);
        assert_eq!(Address::from_host(Group::ARM).id(), 0x404);
        assert_eq!(Address::from_host(Node::SAFETY).id(), 0x00A);
    }

    #[test]
    fn every_identifier_has_one_address() {
        for id in 0..=0x7FF {
            assert_eq!(Address::of_id(id).id(), id);
        }
    }

    #[test]
    fn motors_are_counted_from_zero_and_pucks_from_one() {
        assert_eq!(Node::of_motor(6).number(), 7);
        assert_eq!(Node::of_motor(6).motor(7), Some(6));
        assert_eq!(Node::HOST.motor(7), None);
        assert_eq!(Node::SAFETY.motor(7), None);
        assert_eq!(Node::new(32), None);
    }
}
