//! Lines of standard input.

use std::io::{BufRead, IsTerminal, Write};
use std::sync::mpsc::{SyncSender, sync_channel};

use tokio::sync::mpsc;

use crate::output::Printer;

/// Prompt for a line on a terminal.
const PROMPT: &str = ">>";

/// Lines of standard input, read by a dedicated thread so that nothing else waits for them.
///
/// A line is read only once it is requested. The thread cannot be stopped while the system waits
/// for input; it ends with the process.
#[derive(Debug)]
pub(crate) struct Lines {
    ask: SyncSender<()>,
    lines: mpsc::Receiver<String>,
    asked: bool,
}

impl Lines {
    /// Opens the standard input of this process.
    pub(crate) fn open() -> Self {
        let (ask, asked) = sync_channel::<()>(1);
        let (sender, lines) = mpsc::channel(1);
        std::thread::spawn(move || {
            let terminal = std::io::stdin().is_terminal();
            while asked.recv().is_ok() {
                if terminal {
                    let mut out = Printer::default();
                    // If standard output is closed, the prompt is not needed.
                    let _ = write!(out, "{PROMPT}").and_then(|()| out.flush());
                }
                let Some(line) = next_line(&mut std::io::stdin().lock()) else {
                    return;
                };
                if sender.blocking_send(line).is_err() {
                    return;
                }
            }
        });
        Self {
            ask,
            lines,
            asked: false,
        }
    }

    /// Returns the next line, or `None` at the end. Cancel safe.
    pub(crate) async fn next(&mut self) -> Option<String> {
        if !self.asked {
            // The thread may have ended; then the next receive returns `None`.
            let _ = self.ask.try_send(());
            self.asked = true;
        }
        let line = self.lines.recv().await;
        self.asked = false;
        line
    }
}

/// Returns a line without its line end. Text after the last line end is a line too, which stock drops.
fn next_line(input: &mut dyn BufRead) -> Option<String> {
    let mut bytes = Vec::new();
    input.read_until(b'\n', &mut bytes).ok()?;
    if bytes.is_empty() {
        return None;
    }
    let line = bytes.strip_suffix(b"\n").unwrap_or(&bytes);
    let line = line.strip_suffix(b"\r").unwrap_or(line);
    Some(String::from_utf8_lossy(line).into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_line_may_have_no_end() {
        let mut input = &b"one\r\n\ntwo\nrest"[..];
        let mut lines = std::iter::from_fn(|| next_line(&mut input));
        assert_eq!(lines.next().as_deref(), Some("one"));
        assert_eq!(lines.next().as_deref(), Some(""));
        assert_eq!(lines.next().as_deref(), Some("two"));
        assert_eq!(lines.next().as_deref(), Some("rest"));
        assert_eq!(lines.next(), None);
    }
}
