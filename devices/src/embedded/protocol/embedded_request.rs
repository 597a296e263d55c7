//! Requests of the driver (tables 2 and 12).

use super::{MAX_JOINTS, POSE, ProtocolError, number_encoding};

/// A request without its values.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Kind {
    /// `moc`
    MovePose,
    /// `gcp`
    Pose,
    /// `moj`
    MoveJoints,
    /// `gja`
    Joints,
    /// `gra`
    Gravity,
    /// `hom`
    Home,
    /// `shu`
    Shutdown,
    /// `trf`
    TellFinish,
}

const KINDS: [(Kind, &[u8; 3], &str); 8] = [
    (Kind::MovePose, b"moc", "moving to a pose (moc)"),
    (Kind::Pose, b"gcp", "asking for the pose (gcp)"),
    (Kind::MoveJoints, b"moj", "moving the joints (moj)"),
    (Kind::Joints, b"gja", "asking for the joint angles (gja)"),
    (
        Kind::Gravity,
        b"gra",
        "switching gravity compensation on (gra)",
    ),
    (Kind::Home, b"hom", "moving home (hom)"),
    (Kind::Shutdown, b"shu", "closing the connections (shu)"),
    (
        Kind::TellFinish,
        b"trf",
        "asking to be told the end of the move (trf)",
    ),
];

impl Kind {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::MovePose,
        Self::Pose,
        Self::MoveJoints,
        Self::Joints,
        Self::Gravity,
        Self::Home,
        Self::Shutdown,
        Self::TellFinish,
    ];

    fn row(self) -> (Self, &'static [u8; 3], &'static str) {
        *KINDS
            .iter()
            .find(|row| row.0 == self)
            .expect("every kind has a row, which a test checks")
    }

    /// The three characters in front.
    pub fn header(self) -> &'static [u8; 3] {
        self.row().1
    }

    /// Describes the request for messages: "moving the joints (moj)".
    pub fn step(self) -> &'static str {
        self.row().2
    }

    /// Returns whether it moves the arm.
    pub fn is_move(self) -> bool {
        matches!(self, Self::MovePose | Self::MoveJoints | Self::Home)
    }

    /// Returns the length of the body after the header, for an arm with so many joints.
    pub fn body_length(self, joints: usize) -> usize {
        match self {
            Self::MovePose => 8 * POSE,
            Self::MoveJoints => 8 * joints,
            _ => 0,
        }
    }

    /// Returns the number of bytes after the acknowledgement `d`.
    pub fn answer_length(self, joints: usize) -> usize {
        match self {
            Self::Pose => 8 * POSE,
            Self::Joints => 8 * joints,
            _ => 0,
        }
    }

    fn of(header: [u8; 3]) -> Result<Self, ProtocolError> {
        KINDS
            .iter()
            .find(|row| *row.1 == header)
            .map(|row| row.0)
            .ok_or(ProtocolError::UnknownHeader(header))
    }
}

/// A request of the driver. Numbers are as they came: whether the arm can do it is for the arm to judge.
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    /// `moc`: move the tool to x, y, z (m) and roll, pitch, yaw (rad).
    MovePose([f64; POSE]),
    /// `gcp`: where is the tool?
    Pose,
    /// `moj`: move the joints to these angles, rad, one for each.
    MoveJoints(Vec<f64>),
    /// `gja`: where are the joints?
    Joints,
    /// `gra`: switch gravity compensation on.
    Gravity,
    /// `hom`: go home.
    Home,
    /// `shu`: close the connections.
    Shutdown,
    /// `trf`: report when the trajectory is finished.
    TellFinish,
}

impl Request {
    /// Returns its kind.
    pub fn kind(&self) -> Kind {
        match self {
            Self::MovePose(_) => Kind::MovePose,
            Self::Pose => Kind::Pose,
            Self::MoveJoints(_) => Kind::MoveJoints,
            Self::Joints => Kind::Joints,
            Self::Gravity => Kind::Gravity,
            Self::Home => Kind::Home,
            Self::Shutdown => Kind::Shutdown,
            Self::TellFinish => Kind::TellFinish,
        }
    }

    /// Header and body.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = self.kind().header().to_vec();
        match self {
            Self::MovePose(pose) => number_encoding::put(pose, &mut out),
            Self::MoveJoints(angles) => number_encoding::put(angles, &mut out),
            _ => {}
        }
        out
    }

    fn from_body(kind: Kind, body: &[u8]) -> Self {
        match kind {
            Kind::MovePose => Self::MovePose(number_encoding::pose(body)),
            Kind::Pose => Self::Pose,
            Kind::MoveJoints => Self::MoveJoints(number_encoding::take(body).collect()),
            Kind::Joints => Self::Joints,
            Kind::Gravity => Self::Gravity,
            Kind::Home => Self::Home,
            Kind::Shutdown => Self::Shutdown,
            Kind::TellFinish => Self::TellFinish,
        }
    }
}

/// Cuts the driver's stream into requests, on the server's side.
#[derive(Clone, Debug)]
pub struct RequestReader {
    joints: usize,
    bytes: Vec<u8>,
}

impl RequestReader {
    /// Creates a reader for an arm with so many joints, at most [`MAX_JOINTS`].
    pub fn new(joints: usize) -> Self {
        Self {
            joints: joints.min(MAX_JOINTS),
            bytes: Vec::new(),
        }
    }

    /// Takes bytes as they came.
    pub fn push(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }

    /// The next whole request, `None` until more bytes come.
    ///
    /// Errors: [`ProtocolError::UnknownHeader`], from then on always.
    pub fn next_request(&mut self) -> Result<Option<Request>, ProtocolError> {
        let Some(&header) = self.bytes.first_chunk::<3>() else {
            return Ok(None);
        };
        let kind = Kind::of(header)?;
        let end = 3 + kind.body_length(self.joints);
        let Some(body) = self.bytes.get(3..end) else {
            return Ok(None);
        };
        let request = Request::from_body(kind, body);
        self.bytes.drain(..end);
        Ok(Some(request))
    }

    /// Returns the number of bytes of an unfinished request.
    pub fn unfinished(&self) -> usize {
        self.bytes.len()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use yarp_testing::from_hex as hex;

    use super::*;

    fn request(joints: usize) -> impl Strategy<Value = Request> {
        prop_oneof![
            prop::array::uniform6(any::<f64>()).prop_map(Request::MovePose),
            Just(Request::Pose),
            prop::collection::vec(any::<f64>(), joints).prop_map(Request::MoveJoints),
            Just(Request::Joints),
            Just(Request::Gravity),
            Just(Request::Home),
            Just(Request::Shutdown),
            Just(Request::TellFinish),
        ]
    }

    #[test]
    fn every_kind_has_a_row_and_its_header_is_found() {
        for kind in Kind::ALL {
            assert_eq!(Kind::of(*kind.header()), Ok(kind));
            let header = String::from_utf8_lossy(kind.header()).into_owned();
            assert!(kind.step().contains(&header));
        }
        assert_eq!(Kind::ALL.len(), KINDS.len());
    }

    #[test]
    fn a_move_to_a_pose_is_51_bytes() {
        let bytes = hex("6D 6F 63 00 00 00 00 00 00 E0 3F 33 33 33 33 33 33 C3 3F \
             00 00 00 00 00 00 00 00 00 00 00 00 00 00 E0 BF \
             1F 85 EB 51 B8 1E F9 3F 00 00 00 00 00 00 00 00");
        let request = Request::MovePose([0.5, 0.15, 0.0, -0.5, 1.57, 0.0]);
        assert_eq!(request.to_bytes(), bytes);
        assert_eq!(bytes.len(), 51);
    }

    #[test]
    fn a_move_of_seven_joints_is_59_bytes() {
        let request = Request::MoveJoints(vec![0.0, -2.0, 0.0, 3.13, 0.0, 0.0, 0.0]);
        let bytes = request.to_bytes();
        assert_eq!(bytes.len(), 59);
        assert_eq!(bytes[..3], *b"moj");
        assert_eq!(bytes[11..19], hex("00 00 00 00 00 00 00 C0"));
        assert_eq!(bytes[27..35], hex("0A D7 A3 70 3D 0A 09 40"));
    }

    #[test]
    fn an_unknown_header_is_named() {
        let mut reader = RequestReader::new(7);
        reader.push(b"mo");
        assert_eq!(reader.next_request(), Ok(None));
        reader.push(b"xgra");
        let error = reader.next_request().unwrap_err();
        assert!(error.to_string().contains("\"mox\""), "{error}");
        assert!(reader.next_request().is_err());
    }

    #[test]
    fn six_angles_for_seven_joints_wait_for_the_seventh() {
        let mut reader = RequestReader::new(7);
        reader.push(&Request::MoveJoints(vec![0.0; 6]).to_bytes());
        assert_eq!(reader.next_request(), Ok(None));
        assert_eq!(reader.unfinished(), 51);
    }

    proptest! {
        #[test]
        fn any_split_gives_the_same_requests(
            joints in prop_oneof![Just(4_usize), Just(7)],
            seed in prop::collection::vec((0_usize..2, 1_usize..20), 1..20),
            four in prop::collection::vec(request(4), 0..5),
            seven in prop::collection::vec(request(7), 0..5),
        ) {
            let requests = if joints == 4 { four } else { seven };
            let bytes: Vec<u8> = requests.iter().flat_map(Request::to_bytes).collect();
            let mut reader = RequestReader::new(joints);
            let mut read = Vec::new();
            let mut rest = bytes.as_slice();
            for (_, length) in seed.iter().cycle() {
                if rest.is_empty() {
                    break;
                }
                let (piece, after) = rest.split_at((*length).min(rest.len()));
                reader.push(piece);
                rest = after;
                while let Some(request) = reader.next_request().unwrap() {
                    read.push(request.to_bytes());
                }
            }
            let written: Vec<_> = requests.iter().map(Request::to_bytes).collect();
            prop_assert_eq!(read, written);
            prop_assert_eq!(reader.unfinished(), 0);
        }
    }
}
