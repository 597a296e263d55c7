//! The carrier `local`: messages are passed to a reader of the same process.
//!
//! No socket, and no copy of large data: a received image shares the pixels of the written one.
//! Each connection has a task of its own, so that a slow reader delays no other; a writer that
//! waits for its message waits until the reader has finished it.

use std::collections::HashMap;
use std::net::{IpAddr, Ipv4Addr};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use yarp_wire::carrier::{Carrier, CarrierSpec, Sender};
use yarp_wire::message::WireObject;
use yarp_wire::{Bottle, WireVersion};

use super::connections::{Entry, InputEntry};
use super::counters::Meter;
use super::dedicated_thread::{ConnectionControl, ControlReceiver};
use super::dispatch::Dispatcher;
use super::log_modifier;
use super::monitor::{Chain, MonitorSide};
use super::output::Output;
use super::port_context::PortContext;
use super::received_message::{Received, ValuesReservation};
use super::send_queue::{Parcel, SendQueue};
use super::socket_handle::SocketHandle;
use crate::cancel::Cancelled;
use crate::error::PortError;
use crate::latency::{keep_form, write_form};
use crate::network::Endpoint;

/// The ports of this process, by the number that they listen on.
static PORTS: Mutex<Option<HashMap<u16, Weak<Dispatcher>>>> = Mutex::new(None);

fn ports() -> MutexGuard<'static, Option<HashMap<u16, Weak<Dispatcher>>>> {
    PORTS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Makes a port known to the others of this process.
pub(super) fn announce(reader: &Arc<Dispatcher>) {
    let known = Arc::downgrade(reader);
    let mut ports = ports();
    ports
        .get_or_insert_default()
        .insert(reader.port.number, known);
}

/// Takes back [`announce`].
pub(super) fn withdraw(port: &PortContext) {
    if let Some(ports) = ports().as_mut() {
        ports.remove(&port.number);
    }
}

/// Returns the port at a place, if it is in this process.
fn find(endpoint: &Endpoint) -> Option<Arc<Dispatcher>> {
    let reader = ports().as_ref()?.get(&endpoint.port)?.upgrade()?;
    (reader.port.name == endpoint.name).then_some(reader)
}

/// Connects a port to a reader of the same process.
pub(super) fn connect(
    writer: &PortContext,
    to: &Endpoint,
    spec: &CarrierSpec,
    carrier: &'static Carrier,
) -> Result<Output, PortError> {
    let reader = find(to).ok_or_else(|| PortError::NotInProcess {
        peer: to.name.clone(),
    })?;
    let ends = (writer.name.as_str(), reader.port.name.as_str());
    let monitors = reader
        .monitors()
        .of_carrier(&spec.modifiers, MonitorSide::Receive, ends)?;
    let (control, displaced) = ConnectionControl::new();
    let meter = Arc::<Meter>::default();
    let sender = Sender {
        name: writer.name.clone(),
        modifiers: spec.modifiers.clone(),
    };
    let id = reader.connections.next_number();
    reader.connections.add_input(InputEntry {
        id,
        from: writer.name.clone(),
        carrier_text: spec.to_string(),
        carrier,
        socket: SocketHandle::none(),
        meter: meter.clone(),
        monitors: monitors.clone(),
        control,
    });
    let send_queue = Arc::new(SendQueue::new(None));
    let way = Local {
        send_queue: send_queue.clone(),
        entry: Entry {
            id,
            connections: reader.connections.clone(),
        },
        reader: reader.clone(),
        copies: log_modifier::is_requested_by(&sender),
        monitors,
        from: sender.name.into(),
        meter,
        displaced,
        closing: reader.port.cancelled.clone(),
        cancelled: writer.cancelled.clone(),
    };
    let task = tokio::spawn(way.run());
    Ok(Output::over(
        &to.name,
        spec.to_string(),
        carrier,
        WireVersion::default(),
        send_queue,
        SocketHandle::none(),
        task,
    ))
}

/// A connection within the process.
struct Local {
    send_queue: Arc<SendQueue>,
    entry: Entry,
    reader: Arc<Dispatcher>,
    copies: bool,
    /// The monitors of the messages at the reader, if any.
    monitors: Option<Arc<Chain>>,
    from: Arc<str>,
    meter: Arc<Meter>,
    /// Another connection of the same name takes its place, or the reader drops it.
    displaced: ControlReceiver,
    /// The reader closes.
    closing: Cancelled,
    /// The writer closes.
    cancelled: Cancelled,
}

impl Local {
    /// Hands over messages until either end closes.
    async fn run(self) {
        let (mut displaced, mut closing) = (self.displaced.clone(), self.closing.clone());
        let mut cancelled = self.cancelled.clone();
        let reason = tokio::select! {
            biased;
            () = displaced.ended() => "the reader closed it",
            () = closing.cancelled() => "the reader closed",
            () = cancelled.cancelled() => "the port closed",
            end = self.deliver() => end,
        };
        self.send_queue.close(reason);
    }

    /// Runs like [`Self::run`]; returns the reason for the end.
    async fn deliver(&self) -> &'static str {
        loop {
            while let Some(parcel) = self.send_queue.take_parcel() {
                if self.hand_over(parcel).await {
                    return "the reader closed it";
                }
                // Neither end need ever wait: let others run now and then.
                tokio::task::coop::consume_budget().await;
            }
            if self.send_queue.is_closed() {
                return "closed here";
            }
            self.send_queue.filled.notified().await;
        }
    }

    /// Passes one message to the reader; returns whether the connection must close after it.
    async fn hand_over(&self, parcel: Parcel) -> bool {
        let bytes = parcel.payload.len();
        self.meter.count(bytes, parcel.envelope.as_deref());
        let received = Received {
            payload: parcel.payload,
            envelope: parcel.envelope,
            from: self.from.clone(),
            address: IpAddr::V4(Ipv4Addr::LOCALHOST),
            wants_reply: parcel.wants_reply,
            responder: None,
            reservation: ValuesReservation::default(),
            connection: self.entry.id,
        };
        let monitors = self.monitors.as_ref();
        let taking = self.reader.take(monitors, received, self.copies);
        let (reply, last) = taking.await;
        let reply = parcel.wants_reply.then(|| {
            let wire_version = WireVersion::default();
            write_form(wire_version, |pieces| match reply {
                Some(reply) => reply.write_pieces(pieces, wire_version),
                None => Bottle::new().write_pieces(pieces, wire_version),
            })
        });
        self.send_queue.delivered(bytes, reply.as_ref());
        if let Some(reply) = reply {
            keep_form(reply);
        }
        last
    }
}

impl Drop for Local {
    fn drop(&mut self) {
        // Also after a panic of the reader's handler.
        self.send_queue.close("the reader failed");
    }
}
