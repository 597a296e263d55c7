//! Arms: simulated ones, one behind its embedded PC, and one on a CAN bus.

use std::net::{IpAddr, Ipv4Addr, SocketAddr, ToSocketAddrs};

use yarp_devices::embedded::{ARM_PORT, LinkAddresses, LinkMode, PACKET_PORT};
use yarp_wire::settings::Parameters;

use super::local_device::{self, LocalDevice};
use super::{OpenResult, Opening};
use crate::{ArmKind, ConfiguredArm, HostError};

pub(super) async fn ideal(opening: Opening<'_>) -> OpenResult {
    open(opening, ArmKind::Ideal).await
}

pub(super) async fn dynamic(opening: Opening<'_>) -> OpenResult {
    open(opening, ArmKind::Dynamic).await
}

pub(super) async fn on_simulated_bus(opening: Opening<'_>) -> OpenResult {
    open(opening, ArmKind::SimulatedCan).await
}

/// Opens an arm behind its embedded PC. The driver listens unless an address to connect to is
/// given, like `yarp up --arm embedded`.
pub(super) async fn embedded(opening: Opening<'_>) -> OpenResult {
    let link_mode = link_mode(opening.parameters)?;
    open(opening, ArmKind::Embedded(link_mode)).await
}

pub(super) async fn on_can_bus(opening: Opening<'_>) -> OpenResult {
    let interface = opening.parameters.need("interface")?;
    open(opening, ArmKind::Can(interface)).await
}

async fn open(opening: Opening<'_>, kind: ArmKind) -> OpenResult {
    let arm = ConfiguredArm::from_parameters(kind, opening.parameters)?;
    let arm = local_device::start_shared(opening.parameters, move || arm.start()).await?;
    Ok(Box::new(LocalDevice::machine(arm)))
}

fn link_mode(parameters: &Parameters) -> Result<LinkMode, HostError> {
    let usual = vec![ARM_PORT.into(), PACKET_PORT.into()];
    let ports = parameters.list::<usize>("ports")?.unwrap_or(usual);
    let ports: Option<Vec<u16>> = ports.iter().map(|port| (*port).try_into().ok()).collect();
    let Some([arm, packets]) = ports.as_deref() else {
        let expected = "two TCP ports, for commands and for packets, as in (4321 4323)";
        return Err(parameters.refuse("ports", expected).into());
    };
    let at = |address: IpAddr| LinkAddresses {
        arm: SocketAddr::new(address, *arm),
        packets: SocketAddr::new(address, *packets),
    };
    let listen = parameters.get::<String>("listen")?;
    let connect = parameters.get::<String>("connect")?;
    match (listen, connect) {
        (Some(_), Some(_)) => Err(parameters
            .refuse("connect", "either listen or connect")
            .into()),
        (Some(listen), None) => {
            let address = listen.parse().map_err(|_| {
                parameters.refuse("listen", "an address of this machine, as in 0.0.0.0")
            })?;
            Ok(LinkMode::Listen(at(address)))
        }
        (None, Some(host)) => {
            let found = (host.as_str(), 0).to_socket_addrs();
            let address = found.ok().and_then(|mut addresses| addresses.next());
            let address =
                address.ok_or_else(|| parameters.refuse("connect", "a host that can be found"))?;
            Ok(LinkMode::Connect(at(address.ip())))
        }
        (None, None) => Ok(LinkMode::Listen(at(Ipv4Addr::LOCALHOST.into()))),
    }
}

#[cfg(test)]
mod tests {
    use yarp_wire::settings::{NoSource, Origin, Settings};

    use super::*;

    fn of(text: &str) -> Result<LinkMode, String> {
        let mut settings = Settings::new();
        settings.read_text("f.ini", text, &NoSource);
        let parameters = Parameters::new("arm", settings, Origin::line("f.ini", 1));
        link_mode(&parameters).map_err(|error| error.to_string())
    }

    #[test]
    fn one_end_listens_and_the_other_connects() {
        let here = |address: &str| LinkAddresses {
            arm: format!("{address}:{ARM_PORT}").parse().unwrap(),
            packets: format!("{address}:{PACKET_PORT}").parse().unwrap(),
        };
        assert_eq!(of(""), Ok(LinkMode::Listen(here("127.0.0.1"))));
        assert_eq!(of("listen 0.0.0.0"), Ok(LinkMode::Listen(here("0.0.0.0"))));
        assert_eq!(
            of("connect 127.0.0.2"),
            Ok(LinkMode::Connect(here("127.0.0.2")))
        );
        let Ok(LinkMode::Listen(places)) = of("ports (5 6)") else {
            panic!("it listens");
        };
        assert_eq!((places.arm.port(), places.packets.port()), (5, 6));
        for (text, expected) in [
            (
                "listen x",
                "parameter listen: expected an address of this machine, as in 0.0.0.0, got x",
            ),
            (
                "ports (1)",
                "parameter ports: expected two TCP ports, for commands and for packets, as in (4321 4323), got (1)",
            ),
            (
                "ports (1 70000)",
                "parameter ports: expected two TCP ports, for commands and for packets, as in (4321 4323), got (1 70000)",
            ),
            (
                "connect a\nlisten 0.0.0.0",
                "parameter connect: expected either listen or connect, got a",
            ),
        ] {
            assert_eq!(
                of(text).unwrap_err(),
                format!("f.ini:1: device arm: {expected}")
            );
        }
    }
}
