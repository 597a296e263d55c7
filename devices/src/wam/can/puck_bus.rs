//! Queries and commands to single pucks.

use std::time::{Duration, Instant};

use super::CanErrorKind;
use crate::can::puck::{Address, Group, Node, PuckMessage, PuckProperty, Target, mode};
use crate::can::{BusError, CanBus};

/// Maximum number of attempts of a query.
const MAX_ATTEMPTS: usize = 3;
/// Maximum number of frames among which a reply is searched, so that permanent traffic does not block the driver:
/// more than fit into a second.
pub(super) const MAX_FRAMES_PER_REPLY: usize = 10_000;

/// A bus with pucks on it.
pub(super) struct PuckBus {
    bus: Box<dyn CanBus>,
    timeout: Duration,
}

impl PuckBus {
    pub(super) fn new(bus: Box<dyn CanBus>, timeout: Duration) -> Self {
        Self { bus, timeout }
    }

    pub(super) fn send(
        &mut self,
        to: impl Into<Target>,
        message: PuckMessage,
    ) -> Result<(), BusError> {
        self.bus.send(&message.frame(Address::from_host(to)))
    }

    /// Sets a property.
    pub(super) fn set_property(
        &mut self,
        node: Node,
        property: PuckProperty,
        value: i32,
    ) -> Result<(), BusError> {
        self.send(node, PuckMessage::Value { property, value })
    }

    /// Receives the next message to the host; invalid frames, and those for other receivers, are skipped. `None` at
    /// the deadline, or when as many frames have passed as `left` allows, which is counted down.
    pub(super) fn receive_message(
        &mut self,
        deadline: Instant,
        left: &mut usize,
    ) -> Result<Option<(Node, PuckMessage)>, BusError> {
        while *left > 0 {
            *left -= 1;
            let Some(frame) = self.bus.receive(deadline)? else {
                return Ok(None);
            };
            match PuckMessage::read(&frame) {
                Ok((
                    Address {
                        from,
                        to: Target::Group(Group::REPLIES),
                    },
                    message @ PuckMessage::Value { .. },
                ))
                | Ok((
                    Address {
                        from,
                        to: Target::Group(Group::POSITIONS),
                    },
                    message @ PuckMessage::Position { .. },
                )) => return Ok(Some((from, message))),
                _ => {}
            }
        }
        Ok(None)
    }

    /// Reads a property; insists a few times.
    pub(super) fn get_property(
        &mut self,
        node: Node,
        property: PuckProperty,
    ) -> Result<i32, CanErrorKind> {
        for _ in 0..MAX_ATTEMPTS {
            if let Some(value) = self.try_get_property(node, property, self.timeout)? {
                return Ok(value);
            }
        }
        Err(CanErrorKind::Silent { node })
    }

    /// Reads a property; `None` if no answer has come in this time.
    pub(super) fn try_get_property(
        &mut self,
        node: Node,
        property: PuckProperty,
        time: Duration,
    ) -> Result<Option<i32>, BusError> {
        self.send(node, PuckMessage::Get(property))?;
        self.wait_for(time, |from, message| match message {
            PuckMessage::Value {
                property: of,
                value,
            } if from == node && of == property => Some(value),
            _ => None,
        })
    }

    /// Returns whether the safety module says that the emergency stop is pressed; false if it does not answer.
    pub(super) fn is_stopped(&mut self) -> Result<bool, BusError> {
        let mode = self.try_get_property(Node::SAFETY, PuckProperty::MODE, self.timeout)?;
        Ok(mode == Some(mode::IDLE_OR_STOPPED))
    }

    /// Reads the position of a motor; tries a few times.
    pub(super) fn get_position(&mut self, node: Node) -> Result<i32, CanErrorKind> {
        for _ in 0..MAX_ATTEMPTS {
            self.send(node, PuckMessage::Get(PuckProperty::P))?;
            let found = self.wait_for(self.timeout, |from, message| match message {
                PuckMessage::Position { motor, .. } if from == node => Some(motor),
                _ => None,
            })?;
            if let Some(position) = found {
                return Ok(position);
            }
        }
        Err(CanErrorKind::Silent { node })
    }

    fn wait_for(
        &mut self,
        time: Duration,
        wanted: impl Fn(Node, PuckMessage) -> Option<i32>,
    ) -> Result<Option<i32>, BusError> {
        let deadline = Instant::now() + time;
        let mut left = MAX_FRAMES_PER_REPLY;
        while let Some((from, message)) = self.receive_message(deadline, &mut left)? {
            if let Some(value) = wanted(from, message) {
                return Ok(Some(value));
            }
        }
        Ok(None)
    }

    /// Waits, and forgets what comes meanwhile.
    pub(super) fn discard_for(&mut self, time: Duration) -> Result<(), BusError> {
        self.wait_for(time, |_, _| None).map(|_| ())
    }
}
