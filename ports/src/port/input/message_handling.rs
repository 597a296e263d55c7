//! Handling of the messages of a connection, and the replies.

use std::pin::pin;

use yarp_wire::Bottle;
use yarp_wire::connection::Message;
use yarp_wire::message::{Command, Payload};

use super::{Connection, End, Next, UNSENT};
use crate::port::admin_reply;
use crate::port::dispatch::Dispatched;
use crate::port::large_messages::{read_bottle, run_large, takes_long};
use crate::port::log_modifier;
use crate::port::port_options::Handler;
use crate::port::received_message::{Answer, Received, Reply, ValuesReservation};
use crate::port::text_commands::{HELP, NOT_UNDERSTOOD};
use crate::roles::Right;

/// The state of a message.
///
/// Not a [`Ready`](yarp_wire::Ready): the message is complete, and what is left carries what the
/// rest of its handling needs.
pub(super) enum Step {
    Done(Next),
    /// It is on its way to the owner; returns whether the sender wants a reply.
    Dispatch(Dispatch, bool),
    /// It is not for the owner, or the sender lacks the right to write.
    Command(Command, Payload),
}

/// A message on its way to the owner.
pub(super) enum Dispatch {
    Direct(Dispatched),
    /// The owner reads it at once, which takes long: it has to wait for its turn.
    Large(Received),
    /// There is more to pass than the owner's queue.
    Watched(Received),
}

impl Connection {
    pub(super) async fn message(&mut self, message: Message) -> Next {
        match self.handle_now(message) {
            Step::Done(next) => next,
            left => self.handle_rest(left).await,
        }
    }

    /// Performs the part of a message's handling that needs no waiting: for most that is all.
    pub(super) fn handle_now(&mut self, message: Message) -> Step {
        self.was_valid = true;
        self.record_activity();
        let Message { command, payload } = message;
        let Command::Data { reply, envelope } = command else {
            return Step::Command(command, payload);
        };
        if !self.may(Right::Write) {
            return Step::Command(Command::Data { reply, envelope }, payload);
        }
        self.meter.count(payload.len(), envelope.as_deref());
        let mut received = Received {
            payload,
            envelope,
            from: self.from.clone(),
            address: self.address,
            wants_reply: reply,
            responder: None,
            reservation: ValuesReservation::default(),
            connection: self.number,
        };
        let dispatch = match self.direct_handler(&received.payload) {
            // Most messages go this way, which does not move them.
            Some(handler) => Dispatch::Direct(Dispatched::Answered(handler(&mut received))),
            None => self.dispatch(received),
        };
        let answer = match dispatch {
            Dispatch::Direct(Dispatched::Answered(Answer::Nothing)) => (None, false),
            Dispatch::Direct(Dispatched::Answered(Answer::Reply(reply))) => (Some(reply), false),
            dispatch => return Step::Dispatch(dispatch, reply),
        };
        let next = self.answer(answer, reply);
        self.acceptor.acknowledge(&mut self.output);
        Step::Done(next)
    }

    /// Performs the rest of a message's handling.
    pub(super) async fn handle_rest(&mut self, left: Step) -> Next {
        let next = match left {
            Step::Done(next) => return next,
            Step::Dispatch(dispatch, wants_reply) => {
                let (reply, last) = self.finish(dispatch).await;
                let shared = |reply: &Reply| self.acceptor.shared_reply(&**reply);
                let shared = reply.as_ref().filter(|_| wants_reply).and_then(shared);
                match shared.filter(|text| text.len() > UNSENT) {
                    Some(text) => match Box::pin(self.write_shared(text)).await {
                        Err(end) => return Next::Stop(end),
                        Ok(()) => self.answer((None, last), false),
                    },
                    None => self.answer((reply, last), wants_reply),
                }
            }
            // The peer has no right to write.
            Step::Command(Command::Data { reply, .. }, _) => {
                if !reply {
                    return Next::Stop(End::NotAllowed(Right::Write));
                }
                let answer = admin_reply::fail(&self.refusal(Right::Write));
                self.acceptor.reply(&answer, &mut self.output);
                Next::Go
            }
            Step::Command(Command::Admin, payload) => {
                let read = || read_bottle(&payload).unwrap_or_default();
                let (request, _reservation) = run_large(payload.len(), read).await;
                let answer = self.administer(&request).await;
                self.acceptor.reply(&answer, &mut self.output);
                match self.parts.administration.ends_with(&request) {
                    true => Next::Stop(End::Closed),
                    false => Next::Go,
                }
            }
            Step::Command(command, _) => self.command(command).await,
        };
        self.acceptor.acknowledge(&mut self.output);
        next
    }

    /// Returns the answer to an admin request, or the refusal.
    pub(in crate::port) async fn administer(&mut self, request: &Bottle) -> Bottle {
        let parts = self.parts.clone();
        if let Some(right) = parts
            .administration
            .required_right(request)
            .filter(|right| !self.may(*right))
        {
            return admin_reply::fail(&self.refusal(right));
        }
        if let Some(modification) = parts.administration.modification(request)
            && let Some(reason) = self.why_not_modify(modification)
        {
            return admin_reply::fail(&reason);
        }
        self.wait_for(Box::pin(parts.administration.administer(request)))
            .await
    }

    /// Dispatches a message to the owner and waits for the reply, if one is expected; returns it
    /// and whether the connection must close after it.
    pub(in crate::port) async fn deliver(&mut self, received: Received) -> (Option<Reply>, bool) {
        let dispatch = self.dispatch(received);
        self.finish(dispatch).await
    }

    /// Returns the handler of the owner, unless monitors or loggers come first or reading the message takes long.
    fn direct_handler(&self, payload: &Payload) -> Option<&Handler> {
        let dispatcher = &self.parts.dispatcher;
        let handler = dispatcher.handler()?;
        let is_direct = self.monitors.is_none() && !dispatcher.is_watched() && !takes_long(payload);
        is_direct.then_some(handler)
    }

    /// Dispatches a message to the owner directly, unless monitors or loggers are involved or reading it takes long.
    fn dispatch(&self, received: Received) -> Dispatch {
        let dispatcher = &self.parts.dispatcher;
        if self.monitors.is_some() || dispatcher.is_watched() {
            Dispatch::Watched(received)
        } else if takes_long(&received.payload) && dispatcher.handler().is_some() {
            Dispatch::Large(received)
        } else {
            Dispatch::Direct(dispatcher.dispatch(received))
        }
    }

    /// Waits for the rest of the dispatch, which is pinned here: by value each connection would
    /// store it twice.
    async fn finish(&mut self, dispatch: Dispatch) -> (Option<Reply>, bool) {
        let parts = self.parts.clone();
        match dispatch {
            Dispatch::Direct(dispatched) => {
                self.wait_for(pin!(parts.dispatcher.finish(dispatched)))
                    .await
            }
            Dispatch::Large(received) => {
                let length = received.payload.len();
                let dispatch = || parts.dispatcher.dispatch(received);
                let dispatched = Box::pin(run_large(length, dispatch)).await;
                self.wait_for(Box::pin(parts.dispatcher.finish(dispatched)))
                    .await
            }
            Dispatch::Watched(received) => {
                let copies = log_modifier::is_requested_by(&self.sender);
                let monitors = self.monitors.clone();
                self.wait_for(pin!(parts.dispatcher.take(
                    monitors.as_ref(),
                    received,
                    copies
                )))
                .await
            }
        }
    }

    fn answer(&mut self, (reply, last): (Option<Reply>, bool), wants_reply: bool) -> Next {
        match reply {
            Some(reply) => self.reply(&reply, wants_reply),
            None => self.reply_nothing(wants_reply),
        }
        if last {
            Next::Stop(End::Closed)
        } else {
            Next::Go
        }
    }

    fn reply(&mut self, reply: &Reply, wanted: bool) {
        if wanted {
            self.acceptor.reply(&**reply, &mut self.output);
        }
    }

    /// On a binary connection a sender that requested a reply must get one: without it a stock
    /// sender takes the acknowledgement for the reply and hangs. A terminal gets none.
    fn reply_nothing(&mut self, wanted: bool) {
        let binary = self
            .acceptor
            .carrier()
            .is_some_and(|carrier| carrier.protocol.payload_kind().are_binary());
        if wanted && binary {
            self.acceptor.reply(&Bottle::new(), &mut self.output);
        }
    }

    async fn command(&mut self, command: Command) -> Next {
        match self.execute(command).await {
            Ok(lines) => {
                self.acceptor.answer_lines(&lines, &mut self.output);
                Next::Go
            }
            Err(end) => Next::Stop(end),
        }
    }

    /// Executes a command; returns the text for a terminal, or the reason for closing the
    /// connection.
    pub(in crate::port) async fn execute(&mut self, command: Command) -> Result<String, End> {
        let parts = self.parts.clone();
        let needed = match command {
            Command::AddOutput(_) | Command::RemoveOutput(_) | Command::RemoveInput(_) => {
                Some(Right::Connect)
            }
            Command::Reverse => Some(Right::Read),
            _ => None,
        };
        if let Some(right) = needed.filter(|right| !self.may(*right)) {
            return Ok(self.refusal(right) + "\r\n");
        }
        Ok(match command {
            Command::Quit => return Err(End::Closed),
            Command::Reverse => return Err(End::Reversed),
            Command::AddOutput(destination) => either(
                self.wait_for(Box::pin(
                    parts.administration.add_output_in_words(&destination),
                ))
                .await,
            ),
            Command::RemoveOutput(name) => either(
                self.wait_for(Box::pin(parts.administration.remove_output_in_words(&name)))
                    .await,
            ),
            Command::RemoveInput(name) => {
                either(self.parts.administration.remove_input_in_words(&name))
            }
            Command::Describe => self.parts.administration.describe(),
            Command::Help => HELP.to_owned(),
            _ => NOT_UNDERSTOOD.to_owned(),
        })
    }
}

fn either(result: Result<String, String>) -> String {
    match result {
        Ok(text) | Err(text) => text,
    }
}
