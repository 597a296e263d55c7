//! Commands of messages to a port.

use crate::ready::Ready;
use bytes::{BufMut, Bytes};

/// The command in front of every message on a carrier that can escape.
///
/// Binary block: `int32 n, '~', CHAR, 0, 1`; if CHAR is 0 a string of n bytes follows, the last
/// of them NUL. Text: one line; its first character is the command.
#[derive(Clone, Debug, Eq, PartialEq)]
#[non_exhaustive]
pub enum Command {
    /// `d`, `D`: a message for the port's owner follows.
    Data {
        /// `true` if the sender waits for a reply (`d`).
        reply: bool,
        /// The envelope of the message, usually a [`Stamp`](crate::Stamp).
        envelope: Option<Bytes>,
    },
    /// `a`: a message for the port itself follows.
    Admin,
    /// `/NAME`, `/CARRIER://NAME`: connect to.
    AddOutput(String),
    /// `!/NAME`: disconnect from a reader.
    RemoveOutput(String),
    /// `~/NAME`: disconnect from a writer.
    RemoveInput(String),
    /// `*`: describe yourself.
    Describe,
    /// `q`: this connection ends.
    Quit,
    /// `r`: from now on data flows the other way.
    Reverse,
    /// `i`: end the process.
    Interrupt,
    /// `?`, `h`: list the commands.
    Help,
    /// Anything else.
    Unknown(String),
}

/// The reason why bytes are not a command block.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
#[error("expected a port command block `n ~ c 0 1`, got {got:02X?}")]
pub struct CommandError {
    /// The bytes there.
    pub got: Vec<u8>,
}

/// Bytes of a block without its string.
const BLOCK: usize = 8;
/// Longest string of a command on a stream, in bytes, where nothing tells its length beforehand: that of a name with
/// its carrier, or of an envelope.
pub const SPELLED_LIMIT: usize = 4 * 1024;
/// Offset of the envelope in `D ENVELOPE`.
const ENVELOPE: usize = 2;

impl Command {
    /// Data without an envelope.
    pub const fn data(reply: bool) -> Self {
        Self::Data {
            reply,
            envelope: None,
        }
    }

    /// Reads the command that a line or a block's string spells.
    pub fn parse(line: &Bytes) -> Self {
        let text = || String::from_utf8_lossy(line).into_owned();
        let after = |n: usize| String::from_utf8_lossy(&line[n..]).into_owned();
        match line.first() {
            Some(letter @ (b'd' | b'D')) => Self::Data {
                reply: *letter == b'd',
                envelope: (line.len() > ENVELOPE).then(|| line.slice(ENVELOPE..)),
            },
            Some(b'a') => Self::Admin,
            Some(b'/') => Self::AddOutput(text()),
            Some(b'!') => Self::RemoveOutput(after(1)),
            Some(b'~') => Self::RemoveInput(after(1)),
            Some(b'*') => Self::Describe,
            Some(b'q') => Self::Quit,
            Some(b'r') => Self::Reverse,
            Some(b'i') => Self::Interrupt,
            Some(b'?' | b'h') => Self::Help,
            _ => Self::Unknown(text()),
        }
    }

    /// Reads a block at the start of the bytes of one whole message; gives its size as well.
    pub fn read(message: &Bytes) -> Result<(Self, usize), CommandError> {
        let wrong = || CommandError {
            got: message[..message.len().min(BLOCK)].to_vec(),
        };
        let block: [u8; BLOCK] = *message.first_chunk().ok_or_else(wrong)?;
        if block[4] != b'~' {
            return Err(wrong());
        }
        // The commonest ones without further ado.
        match block[5] {
            b'd' => return Ok((Self::data(true), BLOCK)),
            b'D' => return Ok((Self::data(false), BLOCK)),
            _ => {}
        }
        if block[5] != 0 {
            let letter = message.slice(5..6);
            return Ok((Self::parse(&letter), BLOCK));
        }
        // The string goes up to its NUL; stock does not look at n.
        let string = &message[BLOCK..];
        let end = string.iter().position(|b| *b == 0).ok_or_else(wrong)?;
        let spelled = message.slice(BLOCK..BLOCK + end);
        Ok((Self::parse(&spelled), BLOCK + end + 1))
    }

    /// Reads a block at the start of a stream; `None` while bytes are missing. Its string may have
    /// [`SPELLED_LIMIT`] bytes. `searched` is kept by the caller while the stream grows, 0 at first, and holds how far the end of the
    /// string was looked for.
    pub fn read_prefix(stream: &[u8], searched: &mut usize) -> Ready<(Self, usize), CommandError> {
        let Some(block) = stream.first_chunk::<BLOCK>() else {
            return Ok(None);
        };
        let wrong = || CommandError {
            got: block.to_vec(),
        };
        if block[4] != b'~' {
            return Err(wrong());
        }
        // The commonest ones without a copy.
        match block[5] {
            b'd' => return Ok(Some((Self::data(true), BLOCK))),
            b'D' => return Ok(Some((Self::data(false), BLOCK))),
            _ => {}
        }
        let string = &stream[BLOCK..];
        let end = match block[5] {
            0 => {
                let within = &string[..string.len().min(SPELLED_LIMIT + 1)];
                let from = std::mem::take(searched).min(within.len());
                match within[from..].iter().position(|byte| *byte == 0) {
                    Some(end) => BLOCK + from + end + 1,
                    None if within.len() > SPELLED_LIMIT => return Err(wrong()),
                    None => {
                        *searched = within.len();
                        return Ok(None);
                    }
                }
            }
            _ => BLOCK,
        };
        Self::read(&Bytes::copy_from_slice(&stream[..end])).map(Some)
    }

    /// Returns whether a payload follows.
    pub const fn has_payload(&self) -> bool {
        matches!(self, Self::Data { .. } | Self::Admin)
    }

    /// Bytes of the block that [`Command::put_block`] appends.
    pub fn block_len(&self) -> usize {
        match self.letter() {
            Some(_) => BLOCK,
            None => BLOCK + self.spelled().len() + 1,
        }
    }

    /// Appends the block, in the form that stock uses for this command.
    pub fn put_block(&self, out: &mut impl BufMut) {
        if let Some(letter) = self.letter() {
            out.put_slice(&[0, 0, 0, 0, b'~', letter, 0, 1]);
            return;
        }
        let spelled = self.spelled();
        out.put_i32_le(spelled.len() as i32 + 1);
        out.put_slice(&[b'~', 0, 0, 1]);
        out.put_slice(&spelled);
        out.put_u8(0);
    }

    /// Appends the line of a text connection.
    pub fn put_line(&self, out: &mut impl BufMut) {
        match self.letter() {
            Some(letter) => out.put_u8(letter),
            None => out.put_slice(&self.spelled()),
        }
        out.put_slice(b"\r\n");
    }

    /// Returns the letter of the commands that stock writes as a letter alone.
    const fn letter(&self) -> Option<u8> {
        match self {
            Self::Data {
                reply,
                envelope: None,
            } => Some(if *reply { b'd' } else { b'D' }),
            Self::Admin => Some(b'a'),
            _ => None,
        }
    }

    fn spelled(&self) -> Vec<u8> {
        match self {
            Self::Data { reply, envelope } => {
                let mut out = vec![if *reply { b'd' } else { b'D' }, b' '];
                out.extend_from_slice(envelope.as_deref().unwrap_or_default());
                out
            }
            Self::Admin => b"a".to_vec(),
            Self::AddOutput(name) => name.clone().into_bytes(),
            Self::RemoveOutput(name) => format!("!{name}").into_bytes(),
            Self::RemoveInput(name) => format!("~{name}").into_bytes(),
            Self::Describe => b"*".to_vec(),
            Self::Quit => b"q".to_vec(),
            Self::Reverse => b"r".to_vec(),
            Self::Interrupt => b"i".to_vec(),
            Self::Help => b"?".to_vec(),
            Self::Unknown(text) => text.clone().into_bytes(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(command: Command, block: &[u8], line: &str) {
        let mut bytes = Vec::new();
        command.put_block(&mut bytes);
        assert_eq!(bytes, block);
        assert_eq!(command.block_len(), block.len());
        let read = Command::read(&Bytes::copy_from_slice(block));
        assert_eq!(read, Ok((command.clone(), block.len())));
        let mut text = Vec::new();
        command.put_line(&mut text);
        assert_eq!(text, line.as_bytes());
    }

    #[test]
    fn commands_read_and_print() {
        check(Command::data(false), b"\0\0\0\0~D\0\x01", "D\r\n");
        check(Command::data(true), b"\0\0\0\0~d\0\x01", "d\r\n");
        check(Command::Admin, b"\0\0\0\0~a\0\x01", "a\r\n");
        check(Command::Quit, b"\x02\0\0\0~\0\0\x01q\0", "q\r\n");
        let stamped = Command::Data {
            reply: false,
            envelope: Some("7 1.5".into()),
        };
        check(stamped, b"\x08\0\0\0~\0\0\x01D 7 1.5\0", "D 7 1.5\r\n");
        check(
            Command::RemoveInput("/a".into()),
            b"\x04\0\0\0~\0\0\x01~/a\0",
            "~/a\r\n",
        );
    }

    #[test]
    fn a_letter_may_also_be_spelled() {
        let spelled = Bytes::from_static(b"\x02\0\0\0~\0\0\x01a\0rest");
        assert_eq!(Command::read(&spelled), Ok((Command::Admin, 10)));
        assert_eq!(Command::parse(&"do".into()), Command::data(true));
    }

    /// Whoever never ended it had all of it searched anew for each byte that came.
    #[test]
    fn the_string_of_a_stream_is_searched_once_and_bounded() {
        let mut stream = b"\0\0\0\0~\0\0\x01D ".to_vec();
        let mut searched = 0;
        for size in 0..4096 - 2 {
            assert_eq!(Command::read_prefix(&stream, &mut searched), Ok(None));
            assert_eq!(searched, 2 + size);
            stream.push(b'x');
        }
        let mut whole = stream.clone();
        whole.push(0);
        let mut anew = searched;
        let (command, length) = Command::read_prefix(&whole, &mut anew).unwrap().unwrap();
        assert!(matches!(
            command,
            Command::Data {
                reply: false,
                envelope: Some(_)
            }
        ));
        assert_eq!((length, anew), (whole.len(), 0));
        assert_eq!(Command::read_prefix(&stream, &mut searched), Ok(None));
        stream.push(b'x');
        assert!(Command::read_prefix(&stream, &mut searched).is_err());
        stream.push(0);
        assert!(Command::read_prefix(&stream, &mut 0).is_err());
    }

    #[test]
    fn invalid_command_blocks_are_refused() {
        for bytes in [
            &b""[..],
            b"\0\0\0\0",
            b"\0\0\0\0!D\0\x01",
            b"\x02\0\0\0~\0\0\x01aaaa",
        ] {
            assert!(Command::read(&Bytes::copy_from_slice(bytes)).is_err());
        }
    }
}
