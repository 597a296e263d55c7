//! The name server, and where ports are.

use std::sync::Arc;
use std::time::Duration;

use bytes::BytesMut;
use yarp_wire::Contact;
use yarp_wire::carrier::ALL;

use crate::error::PortError;
use crate::stream::{self, Inflow};

/// A YARP network: a name server and a namespace.
///
/// Cheap to clone. Holds no connection: each question to the name server is a connection of its
/// own, as in stock.
#[derive(Clone, Debug)]
pub struct Network(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    server: Option<(String, u16)>,
    namespace: String,
    prefix: String,
    ip: Option<String>,
    deadline: Duration,
}

/// Where the name server says a port is.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct Place {
    /// Its name.
    pub name: String,
    /// Its host.
    pub host: String,
    /// Its TCP port.
    pub port: u16,
    /// The carrier it is registered with.
    pub carrier: String,
}

/// What a port tells the name server of itself.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Registering<'a> {
    pub(crate) name: &'a str,
    pub(crate) number: Option<u16>,
    pub(crate) type_name: Option<&'a str>,
}

/// Last line of an answer of the name server.
const END: &str = "*** end of message";
/// Longest answer we take.
const LONGEST: usize = 16 << 20;

impl Network {
    /// The network whose name server is at `host:port`, in namespace `/root`.
    pub fn at(host: &str, port: u16) -> Self {
        Self::from(Inner {
            server: Some((host.to_owned(), port)),
            namespace: "/root".to_owned(),
            prefix: String::new(),
            ip: None,
            deadline: Duration::from_secs(10),
        })
    }

    /// No name server: ports can be opened unregistered, and reached by address.
    pub fn none() -> Self {
        Self::from(Inner {
            server: None,
            namespace: "/root".to_owned(),
            prefix: String::new(),
            ip: None,
            deadline: Duration::from_secs(10),
        })
    }

    /// The network that the process's environment and configuration files name.
    pub fn from_process() -> Result<Self, PortError> {
        let dir = std::env::var("YARP_CONFIG_HOME").unwrap_or_default();
        let text = std::fs::read_to_string(format!("{dir}/yarp.conf")).unwrap_or_default();
        let words: Vec<&str> = text.split_whitespace().collect();
        Ok(match words[..] {
            [host, port, ..] => Self::at(host, port.parse().unwrap_or(10000)),
            _ => Self::none(),
        })
    }

    fn from(inner: Inner) -> Self {
        Self(Arc::new(inner))
    }

    /// The same network with another limit on how long connecting and asking may take.
    pub fn with_deadline(&self, deadline: Duration) -> Self {
        Self::from(Inner {
            deadline,
            server: self.0.server.clone(),
            namespace: self.0.namespace.clone(),
            prefix: self.0.prefix.clone(),
            ip: self.0.ip.clone(),
        })
    }

    /// How long connecting and asking may take.
    pub fn deadline(&self) -> Duration {
        self.0.deadline
    }

    /// Host and port of the name server, if one is configured.
    pub fn server(&self) -> Option<(&str, u16)> {
        let (host, port) = self.0.server.as_ref()?;
        Some((host, *port))
    }

    /// The namespace: the name server's own port name.
    pub fn namespace(&self) -> &str {
        &self.0.namespace
    }

    /// The name under which a port called `name` is opened.
    pub(crate) fn full_name(&self, name: &str) -> String {
        if name == "..." {
            return name.to_owned();
        }
        format!("{}{name}", self.0.prefix)
    }

    pub(crate) fn own_host(&self) -> String {
        self.0.ip.clone().unwrap_or_else(|| "127.0.0.1".to_owned())
    }

    /// Sends one request line to the name server and gives the lines of its answer.
    pub async fn ask(&self, request: &str) -> Result<Vec<String>, PortError> {
        let (host, port) = self.server().ok_or(PortError::NoNameServer)?;
        let server = format!("{host}:{port}");
        let failed = |step| {
            let server = server.clone();
            move |source| PortError::NameServer {
                server,
                step,
                source,
            }
        };
        let conversation = async {
            let connecting = stream::connect("the name server", host, port, self.0.deadline);
            let stream = match connecting.await {
                Ok(stream) => stream,
                Err(PortError::Connect { source, .. }) => {
                    return Err(failed("connecting")(source));
                }
                Err(_) => {
                    return Err(failed("connecting")(std::io::ErrorKind::TimedOut.into()));
                }
            };
            let line = format!("NAME_SERVER {request}\n");
            let mut out = BytesMut::from(line.as_bytes());
            let sending = stream::write_all(&stream, &mut out);
            sending.await.map_err(failed("sending"))?;
            let mut input = Inflow::default();
            loop {
                let reading = input.read(&stream, 0);
                let count = reading.await.map_err(failed("reading"))?;
                if let Some(lines) =
                    whole_answer(&input.bytes, count == 0 || input.bytes.len() > LONGEST)
                {
                    return Ok(lines);
                }
            }
        };
        match tokio::time::timeout(self.0.deadline, conversation).await {
            Ok(result) => result,
            Err(_) => Err(failed("answer")(std::io::ErrorKind::TimedOut.into())),
        }
    }

    /// Where a port is.
    pub async fn query(&self, name: &str) -> Result<Place, PortError> {
        let lines = self.ask(&format!("query {name}")).await?;
        let place = lines.iter().find_map(|line| parse_registration(line));
        place.ok_or_else(|| PortError::Unknown {
            name: name.to_owned(),
        })
    }

    /// Where the port that a contact means is: what it says itself, else what the name server says.
    pub async fn resolve(&self, contact: &Contact) -> Result<Place, PortError> {
        if let Some((host, port)) = &contact.address {
            let name = match contact.name.as_str() {
                "" => format!("/{host}:{port}"),
                name => name.to_owned(),
            };
            return Ok(Place {
                name,
                host: host.clone(),
                port: *port,
                carrier: contact.carrier.clone().unwrap_or_else(|| "tcp".to_owned()),
            });
        }
        self.query(&contact.name).await
    }

    pub(crate) async fn register(&self, port: &Registering<'_>) -> Result<Place, PortError> {
        let mut request = format!("register {}", port.name);
        if port.number.is_some() || port.type_name.is_some() || self.0.ip.is_some() {
            let ip = self.0.ip.as_deref().unwrap_or("...");
            let number = port.number.map_or("-1".to_owned(), |n| n.to_string());
            request.push_str(&format!(" tcp {ip} {number}"));
            if let Some(type_name) = port.type_name {
                request.push_str(&format!(" {type_name}"));
            }
        }
        let lines = self.ask(&request).await?;
        let place = lines.iter().find_map(|line| parse_registration(line));
        place.ok_or_else(|| {
            let (host, port) = self.server().unwrap_or(("", 0));
            PortError::Refused {
                server: format!("{host}:{port}"),
                request,
                answer: lines.join(" "),
            }
        })
    }

    /// Tells the name server what a port that listens by now can do.
    pub(crate) async fn introduce(&self, name: &str) -> Result<(), PortError> {
        let carriers = ALL.map(|carrier| carrier.name).join(" ");
        let addresses = crate::addresses::own().join(" ");
        let process = std::process::id();
        for request in [
            format!("set {name} offers {carriers}"),
            format!("set {name} accepts {carriers}"),
            format!("set {name} ips {addresses}"),
            format!("set {name} process {process}"),
            format!("announce {name}"),
        ] {
            self.ask(&request).await?;
        }
        Ok(())
    }

    pub(crate) async fn unregister(&self, name: &str) -> Result<(), PortError> {
        self.ask(&format!("unregister {name}")).await.map(drop)
    }
}

/// The lines of an answer without its last, once it is whole (or the stream has ended).
fn whole_answer(input: &[u8], ended: bool) -> Option<Vec<String>> {
    let text = String::from_utf8_lossy(input);
    let mut lines = Vec::new();
    for line in text.split_inclusive('\n') {
        let whole = line.ends_with('\n');
        let line = line.trim_end_matches(['\r', '\n']);
        if whole && line == END {
            return Some(lines);
        }
        lines.push(line.to_owned());
        // A structured answer is one line.
        if whole && line.len() > 1 && line.starts_with('[') {
            return Some(lines);
        }
    }
    ended.then_some(lines)
}

fn parse_registration(line: &str) -> Option<Place> {
    let words: Vec<&str> = line.split_whitespace().collect();
    match words[..] {
        [
            "registration",
            "name",
            name,
            "ip",
            host,
            "port",
            port,
            "type",
            carrier,
        ] => Some(Place {
            name: name.to_owned(),
            host: host.to_owned(),
            port: port.parse().ok()?,
            carrier: carrier.to_owned(),
        }),
        _ => None,
    }
}
