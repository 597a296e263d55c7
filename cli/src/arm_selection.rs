//! The arms that a command can serve: the option `--arm`.

use std::fmt;
use std::io;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, ToSocketAddrs};
use std::path::PathBuf;
use std::str::FromStr;

use yarp_devices::embedded::{ARM_PORT, LinkAddresses, LinkMode, PACKET_PORT};
use yarp_hosting::{ArmKind, ConfiguredArm};
use yarp_wire::settings::{NoSource, Origin, Parameters, Settings};
use yarp_wire::{Bottle, Value};

use crate::error::Failure;

/// An arm, as named on the command line.
#[derive(Clone, Debug, Eq, PartialEq)]
pub(crate) enum Arm {
    /// Ideal simulation: moves exactly as commanded.
    Simulated,
    /// Dynamic simulation: with masses, friction, encoders and a controller.
    Dynamic,
    /// The driver of the CAN bus in front of a simulated arm, with the effects of a real one.
    SimulatedCan,
    /// An arm behind its embedded PC, which runs `yarp wam-node`.
    Embedded,
    /// An arm on the CAN bus of this interface.
    Can(String),
}

/// Arms with a fixed name.
const NAMES: [(&str, Arm); 4] = [
    ("simulated", Arm::Simulated),
    ("dynamic", Arm::Dynamic),
    ("simulated-can", Arm::SimulatedCan),
    ("embedded", Arm::Embedded),
];
/// Prefix of the interface of an arm on a CAN bus.
const CAN_PREFIX: &str = "can:";

impl FromStr for Arm {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Some(interface) = text
            .strip_prefix(CAN_PREFIX)
            .filter(|name| !name.is_empty())
        {
            return Ok(Self::Can(interface.to_owned()));
        }
        let found = NAMES.into_iter().find(|(name, _)| *name == text);
        found.map(|(_, arm)| arm).ok_or_else(|| {
            let names = NAMES.map(|(name, _)| name).join(", ");
            format!("there is no arm \"{text}\"; expected one of {names}, or {CAN_PREFIX}INTERFACE")
        })
    }
}

impl fmt::Display for Arm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Self::Can(interface) = self {
            return write!(f, "{CAN_PREFIX}{interface}");
        }
        let named = NAMES.iter().find(|(_, arm)| arm == self);
        f.write_str(named.map_or("", |(name, _)| name))
    }
}

impl Arm {
    /// Returns the kind of arm; `link_mode` applies to an arm behind its embedded PC.
    fn kind(&self, link_mode: LinkMode) -> ArmKind {
        match self {
            Self::Simulated => ArmKind::Ideal,
            Self::Dynamic => ArmKind::Dynamic,
            Self::SimulatedCan => ArmKind::SimulatedCan,
            Self::Embedded => ArmKind::Embedded(link_mode),
            Self::Can(interface) => ArmKind::Can(interface.clone()),
        }
    }
}

/// Options for the configuration of the arm.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct ArmArgs {
    /// Number of joints: 4 or 7 (default 7)
    #[arg(long, value_name = "COUNT")]
    joints: Option<u8>,
    /// The arm on the CAN bus, real or simulated, is folded in its home pose now; confirmed by a person who looks at it
    #[arg(long)]
    home_confirmed: bool,
    /// File with parameters of the arm, such as `payload (1.2 0 0 0.06)`; docs/bringing-up-your-wam.md lists them
    #[arg(long, value_name = "FILE")]
    arm_config: Option<PathBuf>,
    /// File zerocal.conf of libbarrett: home pose and angles of the rotors
    #[arg(long, value_name = "FILE")]
    zero_calibration: Option<String>,
    /// Payload at the tool plate: kg, and x, y, z of its centre in m
    #[arg(
        long,
        value_name = "KG,X,Y,Z",
        value_delimiter = ',',
        num_args = 1,
        allow_hyphen_values = true
    )]
    payload: Vec<f64>,
    /// Put guards in front of the ideal simulation too: velocities and torques end when their commander falls silent
    #[arg(long, conflicts_with = "no_guard")]
    guard: bool,
    /// Remove the guards in front of the arm
    #[arg(long)]
    no_guard: bool,
    /// Seconds after which a velocity without a new command ends (default 1)
    #[arg(long, value_name = "SECONDS")]
    velocity_timeout: Option<f64>,
    /// Seconds after which a torque, current or duty cycle without a new command ends (default 0.2)
    #[arg(long, value_name = "SECONDS")]
    effort_timeout: Option<f64>,
}

impl ArmArgs {
    /// Returns the configuration of `arm`; options take precedence over the file.
    pub(crate) fn configuration(
        &self,
        arm: &Arm,
        link_mode: LinkMode,
    ) -> Result<ConfiguredArm, Failure> {
        let mut settings = Settings::new();
        if let Some(path) = &self.arm_config {
            let text = std::fs::read_to_string(path).map_err(|error| {
                let path = path.display();
                Failure::ArmFile(io::Error::new(error.kind(), format!("{path}: {error}")))
            })?;
            let name = path.display().to_string();
            if let Some(problem) = settings.read_text(&name, &text, &NoSource).first() {
                let problem = io::Error::new(io::ErrorKind::InvalidData, problem.to_string());
                return Err(Failure::ArmFile(problem));
            }
        }
        let origin = Origin::CommandLine;
        for (name, set) in [
            ("homeConfirmed", self.home_confirmed),
            ("guard", self.guard),
            ("noGuard", self.no_guard),
        ] {
            if set {
                settings.put(name, "true", &origin);
            }
        }
        if let Some(joints) = self.joints {
            settings.put("joints", i32::from(joints), &origin);
        }
        if let Some(path) = &self.zero_calibration {
            settings.put("zeroCalibration", path.as_str(), &origin);
        }
        for (name, value) in [
            ("velocityTimeout", self.velocity_timeout),
            ("effortTimeout", self.effort_timeout),
        ] {
            if let Some(value) = value {
                settings.put(name, value, &origin);
            }
        }
        if !self.payload.is_empty() {
            let numbers: Bottle = self.payload.iter().copied().map(Value::from).collect();
            settings.put("payload", Value::List(numbers), &origin);
        }
        let parameters = Parameters::new(&arm.to_string(), settings, origin);
        let configuration = ConfiguredArm::from_parameters(arm.kind(link_mode), &parameters)?;
        if let Some((name, origin)) = parameters.unused().next() {
            let expected = format!("{origin}: the arm has no parameter {name}");
            return Err(Failure::ArmFile(io::Error::new(
                io::ErrorKind::InvalidData,
                expected,
            )));
        }
        Ok(configuration)
    }
}

/// Options for the connections between driver and embedded PC: which end listens.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct LinkModeArgs {
    /// Listen for the other end on this address of this machine
    #[arg(long, value_name = "ADDRESS", conflicts_with = "connect")]
    listen: Option<IpAddr>,
    /// Connect to the other end on this host, and reconnect
    #[arg(long, value_name = "HOST")]
    connect: Option<String>,
    /// TCP ports for commands and for asynchronous packets
    #[arg(long, value_name = "ARM,PACKETS", value_delimiter = ',', num_args = 1,
          default_values_t = [ARM_PORT, PACKET_PORT])]
    ports: Vec<u16>,
}

impl LinkModeArgs {
    /// Returns the link mode of the options. Without options, the driver listens and the PC
    /// connects, both on this machine.
    pub(crate) fn link_mode(&self, listens: bool) -> io::Result<LinkMode> {
        let &[arm, packets] = self.ports.as_slice() else {
            return Err(io::Error::new(
                io::ErrorKind::InvalidInput,
                format!("--ports needs two numbers, as in {ARM_PORT},{PACKET_PORT}"),
            ));
        };
        let at = |address: IpAddr| LinkAddresses {
            arm: SocketAddr::new(address, arm),
            packets: SocketAddr::new(address, packets),
        };
        let here = IpAddr::V4(Ipv4Addr::LOCALHOST);
        Ok(match (&self.listen, &self.connect) {
            (Some(address), _) => LinkMode::Listen(at(*address)),
            (None, Some(host)) => LinkMode::Connect(at(resolve(host)?)),
            (None, None) if listens => LinkMode::Listen(at(here)),
            (None, None) => LinkMode::Connect(at(here)),
        })
    }
}

/// Returns the first address of a host.
fn resolve(host: &str) -> io::Result<IpAddr> {
    let found = (host, 0).to_socket_addrs().and_then(|mut addresses| {
        addresses
            .next()
            .ok_or_else(|| io::Error::new(io::ErrorKind::NotFound, "it has no address"))
    });
    found.map(|address| address.ip()).map_err(|error| {
        io::Error::new(
            error.kind(),
            format!("cannot find the host {host}: {error}"),
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_as_they_are_printed() {
        let on_a_bus = [("can:can0", Arm::Can("can0".to_owned()))];
        for (name, arm) in NAMES.into_iter().chain(on_a_bus) {
            assert_eq!(arm.to_string(), name);
            assert_eq!(name.parse(), Ok(arm));
        }
        for wrong in ["ghost", "can:", "can"] {
            let refused = wrong.parse::<Arm>().unwrap_err();
            let known = "simulated, dynamic, simulated-can, embedded, or can:INTERFACE";
            assert!(refused.contains(known), "{refused}");
        }
    }

    #[test]
    fn by_default_one_end_listens_and_the_other_connects() {
        let meet = |listen: Option<&str>, connect: Option<&str>, listens: bool| {
            let args = LinkModeArgs {
                listen: listen.map(|text| text.parse().unwrap()),
                connect: connect.map(str::to_owned),
                ports: vec![1, 2],
            };
            args.link_mode(listens).unwrap()
        };
        let at = |address: &str| LinkAddresses {
            arm: format!("{address}:1").parse().unwrap(),
            packets: format!("{address}:2").parse().unwrap(),
        };
        let here = at("127.0.0.1");
        assert_eq!(meet(None, None, true), LinkMode::Listen(here));
        assert_eq!(meet(None, None, false), LinkMode::Connect(here));
        assert_eq!(
            meet(Some("0.0.0.0"), None, false),
            LinkMode::Listen(at("0.0.0.0"))
        );
        assert_eq!(
            meet(None, Some("127.0.0.2"), true),
            LinkMode::Connect(at("127.0.0.2"))
        );
    }
}
