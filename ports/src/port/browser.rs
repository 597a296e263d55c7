//! Browsers at a port.

use bytes::{Bytes, BytesMut};
use yarp_wire::http::{Action, Request, json, page};
use yarp_wire::message::{Form, Payload};
use yarp_wire::{Bottle, Value};

use super::input::{Connection, End, Next};
use super::options::Page;
use super::received::Received;
use crate::roles::Right;

impl Connection {
    /// Answers what a browser asks for; the connection ends with the answer, or goes on as one
    /// that the port writes to.
    pub(super) async fn browse(&mut self, request: Request) -> Next {
        if let Some(page) = self.own_page(&request) {
            if !self.may(Right::Read) {
                let refusal = self.refusal(Right::Read);
                let page = self.page(&request, "", &refusal);
                self.output.extend_from_slice(page.as_bytes());
                return Next::Stop(End::Closed);
            }
            let response = self.wait_for(page).await;
            self.output.extend_from_slice(response.to_text().as_bytes());
            return Next::Stop(End::Closed);
        }
        let action = Action::of(&request);
        let needed = match &action {
            Action::Send(_) | Action::Json { admin: false, .. } => Some(Right::Write),
            Action::Web(_) | Action::Read => Some(Right::Read),
            // What a description and the administration need, they check.
            _ => None,
        };
        if let Some(right) = needed.filter(|right| !self.may(*right)) {
            let refusal = self.refusal(right);
            let page = self.page(&request, "", &refusal);
            self.output.extend_from_slice(page.as_bytes());
            return Next::Stop(End::Closed);
        }
        let response = match action {
            Action::Describe => self.page(&request, "", &self.core.describe()),
            Action::Send(text) => {
                let reply = self.ask_owner(text.as_bytes()).await;
                self.page(&request, &text, &reply)
            }
            Action::Json {
                request: message,
                admin: true,
            } => {
                let answer = self.administer(&message).await;
                page::json_response(&json::of(&answer))
            }
            Action::Json { request, .. } => {
                let reply = self.ask_owner(request.to_string().as_bytes()).await;
                page::json_response(&json::of(&Bottle::parse(&reply).unwrap_or_default()))
            }
            Action::Web(message) => {
                let reply = self.ask_owner(message.to_string().as_bytes()).await;
                page_in(&reply)
            }
            Action::Read => {
                let head = page::stream_head(&self.core.name);
                self.output.extend_from_slice(head.as_bytes());
                return Next::Stop(End::Reversed);
            }
        };
        self.output.extend_from_slice(response.as_bytes());
        Next::Stop(End::Closed)
    }

    /// What the owner has at that address, if it has pages of its own.
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
        page::Page {
            port: &self.core.name,
            host,
            name_server: server.as_deref(),
            data,
            text,
        }
        .response()
    }

    /// What the owner says to a message, as text.
    async fn ask_owner(&mut self, message: &[u8]) -> String {
        let received = Received {
            payload: Payload::new(Bytes::copy_from_slice(message), Form::Text),
            envelope: None,
            from: self.from.clone(),
            address: self.address,
            wants_reply: true,
            responder: None,
            connection: self.number,
        };
        self.meter.count(message.len(), None);
        let (reply, _) = self.deliver(received).await;
        let mut text = BytesMut::new();
        if let Some(reply) = reply {
            reply.write_text(&mut text);
        }
        String::from_utf8_lossy(&text).into_owned()
    }
}

/// A page in the words of stock: key `web` is its body, `mime` its type.
fn page_in(reply: &str) -> String {
    let bottle = Bottle::parse(reply).unwrap_or_default();
    let text = |key: &str| bottle.find(key).map(Value::to_plain_string);
    match text("web") {
        Some(body) => {
            let mime = text("mime").unwrap_or_else(|| "text/html".to_owned());
            page::own_response(&body, &mime)
        }
        None => reply.to_owned(),
    }
}
