//! The monitors of one connection, one behind the other.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

use bytes::BytesMut;
use tokio::sync::Semaphore;
use yarp_wire::message::{Form, Payload, Pieces, WireObject};
use yarp_wire::typed::Property;
use yarp_wire::{Bottle, Value, WireVersion};

use super::{
    Arbiter, MONITORS, Monitor, MonitorError, MonitorSetup, MonitorSide, PORTMONITOR, Passing,
    built_in, built_in_names, is_modifier,
};
use crate::port::log_modifier::Content;
use crate::port::port_context::PortContext;

/// Minimum size of a payload that is processed where tasks may block.
const MIN_BLOCKING_LEN: usize = 16 * 1024;
/// The most monitors that one connection may ask for.
const MAX_MONITORS: usize = 16;
/// Those that make messages larger at the reader.
const EXPANDING: [&str; 3] = [
    "bottle_compression_zlib",
    "depthimage_compression_zlib",
    "image_compression_jpeg",
];
/// Messages that are expanded at a time: half of the processors stay free for others.
static EXPANSIONS: LazyLock<Semaphore> = LazyLock::new(|| {
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    Semaphore::new((processors / 2).max(1))
});

/// Monitors, in the order in which messages pass them.
#[derive(Debug)]
pub(in crate::port) struct Chain {
    monitors: Vec<Arc<dyn Monitor>>,
    /// One of them may make messages much larger.
    expands: bool,
    /// They are the owner's own, or none that a peer needs a right for.
    pub(in crate::port) is_offered: bool,
}

impl Chain {
    /// Passes a message through the monitors; `None` if one of them stops it.
    pub(in crate::port) async fn update(self: &Arc<Self>, payload: Payload) -> Option<Passing> {
        if payload.len() < MIN_BLOCKING_LEN && !self.expands {
            return self.update_now(payload);
        }
        let permit = match self.expands {
            true => EXPANSIONS.acquire().await.ok(),
            false => None,
        };
        let chain = self.clone();
        let working = tokio::task::spawn_blocking(move || {
            let _permit = permit;
            chain.update_now(payload)
        });
        // A monitor that panics stops its message.
        working.await.unwrap_or_default()
    }

    /// Passes a message like [`Chain::update`], on this thread.
    pub(in crate::port) fn update_now(&self, payload: Payload) -> Option<Passing> {
        let first = Passing::new(payload);
        self.monitors
            .iter()
            .try_fold(first, |message, monitor| monitor.update(message))
    }

    pub(in crate::port) fn reply(&self, reply: Payload) -> Payload {
        self.monitors
            .iter()
            .fold(reply, |reply, monitor| monitor.reply(reply))
    }

    pub(in crate::port) fn set(&self, parameters: &Bottle) {
        self.monitors
            .iter()
            .for_each(|monitor| monitor.set(parameters));
    }

    /// All parameters, sorted by name as in stock.
    pub(in crate::port) fn get(&self) -> Bottle {
        let all = self.monitors.iter().flat_map(|monitor| monitor.get());
        Property::from_bottle(all.collect()).to_bottle()
    }
}

/// The monitors of a port as a whole, for one direction.
#[derive(Debug, Default)]
pub(in crate::port) struct Attached {
    chain: Mutex<Option<Arc<Chain>>>,
    any: AtomicBool,
}

impl Attached {
    /// Returns the chain, if there is one; nearly free if there is none.
    pub(in crate::port) fn chain(&self) -> Option<Arc<Chain>> {
        if !self.is_attached() {
            return None;
        }
        let chain = self.chain.lock().unwrap_or_else(PoisonError::into_inner);
        chain.clone()
    }

    /// Returns whether there is a chain.
    pub(in crate::port) fn is_attached(&self) -> bool {
        self.any.load(Ordering::Relaxed)
    }

    pub(in crate::port) fn put(&self, chain: Option<Arc<Chain>>) {
        let mut slot = self.chain.lock().unwrap_or_else(PoisonError::into_inner);
        self.any.store(chain.is_some(), Ordering::Relaxed);
        *slot = chain;
    }
}

/// A message of the owner, unchanged or modified by the monitor of the port.
pub(in crate::port) enum Outgoing<'a, T> {
    Own(&'a T),
    Changed(Payload),
}

impl<'a, T: WireObject> Outgoing<'a, T> {
    /// Passes a message of the owner through a monitor, if there is one.
    pub(in crate::port) fn of(
        message: &'a T,
        chain: Option<&Chain>,
        wire_version: WireVersion,
    ) -> Option<(Self, std::time::Duration)> {
        let Some(chain) = chain else {
            return Some((Self::Own(message), std::time::Duration::ZERO));
        };
        let mut bytes = BytesMut::new();
        message.write_binary(&mut bytes, wire_version);
        let payload = Payload::new(bytes.freeze(), Form::Binary(wire_version));
        let passing = chain.update_now(payload)?;
        Some((Self::Changed(passing.payload), passing.delay))
    }
}

impl<T: WireObject> WireObject for Outgoing<'_, T> {
    fn write_pieces(&self, out: &mut Pieces, wire_version: WireVersion) {
        match self {
            Self::Own(message) => message.write_pieces(out, wire_version),
            Self::Changed(payload) => Content(payload).write_pieces(out, wire_version),
        }
    }

    fn write_binary(&self, out: &mut BytesMut, wire_version: WireVersion) {
        match self {
            Self::Own(message) => message.write_binary(out, wire_version),
            Self::Changed(payload) => Content(payload).write_binary(out, wire_version),
        }
    }

    fn write_text(&self, out: &mut BytesMut) {
        match self {
            Self::Own(message) => message.write_text(out),
            Self::Changed(payload) => Content(payload).write_text(out),
        }
    }
}

/// Builds chains of the monitors that a port knows.
#[derive(Clone, Copy)]
pub(in crate::port) struct ChainBuilder<'a> {
    pub(in crate::port) port: &'a PortContext,
    pub(in crate::port) arbiter: &'a Arc<Arbiter>,
}

impl ChainBuilder<'_> {
    /// Creates the monitors that a carrier string requests at one end of a connection; `None` if
    /// none.
    pub(in crate::port) fn of_carrier(
        &self,
        modifiers: &[(String, Option<String>)],
        side: MonitorSide,
        (from, to): (&str, &str),
    ) -> Result<Option<Arc<Chain>>, MonitorError> {
        if modifiers.is_empty() {
            return Ok(None);
        }
        let all = yarp_wire::carrier::options(modifiers);
        let Some(name) = all.find_group(side.key()) else {
            return Ok(None);
        };
        let name = name.get(1).map(Value::to_plain_string).unwrap_or_default();
        let setup = MonitorSetup {
            side,
            from: from.to_owned(),
            to: to.to_owned(),
            options: section(&all, side),
            arbiter: self.arbiter.clone(),
        };
        if name == PORTMONITOR {
            return self.portmonitor(setup).map(Some);
        }
        if side == MonitorSide::Send || !is_modifier(&name) {
            let known = match side {
                MonitorSide::Send => PORTMONITOR.to_owned(),
                MonitorSide::Receive => [PORTMONITOR, "bayer", "priority"].join(", "),
            };
            let side = side.key();
            return Err(MonitorError::NoModifier { name, side, known });
        }
        let monitor = built_in(&name, &setup)?;
        Ok(Some(Arc::new(Chain {
            monitors: vec![monitor],
            expands: false,
            is_offered: true,
        })))
    }

    /// Creates the monitor of an attach request, for everything that the port writes or reads.
    pub(in crate::port) fn attachment(
        &self,
        side: MonitorSide,
        what: &str,
    ) -> Result<Arc<Chain>, MonitorError> {
        let (from, to) = match side {
            MonitorSide::Send => (self.port.name.as_str(), ""),
            MonitorSide::Receive => ("", self.port.name.as_str()),
        };
        self.portmonitor(MonitorSetup {
            side,
            from: from.to_owned(),
            to: to.to_owned(),
            // Text that is not a bottle is ignored.
            options: Bottle::parse(what).unwrap_or_default(),
            arbiter: self.arbiter.clone(),
        })
    }

    /// Returns the monitors that `type` and `file` name, and `type1` and `file1`, and so on.
    fn portmonitor(&self, setup: MonitorSetup) -> Result<Arc<Chain>, MonitorError> {
        let word = |key: String| setup.option(&key).map(Value::to_plain_string);
        let mut monitors = Vec::new();
        let mut expansions = 0;
        let mut is_offered = true;
        for stage in 0..MAX_MONITORS {
            let number = match stage {
                0 => String::new(),
                stage => stage.to_string(),
            };
            let kind = word(format!("type{number}"));
            if kind.is_none() && stage > 0 {
                break;
            }
            let kind = kind.unwrap_or_default();
            if kind != "dll" {
                let known = self.known_monitors();
                return Err(MonitorError::NoType { name: kind, known });
            }
            let file = word(format!("file{number}")).unwrap_or_default();
            let is_own = self
                .port
                .options
                .monitors
                .iter()
                .any(|own| own.name == file);
            is_offered &= is_own;
            let expands = !is_own && EXPANDING.contains(&file.as_str());
            expansions += usize::from(expands && setup.side == MonitorSide::Receive);
            if expansions > 1 {
                let reason = "a connection expands its messages once".to_owned();
                return Err(MonitorError::Options { name: file, reason });
            }
            monitors.push(self.monitor(&file, &setup)?);
        }
        Ok(Arc::new(Chain {
            monitors,
            expands: expansions > 0,
            is_offered,
        }))
    }

    fn monitor(&self, name: &str, setup: &MonitorSetup) -> Result<Arc<dyn Monitor>, MonitorError> {
        let mut own = self.port.options.monitors.iter();
        let Some(own) = own.find(|own| own.name == name) else {
            return match MONITORS.iter().any(|(known, _)| *known == name) {
                true => built_in(name, setup),
                false => Err(MonitorError::NoMonitor {
                    name: name.to_owned(),
                    known: self.known_monitors(),
                }),
            };
        };
        (own.factory)(setup).map_err(|reason| MonitorError::Options {
            name: name.to_owned(),
            reason,
        })
    }

    fn known_monitors(&self) -> String {
        let mut known: Vec<&str> = built_in_names().collect();
        known.extend(
            self.port
                .options
                .monitors
                .iter()
                .map(|own| own.name.as_str()),
        );
        known.join(", ")
    }
}

/// Options that are read from the whole carrier string if one end has none of its own, as in 3.12.
const SHARED_OPTIONS: [&str; 2] = ["type", "context"];

/// Returns the options of one end: those behind its key, and if they name no `file`, all others behind. A `file` of its
/// own without [`SHARED_OPTIONS`] gets the first of the whole string.
fn section(all: &Bottle, side: MonitorSide) -> Bottle {
    let is = |item: &Value, key: &str| {
        let list = item.as_list();
        list.and_then(|list| list.get(0))
            .is_some_and(|first| first.to_plain_string() == key)
    };
    let mut own = all
        .iter()
        .skip_while(|item| !is(item, side.key()))
        .skip(1)
        .take_while(|item| !is(item, "send") && !is(item, "recv"))
        .cloned()
        .collect::<Bottle>();
    if own.find_group("file").is_none() {
        own.extend(all.iter().cloned());
        return own;
    }
    for key in SHARED_OPTIONS {
        if own.find_group(key).is_none() {
            own.extend(all.iter().find(|item| is(item, key)).cloned());
        }
    }
    own
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_end_has_the_options_behind_its_key_or_all() {
        let check = |text: &str, side, expected: &str| {
            let spec: yarp_wire::carrier::CarrierSpec = text.parse().unwrap();
            let options = section(&spec.options(), side);
            let found = options.find_group("file").map(ToString::to_string);
            assert_eq!(found.unwrap_or_default(), expected, "{text}");
        };
        use MonitorSide::{Receive, Send};
        let both = "tcp+send.portmonitor+file.a+type.dll+recv.portmonitor+file.b+type.dll";
        check(both, Send, "file a");
        check(both, Receive, "file b");
        let shared = "tcp+send.portmonitor+recv.portmonitor+type.dll+file.c";
        check(shared, Send, "file c");
        check(shared, Receive, "file c");
        check("tcp+type.dll+file.d+recv.portmonitor", Receive, "file d");
    }

    #[test]
    fn both_ends_share_a_type_and_a_context() {
        let check = |text: &str, side, expected: [&str; 3]| {
            let spec: yarp_wire::carrier::CarrierSpec = text.parse().unwrap();
            let options = section(&spec.options(), side);
            let word = |key: &str| options.find_group(key)?.get(1).map(Value::to_plain_string);
            let found = ["file", "type", "context"].map(|key| word(key).unwrap_or_default());
            assert_eq!(found, expected, "{text}");
        };
        use MonitorSide::{Receive, Send};
        let last =
            "fast_tcp+send.portmonitor+file.a+recv.portmonitor+file.b+type.dll+context.c+x.1";
        check(last, Send, ["a", "dll", "c"]);
        check(last, Receive, ["b", "dll", "c"]);
        let first = "tcp+send.portmonitor+file.a+type.dll+recv.portmonitor+file.b";
        check(first, Receive, ["b", "dll", ""]);
        let each = "tcp+send.portmonitor+file.a+type.lua+recv.portmonitor+file.b+type.dll";
        check(each, Send, ["a", "lua", ""]);
        check(each, Receive, ["b", "dll", ""]);
    }
}
