//! Processes of the peers.

use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use crate::Failure;

/// Timeout for output, longer than any measurement.
const OUTPUT_TIMEOUT: Duration = Duration::from_secs(60);

/// Implementation of a peer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Side {
    Ours,
    Stock,
    Zenoh,
}

/// Starts peers.
pub(crate) struct Bench {
    ours: PathBuf,
    next: std::cell::Cell<usize>,
}

impl Bench {
    pub(crate) fn new() -> Result<Self, Failure> {
        Ok(Self {
            ours: std::env::current_exe()?,
            next: 0.into(),
        })
    }

    /// Returns a new name for a port.
    pub(crate) fn name(&self) -> String {
        let next = self.next.get() + 1;
        self.next.set(next);
        format!("/bench/{}/{next}", std::process::id())
    }

    fn program(&self, side: Side) -> Result<PathBuf, Failure> {
        let (variable, source) = match side {
            Side::Ours => return Ok(self.ours.clone()),
            Side::Stock => ("STOCK_PEER", "bench/stock_peer.cpp"),
            Side::Zenoh => ("ZENOH_PEER", "bench/zenoh"),
        };
        let program = std::env::var_os(variable).ok_or_else(|| {
            format!("{variable} must name the built {source}; `conformance/bench/run.sh` does it")
        })?;
        Ok(program.into())
    }

    pub(crate) fn start(&self, side: Side, arguments: &[&str]) -> Result<Running, Failure> {
        self.start_with(side, arguments, &[])
    }

    /// Starts a peer with these variables in its environment.
    pub(crate) fn start_with(
        &self,
        side: Side,
        arguments: &[&str],
        variables: &[(&str, &str)],
    ) -> Result<Running, Failure> {
        let program = self.program(side)?;
        let mut child = Command::new(&program)
            .args(arguments)
            .envs(variables.iter().copied())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|error| format!("cannot start {}: {error}", program.display()))?;
        let output = BufReader::new(child.stdout.take().expect("piped"));
        let (said, lines) = channel();
        thread::spawn(move || {
            for line in output.lines().map_while(Result::ok) {
                if said.send(line).is_err() {
                    return;
                }
            }
        });
        let log = BufReader::new(child.stderr.take().expect("piped"));
        let last_words = thread::spawn(move || log.lines().map_while(Result::ok).last());
        let what = format!("{side:?} {}", arguments.join(" "));
        Ok(Running {
            child,
            lines,
            what,
            last_words: Some(last_words),
        })
    }

    /// Starts the listening end of a TCP connection that needs no name server; also returns its
    /// port.
    pub(crate) fn listener(
        &self,
        side: Side,
        words: &[&str],
    ) -> Result<(Running, String), Failure> {
        let mut running = self.start(side, words)?;
        let ready = running.line_starting("ready")?;
        let port = ready.trim_start_matches("ready").trim().to_owned();
        Ok((running, port))
    }

    pub(crate) fn server(&self, side: Side, what: &str) -> Result<(Running, String), Failure> {
        let name = self.name();
        let mut running = self.start(side, &[what, &name])?;
        running.line_starting("ready")?;
        Ok((running, name))
    }
}

/// A running peer, which ends when this is dropped.
pub(crate) struct Running {
    child: Child,
    lines: Receiver<String>,
    /// Its side and arguments.
    what: String,
    /// The last lines of its log, once it has ended.
    last_words: Option<JoinHandle<Option<String>>>,
}

impl Running {
    pub(crate) fn line_starting(&mut self, start: &str) -> Result<String, Failure> {
        loop {
            let line = self.lines.recv_timeout(OUTPUT_TIMEOUT).map_err(|error| {
                let what = &self.what;
                match error {
                    RecvTimeoutError::Timeout => {
                        format!("{what}: said nothing for {OUTPUT_TIMEOUT:?}")
                    }
                    RecvTimeoutError::Disconnected => {
                        let words = self.last_words.take().map(JoinHandle::join);
                        let words = words.and_then(Result::ok).flatten();
                        format!(
                            "{what}: ended early: {}",
                            words.as_deref().unwrap_or("no word")
                        )
                    }
                }
            })?;
            if line.starts_with(start) {
                return Ok(line);
            }
        }
    }

    /// Returns the next numbers; skips stock's log lines between them.
    pub(crate) fn numbers(&mut self, n: usize) -> Result<Vec<f64>, Failure> {
        let mut numbers = Vec::with_capacity(n);
        while numbers.len() < n {
            let line = self.line_starting("")?;
            if let Ok(number) = line.trim().parse() {
                numbers.push(number);
            }
        }
        Ok(numbers)
    }

    /// Asks a counting peer to answer once it has read `goal` messages; returns its count.
    pub(crate) fn count(&mut self, goal: u32) -> Result<f64, Failure> {
        let input = self.child.stdin.as_mut().expect("piped");
        writeln!(input, "{goal}")?;
        input.flush()?;
        Ok(self.numbers(1)?[0])
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // Closes its input; a process that does not end by itself is killed.
        drop(self.child.stdin.take());
        for _ in 0..100 {
            if matches!(self.child.try_wait(), Ok(Some(_)) | Err(_)) {
                return;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
