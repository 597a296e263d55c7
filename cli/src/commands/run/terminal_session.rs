//! The server's end of a command with a terminal: its ports, and the text between them and the pipes of the command.

use std::os::fd::OwnedFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use rustix::io::Errno;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::unix::pipe::{Receiver, Sender};
use tokio::sync::{Notify, mpsc, watch};
use tokio::time::{Instant, timeout, timeout_at};
use yarp_ports::{Answer, Network, Port, PortOptions, error_chain};
use yarp_wire::Bottle;

use super::note;
use super::output_log::LogPort;
use super::process_table::Piped;
use super::text_chunks::{MAX_LINE, TextDecoder, message_text};

/// Time that the output of a command waits for its terminal; later output without a terminal is lost.
const READER_TIMEOUT: Duration = Duration::from_secs(10);
/// Time for the rest of the output after the end of a command. A terminal that its user has stopped takes none.
const DRAIN_TIMEOUT: Duration = Duration::from_secs(2);

/// Number of the next session of this process.
static NEXT_SESSION: AtomicU32 = AtomicU32::new(0);

/// The ports of a command with a terminal.
#[derive(Debug)]
pub(super) struct TerminalSession {
    id: String,
    output: Output,
    input: Port,
    /// Text for the command. While it takes none, the writers wait.
    typed: mpsc::Receiver<String>,
}

impl TerminalSession {
    /// Opens the ports, for peers that may administer the port `server` and for nobody else.
    ///
    /// Errors, in words: a port that cannot be opened.
    pub(super) async fn open(network: &Network, server: &str, tag: &str) -> Result<Self, String> {
        let number = NEXT_SESSION.fetch_add(1, Ordering::Relaxed);
        let id = format!("{server}/{}/{tag}-{number}", std::process::id());
        let options = || PortOptions::new().administrators_of(server).no_browsers();
        let output = Output::open(network, &format!("{id}/stdout"), options()).await?;
        let (sender, typed) = mpsc::channel(1);
        let options = options().input_only().handler(move |received| {
            let sender = sender.clone();
            let text = message_text(&received.bottle().unwrap_or_default());
            Answer::Later(Box::pin(async move {
                // Without its receiver the command has ended.
                let _ = sender.send(text).await;
                Answer::Nothing
            }))
        });
        let input = open(network, &format!("{id}/stdin"), options).await?;
        Ok(Self {
            id,
            output,
            input,
            typed,
        })
    }

    /// Returns the prefix of the ports, which stands for the session in requests.
    pub(super) fn id(&self) -> &str {
        &self.id
    }

    /// Passes text between a command and its terminal, until the command has ended and the terminal has its output.
    pub(super) async fn run(&mut self, command: Piped, log: Option<LogPort>) {
        let Piped {
            input,
            output,
            mut ended,
            ..
        } = command;
        let pipes = (
            Sender::from_owned_fd(OwnedFd::from(input)),
            Receiver::from_owned_fd(OwnedFd::from(output)),
        );
        let (Ok(input), Ok(output)) = pipes else {
            note(format_args!("{}: the pipes cannot be read", self.id));
            let _ = ended.await;
            return;
        };
        let reader_deadline = Instant::now() + READER_TIMEOUT;
        let (has_ended, watched) = watch::channel(false);
        let showing = show(&self.output, output, log, reader_deadline, watched);
        tokio::pin!(showing);
        let typing = pass_input(&mut self.typed, input);
        tokio::pin!(typing);
        let mut is_shown = false;
        loop {
            tokio::select! {
                biased;
                _ = &mut ended => break,
                () = &mut showing, if !is_shown => is_shown = true,
                () = &mut typing => {}
            }
        }
        has_ended.send_replace(true);
        if !is_shown {
            let deadline = reader_deadline.max(Instant::now()) + DRAIN_TIMEOUT;
            let _ = timeout_at(deadline, showing).await;
        }
    }

    /// Sends a text to the terminal: the reason why the command did not start.
    pub(super) async fn send_text(&self, text: &str) {
        let sending = async {
            self.output.has_reader().await;
            self.output.port.write(&Bottle::of(text)).await
        };
        let _ = timeout(DRAIN_TIMEOUT, sending).await;
    }

    /// Closes the ports.
    pub(super) async fn close(self) {
        tokio::join!(self.output.port.close(), self.input.close());
    }
}

/// The port of what a command prints.
#[derive(Debug)]
struct Output {
    port: Port,
    /// Notifies of connections of the port that begin or end.
    changes: Arc<Notify>,
}

impl Output {
    async fn open(network: &Network, name: &str, options: PortOptions) -> Result<Self, String> {
        let changes = Arc::<Notify>::default();
        let changed = changes.clone();
        let options = options.on_connection_change(move |_| changed.notify_waiters());
        let port = open(network, name, options).await?;
        Ok(Self { port, changes })
    }

    /// Waits until the port has a reader.
    async fn has_reader(&self) {
        loop {
            let changed = self.changes.notified();
            if !self.port.outputs().is_empty() {
                return;
            }
            changed.await;
        }
    }
}

async fn open(network: &Network, name: &str, options: PortOptions) -> Result<Port, String> {
    let opening = Port::open(network, name, options);
    opening.await.map_err(|error| error_chain(&error))
}

/// Sends what a command prints, until all of it has ended; once the command itself has ended, what it has left.
async fn show(
    shown: &Output,
    mut output: Receiver,
    mut log: Option<LogPort>,
    reader_deadline: Instant,
    mut ended: watch::Receiver<bool>,
) {
    let _ = timeout_at(reader_deadline, shown.has_reader()).await;
    let mut decoder = TextDecoder::default();
    let mut buffer = [0; MAX_LINE];
    loop {
        let length = tokio::select! {
            biased;
            _ = ended.wait_for(|ended| *ended) => match rustix::io::read(&output, &mut buffer) {
                Err(Errno::INTR) => continue,
                // A child of the command may still have the pipe.
                read => read.unwrap_or(0),
            },
            read = output.read(&mut buffer) => read.unwrap_or(0),
        };
        let text = match length {
            0 => decoder.finish(),
            _ => decoder.push(&buffer[..length]),
        };
        if let Some(log) = &mut log {
            log.write(&text);
        }
        if !text.is_empty() {
            shown.port.write(&Bottle::of(text.as_str())).await;
        }
        if length == 0 {
            break;
        }
    }
    if let Some(log) = log {
        log.close().await;
    }
}

/// Passes text to a command for ever. What a command does not read any more is discarded.
async fn pass_input(typed: &mut mpsc::Receiver<String>, input: Sender) {
    let mut input = Some(input);
    while let Some(text) = typed.recv().await {
        if let Some(pipe) = &mut input
            && pipe.write_all(text.as_bytes()).await.is_err()
        {
            input = None;
        }
    }
    std::future::pending().await
}
