//! Terminals for commands: a window of `xterm`, or of another program, in which this program connects itself with a command.

use std::env;
use std::os::fd::OwnedFd;
use std::os::unix::process::CommandExt;
use std::process::{ChildStderr, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use rustix::process::Pid;
use tokio::io::AsyncReadExt;
use tokio::net::unix::pipe::Receiver;
use tokio::time::{sleep, timeout};
use yarp_ports::Network;
use yarp_wire::{Bottle, PortName, Value};

use super::process_table::{Processes, Window};
use super::{FORWARD_ARGUMENT, TERMINAL_ARGUMENT, launch};
use crate::commands::argument_words::Options;

/// Terminal of stock.
const XTERM: &str = "xterm";
/// Time that a terminal has to open its ports.
const OPEN_TIMEOUT: Duration = Duration::from_secs(10);
/// Interval between two checks of the ports.
const POLL_INTERVAL: Duration = Duration::from_millis(50);
/// Maximum number of bytes of error messages of a terminal that a client is told.
const MAX_ERRORS: usize = 1000;
/// Time that error messages may take after the end of a terminal.
const ERRORS_TIMEOUT: Duration = Duration::from_millis(200);

/// The program of terminals, with its first arguments.
#[derive(Clone, Debug)]
pub(super) struct TerminalProgram(Vec<String>);

impl TerminalProgram {
    /// Returns the program that the options of a server name, by default `xterm`.
    pub(super) fn of(options: &Options) -> Self {
        let words = launch::words(&options.text("terminal").unwrap_or_default());
        match words.is_empty() {
            true => Self(vec![XTERM.to_owned()]),
            false => Self(words),
        }
    }

    /// Returns the command that opens a window as stock does, but without a shell.
    fn command(&self, request: &TerminalRequest) -> Result<Command, String> {
        let own = env::current_exe();
        let own = own.map_err(|error| format!("Can't find this program: {error}"))?;
        let Some((program, first)) = self.0.split_first() else {
            return Err("Can't execute command because it is empty".to_owned());
        };
        let mut command = Command::new(program);
        let hold = match request.window.hold {
            true => "-hold",
            false => "+hold",
        };
        command.args(first).arg(hold);
        if let Some(geometry) = &request.geometry {
            command.args(["-geometry", geometry]);
        }
        command.args(["-title", &request.tag, "-e"]).arg(own);
        let option = format!("--{TERMINAL_ARGUMENT}");
        command.args(["run", &option, &request.window.session]);
        if let Some((port, logger)) = &request.forward {
            command.args([&format!("--{FORWARD_ARGUMENT}"), port, logger]);
        }
        // The window shows the command, not the connections.
        command.env("YARP_QUIET", "1");
        command.stdin(Stdio::null()).stdout(Stdio::null());
        command.stderr(Stdio::piped()).process_group(0);
        Ok(command)
    }
}

/// A request for a terminal.
#[derive(Debug, PartialEq)]
pub(super) struct TerminalRequest {
    tag: String,
    window: Window,
    geometry: Option<String>,
    /// Port for the log of the output, and port of the logger.
    forward: Option<(String, String)>,
}

impl TerminalRequest {
    /// Parses a request.
    ///
    /// Errors, in words: names that are no names of ports. Arguments of a program are made of them.
    pub(super) fn of(request: &Bottle) -> Result<Self, String> {
        let text = |name| request.find(name).map(Value::to_plain_string);
        let port = |name: &str| match name.parse::<PortName>().is_ok() {
            true => Ok(name.to_owned()),
            false => Err(format!("\"{name}\" is no name of a port")),
        };
        let session = text("stdiouuid").ok_or(
            "the request is for another server, and has no (stdiouuid ..) of that server's command",
        )?;
        let forward = request.find_group("forward").map(|group| {
            let text = |index| group.get(index).and_then(Value::as_str).unwrap_or_default();
            Ok::<_, String>((port(text(1))?, port(text(2))?))
        });
        Ok(Self {
            tag: text("as").unwrap_or_default(),
            window: Window {
                session: port(&session)?,
                hold: super::contains_word(request, "hold"),
            },
            geometry: text("geometry").filter(|geometry| !geometry.is_empty()),
            forward: forward.transpose()?,
        })
    }

    /// Returns the tag.
    pub(super) fn tag(&self) -> &str {
        &self.tag
    }

    /// Opens a terminal, and waits until it has opened its ports.
    ///
    /// Errors, in words with what to try: a missing program, one that ends early, one that does not open its ports.
    pub(super) async fn open(
        self,
        program: &TerminalProgram,
        processes: &Arc<Processes>,
        network: &Network,
    ) -> Result<Pid, String> {
        let remedy = "a terminal needs xterm on the PATH of its server and a screen (DISPLAY), or the server another program \
             (yarp run --server NAME --terminal COMMAND)";
        let session = self.window.session.clone();
        let mut command = program.command(&self)?;
        let started = processes.start_terminal(&mut command, &self.tag, self.window);
        let mut started =
            started.map_err(|reason| format!("{reason}: {}\n{remedy}", program.0[0]))?;
        let errors = started.errors.map(ErrorText::collect);
        let port = format!("{session}/stdio:i");
        let opening = until_registered(network, &port);
        tokio::pin!(opening);
        let deadline = sleep(OPEN_TIMEOUT);
        tokio::pin!(deadline);
        let mut runs = true;
        loop {
            tokio::select! {
                () = &mut opening => return Ok(started.pid),
                status = &mut started.ended, if runs => match status.ok().flatten() {
                    // It has left the window to another process.
                    Some(status) if status.success() => runs = false,
                    status => {
                        let told = match errors {
                            Some(errors) => errors.text().await,
                            None => String::new(),
                        };
                        let status = described(status);
                        return Err(format!("The terminal ended at once ({status}): {told}\n{remedy}"));
                    }
                },
                () = &mut deadline => {
                    processes.end_terminal(&session);
                    return Err(format!("The terminal opened no ports within {} s\n{remedy}", OPEN_TIMEOUT.as_secs()));
                }
            }
        }
    }
}

fn described(status: Option<ExitStatus>) -> String {
    status.map_or_else(|| "unknown status".to_owned(), |status| status.to_string())
}

async fn until_registered(network: &Network, name: &str) {
    while network.query(name).await.is_err() {
        sleep(POLL_INTERVAL).await;
    }
}

/// The beginning of what a terminal prints on standard error.
#[derive(Debug)]
struct ErrorText {
    text: Arc<Mutex<Vec<u8>>>,
    reading: tokio::task::JoinHandle<()>,
}

impl ErrorText {
    /// Reads until the end, so that the terminal never waits for it.
    fn collect(errors: ChildStderr) -> Self {
        let text = Arc::<Mutex<Vec<u8>>>::default();
        let collected = text.clone();
        let reading = tokio::spawn(async move {
            let Ok(mut errors) = Receiver::from_owned_fd(OwnedFd::from(errors)) else {
                return;
            };
            let mut buffer = [0; MAX_ERRORS];
            while let Ok(length @ 1..) = errors.read(&mut buffer).await {
                let mut text = collected.lock().unwrap_or_else(PoisonError::into_inner);
                let room = MAX_ERRORS - text.len();
                text.extend_from_slice(&buffer[..length.min(room)]);
            }
        });
        Self { text, reading }
    }

    /// Returns the text once it has ended.
    async fn text(self) -> String {
        // A process that the terminal has left behind may hold the pipe.
        let _ = timeout(ERRORS_TIMEOUT, self.reading).await;
        let text = self.text.lock().unwrap_or_else(PoisonError::into_inner);
        String::from_utf8_lossy(&text).trim().to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> Result<TerminalRequest, String> {
        TerminalRequest::of(&Bottle::parse(text).unwrap())
    }

    #[test]
    fn requests_of_stock_are_parsed() {
        let request = "(stdio \"/desk\") (cmd ls) (as t) (on \"/host\") (geometry \"80x24+0+0\") (hold) (stdiouuid \"/host/7/t-0\") \
             (forward \"/log/host/ls\" \"/yarplogger\")";
        let expected = TerminalRequest {
            tag: "t".to_owned(),
            window: Window {
                session: "/host/7/t-0".to_owned(),
                hold: true,
            },
            geometry: Some("80x24+0+0".to_owned()),
            forward: Some(("/log/host/ls".to_owned(), "/yarplogger".to_owned())),
        };
        assert_eq!(parsed(request), Ok(expected));
        let request = parsed("(as t) (stdiouuid /s) (geometry \"\")").unwrap();
        assert!(!request.window.hold && request.geometry.is_none() && request.forward.is_none());
    }

    /// Its words become arguments of a program.
    #[test]
    fn only_names_of_ports_become_arguments() {
        for (request, expected) in [
            ("(stdio /desk) (as t)", "has no (stdiouuid ..)"),
            (
                "(stdiouuid \"--server\")",
                "\"--server\" is no name of a port",
            ),
            ("(stdiouuid \"/a b\")", "\"/a b\" is no name of a port"),
            (
                "(stdiouuid /s) (forward \"--on\" /l)",
                "\"--on\" is no name",
            ),
            ("(stdiouuid /s) (forward /l \"-x\")", "\"-x\" is no name"),
            ("(stdiouuid /s) (forward)", "\"\" is no name"),
        ] {
            let reason = parsed(request).unwrap_err();
            assert!(reason.contains(expected), "{request}: {reason}");
        }
    }

    #[test]
    fn another_program_gets_the_options_of_xterm() {
        let check = |terminal: &str, expected: &[&str]| {
            let words: Vec<String> = match terminal {
                "" => vec![],
                _ => ["--terminal", terminal].map(str::to_owned).into(),
            };
            let program = TerminalProgram::of(&Options::parse(&words));
            let request = parsed("(as \"my tag\") (stdiouuid /s) (geometry \"9x9\")").unwrap();
            let command = program.command(&request).unwrap();
            let mut all = vec![command.get_program().to_str().unwrap()];
            all.extend(
                command
                    .get_args()
                    .map(|argument| argument.to_str().unwrap()),
            );
            let own = all.remove(expected.len() + 6);
            assert_eq!(own, env::current_exe().unwrap().to_str().unwrap());
            let rest = ["+hold", "-geometry", "9x9", "-title", "my tag", "-e"];
            let helper = ["run", "--readwrite", "/s"];
            assert_eq!(all, [expected, &rest, &helper].concat());
        };
        check("", &["xterm"]);
        check("urxvt -fg \"dark red\"", &["urxvt", "-fg", "dark red"]);
    }
}
