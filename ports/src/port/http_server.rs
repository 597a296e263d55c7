//! Serving of HTTP requests.

use bytes::{Bytes, BytesMut};
use yarp_wire::connection::Message;
use yarp_wire::http::bottle_json::{self, Outer};
use yarp_wire::http::{
    Action, Admission, MAX_VALUES_SIZE, Refusal, Request, Response, Who, html_page,
};
use yarp_wire::message::{Command, Form, Payload};
use yarp_wire::protocol::{Incoming, Protocol as _, TEXT_LINES};
use yarp_wire::{Bottle, Limits, Value, WireVersion};

use super::input::{Connection, End, Next};
use super::large_messages::{read_bottle, reserve_large, run_large};
use super::port_options::Page;
use super::received_message::{Received, ValuesReservation};
use crate::roles::Right;

/// Most answers on one page, in bytes.
const ANSWERS_LIMIT: usize = 1 << 20;
/// Most lines of a request that are obeyed.
const LINES_LIMIT: usize = 1000;

impl Connection {
    /// Answers an HTTP request; the connection closes after the answer, or becomes an output of the
    /// port.
    pub(super) async fn browse(&mut self, mut request: Box<Request>) -> Next {
        let size = request.target.len() + request.form_length();
        // Before it waits for its turn: a hundred forms that wait take a hundred times their length.
        let Ok(_reservation) = reserve_large(size, || MAX_VALUES_SIZE) else {
            return self.respond(&Response::busy(), &request);
        };
        run_large(size, || request.decode_form()).await;
        if let Some(page) = self.own_page(&request) {
            if !self.may(Right::Read) {
                return self.refuse_page(&request, Right::Read);
            }
            let response = self.wait_for(page).await;
            return self.respond(&response, &request);
        }
        let action = run_large(size, || Action::of(&request)).await;
        // Any page can have a browser ask for any address.
        if request.admission.may_only_view() && !action.only_views() {
            return self.respond(&Response::refused(&Refusal::ViewOnly), &request);
        }
        if action == Action::Read && !request.admission.may_stream() {
            return self.respond(&Response::refused(&Refusal::Unknown), &request);
        }
        let needed = match &action {
            Action::Ask { who, .. } => match who {
                // Also what is asked for by its address is a message to the owner.
                Who::Owner | Who::Pages => Some(Right::Write),
                Who::Port => None,
            },
            Action::Read => Some(Right::Read),
            // Each line checks the rights that it needs.
            _ => None,
        };
        if let Some(right) = needed.filter(|right| !self.may(*right)) {
            return self.refuse_page(&request, right);
        }
        let admission = &request.admission;
        let response = match action {
            Action::Type { lines, data } => {
                let answers = self.type_lines(&lines).await;
                self.put_page(admission, &data, &answers);
                return Next::Stop(End::Closed);
            }
            Action::Ask { message, who, json } => {
                let reply = match who {
                    Who::Port => self.administer(&message).await.to_string(),
                    _ => self.ask_owner(message.to_text()).await,
                };
                let length = reply.len();
                let read = || Reply::of(&reply, json, admission);
                match run_large(length, read).await {
                    Reply::Whole(response) => response,
                    Reply::Stream(_) if !self.may(Right::Read) => {
                        return self.refuse_page(&request, Right::Read);
                    }
                    Reply::Stream(head) => {
                        self.output.extend_from_slice(head.as_bytes());
                        return Next::Stop(End::Reversed);
                    }
                }
            }
            Action::TooLarge => return self.respond(&Response::too_large(), &request),
            Action::Read => {
                let head = html_page::stream_head(&self.parts.context.name, admission);
                self.output.extend_from_slice(head.as_bytes());
                return Next::Stop(End::Reversed);
            }
        };
        self.output.extend_from_slice(response.as_bytes());
        Next::Stop(End::Closed)
    }

    fn respond(&mut self, response: &Response, request: &Request) -> Next {
        let text = response.to_text(&request.admission);
        self.output.extend_from_slice(text.as_bytes());
        Next::Stop(End::Closed)
    }

    fn refuse_page(&mut self, request: &Request, right: Right) -> Next {
        let refusal = self.refusal(right);
        self.put_page(&request.admission, "", &refusal);
        Next::Stop(End::Closed)
    }

    /// Returns the answers to lines as typed at a terminal.
    async fn type_lines(&mut self, lines: &str) -> String {
        let mut messages = TEXT_LINES.message_decoder(WireVersion::V3, Limits::DEFAULT);
        let mut nothing = BytesMut::new();
        let mut input = BytesMut::from(lines);
        input.extend_from_slice(b"\n");
        let mut answers = String::new();
        let mut count = 0;
        let mut is_cut = false;
        while let Ok(Some(Incoming::Message(message))) = messages.read(&mut input, &mut nothing) {
            is_cut = answers.len() > ANSWERS_LIMIT || count == LINES_LIMIT;
            if is_cut {
                break;
            }
            let Message { command, payload } = message;
            match command {
                Command::Data { .. } if !self.may(Right::Write) => {
                    answers += &self.refusal(Right::Write);
                }
                Command::Data { .. } => answers += &self.ask_owner(payload.bytes()).await,
                Command::Admin => {
                    let read = || read_bottle(&payload).unwrap_or_default();
                    let (request, _reservation) = run_large(payload.len(), read).await;
                    answers += &self.administer(&request).await.to_string();
                }
                command => match self.execute(command).await {
                    Ok(told) => answers += &told,
                    // Reading takes place on a page of its own.
                    Err(_) => break,
                },
            }
            if !answers.ends_with('\n') {
                answers.push('\n');
            }
            count += 1;
            // Other tasks run after each line: a hundred of these forms at once would else keep them waiting.
            tokio::task::yield_now().await;
        }
        if is_cut || answers.len() > ANSWERS_LIMIT {
            let fits = |end: &usize| answers.is_char_boundary(*end);
            let end = (0..=ANSWERS_LIMIT.min(answers.len())).rev().find(fits);
            answers.truncate(end.unwrap_or_default());
            answers += "\n(No more is answered here: at most 1000 lines, and 1 MiB of answers.)\n";
        }
        answers
    }

    /// Returns the owner's response for that address, if it serves pages.
    fn own_page(&self, request: &Request) -> Option<Page> {
        self.parts.context.options.pages.as_ref()?(request)
    }

    /// Appends the page of the port, with these answers.
    fn put_page(&mut self, admission: &Admission, data: &str, text: &str) {
        let server = self.parts.context.network.server();
        let server = server.map(|(host, port)| format!("{host}:{port}"));
        let page = html_page::Page {
            port: &self.parts.context.name,
            name_server: server.as_deref(),
            data,
            text,
        };
        page.put(admission, &mut self.output);
    }

    /// Returns the owner's reply to a message, as text.
    async fn ask_owner(&mut self, message: impl Into<Bytes>) -> String {
        let message = message.into();
        self.meter.count(message.len(), None);
        let received = Received {
            payload: Payload::new(message, Form::Text),
            envelope: None,
            from: self.from.clone(),
            address: self.address,
            wants_reply: true,
            responder: None,
            connection: self.number,
            reservation: ValuesReservation::default(),
        };
        let (reply, _) = self.deliver(received).await;
        let mut text = BytesMut::new();
        if let Some(reply) = reply {
            reply.write_text(&mut text);
        }
        String::from_utf8_lossy(&text).into_owned()
    }
}

/// A reply on its way to a browser.
enum Reply {
    Whole(String),
    /// The head of a page that streams the port's messages.
    Stream(String),
}

impl Reply {
    /// Interprets a reply as JSON if requested; else as a page with stock's keys: `web` is its
    /// body, `mime` its type, and with `stream` it continues. A reply without these keys is
    /// returned unchanged.
    fn of(reply: &str, json: Option<Outer>, admission: &Admission) -> Self {
        // A reply of so many values is no page of the owner's.
        let size = || Bottle::max_parsed_size(reply.as_bytes());
        let bottle = match reserve_large(reply.len(), size) {
            Ok(_reservation) => Bottle::parse(reply).unwrap_or_default(),
            Err(_) => Bottle::new(),
        };
        let text = |key: &str| bottle.find(key).map(Value::to_plain_string);
        let mime = text("mime");
        if let Some(outer) = json {
            let json = bottle_json::of(&bottle, outer);
            return Self::Whole(html_page::json_response(&json, mime.as_deref(), admission));
        }
        let mime = mime.as_deref().unwrap_or("text/html");
        let body = text("web").unwrap_or_default();
        if bottle.find("stream").is_some() {
            return Self::Stream(html_page::own_stream_head(&body, mime, admission));
        }
        Self::Whole(match body.is_empty() {
            true => html_page::text_response(&format!("{reply}\r\n"), admission),
            false => html_page::own_response(&body, mime, admission),
        })
    }
}
