//! Sockets of the file system for connections within one machine.
//!
//! Both ends know the TCP ports of the header's connection and derive the path from them:
//! `DIR/<acceptor's TCP port>_<initiator's TCP port>.sock`. The acceptor makes the socket.

use std::io;
use std::path::PathBuf;
use std::time::Duration;

use socket2::SockRef;
use tokio::net::{TcpStream, UnixListener, UnixStream};

/// How long the acceptor waits for the initiator.
const PATIENCE: Duration = Duration::from_secs(5);
/// Pause between the initiator's tries, and how many there are; stock has 5.
const PAUSE: Duration = Duration::from_millis(20);
const TRIES: usize = 50;
/// Tries that are left once the header's connection has ended: most likely the acceptor has died.
const LAST_TRIES: usize = 5;

/// Bytes that may be on their way. The system tells a writer of room once no more than a quarter of it
/// is taken; with less room than this the reader has read that quarter before more comes.
const ROOM: usize = 300_000;

/// Goes on as acceptor of the connection that `header` began.
pub(crate) async fn accept(header: &TcpStream) -> io::Result<UnixStream> {
    let own = header.local_addr()?;
    let peer = header.peer_addr()?;
    if own.ip() != peer.ip() {
        let message = format!("{} is another machine", peer.ip());
        return Err(io::Error::other(message));
    }
    let path = path(own.port(), peer.port())?;
    // Left behind by a process that had the same ports and was killed.
    let _ = std::fs::remove_file(&path);
    let listener = UnixListener::bind(&path)?;
    let accepted = tokio::time::timeout(PATIENCE, listener.accept()).await;
    // Nobody else shall connect; the connection itself stays.
    let _ = std::fs::remove_file(&path);
    let (stream, _) = accepted.map_err(|_| io::ErrorKind::TimedOut)??;
    Ok(with_room(stream))
}

/// Goes on as initiator of the connection that `header` began; `answer` takes what the acceptor says
/// on that connection instead.
pub(crate) async fn connect(header: &TcpStream, answer: &mut [u8; 8]) -> io::Result<UnixStream> {
    let path = path(header.peer_addr()?.port(), header.local_addr()?.port())?;
    let mut tries = TRIES;
    let mut said = 0;
    loop {
        match UnixStream::connect(&path).await {
            Ok(stream) => return Ok(with_room(stream)),
            Err(error) if tries == 0 => {
                let message = format!("no socket at {}: {error}", path.display());
                return Err(io::Error::new(error.kind(), message));
            }
            Err(_) => tries -= 1,
        }
        tokio::time::sleep(PAUSE).await;
        match header.try_read(&mut answer[said..]) {
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
            read => {
                said += read.unwrap_or(0);
                tries = tries.min(LAST_TRIES);
            }
        }
    }
}

fn with_room(stream: UnixStream) -> UnixStream {
    // Less room only makes large messages slower.
    let _ = SockRef::from(&stream).set_send_buffer_size(ROOM);
    stream
}

/// Where the socket between two TCP ports is; makes the folder.
fn path(acceptor: u16, initiator: u16) -> io::Result<PathBuf> {
    let variable = |name| std::env::var_os(name).filter(|value| !value.is_empty());
    let folder = if let Some(folder) = variable("YARP_RUNTIME_DIR") {
        PathBuf::from(folder)
    } else if let Some(folder) = variable("XDG_RUNTIME_DIR") {
        PathBuf::from(folder).join("yarp")
    } else {
        let user = variable("USER").unwrap_or_default();
        let user = user.to_string_lossy();
        PathBuf::from(format!("/tmp/runtime-{user}")).join("yarp")
    };
    std::fs::create_dir_all(&folder)?;
    Ok(folder.join(format!("{acceptor}_{initiator}.sock")))
}
