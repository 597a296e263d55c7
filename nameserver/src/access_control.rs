//! Access control for name server requests: checks the right that [`Command::rules`] states under the roles in force.

use yarp_ports::roles::{Peer, Right, Roles};
use yarp_wire::name_service::{Command, Needs, SERVER_CHOOSES};

use crate::registry::bare_name;

/// Name under which rights are checked for a port whose name the server has yet to choose.
const ANONYMOUS_PREFIX: &str = "/tmp/port/";

/// Returns the reason why `peer` may not send `command` to the server named `own`, or `None` if it
/// may.
pub(crate) fn refusal(
    roles: &Roles,
    own: &str,
    peer: Peer<'_>,
    command: &Command,
) -> Option<String> {
    let (right, ports) = needed(own, command.rules().needs);
    let mut ports = ports.into_iter();
    // The server's own connection asks the ports, so they cannot tell that another machine wants it.
    let rights = |port: &str| match right {
        Right::Connect => roles.rights_at_port(port, peer),
        _ => roles.rights(port, peer),
    };
    let port = ports.find(|port| !rights(port).has(right))?;
    Some(format!(
        "roles.conf gives {peer} no right to {right} on {port}"
    ))
}

/// The right that a command needs, and on which ports.
fn needed<'a>(own: &'a str, needs: Needs<'a>) -> (Right, Vec<&'a str>) {
    use Right::{Administer, Connect, Read};
    match needs {
        Needs::Lookup => (Read, vec![own]),
        Needs::AdministerServer => (Administer, vec![own]),
        Needs::AdministerNew(name) if name == SERVER_CHOOSES || name.starts_with('=') => {
            (Administer, vec![ANONYMOUS_PREFIX])
        }
        Needs::AdministerNew(name) | Needs::Administer(name) => (Administer, vec![name]),
        Needs::AdministerOwned(name, owned) => {
            let owned = owned.iter().map(String::as_str);
            let names = std::iter::once(name).chain(owned);
            (Administer, names.collect())
        }
        Needs::AdministerHolders(holders) => {
            let names = holders.iter().map(|holder| holder.name.as_str());
            (Administer, names.collect())
        }
        Needs::Connect(name) => (Connect, vec![bare_name(name)]),
        Needs::ConnectBoth(source, destination) => {
            (Connect, vec![bare_name(source), bare_name(destination)])
        }
    }
}

#[cfg(test)]
mod tests {
    use std::net::IpAddr;

    use super::*;

    /// The server makes the connection itself, so that the ports take it for one of this machine.
    #[test]
    fn other_hosts_have_no_ports_connected_that_no_role_names() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("roles.conf");
        std::fs::write(&file, "[us]\nports /wam/*\nat local\nrights all\n").unwrap();
        let roles = Roles::from_file(&file).unwrap();
        let asked = |address: &str, source: &str, destination: &str| {
            let peer = Peer {
                name: "/asker",
                address: address.parse::<IpAddr>().unwrap(),
            };
            let command = Command::Subscribe {
                source: source.to_owned(),
                destination: destination.to_owned(),
                mode: String::new(),
            };
            refusal(&roles, "/root", peer, &command).is_some()
        };
        assert!(asked("192.0.2.255", "/a", "tcp://b"));
        assert!(asked("192.0.2.255", "/a", "/wam/rpc:i"));
        assert!(!asked("127.0.0.1", "/a", "tcp://b"));
        assert!(!asked("127.0.0.1", "/a", "/wam/rpc:i"));
    }
}
