//! The file format of recordings: MCAP, without chunks and without an index.
//!
//! <https://mcap.dev/spec>: a magic number, records of one byte, a length of eight and content, a footer, the magic number again. A file that ends early,
//! because the recorder was killed, is read up to its last whole record.

use std::collections::HashMap;
use std::io::{self, Read, Write};

use bytes::Bytes;

const MAGIC: [u8; 8] = *b"\x89MCAP0\r\n";
const HEADER: u8 = 0x01;
const FOOTER: u8 = 0x02;
const CHANNEL: u8 = 0x04;
const MESSAGE: u8 = 0x05;
const DATA_END: u8 = 0x0f;
/// Records of a compressed file, which this reader does not know.
const CHUNK: u8 = 0x06;
/// Bytes of a message before its data.
const MESSAGE_HEAD: usize = 2 + 4 + 8 + 8;
/// Maximum number of bytes of a record.
const MAX_RECORD: u64 = 256 << 20;
/// Maximum number of channels of a file.
const MAX_CHANNELS: usize = 4096;
/// Encoding of all messages that are recorded: the binary form of YARP.
pub(crate) const ENCODING: &str = "yarp";

/// Reason why a file is not read.
#[derive(Debug, thiserror::Error)]
pub enum McapError {
    /// The file cannot be read.
    #[error("cannot read the recording")]
    Io(#[from] io::Error),
    /// It begins with something else.
    #[error("expected an MCAP file, got one that begins otherwise")]
    NotMcap,
    /// It was compressed by another program.
    #[error(
        "expected a recording without chunks, got one with them; `mcap` of its authors can write it without"
    )]
    Chunked,
    /// A record does not have the form that its kind has.
    #[error("record {number} of kind {kind:#04x} is damaged: {reason}")]
    Damaged {
        /// Number of the record, from 1.
        number: u64,
        /// Kind.
        kind: u8,
        /// Reason.
        reason: &'static str,
    },
}

/// A source of messages of a file.
#[derive(Clone, Debug, Eq, PartialEq)]
pub(crate) struct Channel {
    /// Name of the recorded port.
    pub(crate) topic: String,
    /// Encoding of its messages.
    pub(crate) encoding: String,
    /// Further facts, such as the wire version.
    pub(crate) metadata: HashMap<String, String>,
}

/// A message of a file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Recorded {
    /// Its channel.
    pub(crate) channel: u16,
    /// Number in its channel.
    pub(crate) sequence: u32,
    /// Nanoseconds since the start of 1970 when it was received.
    pub(crate) log_time: u64,
    /// The same when it was sent, if its sender said so, else when it was received.
    pub(crate) publish_time: u64,
    /// Content.
    pub(crate) data: Bytes,
}

/// Writes a recording.
#[derive(Debug)]
pub(crate) struct Writer<W> {
    out: W,
}

impl<W: Write> Writer<W> {
    /// Begins a recording.
    pub(crate) fn new(mut out: W) -> io::Result<Self> {
        out.write_all(&MAGIC)?;
        let mut writer = Self { out };
        let mut header = Vec::new();
        put_text(&mut header, "");
        put_text(
            &mut header,
            concat!("yarp-view ", env!("CARGO_PKG_VERSION")),
        );
        writer.record(HEADER, &[&header])?;
        Ok(writer)
    }

    /// Adds a channel.
    pub(crate) fn channel(&mut self, id: u16, channel: &Channel) -> io::Result<()> {
        let mut content = Vec::new();
        content.extend(id.to_le_bytes());
        // No schema.
        content.extend(0_u16.to_le_bytes());
        put_text(&mut content, &channel.topic);
        put_text(&mut content, &channel.encoding);
        let mut pairs = Vec::new();
        for (key, value) in &channel.metadata {
            put_text(&mut pairs, key);
            put_text(&mut pairs, value);
        }
        content.extend((pairs.len() as u32).to_le_bytes());
        content.extend(pairs);
        self.record(CHANNEL, &[&content])
    }

    /// Adds a message.
    pub(crate) fn message(&mut self, message: &Recorded) -> io::Result<()> {
        let mut head = [0; MESSAGE_HEAD];
        head[..2].copy_from_slice(&message.channel.to_le_bytes());
        head[2..6].copy_from_slice(&message.sequence.to_le_bytes());
        head[6..14].copy_from_slice(&message.log_time.to_le_bytes());
        head[14..].copy_from_slice(&message.publish_time.to_le_bytes());
        self.record(MESSAGE, &[&head, &message.data])
    }

    /// Passes everything on to the file.
    pub(crate) fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }

    /// Ends the recording.
    pub(crate) fn finish(mut self) -> io::Result<()> {
        self.record(DATA_END, &[&[0; 4]])?;
        self.record(FOOTER, &[&[0; 20]])?;
        self.out.write_all(&MAGIC)?;
        self.out.flush()
    }

    fn record(&mut self, kind: u8, parts: &[&[u8]]) -> io::Result<()> {
        let length: usize = parts.iter().map(|part| part.len()).sum();
        self.out.write_all(&[kind])?;
        self.out.write_all(&(length as u64).to_le_bytes())?;
        parts.iter().try_for_each(|part| self.out.write_all(part))
    }
}

fn put_text(out: &mut Vec<u8>, text: &str) {
    out.extend((text.len() as u32).to_le_bytes());
    out.extend(text.as_bytes());
}

/// Reads a recording, record by record.
#[derive(Debug)]
pub(crate) struct Reader<R> {
    input: R,
    number: u64,
    channels: HashMap<u16, Channel>,
}

impl<R: Read> Reader<R> {
    /// Begins to read.
    pub(crate) fn new(mut input: R) -> Result<Self, McapError> {
        let mut magic = [0; MAGIC.len()];
        let read = read_up_to(&mut input, &mut magic)?;
        if read < magic.len() || magic != MAGIC {
            return Err(McapError::NotMcap);
        }
        Ok(Self {
            input,
            number: 0,
            channels: HashMap::new(),
        })
    }

    /// Returns a channel that has occurred.
    pub(crate) fn channel(&self, id: u16) -> Option<&Channel> {
        self.channels.get(&id)
    }

    /// Returns the next message; `None` at the end, and where a file that was cut ends.
    pub(crate) fn next(&mut self) -> Result<Option<Recorded>, McapError> {
        loop {
            let mut head = [0; 9];
            if read_up_to(&mut self.input, &mut head)? < head.len() {
                return Ok(None);
            }
            self.number += 1;
            let kind = head[0];
            let length = u64::from_le_bytes(head[1..].try_into().expect("eight bytes"));
            if matches!(kind, FOOTER | DATA_END) {
                return Ok(None);
            }
            if length > MAX_RECORD {
                return Err(self.damaged(kind, "it is too large"));
            }
            // Memory is taken as the bytes arrive, not as they are promised.
            let mut content = Vec::new();
            (&mut self.input).take(length).read_to_end(&mut content)?;
            if (content.len() as u64) < length {
                return Ok(None);
            }
            match kind {
                CHANNEL => self.add_channel(&content)?,
                MESSAGE => return self.message(content).map(Some),
                CHUNK => return Err(McapError::Chunked),
                // Schemas and attachments say nothing that is needed here.
                _ => {}
            }
        }
    }

    fn damaged(&self, kind: u8, reason: &'static str) -> McapError {
        McapError::Damaged {
            number: self.number,
            kind,
            reason,
        }
    }

    fn add_channel(&mut self, content: &[u8]) -> Result<(), McapError> {
        let mut fields = Fields(content);
        let read = || -> Option<(u16, Channel)> {
            let id = fields.number()?;
            let _schema: u16 = fields.number()?;
            let (topic, encoding) = (fields.text()?, fields.text()?);
            let mut pairs = Fields(fields.block()?);
            let mut metadata = HashMap::new();
            while !pairs.0.is_empty() {
                metadata.insert(pairs.text()?, pairs.text()?);
            }
            let channel = Channel {
                topic,
                encoding,
                metadata,
            };
            Some((id, channel))
        }();
        let (id, channel) = read.ok_or_else(|| self.damaged(CHANNEL, "a field is missing"))?;
        if self.channels.len() >= MAX_CHANNELS {
            return Err(self.damaged(CHANNEL, "there are too many channels"));
        }
        self.channels.insert(id, channel);
        Ok(())
    }

    fn message(&self, content: Vec<u8>) -> Result<Recorded, McapError> {
        if content.len() < MESSAGE_HEAD {
            return Err(self.damaged(MESSAGE, "its head is not complete"));
        }
        let content = Bytes::from(content);
        let at = |from: usize| {
            u64::from_le_bytes(content[from..from + 8].try_into().expect("eight bytes"))
        };
        let channel = u16::from_le_bytes([content[0], content[1]]);
        if !self.channels.contains_key(&channel) {
            return Err(self.damaged(MESSAGE, "its channel is unknown"));
        }
        Ok(Recorded {
            channel,
            sequence: u32::from_le_bytes(content[2..6].try_into().expect("four bytes")),
            log_time: at(6),
            publish_time: at(14),
            data: content.slice(MESSAGE_HEAD..),
        })
    }
}

/// Reads until the buffer is full or the input ends; returns the number of bytes.
fn read_up_to(input: &mut impl Read, buffer: &mut [u8]) -> io::Result<usize> {
    let mut filled = 0;
    while filled < buffer.len() {
        match input.read(&mut buffer[filled..]) {
            Ok(0) => break,
            Ok(read) => filled += read,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(filled)
}

/// The rest of a record.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    fn number(&mut self) -> Option<u16> {
        Some(u16::from_le_bytes(self.take(2)?.try_into().ok()?))
    }

    /// Returns bytes that are preceded by their number.
    fn block(&mut self) -> Option<&'a [u8]> {
        let length = u32::from_le_bytes(self.take(4)?.try_into().ok()?);
        self.take(usize::try_from(length).ok()?)
    }

    fn text(&mut self) -> Option<String> {
        String::from_utf8(self.block()?.to_vec()).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(sequence: u32) -> Recorded {
        Recorded {
            channel: 3,
            sequence,
            log_time: 1_000_000_007,
            publish_time: 999,
            data: Bytes::from_static(b"content"),
        }
    }

    fn recording() -> Vec<u8> {
        let mut file = Vec::new();
        let mut writer = Writer::new(&mut file).unwrap();
        let channel = Channel {
            topic: "/wam/stateExt:o".to_owned(),
            encoding: ENCODING.to_owned(),
            metadata: [("wire version".to_owned(), "3".to_owned())].into(),
        };
        writer.channel(3, &channel).unwrap();
        writer.message(&message(0)).unwrap();
        writer.message(&message(1)).unwrap();
        writer.finish().unwrap();
        file
    }

    fn read(file: &[u8]) -> Result<Vec<Recorded>, McapError> {
        let mut reader = Reader::new(file)?;
        let mut all = Vec::new();
        while let Some(message) = reader.next()? {
            assert_eq!(
                reader.channel(message.channel).unwrap().topic,
                "/wam/stateExt:o"
            );
            all.push(message);
        }
        Ok(all)
    }

    #[test]
    fn a_recording_is_read_back() {
        let file = recording();
        assert_eq!(read(&file).unwrap(), [message(0), message(1)]);
        assert!(file.starts_with(&MAGIC) && file.ends_with(&MAGIC));
    }

    /// A recorder that was killed leaves a file that ends anywhere.
    #[test]
    fn a_cut_recording_is_read_up_to_its_last_whole_message() {
        let file = recording();
        let mut most = 0;
        for end in MAGIC.len()..file.len() {
            let found = read(&file[..end]).unwrap().len();
            assert!(found >= most, "{end}");
            most = found;
        }
        assert_eq!(most, 2);
    }

    #[test]
    fn damaged_recordings_are_refused() {
        assert!(matches!(read(b"not one"), Err(McapError::NotMcap)));
        let file = recording();
        for index in 8..file.len() {
            for bit in [0x01, 0x80] {
                let mut damaged = file.clone();
                damaged[index] ^= bit;
                // The result may be anything but a panic or much memory.
                let _ = Reader::new(&damaged[..]).and_then(|mut reader| {
                    while reader.next()?.is_some() {}
                    Ok(())
                });
            }
        }
        let mut huge = MAGIC.to_vec();
        huge.push(MESSAGE);
        huge.extend(u64::MAX.to_le_bytes());
        assert!(matches!(read(&huge), Err(McapError::Damaged { .. })));
        let mut chunked = MAGIC.to_vec();
        chunked.push(CHUNK);
        chunked.extend(0_u64.to_le_bytes());
        assert!(matches!(read(&chunked), Err(McapError::Chunked)));
        let mut orphan = MAGIC.to_vec();
        orphan.push(MESSAGE);
        orphan.extend((MESSAGE_HEAD as u64).to_le_bytes());
        orphan.extend([0; MESSAGE_HEAD]);
        assert!(matches!(read(&orphan), Err(McapError::Damaged { .. })));
    }
}
