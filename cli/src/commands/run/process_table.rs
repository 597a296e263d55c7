//! Table of the commands that a server has started.

use std::io::PipeReader;
use std::process::{Child, ChildStderr, ChildStdin, Command, ExitStatus};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rustix::io::Errno;
use rustix::process::{Pid, Signal, WaitId, WaitIdOptions, kill_process_group, waitid};
use tokio::sync::oneshot;
use yarp_wire::{Bottle, Value};

use super::launch::{self, Launch};
use super::note;
use super::orphan_guard::{self, OrphanGuard};
use super::output_log::OutputLog;

/// Maximum number of commands and terminals that run concurrently.
const MAX_PROCESSES: usize = 256;

/// Running commands.
pub(super) struct Processes {
    state: Mutex<State>,
    log: OutputLog,
}

struct State {
    running: Vec<Process>,
    /// Groups whose command has ended, but not all of its children.
    left: Vec<Pid>,
    /// `None` once the server ends: then nothing is started any more.
    guard: Option<OrphanGuard>,
}

struct Process {
    pid: Pid,
    launch: Launch,
    kind: Kind,
    /// Gets the exit status, if it is known.
    ended: oneshot::Sender<Option<ExitStatus>>,
}

#[derive(Debug)]
enum Kind {
    Command,
    Terminal(Window),
}

/// A terminal that shows the input and output of a command.
#[derive(Debug, PartialEq)]
pub(super) struct Window {
    /// Prefix of the ports of the command.
    pub(super) session: String,
    /// True if only its user closes it.
    pub(super) hold: bool,
}

/// A command with a terminal, which has started.
#[derive(Debug)]
pub(super) struct Piped {
    pub(super) pid: Pid,
    pub(super) input: ChildStdin,
    pub(super) output: PipeReader,
    pub(super) ended: oneshot::Receiver<Option<ExitStatus>>,
}

/// A terminal that has started.
#[derive(Debug)]
pub(super) struct StartedTerminal {
    pub(super) pid: Pid,
    pub(super) errors: Option<ChildStderr>,
    pub(super) ended: oneshot::Receiver<Option<ExitStatus>>,
}

impl Processes {
    pub(super) fn new(guard: OrphanGuard, log: OutputLog) -> Self {
        let state = State {
            running: Vec::new(),
            left: Vec::new(),
            guard: Some(guard),
        };
        Self {
            state: Mutex::new(state),
            log,
        }
    }

    /// Starts a command; returns its process id, or an error message.
    pub(super) fn start(self: &Arc<Self>, launch: Launch) -> Result<Pid, String> {
        let mut state = self.lock_with_room()?;
        let (child, output) = launch.spawn()?;
        let log = launch.logger.clone().zip(output);
        let command = launch.command.clone();
        let (pid, _) = self.adopt(&mut state, child, launch, Kind::Command)?;
        if let Some((logger, output)) = log {
            self.log.forward(output, &command, pid, &logger);
        }
        Ok(pid)
    }

    /// Starts a command with a terminal; returns its pipes, or an error message.
    pub(super) fn start_piped(self: &Arc<Self>, mut launch: Launch) -> Result<Piped, String> {
        launch.terminal = true;
        let mut state = self.lock_with_room()?;
        let (mut child, output) = launch.spawn()?;
        let input = child.stdin.take();
        let (pid, ended) = self.adopt(&mut state, child, launch, Kind::Command)?;
        match (input, output) {
            (Some(input), Some(output)) => Ok(Piped {
                pid,
                input,
                output,
                ended,
            }),
            _ => Err("Can't execute command because it has no pipes".to_owned()),
        }
    }

    /// Starts a terminal; returns what tells of its end, or an error message.
    pub(super) fn start_terminal(
        self: &Arc<Self>,
        command: &mut Command,
        tag: &str,
        window: Window,
    ) -> Result<StartedTerminal, String> {
        let mut state = self.lock_with_room()?;
        let mut child = command
            .spawn()
            .map_err(|error| format!("Can't execute command because {}", launch::reason(&error)))?;
        let errors = child.stderr.take();
        let launch = Launch {
            tag: tag.to_owned(),
            ..Launch::default()
        };
        let (pid, ended) = self.adopt(&mut state, child, launch, Kind::Terminal(window))?;
        Ok(StartedTerminal { pid, errors, ended })
    }

    /// Returns the log of commands.
    pub(super) fn log(&self) -> &OutputLog {
        &self.log
    }

    /// Locks the table for one more process; or returns an error message.
    fn lock_with_room(&self) -> Result<MutexGuard<'_, State>, String> {
        let state = self.lock();
        if state.guard.is_none() {
            return Err("Can't execute command because the server is shutting down".to_owned());
        }
        if state.running.len() >= MAX_PROCESSES {
            return Err(format!(
                "Can't execute command because {MAX_PROCESSES} are running"
            ));
        }
        Ok(state)
    }

    /// Adds a process that has started.
    fn adopt(
        self: &Arc<Self>,
        state: &mut State,
        mut child: Child,
        launch: Launch,
        kind: Kind,
    ) -> Result<(Pid, oneshot::Receiver<Option<ExitStatus>>), String> {
        let Some(pid) = i32::try_from(child.id()).ok().and_then(Pid::from_raw) else {
            let _ = child.kill();
            let _ = child.wait();
            return Err("Can't execute command because its process id is unknown".to_owned());
        };
        if let Some(guard) = &mut state.guard {
            guard.watch(pid);
        }
        let (ended, receiver) = oneshot::channel();
        state.running.push(Process {
            pid,
            launch,
            kind,
            ended,
        });
        let processes = self.clone();
        // The thread ends with the process.
        std::thread::spawn(move || processes.reap(pid, child));
        Ok((pid, receiver))
    }

    /// Waits for the end of a process, and removes it.
    fn reap(&self, pid: Pid, mut child: Child) {
        let ended = WaitIdOptions::EXITED | WaitIdOptions::NOWAIT;
        while matches!(waitid(WaitId::Pid(pid), ended), Err(Errno::INTR)) {}
        let mut state = self.lock();
        // From here on the process id may be reused: no holder of the lock sends it a signal.
        let status = child.wait().ok();
        for process in state.running.extract_if(.., |process| process.pid == pid) {
            // Nobody may wait for it.
            let _ = process.ended.send(status);
        }
        state.left.push(pid);
        state.prune();
        note(format_args!("CLEANUP cmd {}", pid.as_raw_nonzero()));
    }

    /// Closes the terminals with a tag, or that of one session alone, unless they are held.
    pub(super) fn close_terminals(&self, tag: &str, session: Option<&str>) {
        self.send_signal(Signal::TERM, |process| match &process.kind {
            Kind::Command => false,
            Kind::Terminal(window) => {
                let is_meant = session.is_none_or(|session| session == window.session);
                process.launch.tag == tag && is_meant && !window.hold
            }
        });
    }

    /// Ends the terminal of a session, whether it is held or not.
    pub(super) fn end_terminal(&self, session: &str) {
        self.send_signal(Signal::TERM, |process| match &process.kind {
            Kind::Command => false,
            Kind::Terminal(window) => window.session == session,
        });
    }

    /// Sends a signal to all commands with a tag, or to all; returns their number.
    pub(super) fn signal(&self, tag: Option<&str>, signal: Signal) -> usize {
        self.send_signal(signal, |process| {
            process.is_command() && tag.is_none_or(|tag| process.launch.tag == tag)
        })
    }

    fn send_signal(&self, signal: Signal, wanted: impl Fn(&Process) -> bool) -> usize {
        let mut state = self.lock();
        state.prune();
        let mut count = 0;
        for process in state.running.iter().filter(|process| wanted(process)) {
            let Process { pid, launch, .. } = process;
            note(format_args!(
                "SIGNAL {} ({})",
                launch.tag,
                pid.as_raw_nonzero()
            ));
            // The process may have ended without being reaped yet.
            let _ = kill_process_group(*pid, signal);
            count += 1;
        }
        count
    }

    /// Returns true if a command with this tag runs.
    pub(super) fn is_running(&self, tag: &str) -> bool {
        let state = self.lock();
        state
            .running
            .iter()
            .any(|process| process.is_command() && process.launch.tag == tag)
    }

    /// Returns all commands in the form of `ps`.
    pub(super) fn list(&self) -> Bottle {
        let state = self.lock();
        let shown = |Process { pid, launch, .. }: &Process| {
            let pair =
                |name: &str, value: Value| Value::List([name.into(), value].into_iter().collect());
            Value::List(Bottle::from_iter([
                pair("pid", Value::Int32(pid.as_raw_nonzero().get())),
                pair("tag", launch.tag.as_str().into()),
                pair("status", "running".into()),
                pair("cmd", launch.command.as_str().into()),
                pair("env", launch.environment.as_str().into()),
            ]))
        };
        let commands = state.running.iter().filter(|process| process.is_command());
        commands.map(shown).collect()
    }

    /// Ends all commands and their children, and waits for them.
    pub(super) async fn end(&self) {
        let guard = self.lock().guard.take();
        if let Some(guard) = guard {
            guard.end().await;
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Process {
    fn is_command(&self) -> bool {
        matches!(self.kind, Kind::Command)
    }
}

impl State {
    /// Removes groups that have ended: their ids may be reused.
    fn prune(&mut self) {
        let Self { left, guard, .. } = self;
        left.retain(|group| {
            let exists = orphan_guard::exists(*group);
            if !exists && let Some(guard) = guard {
                guard.unwatch(*group);
            }
            exists
        });
    }
}
