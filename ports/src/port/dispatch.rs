//! Dispatch of messages to the owner of the port, and of replies back.

use std::sync::Arc;

use super::connections::Connections;
use super::counters::PortCounters;
use super::log_modifier::{self, LoggedMessage};
use super::monitor::{Arbiter, Attached, Chain, ChainBuilder};
use super::port_context::PortContext;
use super::port_options::{Handler, Input, Serving};
use super::receive_queue::ReceiveQueue;
use super::received_message::{Answer, Received, Reply};
use super::reply_channel::{ReplyPool, ReplyReceiver};

/// The state of a message after the part of its dispatch that does not wait.
///
/// Not a [`Ready`](yarp_wire::Ready): each variant waits for something else, the owner's answer or
/// room in the queue.
pub(super) enum Dispatched {
    Answered(Answer),
    /// The owner has it, and will answer.
    Pending(ReplyReceiver<Answer>),
    /// The queue is full; a reply may be expected.
    QueueFull(Received, Option<ReplyReceiver<Answer>>),
}

/// Passes arriving messages through the monitors to the owner of the port.
pub(crate) struct Dispatcher {
    pub(super) port: Arc<PortContext>,
    pub(super) connections: Arc<Connections>,
    pub(crate) receive_queue: Option<ReceiveQueue>,
    /// Pool of the channels on which connections wait for the owner's replies.
    slots: ReplyPool<Answer>,
    /// Selects the writer to accept among those with `recv.priority`.
    arbiter: Arc<Arbiter>,
    /// The monitors of everything written and everything read.
    pub(super) attached_out: Attached,
    pub(super) attached_in: Attached,
}

impl Dispatcher {
    pub(crate) fn new(port: Arc<PortContext>, connections: Arc<Connections>) -> Self {
        let receive_queue = match port.options.input {
            Input::Queue(queue, _) => Some(ReceiveQueue::new(queue)),
            _ => None,
        };
        Self {
            port,
            connections,
            receive_queue,
            slots: ReplyPool::default(),
            arbiter: Arc::default(),
            attached_out: Attached::default(),
            attached_in: Attached::default(),
        }
    }

    /// Returns the builder of the monitors of connections.
    pub(super) fn monitors(&self) -> ChainBuilder<'_> {
        ChainBuilder {
            port: &self.port,
            arbiter: &self.arbiter,
        }
    }

    /// Returns the counters of the port.
    pub(crate) fn counters(&self) -> PortCounters {
        let receive_queue = self.receive_queue.as_ref();
        self.connections
            .counters(receive_queue.map_or(0, ReceiveQueue::waiting))
    }

    /// Passes a message through the monitors of a connection and of the port; `None` if one stops
    /// it.
    async fn monitored(
        &self,
        monitors: Option<&Arc<Chain>>,
        mut received: Received,
    ) -> Option<Received> {
        let attached = self.attached_in.chain();
        for chain in monitors.into_iter().chain(&attached) {
            let passing = chain.update(received.payload).await?;
            if !passing.delay.is_zero() {
                tokio::time::sleep(passing.delay).await;
            }
            received.payload = passing.payload;
        }
        Some(received)
    }

    /// Returns the handler with which the owner reads messages as they are dispatched.
    pub(super) fn handler(&self) -> Option<&Handler> {
        match &self.port.options.input {
            Input::Handler(handler) => Some(handler),
            _ => None,
        }
    }

    /// Returns whether messages that arrive have more to pass than the owner's queue.
    pub(super) fn is_watched(&self) -> bool {
        self.connections.is_logged() || self.attached_in.is_attached()
    }

    /// Passes a message through the monitors to the owner, and its copy to the loggers, unless the
    /// message is a copy already. Waits for the reply, if one is expected; returns it and whether
    /// the connection must close after it.
    pub(super) async fn take(
        &self,
        monitors: Option<&Arc<Chain>>,
        received: Received,
        copies: bool,
    ) -> (Option<Reply>, bool) {
        let Some(received) = self.monitored(monitors, received).await else {
            return (None, false);
        };
        let copy = (self.connections.is_logged() && !copies).then(|| LoggedMessage::of(&received));
        let (reply, last) = self.finish(self.dispatch(received)).await;
        if let Some(copy) = copy {
            log_modifier::forward(&self.connections.loggers(), &copy, reply.as_ref());
        }
        (reply, last)
    }

    /// Dispatches a message to the owner.
    ///
    /// Messages that the queue drops are counted at their connections.
    pub(super) fn dispatch(&self, mut received: Received) -> Dispatched {
        match &self.port.options.input {
            Input::Discard => Dispatched::Answered(Answer::Nothing),
            Input::Handler(handler) => Dispatched::Answered(handler(&mut received)),
            Input::Queue(_, serving) => {
                let mut answer = None;
                if received.wants_reply && *serving == Serving::Replies {
                    let (sender, call) = self.slots.begin();
                    received.responder = Some(sender);
                    answer = Some(call);
                }
                match self.queue().try_push(received) {
                    Ok(dropped) => {
                        dropped
                            .into_iter()
                            .for_each(|id| self.connections.count_dropped(id));
                        answer.map_or(Dispatched::Answered(Answer::Nothing), Dispatched::Pending)
                    }
                    Err(received) => Dispatched::QueueFull(received, answer),
                }
            }
        }
    }

    fn queue(&self) -> &ReceiveQueue {
        let receive_queue = self.receive_queue.as_ref();
        receive_queue.expect("a port that queues has a receive queue")
    }

    /// Waits for the rest of the dispatch.
    pub(super) async fn finish(&self, dispatched: Dispatched) -> (Option<Reply>, bool) {
        let asked = match dispatched {
            Dispatched::Answered(answer) => Err(answer),
            Dispatched::Pending(asked) => Ok(asked),
            Dispatched::QueueFull(received, asked) => {
                if let Some(id) = self.queue().push(received).await {
                    self.connections.count_dropped(id);
                }
                asked.ok_or(Answer::Nothing)
            }
        };
        let mut answer = match asked {
            Ok(asked) => asked.outcome().await,
            Err(answer) => answer,
        };
        loop {
            match answer {
                Answer::Later(later) => answer = later.await,
                Answer::Nothing => return (None, false),
                Answer::Reply(reply) => return (Some(reply), false),
                Answer::ReplyAndClose(reply) => return (Some(reply), true),
            }
        }
    }
}
