//! Questions and orders to single pucks.

use std::time::{Duration, Instant};

use super::Problem;
use crate::can::puck::{Address, Group, Message, Node, Property, Target};
use crate::can::{BusError, CanBus};

/// How often a question is asked.
const TRIES: usize = 3;
/// How many frames an answer is looked for among, so that others who never fall silent do not keep us: more than fit
/// into a second.
pub(super) const MOST_FRAMES: usize = 10_000;

/// A bus with somebody to talk to.
pub(super) struct Line {
    bus: Box<dyn CanBus>,
    patience: Duration,
}

impl Line {
    pub(super) fn new(bus: Box<dyn CanBus>, patience: Duration) -> Self {
        Self { bus, patience }
    }

    pub(super) fn send(&mut self, to: impl Into<Target>, message: Message) -> Result<(), BusError> {
        self.bus.send(&message.frame(Address::from_host(to)))
    }

    /// Sets a property.
    pub(super) fn tell(
        &mut self,
        node: Node,
        property: Property,
        value: i32,
    ) -> Result<(), BusError> {
        self.send(node, Message::Value { property, value })
    }

    /// The next message to the host; what says nothing, or is for others, is left out. `None` at the deadline, or
    /// when as many frames have passed as `left` allows, which is counted down.
    pub(super) fn hear(
        &mut self,
        deadline: Instant,
        left: &mut usize,
    ) -> Result<Option<(Node, Message)>, BusError> {
        while *left > 0 {
            *left -= 1;
            let Some(frame) = self.bus.receive(deadline)? else {
                return Ok(None);
            };
            match Message::read(&frame) {
                Ok((
                    Address {
                        from,
                        to: Target::Group(Group::REPLIES),
                    },
                    message @ Message::Value { .. },
                ))
                | Ok((
                    Address {
                        from,
                        to: Target::Group(Group::POSITIONS),
                    },
                    message @ Message::Position { .. },
                )) => return Ok(Some((from, message))),
                _ => {}
            }
        }
        Ok(None)
    }

    /// Reads a property; insists a few times.
    pub(super) fn ask(&mut self, node: Node, property: Property) -> Result<i32, Problem> {
        for _ in 0..TRIES {
            if let Some(value) = self.ask_once(node, property, self.patience)? {
                return Ok(value);
            }
        }
        Err(Problem::Silent { node })
    }

    /// Reads a property; `None` if no answer has come in this time.
    pub(super) fn ask_once(
        &mut self,
        node: Node,
        property: Property,
        time: Duration,
    ) -> Result<Option<i32>, BusError> {
        self.send(node, Message::Get(property))?;
        self.find(time, |from, message| match message {
            Message::Value {
                property: of,
                value,
            } if from == node && of == property => Some(value),
            _ => None,
        })
    }

    /// Where a motor is; insists a few times.
    pub(super) fn ask_position(&mut self, node: Node) -> Result<i32, Problem> {
        for _ in 0..TRIES {
            self.send(node, Message::Get(Property::P))?;
            let found = self.find(self.patience, |from, message| match message {
                Message::Position { motor, .. } if from == node => Some(motor),
                _ => None,
            })?;
            if let Some(position) = found {
                return Ok(position);
            }
        }
        Err(Problem::Silent { node })
    }

    fn find(
        &mut self,
        time: Duration,
        wanted: impl Fn(Node, Message) -> Option<i32>,
    ) -> Result<Option<i32>, BusError> {
        let deadline = Instant::now() + time;
        let mut left = MOST_FRAMES;
        while let Some((from, message)) = self.hear(deadline, &mut left)? {
            if let Some(value) = wanted(from, message) {
                return Ok(Some(value));
            }
        }
        Ok(None)
    }

    /// Waits, and forgets what comes meanwhile.
    pub(super) fn pause(&mut self, time: Duration) -> Result<(), BusError> {
        self.find(time, |_, _| None).map(|_| ())
    }
}
