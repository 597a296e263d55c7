//! A hand behind a server: requests of three letters, over a TCP connection.
//!
//! | request | body | what the hand does | answer |
//! | --- | --- | --- | --- |
//! | `hhi` | | initialises | `d`, or `q` for no |
//! | `cgo` | | opens the spread | the same |
//! | `opn`, `cls` | | opens, closes the fingers | the same |
//! | `hhe` | | goes home: fingers to 4000 counts, then all close | the same |
//! | `cmd` | a line of GCL, 00 | the line | `d` or `q`, text without echo and prompt, 00 |
//!
//! An answer comes when the hand's prompt is back, in the order of the requests. `cmd` with ^C alone stops the hand at
//! once, also during another request, which then answers `q`. As with the arm, the driver listens and the server
//! connects.
//!
//! | file | content |
//! | --- | --- |
//! | `node_protocol` | the bytes; no socket |
//! | `remote_hand` | [`RemoteHand`]: waits for the server and sends it requests |
//! | `node_server` | [`HandNode`]: the server beside the hand |
//!
//! Source: tables 4 and 17 of the thesis. Details that it leaves open (the end of a line, the text of a refusal, the
//! transport of ^C) are decided here: the 00, the text after `q`, and the port 4322 are ours.

mod node_protocol;
mod node_server;
mod remote_hand;

pub use node_protocol::{
    MAX_LINE, NodeReply, NodeReplyReader, Request, RequestError, RequestReader,
};
pub use node_server::HandNode;
pub use remote_hand::{RemoteHand, RemoteHandOptions};

/// The port on which the driver waits for the server.
pub const PORT: u16 = 4322;
