//! The two versions of iCub's protocol.

use yarp_wire::Value;

/// Version of the protocol that a controller serves: the words are the same, but each client insists on the version
/// that it knows.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub enum CartesianVersion {
    /// Of icub-main 1.x.
    V1_1,
    /// Of icub-main from 2.0 on.
    #[default]
    V2_0,
}

impl CartesianVersion {
    const ALL: [Self; 2] = [Self::V1_1, Self::V2_0];

    /// Returns the version as people write it.
    pub fn text(self) -> &'static str {
        match self {
            Self::V1_1 => "1.1",
            Self::V2_0 => "2.0",
        }
    }

    /// Parses the version as people write it.
    pub fn from_text(text: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|version| version.text() == text)
    }

    /// Returns the version as servers send it: a number in the older one, a word in the later.
    pub(super) fn value(self) -> Value {
        match self {
            Self::V1_1 => 1.1.into(),
            Self::V2_0 => self.text().into(),
        }
    }
}
