//! Runs the `yarp` command with its own configuration.

#![allow(
    dead_code,
    reason = "each test file is a program of its own and uses a part"
)]

use std::io::{BufRead, BufReader, Write};
use std::net::TcpListener;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Condvar, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Longer than any step takes on a busy machine.
const TIMEOUT: Duration = Duration::from_secs(60);

/// A configuration directory, shared by all commands of a test.
pub(crate) struct Home {
    directory: tempfile::TempDir,
    /// Base of the TCP ports, far from those of other tests and networks.
    range: u16,
}

/// Output and exit code of a command.
#[derive(Debug)]
pub(crate) struct Ended {
    pub(crate) code: Option<i32>,
    pub(crate) out: Vec<String>,
    pub(crate) err: Vec<String>,
}

impl Ended {
    /// Asserts that the command ended with `code`.
    #[track_caller]
    pub(crate) fn with(self, code: i32) -> Self {
        assert_eq!(self.code, Some(code), "{self:?}");
        self
    }

    /// Returns true if a line of standard output contains `text`.
    pub(crate) fn says(&self, text: &str) -> bool {
        self.out.iter().any(|line| line.contains(text))
    }

    /// Asserts that a line of standard error contains `text`.
    #[track_caller]
    pub(crate) fn complains(&self, text: &str) {
        let said = self.err.iter().any(|line| line.contains(text));
        assert!(said, "no {text:?} in {self:?}");
    }
}

impl Home {
    /// Creates an empty configuration.
    pub(crate) fn new() -> Self {
        Self {
            directory: tempfile::tempdir().unwrap(),
            range: free_port(),
        }
    }

    pub(crate) fn path(&self) -> &Path {
        self.directory.path()
    }

    /// Returns the default TCP port of servers.
    pub(crate) fn range(&self) -> u16 {
        self.range
    }

    /// Runs `yarp` with these arguments repeatedly until it prints `text`.
    #[track_caller]
    pub(crate) fn run_until(&self, line: &str, text: &str) -> Ended {
        let start = Instant::now();
        loop {
            let ended = self.run(line);
            if ended.says(text) {
                return ended;
            }
            assert!(start.elapsed() < TIMEOUT, "no {text:?}: {ended:?}");
        }
    }

    /// Returns the content of a configuration file, if it exists.
    pub(crate) fn file(&self, name: &str) -> Option<String> {
        std::fs::read_to_string(self.path().join(name)).ok()
    }

    /// Starts `yarp` with these arguments, separated by blanks.
    pub(crate) fn start(&self, line: &str) -> Running {
        let mut command = Command::new(env!("CARGO_BIN_EXE_yarp"));
        command.args(line.split_whitespace());
        self.spawn(command, line)
    }

    /// Starts a command that executes `yarp` with this configuration.
    pub(crate) fn spawn(&self, mut command: Command, line: &str) -> Running {
        let mut child = self
            .prepare(&mut command)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let out = Watched::of(child.stdout.take().unwrap());
        let err = Watched::of(child.stderr.take().unwrap());
        Running {
            line: line.to_owned(),
            child,
            out,
            err,
        }
    }

    /// Gives a command the environment of this home.
    pub(crate) fn prepare<'a>(&self, command: &'a mut Command) -> &'a mut Command {
        command
            .env("YARP_CONFIG_HOME", self.path())
            // Files of the user must not be read.
            .env("YARP_DATA_HOME", self.path().join("data"))
            .env("YARP_PORT_RANGE", self.range.to_string())
            .env_remove("YARP_NAMESPACE")
            .env_remove("YARP_PORT_PREFIX")
            .env_remove("YARP_IP")
            .env_remove("YARP_QUIET")
    }

    /// Runs `yarp` with these arguments and `input` on standard input.
    pub(crate) fn run_with(&self, line: &str, input: &str) -> Ended {
        let mut running = self.start(line);
        running.type_text(input);
        running.finish()
    }

    /// Runs `yarp` with these arguments.
    pub(crate) fn run(&self, line: &str) -> Ended {
        self.run_with(line, "")
    }

    /// Starts a name server for the other commands of this configuration.
    pub(crate) fn serve(&self) -> Running {
        self.serve_with("")
    }

    /// Starts a name server with further options.
    pub(crate) fn serve_with(&self, options: &str) -> Running {
        let mut last = None;
        for _ in 0..5 {
            let port = free_port();
            let words = format!("server --ip 127.0.0.1 --socket {port} --write {options}");
            let mut server = self.start(&words);
            if server.sees("Ok. Ready!") {
                return server;
            }
            // Another program took the port.
            last = Some(server.finish());
        }
        panic!("no name server starts: {last:?}");
    }

    /// Returns the TCP port in the configuration.
    pub(crate) fn server_port(&self) -> u16 {
        let place = self.file("yarp.conf").unwrap();
        place.split_whitespace().nth(1).unwrap().parse().unwrap()
    }

    /// Returns the names that the name server knows, except its own.
    pub(crate) fn names(&self) -> Vec<String> {
        let list = self.run("name list").with(0);
        let words = list.out.iter().map(|line| line.split(' '));
        let names = words.filter_map(|mut words| words.nth(2).map(str::to_owned));
        names
            .filter(|name| name.starts_with('/') && name != "/root")
            .collect()
    }
}

/// Returns a free TCP port.
fn free_port() -> u16 {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    listener.local_addr().unwrap().port()
}

/// A running command. Dropping it kills it.
pub(crate) struct Running {
    line: String,
    child: Child,
    out: Watched,
    err: Watched,
}

impl Running {
    /// Waits until a line of standard output contains `text`; returns false if none does before the
    /// timeout.
    pub(crate) fn sees(&mut self, text: &str) -> bool {
        self.sees_within(text, TIMEOUT)
    }

    /// Waits like [`Running::sees`], at most for `timeout`.
    pub(crate) fn sees_within(&mut self, text: &str, timeout: Duration) -> bool {
        self.out.wait(|line| line.contains(text), timeout)
    }

    /// Waits until `count` lines of standard output are `text`.
    #[track_caller]
    pub(crate) fn see_often(self, text: &str, count: usize) -> Self {
        let often = |lines: &[String]| lines.iter().filter(|line| *line == text).count() >= count;
        let seen = self.out.wait_for(often, TIMEOUT);
        assert!(
            seen,
            "{}: not {count} times {text:?} in {:?}",
            self.line,
            self.out.lines()
        );
        self
    }

    /// Returns the output so far.
    pub(crate) fn printed(&self) -> Vec<String> {
        self.out.lines()
    }

    /// Returns what it wrote to standard error so far.
    pub(crate) fn logged(&self) -> Vec<String> {
        self.err.lines()
    }

    /// Writes `text` as a line repeatedly until `reader` prints it.
    #[track_caller]
    pub(crate) fn reaches(&mut self, reader: &mut Self, text: &str) {
        let deadline = Instant::now() + TIMEOUT;
        while !reader.sees_within(text, Duration::from_millis(300)) {
            let (out, err) = (reader.out.lines(), reader.err.lines());
            assert!(
                Instant::now() < deadline,
                "{}: {out:?} {err:?}",
                reader.line
            );
            self.type_text(&format!("{text}\n"));
        }
    }

    /// Returns the process id.
    pub(crate) fn id(&self) -> u32 {
        self.child.id()
    }

    /// Asserts [`Running::sees`].
    #[track_caller]
    pub(crate) fn see(mut self, text: &str) -> Self {
        let seen = self.sees(text);
        let (out, err) = (self.out.lines(), self.err.lines());
        assert!(seen, "{}: no {text:?} in {out:?} {err:?}", self.line);
        self
    }

    /// Writes to its standard input.
    pub(crate) fn type_text(&mut self, text: &str) {
        let input = self.child.stdin.as_mut().unwrap();
        // Some commands end before they have read everything.
        let _ = input
            .write_all(text.as_bytes())
            .and_then(|()| input.flush());
    }

    /// Kills it without an orderly end.
    pub(crate) fn kill(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// Sends a signal.
    #[cfg(unix)]
    pub(crate) fn signal(self, name: &str) -> Self {
        let id = self.child.id().to_string();
        let sent = Command::new("kill")
            .args(["-s", name, &id])
            .status()
            .unwrap();
        assert!(sent.success());
        self
    }

    /// Closes its input and waits for its end.
    pub(crate) fn finish(mut self) -> Ended {
        drop(self.child.stdin.take());
        let deadline = Instant::now() + TIMEOUT;
        let status = loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                break status;
            }
            let (out, err) = (self.out.lines(), self.err.lines());
            assert!(Instant::now() < deadline, "{}: {out:?} {err:?}", self.line);
            std::thread::sleep(Duration::from_millis(5));
        };
        self.out.join();
        self.err.join();
        Ended {
            code: status.code(),
            out: self.out.lines(),
            err: self.err.lines(),
        }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Output collected by a thread.
#[derive(Default)]
struct Collected {
    lines: Vec<String>,
    ended: bool,
}

/// Lines that a thread collects when they arrive.
struct Watched {
    state: Arc<(Mutex<Collected>, Condvar)>,
    thread: Option<JoinHandle<()>>,
}

impl Watched {
    fn of(stream: impl std::io::Read + Send + 'static) -> Self {
        let state = Arc::<(Mutex<Collected>, Condvar)>::default();
        let theirs = state.clone();
        let thread = std::thread::spawn(move || {
            let (collected, changed) = &*theirs;
            for line in BufReader::new(stream).split(b'\n').map_while(Result::ok) {
                let line = String::from_utf8_lossy(&line)
                    .trim_end_matches('\r')
                    .to_owned();
                collected.lock().unwrap().lines.push(line);
                changed.notify_all();
            }
            collected.lock().unwrap().ended = true;
            changed.notify_all();
        });
        Self {
            state,
            thread: Some(thread),
        }
    }

    fn wait(&self, matches: impl Fn(&str) -> bool, timeout: Duration) -> bool {
        self.wait_for(|lines| lines.iter().any(|line| matches(line)), timeout)
    }

    fn wait_for(&self, found: impl Fn(&[String]) -> bool, timeout: Duration) -> bool {
        let (collected, changed) = &*self.state;
        let waiting = changed.wait_timeout_while(collected.lock().unwrap(), timeout, |state| {
            !state.ended && !found(&state.lines)
        });
        found(&waiting.unwrap().0.lines)
    }

    fn lines(&self) -> Vec<String> {
        self.state.0.lock().unwrap().lines.clone()
    }

    fn join(&mut self) {
        if let Some(thread) = self.thread.take() {
            thread.join().unwrap();
        }
    }
}
