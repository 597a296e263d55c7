//! Replay of a recording into the network.

use std::collections::HashMap;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use std::time::Duration;

use bytes::{BufMut, Bytes, BytesMut};
use tokio::time::Instant;
use yarp_ports::{Network, Port, PortError, PortOptions};
use yarp_wire::message::WireObject;
use yarp_wire::{Bottle, Limits, Stamp, WireVersion};

use crate::mcap::{ENCODING, McapError, Reader, Recorded};
use crate::recorder::WIRE_VERSION;

/// Longest pause between two messages; longer ones are shortened to it.
const MAX_PAUSE: Duration = Duration::from_secs(10);
/// Maximum number of messages that a reader may be behind before it is skipped.
const MAX_BACKLOG: usize = 64;
/// Maximum number of ports of a replay.
const MAX_PORTS: usize = 256;

/// Reason why a replay failed.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] McapError),
    /// A port cannot be opened.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The file has nothing to replay.
    #[error("the recording has no messages of ports")]
    Empty,
    /// The file has too many ports.
    #[error("the recording has {0} ports, more than are replayed")]
    TooManyPorts(usize),
}

/// A recording whose ports are open.
#[derive(Debug)]
pub struct Replay {
    file: std::path::PathBuf,
    prefix: String,
    ports: HashMap<String, Port>,
}

impl Replay {
    /// Reads the file once and opens a port for each one that was recorded, with its name behind `prefix`.
    ///
    /// Errors: [`ReplayError`] for a file that is no recording, and for a name that is taken.
    pub async fn open(network: &Network, file: &Path, prefix: &str) -> Result<Self, ReplayError> {
        let mut topics = Vec::new();
        let mut reader = reader(file)?;
        while let Some(message) = reader.next()? {
            let channel = reader
                .channel(message.channel)
                .filter(|channel| channel.encoding == ENCODING);
            if let Some(channel) = channel
                && !topics.contains(&channel.topic)
            {
                topics.push(channel.topic.clone());
            }
        }
        if topics.is_empty() {
            return Err(ReplayError::Empty);
        }
        if topics.len() > MAX_PORTS {
            return Err(ReplayError::TooManyPorts(topics.len()));
        }
        let mut replay = Self {
            file: file.to_owned(),
            prefix: prefix.to_owned(),
            ports: HashMap::new(),
        };
        for topic in topics {
            let name = format!("{prefix}{topic}");
            match Port::open(network, &name, PortOptions::new()).await {
                Ok(port) => drop(replay.ports.insert(topic, port)),
                Err(error) => {
                    replay.close().await;
                    return Err(error.into());
                }
            }
        }
        Ok(replay)
    }

    /// Returns the names of the ports.
    pub fn names(&self) -> Vec<String> {
        let mut names: Vec<_> = self
            .ports
            .keys()
            .map(|topic| format!("{}{topic}", self.prefix))
            .collect();
        names.sort();
        names
    }

    /// Writes all messages at the pace of the recording times `speed`; returns their number.
    pub async fn play(&self, speed: f64) -> Result<u64, ReplayError> {
        let mut reader = reader(&self.file)?;
        let mut due = Instant::now();
        let mut last = None;
        let mut count = 0;
        while let Some(message) = reader.next()? {
            let pause = last.map_or(0, |last| message.log_time.saturating_sub(last));
            last = Some(message.log_time);
            due += Duration::from_nanos(pause).div_f64(speed).min(MAX_PAUSE);
            tokio::time::sleep_until(due).await;
            let Some(channel) = reader.channel(message.channel) else {
                continue;
            };
            let Some(port) = self.ports.get(&channel.topic) else {
                continue;
            };
            let wire_version = match channel.metadata.get(WIRE_VERSION).map(String::as_str) {
                Some("4") => WireVersion::V4,
                _ => WireVersion::V3,
            };
            let stamp = Stamp::new(message.sequence as i32, message.publish_time as f64 / 1e9);
            port.try_write(
                &Replayed::new(&message, wire_version),
                Some(stamp.into()),
                MAX_BACKLOG,
            );
            count += 1;
        }
        for port in self.ports.values() {
            port.flush().await;
        }
        Ok(count)
    }

    /// Closes the ports.
    pub async fn close(self) {
        for (_, port) in self.ports {
            port.close().await;
        }
    }
}

fn reader(file: &Path) -> Result<Reader<BufReader<File>>, McapError> {
    Reader::new(BufReader::new(File::open(file)?))
}

/// A message as it was recorded.
struct Replayed {
    data: Bytes,
    wire_version: WireVersion,
}

impl Replayed {
    fn new(message: &Recorded, wire_version: WireVersion) -> Self {
        Self {
            data: message.data.clone(),
            wire_version,
        }
    }
}

impl WireObject for Replayed {
    fn write_binary(&self, out: &mut BytesMut, wire_version: WireVersion) {
        if wire_version == self.wire_version {
            out.put_slice(&self.data);
            return;
        }
        // Nearly every type is laid out as a bottle; one that is not goes as it is.
        match Bottle::decode(&self.data, self.wire_version, Limits::DEFAULT) {
            Ok(bottle) => bottle.write_binary(out, wire_version),
            Err(_) => out.put_slice(&self.data),
        }
    }
}
