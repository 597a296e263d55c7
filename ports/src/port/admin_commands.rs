//! Answers to admin requests, in stock's words.

use std::sync::Arc;

use yarp_wire::admin::{AdminRequest, Direction};
use yarp_wire::carrier::Carrier;
use yarp_wire::{Bottle, Limits, Value, Vocab32, WireVersion};

use super::admin_reply::{counted, fail, group, ok, pair, scheduling};
use super::administration::Administration;
use super::monitor::{Attached, Chain, MonitorSide};
use super::port_options::{Input, Outputs, Serving};
use super::pray_command;
use crate::log_text::printable;
use crate::port_limits::{MAX_PROPERTIES, MAX_PROPERTY_BYTES};
use crate::roles::{self, Right};
use crate::thread_schedule::{self, Schedule};
use crate::version_probe;

/// Stock's answer to `[help]`. Source: recorded traffic of 3.12.3 and 4.0.0.
const HELP: [&str; 20] = [
    "[help]                  # give this help",
    "[ver]                   # report protocol version information",
    "[add] $portname         # add an output connection",
    "[add] $portname $car    # add an output with a given protocol",
    "[del] $portname         # remove an input or output connection",
    "[list] [in]             # list input connections",
    "[list] [out]            # list output connections",
    "[list] [in]  $portname  # give details for input",
    "[list] [out] $portname  # give details for output",
    "[prop] [get]            # get all user-defined port properties",
    "[prop] [get] $prop      # get a user-defined port property (prop, val)",
    "[prop] [set] $prop $val # set a user-defined port property (prop, val)",
    "[prop] [get] $portname  # get Qos properties of a connection to/from a port",
    "[prop] [set] $portname  # set Qos properties of a connection to/from a port",
    "[prop] [get] $cur_port  # get information about current process (e.g., scheduling priority, pid)",
    "[prop] [set] $cur_port  # set properties of the current process (e.g., scheduling priority, pid)",
    "[atch] [out] $prop      # attach a portmonitor plug-in to the port's output",
    "[atch] [in]  $prop      # attach a portmonitor plug-in to the port's input",
    "[dtch] [out]            # detach portmonitor plug-in from the port's output",
    "[dtch] [in]             # detach portmonitor plug-in from the port's input",
];

/// Returns the right that a request needs; `None` if every peer may send it.
fn required_right(request: &Bottle) -> Option<Right> {
    match AdminRequest::parse(request) {
        AdminRequest::Add(_) | AdminRequest::Remove(_) => Some(Right::Connect),
        AdminRequest::Set(..)
        | AdminRequest::SetProperty(..)
        | AdminRequest::Attach(..)
        | AdminRequest::Detach(_)
        | AdminRequest::PublisherUpdate
        | AdminRequest::RequestTopic
        | AdminRequest::BusInfo
        | AdminRequest::Other(_) => Some(Right::Administer),
        _ => None,
    }
}

/// A change that the right to administer a port does not suffice for.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Modification {
    /// Of the monitors of a port, or of the scheduling of its process. The owner of a port may deny it to everybody
    /// ([`PortOptions::deny_modification`](crate::PortOptions::deny_modification)).
    Port,
    /// Of the scheduling of one connection.
    Connection,
}

/// Peer that requests a [`Modification`]; it may administer the port.
#[derive(Clone, Copy, Debug)]
pub(super) struct Asking {
    /// It speaks as browsers do.
    pub(super) is_page: bool,
    /// It is on this machine.
    pub(super) is_local: bool,
    /// A role names the port, so that the right to administer it was given on purpose.
    pub(super) is_named: bool,
}

impl Asking {
    /// Returns why it may not; none if it may.
    pub(super) fn why_not(
        self,
        port: &str,
        modification: Modification,
        modifiable: bool,
    ) -> Option<String> {
        if modification == Modification::Port && !modifiable {
            return Some(format!("not allowed: the owner of {port} refuses it"));
        }
        if self.is_page {
            return Some("not allowed from pages".to_owned());
        }
        let may = self.is_local || self.is_named;
        (!may).then(|| {
            let file = roles::FILE;
            format!("not allowed from other machines: {file} may give `administer` on {port}")
        })
    }
}

/// Returns a request as a port of this wire version parses it: 3.x truncates its words to four
/// characters.
///
/// A peer that probes the wire version (`version_probe.rs`) thus learns the one assumed for peers
/// that do not reveal theirs.
fn as_parsed_by(request: &Bottle, wire_version: WireVersion) -> Bottle {
    let cut = |value: &Value| match (value, wire_version) {
        (Value::Vocab64(word), WireVersion::V3) => Value::Vocab32(word.truncated()),
        _ => value.clone(),
    };
    request.iter().map(cut).collect()
}

impl Administration {
    /// Returns the right that a peer needs for its request; `None` for requests that any peer may send.
    pub(super) fn required_right(&self, request: &Bottle) -> Option<Right> {
        required_right(&as_parsed_by(request, self.port.options.wire_version))
    }

    /// Returns what a request modifies; `None` for all others.
    pub(super) fn modification(&self, request: &Bottle) -> Option<Modification> {
        match AdminRequest::parse(&as_parsed_by(request, self.port.options.wire_version)) {
            AdminRequest::Attach(..) | AdminRequest::Detach(_) => Some(Modification::Port),
            AdminRequest::SetProperty(key, groups) => {
                let has = |group| groups.find_group(group).is_some();
                match key {
                    key if key == self.port.name && has("process") => Some(Modification::Port),
                    key if key.starts_with('/') && has("sched") => Some(Modification::Connection),
                    _ => None,
                }
            }
            _ => None,
        }
    }

    /// Returns the answer to an admin request.
    pub(super) async fn administer(&self, request: &Bottle) -> Bottle {
        let request = as_parsed_by(request, self.port.options.wire_version);
        match AdminRequest::parse(&request) {
            AdminRequest::Help => {
                let mut answer = Bottle::of(Vocab32::MANY);
                answer.extend(HELP.map(Value::from));
                answer
            }
            AdminRequest::Version => Bottle::from_iter([
                Vocab32::new("ver").into(),
                Value::Int32(1),
                Value::Int32(2),
                Value::Int32(3),
            ]),
            AdminRequest::Add(destination) => counted(self.add_output_in_words(&destination).await),
            AdminRequest::Remove(name) => self.remove(&name).await,
            AdminRequest::List(direction, None) => self.names(direction),
            AdminRequest::List(direction, Some(name)) => self.details(direction, &name),
            AdminRequest::Set(direction, name, parameters) => {
                self.set_parameters(direction, name, &parameters)
            }
            AdminRequest::Get(direction, name) => self.parameters(direction, name),
            AdminRequest::GetProperty(key) => self.property(key),
            AdminRequest::SetProperty(key, values) => self.set_property(key, values).await,
            AdminRequest::UnknownProperty => fail("property action not known"),
            AdminRequest::Attach(None, _) => {
                fail("attach command must be followed by [out] or [in]")
            }
            AdminRequest::Attach(Some(direction), what) => self.attach(direction, &what),
            AdminRequest::Detach(None) => fail("detach command must be followed by [out] or [in]"),
            AdminRequest::Detach(Some(direction)) => {
                self.attached(direction).1.put(None);
                ok()
            }
            // With one word more than stock's: a probing caller of this implementation must take
            // this port neither for 3.x nor for 4.0 (`version_probe.rs`).
            AdminRequest::Process => Bottle::from_iter([
                1.into(),
                "".into(),
                (std::process::id() as i32).into(),
                version_probe::EITHER_VERSION.into(),
            ]),
            AdminRequest::Pray => {
                let lines = pray_command::pray(&self.port.name);
                lines.into_iter().map(Value::from).collect()
            }
            // The answer of a port outside any ROS graph.
            AdminRequest::PublisherUpdate if self.is_of_3() => {
                Bottle::from_iter([Value::Int32(1), "ok".into()])
            }
            AdminRequest::RequestTopic if self.is_of_3() => {
                let number = i32::from(self.port.number).into();
                let place = ["TCPROS".into(), self.port.host.as_str().into(), number];
                let place = Bottle::from_iter(place).into();
                Bottle::from_iter([1.into(), self.port.name.as_str().into(), place])
            }
            AdminRequest::BusInfo if self.is_of_3() => {
                let none = Bottle::of(Bottle::new()).into();
                Bottle::from_iter([1.into(), "".into(), none])
            }
            _ => {
                let own = self.port.options.admin.as_ref();
                let own = own.and_then(|admin| admin(&request));
                own.unwrap_or_else(|| fail("send [help] for list of valid commands"))
            }
        }
    }

    /// Returns whether the connection ends with the answer.
    pub(super) fn ends_with(&self, request: &Bottle) -> bool {
        self.is_of_3() && AdminRequest::parse(request).is_of_ros()
    }

    fn is_of_3(&self) -> bool {
        self.port.options.wire_version == WireVersion::V3
    }

    async fn remove(&self, name: &str) -> Bottle {
        match (
            self.remove_output_in_words(name).await,
            self.remove_input_in_words(name),
        ) {
            (Ok(text), _) | (Err(_), Ok(text)) => counted(Ok(text)),
            (Err(out), Err(back)) => counted(Err(out + &back)),
        }
    }

    fn names(&self, direction: Direction) -> Bottle {
        match direction {
            Direction::In => {
                let inputs = self.connections.inputs();
                inputs
                    .iter()
                    .map(|input| input.from.as_str().into())
                    .collect()
            }
            Direction::Out => {
                let outputs = self.connections.outputs();
                outputs
                    .iter()
                    .map(|output| output.to.as_str().into())
                    .collect()
            }
        }
    }

    fn details(&self, direction: Direction, name: &str) -> Bottle {
        let name = yarp_wire::Contact::parse(name).name;
        let mut answer = Bottle::new();
        let mut add = |from: &str, to: &str, text: &str, carrier: &Carrier| {
            answer.push(pair("from", from));
            answer.push(pair("to", to));
            answer.push(pair("carrier", text));
            if carrier.connectionless {
                answer.push(pair("connectionless", 1));
            }
            if !carrier.push {
                answer.push(pair("push", 0));
            }
        };
        match direction {
            Direction::In => {
                for input in self
                    .connections
                    .inputs()
                    .iter()
                    .filter(|input| input.from == name)
                {
                    let (from, text) = (&input.from, &input.carrier_text);
                    add(from, &self.port.name, text, input.carrier);
                }
            }
            Direction::Out => {
                for output in self
                    .connections
                    .outputs()
                    .iter()
                    .filter(|output| output.to == name)
                {
                    let (to, text) = (&output.to, &output.carrier_text);
                    add(&self.port.name, to, text, output.carrier);
                }
            }
        }
        answer
    }

    /// `[atch]`: attaches one monitor for all that the port writes or reads, replacing an earlier
    /// one. As in stock, the earlier one is removed even if the new one cannot be created; the
    /// reason follows stock's text.
    fn attach(&self, direction: Direction, what: &str) -> Bottle {
        let (side, attached) = self.attached(direction);
        attached.put(None);
        match self.dispatcher.monitors().attachment(side, what) {
            Ok(chain) => {
                attached.put(Some(chain));
                ok()
            }
            Err(error) => {
                let reason = error.to_string();
                tracing::warn!(port = %self.port.name, "no monitor is attached: {}", printable(&reason));
                fail("Failed to configure the portmonitor plug-in").with(error.to_string())
            }
        }
    }

    fn attached(&self, direction: Direction) -> (MonitorSide, &Attached) {
        match direction {
            Direction::In => (MonitorSide::Receive, &self.dispatcher.attached_in),
            Direction::Out => (MonitorSide::Send, &self.dispatcher.attached_out),
        }
    }

    /// A connection without parameters accepts any, as in stock.
    fn set_parameters(
        &self,
        direction: Direction,
        name: Option<String>,
        parameters: &Bottle,
    ) -> Bottle {
        let way = match direction {
            Direction::In => "from",
            Direction::Out => "to",
        };
        match self.find(direction, name) {
            Ok((name, chain)) => {
                if let Some(chain) = chain {
                    chain.set(parameters);
                }
                match name == self.port.name {
                    true => ok(),
                    false => counted(Ok(format!("Configured connection {way} {name}\r\n"))),
                }
            }
            Err(answer) => answer,
        }
    }

    fn parameters(&self, direction: Direction, name: Option<String>) -> Bottle {
        match self.find(direction, name) {
            Ok((_, chain)) => {
                let parameters = chain.map(|chain| chain.get()).unwrap_or_default();
                Bottle::of(Value::Dictionary(parameters))
            }
            Err(answer) => answer,
        }
    }

    /// Returns the monitors of the named connection, or of the port itself under its own name, or
    /// stock's answer that there are none.
    fn find(
        &self,
        direction: Direction,
        name: Option<String>,
    ) -> Result<(String, Option<Arc<Chain>>), Bottle> {
        let Some(name) = name else {
            return Err(counted(Err("target port is not specified.\r\n".to_owned())));
        };
        let (found, place, way) = match direction {
            Direction::In => {
                let inputs = self.connections.inputs();
                let found = inputs.iter().find(|input| input.from == name);
                (found.map(|input| input.monitors.clone()), "input", "from")
            }
            Direction::Out => {
                let outputs = self.connections.outputs();
                let found = outputs.iter().find(|output| output.to == name);
                (found.map(|output| output.monitors.clone()), "output", "to")
            }
        };
        if name == self.port.name {
            return match self.attached(direction).1.chain() {
                Some(chain) => Ok((name, Some(chain))),
                None => Err(fail(&format!(
                    "No port modifier is attached to the {place}"
                ))),
            };
        }
        // Stock says incoming for either direction.
        found.map(|chain| (name.clone(), chain)).ok_or_else(|| {
            let text = format!("Could not find an incoming connection {way} {name}\r\n");
            counted(Err(text))
        })
    }

    fn property(&self, key: Option<String>) -> Bottle {
        let Some(key) = key else {
            let properties = self.properties();
            return properties
                .iter()
                .map(|(key, values)| {
                    let mut entry = Bottle::of(key.as_str());
                    entry.extend(values.iter().cloned());
                    entry.into()
                })
                .collect();
        };
        if key == self.port.name {
            return self.own_properties();
        }
        if key.starts_with('/') {
            return self.connection_properties(&key);
        }
        let properties = self.properties();
        let found = properties.iter().find(|(name, _)| *name == key);
        match found {
            Some((_, values)) => values.clone(),
            None if key == "counters" => {
                drop(properties);
                self.dispatcher.counters().to_bottle()
            }
            None => Bottle::new(),
        }
    }

    async fn set_property(&self, key: String, values: Bottle) -> Bottle {
        if key.starts_with('/') {
            return self.set_connection_properties(&key, &values).await;
        }
        // This form holds all values.
        let size = |key: &str, values: &Bottle| key.len() + values.encode(WireVersion::V4).len();
        let mut properties = self.properties();
        let others = properties.iter().filter(|(name, _)| *name != key);
        let (count, bytes) = others.fold((0, 0), |(count, bytes), (name, values)| {
            (count + 1, bytes + size(name, values))
        });
        if count >= MAX_PROPERTIES {
            return fail("too many properties");
        }
        if bytes + size(&key, &values) > MAX_PROPERTY_BYTES {
            let text = format!(
                "too large: the properties of a port have {MAX_PROPERTY_BYTES} bytes in all"
            );
            return fail(&text);
        }
        // A part of a message would keep all of it in memory.
        let bytes = values.encode(WireVersion::V4);
        let copied = Bottle::decode(&bytes, WireVersion::V4, Limits::DEFAULT);
        let values = copied.unwrap_or_default();
        match properties.binary_search_by(|(name, _)| name.cmp(&key)) {
            Ok(found) => properties[found].1 = values,
            Err(place) => properties.insert(place, (key, values)),
        }
        ok()
    }

    fn own_properties(&self) -> Bottle {
        // The name it was invoked with: `yarp`, not its path.
        let mut words = std::env::args_os().map(|word| word.to_string_lossy().into_owned());
        let program = words.next().unwrap_or_default();
        let arguments: Vec<String> = words.collect();
        let is_input = self.port.options.outputs != Outputs::One
            || !matches!(self.port.options.input, Input::Discard);
        let is_rpc = matches!(self.port.options.input, Input::Queue(_, Serving::Replies))
            || self.port.options.outputs == Outputs::One;
        let number = |flag: bool| i32::from(flag);
        let schedule = Schedule::now().unwrap_or_default();
        Bottle::from_iter([
            scheduling(schedule, thread_schedule::thread()),
            group(
                "process",
                [
                    pair("arguments", arguments.join(" ")),
                    pair("name", program),
                    pair("pid", std::process::id() as i32),
                    pair("policy", schedule.policy),
                    pair("priority", schedule.priority),
                ],
            ),
            group(
                "platform",
                [
                    pair("hostname", self.port.host.as_str()),
                    pair("os", "Linux"),
                ],
            ),
            group(
                "port",
                [
                    pair("is_input", number(is_input)),
                    pair(
                        "is_output",
                        number(self.port.options.outputs != Outputs::None),
                    ),
                    pair("is_rpc", number(is_rpc)),
                    pair(
                        "type",
                        self.port.options.type_name.clone().unwrap_or_default(),
                    ),
                ],
            ),
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_machines_modify_ports_that_roles_name_and_pages_none() {
        for (is_page, is_local, is_named, may) in [
            (false, true, false, true),
            (false, false, false, false),
            (false, false, true, true),
            (true, true, true, false),
        ] {
            let asking = Asking {
                is_page,
                is_local,
                is_named,
            };
            for modification in [Modification::Port, Modification::Connection] {
                let refused = asking.why_not("/p", modification, true).is_some();
                assert_eq!(refused, !may, "{asking:?} {modification:?}");
            }
            let refused = |modification| asking.why_not("/p", modification, false).is_some();
            assert!(refused(Modification::Port), "the owner decides");
            assert_eq!(refused(Modification::Connection), !may, "{asking:?}");
        }
    }

    #[test]
    fn long_words_are_looked_at_as_they_are_obeyed() {
        let long = Bottle::from_iter([
            Value::Vocab64(yarp_wire::Vocab64::from_bytes(b"dtchmore")),
            Value::from(Vocab32::new("in")),
        ]);
        assert_eq!(
            required_right(&as_parsed_by(&long, WireVersion::V3)),
            Some(Right::Administer)
        );
        let parsed = AdminRequest::parse(&as_parsed_by(&long, WireVersion::V3));
        assert_eq!(parsed, AdminRequest::Detach(Some(Direction::In)));
    }
}
