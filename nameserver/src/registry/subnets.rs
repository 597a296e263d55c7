//! Selects the address of a port that a client can reach.
//!
//! A server with addresses in several networks gives each client an address in the network from
//! which the query came, if the port has one there (its property `ips`, which ports set when they
//! open). Stock gives every client the address with which the port registered.

use std::net::IpAddr;

use yarp_wire::name_service::Registration;

/// A network in which the server has an address.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub struct Subnet {
    /// Address of the server.
    pub own: IpAddr,
    /// Length of the network prefix in bits.
    pub bits: u8,
}

impl Subnet {
    /// Returns true if an address belongs to the network.
    pub fn contains(&self, address: IpAddr) -> bool {
        let differ = match (self.own, address) {
            (IpAddr::V4(own), IpAddr::V4(other)) => {
                u128::from(own.to_bits() ^ other.to_bits()) << 96
            }
            (IpAddr::V6(own), IpAddr::V6(other)) => own.to_bits() ^ other.to_bits(),
            _ => return false,
        };
        differ.leading_zeros() >= u32::from(self.bits)
    }
}

/// Replaces the address of a port by the one that a client at `from` can reach.
///
/// Changes nothing for clients on the server's own machine, for hosts given by name, if the address
/// is already in the client's network, and if it is none of the port's own addresses: then it was
/// set explicitly (`YARP_IP`), for a port behind address translation. Clients from other networks
/// get the registered address, unless that is a loopback address.
pub(super) fn suit(
    registration: &mut Registration,
    ips: &[String],
    subnets: &[Subnet],
    from: Option<IpAddr>,
) {
    let from = from.map(|from| from.to_canonical());
    let (Some(from), Ok(host)) = (from, registration.host.parse::<IpAddr>()) else {
        return;
    };
    let here = subnets.iter().any(|subnet| subnet.own == from);
    if here || from.is_loopback() || host.is_multicast() {
        return;
    }
    let network = subnets
        .iter()
        .find(|subnet| !subnet.own.is_loopback() && subnet.contains(from));
    if network.is_some_and(|network| network.contains(host)) {
        return;
    }
    let known = || ips.iter().filter_map(|ip| ip.parse::<IpAddr>().ok());
    if !host.is_loopback() && !known().any(|ip| ip == host) {
        return;
    }
    let near = known().find(|ip| network.is_some_and(|network| network.contains(*ip)));
    let other = || known().find(|ip| !ip.is_loopback() && ip.is_ipv4() == from.is_ipv4());
    if let Some(ip) = near.or_else(|| host.is_loopback().then(other).flatten()) {
        registration.host = ip.to_string();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn subnets() -> Vec<Subnet> {
        [
            ("127.0.0.1", 8),
            ("10.1.0.1", 24),
            ("10.2.0.1", 16),
            ("fd00::1", 64),
        ]
        .map(|(own, bits)| Subnet {
            own: own.parse().unwrap(),
            bits,
        })
        .to_vec()
    }

    #[track_caller]
    fn check(host: &str, from: &str, expected: &str) {
        let mut registration: Registration =
            format!("registration name /p ip {host} port 10002 type tcp")
                .parse()
                .unwrap();
        let ips = ["127.0.0.1", "10.1.0.7", "10.2.9.7", "192.0.2.7", "fd00::7"];
        let ips = ips.map(str::to_owned);
        let from = from.parse().ok();
        suit(&mut registration, &ips, &subnets(), from);
        assert_eq!(registration.host, expected, "{host} for {from:?}");
    }

    #[test]
    fn clients_get_an_address_in_their_network() {
        check("10.1.0.7", "10.1.0.9", "10.1.0.7");
        check("10.1.0.7", "10.2.1.1", "10.2.9.7");
        check("10.2.9.7", "10.1.0.9", "10.1.0.7");
        check("10.2.9.7", "::ffff:10.1.0.9", "10.1.0.7");
        check("10.2.9.7", "fd00::9", "fd00::7");
        check("127.0.0.1", "10.2.1.1", "10.2.9.7");
        // The port's other address in the same network is as good as any.
        check("10.1.0.8", "10.1.0.9", "10.1.0.8");
    }

    #[test]
    fn other_clients_get_the_registered_address() {
        for from in ["127.0.0.1", "10.1.0.1", "fd00::1", "unknown"] {
            check("10.1.0.7", from, "10.1.0.7");
            check("127.0.0.1", from, "127.0.0.1");
        }
        check("robot", "10.2.1.1", "robot");
        check("203.0.113.5", "10.2.1.1", "203.0.113.5");
        check("224.2.1.1", "10.2.1.1", "224.2.1.1");
        // From elsewhere: only a loopback address is replaced.
        check("10.1.0.7", "198.51.100.3", "10.1.0.7");
        check("127.0.0.1", "198.51.100.3", "10.1.0.7");
    }
}
