//! Replies of the embedded PC.

use super::{Kind, MAX_JOINTS, POSE, ProtocolError, number_encoding};

/// The acknowledgement (annex B).
const DONE: u8 = b'd';
/// On failure.
const REFUSED: u8 = b'q';

/// An answer to a request.
#[derive(Clone, Debug, PartialEq)]
pub enum Reply {
    /// `d`: the arm took it.
    Done,
    /// `d` and x, y, z (m), roll, pitch, yaw (rad).
    Pose([f64; POSE]),
    /// `d` and the angle of each joint, rad.
    Joints(Vec<f64>),
    /// `q`
    Refused,
}

impl Reply {
    /// Acknowledgement and values.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = vec![DONE];
        match self {
            Self::Done => {}
            Self::Pose(pose) => number_encoding::put(pose, &mut out),
            Self::Joints(angles) => number_encoding::put(angles, &mut out),
            Self::Refused => out[0] = REFUSED,
        }
        out
    }
}

/// Reads the answer to one request, on the driver's side.
#[derive(Clone, Debug)]
pub struct ReplyReader {
    kind: Kind,
    length: usize,
    bytes: Vec<u8>,
}

impl ReplyReader {
    /// Creates a reader for the reply to such a request, for an arm with so many joints, at most [`MAX_JOINTS`].
    pub fn new(kind: Kind, joints: usize) -> Self {
        Self {
            kind,
            length: kind.answer_length(joints.min(MAX_JOINTS)),
            bytes: Vec::new(),
        }
    }

    /// Takes bytes as they came; the answer when it is whole, `None` until then.
    ///
    /// A `q` may be followed by a NUL, as the ancestor of the protocol sent when it closed.
    ///
    /// Errors: [`ProtocolError::NotAnAcknowledgement`], [`ProtocolError::Surplus`].
    pub fn push(&mut self, bytes: &[u8]) -> Result<Option<Reply>, ProtocolError> {
        self.bytes.extend_from_slice(bytes);
        match self.bytes.split_first() {
            None => Ok(None),
            Some((&REFUSED, [] | [0])) => Ok(Some(Reply::Refused)),
            Some((&REFUSED, rest)) => Err(ProtocolError::Surplus(rest.len())),
            Some((&DONE, rest)) if rest.len() < self.length => Ok(None),
            Some((&DONE, rest)) if rest.len() > self.length => {
                Err(ProtocolError::Surplus(rest.len() - self.length))
            }
            Some((&DONE, values)) => Ok(Some(match self.kind {
                Kind::Pose => Reply::Pose(number_encoding::pose(values)),
                Kind::Joints => Reply::Joints(number_encoding::take(values).collect()),
                _ => Reply::Done,
            })),
            Some((&other, _)) => Err(ProtocolError::NotAnAcknowledgement(other)),
        }
    }

    /// Returns whether a part of the reply has been received.
    pub fn has_begun(&self) -> bool {
        !self.bytes.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn every_split_gives_the_same_answer() {
        let pose = Reply::Pose([0.5, 0.15, -0.1, 0.5, 1.57, 0.0]);
        let angles = Reply::Joints(vec![0.0, -2.0, 0.0, 3.13, 0.0, 0.0, 0.0]);
        for (kind, reply) in [
            (Kind::Pose, pose),
            (Kind::Joints, angles),
            (Kind::Home, Reply::Done),
            (Kind::Joints, Reply::Refused),
        ] {
            let bytes = reply.to_bytes();
            for cut in 0..bytes.len() {
                let mut reader = ReplyReader::new(kind, 7);
                assert_eq!(reader.push(&bytes[..cut]), Ok(None), "{kind:?} {cut}");
                assert_eq!(reader.push(&bytes[cut..]), Ok(Some(reply.clone())));
            }
        }
    }

    #[test]
    fn what_is_no_answer_is_told() {
        let check = |kind: Kind, bytes: &[u8], expected: ProtocolError| {
            assert_eq!(ReplyReader::new(kind, 7).push(bytes), Err(expected));
        };
        check(Kind::Home, b"x", ProtocolError::NotAnAcknowledgement(b'x'));
        check(Kind::Home, b"dd", ProtocolError::Surplus(1));
        check(Kind::Home, b"q\0\0", ProtocolError::Surplus(2));
        check(Kind::Pose, &[b'd'; 60], ProtocolError::Surplus(11));
        let closing = ReplyReader::new(Kind::Home, 7).push(b"q\0");
        assert_eq!(closing, Ok(Some(Reply::Refused)));
    }

    proptest! {
        #[test]
        fn any_bytes_give_an_answer_an_error_or_a_wait(
            bytes in prop::collection::vec(any::<u8>(), 0..80),
            which in 0..Kind::ALL.len(),
        ) {
            let kind = Kind::ALL[which];
            let whole = ReplyReader::new(kind, 7).push(&bytes);
            if let Ok(Some(reply)) = whole {
                prop_assert_eq!(&reply.to_bytes()[..1], &bytes[..1]);
            }
        }
    }
}
