//! Answers on `rpc:i`.
//!
//! ```text
//! [is] ECHO VALUES.. [tsta] count time [ok]     to a question
//! [ok]                                          to an order
//! [fail]                                        to whatever was refused, without a reason
//! ```

use yarp_devices::JointType;
use yarp_wire::{Bottle, Stamp, Value, Vocab32};

use super::board_vocabulary as word;
use crate::thrift::Item;

/// A reply.
#[derive(Clone, Debug, PartialEq)]
pub struct Reply(Bottle);

impl Reply {
    /// Reply to a command that was executed.
    pub fn ok() -> Self {
        Self(Bottle::of(Vocab32::OK))
    }

    /// To what was refused.
    pub fn fail() -> Self {
        Self(Bottle::of(Vocab32::FAIL))
    }

    /// To a request of fewer than two items.
    pub fn not_understood() -> Self {
        Self(Bottle::of(word::NOT_UNDERSTOOD))
    }

    /// Reply to the query for the protocol version.
    pub fn version(version: ProtocolVersion) -> Self {
        let numbers = [version.major, version.minor, version.tweak];
        let mut reply = Bottle::of(word::PROTOCOL_VERSION);
        reply.extend(numbers.map(Value::Int32));
        reply.push(Vocab32::OK);
        Self(reply)
    }

    /// Reply to a query: `echo` is a word of the query, `stamp` the time of the reply.
    pub fn is(echo: Value, values: impl IntoIterator<Item = Value>, stamp: Stamp) -> Self {
        let mut reply = Bottle::of(word::IS).with(echo);
        reply.extend(values);
        reply.push(word::TIME_STAMP);
        reply.extend(stamp.to_bottle());
        reply.push(Vocab32::OK);
        Self(reply)
    }

    /// Reply to the queries of some interfaces: without echo or time where `values` and `stamp` have none.
    pub(super) fn bare(values: impl IntoIterator<Item = Value>, stamp: Option<Stamp>) -> Self {
        let mut reply = Bottle::from_iter(values);
        if let Some(stamp) = stamp {
            reply.push(word::TIME_STAMP);
            reply.extend(stamp.to_bottle());
        }
        reply.push(Vocab32::OK);
        Self(reply)
    }

    /// Usage for people: each line is a request and its effect.
    pub fn usage(lines: impl IntoIterator<Item = (Bottle, String)>) -> Self {
        let mut reply = Bottle::of(Vocab32::MANY);
        for (typed, meaning) in lines {
            reply.push(typed);
            reply.push(meaning);
        }
        reply.push(Vocab32::OK);
        Self(reply)
    }

    /// A reply as received.
    pub fn from_bottle(reply: Bottle) -> Self {
        Self(reply)
    }

    /// The answer as it travels.
    pub fn into_bottle(self) -> Bottle {
        self.0
    }

    /// Returns whether the peer refused.
    pub fn is_refusal(&self) -> bool {
        let first = self.word(0);
        first == Some(Vocab32::FAIL) || first == Some(word::NOT_UNDERSTOOD)
    }

    /// Returns whether a command was executed.
    pub fn is_ok(&self) -> bool {
        self.word(0) == Some(Vocab32::OK)
    }

    /// The version of the protocol. Exactly five items, as stock demands.
    pub fn read_version(&self) -> Option<ProtocolVersion> {
        if self.0.len() != 5 || self.word(0) != Some(word::PROTOCOL_VERSION) {
            return None;
        }
        let number = |index| self.0.get(index).and_then(Value::as_i32);
        Some(ProtocolVersion {
            major: number(1)?,
            minor: number(2)?,
            tweak: number(3)?,
        })
    }

    /// Returns the items after the first `skipped` ones, without time and `[ok]`.
    pub(super) fn results(&self, skipped: usize) -> Option<Vec<Value>> {
        let items = self.0.as_slice().get(skipped..)?;
        if skipped > 0 && self.word(0) != Some(word::IS) {
            return None;
        }
        let time = Value::from(word::TIME_STAMP);
        let end = items.iter().position(|item| *item == time);
        let end = end.or_else(|| items.len().checked_sub(1))?;
        Some(items[..end].to_vec())
    }

    fn word(&self, index: usize) -> Option<Vocab32> {
        self.0.get(index).and_then(Value::as_vocab)
    }
}

/// The version of the protocol between client and control board.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub struct ProtocolVersion {
    /// Must be the same on both sides.
    pub major: i32,
    /// Must be the same on both sides.
    pub minor: i32,
    /// Need not be the same.
    pub tweak: i32,
}

impl ProtocolVersion {
    /// Protocol version of YARP 3.5 to 3.12.
    pub const CURRENT: Self = Self {
        major: 1,
        minor: 9,
        tweak: 0,
    };

    /// A version that has one number, as in 4.0.
    pub(crate) fn only(protocol: i16) -> Self {
        Self {
            major: protocol.into(),
            minor: 0,
            tweak: 0,
        }
    }

    /// Returns whether both sides are compatible.
    pub fn is_compatible(self, other: Self) -> bool {
        (self.major, self.minor) == (other.major, other.minor)
    }
}

impl std::fmt::Display for ProtocolVersion {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}.{}.{}", self.major, self.minor, self.tweak)
    }
}

/// The kind of an axis as stock sends it: the code of a word, as an integer.
pub(crate) fn joint_type_to_value(joint_type: JointType) -> Item {
    let word = match joint_type {
        JointType::Revolute => word::REVOLUTE,
        JointType::Prismatic => word::PRISMATIC,
        _ => word::UNKNOWN_TYPE,
    };
    Item::I32(word.code() as i32)
}

/// Parses the type of an axis; an unknown word is an unknown type.
pub(crate) fn joint_type_from_value(value: &Value) -> Option<JointType> {
    Some(match value.as_vocab()? {
        word::REVOLUTE => JointType::Revolute,
        word::PRISMATIC => JointType::Prismatic,
        _ => JointType::Unknown,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use yarp_wire::WireVersion;

    #[test]
    fn bytes_are_those_recorded() {
        // [get] [llim] 0 and [get] [prot], answered by a stock 3.12.3 board.
        let limits: &[u8] = b"\x00\x01\x00\x00\x08\x00\x00\x00\x09\x00\x00\x00is\x00\x00\x09\x00\x00\x00llim\
            \x0a\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x0a\x00\x00\x00\x00\x00\x00\x00\x00\x00Y@\
            \x09\x00\x00\x00tsta\x01\x00\x00\x00\xde\x01\x00\x00\x0a\x00\x00\x00\x83\x84\x94\xb1M\xc0\xdaA\
            \x09\x00\x00\x00ok\x00\x00";
        let time = f64::from_le_bytes(*b"\x83\x84\x94\xb1M\xc0\xdaA");
        let reply = Reply::is(
            word::POSITION_LIMITS.into(),
            [0.0.into(), 100.0.into()],
            Stamp::new(0x1de, time),
        );
        assert_eq!(&reply.into_bottle().encode(WireVersion::V3)[..], limits);
        let version: &[u8] = b"\x00\x01\x00\x00\x05\x00\x00\x00\x09\x00\x00\x00prot\x01\x00\x00\x00\x01\x00\x00\x00\
            \x01\x00\x00\x00\x09\x00\x00\x00\x01\x00\x00\x00\x00\x00\x00\x00\x09\x00\x00\x00ok\x00\x00";
        let reply = Reply::version(ProtocolVersion::CURRENT);
        assert_eq!(&reply.into_bottle().encode(WireVersion::V3)[..], version);
    }

    #[test]
    fn the_number_of_axes_is_answered_in_these_bytes() {
        // [is] [axes] 2 [tsta] 7 1.5 [ok], float64 being code 10 in 3.x.
        let drawn: &[u8] =
            b"\x00\x01\x00\x00\x07\x00\x00\x00\x09\x00\x00\x00is\x00\x00\x09\x00\x00\x00axes\
            \x01\x00\x00\x00\x02\x00\x00\x00\x09\x00\x00\x00tsta\x01\x00\x00\x00\x07\x00\x00\x00\
            \x0a\x00\x00\x00\x00\x00\x00\x00\x00\x00\xf8\x3f\x09\x00\x00\x00ok\x00\x00";
        let reply = Reply::is(word::AXES.into(), [2.into()], Stamp::new(7, 1.5));
        assert_eq!(&reply.into_bottle().encode(WireVersion::V3)[..], drawn);
    }

    #[test]
    fn answers_are_read() {
        let reply = |text: &str| Reply::from_bottle(Bottle::parse(text).unwrap());
        let values = |text: &str, skipped| {
            let values = reply(text).results(skipped)?;
            Some(Bottle::from(values).to_string())
        };
        let limits = "[is] [llim] -1.0 1.0 [tsta] 7 1.5 [ok]";
        assert_eq!(values(limits, 2).as_deref(), Some("-1.0 1.0"));
        assert_eq!(values("[is] [pid] 1.0 [ok]", 2).as_deref(), Some("1.0"));
        assert_eq!(
            values("[stif] [tsta] 7 1.5 [ok]", 0).as_deref(),
            Some("[stif]")
        );
        assert_eq!(values("[ok]", 2), None);
        assert_eq!(values("1 2 3", 2), None);
        assert!(reply("[fail]").is_refusal() && reply("[nak]").is_refusal());
        assert!(reply("[ok]").is_ok() && !reply("").is_ok());
        assert_eq!(reply("[prot] 1 9 0").read_version(), None);
        let other = reply("[prot] 1 9 7 [ok]").read_version().unwrap();
        assert!(ProtocolVersion::CURRENT.is_compatible(other));
        let kind = joint_type_to_value(JointType::Revolute);
        assert_eq!(kind, Item::I32(1987212385));
        assert_eq!(
            joint_type_from_value(&kind.into()),
            Some(JointType::Revolute)
        );
    }
}
