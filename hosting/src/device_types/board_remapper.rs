//! Several devices as one control board, with the parameters of stock's `controlboardremapper` and
//! `remotecontrolboardremapper`.
//!
//! Joints are listed by `axesNames (a b)`, or as ranges of networks: `networks (left right)`,
//! `joints 5`, `left (0 2 0 2)` for joints 0 to 2 of the board, which are joints 0 to 2 of the
//! device attached as `left`.
//!
//! Source: `ControlBoardRemapper.cpp` and `RemoteControlBoardRemapper.cpp` of YARP 3.5.

use std::sync::Arc;

use yarp_devices::remapper::{Named, RemapError, Remapper};
use yarp_devices::{AxisIndex, Device};
use yarp_wire::PortName;
use yarp_wire::settings::{Origin, ParameterError, Parameters};

use super::local_device::LocalDevice;
use super::{OpenResult, Opening, remote_board};
use crate::{Attached, Future, HostError, Hosted, Parts};

/// Maximum number of joints that fit the state of a board on the wire.
const MAX_JOINTS: usize = 1000;
/// Network names of a device that is attached without a name.
const UNNAMED: [&str; 2] = ["...", "all"];
/// Network names of a calibrator in stock; boards calibrate themselves here.
const CALIBRATORS: [&str; 2] = ["Calibrator", "calibrator"];

pub(super) async fn open(opening: Opening<'_>) -> OpenResult {
    let parameters = opening.parameters;
    let mapping = Mapping::read(parameters)?.ok_or_else(|| missing(parameters))?;
    parameters.has("verbose");
    Ok(Box::new(RemappedDevice {
        mapping,
        board: None,
    }))
}

pub(super) async fn open_remote(opening: Opening<'_>) -> OpenResult {
    let parameters = opening.parameters;
    let mapping = Mapping::read(parameters)?.ok_or_else(|| missing(parameters))?;
    let prefix: PortName = parameters.need("localPortPrefix")?;
    let remotes = parameters.list::<PortName>("remoteControlBoards")?;
    let remotes = remotes.filter(|remotes| !remotes.is_empty());
    let remotes = remotes.ok_or_else(|| {
        parameters.refuse(
            "remoteControlBoards",
            "the names of remote boards, as in (/left /right)",
        )
    })?;
    let mut others = Vec::new();
    for remote in remotes {
        let local = format!("{prefix}{remote}");
        let group = "REMOTE_CONTROLBOARD_OPTIONS::";
        let opened = match remote_board::options(parameters, group, remote.as_ref(), &local) {
            Ok(options) => remote_board::connect(opening, options).await,
            Err(error) => Err(error),
        };
        match opened {
            Ok(board) => others.push(Attached {
                device: remote.to_string(),
                network: remote.to_string(),
                parts: Parts {
                    board: Some(board),
                    ..Parts::default()
                },
            }),
            Err(error) => {
                release(others).await;
                return Err(error);
            }
        }
    }
    let board = mapping.apply(others).await?;
    Ok(Box::new(LocalDevice::board(board)))
}

fn missing(parameters: &Parameters) -> ParameterError {
    ParameterError::Missing {
        origin: parameters.origin().clone(),
        device: parameters.device().into(),
        name: "axesNames".into(),
        expected: "the names of joints, or networks instead",
    }
}

/// Drops boards on a blocking thread, because remote boards close their ports synchronously.
async fn release<T: Send + 'static>(boards: T) {
    let _ = tokio::task::spawn_blocking(move || drop(boards)).await;
}

/// Selection of the joints of a board.
#[derive(Clone, Debug)]
pub(super) struct Mapping {
    joints: Joints,
    /// Position of the description.
    origin: Origin,
    /// Name of the board.
    device: String,
}

#[derive(Clone, Debug, Eq, PartialEq)]
enum Joints {
    /// Joints with these names.
    Names(Vec<String>),
    /// Joints by network and index.
    Networks {
        /// Names of the networks.
        names: Vec<String>,
        /// Index of the network, and joint of its device.
        joints: Vec<(usize, AxisIndex)>,
    },
}

impl Mapping {
    /// Reads the selection from parameters, if they contain one.
    pub(super) fn read(parameters: &Parameters) -> Result<Option<Self>, HostError> {
        let names = parameters.list::<String>("axesNames")?;
        let networks = parameters.list::<String>("networks")?;
        let joints = match (names, networks) {
            (Some(_), Some(_)) => {
                return Err(parameters
                    .refuse("networks", "either axesNames or networks")
                    .into());
            }
            (Some(names), None) if names.is_empty() => {
                return Err(parameters
                    .refuse("axesNames", "the name of one joint at least")
                    .into());
            }
            (Some(names), None) => Joints::Names(names),
            (None, Some(networks)) => joint_ranges(parameters, networks)?,
            (None, None) => return Ok(None),
        };
        Ok(Some(Self {
            joints,
            origin: parameters.origin().clone(),
            device: parameters.device().to_owned(),
        }))
    }

    /// Creates the board.
    pub(super) async fn apply(&self, others: Vec<Attached>) -> Result<Arc<Remapper>, HostError> {
        let mut devices: Vec<Named> = Vec::new();
        for other in others {
            let network = other.network.as_str();
            if CALIBRATORS.contains(&network) {
                continue;
            }
            let name = match UNNAMED.contains(&network) {
                true => other.device.clone(),
                false => other.network.clone(),
            };
            match other.parts.board {
                Some(board) => devices.push((name, board)),
                None if network == "all" => {}
                None => {
                    return Err(HostError::Unsuitable {
                        device: other.device,
                        expected: "a device with joints",
                    });
                }
            }
        }
        let mapping = self.clone();
        // Remote boards are queried for the names of their joints.
        let made = tokio::task::spawn_blocking(move || mapping.remap(devices));
        let made = made
            .await
            .unwrap_or_else(|panicked| std::panic::resume_unwind(panicked.into_panic()));
        made.map(Arc::new)
    }

    fn remap(self, mut devices: Vec<Named>) -> Result<Remapper, HostError> {
        let made = match self.joints {
            Joints::Names(names) => Remapper::of_names(devices, &names),
            Joints::Networks { names, joints } => {
                if let ([name], [(device, _)]) = (&names[..], &mut devices[..]) {
                    // A single device needs no name.
                    device.clone_from(name);
                }
                let place = |network: &String| {
                    let place = devices.iter().position(|(device, _)| device == network);
                    place.ok_or_else(|| HostError::NoNetwork {
                        origin: self.origin.clone(),
                        device: self.device.clone(),
                        network: network.clone(),
                    })
                };
                let places = names.iter().map(place).collect::<Result<Vec<_>, _>>()?;
                let joints = joints
                    .iter()
                    .map(|(network, axis)| (places[*network], *axis));
                Remapper::of_joints(devices, &joints.collect::<Vec<_>>())
            }
        };
        made.map_err(|source: RemapError| HostError::Remap {
            origin: self.origin,
            device: self.device,
            source: Box::new(source),
        })
    }
}

/// Reads the joints of networks: for each network, first and last joint of the board, and first and
/// last joint of the device.
fn joint_ranges(parameters: &Parameters, names: Vec<String>) -> Result<Joints, HostError> {
    let total: usize = parameters.need("joints")?;
    if !(1..=MAX_JOINTS).contains(&total) {
        let expected = format!("1 to {MAX_JOINTS} joints");
        return Err(parameters.refuse("joints", expected).into());
    }
    let mut joints = vec![None; total];
    for (number, network) in names.iter().enumerate() {
        let four = "first and last joint of this board, first and last joint of the device";
        let refuse = |expected: &str| HostError::from(parameters.refuse(network, expected));
        let row = parameters.list::<usize>(network)?;
        let Some([first, last, their_first, their_last]) = row.as_deref() else {
            return Err(refuse(four));
        };
        if first > last || last.abs_diff(*first) != their_last.wrapping_sub(*their_first) {
            return Err(refuse("as many joints of the board as of the device"));
        }
        if *last >= total {
            return Err(refuse(&format!(
                "joints of the board from 0 to {}",
                total - 1
            )));
        }
        for (at, joint) in joints[*first..=*last].iter_mut().enumerate() {
            let place = (number, AxisIndex::from(their_first + at));
            if joint.replace(place).is_some() {
                let again = first + at;
                return Err(refuse(&format!(
                    "each joint of the board once, not joint {again} again"
                )));
            }
        }
    }
    match joints.iter().position(Option::is_none) {
        Some(joint) => {
            let expected = format!("a network for each joint, none has joint {joint}");
            Err(parameters.refuse("networks", expected).into())
        }
        None => Ok(Joints::Networks {
            names,
            joints: joints.into_iter().flatten().collect(),
        }),
    }
}

/// A board made of local devices, which exists while it is attached.
struct RemappedDevice {
    mapping: Mapping,
    board: Option<Arc<Remapper>>,
}

impl Hosted for RemappedDevice {
    fn parts(&self) -> Parts {
        let board = self.board.clone();
        Parts {
            board: board.map(|board| board as Arc<dyn Device>),
            ..Parts::default()
        }
    }

    fn attach(&mut self, others: Vec<Attached>) -> Future<'_, Result<(), HostError>> {
        Box::pin(async move {
            if self.board.is_some() {
                return Err(HostError::Attached);
            }
            self.board = Some(self.mapping.apply(others).await?);
            Ok(())
        })
    }

    fn detach(&mut self) -> Future<'_, Result<(), HostError>> {
        Box::pin(async move {
            release(self.board.take()).await;
            Ok(())
        })
    }

    fn close(self: Box<Self>) -> Future<'static, ()> {
        Box::pin(release(self))
    }
}

#[cfg(test)]
mod tests {
    use yarp_wire::settings::{NoSource, Settings};

    use super::*;

    fn of(text: &str) -> Result<Option<Joints>, String> {
        let mut settings = Settings::new();
        settings.read_text("f.ini", text, &NoSource);
        let parameters = Parameters::new("both", settings, Origin::line("f.ini", 1));
        let mapping = Mapping::read(&parameters).map_err(|error| error.to_string())?;
        Ok(mapping.map(|mapping| mapping.joints))
    }

    /// Checks ranges in brackets, and in the form of stock's older files.
    #[test]
    fn ranges_of_networks_become_joints() {
        let text = "networks (left right)\njoints 5\nleft (3 4 0 1)\nright 0 2 5 7\n";
        let Some(Joints::Networks { names, joints }) = of(text).unwrap() else {
            panic!("these are networks");
        };
        assert_eq!(names, ["left", "right"]);
        let expected = [(1, 5), (1, 6), (1, 7), (0, 0), (0, 1)];
        assert_eq!(
            joints,
            expected.map(|(network, axis)| (network, axis.into()))
        );
        let names = of("axesNames (a b)").unwrap();
        assert_eq!(names, Some(Joints::Names(vec!["a".into(), "b".into()])));
        assert_eq!(of("").unwrap(), None);
    }

    #[test]
    fn inconsistent_parameters_are_refused_with_their_line() {
        let two = "networks (a b)\njoints 4\na (0 1 0 1)\n";
        for (text, expected) in [
            (
                "axesNames (a)\nnetworks (b)".to_owned(),
                "f.ini:2: device both: parameter networks: expected either axesNames or networks, got (b)",
            ),
            (
                "networks (a)".to_owned(),
                "f.ini:1: device both: parameter joints is missing, expected a whole number from 0",
            ),
            (
                "networks (a)\njoints 0".to_owned(),
                "f.ini:2: device both: parameter joints: expected 1 to 1000 joints, got 0",
            ),
            (
                format!("{two}b (2 3 0)"),
                "f.ini:4: device both: parameter b: expected first and last joint of this board, first and last joint of the device, got (2 3 0)",
            ),
            (
                format!("{two}b (2 3 0 2)"),
                "f.ini:4: device both: parameter b: expected as many joints of the board as of the device, got (2 3 0 2)",
            ),
            (
                format!("{two}b (3 2 1 0)"),
                "f.ini:4: device both: parameter b: expected as many joints of the board as of the device, got (3 2 1 0)",
            ),
            (
                format!("{two}b (3 4 0 1)"),
                "f.ini:4: device both: parameter b: expected joints of the board from 0 to 3, got (3 4 0 1)",
            ),
            (
                format!("{two}b (1 2 0 1)"),
                "f.ini:4: device both: parameter b: expected each joint of the board once, not joint 1 again, got (1 2 0 1)",
            ),
            (
                format!("{two}b (3 3 0 0)"),
                "f.ini:1: device both: parameter networks: expected a network for each joint, none has joint 2, got (a b)",
            ),
        ] {
            assert_eq!(of(&text).unwrap_err(), expected);
        }
    }
}
