//! The addresses of this machine.

use std::net::IpAddr;

/// All addresses of this machine's interfaces as text, IPv4 first.
///
/// Link-local IPv6 addresses name their interface by index, as stock does: `fe80::1%4`.
pub fn own() -> Vec<String> {
    let mut interfaces = if_addrs::get_if_addrs().unwrap_or_default();
    interfaces.sort_by_key(|interface| interface.ip().is_ipv6());
    interfaces
        .iter()
        .map(|interface| match (interface.ip(), interface.index) {
            (IpAddr::V6(ip), Some(index)) if ip.is_unicast_link_local() => {
                format!("{ip}%{index}")
            }
            (ip, _) => ip.to_string(),
        })
        .collect()
}

/// Returns the addresses of this machine's interfaces, each with the prefix length of its network.
pub fn subnets() -> Vec<(IpAddr, u8)> {
    let interfaces = if_addrs::get_if_addrs().unwrap_or_default();
    let subnet = |interface: if_addrs::Interface| match interface.addr {
        if_addrs::IfAddr::V4(v4) => (IpAddr::V4(v4.ip), v4.prefixlen),
        if_addrs::IfAddr::V6(v6) => (IpAddr::V6(v6.ip), v6.prefixlen),
    };
    interfaces.into_iter().map(subnet).collect()
}

/// Returns whether this is an address of one of this machine's interfaces.
pub(crate) fn is_own(address: IpAddr) -> bool {
    all().contains(&address)
}

/// Returns whether this is an address of this machine.
pub(crate) fn is_local(address: IpAddr) -> bool {
    let address = address.to_canonical();
    address.is_loopback() || is_own(address)
}

/// The addresses of this machine's interfaces.
pub(crate) fn all() -> Vec<IpAddr> {
    let interfaces = if_addrs::get_if_addrs().unwrap_or_default();
    interfaces.iter().map(if_addrs::Interface::ip).collect()
}

/// Returns the address under which others reach this machine, as stock chooses it: the IPv4 address that is
/// not loopback, of several the one with the shortest text, of those the first.
pub fn best() -> String {
    let interfaces = if_addrs::get_if_addrs().unwrap_or_default();
    shortest(interfaces.iter().map(if_addrs::Interface::ip))
}

fn shortest(addresses: impl Iterator<Item = IpAddr>) -> String {
    addresses
        .filter(|ip| ip.is_ipv4() && !ip.is_loopback())
        .map(|ip| ip.to_string())
        .min_by_key(String::len)
        .unwrap_or_else(|| "127.0.0.1".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_address_is_the_one_that_stock_takes() {
        for (all, expected) in [
            (&["127.0.0.1", "::1"][..], "127.0.0.1"),
            (
                &["127.0.0.1", "192.0.2.22", "10.1.2.3", "10.1.2.4", "fd00::2"],
                "10.1.2.3",
            ),
            (&["fd00::2", "192.0.2.2", "127.0.0.1"], "192.0.2.2"),
        ] {
            let all = all.iter().map(|ip| ip.parse().unwrap());
            assert_eq!(shortest(all), expected);
        }
    }
}
