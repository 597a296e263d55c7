//! Messages, replies and acknowledgements into a stream.

use bytes::{BufMut, BytesMut};

use crate::carrier::{Carrier, Framing, Transport};
use crate::dialect::Dialect;
use crate::http::page;
use crate::message::{Command, Index, WireObject};
use crate::number;
use crate::websocket::{put_close, put_frame_head};

/// The acknowledgement of a text connection.
pub const ACKNOWLEDGEMENT_LINE: &str = "<ACK>";

/// The acknowledgement of a connection without an index.
pub(super) const ACKNOWLEDGEMENT_WORD: &[u8; 4] = b"ACK\0";

/// Appends a message: its head and, if it has one, its content.
pub fn put_message(
    out: &mut BytesMut,
    carrier: &Carrier,
    command: &Command,
    content: Option<&dyn WireObject>,
    dialect: Dialect,
) {
    let mut payload = BytesMut::new();
    if let Some(content) = content {
        put_reply(&mut payload, carrier, content, dialect);
    }
    put_head(out, carrier, command, payload.len());
    out.extend_from_slice(&payload);
}

/// Appends all of a message that comes before a payload of `length` bytes.
pub fn put_head(out: &mut impl BufMut, carrier: &Carrier, command: &Command, length: usize) {
    match carrier.framing {
        Framing::Indexed => {
            Index::put(out, command.block_len(), length);
            command.put_block(out);
        }
        Framing::Bare if carrier.transport == Transport::WebSocket => {
            put_frames(out, command, length);
        }
        Framing::Bare => command.put_block(out),
        Framing::Lines => command.put_line(out),
        // What goes to browsers is made whole: a part holds its own head.
        Framing::NameService | Framing::Http | Framing::Pictures => {}
    }
}

/// As stock: the block is a frame, the payload another.
fn put_frames(out: &mut impl BufMut, command: &Command, length: usize) {
    put_frame_head(out, command.block_len());
    command.put_block(out);
    if length > 0 {
        put_frame_head(out, length);
    }
    if *command == Command::Quit {
        put_close(out);
    }
}

/// Appends a reply, or the payload of a message: the object alone, in the form of the carrier.
pub fn put_reply(out: &mut BytesMut, carrier: &Carrier, object: &dyn WireObject, dialect: Dialect) {
    match carrier.framing {
        Framing::Indexed | Framing::Bare | Framing::Pictures => {
            object.write_binary(out, dialect);
        }
        Framing::Lines | Framing::NameService => object.write_text(out),
        Framing::Http => {
            let mut text = BytesMut::new();
            object.write_text(&mut text);
            let chunk = page::chunk(&String::from_utf8_lossy(&text));
            out.put_slice(chunk.as_bytes());
        }
    }
}

/// Appends an acknowledgement, if the carrier has them.
pub fn put_acknowledgement(out: &mut impl BufMut, carrier: &Carrier) {
    if !carrier.acknowledges {
        return;
    }
    match carrier.framing {
        Framing::Indexed => number::put(out, 0),
        Framing::Bare => out.put_slice(ACKNOWLEDGEMENT_WORD),
        Framing::Lines | Framing::NameService | Framing::Http | Framing::Pictures => {
            out.put_slice(ACKNOWLEDGEMENT_LINE.as_bytes());
            out.put_slice(b"\r\n");
        }
    }
}
