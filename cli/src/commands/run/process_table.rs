//! Table of the commands that a server has started.

use std::process::Child;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rustix::io::Errno;
use rustix::process::{Pid, Signal, WaitId, WaitIdOptions, kill_process_group, waitid};
use yarp_wire::{Bottle, Value};

use super::launch::Launch;
use super::note;
use super::orphan_guard::{self, OrphanGuard};
use super::output_log::OutputLog;

/// Maximum number of commands that run concurrently.
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
        let mut state = self.lock();
        let State { running, guard, .. } = &mut *state;
        let Some(guard) = guard else {
            return Err("Can't execute command because the server is shutting down".to_owned());
        };
        if running.len() >= MAX_PROCESSES {
            return Err(format!(
                "Can't execute command because {MAX_PROCESSES} are running"
            ));
        }
        let (mut child, output) = launch.spawn()?;
        let Some(pid) = i32::try_from(child.id()).ok().and_then(Pid::from_raw) else {
            let _ = child.kill();
            let _ = child.wait();
            return Err("Can't execute command because its process id is unknown".to_owned());
        };
        guard.watch(pid);
        if let (Some(output), Some(logger)) = (output, &launch.logger) {
            self.log.forward(output, &launch.command, pid, logger);
        }
        running.push(Process { pid, launch });
        let processes = self.clone();
        // The task ends with the command.
        std::thread::spawn(move || processes.reap(pid, child));
        Ok(pid)
    }

    /// Waits for the end of a command, and removes it.
    fn reap(&self, pid: Pid, mut child: Child) {
        let ended = WaitIdOptions::EXITED | WaitIdOptions::NOWAIT;
        while matches!(waitid(WaitId::Pid(pid), ended), Err(Errno::INTR)) {}
        let mut state = self.lock();
        // From here on the process id may be reused: no holder of the lock sends it a signal.
        let _ = child.wait();
        state.running.retain(|process| process.pid != pid);
        state.left.push(pid);
        state.prune();
        note(format_args!("CLEANUP cmd {}", pid.as_raw_nonzero()));
    }

    /// Sends a signal to all commands with a tag, or to all; returns their number.
    pub(super) fn signal(&self, tag: Option<&str>, signal: Signal) -> usize {
        let mut state = self.lock();
        state.prune();
        let wanted = |process: &&Process| tag.is_none_or(|tag| process.launch.tag == tag);
        let mut count = 0;
        for Process { pid, launch } in state.running.iter().filter(wanted) {
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
            .any(|process| process.launch.tag == tag)
    }

    /// Returns all commands in the form of `ps`.
    pub(super) fn list(&self) -> Bottle {
        let state = self.lock();
        let shown = |Process { pid, launch }: &Process| {
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
        state.running.iter().map(shown).collect()
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
