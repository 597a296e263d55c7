//! The output of a command, sent to stock's `yarplogger` line by line.
//!
//! Each command has a port `/log/SERVER/PROGRAM/PID`, which connects to the logger; a logger that starts later finds it by its
//! name. A message has two strings: the name of the port in brackets, and the line. A command never waits for a logger: a reader
//! that is [`MAX_BACKLOG`] lines behind misses lines.

use std::io::PipeReader;
use std::os::fd::OwnedFd;
use std::path::Path;
use std::time::Duration;

use rustix::process::Pid;
use tokio::io::AsyncReadExt;
use tokio::net::unix::pipe::Receiver;
use tokio::runtime::Handle;
use tokio::time::timeout;
use yarp_ports::{Network, Port, PortOptions, error_chain};
use yarp_wire::Bottle;

use super::note;
use super::text_chunks::{Lines, MAX_LINE, TextDecoder};

/// Logger if a request names none.
pub(super) const LOGGER: &str = "/yarplogger";
/// Lines that wait for a reader.
const MAX_BACKLOG: usize = 1000;
/// Timeout of the connection to the logger.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(2);

/// Sends the output of commands of a server.
#[derive(Clone, Debug)]
pub(super) struct OutputLog {
    network: Network,
    /// Port of the server.
    server: String,
    runtime: Handle,
}

impl OutputLog {
    pub(super) fn new(network: &Network, server: &str) -> Self {
        Self {
            network: network.clone(),
            server: server.to_owned(),
            runtime: Handle::current(),
        }
    }

    /// Sends what `command` prints to the port `logger`, until its end.
    pub(super) fn forward(&self, output: PipeReader, command: &str, pid: Pid, logger: &str) {
        let name = self.name_of(command, pid);
        let (network, logger) = (self.network.clone(), logger.to_owned());
        self.runtime.spawn(async move {
            if let Err(reason) = send(&network, output, &name, &logger).await {
                note(format_args!("{name}: output not forwarded: {reason}"));
            }
        });
    }

    /// Opens the port for the output of `command`, and connects it to the port `logger`; reports a failure.
    pub(super) async fn open(&self, command: &str, pid: Pid, logger: &str) -> Option<LogPort> {
        LogPort::open(&self.network, &self.name_of(command, pid), logger).await
    }

    fn name_of(&self, command: &str, pid: Pid) -> String {
        let pid = pid.as_raw_nonzero();
        format!("/log{}/{}/{pid}", self.server, program(command))
    }
}

/// Port that sends lines to a logger.
#[derive(Debug)]
pub(super) struct LogPort {
    port: Port,
    /// First string of each message.
    sender: String,
    lines: Lines,
}

impl LogPort {
    /// Opens the port, and connects it to the port `logger` if that is there; reports a failure.
    pub(super) async fn open(network: &Network, name: &str, logger: &str) -> Option<Self> {
        let port = match Port::open(network, name, PortOptions::new()).await {
            Ok(port) => port,
            Err(error) => {
                note(format_args!("{name}: {}", error_chain(&error)));
                return None;
            }
        };
        let _ = timeout(CONNECT_TIMEOUT, port.connect(logger)).await;
        Some(Self {
            port,
            sender: format!("[{name}]"),
            lines: Lines::default(),
        })
    }

    /// Sends each line that is complete with this text.
    pub(super) fn write(&mut self, text: &str) {
        let Self {
            port,
            sender,
            lines,
        } = self;
        lines.push(text, |line| send_line(port, sender, line));
    }

    /// Sends a last line without an end, and closes the port.
    pub(super) async fn close(self) {
        let Self {
            port,
            sender,
            mut lines,
        } = self;
        lines.finish(|line| send_line(&port, &sender, line));
        port.close().await;
    }
}

fn send_line(port: &Port, sender: &str, line: &str) {
    let message = Bottle::new().with(sender).with(line);
    port.try_write(&message, None, MAX_BACKLOG);
}

/// Returns the name of the program of a command line, without its folder.
fn program(command: &str) -> &str {
    let path = command.split_whitespace().next().unwrap_or_default();
    let path = path.trim_matches('"');
    let name = Path::new(path).file_name().and_then(|name| name.to_str());
    name.unwrap_or("command")
}

async fn send(
    network: &Network,
    output: PipeReader,
    name: &str,
    logger: &str,
) -> Result<(), String> {
    let mut output = Receiver::from_owned_fd(OwnedFd::from(output)).map_err(|e| e.to_string())?;
    // The command must be able to print, whether its port can be opened or not.
    let mut port = LogPort::open(network, name, logger).await;
    let mut decoder = TextDecoder::default();
    let mut buffer = [0; MAX_LINE];
    let result = loop {
        let text = match output.read(&mut buffer).await {
            Ok(0) => break Ok(()),
            Ok(length) => decoder.push(&buffer[..length]),
            Err(error) => break Err(error.to_string()),
        };
        if let Some(port) = &mut port {
            port.write(&text);
        }
    };
    if let Some(mut port) = port {
        port.write(&decoder.finish());
        port.close().await;
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_is_named_after_the_program() {
        assert_eq!(program("/usr/bin/sleep 9"), "sleep");
        assert_eq!(program("sh -c \"echo /a/b\""), "sh");
        assert_eq!(program("\"/opt/x\" 1"), "x");
        assert_eq!(program(""), "command");
    }
}
