//! The guard: a process beside the server that ends all remaining commands when the server ends,
//! however it ended.

use std::collections::BTreeSet;
use std::io::Write;
use std::os::unix::process::CommandExt;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::time::Duration;
use std::{env, io};

use rustix::process::{Pid, Signal, kill_process_group, test_kill_process_group};
use tokio::time::{Instant, sleep};

use super::GUARD_ARGUMENT;
use crate::network_access::FOREVER;
use crate::signals::Interrupt;
use crate::stdin_lines::Lines;

/// Time that a command has to end after SIGTERM, and again after SIGKILL.
const TERMINATION_TIMEOUT: Duration = Duration::from_secs(5);
/// Interval between two checks of the groups.
const POLL_INTERVAL: Duration = Duration::from_millis(20);
/// Maximum time that the guard takes to end.
const GUARD_TIMEOUT: Duration = Duration::from_secs(15);

/// The server's end of its guard.
pub(super) struct OrphanGuard {
    child: Child,
    input: ChildStdin,
}

impl OrphanGuard {
    pub(super) fn start() -> io::Result<Self> {
        let mut child = Command::new(env::current_exe()?)
            .args(["run", &format!("--{GUARD_ARGUMENT}")])
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            // Ctrl-C does not reach the guard.
            .process_group(0)
            .spawn()?;
        let input = child.stdin.take();
        let input =
            input.ok_or_else(|| io::Error::other("the process guard has no standard input"))?;
        Ok(Self { child, input })
    }

    /// Adds a process group that the guard ends when the server ends.
    pub(super) fn watch(&mut self, group: Pid) {
        self.send('+', group);
    }

    /// Removes a process group that has ended; its id may be reused.
    pub(super) fn unwatch(&mut self, group: Pid) {
        self.send('-', group);
    }

    fn send(&mut self, sign: char, group: Pid) {
        let line = format!("{sign}{}\n", group.as_raw_nonzero());
        if let Err(error) = self.input.write_all(line.as_bytes()) {
            tracing::error!(target: "yarp.run", "the process guard is gone: commands may outlive this server: {error}");
        }
    }

    /// Ends all groups, and waits for the guard.
    pub(super) async fn end(self) {
        let Self { mut child, input } = self;
        drop(input);
        let deadline = Instant::now() + GUARD_TIMEOUT;
        while matches!(child.try_wait(), Ok(None)) {
            if Instant::now() > deadline {
                // The guard has ended, or will.
                let _ = child.kill();
                let _ = child.wait();
                return;
            }
            sleep(POLL_INTERVAL).await;
        }
    }
}

/// Runs the guard: collects groups until its standard input ends, then ends them.
pub(super) async fn run() {
    // Signals are handled by the server.
    let _deaf = Interrupt::listen_with(u32::MAX, FOREVER);
    let mut lines = Lines::open();
    let mut groups = BTreeSet::new();
    while let Some(line) = lines.next().await {
        let (sign, number) = line.split_at(line.len().min(1));
        match (sign, number.parse()) {
            ("+", Ok(number)) => drop(groups.insert(number)),
            ("-", Ok(number)) => drop(groups.remove(&number)),
            _ => {}
        }
    }
    // Group 1 would mean every process.
    let groups = groups.into_iter().filter(|number: &i32| *number > 1);
    end(&groups.filter_map(Pid::from_raw).collect::<Vec<_>>()).await;
}

/// Sends SIGTERM to groups, kills those that remain, and waits for both.
async fn end(groups: &[Pid]) {
    for signals in [&[Signal::TERM, Signal::CONT][..], &[Signal::KILL]] {
        for group in groups {
            for signal in signals {
                // The group may have ended.
                let _ = kill_process_group(*group, *signal);
            }
        }
        let deadline = Instant::now() + TERMINATION_TIMEOUT;
        while groups.iter().any(|group| exists(*group)) && Instant::now() < deadline {
            sleep(POLL_INTERVAL).await;
        }
    }
}

/// Returns true if a group has any process.
pub(super) fn exists(group: Pid) -> bool {
    test_kill_process_group(group).is_ok()
}
