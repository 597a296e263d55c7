//! Common parts of the port tests: ports without a name server, and raw connections to them.

#![allow(dead_code, reason = "each test uses a part of it")]

pub(crate) mod captured_log;

use std::future::Future;
use std::time::Duration;

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use yarp_ports::{AdminClient, Network, Port, PortOptions};
use yarp_wire::Bottle;
use yarp_wire::carrier::Carrier;

/// The most that anything here may take; nothing is right or wrong because of it.
pub(crate) const DEADLINE: Duration = Duration::from_secs(20);

/// Opens a port that no name server knows.
pub(crate) async fn open(name: &str, options: PortOptions) -> Port {
    let network = Network::none().with_timeout(DEADLINE);
    let opening = Port::open(&network, name, options.unregistered());
    within(opening).await.unwrap()
}

/// Returns the address of `port`, as a contact over `carrier`.
pub(crate) fn at(port: &Port, carrier: &str) -> String {
    format!("{carrier}://127.0.0.1:{}{}", port.tcp_port(), port.name())
}

/// Connects `writer` to `reader`.
pub(crate) async fn connect(writer: &Port, reader: &Port, carrier: &str) {
    within(writer.connect(&at(reader, carrier))).await.unwrap();
    assert_eq!(writer.outputs(), [reader.name()]);
}

/// Waits for `future`; a test that gets stuck fails.
#[track_caller]
pub(crate) fn within<T>(future: impl Future<Output = T>) -> impl Future<Output = T> {
    let caller = std::panic::Location::caller();
    async move {
        match tokio::time::timeout(DEADLINE, future).await {
            Ok(result) => result,
            Err(_) => panic!("stuck at {caller}"),
        }
    }
}

/// Waits until `condition` holds.
#[track_caller]
pub(crate) fn until(condition: impl Fn() -> bool) -> impl Future<Output = ()> {
    within(async move {
        while !condition() {
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
    })
}

/// Returns the text of the next message.
#[track_caller]
pub(crate) fn next(reader: &Port) -> impl Future<Output = String> {
    let reading = within(reader.read());
    async move { reading.await.unwrap().bottle().unwrap().to_string() }
}

/// Returns the port's own answer to a request.
pub(crate) async fn ask(port: &Port, request: &Bottle) -> String {
    let carrier = Carrier::by_name("text_ack").unwrap();
    let address = ("127.0.0.1", port.tcp_port());
    let opening = AdminClient::open(port.name(), address, carrier, "admin", port.network());
    let mut client = opening.await.unwrap();
    client.admin(request).await.unwrap().to_string()
}

/// Returns a bottle from its text.
pub(crate) fn bottle(text: &str) -> Bottle {
    Bottle::parse(text).unwrap()
}

/// A connection to a port, byte for byte.
pub(crate) struct Raw(TcpStream);

impl Raw {
    /// Connects to `port`, and sends nothing.
    pub(crate) async fn to(port: &Port) -> Self {
        let stream = within(TcpStream::connect(("127.0.0.1", port.tcp_port())));
        Self(stream.await.unwrap())
    }

    /// Connects in text mode as `name`, and waits for the welcome.
    pub(crate) async fn text(port: &Port, name: &str) -> Self {
        let mut raw = Self::to(port).await;
        raw.send(format!("CONNECT {name}\r\n")).await;
        raw.expect(format!("Welcome {name}\r\n")).await;
        raw
    }

    /// Connects over `tcp` as `name`, and waits for the header reply.
    pub(crate) async fn tcp(port: &Port, name: &str) -> Self {
        let mut raw = Self::to(port).await;
        raw.send(tcp_header(name)).await;
        raw.expect(yarp_wire::framed_number::encode(port.tcp_port().into()))
            .await;
        raw
    }

    /// Sends bytes.
    pub(crate) async fn send(&mut self, bytes: impl AsRef<[u8]>) {
        within(self.0.write_all(bytes.as_ref())).await.unwrap();
    }

    /// Reads as many bytes as are expected and compares.
    #[track_caller]
    pub(crate) fn expect(&mut self, bytes: impl AsRef<[u8]>) -> impl Future<Output = ()> {
        let caller = std::panic::Location::caller();
        async move {
            let expected = bytes.as_ref();
            let mut got = vec![0; expected.len()];
            let reading = tokio::time::timeout(DEADLINE, async {
                let mut count = 0;
                while count < got.len() {
                    match self.0.read(&mut got[count..]).await.unwrap() {
                        0 => break,
                        more => count += more,
                    }
                }
                count
            });
            let count = reading.await.unwrap_or(0);
            assert_eq!(
                String::from_utf8_lossy(&got[..count]),
                String::from_utf8_lossy(expected),
                "at {caller}"
            );
            assert_eq!(&got[..count], expected, "at {caller}");
        }
    }

    /// Sends as many of the bytes as the other side accepts before it closes the connection.
    pub(crate) async fn try_send(&mut self, bytes: impl AsRef<[u8]>) {
        let _ = within(self.0.write_all(bytes.as_ref())).await;
    }

    /// Reads that many bytes.
    pub(crate) async fn receive(&mut self, count: usize) -> Vec<u8> {
        let mut bytes = vec![0; count];
        within(self.0.read_exact(&mut bytes)).await.unwrap();
        bytes
    }

    /// Returns whether the connection is still open; discards received bytes.
    pub(crate) fn is_open(&self) -> bool {
        loop {
            match self.0.try_read(&mut [0; 256]) {
                Ok(0) => return false,
                Ok(_) => {}
                Err(error) => return error.kind() == std::io::ErrorKind::WouldBlock,
            }
        }
    }

    /// Reads one byte.
    pub(crate) async fn byte(&mut self) -> u8 {
        within(self.0.read_u8()).await.unwrap()
    }

    /// Reads until the other side sends no more. The connection stays open for answers.
    pub(crate) async fn rest(&mut self) -> Vec<u8> {
        let mut rest = Vec::new();
        within(self.0.read_to_end(&mut rest)).await.unwrap();
        rest
    }

    /// Returns whether the connection was reset because sent bytes were not read; sends a byte.
    pub(crate) fn was_reset(&self) -> bool {
        self.0.try_write(b"?").is_err()
    }

    /// Waits until the other side closes the connection; returns the received bytes.
    pub(crate) async fn ended(mut self) -> Vec<u8> {
        let mut rest = Vec::new();
        // A connection that is reset has ended, too.
        let _ = within(self.0.read_to_end(&mut rest)).await;
        rest
    }
}

/// Returns the first bytes of an initiator on `tcp`.
pub(crate) fn tcp_header(name: &str) -> Vec<u8> {
    let mut header = b"YA\xe4\x1e\0\0RP".to_vec();
    header.extend_from_slice(&(name.len() as i32 + 1).to_le_bytes());
    header.extend_from_slice(name.as_bytes());
    header.push(0);
    header
}

/// Returns a message on `tcp`: a command letter and a bottle for readers of YARP 3.x.
pub(crate) fn tcp_message(letter: u8, content: &Bottle) -> Vec<u8> {
    let content = content.encode(yarp_wire::WireVersion::V3);
    let mut message = b"YA\x0a\0\0\0RP\x02\x01\xff\xff\xff\xff\xff\xff\xff\xff\x08\0\0\0".to_vec();
    message.extend_from_slice(&(content.len() as i32).to_le_bytes());
    message.extend_from_slice(&[0, 0, 0, 0, 0, 0, 0, 0, b'~', letter, 0, 1]);
    message.extend_from_slice(&content);
    message
}

/// Returns a command on `tcp`, spelled as stock spells them.
pub(crate) fn tcp_command(letter: u8) -> Vec<u8> {
    let mut message =
        b"YA\x0a\0\0\0RP\x01\x01\xff\xff\xff\xff\xff\xff\xff\xff\x0a\0\0\0\0\0\0\0".to_vec();
    message.extend_from_slice(&[2, 0, 0, 0, b'~', 0, 0, 1, letter, 0]);
    message
}

/// The acknowledgement of `tcp`.
pub(crate) const ACK: &[u8] = b"YA\0\0\0\0RP";
