//! Recording of the messages of ports to a file.

use std::collections::HashMap;
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;

use bytes::Bytes;
use yarp_devices::clock::wall_clock;
use yarp_ports::{Answer, Network, Port, PortError, PortOptions, Received, remote_admin};
use yarp_wire::WireVersion;

use crate::mcap::{Channel, ENCODING, Recorded, Writer};

/// Maximum number of messages that wait for the disk.
const MAX_WAITING: usize = 1024;
/// Interval between two flushes of the file.
const FLUSH_INTERVAL: Duration = Duration::from_secs(1);
/// Maximum number of recorded ports.
const MAX_PORTS: usize = 1024;
/// Key of the wire version in the metadata of a channel.
pub(crate) const WIRE_VERSION: &str = "wire version";

/// Reason why a recording failed.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The file cannot be written.
    #[error("cannot write the recording")]
    File(#[from] io::Error),
    /// A port failed.
    #[error(transparent)]
    Port(#[from] PortError),
    /// A port that is to be recorded cannot be connected.
    #[error("cannot record {port}: {reason}")]
    Source {
        /// The port.
        port: String,
        /// Reason.
        reason: String,
    },
}

/// Numbers of messages of a recording.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct RecordCounts {
    /// Messages that were taken.
    pub taken: u64,
    /// Messages that were dropped because the disk was too slow.
    pub dropped: u64,
}

#[derive(Debug, Default)]
struct Counters {
    taken: AtomicU64,
    dropped: AtomicU64,
}

/// A message on its way to the file.
struct Waiting {
    from: Arc<str>,
    wire_version: WireVersion,
    log_time: u64,
    publish_time: u64,
    data: Bytes,
}

/// A recording that is under way.
#[derive(Debug)]
pub struct Recorder {
    port: Port,
    writer: JoinHandle<io::Result<()>>,
    counters: Arc<Counters>,
}

impl Recorder {
    /// Creates the file and records everything that arrives at the port `name`.
    ///
    /// Errors: [`RecordError`] if the file or the port cannot be made.
    pub async fn start(network: &Network, name: &str, file: &Path) -> Result<Self, RecordError> {
        let writer = Writer::new(BufWriter::new(File::create(file)?))?;
        let (sender, receiver) = sync_channel(MAX_WAITING);
        let counters = Arc::new(Counters::default());
        let counted = counters.clone();
        let options = PortOptions::new()
            .input_only()
            .no_browsers()
            .handler(move |message| {
                take(message, &sender, &counted);
                Answer::Nothing
            });
        let port = Port::open(network, name, options).await?;
        let writer = std::thread::Builder::new()
            .name("recorder".into())
            .spawn(move || write(writer, &receiver))?;
        Ok(Self {
            port,
            writer,
            counters,
        })
    }

    /// Connects a port, so that its messages are recorded.
    pub async fn connect(&self, source: &str) -> Result<(), RecordError> {
        let connecting = remote_admin::connect(self.port.network(), source, self.port.name(), None);
        connecting
            .await
            .map(drop)
            .map_err(|error| RecordError::Source {
                port: source.to_owned(),
                reason: error.to_string(),
            })
    }

    /// Returns the numbers of messages so far.
    pub fn counts(&self) -> RecordCounts {
        RecordCounts {
            taken: self.counters.taken.load(Ordering::Relaxed),
            dropped: self.counters.dropped.load(Ordering::Relaxed),
        }
    }

    /// Returns true if the file can no longer be written.
    pub fn has_failed(&self) -> bool {
        self.writer.is_finished()
    }

    /// Ends the connections and the file.
    ///
    /// Errors: [`RecordError::File`] if not everything was written.
    pub async fn finish(self) -> Result<RecordCounts, RecordError> {
        let counters = self.counters;
        // The handler, which holds the sender, goes with the port.
        self.port.close().await;
        let writer = self.writer;
        let ended = tokio::task::spawn_blocking(move || writer.join()).await;
        match ended {
            Ok(Ok(result)) => result?,
            _ => {
                return Err(
                    io::Error::other("the thread that writes the recording panicked").into(),
                );
            }
        }
        Ok(RecordCounts {
            taken: counters.taken.load(Ordering::Relaxed),
            dropped: counters.dropped.load(Ordering::Relaxed),
        })
    }
}

fn take(message: &Received, sender: &SyncSender<Waiting>, counters: &Counters) {
    let wire_version = message.payload.wire_version();
    let Ok(data) = message.payload.to_binary(wire_version) else {
        return;
    };
    let now = nanoseconds(wall_clock());
    let waiting = Waiting {
        from: message.from.clone(),
        wire_version,
        log_time: now,
        publish_time: message.stamp().map_or(now, |stamp| nanoseconds(stamp.time)),
        data,
    };
    match sender.try_send(waiting) {
        Ok(()) => counters.taken.fetch_add(1, Ordering::Relaxed),
        // The port must not wait for the disk.
        Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => {
            counters.dropped.fetch_add(1, Ordering::Relaxed)
        }
    };
}

fn nanoseconds(seconds: f64) -> u64 {
    (seconds.max(0.0) * 1e9) as u64
}

/// Writes messages until the port is closed.
fn write(mut writer: Writer<BufWriter<File>>, receiver: &Receiver<Waiting>) -> io::Result<()> {
    let mut channels: HashMap<(Arc<str>, WireVersion), (u16, u32)> = HashMap::new();
    loop {
        let waiting = match receiver.recv_timeout(FLUSH_INTERVAL) {
            Ok(waiting) => waiting,
            Err(RecvTimeoutError::Timeout) => {
                writer.flush()?;
                continue;
            }
            Err(RecvTimeoutError::Disconnected) => return writer.finish(),
        };
        let key = (waiting.from, waiting.wire_version);
        if !channels.contains_key(&key) {
            if channels.len() >= MAX_PORTS {
                continue;
            }
            let id = channels.len() as u16 + 1;
            writer.channel(id, &channel(&key.0, key.1))?;
            channels.insert(key.clone(), (id, 0));
        }
        let Some((id, sequence)) = channels.get_mut(&key) else {
            continue;
        };
        writer.message(&Recorded {
            channel: *id,
            sequence: *sequence,
            log_time: waiting.log_time,
            publish_time: waiting.publish_time,
            data: waiting.data,
        })?;
        *sequence = sequence.wrapping_add(1);
    }
}

fn channel(topic: &str, wire_version: WireVersion) -> Channel {
    let version = match wire_version {
        WireVersion::V3 => "3",
        WireVersion::V4 => "4",
    };
    Channel {
        topic: topic.to_owned(),
        encoding: ENCODING.to_owned(),
        metadata: [(WIRE_VERSION.to_owned(), version.to_owned())].into(),
    }
}
