//! Access control for name server requests: the rights that each command needs under the roles in
//! force.

use yarp_ports::roles::{Peer, Right, Roles};
use yarp_wire::name_service::{Command, SERVER_CHOOSES};

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
    let mut needs = needed(own, command).into_iter();
    let (right, port) = needs.find(|(right, port)| !roles.rights(port, peer).has(*right))?;
    Some(format!(
        "roles.conf gives {peer} no right to {right} on {port}"
    ))
}

/// Returns the rights that a command needs, each with the port it concerns.
fn needed<'a>(own: &'a str, command: &'a Command) -> Vec<(Right, &'a str)> {
    match command {
        Command::Register(asked) if asked.name == SERVER_CHOOSES || asked.name.starts_with('=') => {
            vec![(Right::Administer, ANONYMOUS_PREFIX)]
        }
        Command::Register(asked) => vec![(Right::Administer, &asked.name)],
        // The names that a port declares to own are removed together with it.
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
            // A topic connects its writers to every subscriber.
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
