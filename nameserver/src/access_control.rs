//! What a request needs of the roles in force.

use yarp_ports::roles::{Peer, Right, Roles};
use yarp_wire::name_service::{Command, SERVER_CHOOSES};

use crate::registry::bare_name;

/// Under which name a port is looked at that has none yet.
const ANONYMOUS_PREFIX: &str = "/tmp/port/";

/// Why `peer` may not ask `command` of the server called `own`; none if it may.
pub(crate) fn refusal(
    roles: &Roles,
    own: &str,
    peer: Peer<'_>,
    command: &Command,
) -> Option<String> {
    let mut needs = needed(own, command).into_iter();
    let (right, port) = needs.find(|(right, port)| !roles.rights(port, peer).has(*right))?;
    Some(format!(
        "roles.conf gives {peer} no right to {right} on {port}"
    ))
}

/// The rights that a command needs, and on which ports.
fn needed<'a>(own: &'a str, command: &'a Command) -> Vec<(Right, &'a str)> {
    match command {
        Command::Register(asked) if asked.name == SERVER_CHOOSES || asked.name.starts_with('=') => {
            vec![(Right::Administer, ANONYMOUS_PREFIX)]
        }
        Command::Register(asked) => vec![(Right::Administer, &asked.name)],
        // What one port says to own goes with it.
        Command::Set { name, key, values } if key == "owns" => {
            let owned = values.iter().map(String::as_str);
            let names = std::iter::once(name.as_str()).chain(owned);
            names.map(|name| (Right::Administer, name)).collect()
        }
        Command::Unregister { name }
        | Command::Set { name, .. }
        | Command::Announce { name, .. } => vec![(Right::Administer, name)],
        Command::Subscribe {
            source,
            destination,
            ..
        } => vec![
            (Right::Connect, bare_name(source)),
            // A topic connects its writers to whoever subscribes.
            (Right::Connect, bare_name(destination)),
        ],
        Command::Unsubscribe { source, .. } => vec![(Right::Connect, bare_name(source))],
        Command::Topic { name, .. } | Command::Untopic { name } => {
            vec![(Right::Connect, bare_name(name))]
        }
        Command::Type { value: Some(_), .. } | Command::CollectGarbage => {
            vec![(Right::Administer, own)]
        }
        _ => vec![(Right::Read, own)],
    }
}
