//! Serving of HTTP requests.

use bytes::{Bytes, BytesMut};
use yarp_wire::connection::Message;
use yarp_wire::http::bottle_json::{self, Outer};
use yarp_wire::http::{Action, Request, Who, html_page};
use yarp_wire::message::{Command, Form, Payload};
use yarp_wire::protocol::{Incoming, Protocol as _, TEXT_LINES};
use yarp_wire::{Bottle, Limits, Value, WireVersion};

use super::input::{Connection, End, Next};
use super::port_options::Page;
use super::received_message::Received;
use crate::roles::Right;

impl Connection {
    /// Answers an HTTP request; the connection closes after the answer, or becomes an output of the
    /// port.
    pub(super) async fn browse(&mut self, request: Request) -> Next {
        if let Some(page) = self.own_page(&request) {
            if !self.may(Right::Read) {
                return self.refuse_page(&request, Right::Read);
            }
            let response = self.wait_for(page).await;
            self.output.extend_from_slice(response.to_text().as_bytes());
            return Next::Stop(End::Closed);
        }
        let action = Action::of(&request);
        let needed = match &action {
            Action::Ask { who, .. } => match who {
                Who::Owner => Some(Right::Write),
                Who::Pages => Some(Right::Read),
                Who::Port => None,
            },
            Action::Read => Some(Right::Read),
            // Each line checks the rights that it needs.
            _ => None,
        };
        if let Some(right) = needed.filter(|right| !self.may(*right)) {
            return self.refuse_page(&request, right);
        }
        let response = match action {
            Action::Type { lines, data } => {
                let answers = self.type_lines(&lines).await;
                self.page(&request, &data, &answers)
            }
            Action::Ask { message, who, json } => {
                let reply = match who {
                    Who::Port => self.administer(&message).await.to_string(),
                    _ => self.ask_owner(message.to_text()).await,
                };
                match Reply::of(&reply, json) {
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
            Action::Read => {
                let head = html_page::stream_head(&self.core.name);
                self.output.extend_from_slice(head.as_bytes());
                return Next::Stop(End::Reversed);
            }
        };
        self.output.extend_from_slice(response.as_bytes());
        Next::Stop(End::Closed)
    }

    fn refuse_page(&mut self, request: &Request, right: Right) -> Next {
        let page = self.page(request, "", &self.refusal(right));
        self.output.extend_from_slice(page.as_bytes());
        Next::Stop(End::Closed)
    }

    /// Returns the answers to lines as typed at a terminal.
    async fn type_lines(&mut self, lines: &str) -> String {
        let mut messages = TEXT_LINES.message_decoder(WireVersion::V3, Limits::DEFAULT);
        let mut nothing = BytesMut::new();
        let mut input = BytesMut::from(lines);
        input.extend_from_slice(b"\n");
        let mut answers = String::new();
        while let Ok(Some(Incoming::Message(message))) = messages.read(&mut input, &mut nothing) {
            let Message { command, payload } = message;
            match command {
                Command::Data { .. } if !self.may(Right::Write) => {
                    answers += &self.refusal(Right::Write);
                }
                Command::Data { .. } => answers += &self.ask_owner(payload.bytes()).await,
                Command::Admin => {
                    let request = payload.to_bottle().unwrap_or_default();
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
        }
        answers
    }

    /// Returns the owner's response for that address, if it serves pages.
    fn own_page(&self, request: &Request) -> Option<Page> {
        self.core.options.pages.as_ref()?(request)
    }

    fn page(&self, request: &Request, data: &str, text: &str) -> String {
        let own = format!("{}:{}", self.core.host, self.core.number);
        let host = match request.host.as_str() {
            "" => &own,
            host => host,
        };
        let server = self.core.network.server();
        let server = server.map(|(host, port)| format!("{host}:{port}"));
        html_page::Page {
            port: &self.core.name,
            host,
            name_server: server.as_deref(),
            data,
            text,
        }
        .response()
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
    fn of(reply: &str, json: Option<Outer>) -> Self {
        let bottle = Bottle::parse(reply).unwrap_or_default();
        let text = |key: &str| bottle.find(key).map(Value::to_plain_string);
        let mime = text("mime");
        if let Some(outer) = json {
            let json = bottle_json::of(&bottle, outer);
            return Self::Whole(html_page::json_response(&json, mime.as_deref()));
        }
        let mime = mime.as_deref().unwrap_or("text/html");
        let body = text("web").unwrap_or_default();
        if bottle.find("stream").is_some() {
            return Self::Stream(html_page::own_stream_head(&body, mime));
        }
        Self::Whole(match body.is_empty() {
            true => format!("{reply}\r\n"),
            false => html_page::own_response(&body, mime),
        })
    }
}
