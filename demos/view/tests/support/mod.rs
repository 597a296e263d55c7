//! A network with a name server, an arm and a view, and a browser's side of a web socket.
#![allow(dead_code, reason = "each test file uses a part of it")]

use std::future::Future;
use std::sync::Arc;
use std::time::Duration;

use serde_json::Value as Json;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use yarp_devices::wam::SimulatedWam;
use yarp_nameserver::{Server, ServerOptions};
use yarp_ports::Network;
use yarp_view::{View, ViewOptions};
use yarp_wire::{Bottle, Limits, Value, WireVersion};
use yarp_wrappers::{ControlBoardOptions, ControlBoardServer};

/// Longer than any step takes on a busy machine.
pub(crate) const TIMEOUT: Duration = Duration::from_secs(60);

pub(crate) async fn within<T>(future: impl Future<Output = T>) -> T {
    tokio::time::timeout(TIMEOUT, future)
        .await
        .expect("within the timeout")
}

/// A name server, the arm /wam, and its view.
pub(crate) struct Lab {
    pub(crate) server: Server,
    pub(crate) network: Network,
    pub(crate) arm: ControlBoardServer,
    pub(crate) view: View,
}

impl Lab {
    pub(crate) async fn open(control: bool) -> Self {
        let server = Server::start(ServerOptions::default().at("127.0.0.1", 0))
            .await
            .unwrap();
        let network = server.network();
        let arm = Arc::new(SimulatedWam::new());
        let arm = ControlBoardServer::open(&network, arm, "/wam", ControlBoardOptions::new())
            .await
            .unwrap();
        let view = View::open(&network, ViewOptions::new("/wam").control(control))
            .await
            .unwrap();
        Self {
            server,
            network,
            arm,
            view,
        }
    }

    pub(crate) async fn close(self) {
        within(self.view.close()).await;
        within(self.arm.close()).await;
        within(self.server.close()).await;
    }

    /// Returns host and port of the page.
    pub(crate) fn host(&self) -> String {
        self.view
            .url()
            .trim_start_matches("http://")
            .trim_end_matches('/')
            .to_owned()
    }

    /// Returns what a request is answered, with these headers.
    pub(crate) async fn request(&self, path: &str, headers: &str) -> String {
        let host = self.host();
        let mut stream = TcpStream::connect(&host).await.unwrap();
        let request = format!("GET {path} HTTP/1.1\r\nHost: {host}\r\n{headers}\r\n");
        stream.write_all(request.as_bytes()).await.unwrap();
        let mut answer = Vec::new();
        within(stream.read_to_end(&mut answer)).await.unwrap();
        String::from_utf8(answer).unwrap()
    }
}

/// A web socket of a page.
pub(crate) struct Page {
    stream: TcpStream,
}

const fn block(letter: u8) -> [u8; 8] {
    [0, 0, 0, 0, b'~', letter, 0, 1]
}

impl Page {
    pub(crate) async fn open(lab: &Lab) -> Self {
        let host = lab.host();
        let mut stream = TcpStream::connect(&host).await.unwrap();
        let request = format!(
            "GET /?ws HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
             Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
        );
        stream.write_all(request.as_bytes()).await.unwrap();
        let mut head = Vec::new();
        while !head.ends_with(b"\r\n\r\n") {
            head.push(within(stream.read_u8()).await.unwrap());
        }
        assert!(
            head.starts_with(b"HTTP/1.1 101"),
            "{}",
            String::from_utf8_lossy(&head)
        );
        Self { stream }
    }

    /// Opens a socket that the view writes to.
    pub(crate) async fn watch(lab: &Lab) -> Self {
        let mut page = Self::open(lab).await;
        page.send(&block(b'r')).await;
        page
    }

    async fn send(&mut self, body: &[u8]) {
        assert!(body.len() < 126);
        // A mask that changes nothing.
        let head = [0x82, 0x80 | body.len() as u8, 0, 0, 0, 0];
        self.stream
            .write_all(&[&head[..], body].concat())
            .await
            .unwrap();
    }

    async fn frame(&mut self) -> Vec<u8> {
        let mut head = [0; 2];
        within(self.stream.read_exact(&mut head)).await.unwrap();
        let length = match head[1] {
            126 => u64::from(self.stream.read_u16().await.unwrap()),
            127 => self.stream.read_u64().await.unwrap(),
            short => short.into(),
        };
        let mut body = vec![0; length as usize];
        within(self.stream.read_exact(&mut body)).await.unwrap();
        body
    }

    /// Sends a command and returns the reply.
    pub(crate) async fn command(&mut self, text: &str) -> Bottle {
        let command = Bottle::parse(text).unwrap();
        let body = [&block(b'd')[..], &command.encode(WireVersion::V3)].concat();
        self.send(&body).await;
        let reply = self.frame().await;
        Bottle::decode(&reply.into(), WireVersion::V3, Limits::DEFAULT).unwrap()
    }

    /// Returns the next message of the view.
    pub(crate) async fn next(&mut self) -> Json {
        assert_eq!(self.frame().await[4..6], *b"~D");
        let bottle =
            Bottle::decode(&self.frame().await.into(), WireVersion::V3, Limits::DEFAULT).unwrap();
        serde_json::from_str(bottle.get(0).and_then(Value::as_str).unwrap()).unwrap()
    }

    /// Returns the first message for which `found` has a result.
    pub(crate) async fn until<T>(&mut self, found: impl Fn(&Json) -> Option<T>) -> T {
        let search = async {
            loop {
                let message = self.next().await;
                if let Some(result) = found(&message) {
                    return result;
                }
            }
        };
        within(search).await
    }

    /// Waits until a joint is where it should be.
    pub(crate) async fn until_joint(&mut self, joint: usize, degrees: f64) {
        let at = |message: &Json| message["state"]["arm"]["p"][joint].as_f64();
        self.until(|message| at(message).filter(|position| (position - degrees).abs() < 0.5))
            .await;
    }
}
