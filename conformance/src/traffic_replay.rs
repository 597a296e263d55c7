//! Plays the connecting side of a recorded conversation and compares the answers.

use std::time::Duration;

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

use crate::capture::{Run, Stream};
use crate::traffic_mask;

/// Timeout after which an answer counts as missing.
const REPLY_TIMEOUT: Duration = Duration::from_secs(20);

/// Length of a header reply, whose number is the acceptor's port.
const HEADER_REPLY_BYTES: usize = 8;

/// A connection of a recorded conversation, to be played against a peer of ours.
#[derive(Debug)]
pub struct Player<'a> {
    stream: TcpStream,
    runs: std::slice::Iter<'a, Run>,
    heard: bool,
}

impl<'a> Player<'a> {
    /// Connects to a peer of ours.
    pub async fn connect(recorded: &'a Stream, address: (&str, u16)) -> Result<Self, String> {
        let stream = TcpStream::connect(address)
            .await
            .map_err(|error| format!("cannot connect to {address:?}: {error}"))?;
        Ok(Self {
            stream,
            runs: recorded.runs.iter(),
            heard: false,
        })
    }

    /// Plays the next run; returns `false` at the end.
    pub async fn step(&mut self) -> Result<bool, String> {
        let Some(run) = self.runs.next() else {
            return Ok(false);
        };
        if run.sent {
            let sent = self.stream.write_all(&run.bytes).await;
            sent.map_err(|error| format!("cannot send {}: {error}", show(&run.bytes)))?;
            return Ok(true);
        }
        let first = !std::mem::replace(&mut self.heard, true);
        let answer = self.answer_like(&run.bytes).await?;
        if comparable(&answer, first) != comparable(&run.bytes, first) {
            let (got, expected) = (show(&answer), show(&run.bytes));
            return Err(format!(
                "answers differ\n  stock: {expected}\n  ours:  {got}"
            ));
        }
        Ok(true)
    }

    /// Plays the rest, and checks that the peer sends nothing more than recorded.
    pub async fn finish(mut self) -> Result<(), String> {
        while self.step().await? {}
        // The peer may wait for more data: closing the write side tells it that nothing follows.
        let _ = self.stream.shutdown().await;
        let mut rest = Vec::new();
        let reading = self.stream.read_to_end(&mut rest);
        // A reset ends the connection as well.
        let _ = tokio::time::timeout(REPLY_TIMEOUT, reading)
            .await
            .map_err(|_| "the connection stays open after the conversation")?;
        if rest.is_empty() {
            Ok(())
        } else {
            Err(format!("said more than stock: {}", show(&rest)))
        }
    }

    /// Reads an answer of the same shape: as many lines, or as many bytes if it is binary.
    async fn answer_like(&mut self, recorded: &[u8]) -> Result<Vec<u8>, String> {
        let lines = |bytes: &[u8]| bytes.iter().filter(|byte| **byte == b'\n').count();
        let text = is_text(recorded);
        let mut answer = Vec::new();
        let mut byte = [0];
        while if text {
            lines(&answer) < lines(recorded)
        } else {
            answer.len() < recorded.len()
        } {
            let reading = self.stream.read(&mut byte);
            match tokio::time::timeout(REPLY_TIMEOUT, reading).await {
                Ok(Ok(1)) => answer.push(byte[0]),
                other => {
                    let (got, expected) = (show(&answer), show(recorded));
                    return Err(format!(
                        "the answer breaks off ({other:?})\n  stock: {expected}\n  ours:  {got}"
                    ));
                }
            }
        }
        Ok(answer)
    }
}

/// Plays a whole connection.
pub async fn play(recorded: &Stream, address: (&str, u16)) -> Result<(), String> {
    Player::connect(recorded, address).await?.finish().await
}

/// Masks everything in an answer that may differ.
fn comparable(bytes: &[u8], first: bool) -> Vec<u8> {
    if is_text(bytes) {
        return traffic_mask::text(bytes).into_bytes();
    }
    let mut bytes = bytes.to_vec();
    if first && bytes.len() >= HEADER_REPLY_BYTES && bytes.starts_with(b"YA") {
        bytes[2..6].fill(0);
    }
    bytes
}

fn is_text(bytes: &[u8]) -> bool {
    bytes
        .iter()
        .all(|byte| matches!(byte, b'\r' | b'\n' | b'\t' | b' '..=b'~'))
}

fn show(bytes: &[u8]) -> String {
    bytes.escape_ascii().to_string()
}

/// Plays overlapping connections, each run in its recorded order.
///
/// Returns the errors of all connections, each with what its connection sent first.
pub async fn play_together<'a>(
    recorded: impl IntoIterator<Item = &'a Stream>,
    address: (&str, u16),
) -> Vec<String> {
    let recorded: Vec<&Stream> = recorded.into_iter().collect();
    let mut turns: Vec<(usize, f64)> = Vec::new();
    for (index, stream) in recorded.iter().enumerate() {
        turns.extend(stream.runs.iter().map(|run| (index, run.time)));
    }
    turns.sort_by(|a, b| a.1.total_cmp(&b.1));
    let mut players: Vec<Option<Player<'_>>> = Vec::new();
    players.resize_with(recorded.len(), || None);
    let mut left: Vec<usize> = recorded.iter().map(|stream| stream.runs.len()).collect();
    let mut errors = Vec::new();
    for (index, _) in turns {
        if left[index] == 0 {
            continue;
        }
        let turn = async {
            if players[index].is_none() {
                players[index] = Some(Player::connect(recorded[index], address).await?);
            }
            let player = players[index].as_mut().expect("connected above");
            player.step().await?;
            left[index] -= 1;
            if left[index] == 0
                && let Some(player) = players[index].take()
            {
                player.finish().await?;
            }
            Ok::<(), String>(())
        };
        if let Err(error) = turn.await {
            left[index] = 0;
            players[index] = None;
            errors.push(format!("{}: {error}", show(&recorded[index].runs[0].bytes)));
        }
    }
    errors
}
