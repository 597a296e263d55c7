//! The representation of queued messages, by transport.

use std::collections::VecDeque;

use bytes::{Bytes, BytesMut};
use yarp_wire::carrier::Transport;
use yarp_wire::connection::Initiator;
use yarp_wire::message::{Command, Payload};

use crate::latency::Form;
use crate::latency::{Batch, DatagramBatch};

/// Room for several small messages to a reader in this process.
const INITIAL_CAPACITY: usize = 1024;

/// Messages that are to be sent.
#[derive(Debug)]
pub(super) enum TransportQueue {
    /// The bytes of a stream.
    Stream(Initiator, Batch),
    /// The bytes of each message separately.
    Datagrams(Initiator, DatagramBatch),
    /// Unencoded, for a reader in this process; small messages are copied into the buffer.
    Local(VecDeque<Parcel>, BytesMut),
}

/// A message for a reader in this process.
#[derive(Debug)]
pub(crate) struct Parcel {
    pub(crate) payload: Payload,
    pub(crate) envelope: Option<Bytes>,
    pub(crate) wants_reply: bool,
}

impl TransportQueue {
    /// For a connection over a socket, or to a reader in this process.
    pub(super) fn new(initiator: Option<Initiator>) -> Self {
        let Some(initiator) = initiator else {
            return Self::Local(VecDeque::new(), BytesMut::new());
        };
        match initiator.carrier().transport {
            Transport::Datagrams | Transport::Group => {
                Self::Datagrams(initiator, DatagramBatch::default())
            }
            _ => Self::Stream(initiator, Batch::default()),
        }
    }

    /// Returns whether the reader reports the completion of such a message.
    pub(super) fn is_answered(&self, command: &Command) -> bool {
        match self {
            Self::Stream(initiator, _) | Self::Datagrams(initiator, _) => {
                initiator.carrier().acknowledges || wants_reply(command)
            }
            Self::Local(..) => matches!(command, Command::Data { .. }),
        }
    }

    /// Returns whether the sending task has been notified of queued bytes that it has not taken
    /// yet: it will also take later ones.
    pub(super) fn is_expected(&self) -> bool {
        match self {
            Self::Stream(_, batch) => !batch.is_empty(),
            Self::Datagrams(..) | Self::Local(..) => false,
        }
    }

    /// Appends a message; returns how many bytes that makes.
    pub(super) fn put(&mut self, command: &Command, form: &Form) -> usize {
        let pieces = &form.pieces;
        match self {
            Self::Stream(initiator, batch) => {
                let before = batch.len();
                initiator.send(command, pieces.len(), batch.buffer());
                batch.push(pieces);
                batch.len() - before
            }
            Self::Datagrams(initiator, messages) => {
                messages.push(|out| initiator.send(command, pieces.len(), out), pieces)
            }
            Self::Local(parcels, room) => {
                // Commands are for peers elsewhere.
                let Command::Data { envelope, .. } = command else {
                    return 0;
                };
                parcels.push_back(Parcel {
                    payload: in_process(form, room),
                    envelope: envelope.clone(),
                    wants_reply: wants_reply(command),
                });
                pieces.len()
            }
        }
    }

    /// The reply of a reader in this process.
    pub(super) fn reply(&mut self, reply: &Form) -> Option<Payload> {
        match self {
            Self::Local(_, room) => Some(in_process(reply, room)),
            Self::Stream(..) | Self::Datagrams(..) => None,
        }
    }

    pub(super) fn clear(&mut self) {
        match self {
            Self::Stream(_, batch) => batch.clear(),
            Self::Datagrams(_, messages) => messages.clear(),
            Self::Local(parcels, _) => parcels.clear(),
        }
    }
}

/// Creates a message for a reader in this process, or its reply. Small ones share a buffer.
fn in_process(form: &Form, room: &mut BytesMut) -> Payload {
    if let Some(written) = form.pieces.as_written()
        && room.capacity() < written.len()
    {
        room.reserve(written.len().max(INITIAL_CAPACITY));
    }
    Payload::of_pieces_in(&form.pieces, form.wire_version, room)
}

fn wants_reply(command: &Command) -> bool {
    matches!(command, Command::Admin | Command::Data { reply: true, .. })
}
