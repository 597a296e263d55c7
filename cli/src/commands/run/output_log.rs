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
use tokio::io::{AsyncBufReadExt, AsyncReadExt, BufReader};
use tokio::net::unix::pipe::Receiver;
use tokio::runtime::Handle;
use tokio::time::timeout;
use yarp_ports::{Network, Port, PortOptions, error_chain};
use yarp_wire::{Bottle, Value};

use super::note;

/// Logger if a request names none.
pub(super) const LOGGER: &str = "/yarplogger";
/// Bytes of a line; a longer one is sent in parts, as by stock.
const MAX_LINE: u64 = 2047;
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
        let pid = pid.as_raw_nonzero();
        let name = format!("/log{}/{}/{pid}", self.server, program(command));
        let (network, logger) = (self.network.clone(), logger.to_owned());
        self.runtime.spawn(async move {
            if let Err(reason) = send(&network, output, &name, &logger).await {
                note(format_args!("{name}: output not forwarded: {reason}"));
            }
        });
    }
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
    let output = Receiver::from_owned_fd(OwnedFd::from(output)).map_err(|e| e.to_string())?;
    let mut output = BufReader::new(output);
    // The command must be able to print, whether its port can be opened or not.
    let port = Port::open(network, name, PortOptions::new()).await;
    let port = match port {
        Ok(port) => port,
        Err(error) => {
            note(format_args!("{name}: {}", error_chain(&error)));
            let mut discarded = tokio::io::sink();
            return tokio::io::copy(&mut output, &mut discarded)
                .await
                .map(drop)
                .map_err(|error| error.to_string());
        }
    };
    let _ = timeout(CONNECT_TIMEOUT, port.connect(logger)).await;
    let sender = format!("[{name}]");
    let mut line = Vec::new();
    let result = loop {
        line.clear();
        match (&mut output)
            .take(MAX_LINE)
            .read_until(b'\n', &mut line)
            .await
        {
            Ok(0) => break Ok(()),
            Ok(_) => {
                let text = Value::from(String::from_utf8_lossy(&line).as_ref());
                let message = Bottle::new().with(sender.as_str()).with(text);
                port.try_write(&message, None, MAX_BACKLOG);
            }
            Err(error) => break Err(error.to_string()),
        }
    };
    port.close().await;
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
