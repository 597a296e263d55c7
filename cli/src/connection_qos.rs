//! Quality of service of a connection, read and set at both of its ports.

use std::io::Write;
use std::process::ExitCode;

use yarp_ports::{Endpoint, Network, remote_admin};
use yarp_wire::{Bottle, Value};

use crate::error::Result;
use crate::network_access;
use crate::stock_format::complain;

/// One end of a connection.
pub(crate) struct End {
    place: Endpoint,
    /// Port at the other end.
    peer: String,
}

/// Words of a `get` or `set` command.
pub(crate) struct QosCommand<'a> {
    /// True for `set`, false for `get`.
    pub(crate) sets: bool,
    source: &'a str,
    destination: &'a str,
    /// Words after the ports.
    pub(crate) rest: &'a [String],
}

impl<'a> QosCommand<'a> {
    /// Parses the words of a command; prints an error and returns `None` if they are invalid.
    pub(crate) fn parse(
        words: &'a [String],
        command: &str,
        out: &mut dyn Write,
    ) -> Result<Option<Self>> {
        let text = match words {
            [] => format!(
                "Not enough parameters/options. If not sure on how to use the command, \
                 please type \"yarp {command} --help\" for instructions"
            ),
            [mode, more @ ..] if mode == "get" || mode == "set" => match more {
                [source, destination, rest @ ..] => {
                    return Ok(Some(Self {
                        sets: mode == "set",
                        source,
                        destination,
                        rest,
                    }));
                }
                _ => "Get/set mode must have two ports involved in the connection as parameters \
                      (argc>=2)"
                    .to_owned(),
            },
            _ => format!("Unspupported mode (type \"yarp {command} --help\" to get help)"),
        };
        complain(out, &text)?;
        Ok(None)
    }

    /// Returns the two ends of the connection; prints an error and returns `None` if one does not
    /// exist.
    pub(crate) async fn ends(
        &self,
        network: &Network,
        out: &mut dyn Write,
    ) -> Result<Option<[End; 2]>> {
        ends(network, self.source, self.destination, out).await
    }

    /// Returns which end to set, and the value; prints an error and returns `None` if they are
    /// missing.
    pub(crate) fn chosen(&self, out: &mut dyn Write) -> Result<Option<(usize, &'a str)>> {
        let [first, second, ..] = self.rest else {
            complain(out, TOO_FEW)?;
            return Ok(None);
        };
        let chosen = side(first, second);
        if chosen.is_none() {
            let text = "You haven't specified a port to which to apply the changes";
            complain(out, text)?;
        }
        Ok(chosen)
    }

    /// Prints the value, or an error if there is none.
    pub(crate) fn print_value(
        &self,
        text: Option<String>,
        out: &mut dyn Write,
    ) -> Result<ExitCode> {
        match text {
            Some(text) => {
                writeln!(out, "{text}")?;
                Ok(ExitCode::SUCCESS)
            }
            None => {
                let rest = self.rest.join(" ");
                complain(out, &format!("Wrong value. Do not know what {rest} is"))?;
                Ok(ExitCode::FAILURE)
            }
        }
    }
}

/// Returns source and destination of a connection; prints an error and returns `None` if one does
/// not exist.
async fn ends(
    network: &Network,
    source: &str,
    destination: &str,
    out: &mut dyn Write,
) -> Result<Option<[End; 2]>> {
    let mut ends = Vec::new();
    for (name, peer) in [(source, destination), (destination, source)] {
        let Some(place) = network_access::alive(network, name).await else {
            complain(out, &format!("{name} not found. Please check again"))?;
            return Ok(None);
        };
        let peer = peer.to_owned();
        ends.push(End { place, peer });
    }
    Ok(ends.try_into().ok())
}

impl End {
    /// Returns group `name` of the port's properties of the connection; prints an error and returns
    /// `None` if it is missing.
    pub(crate) async fn get(
        &self,
        network: &Network,
        name: &str,
        out: &mut dyn Write,
    ) -> Result<Option<Bottle>> {
        let request = Bottle::from_iter(["prop".into(), "get".into(), self.peer.as_str().into()]);
        let answer = remote_admin::administer(network, &self.place, &request).await?;
        let group = answer.find(name).and_then(Value::as_list).cloned();
        if group.is_none() {
            let port = &self.place.name;
            complain(
                out,
                &format!("Cannot get qos properties of '{port}'. ({answer})"),
            )?;
        }
        Ok(group)
    }

    /// Sets group `name` at the port; returns true on success, and prints an error otherwise.
    pub(crate) async fn set(
        &self,
        network: &Network,
        name: &str,
        values: &[(&str, i32)],
        out: &mut dyn Write,
    ) -> Result<bool> {
        let values = values.iter().map(|(key, value)| {
            Value::from(Bottle::from_iter([(*key).into(), Value::Int32(*value)]))
        });
        let group = [name.into(), Value::Dictionary(values.collect())];
        let request = Bottle::from_iter([
            "prop".into(),
            "set".into(),
            self.peer.as_str().into(),
            Bottle::from_iter(group).into(),
        ]);
        let answer = remote_admin::administer(network, &self.place, &request).await?;
        let done = answer
            .get(0)
            .is_some_and(|word| word.to_plain_string() == "ok");
        if !done {
            let port = &self.place.name;
            complain(
                out,
                &format!("Cannot set qos properties of '{port}'. ({answer})"),
            )?;
        }
        Ok(done)
    }
}

/// Parses two words after the ports: returns `--src` as 0 or `--des` as 1, and the other word.
pub(crate) fn side<'a>(first: &'a str, second: &'a str) -> Option<(usize, &'a str)> {
    let side = |word| ["--src", "--des"].iter().position(|name| *name == word);
    match (side(first), side(second)) {
        (Some(side), None) => Some((side, second)),
        (None, Some(side)) => Some((side, first)),
        _ => None,
    }
}

/// Error of `set` without a value.
const TOO_FEW: &str = "Set mode must have the port to apply the new parameter to and \
    the value of the packet priority as parameters (argc>=4)";

/// Printed names of the two ends.
pub(crate) const NAMES: [&str; 2] = ["src", "des"];
