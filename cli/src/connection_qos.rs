//! How a connection is treated, as the ports at its two ends tell and are told.

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
    /// The port at the other end.
    peer: String,
}

/// What to do with which connection, and how.
pub(crate) struct QosCommand<'a> {
    /// Whether something is to be set, not told.
    pub(crate) sets: bool,
    source: &'a str,
    destination: &'a str,
    /// The words behind the ports.
    pub(crate) rest: &'a [String],
}

impl<'a> QosCommand<'a> {
    /// Reads the words of a command; `None`, and a complaint, if they say nothing that it does.
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

    /// The two ends of the connection; `None`, and a complaint, if one is not there.
    pub(crate) async fn ends(
        &self,
        network: &Network,
        out: &mut dyn Write,
    ) -> Result<Option<[End; 2]>> {
        ends(network, self.source, self.destination, out).await
    }

    /// Which end is to be set to what; `None`, and a complaint, if that is not said.
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

    /// Prints what was asked for, if there is something.
    pub(crate) fn tell(&self, text: Option<String>, out: &mut dyn Write) -> Result<ExitCode> {
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

/// Source and destination of a connection; `None`, and a complaint, if one is not there.
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
    /// Group `name` of what the port tells of the connection; `None`, and a complaint, without one.
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

    /// Sets group `name` at the port; tells whether it did, and complains if not.
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

/// Which of two words after the ports is `--src` (0) or `--des` (1), and the other word.
pub(crate) fn side<'a>(first: &'a str, second: &'a str) -> Option<(usize, &'a str)> {
    let side = |word| ["--src", "--des"].iter().position(|name| *name == word);
    match (side(first), side(second)) {
        (Some(side), None) => Some((side, second)),
        (None, Some(side)) => Some((side, first)),
        _ => None,
    }
}

/// What `set` answers if it does not hear what to set.
const TOO_FEW: &str = "Set mode must have the port to apply the new parameter to and \
    the value of the packet priority as parameters (argc>=4)";

/// What ends are called where they are printed.
pub(crate) const NAMES: [&str; 2] = ["src", "des"];
